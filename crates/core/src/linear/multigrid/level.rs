//! One level of the hierarchy: its matrix, scaled to entries of order one.

use pulp::Arch;

use super::super::LinearError;
use super::super::blocks::{Block, BlockMatrix};
use super::super::lattice::{Lattice, Transfer};
use super::contributions::RowColumns;
use super::rows::{Rows, in_parts};
use super::shared_level::Shared;
use super::stencil::{Stencil, inverse_of};

/// A level: Â = S A S with the matrix A of the level and a diagonal S that makes the entries of order one, even if a
/// body fills only a small part of a cell. Held degrees of freedom have only a one on the diagonal. If there are
/// several ranks, each rank has the rows of its own nodes, which come first; fields also have values at the ghosts that
/// follow.
#[derive(Debug, Clone)]
pub(super) struct Level<const D: usize, const N: usize> {
    pub lattice: Lattice<D>,
    pub rows: Rows<N>,
    /// The diagonal of S; zero for degrees of freedom that are held or have no stiffness.
    pub scale: Vec<[f64; N]>,
    /// The diagonal of S⁻¹; zero for degrees of freedom that are held or have no stiffness.
    pub unscale: Vec<[f64; N]>,
    /// True for the held degrees of freedom of own nodes.
    pub held: Vec<[bool; N]>,
    /// Inverses of the diagonal blocks of Â.
    pub inverse: Vec<Block<N>>,
    /// The nodes of each colour that this rank owns.
    pub colours: Vec<Vec<u32>>,
    pub x: Vec<[f64; N]>,
    pub b: Vec<[f64; N]>,
    /// Residual, or the new values of one colour.
    pub work: Vec<[f64; N]>,
    /// Additional data if there are several ranks.
    pub shared: Option<Shared>,
}

impl<const D: usize, const N: usize> Level<D, N> {
    pub(super) fn new(
        lattice: Lattice<D>,
        rows: Rows<N>,
        held: Vec<[bool; N]>,
        shared: Option<Shared>,
    ) -> Self {
        let zero = vec![[0.0; N]; lattice.len()];
        let mut colours = lattice.colours(rows.len());
        if shared.is_none() {
            // Ranks must agree on the colours.
            colours.retain(|nodes| !nodes.is_empty());
        }
        Level {
            colours,
            scale: zero.clone(),
            unscale: zero.clone(),
            inverse: vec![[[0.0; N]; N]; rows.len()],
            work: vec![[0.0; N]; rows.len()],
            x: zero.clone(),
            b: zero,
            lattice,
            rows,
            held,
            shared,
        }
    }

    /// The finest level.
    pub(super) fn finest(lattice: Lattice<D>, matrix: &BlockMatrix<N>, held: Vec<[bool; N]>) -> Self {
        let RowColumns { start, column } = whole_rows(matrix);
        Level::new(lattice, Rows::new(start, column), held, None)
    }

    /// The next coarser level.
    pub(super) fn coarser(&self) -> (Level<D, N>, Transfer) {
        if let Some(shared) = &self.shared {
            return self.coarser_shared(shared);
        }
        let (lattice, transfer) = self.lattice.coarsen();
        let mut held = vec![[false; N]; lattice.len()];
        let (mut start, mut column) = (vec![0], Vec::new());
        for (n, place) in lattice.place.iter().enumerate() {
            // A node at the position of a held fine node is held in the same way.
            for &(child, weight) in transfer.children(n) {
                if weight == 1.0 {
                    held[n] = self.held[child as usize];
                }
            }
            lattice.for_each_near(*place, lattice.reach, |near| column.push(near));
            start.push(column.len());
        }
        (Level::new(lattice, Rows::new(start, column), held, None), transfer)
    }

    /// True if this is the finest level for this lattice, matrix and held degrees of freedom.
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

