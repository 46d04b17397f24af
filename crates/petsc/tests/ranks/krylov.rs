//! The iterative backend.

use mpm_core::linear::{BlockMatrix, Factorisation, Layout, LinearError};
use mpm_core::ranks::{Halo, Ranks};
use mpm_petsc::{Krylov, Preconditioner};

use crate::body::{Kind, Part, deviation, expected};
use crate::report;

const TOLERANCE: f64 = 1e-12;

pub fn check(ranks: &Ranks) {
    for with_jacobi in [false, true] {
        for kind in [Kind::Definite, Kind::Unsymmetric] {
            agrees(ranks, if with_jacobi { [5, 2] } else { [13, 5] }, kind, with_jacobi);
            agrees(ranks, [3, 1], kind, with_jacobi);
            agrees(ranks, if with_jacobi { [4, 2, 1] } else { [6, 3, 3] }, kind, with_jacobi);
        }
        agrees(ranks, if with_jacobi { [4, 1] } else { [7, 4] }, Kind::Shifted(1.0), with_jacobi);
        not_finite(ranks, with_jacobi);
    }
    errors_of_a_preconditioner_arrive(ranks);
    iterations_end(ranks);
}

fn backend<const D: usize>(with_jacobi: bool) -> Krylov<D, D> {
    match with_jacobi {
        true => Krylov::with_preconditioner(Box::new(Jacobi::default())).expect("PETSc runs"),
        false => Krylov::new().expect("PETSc runs"),
    }
}

fn agrees<const D: usize>(ranks: &Ranks, elements: [u32; D], kind: Kind, with_jacobi: bool) {
    let (_, solution) = expected(elements, kind);
    let mut part = Part::new(ranks, elements, kind);
    let mut backend = backend::<D>(with_jacobi);
    let name = format!("krylov {elements:?} {kind:?}, {}", if with_jacobi { "Jacobi" } else { "multigrid" });
    let (solved, x) = part.solve(&mut backend, TOLERANCE).unwrap_or_else(|error| panic!("{name}: {error}"));
    let error = ranks.largest(deviation(&part, &x, &solution));
    assert!(error < 1e-9, "{name}: {error:e}");
    let wanted = match kind {
        Kind::Definite => Factorisation::Multigrid,
        Kind::Unsymmetric => Factorisation::MultigridUnsymmetric,
        _ => Factorisation::MultigridIndefinite,
    };
    assert_eq!(solved.factorisation, wanted, "{name}");
    report(ranks, &name, &format!("{} iterations", solved.iterations), error, &x);
    // The layout is kept; other values give another solution.
    part.blocks.iter_mut().flatten().flatten().for_each(|value| *value *= 2.0);
    let (_, half) = part.solve(&mut backend, TOLERANCE).expect("a regular matrix");
    let doubled: Vec<[f64; D]> = half.iter().map(|x| x.map(|x| 2.0 * x)).collect();
    let again = ranks.largest(deviation(&part, &doubled, &solution));
    assert!(again < 1e-9, "{name}: {again:e}");
    // The preconditioner belongs to an earlier matrix.
    part.blocks.iter_mut().flatten().flatten().for_each(|value| *value *= 2.0);
    let (_, quarter) = part.solve_again(&mut backend, TOLERANCE).expect("a regular matrix");
    let fourfold: Vec<[f64; D]> = quarter.iter().map(|x| x.map(|x| 4.0 * x)).collect();
    let later = ranks.largest(deviation(&part, &fourfold, &solution));
    assert!(later < 1e-9, "{name}: {later:e}");
}

fn not_finite(ranks: &Ranks, with_jacobi: bool) {
    let outcome = Part::new(ranks, [6, 3], Kind::NotFinite).solve(&mut backend::<2>(with_jacobi), TOLERANCE);
    assert_eq!(outcome.err(), Some(LinearError::Singular { unknown: None }));
}

#[derive(Clone, Copy)]
enum Failure {
    Error,
    Panic,
}

/// The Jacobi preconditioner: the inverse of the diagonal.
#[derive(Default)]
struct Jacobi<const N: usize> {
    inverse: Vec<[f64; N]>,
    /// How the application of the preconditioner fails on this rank.
    fails: Option<Failure>,
}

impl<const D: usize> Preconditioner<D, D> for Jacobi<D> {
    fn prepare(&mut self, _: &Layout<D, D>, _: &BlockMatrix<D>) -> Result<(), LinearError> {
        Ok(())
    }

    fn factorise(&mut self, layout: &Layout<D, D>, matrix: &BlockMatrix<D>) -> Result<bool, LinearError> {
        self.inverse = vec![[0.0; D]; layout.nodes.len()];
        matrix.for_each(|row, column, place| {
            if row == column {
                self.inverse[row] = std::array::from_fn(|k| matrix.blocks[place][k][k]);
            }
        });
        layout.halo.add(&mut self.inverse);
        let positive = self.inverse.as_flattened().iter().all(|entry| *entry > 0.0);
        self.inverse.as_flattened_mut().iter_mut().for_each(|entry| *entry = 1.0 / *entry);
        Ok(positive)
    }

    fn apply(&mut self, _: &Halo, r: &[[f64; D]], z: &mut [[f64; D]]) -> Result<(), LinearError> {
        for ((z, r), inverse) in z.iter_mut().zip(r).zip(&self.inverse) {
            *z = std::array::from_fn(|k| r[k] * inverse[k]);
        }
        match self.fails {
            None => Ok(()),
            Some(Failure::Error) => Err(LinearError::OutOfMemory { needed: Some(7) }),
            Some(Failure::Panic) => panic!("the preconditioner panics"),
        }
    }
}

fn errors_of_a_preconditioner_arrive(ranks: &Ranks) {
    let fails = ranks.own() + 1 == ranks.count();
    let outcome = solve_with(ranks, fails.then_some(Failure::Error));
    let needed = fails.then_some(7);
    assert_eq!(outcome, Some(LinearError::OutOfMemory { needed }));
}

fn solve_with(ranks: &Ranks, fails: Option<Failure>) -> Option<LinearError> {
    let jacobi = Jacobi { fails, ..Jacobi::default() };
    let mut backend: Krylov<2, 2> = Krylov::with_preconditioner(Box::new(jacobi)).expect("PETSc runs");
    Part::new(ranks, [6, 3], Kind::Definite).solve(&mut backend, TOLERANCE).err()
}

/// A panic in a function that PETSc calls, on the last rank.
pub fn panic(ranks: &Ranks) {
    solve_with(ranks, (ranks.own() + 1 == ranks.count()).then_some(Failure::Panic));
}

/// An option that PETSc does not know.
pub fn wrong_option(ranks: &Ranks) {
    let outcome = Part::new(ranks, [6, 3], Kind::Definite).solve(&mut backend::<2>(false), TOLERANCE);
    match outcome.err() {
        Some(LinearError::Library(text)) => assert!(text.contains("nonsense"), "{text}"),
        other => panic!("{other:?}"),
    }
}

fn iterations_end(ranks: &Ranks) {
    let outcome = Part::new(ranks, [13, 5], Kind::Unsymmetric).solve(&mut backend::<2>(true), TOLERANCE);
    match outcome.err() {
        Some(LinearError::NotConverged { iterations: 300, residual }) => assert!(residual > TOLERANCE),
        other => panic!("{other:?}"),
    }
}
