//! Iterative solver for large systems on the nodes of a structured grid, with a multigrid cycle as preconditioner:
//! conjugate gradients, or GMRES if the matrix is unsymmetric or turns out not to be positive definite.

mod conjugate;
mod gmres;
#[cfg(test)]
mod tests;

use super::backend::{Backend, Layout, Solved, Stiffness};
use super::blocks::BlockMatrix;
use super::preconditioner::{Preconditioner, held_by};
use super::reduction::Reduction;
use super::{Factorisation, LinearError};

use conjugate::ConjugateGradients;
use gmres::Gmres;

/// The iterative backend on structured grids. It applies the assembled matrix block by block; only the preconditioner
/// keeps a copy, in single precision. For an unsymmetric matrix, the preconditioner is computed from the symmetric part
/// of the matrix, which is also kept, in double precision.
///
/// Several ranks together compute the same result as a single rank, up to round-off: matrix products are completed
/// across ranks, and scalar products run over the nodes of all ranks.
#[derive(Default)]
pub struct Krylov<const D: usize, const N: usize = D> {
    preconditioner: Preconditioner<D, N>,
    held: Vec<[bool; N]>,
    /// True if the matrix, or its symmetric part, has shown no direction of negative curvature.
    definite: bool,
    conjugate_gradients: ConjugateGradients<N>,
    gmres: Gmres<N>,
}

impl<const D: usize, const N: usize> Krylov<D, N> {
    /// Number of nodes of each level of the preconditioner, over all ranks.
    pub fn levels(&self) -> Vec<usize> {
        self.preconditioner.levels().to_vec()
    }

    /// The preconditioner.
    pub fn preconditioner(&self) -> &Preconditioner<D, N> {
        &self.preconditioner
    }
}

impl<const D: usize, const N: usize> Backend<D, N> for Krylov<D, N> {
    /// Sets up the levels of the preconditioner, unless nodes, pattern and unknowns are the same as in the previous
    /// call.
    ///
    /// # Errors
    /// [`LinearError::Unsymmetric`] if the pattern is not symmetric; [`LinearError::OutOfMemory`].
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.held = held_by(layout.numbering);
        self.preconditioner.prepare(layout, matrix)
    }

    /// Computes the preconditioner from the values of the matrix.
    ///
    /// # Errors
    /// [`LinearError::Singular`] if an unknown has no diagonal stiffness; errors of the factorisation on the coarsest
    /// level.
    fn factorise(&mut self, _: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.definite = self.preconditioner.factorise(matrix)?;
        Ok(())
    }

    /// Measures the residual in the norm of the forces on the unknowns.
    ///
    /// # Errors
    /// [`LinearError::NotConverged`] after too many iterations, or if the residual is not finite; errors of the
    /// preconditioner.
    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        let Self { preconditioner, held, definite, conjugate_gradients, gmres } = self;
        let is_symmetric = preconditioner.is_of_symmetric();
        let over = Reduction(layout.halo);
        let mut precondition = |r: &[[f64; N]], z: &mut [[f64; N]]| preconditioner.apply(r, z);
        let mut masked = |x: &[[f64; N]], out: &mut [[f64; N]]| {
            stiffness.multiply(x, out);
            over.complete(out);
            mask(out, held);
        };
        let mut rhs = b.to_vec();
        mask(&mut rhs, held);
        let mut before = 0;
        if *definite && is_symmetric {
            match conjugate_gradients.solve(over, &mut masked, &mut precondition, &rhs, x, tolerance) {
                Err(conjugate::Failure::NotPositiveDefinite { iterations }) => {
                    *definite = false;
                    before = iterations;
                }
                Err(conjugate::Failure::Linear(error)) => return Err(error),
                Ok(iterations) => return Ok(Solved { factorisation: Factorisation::Multigrid, iterations }),
            }
        }
        let iterations = before + gmres.solve(over, &mut masked, &mut precondition, &rhs, x, tolerance)?;
        // A symmetric matrix reaches this line only if it is not positive definite.
        let factorisation = match (*definite, is_symmetric) {
            (true, _) => Factorisation::MultigridUnsymmetric,
            (false, true) => Factorisation::MultigridIndefinite,
            (false, false) => Factorisation::MultigridIndefiniteUnsymmetric,
        };
        Ok(Solved { factorisation, iterations })
    }

    fn is_iterative(&self) -> bool {
        true
    }
}

fn mask<const N: usize>(x: &mut [[f64; N]], held: &[[bool; N]]) {
    for (x, held) in x.iter_mut().zip(held) {
        for d in 0..N {
            if held[d] {
                x[d] = 0.0;
            }
        }
    }
}