    /// Takes over the values of a matrix; returns true if its diagonal is positive at all free degrees of freedom.
    ///
    /// # Errors
    /// [`LinearError::Singular`] if a free degree of freedom has no stiffness.
    pub(super) fn take(&mut self, matrix: &BlockMatrix<N>) -> Result<bool, LinearError> {
        if let Some(shared) = self.shared.take() {
            let outcome = self.take_shared(&shared, matrix);
            self.shared = Some(shared);
            return outcome;
        }
        let positive = self.scale_by(|n| diagonal_of(matrix, n))?;
        let scale = &self.scale;
        self.rows.fill(&|piece| {
            piece.for_each(|row, columns, values| {
                let width = values.len() / N;
                for (k, &column) in columns.iter().enumerate() {
                    let Some(block) = block_of(matrix, row as u32, column) else { continue };
                    for i in 0..N {
                        for j in 0..N {
                            let scaled = block[i][j] * scale[row][i] * scale[column as usize][j];
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

    /// Scales the nodes of this rank by the diagonal of the finest level; returns true if this diagonal is positive.
    ///
    /// # Errors
    /// [`LinearError::Singular`] if a free degree of freedom has no stiffness.
    pub(super) fn scale_by(&mut self, diagonal: impl Fn(usize) -> [f64; N]) -> Result<bool, LinearError> {
        let mut positive = true;
        for n in 0..self.rows.len() {
            let stiffness = diagonal(n);
            for d in (0..N).filter(|d| !self.held[n][*d]) {
                if stiffness[d] == 0.0 || !stiffness[d].is_finite() {
                    return Err(LinearError::Singular { unknown: None });
                }
                positive &= stiffness[d] > 0.0;
                self.unscale[n][d] = stiffness[d].abs().sqrt();
                self.scale[n][d] = 1.0 / self.unscale[n][d];
            }
        }
        Ok(positive)
    }

    /// Computes the values of the Galerkin product Tᵀ A T of a finer level.
    pub(super) fn take_product(&mut self, fine: &Level<D, N>, transfer: &Transfer) {
        let mut stiffness: Vec<[f64; N]> = vec![[0.0; N]; self.lattice.len()];
        for (n, stiffness) in stiffness.iter_mut().enumerate() {
            for &(child, weight) in transfer.children(n) {
                for d in 0..N {
                    stiffness[d] += (f64::from(weight) * fine.unscale[child as usize][d]).powi(2);
                }
            }
        }
        if let Some(shared) = &self.shared {
            shared.contributions.rows.add(&shared.ghosts.ranks, &mut stiffness);
        }
        for n in 0..self.rows.len() {
            for d in 0..N {
                let free = !self.held[n][d] && stiffness[n][d] > 0.0;
                self.unscale[n][d] = if free { stiffness[n][d].sqrt() } else { 0.0 };
                self.scale[n][d] = if free { 1.0 / self.unscale[n][d] } else { 0.0 };
            }
        }
        if let Some(shared) = self.shared.take() {
            self.take_shared_product(&shared, fine, transfer);
            self.shared = Some(shared);
            return;
        }
        let stencil = Stencil::new(&self.lattice);
        let scale = &self.scale;
        self.rows.fill(&|piece| {
            let mut sum = vec![[[0.0; N]; N]; stencil.len];
            Arch::new().dispatch(
                #[inline(always)]
                || {
                    piece.for_each(|row, columns, values| {
                        stencil.product(&fine.rows, &fine.unscale, transfer, row, &mut sum);
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

    pub(super) fn invert(&mut self) {
        let rows = &self.rows;
        in_parts(0, &mut self.inverse, &|first, part: &mut [Block<N>]| {
            for (k, inverse) in part.iter_mut().enumerate() {
                *inverse = inverse_of(&rows.diagonal(first + k));
            }
        });
    }
}

/// The columns of all rows of a matrix, ascending, for both triangles.
pub(super) fn whole_rows<const N: usize>(matrix: &BlockMatrix<N>) -> RowColumns {
    let n = matrix.column_start.len().saturating_sub(1);
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
        // Earlier columns have already given row c its entries left of the diagonal.
        for &row in &matrix.row[matrix.column_start[c]..matrix.column_start[c + 1]] {
            column[next[row as usize]] = c as u32;
            next[row as usize] += 1;
            if row as usize != c {
                column[next[c]] = row;
                next[c] += 1;
            }
        }
    }
    RowColumns { start, column }
}

/// The diagonal of the block of a node.
pub(super) fn diagonal_of<const N: usize>(matrix: &BlockMatrix<N>, n: usize) -> [f64; N] {
    let first = matrix.column_start[n];
    let is_own = first < matrix.column_start[n + 1] && matrix.row[first] == n as u32;
    std::array::from_fn(|d| if is_own { matrix.blocks[first][d][d] } else { 0.0 })
}

/// The block of a row and a column of a symmetric matrix.
pub(super) fn block_of<const N: usize>(matrix: &BlockMatrix<N>, row: u32, column: u32) -> Option<Block<N>> {
    let (low, high) = (row.min(column) as usize, row.max(column));
    let places = matrix.column_start[low]..matrix.column_start[low + 1];
    let at = matrix.row[places.clone()].binary_search(&high).ok()?;
    let block = &matrix.blocks[places.start + at];
    Some(if row >= column { *block } else { std::array::from_fn(|i| std::array::from_fn(|j| block[j][i])) })
}

/// Sets the diagonal to one for degrees of freedom with zero scale.
pub(super) fn own_entries<const N: usize>(row: usize, columns: &[u32], scale: &[f64; N], values: &mut [f32]) {
    let width = values.len() / N;
    if let Ok(place) = columns.binary_search(&(row as u32)) {
        for d in (0..N).filter(|&d| scale[d] == 0.0) {
            values[d * width + place * N + d] = 1.0;
        }
    }
}
