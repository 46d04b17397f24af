//! The direct solver on small matrices with known solutions, and on singular ones.

use super::*;
use nalgebra::DMatrix;

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

fn check(solver: &mut Direct, a: &DMatrix<f64>, symmetric: bool, expected: Factorisation) {
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
fn the_solution_is_that_of_a_dense_matrix() {
    let mut solver = Direct::default();
    for m in [1, 3, 20] {
        check(&mut solver, &matrix(m, 0.0, 0.0), true, Factorisation::Cholesky);
        check(&mut solver, &matrix(m, 0.0, 0.3), false, Factorisation::Lu);
    }
    check(&mut solver, &matrix(20, 9.0, 0.3), false, Factorisation::LuIndefinite);
    check(&mut solver, &matrix(20, 2.13, 0.0), true, Factorisation::Ldlt);
}

#[test]
fn a_matrix_that_ldlt_cannot_factorise_is_solved_with_pivoting() {
    let a = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    let mut solver = Direct::default();
    check(&mut solver, &a, true, Factorisation::LuIndefinite);
}

#[test]
fn a_singular_matrix_is_an_error_that_names_the_unknown() {
    let mut a = matrix(5, 0.0, 0.0);
    a.row_mut(7).fill(0.0);
    a.column_mut(7).fill(0.0);
    let mut solver = Direct::default();
    for symmetric in [true, false] {
        let (pattern, values) = sparse(&a, symmetric);
        solver.analyse(pattern.clone(), (0..25).collect()).unwrap();
        assert_eq!(solver.factorise(&values), Err(LinearError::Singular { unknown: Some(7) }));
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
        for symmetric in [true, false] {
            let mut solver = Direct::default();
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
                for (r, c, sign) in [(i, i, 1.0), (i + 1, i + 1, 1.0), (i, i + 1, -1.0), (i + 1, i, -1.0)] {
                    a[(r, c)] += k * sign;
                }
                if !inside && i != loose + 1 {
                    a[(i, i)] += 0.5; // the rest is held
                }
            }
            if loose != n - 2 {
                a[(n - 1, n - 1)] += 0.5;
            }
            for symmetric in [true, false] {
                let mut solver = Direct::default();
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
