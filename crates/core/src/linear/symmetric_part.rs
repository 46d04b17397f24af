//! The symmetric part ½ (K + Kᵀ) of a matrix, from which the preconditioner of the matrix is formed.

use super::blocks::BlockMatrix;
use super::{Block, LinearError};

/// The lower triangle of the symmetric part.
pub(super) struct SymmetricPart<const N: usize> {
    column_start: Vec<usize>,
    row: Vec<u32>,
    blocks: Vec<Block<N>>,
    /// For each block, its index in the whole matrix and the index of its mirror image.
    places: Vec<[usize; 2]>,
}

impl<const N: usize> SymmetricPart<N> {
    /// Lays out the symmetric part of a matrix that stores all its blocks.
    ///
    /// # Errors
    /// [`LinearError::Unsymmetric`] if a block has no mirror image.
    pub fn new(matrix: &BlockMatrix<N>) -> Result<Self, LinearError> {
        let BlockMatrix { column_start, row, .. } = *matrix;
        let rows = |column: usize| &row[column_start[column]..column_start[column + 1]];
        let mut part =
            SymmetricPart { column_start: vec![0], row: Vec::new(), blocks: Vec::new(), places: Vec::new() };
        for column in 0..column_start.len() - 1 {
            for (k, &r) in rows(column).iter().enumerate().filter(|(_, r)| **r as usize >= column) {
                let mirror = rows(r as usize).binary_search(&(column as u32));
                let mirror = mirror.map_err(|_| LinearError::Unsymmetric)?;
                part.row.push(r);
                part.places.push([column_start[column] + k, column_start[r as usize] + mirror]);
            }
            part.column_start.push(part.row.len());
        }
        part.blocks = vec![[[0.0; N]; N]; part.row.len()];
        Ok(part)
    }

    /// Computes the values of the symmetric part from the values of the matrix.
    pub fn take(&mut self, matrix: &BlockMatrix<N>) {
        for (block, [place, mirror]) in self.blocks.iter_mut().zip(&self.places) {
            let (one, other) = (&matrix.blocks[*place], &matrix.blocks[*mirror]);
            for i in 0..N {
                for k in 0..N {
                    block[i][k] = 0.5 * (one[i][k] + other[k][i]);
                }
            }
        }
    }

    /// The symmetric part as a matrix.
    pub fn matrix(&self) -> BlockMatrix<'_, N> {
        let SymmetricPart { column_start, row, blocks, .. } = self;
        BlockMatrix { symmetric: true, column_start, row, blocks }
    }
}
