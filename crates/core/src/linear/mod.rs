//! Sparse linear systems: backends that solve the equations of a load step, and the solvers on which they are built.

mod backend;
mod blocks;
#[cfg(test)]
mod bodies;
mod choice;
mod direct;
mod direct_backend;
mod divided;
mod gathered;
mod krylov;
mod lattice;
mod ldlt;
mod multifrontal;
mod multigrid;
mod numbering;
pub mod ordering;
mod pivoted_lu;
mod preconditioner;
mod reduction;
mod symmetric_part;

use serde::{Deserialize, Serialize};

use crate::counted::counted;

pub use backend::{Backend, Backends, Engine, Engines, Layout, Solved, Stiffness};
pub use blocks::{Block, BlockMatrix, Division};
pub use choice::{ALGEBRAIC, Choice, Extent};
pub use direct::Direct;
pub use direct_backend::{DirectBackend, FreeEntries};
pub use divided::Divided;
pub use gathered::Gathered;
pub use krylov::Krylov;
pub use numbering::Numbering;
pub use preconditioner::Preconditioner;

/// Pattern of a sparse square matrix by columns; for a symmetric matrix, only the lower triangle including the
/// diagonal.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Pattern {
    /// Number of unknowns.
    pub n: usize,
    /// Start of each column in `row`; `n + 1` entries.
    pub column_start: Vec<usize>,
    /// Row of each entry, ascending within a column.
    pub row: Vec<usize>,
    /// True if only the lower triangle is given.
    pub symmetric: bool,
}

impl Pattern {
    /// The pattern in the form that `faer` requires.
    fn view(&self) -> faer::sparse::SymbolicSparseColMatRef<'_, usize> {
        faer::sparse::SymbolicSparseColMatRef::new_checked(
            self.n,
            self.n,
            &self.column_start,
            None,
            &self.row,
        )
    }
}

/// The kind of factorisation that solved a system.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Factorisation {
    /// LLᵀ: the matrix is positive definite.
    Cholesky,
    /// LDLᵀ: the matrix is symmetric but not positive definite.
    Ldlt,
    /// LU of an unsymmetric matrix, with positive pivots only.
    Lu,
    /// LU with a negative pivot or with pivoting; it also serves symmetric matrices that LDLᵀ cannot solve.
    LuIndefinite,
    /// No factorisation: conjugate gradients with a multigrid preconditioner, for a symmetric matrix that has shown no
    /// negative curvature.
    Multigrid,
    /// No factorisation: generalised minimal residuals with a multigrid preconditioner, for an unsymmetric matrix whose
    /// symmetric part has shown no negative curvature.
    MultigridUnsymmetric,
    /// No factorisation: generalised minimal residuals with a multigrid preconditioner, for a symmetric matrix that is
    /// not positive definite.
    MultigridIndefinite,
    /// No factorisation: generalised minimal residuals with a multigrid preconditioner, for an unsymmetric matrix whose
    /// symmetric part is not positive definite.
    MultigridIndefiniteUnsymmetric,
}

impl Factorisation {
    /// True if the matrix was positive definite. An unsymmetric matrix counts as positive definite if all pivots of its
    /// LU are positive (which holds if its symmetric part is positive definite), or if the set-up of the multigrid
    /// preconditioner has found no negative curvature of its symmetric part.
    pub fn is_definite(self) -> bool {
        use Factorisation::{Cholesky, Lu, Multigrid, MultigridUnsymmetric};
        matches!(self, Cholesky | Lu | Multigrid | MultigridUnsymmetric)
    }

    /// True if the matrix shows that an equilibrium of this nature is unstable.
    pub fn shows_instability(self, nature: Nature) -> bool {
        use Factorisation::{Ldlt, MultigridIndefinite};
        match nature {
            Nature::Potential => !self.is_definite(),
            Nature::NoPotential => matches!(self, Ldlt | MultigridIndefinite),
            Nature::SaddlePoint => false,
        }
    }

