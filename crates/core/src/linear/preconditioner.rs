//! One multigrid cycle as a preconditioner, for iterative solvers in this crate and elsewhere.

use super::backend::Layout;
use super::blocks::BlockMatrix;
use super::multigrid::Multigrid;
use super::reduction::agree;
use super::symmetric_part::SymmetricPart;
use super::{LinearError, Numbering};

/// An approximate inverse of a matrix on the nodes of a structured grid, kept in single precision. For an unsymmetric
/// matrix, it approximates the inverse of the symmetric part.
///
/// All ranks must call each method together. Errors are the same on all ranks.
#[derive(Default)]
pub struct Preconditioner<const D: usize, const N: usize = D> {
    multigrid: Multigrid<D, N>,
    /// The symmetric part of a matrix that is not symmetric.
    symmetric_part: Option<SymmetricPart<N>>,
}

impl<const D: usize, const N: usize> Preconditioner<D, N> {
    /// Prepares for matrices of this pattern. Keeps what the previous call prepared if nodes, pattern and unknowns are
    /// the same.
    ///
    /// # Errors
    /// [`LinearError::Unsymmetric`] if the pattern is not symmetric; [`LinearError::OutOfMemory`].
    pub fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.symmetric_part = if matrix.symmetric {
            None
        } else {
            Some(agree(layout.halo.ranks(), SymmetricPart::new(matrix))?)
        };
        let places = (0..layout.numbering.n_nodes()).map(layout.lattice).collect();
        let lines = layout.lines.map(|lines| lines.map(<[f64]>::to_vec));
        let part = self.symmetric_part.as_ref().map(SymmetricPart::matrix);
        let matrix = part.as_ref().unwrap_or(matrix);
        self.multigrid.analyse(matrix, places, lines, held_by(layout.numbering), layout.halo).map(|_| ())
    }

    /// Takes the values of a matrix; returns false if the matrix, or its symmetric part, is found not to be positive
    /// definite.
    ///
    /// # Errors
    /// [`LinearError::Singular`] if an unknown has no diagonal stiffness; errors of the factorisation on the coarsest
    /// level.
    pub fn factorise(&mut self, matrix: &BlockMatrix<N>) -> Result<bool, LinearError> {
        let Some(part) = &mut self.symmetric_part else { return self.multigrid.factorise(matrix) };
        part.take(matrix);
        self.multigrid.factorise(&part.matrix())
    }

    /// Replaces `z` by an approximation of A⁻¹ r; both are complete fields on the active nodes. `z` is zero for
    /// components that are not unknowns.
    ///
    /// # Errors
    /// [`LinearError`] if the matrix of the coarsest level is singular.
    pub fn apply(&mut self, r: &[[f64; N]], z: &mut [[f64; N]]) -> Result<(), LinearError> {
        self.multigrid.precondition(r, z)
    }

    /// True if the preconditioner was set up for a symmetric matrix.
    pub fn is_of_symmetric(&self) -> bool {
        self.symmetric_part.is_none()
    }

    /// Number of nodes of each level, over all ranks.
    pub fn levels(&self) -> &[usize] {
        self.multigrid.sizes()
    }

    /// Numbers of own nodes and of ghosts that this rank stores on each level.
    pub fn levels_here(&self) -> Vec<[usize; 2]> {
        self.multigrid.sizes_here()
    }
}

/// True for each component of an active node that is not an unknown.
pub(super) fn held_by<const N: usize>(numbering: &Numbering<N>) -> Vec<[bool; N]> {
    let is_held = |node, component| numbering.unknown(node, component).is_none();
    let held = |node| std::array::from_fn(|component| is_held(node, component));
    (0..numbering.n_nodes()).map(held).collect()
}
