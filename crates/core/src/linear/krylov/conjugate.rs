//! Preconditioned conjugate gradients (Hestenes and Stiefel, 1952).

use crate::linear::LinearError;
use crate::linear::reduction::{Reduction, add};

/// Largest number of iterations of conjugate gradients or GMRES.
pub(super) const MAX_ITERATIONS: usize = 300;

/// Reasons why the conjugate gradient iterations end without a solution.
pub(super) enum Failure {
    /// The matrix or the preconditioner is not positive definite: pᵀAp or rᵀz is not positive.
    NotPositiveDefinite {
        /// Number of iterations so far.
        iterations: usize,
    },
    /// The iterations do not converge, or the preconditioner fails.
    Linear(LinearError),
}

impl From<LinearError> for Failure {
    fn from(error: LinearError) -> Self {
        Failure::Linear(error)
    }
}

/// The vectors of the iterations.
#[derive(Default)]
pub(super) struct ConjugateGradients<const N: usize> {
    residual: Vec<[f64; N]>,
    preconditioned: Vec<[f64; N]>,
    direction: Vec<[f64; N]>,
    product: Vec<[f64; N]>,
}

impl<const N: usize> ConjugateGradients<N> {
    /// Solves A x = b to a residual of `tolerance` relative to b; returns the number of iterations. All fields are
    /// complete; `over` forms their scalar products.
    pub(super) fn solve(
        &mut self,
        over: Reduction,
        multiply: &mut impl FnMut(&[[f64; N]], &mut [[f64; N]]),
        precondition: &mut impl FnMut(&[[f64; N]], &mut [[f64; N]]) -> Result<(), LinearError>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<usize, Failure> {
        let Self { residual: r, preconditioned: z, direction: p, product: q } = self;
        for vector in [&mut *r, &mut *z, &mut *p, &mut *q] {
            vector.clear();
            vector.resize(b.len(), [0.0; N]);
        }
        x.fill([0.0; N]);
        r.copy_from_slice(b);
        let size = over.dot(r, r).sqrt();
        let mut rz_before = 0.0;
        let mut norm = size;
        let mut iteration = 0;
        loop {
            if norm <= tolerance * size {
                return Ok(iteration);
            }
            if iteration == MAX_ITERATIONS || !norm.is_finite() {
                return Err(LinearError::NotConverged { iterations: iteration, residual: norm / size }.into());
            }
            precondition(r, z)?;
            let rz = over.dot(r, z);
            if rz.is_nan() || rz <= 0.0 {
                return Err(Failure::NotPositiveDefinite { iterations: iteration });
            }
            let beta = if iteration == 0 { 0.0 } else { rz / rz_before };
            rz_before = rz;
            combine(p, beta, z);
            multiply(p, q);
            let curvature = over.dot(p, q);
            if curvature.is_nan() || curvature <= 0.0 {
                return Err(Failure::NotPositiveDefinite { iterations: iteration + 1 });
            }
            let alpha = rz / curvature;
            add(x, alpha, p);
            add(r, -alpha, q);
            norm = over.dot(r, r).sqrt();
            iteration += 1;
        }
    }
}

/// p ← z + β p.
fn combine<const N: usize>(p: &mut [[f64; N]], beta: f64, z: &[[f64; N]]) {
    for (p, z) in p.as_flattened_mut().iter_mut().zip(z.as_flattened()) {
        *p = z + beta * *p;
    }
}