    /// True if nothing was factorised.
    pub fn is_iterative(self) -> bool {
        use Factorisation::{Cholesky, Ldlt, Lu, LuIndefinite};
        !matches!(self, Cholesky | Ldlt | Lu | LuIndefinite)
    }
}

/// The nature of an equilibrium, which decides what an indefinite matrix says about its stability.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Nature {
    /// All forces derive from a potential, at least approximately: an indefinite matrix shows an instability.
    Potential,
    /// Some forces, such as friction, have no potential. The signs of the pivots of an unsymmetric matrix depend on the
    /// order of the unknowns, so that only an indefinite symmetric matrix shows an instability.
    NoPotential,
    /// Unknowns are multipliers of constraints on others: the matrix of a saddle point is indefinite by nature.
    SaddlePoint,
}

/// The size of a factor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FactorSize {
    /// Entries of L, or of L and U.
    pub entries: usize,
    /// Number of additions and multiplications of the factorisation, to leading order.
    pub operations: f64,
}

/// A linear system could not be solved.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
pub enum LinearError {
    /// The matrix is singular to working precision.
    #[error("the matrix is singular")]
    Singular {
        /// An unknown involved in the singular motion, if one can be identified.
        unknown: Option<usize>,
    },
    /// The matrix is regular, but a global unknown remains undetermined.
    #[error("a global unknown is undetermined")]
    Undetermined,
    /// The factor does not fit in memory.
    #[error("out of memory")]
    OutOfMemory {
        /// Memory needed, [byte], if known.
        needed: Option<u64>,
    },
    /// The iterative solver was requested, but nodes are held along directions other than the axes, or are tied, and
    /// there is no algebraic multigrid.
    #[error("some nodes are held along directions other than the axes, or tied to others")]
    Turned,
    /// The iterative solver was requested, but the grid is a mesh and there is no algebraic multigrid.
    #[error("the grid is a mesh, for which multigrid is available only on several ranks, through PETSc")]
    Unstructured,
    /// The matrix, or its pattern, lacks the symmetry that the solver needs.
    #[error("the matrix is not symmetric")]
    Unsymmetric,
    /// An iterative solver has not reached its tolerance.
    #[error(
        "a relative residual of {residual:.1e} remains after {}", counted(*iterations, "iteration", "iterations")
    )]
    NotConverged {
        /// Number of iterations.
        iterations: usize,
        /// Norm of the residual relative to the right-hand side.
        residual: f64,
    },
    /// A library outside this crate has failed in another way.
    #[error("the library that solves the equations has failed: {0}")]
    Library(Text),
}

/// The message with which a library reports its failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Text(pub &'static str);

impl std::fmt::Display for Text {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.0)
    }
}

impl Serialize for Text {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(to)
    }
}

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        // The leak is harmless: ranks exchange such an error once, at the end of a run.
        Ok(Text(Box::leak(String::deserialize(from)?.into_boxed_str())))
    }
}

/// A direct solver for sparse linear systems, as used by the direct [`Backend`].
pub trait LinearSolver {
    /// Prepares for matrices of this pattern; `order` lists the unknowns in the order of elimination. Does nothing if
    /// the pattern and the order are the same as in the last analysis; returns false in this case, and true otherwise.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`] if the factor does not fit in memory.
    fn analyse(&mut self, pattern: Pattern, order: Vec<usize>) -> Result<bool, LinearError>;

    /// Factorises the matrix with these values, in the order of the pattern.
    ///
    /// # Errors
    /// [`LinearError`] if no factorisation exists.
    fn factorise(&mut self, values: &[f64]) -> Result<Factorisation, LinearError>;

    /// Replaces the right-hand side by the solution.
    ///
    /// # Errors
    /// [`LinearError`] if the solution is not finite, or if a further factorisation that it needs fails.
    fn solve(&mut self, rhs: &mut [f64]) -> Result<(), LinearError>;
}

/// The same checks for every [`LinearSolver`]; for a new one, add a line to the list.
#[cfg(test)]
mod conformance {
    use super::*;
    use nalgebra::DMatrix;

    fn solvers() -> Vec<Box<dyn LinearSolver>> {
        vec![Box::new(Direct::default())]
    }

