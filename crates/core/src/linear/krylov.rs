//! Iterative solver for large systems on the nodes of a structured grid, with a multigrid cycle as preconditioner:
//! conjugate gradients, and GMRES where the matrix turns out not to be positive definite.

mod conjugate;
mod gmres;

use super::blocks::BlockMatrix;
use super::multigrid::Multigrid;
use super::{Factorisation, LinearError};

use conjugate::ConjugateGradients;
use gmres::Gmres;

/// An iterative solver for symmetric systems. The matrix is applied block by block where it stands; only the
/// preconditioner keeps a copy, in single precision.
#[derive(Default)]
pub struct Krylov<const D: usize> {
    multigrid: Multigrid<D>,
    held: Vec<[bool; D]>,
    /// Whether the matrix has been positive definite so far.
    definite: bool,
    conjugate_gradients: ConjugateGradients<D>,
    gmres: Gmres<D>,
}

impl<const D: usize> Krylov<D> {
    /// Prepares for matrices of this pattern on nodes at these places of a lattice, some of whose degrees of freedom
    /// are held. Does nothing when they are those of the last time; returns whether it did something.
    ///
    /// # Errors
    /// [`LinearError::Unsymmetric`]; [`LinearError::OutOfMemory`].
    pub fn analyse(
        &mut self,
        matrix: &BlockMatrix<D>,
        places: Vec<[u32; D]>,
        held: Vec<[bool; D]>,
    ) -> Result<bool, LinearError> {
        if !matrix.symmetric {
            return Err(LinearError::Unsymmetric);
        }
        let changed = self.multigrid.analyse(matrix, places, held.clone())?;
        self.held = held;
        Ok(changed)
    }

    /// Sets up the preconditioner for the values of a matrix.
    ///
    /// # Errors
    /// [`LinearError::Singular`] where a free degree of freedom has no stiffness of its own, or the coarsest level none
    /// at all.
    pub fn factorise(&mut self, matrix: &BlockMatrix<D>) -> Result<(), LinearError> {
        self.definite = self.multigrid.factorise(matrix)?;
        Ok(())
    }

    /// Solves A x = b on the free degrees of freedom to a residual of `tolerance` relative to b, in the norm of their
    /// forces; `multiply` applies A, and x vanishes where held. Returns which method did it, in how many iterations.
    ///
    /// # Errors
    /// [`LinearError::NotConverged`] after too many iterations.
    pub fn solve(
        &mut self,
        mut multiply: impl FnMut(&[[f64; D]], &mut [[f64; D]]),
        b: &[[f64; D]],
        x: &mut [[f64; D]],
        tolerance: f64,
    ) -> Result<(Factorisation, usize), LinearError> {
        let Self { multigrid, held, definite, conjugate_gradients, gmres } = self;
        let mut precondition = |r: &[[f64; D]], z: &mut [[f64; D]]| multigrid.precondition(r, z);
        let mut masked = |x: &[[f64; D]], out: &mut [[f64; D]]| {
            multiply(x, out);
            mask(out, held);
        };
        let mut rhs = b.to_vec();
        mask(&mut rhs, held);
        let mut before = 0;
        if *definite {
            match conjugate_gradients.solve(&mut masked, &mut precondition, &rhs, x, tolerance) {
                Err(conjugate::Failure::NotPositiveDefinite { iterations }) => {
                    *definite = false;
                    before = iterations;
                }
                Err(conjugate::Failure::Linear(error)) => return Err(error),
                Ok(iterations) => return Ok((Factorisation::Multigrid, iterations)),
            }
        }
        let iterations = gmres.solve(&mut masked, &mut precondition, &rhs, x, tolerance)?;
        Ok((Factorisation::MultigridIndefinite, before + iterations))
    }

    /// Number of nodes of each level of the preconditioner.
    pub fn levels(&self) -> Vec<usize> {
        self.multigrid.sizes()
    }
}

fn mask<const D: usize>(x: &mut [[f64; D]], held: &[[bool; D]]) {
    for (x, held) in x.iter_mut().zip(held) {
        for d in 0..D {
            if held[d] {
                x[d] = 0.0;
            }
        }
    }
}
