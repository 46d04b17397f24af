//! The door for preconditioners over many ranks.

use mpm_core::linear::{self, BlockMatrix, Layout, LinearError};
use mpm_core::ranks::Halo;

/// An approximate inverse over all ranks. All ranks call each method together; an error on one rank is an error on all.
pub trait Preconditioner<const D: usize, const N: usize>: Send {
    /// Prepares for matrices of this pattern.
    ///
    /// # Errors
    /// [`LinearError`].
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError>;

    /// Takes over the values of a matrix; returns false if they show that it is not positive definite.
    ///
    /// # Errors
    /// [`LinearError`].
    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<bool, LinearError>;

    /// Replaces `z` by an approximation of A⁻¹ r. Both are fields on the active nodes; `r` is complete and zero at
    /// components that are not unknowns, and only the values of `z` at the unknowns of own nodes are used.
    ///
    /// # Errors
    /// [`LinearError`].
    fn apply(&mut self, halo: &Halo, r: &[[f64; N]], z: &mut [[f64; N]]) -> Result<(), LinearError>;
}

/// The geometric multigrid of the core, for structured grids.
impl<const D: usize, const N: usize> Preconditioner<D, N> for linear::Preconditioner<D, N> {
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        linear::Preconditioner::prepare(self, layout, matrix)
    }

    fn factorise(&mut self, _: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<bool, LinearError> {
        linear::Preconditioner::factorise(self, matrix)
    }

    fn apply(&mut self, _: &Halo, r: &[[f64; N]], z: &mut [[f64; N]]) -> Result<(), LinearError> {
        linear::Preconditioner::apply(self, r, z)
    }
}
