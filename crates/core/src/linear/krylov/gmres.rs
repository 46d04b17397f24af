//! Generalised minimal residuals (Saad and Schultz, 1986), preconditioned from the right and restarted.

use crate::linear::LinearError;
use crate::linear::reduction::{Reduction, add};

use super::conjugate::MAX_ITERATIONS;

/// Number of directions after which the iterations restart, so that the memory is bounded.
const RESTART: usize = 40;

/// The vectors of the iterations.
#[derive(Default)]
pub(super) struct Gmres<const N: usize> {
    /// Orthonormal basis of the Krylov space, with storage for the longest basis so far.
    basis: Vec<Vec<[f64; N]>>,
    work: Vec<[f64; N]>,
    preconditioned: Vec<[f64; N]>,
}

impl<const N: usize> Gmres<N> {
    /// Solves A x = b to a residual of `tolerance` relative to b; returns the number of iterations. With
    /// preconditioning from the right, the residual is the residual of the original equations. All fields are complete,
    /// and `over` sums over their nodes.
    ///
    /// # Errors
    /// [`LinearError::NotConverged`]; errors of the preconditioner.
    pub(super) fn solve(
        &mut self,
        over: Reduction,
        multiply: &mut impl FnMut(&[[f64; N]], &mut [[f64; N]]),
        precondition: &mut impl FnMut(&[[f64; N]], &mut [[f64; N]]) -> Result<(), LinearError>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<usize, LinearError> {
        let Self { basis, work, preconditioned } = self;
        work.resize(b.len(), [0.0; N]);
        preconditioned.resize(b.len(), [0.0; N]);
        basis.iter_mut().for_each(|vector| vector.resize(b.len(), [0.0; N]));
        x.fill([0.0; N]);
        let size = over.dot(b, b).sqrt();
        let mut iterations = 0;
        loop {
            multiply(x, work);
            work.iter_mut().zip(b).for_each(|(r, b)| *r = std::array::from_fn(|d| b[d] - r[d]));
            let norm = over.dot(work, work).sqrt();
            if norm <= tolerance * size {
                return Ok(iterations);
            }
            if iterations >= MAX_ITERATIONS || !norm.is_finite() {
                return Err(LinearError::NotConverged { iterations, residual: norm / size });
            }
            let mut projection = Projection::new(norm);
            put(basis, 0, work, norm);
            while projection.columns() < RESTART
                && iterations < MAX_ITERATIONS
                && projection.residual() > tolerance * size
            {
                let j = projection.columns();
                precondition(&basis[j], preconditioned)?;
                multiply(preconditioned, work);
                iterations += 1;
                let mut column = Vec::with_capacity(j + 2);
                for vector in &basis[..=j] {
                    let along = over.dot(work, vector);
                    add(work, -along, vector);
                    column.push(along);
                }
                let rest = over.dot(work, work).sqrt();
                column.push(rest);
                if column.iter().any(|entry| !entry.is_finite()) {
                    return Err(LinearError::NotConverged { iterations, residual: norm / size });
                }
                projection.append(column);
                if rest == 0.0 {
                    break;
                }
                put(basis, j + 1, work, rest);
            }
            work.fill([0.0; N]);
            for (vector, y) in basis.iter().zip(projection.solution()) {
                add(work, y, vector);
            }
            precondition(work, preconditioned)?;
            add(x, 1.0, preconditioned);
        }
    }
}

/// Stores a vector, divided by its norm, at index `place` of the basis.
fn put<const N: usize>(basis: &mut Vec<Vec<[f64; N]>>, place: usize, vector: &[[f64; N]], norm: f64) {
    let unit = vector.iter().map(|v| v.map(|v| v / norm));
    match basis.get_mut(place) {
        Some(there) => there.iter_mut().zip(unit).for_each(|(a, b)| *a = b),
        None => basis.push(unit.collect()),
    }
}

/// The equations in the Krylov space: an upper Hessenberg matrix, made triangular by rotations as it grows.
struct Projection {
    /// Columns of the triangle.
    triangle: Vec<Vec<f64>>,
    rotations: Vec<[f64; 2]>,
    rhs: Vec<f64>,
}

impl Projection {
    fn new(norm: f64) -> Self {
        Projection { triangle: Vec::new(), rotations: Vec::new(), rhs: vec![norm] }
    }

    fn columns(&self) -> usize {
        self.triangle.len()
    }

    /// Norm of the residual of the best solution in the space.
    fn residual(&self) -> f64 {
        self.rhs.last().map_or(0.0, |last| last.abs())
    }

    /// Appends the next column of the Hessenberg matrix, including the entry below the diagonal.
    fn append(&mut self, mut column: Vec<f64>) {
        for (k, [c, s]) in self.rotations.iter().enumerate() {
            [column[k], column[k + 1]] =
                [c * column[k] + s * column[k + 1], c * column[k + 1] - s * column[k]];
        }
        let k = self.rotations.len();
        let below = column[k + 1];
        let length = column[k].hypot(below);
        let [c, s] = if length > 0.0 { [column[k] / length, below / length] } else { [1.0, 0.0] };
        column[k] = length;
        column.truncate(k + 1);
        self.triangle.push(column);
        self.rotations.push([c, s]);
        let rest = self.rhs[k];
        self.rhs[k] = c * rest;
        self.rhs.push(-s * rest);
    }

    /// Coefficients of the solution in the basis.
    fn solution(&self) -> Vec<f64> {
        let n = self.columns();
        let mut y = self.rhs[..n].to_vec();
        for k in (0..n).rev() {
            // A direction in the null space of the matrix contributes nothing.
            y[k] = if self.triangle[k][k] > 0.0 { y[k] / self.triangle[k][k] } else { 0.0 };
            for i in 0..k {
                y[i] -= self.triangle[k][i] * y[k];
            }
        }
        y
    }
}