    /// Every solver, once for the lower triangle of a symmetric matrix and once for both triangles.
    fn on_triangles() -> Vec<(Box<dyn LinearSolver>, bool)> {
        solvers()
            .into_iter()
            .map(|solver| (solver, true))
            .chain(solvers().into_iter().map(|solver| (solver, false)))
            .collect()
    }

    /// A five-point Laplacian on an m×m grid, shifted, with an optional unsymmetric part.
    fn matrix(m: usize, shift: f64, skew: f64) -> DMatrix<f64> {
        let n = m * m;
        let mut a = DMatrix::zeros(n, n);
        for i in 0..n {
            a[(i, i)] = 4.0 + 0.1 * (i % 7) as f64 - shift;
            for j in [i + 1, i + m] {
                if j < n && !(j == i + 1 && j % m == 0) {
                    a[(i, j)] = -1.0 + skew;
                    a[(j, i)] = -1.0 - skew;
                }
            }
        }
        a
    }

    fn sparse(a: &DMatrix<f64>, symmetric: bool) -> (Pattern, Vec<f64>) {
        let mut pattern = Pattern { n: a.nrows(), column_start: vec![0], row: vec![], symmetric };
        let mut values = vec![];
        for j in 0..a.ncols() {
            for i in (0..a.nrows()).filter(|&i| !symmetric || i >= j) {
                if a[(i, j)] != 0.0 || i == j {
                    pattern.row.push(i);
                    values.push(a[(i, j)]);
                }
            }
            pattern.column_start.push(values.len());
        }
        (pattern, values)
    }

