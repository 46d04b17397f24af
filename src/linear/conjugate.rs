//! Conjugate gradients (Hestenes and Stiefel, 1952) with a multigrid cycle as preconditioner.

use super::LinearError;
use super::blocks::BlockMatrix;
use super::multigrid::Multigrid;

/// Iterations after which a system is given up.
const MOST: usize = 300;

/// Numbers that one thread adds up.
const TERMS: usize = 1024;

/// An iterative solver for symmetric positive definite systems on the nodes of a structured grid. The matrix is applied
/// block by block where it stands; only the preconditioner keeps a copy, in single precision.
#[derive(Default)]
pub struct ConjugateGradients<const D: usize> {
    multigrid: Multigrid<D>,
    held: Vec<[bool; D]>,
    residual: Vec<[f64; D]>,
    preconditioned: Vec<[f64; D]>,
    direction: Vec<[f64; D]>,
    product: Vec<[f64; D]>,
}

impl<const D: usize> ConjugateGradients<D> {
    /// Prepares for matrices of this pattern on nodes at these places of a lattice, some of whose degrees of freedom
    /// are held. Does nothing when they are those of the last time; returns whether it did something.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`] for a matrix that is not symmetric; [`LinearError::OutOfMemory`].
    pub fn analyse(
        &mut self,
        matrix: &BlockMatrix<D>,
        places: Vec<[u32; D]>,
        held: Vec<[bool; D]>,
    ) -> Result<bool, LinearError> {
        if !matrix.symmetric {
            return Err(LinearError::NotPositiveDefinite);
        }
        let n = places.len();
        let changed = self.multigrid.analyse(matrix, places, held.clone())?;
        self.held = held;
        for vector in [&mut self.residual, &mut self.preconditioned, &mut self.direction, &mut self.product] {
            vector.resize(n, [0.0; D]);
        }
        Ok(changed)
    }

    /// Sets up the preconditioner for the values of a matrix.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`] as far as that shows here.
    pub fn factorise(&mut self, matrix: &BlockMatrix<D>) -> Result<(), LinearError> {
        self.multigrid.factorise(matrix)
    }

    /// Solves A x = b on the free degrees of freedom to a residual of `tolerance` relative to b, in the norm of their
    /// forces; `multiply` applies A, and x vanishes where held. Returns the number of iterations.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`] when a direction shows it, [`LinearError::NotConverged`] after too many
    /// iterations.
    pub fn solve(
        &mut self,
        mut multiply: impl FnMut(&[[f64; D]], &mut [[f64; D]]),
        b: &[[f64; D]],
        x: &mut [[f64; D]],
        tolerance: f64,
    ) -> Result<usize, LinearError> {
        let Self { multigrid, held, residual: r, preconditioned: z, direction: p, product: q } = self;
        x.fill([0.0; D]);
        r.copy_from_slice(b);
        mask(r, held);
        p.fill([0.0; D]);
        let size = dot(r, r).sqrt();
        let mut rz_before = 0.0;
        let mut norm = size;
        for iteration in 0..=MOST {
            if norm <= tolerance * size {
                return Ok(iteration);
            }
            if iteration == MOST || !norm.is_finite() {
                break;
            }
            multigrid.precondition(r, z)?;
            let rz = dot(r, z);
            if rz.is_nan() || rz <= 0.0 {
                return Err(LinearError::NotPositiveDefinite);
            }
            let beta = if iteration == 0 { 0.0 } else { rz / rz_before };
            rz_before = rz;
            combine(p, beta, z);
            multiply(p, q);
            mask(q, held);
            let curvature = dot(p, q);
            if curvature.is_nan() || curvature <= 0.0 {
                return Err(LinearError::NotPositiveDefinite);
            }
            let alpha = rz / curvature;
            add(x, alpha, p);
            add(r, -alpha, q);
            norm = dot(r, r).sqrt();
        }
        Err(LinearError::NotConverged { iterations: MOST, residual: norm / size })
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

/// Scalar product, by halves: the order of the sum is fixed, whatever the number of threads.
fn dot<const D: usize>(a: &[[f64; D]], b: &[[f64; D]]) -> f64 {
    if a.len() <= TERMS {
        let mut sum = [0.0; D];
        for (a, b) in a.iter().zip(b) {
            for d in 0..D {
                sum[d] += a[d] * b[d];
            }
        }
        return sum.iter().sum();
    }
    let middle = a.len() / 2;
    let ((a_low, a_high), (b_low, b_high)) = (a.split_at(middle), b.split_at(middle));
    let (low, high) = rayon::join(|| dot(a_low, b_low), || dot(a_high, b_high));
    low + high
}

/// p ← z + β p.
fn combine<const D: usize>(p: &mut [[f64; D]], beta: f64, z: &[[f64; D]]) {
    for (p, z) in p.as_flattened_mut().iter_mut().zip(z.as_flattened()) {
        *p = z + beta * *p;
    }
}

/// x ← x + α p.
fn add<const D: usize>(x: &mut [[f64; D]], alpha: f64, p: &[[f64; D]]) {
    for (x, p) in x.as_flattened_mut().iter_mut().zip(p.as_flattened()) {
        *x += alpha * p;
    }
}
