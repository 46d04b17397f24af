//! One level of the hierarchy: its matrix, scaled to entries of about one, and the smoother.

use pulp::Arch;

use super::super::LinearError;
use super::super::blocks::{Block, BlockMatrix};
use super::super::lattice::{Lattice, Transfer};
use super::rows::{Rows, in_parts};

/// Smallest pivot of a scaled diagonal block; smaller ones are replaced by it. The iterations around the cycle resolve
/// such weak motions.
const WEAKEST: f64 = 1e-4;

/// Entries of a row that fit into working space without allocation.
const NEAR: usize = 3 * 343 + 4;

/// A level: Â = S A S with the matrix A of the level and a diagonal S that makes the entries about one, however little
/// of a cell a body fills. Held degrees of freedom have only a one on the diagonal.
#[derive(Debug, Clone)]
pub(super) struct Level<const D: usize, const N: usize> {
    pub lattice: Lattice<D>,
    pub rows: Rows<N>,
    /// The diagonal of S, zero where held.
    pub scale: Vec<[f64; N]>,
    /// Its inverse, zero where held.
    unscale: Vec<[f64; N]>,
    /// Degrees of freedom that are prescribed.
    held: Vec<[bool; N]>,
    /// Inverses of the diagonal blocks of Â.
    inverse: Vec<Block<N>>,
    colours: Vec<Vec<u32>>,
    pub x: Vec<[f64; N]>,
    pub b: Vec<[f64; N]>,
    /// Residual, or the new values of one colour.
    work: Vec<[f64; N]>,
}

impl<const D: usize, const N: usize> Level<D, N> {
    fn new(lattice: Lattice<D>, rows: Rows<N>, held: Vec<[bool; N]>) -> Self {
        let zero = vec![[0.0; N]; lattice.len()];
        Level {
            colours: lattice.colours(),
            scale: zero.clone(),
            unscale: zero.clone(),
            inverse: vec![[[0.0; N]; N]; lattice.len()],
            x: zero.clone(),
            b: zero.clone(),
            work: zero,
            lattice,
            rows,
            held,
        }
    }

    /// The finest level.
    pub(super) fn finest(lattice: Lattice<D>, matrix: &BlockMatrix<N>, held: Vec<[bool; N]>) -> Self {
        let n = lattice.len();
        let mut start = vec![0; n + 1];
        for c in 0..n {
            for &row in &matrix.row[matrix.column_start[c]..matrix.column_start[c + 1]] {
                start[row as usize + 1] += 1;
                start[c + 1] += usize::from(row as usize != c);
            }
        }
        for r in 0..n {
            start[r + 1] += start[r];
        }
        let mut next = start.clone();
        let mut column = vec![0; start[n]];
        for c in 0..n {
            // The rows above the diagonal have come with the columns before.
            for &row in &matrix.row[matrix.column_start[c]..matrix.column_start[c + 1]] {
                column[next[row as usize]] = c as u32;
                next[row as usize] += 1;
                if row as usize != c {
                    column[next[c]] = row;
                    next[c] += 1;
                }
            }
        }
        Level::new(lattice, Rows::new(start, column), held)
    }

    /// The level above this one.
    pub(super) fn coarser(&self) -> (Level<D, N>, Transfer) {
        let (lattice, transfer) = self.lattice.coarsen();
        let mut held = vec![[false; N]; lattice.len()];
        let (mut start, mut column) = (vec![0], Vec::new());
        for (n, place) in lattice.place.iter().enumerate() {
            // A node at the place of a held fine node is held in the same way.
            for &(child, weight) in transfer.children(n) {
                if weight == 1.0 {
                    held[n] = self.held[child as usize];
                }
            }
            lattice.for_each_near(*place, lattice.reach, |near| column.push(near));
            start.push(column.len());
        }
        (Level::new(lattice, Rows::new(start, column), held), transfer)
    }

    /// True if this is the finest level of such a system.
    pub(super) fn is_of(&self, lattice: &Lattice<D>, matrix: &BlockMatrix<N>, held: &[[bool; N]]) -> bool {
        let same_columns = || {
            (0..self.rows.len()).all(|c| {
                let columns = self.rows.columns(c);
                let below = columns.partition_point(|&other| (other as usize) < c);
                columns[below..] == matrix.row[matrix.column_start[c]..matrix.column_start[c + 1]]
            })
        };
        self.held == held && self.lattice == *lattice && same_columns()
    }

