//! Iterative solver for large systems on the nodes of a structured grid, with a multigrid cycle as preconditioner:
//! conjugate gradients, and GMRES where the matrix turns out not to be positive definite, or is not symmetric.

mod conjugate;
mod gmres;
mod symmetric_part;

use super::backend::{Backend, Layout, Solved, Stiffness};
use super::blocks::BlockMatrix;
use super::multigrid::Multigrid;
use super::{Factorisation, LinearError};

use conjugate::ConjugateGradients;
use gmres::Gmres;
use symmetric_part::SymmetricPart;

/// The iterative backend on structured grids. It applies the assembled matrix block by block; only the preconditioner keeps
/// a copy, in single precision. The preconditioner of an unsymmetric matrix is that of its symmetric part.
#[derive(Default)]
pub struct Krylov<const D: usize, const N: usize = D> {
    multigrid: Multigrid<D, N>,
    held: Vec<[bool; N]>,
    /// Of a matrix that is not symmetric.
    symmetric_part: Option<SymmetricPart<N>>,
    /// True if the matrix, or its symmetric part, has shown no direction of negative curvature.
    definite: bool,
    conjugate_gradients: ConjugateGradients<N>,
    gmres: Gmres<N>,
}

impl<const D: usize, const N: usize> Krylov<D, N> {
    /// Number of nodes of each level of the preconditioner.
    pub fn levels(&self) -> Vec<usize> {
        self.multigrid.sizes()
    }
}

impl<const D: usize, const N: usize> Backend<D, N> for Krylov<D, N> {
    /// Does nothing if nodes, pattern and unknowns are those of the last call.
    ///
    /// # Errors
    /// [`LinearError::Unsymmetric`] if the pattern is not symmetric; [`LinearError::OutOfMemory`].
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.symmetric_part = if matrix.symmetric { None } else { Some(SymmetricPart::new(matrix)?) };
        let n = layout.numbering.n_nodes();
        let places = (0..n).map(layout.lattice).collect();
        let is_held = |node, component| layout.numbering.unknown(node, component).is_none();
        self.held = (0..n).map(|node| std::array::from_fn(|component| is_held(node, component))).collect();
        let lines = layout.lines.map(|lines| lines.map(<[f64]>::to_vec));
        let part = self.symmetric_part.as_ref().map(SymmetricPart::matrix);
        self.multigrid
            .analyse(part.as_ref().unwrap_or(matrix), (places, lines), self.held.clone())
            .map(|_| ())
    }

    /// Sets up the preconditioner.
    ///
    /// # Errors
    /// [`LinearError::Singular`] if an unknown has no diagonal stiffness, or the coarsest level has none at all.
    fn factorise(&mut self, _: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let Some(part) = &mut self.symmetric_part else {
            self.definite = self.multigrid.factorise(matrix)?;
            return Ok(());
        };
        part.take(matrix);
        self.definite = self.multigrid.factorise(&part.matrix())?;
        Ok(())
    }

    /// Measures the residual in the norm of the forces on the unknowns.
    ///
    /// # Errors
    /// [`LinearError::NotConverged`] after too many iterations.
    fn solve(
        &mut self,
        _: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        let Self { multigrid, held, definite, symmetric_part, conjugate_gradients, gmres } = self;
        let mut precondition = |r: &[[f64; N]], z: &mut [[f64; N]]| multigrid.precondition(r, z);
        let mut masked = |x: &[[f64; N]], out: &mut [[f64; N]]| {
            stiffness.multiply(x, out);
            mask(out, held);
        };
        let mut rhs = b.to_vec();
        mask(&mut rhs, held);
        let mut before = 0;
        if *definite && symmetric_part.is_none() {
            match conjugate_gradients.solve(&mut masked, &mut precondition, &rhs, x, tolerance) {
                Err(conjugate::Failure::NotPositiveDefinite { iterations }) => {
                    *definite = false;
                    before = iterations;
                }
                Err(conjugate::Failure::Linear(error)) => return Err(error),
                Ok(iterations) => return Ok(Solved { factorisation: Factorisation::Multigrid, iterations }),
            }
        }
        let iterations = before + gmres.solve(&mut masked, &mut precondition, &rhs, x, tolerance)?;
        // A symmetric matrix gets here only if it is not positive definite.
        let factorisation =
            if *definite { Factorisation::MultigridUnsymmetric } else { Factorisation::MultigridIndefinite };
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