    fn check(solver: &mut dyn LinearSolver, a: &DMatrix<f64>, symmetric: bool, expected: Factorisation) {
        let (pattern, values) = sparse(a, symmetric);
        let reversed = || (0..pattern.n).rev().collect();
        solver.analyse(pattern.clone(), (0..pattern.n).collect()).unwrap();
        let is_new = solver.analyse(pattern.clone(), reversed()).unwrap();
        assert_eq!(is_new, pattern.n > 1, "another order is analysed");
        assert!(!solver.analyse(pattern.clone(), reversed()).unwrap(), "the analysis is kept");
        assert_eq!(solver.factorise(&values).unwrap(), expected);
        let exact: Vec<f64> = (0..pattern.n).map(|i| (i as f64).sin()).collect();
        let mut x: Vec<f64> = (a * nalgebra::DVector::from_vec(exact.clone())).iter().copied().collect();
        solver.solve(&mut x).unwrap();
        let error = x.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-11, "{error:e}");
    }

    #[test]
    fn every_solver_agrees_with_the_exact_solution() {
        for mut solver in solvers() {
            for m in [1, 3, 20] {
                check(solver.as_mut(), &matrix(m, 0.0, 0.0), true, Factorisation::Cholesky);
                check(solver.as_mut(), &matrix(m, 0.0, 0.3), false, Factorisation::Lu);
            }
            check(solver.as_mut(), &matrix(20, 9.0, 0.3), false, Factorisation::LuIndefinite);
            check(solver.as_mut(), &matrix(20, 2.13, 0.0), true, Factorisation::Ldlt);
        }
    }

    #[test]
    fn a_matrix_that_ldlt_cannot_factorise_is_solved_with_pivoting() {
        let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
        for mut solver in solvers() {
            check(solver.as_mut(), &a, true, Factorisation::LuIndefinite);
        }
    }

    #[test]
    fn a_singular_matrix_is_an_error_that_names_the_unknown() {
        let mut a = matrix(5, 0.0, 0.0);
        a.row_mut(7).fill(0.0);
        a.column_mut(7).fill(0.0);
        for mut solver in solvers() {
            for symmetric in [true, false] {
                let (pattern, values) = sparse(&a, symmetric);
                solver.analyse(pattern.clone(), (0..25).collect()).unwrap();
                assert_eq!(solver.factorise(&values), Err(LinearError::Singular { unknown: Some(7) }));
            }
        }
    }

    /// Two unknowns whose rows are parallel and whose diagonal entries are far smaller than the others: one combination
    /// of the two meets no resistance. A right-hand side that does not load this combination has a solution; others
    /// have none.
    #[test]
    fn a_weak_mechanism_without_load_is_no_obstacle() {
        for (m, at) in [(3, 4), (20, 210)] {
            let mut a = matrix(m, 0.0, 0.0);
            let n = m * m;
            let strong = a.row(at).clone_owned();
            for (k, factor) in [(at, 1e-4), (at + 1, -3e-4)] {
                a.row_mut(k).fill(0.0);
                a.column_mut(k).fill(0.0);
                for j in (0..n).filter(|j| *j != at && *j != at + 1) {
                    a[(k, j)] = factor * strong[j];
                    a[(j, k)] = factor * strong[j];
                }
            }
            for (i, j, value) in
                [(at, at, 4e-8), (at + 1, at + 1, 36e-8), (at, at + 1, -12e-8), (at + 1, at, -12e-8)]
            {
                a[(i, j)] = value;
            }
            for (mut solver, symmetric) in on_triangles() {
                let (pattern, values) = sparse(&a, symmetric);
                solver.analyse(pattern.clone(), (0..n).rev().collect()).unwrap();
                let some = nalgebra::DVector::from_fn(n, |i, _| (i as f64).sin());
                let b = &a * &some;
                let mut x: Vec<f64> = b.iter().copied().collect();
                solver.factorise(&values).and_then(|_| solver.solve(&mut x)).unwrap();
                let rest = &a * nalgebra::DVector::from_vec(x.clone()) - &b;
                assert!(rest.norm() < 1e-11 * b.norm(), "{m}: {:e}", rest.norm() / b.norm());
                assert!(
                    x.iter().all(|x| x.abs() < 1e5),
                    "{m}: {:e}",
                    x.iter().fold(0.0f64, |l, x| l.max(x.abs()))
                );
                let mut loaded: Vec<f64> = b.iter().copied().collect();
                loaded[at] += 1e-3;
                // The result is either an error or a solution so large that the caller must notice it.
                let outcome = solver.factorise(&values).and_then(|_| solver.solve(&mut loaded));
                let far = loaded.iter().fold(0.0f64, |far, x| far.max(x.abs()));
                assert!(outcome.is_err() || far > 1e6, "{m}: {outcome:?} {far:e}");
            }
        }
    }

    /// The stiffness of a chain of springs with an unsupported part at the start, at the end or in the middle; no row
    /// is empty, yet the matrix is singular.
    #[test]
    fn a_loose_part_is_an_error_whatever_its_place_and_size() {
        for n in [4, 40, 400] {
            for loose in [0, n / 2, n - 2] {
                let mut a = DMatrix::zeros(n, n);
                for i in 0..n - 1 {
                    let inside = i == loose;
                    let cut = i + 1 == loose || i == loose + 1;
                    let k = if cut { 0.0 } else { 1.0 };
                    for (r, c, sign) in [(i, i, 1.0), (i + 1, i + 1, 1.0), (i, i + 1, -1.0), (i + 1, i, -1.0)]
                    {
                        a[(r, c)] += k * sign;
                    }
                    if !inside && i != loose + 1 {
                        a[(i, i)] += 0.5; // the rest is held
                    }
                }
                if loose != n - 2 {
                    a[(n - 1, n - 1)] += 0.5;
                }
                for (mut solver, symmetric) in on_triangles() {
                    let (pattern, values) = sparse(&a, symmetric);
                    solver.analyse(pattern.clone(), (0..n).rev().collect()).unwrap();
                    let mut x = vec![1.0; n];
                    let outcome = solver.factorise(&values).and_then(|_| solver.solve(&mut x));
                    match outcome {
                        Err(LinearError::Singular { unknown }) => {
                            if let Some(u) = unknown {
                                assert!(u == loose || u == loose + 1, "n = {n}, loose {loose}: names {u}");
                            }
                        }
                        other => panic!("n = {n}, loose {loose}: {other:?}"),
                    }
                }
            }
        }
    }
}