    /// Takes the values of the matrix; returns true if its whole diagonal is positive.
    ///
    /// # Errors
    /// [`LinearError::Singular`] if a free degree of freedom has no stiffness.
    pub(super) fn take(&mut self, matrix: &BlockMatrix<N>) -> Result<bool, LinearError> {
        let mut positive = true;
        for n in 0..self.lattice.len() {
            let places = matrix.column_start[n]..matrix.column_start[n + 1];
            let own =
                (matrix.row.get(places.start) == Some(&(n as u32))).then(|| &matrix.blocks[places.start]);
            for d in 0..N {
                if self.held[n][d] {
                    continue;
                }
                let stiffness = own.map_or(0.0, |block| block[d][d]);
                if stiffness == 0.0 || !stiffness.is_finite() {
                    return Err(LinearError::Singular { unknown: None });
                }
                positive &= stiffness > 0.0;
                self.unscale[n][d] = stiffness.abs().sqrt();
                self.scale[n][d] = 1.0 / self.unscale[n][d];
            }
        }
        let scale = &self.scale;
        self.rows.fill(&|piece| {
            piece.for_each(|row, columns, values| {
                let width = values.len() / N;
                for (k, &column) in columns.iter().enumerate() {
                    let (row, column) = (row as u32, column);
                    let (low, high) = (row.min(column), row.max(column));
                    let places = matrix.column_start[low as usize]..matrix.column_start[low as usize + 1];
                    let Ok(at) = matrix.row[places.clone()].binary_search(&high) else { continue };
                    let block = &matrix.blocks[places.start + at];
                    for i in 0..N {
                        for j in 0..N {
                            let entry = if row >= column { block[i][j] } else { block[j][i] };
                            let scaled = entry * scale[row as usize][i] * scale[column as usize][j];
                            values[i * width + k * N + j] = scaled as f32;
                        }
                    }
                }
                own_entries(row, columns, &scale[row], values);
            });
        });
        self.invert();
        Ok(positive)
    }

    /// Takes the values of the Galerkin product Tᵀ A T of a finer level.
    pub(super) fn take_product(&mut self, fine: &Level<D, N>, transfer: &Transfer) {
        for n in 0..self.lattice.len() {
            let mut stiffness = [0.0; N];
            for &(child, weight) in transfer.children(n) {
                for d in 0..N {
                    stiffness[d] += (f64::from(weight) * fine.unscale[child as usize][d]).powi(2);
                }
            }
            for d in 0..N {
                let free = !self.held[n][d] && stiffness[d] > 0.0;
                self.unscale[n][d] = if free { stiffness[d].sqrt() } else { 0.0 };
                self.scale[n][d] = if free { 1.0 / self.unscale[n][d] } else { 0.0 };
            }
        }
        let stencil = Stencil::new(&self.lattice);
        let scale = &self.scale;
        self.rows.fill(&|piece| {
            let mut sum = vec![[[0.0; N]; N]; stencil.len];
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    piece.for_each(|row, columns, values| {
                        stencil.product(fine, transfer, row, &mut sum);
                        let width = values.len() / N;
                        for (k, &column) in columns.iter().enumerate() {
                            let block = &sum[stencil.place(row, column as usize)];
                            for i in 0..N {
                                for j in 0..N {
                                    let scaled = block[i][j] * scale[row][i] * scale[column as usize][j];
                                    values[i * width + k * N + j] = scaled as f32;
                                }
                            }
                        }
                        own_entries(row, columns, &scale[row], values);
                    });
                },
            );
        });
        self.invert();
    }

    fn invert(&mut self) {
        let rows = &self.rows;
        in_parts(0, &mut self.inverse, &|first, part: &mut [Block<N>]| {
            for (k, inverse) in part.iter_mut().enumerate() {
                *inverse = inverse_of(&rows.diagonal(first + k));
            }
        });
    }

    /// One block Gauss–Seidel sweep over the colours, forwards or backwards; `afresh` starts from zero.
    pub(super) fn sweep(&mut self, forwards: bool, afresh: bool) {
        if afresh {
            self.x.fill([0.0; N]);
        }
        let count = self.colours.len();
        for number in 0..count {
            let nodes = &self.colours[if forwards { number } else { count - 1 - number }];
            let (rows, inverse, b, x) = (&self.rows, &self.inverse, &self.b, &self.x);
            let fresh = &mut self.work[..nodes.len()];
            let still_zero = afresh && number == 0;
            in_parts(0, fresh, &|first, part: &mut [[f64; N]]| {
                with_room(
                    rows,
                    #[inline(always)]
                    |room| {
                        for (fresh, &n) in part.iter_mut().zip(&nodes[first..]) {
                            let n = n as usize;
                            let ax = if still_zero { [0.0; N] } else { rows.times(n, x, room) };
                            for i in 0..N {
                                fresh[i] = x[n][i];
                                for k in 0..N {
                                    fresh[i] += inverse[n][i][k] * (b[n][k] - ax[k]);
                                }
                            }
                        }
                    },
                );
            });
            for (fresh, &n) in fresh.iter().zip(nodes) {
                self.x[n as usize] = *fresh;
            }
        }
    }

    /// Passes the residual b − Â x to the coarser level as its right-hand side.
    pub(super) fn restrict(&mut self, transfer: &Transfer, coarse: &mut Level<D, N>) {
        let (rows, b, x) = (&self.rows, &self.b, &self.x);
        in_parts(0, &mut self.work, &|first, part: &mut [[f64; N]]| {
            with_room(
                rows,
                #[inline(always)]
                |room| {
                    for (k, residual) in part.iter_mut().enumerate() {
                        let ax = rows.times(first + k, x, room);
                        for d in 0..N {
                            residual[d] = b[first + k][d] - ax[d];
                        }
                    }
                },
            );
        });
        let (residual, unscale, scale) = (&self.work, &self.unscale, &coarse.scale);
        in_parts(0, &mut coarse.b, &|first, part: &mut [[f64; N]]| {
            for (k, b) in part.iter_mut().enumerate() {
                let mut sum = [0.0; N];
                for &(child, weight) in transfer.children(first + k) {
                    let child = child as usize;
                    for d in 0..N {
                        sum[d] += f64::from(weight) * unscale[child][d] * residual[child][d];
                    }
                }
                *b = std::array::from_fn(|d| sum[d] * scale[first + k][d]);
            }
        });
    }

    /// Adds the correction found on the coarser level.
    pub(super) fn prolong(&mut self, transfer: &Transfer, coarse: &Level<D, N>) {
        let unscale = &self.unscale;
        in_parts(0, &mut self.x, &|first, part: &mut [[f64; N]]| {
            for (k, x) in part.iter_mut().enumerate() {
                for &(parent, weight) in transfer.parents(first + k) {
                    let parent = parent as usize;
                    for d in 0..N {
                        let correction = coarse.scale[parent][d] * coarse.x[parent][d];
                        x[d] += unscale[first + k][d] * f64::from(weight) * correction;
                    }
                }
            }
        });
    }
}

