//! Sums of the Galerkin product Tᵀ A T, and inverses of the diagonal blocks of a level.

use super::super::blocks::Block;
use super::super::lattice::{Lattice, Transfer};
use super::rows::Rows;

/// Smallest magnitude of a pivot of a scaled diagonal block, relative to the diagonal entry, [-]; smaller pivots are
/// replaced by this value, with the sign of the diagonal entry. The outer iterations resolve the weak motions to which
/// such pivots belong.
const WEAKEST: f64 = 1e-4;

/// Numbers the positions around a node of a level.
pub(super) struct Stencil {
    /// A key of each node; the difference between two keys determines the relative position of the nodes.
    key: Vec<usize>,
    centre: usize,
    /// Number of positions.
    pub len: usize,
}

impl Stencil {
    pub(super) fn new<const D: usize>(lattice: &Lattice<D>) -> Self {
        let number = |place: &[u32; D]| {
            (0..D).rev().fold(0, |n, d| n * (2 * lattice.reach[d] as usize + 1) + place[d] as usize)
        };
        let len = lattice.reach.iter().map(|&r| 2 * r as usize + 1).product();
        Stencil { key: lattice.place.iter().map(number).collect(), centre: number(&lattice.reach), len }
    }

    /// The position number of the node of a column, relative to the node of a row.
    #[inline(always)]
    pub(super) fn place(&self, row: usize, column: usize) -> usize {
        self.key[column] + self.centre - self.key[row]
    }

    /// Sums up the blocks of a row of Tᵀ A T.
    #[inline(always)]
    pub(super) fn product<const N: usize>(
        &self,
        rows: &Rows<N>,
        unscale: &[[f64; N]],
        transfer: &Transfer,
        row: usize,
        sum: &mut [Block<N>],
    ) {
        sum.fill([[0.0; N]; N]);
        for &(child, weight) in transfer.children(row) {
            let n = child as usize;
            let left = unscale[n].map(|u| u * f64::from(weight));
            let components: [&[f32]; N] = std::array::from_fn(|i| rows.component(n, i));
            for (k, &column) in rows.columns(n).iter().enumerate() {
                let right = &unscale[column as usize];
                let mut block = [[0.0; N]; N];
                for i in 0..N {
                    for j in 0..N {
                        block[i][j] = left[i] * f64::from(components[i][k * N + j]) * right[j];
                    }
                }
                for &(parent, weight) in transfer.parents(column as usize) {
                    let sum = &mut sum[self.place(row, parent as usize)];
                    let weight = f64::from(weight);
                    for i in 0..N {
                        for j in 0..N {
                            sum[i][j] += weight * block[i][j];
                        }
                    }
                }
            }
        }
    }
}

/// The inverse of a symmetric block, whose pivots are kept away from zero and given the sign of the diagonal entry.
pub(super) fn inverse_of<const N: usize>(block: &Block<N>) -> Block<N> {
    let mut factor = *block; // L below the diagonal, pivots on it
    for k in 0..N {
        let weakest = WEAKEST * block[k][k].abs().max(f64::MIN_POSITIVE);
        factor[k][k] = if block[k][k] < 0.0 { factor[k][k].min(-weakest) } else { factor[k][k].max(weakest) };
        for i in k + 1..N {
            let l = factor[i][k] / factor[k][k];
            for j in k + 1..=i {
                factor[i][j] -= l * factor[j][k];
            }
        }
        for i in k + 1..N {
            factor[i][k] /= factor[k][k];
        }
    }
    let mut inverse = [[0.0; N]; N];
    for c in 0..N {
        let mut x: [f64; N] = std::array::from_fn(|i| f64::from(u8::from(i == c)));
        for i in 0..N {
            for j in 0..i {
                x[i] -= factor[i][j] * x[j];
            }
        }
        for i in (0..N).rev() {
            x[i] /= factor[i][i];
            for j in i + 1..N {
                x[i] -= factor[j][i] * x[j];
            }
        }
        for i in 0..N {
            inverse[i][c] = x[i];
        }
    }
    inverse
}
