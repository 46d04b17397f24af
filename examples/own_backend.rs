//! A user-defined linear solver: conjugate gradients with the inverse of the diagonal blocks as preconditioner.
//!
//! ```sh
//! cargo run --example own_backend
//! ```
//!
//! It cannot compete with the built-in solvers, but shows everything that a backend must do on a single machine; on
//! several ranks, it would also have to add up the contributions at shared nodes (`Layout::halo`). A run with it takes
//! the same steps as a run with a built-in solver.
#![allow(clippy::print_stdout, reason = "a program")]

use mpm::deck::{build::build, load::load_text};
use mpm::linear::{Backend, BlockMatrix, Factorisation, Layout, LinearError, Solved, Stiffness};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{Silent, SolveError, Stepper};
use nalgebra::SMatrix;

/// Conjugate gradients; keeps the inverses of the diagonal blocks.
#[derive(Default)]
struct ConjugateGradients<const N: usize> {
    inverse: Vec<SMatrix<f64, N, N>>,
}

impl<const D: usize, const N: usize> Backend<D, N> for ConjugateGradients<N> {
    fn prepare(&mut self, _: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        if matrix.symmetric { Ok(()) } else { Err(LinearError::Unsymmetric) }
    }

    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.inverse = vec![SMatrix::identity(); layout.numbering.n_nodes()];
        let mut diagonal = self.inverse.clone();
        matrix.for_each(|row, column, place| {
            if row == column {
                diagonal[row] = SMatrix::from_fn(|i, k| matrix.blocks[place][i][k]);
            }
        });
        for (node, block) in diagonal.iter_mut().enumerate() {
            let is_unknown = |c: usize| layout.numbering.unknown(node, c).is_some();
            // Rows and columns without an unknown become rows and columns of the identity.
            for (i, k) in (0..N).flat_map(|i| (0..N).map(move |k| (i, k))) {
                if !(is_unknown(i) && is_unknown(k)) {
                    block[(i, k)] = f64::from(u8::from(i == k));
                }
            }
            self.inverse[node] = block.try_inverse().ok_or(LinearError::Singular { unknown: None })?;
        }
        Ok(())
    }

    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        let dot = |a: &[[f64; N]], b: &[[f64; N]]| -> f64 {
            a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
        };
        let precondition = |r: &[[f64; N]]| -> Vec<[f64; N]> {
            let scaled = |(r, inverse): (&[f64; N], &SMatrix<f64, N, N>)| {
                (inverse * nalgebra::SVector::from(*r)).into()
            };
            r.iter().zip(&self.inverse).map(scaled).collect()
        };
        x.fill([0.0; N]);
        let (mut r, enough) = (b.to_vec(), tolerance * dot(b, b).sqrt());
        let mut z = precondition(&r);
        let (mut p, mut rz, mut product) = (z.clone(), dot(&r, &z), vec![[0.0; N]; b.len()]);
        let most = 20 * layout.numbering.count();
        for iterations in 0..most {
            if dot(&r, &r).sqrt() <= enough {
                return Ok(Solved { factorisation: Factorisation::Multigrid, iterations });
            }
            stiffness.multiply(&p, &mut product);
            layout.numbering.for_each(|node, component, unknown| {
                if unknown.is_none() {
                    product[node][component] = 0.0;
                }
            });
            let curvature = dot(&p, &product);
            if curvature <= 0.0 {
                return Err(LinearError::Singular { unknown: None });
            }
            let length = rz / curvature;
            for ((x, p), (r, product)) in x.iter_mut().zip(&p).zip(r.iter_mut().zip(&product)) {
                for c in 0..N {
                    x[c] += length * p[c];
                    r[c] -= length * product[c];
                }
            }
            z = precondition(&r);
            let before = std::mem::replace(&mut rz, dot(&r, &z));
            for (p, z) in p.iter_mut().zip(&z) {
                (0..N).for_each(|c| p[c] = z[c] + rz / before * p[c]);
            }
        }
        Err(LinearError::NotConverged { iterations: most, residual: dot(&r, &r).sqrt() / dot(b, b).sqrt() })
    }

    fn is_iterative(&self) -> bool {
        true
    }
}

const DECK: &str = "
version: 1
title: wall of earth
grid: {type: structured, origin: [0, 0], size: [5, 4], spacing: 0.5}
materials: {clay: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 15e3, density: 2000}}
bodies:
  - {name: wall, material: clay, method: gimp, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [2, 3]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [x, y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81]}
steps: {count: 5}
";

fn wall() -> Option<(Model<2>, Points<2>)> {
    build(&load_text("wall.yaml", DECK.as_bytes(), &[]).ok()?).ok()
}

/// Positions of the points at the end, [m], and the residuals of each step.
type Outcome = (Vec<[f64; 2]>, Vec<Vec<f64>>);

fn run(own: bool) -> Result<Outcome, SolveError> {
    let Some((model, mut points)) = wall() else { return Ok(Default::default()) };
    let mut stepper = Stepper::new(&model, &mut points);
    if own {
        stepper = stepper.with_backend(Box::new(ConjugateGradients::default()));
    }
    let mut residuals = Vec::new();
    while let Some(report) = stepper.step(&mut Silent)? {
        residuals.push(report.residuals.clone());
    }
    Ok((stepper.points().converged.position.clone(), residuals))
}

fn main() {
    match run(true) {
        Ok((_, residuals)) => residuals
            .iter()
            .for_each(|step| println!("{}", step.iter().map(|r| format!("{r:.1e} ")).collect::<String>())),
        Err(error) => println!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;

    #[test]
    fn the_answer_is_that_of_the_built_in_backend() {
        let ([(built_in, _), (own, residuals)], mut farthest) =
            ([run(false).unwrap(), run(true).unwrap()], 0.0f64);
        assert!(residuals.len() == 5 && own.len() == 96);
        for (a, b) in built_in.iter().flatten().zip(own.iter().flatten()) {
            farthest = farthest.max((a - b).abs());
        }
        assert!(farthest < 1e-9, "{farthest:e}");
        assert!(
            residuals.iter().all(|step| step.len() < 12 && step.last().unwrap() <= &1e-9),
            "{residuals:?}"
        );
    }
}