/// Runs `work` with working space for the vector entries of any row.
fn with_room<const N: usize>(rows: &Rows<N>, work: impl FnOnce(&mut [f64])) {
    let width = rows.width();
    let mut near = [0.0; NEAR];
    let mut far = Vec::new();
    let room = if width <= NEAR {
        &mut near[..width]
    } else {
        far.resize(width, 0.0);
        &mut far[..]
    };
    Arch::new().dispatch(
        #[inline(always)]
        || work(room),
    );
}

/// Sets the diagonal to one if a degree of freedom is held.
fn own_entries<const N: usize>(row: usize, columns: &[u32], scale: &[f64; N], values: &mut [f32]) {
    let width = values.len() / N;
    if let Ok(place) = columns.binary_search(&(row as u32)) {
        for d in (0..N).filter(|&d| scale[d] == 0.0) {
            values[d * width + place * N + d] = 1.0;
        }
    }
}

/// Numbers the places around a node of a level.
struct Stencil {
    /// A key of each node; the difference of two keys gives their relative position.
    key: Vec<usize>,
    centre: usize,
    len: usize,
}

impl Stencil {
    fn new<const D: usize>(lattice: &Lattice<D>) -> Self {
        let number = |place: &[u32; D]| {
            (0..D).rev().fold(0, |n, d| n * (2 * lattice.reach[d] as usize + 1) + place[d] as usize)
        };
        let len = lattice.reach.iter().map(|&r| 2 * r as usize + 1).product();
        Stencil { key: lattice.place.iter().map(number).collect(), centre: number(&lattice.reach), len }
    }

    #[inline(always)]
    fn place(&self, row: usize, column: usize) -> usize {
        self.key[column] + self.centre - self.key[row]
    }

    /// Sums up the blocks of a row of Tᵀ A T.
    #[inline(always)]
    fn product<const D: usize, const N: usize>(
        &self,
        fine: &Level<D, N>,
        transfer: &Transfer,
        row: usize,
        sum: &mut [Block<N>],
    ) {
        sum.fill([[0.0; N]; N]);
        for &(child, weight) in transfer.children(row) {
            let n = child as usize;
            let left = fine.unscale[n].map(|u| u * f64::from(weight));
            let components: [&[f32]; N] = std::array::from_fn(|i| fine.rows.component(n, i));
            for (k, &column) in fine.rows.columns(n).iter().enumerate() {
                let right = &fine.unscale[column as usize];
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

/// The inverse of a symmetric block whose pivots are kept away from zero, with the sign of the diagonal.
fn inverse_of<const N: usize>(block: &Block<N>) -> Block<N> {
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
