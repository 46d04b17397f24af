//! The consistent mass on the pairs of coupled nodes; it is the same along each axis.

use crate::assembly::{System, UNCOUPLED};
use crate::basis::Connectivity;
use crate::linear::Block;
use crate::points::Points;
use crate::terms::ghost::Ghost;

/// The mass of this rank, [mass], by the indices of the blocks of a system.
pub(super) struct Mass(Vec<f64>);

impl Mass {
    /// Σ m_p S_p S_pᵀ of the points, and the ghost mass of the faces.
    pub(super) fn new<const D: usize, const N: usize>(
        links: &Connectivity<D>,
        points: &Points<D>,
        ghost: &Ghost,
        sum: &System<N>,
    ) -> Mass {
        let pairs = &sum.pairs;
        let mut mass = vec![0.0; pairs.n_pairs()];
        let (mut dense, mut touched) = (Vec::new(), Vec::new());
        for group in 0..links.n_groups() {
            let (n, positions) = (links.nodes_of(group).len(), pairs.positions(group));
            dense.clear();
            dense.resize(positions.len(), 0.0);
            for p in links.points_of(group) {
                touched.clear();
                links.for_each_value(p, |local, value| touched.push((local, value)));
                for &(row, value) in &touched {
                    let share = points.mass[p] * value;
                    for &(column, value) in &touched {
                        if !pairs.symmetric() {
                            dense[row * n + column] += share * value;
                        } else if column <= row {
                            dense[row * (row + 1) / 2 + column] += share * value;
                        }
                    }
                }
            }
            for (position, dense) in positions.iter().zip(&dense) {
                if *position != UNCOUPLED {
                    mass[*position as usize] += dense;
                }
            }
        }
        for (places, entry) in ghost.places_in(sum).iter().zip(ghost.entries()) {
            for &place in places.iter().flatten() {
                mass[place] += entry;
            }
        }
        Mass(mass)
    }

    /// Adds the product of the mass and a nodal field to `out`; the sum over the ranks remains to be formed.
    pub(super) fn multiply<const N: usize>(&self, sum: &System<N>, x: &[[f64; N]], out: &mut [[f64; N]]) {
        let symmetric = sum.is_symmetric();
        sum.pairs.for_each(|row, column, place| {
            let mass = self.0[place];
            for c in 0..N {
                out[row][c] += mass * x[column][c];
            }
            if symmetric && row != column {
                for c in 0..N {
                    out[column][c] += mass * x[row][c];
                }
            }
        });
    }

    /// Diagonal of the mass, on this rank.
    pub(super) fn diagonal<const N: usize>(&self, sum: &System<N>, n: usize) -> Vec<f64> {
        let mut diagonal = vec![0.0; n];
        sum.pairs.for_each(|row, column, place| {
            if row == column {
                diagonal[row] = self.0[place];
            }
        });
        diagonal
    }

    /// Adds a multiple of the mass to the stiffness between displacements.
    pub(super) fn add<const D: usize, const N: usize>(&self, factor: f64, sum: &mut System<N>) {
        for (block, mass) in sum.blocks.iter_mut().zip(&self.0) {
            (0..D).for_each(|d| block[d][d] += factor * mass);
        }
    }
}

/// Adds `factor` times the product of blocks of a system and a nodal field to `out`, on this rank.
pub(super) fn multiply_blocks<const N: usize>(
    sum: &System<N>,
    blocks: &[Block<N>],
    factor: f64,
    x: &[[f64; N]],
    out: &mut [[f64; N]],
) {
    let symmetric = sum.is_symmetric();
    sum.pairs.for_each(|row, column, place| {
        let block = &blocks[place];
        for i in 0..N {
            for k in 0..N {
                out[row][i] += factor * block[i][k] * x[column][k];
                if symmetric && row != column {
                    out[column][k] += factor * block[i][k] * x[row][i];
                }
            }
        }
    });
}
