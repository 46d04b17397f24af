//! The linear solver on matrices for which factorisation without pivoting is inaccurate.
#![allow(clippy::unwrap_used)]

use mpm::linear::{Direct, Pattern};

/// A symmetric tridiagonal matrix, stored as its lower triangle: pairs of unknowns with the block [[pivot, 1], [1, 0]],
/// and the entry `link` between consecutive pairs.
struct Pairs {
    n: usize,
    pivot: f64,
    link: f64,
}

impl Pairs {
    fn diagonal(&self, i: usize) -> f64 {
        if i.is_multiple_of(2) { self.pivot } else { 0.0 }
    }

    fn below(&self, i: usize) -> f64 {
        if i.is_multiple_of(2) { 1.0 } else { self.link }
    }

    fn pattern_and_values(&self) -> (Pattern, Vec<f64>) {
        let mut pattern = Pattern { n: self.n, column_start: vec![0], row: vec![], symmetric: true };
        let mut values = Vec::new();
        for j in 0..self.n {
            pattern.row.push(j);
            values.push(self.diagonal(j));
            if j + 1 < self.n {
                pattern.row.push(j + 1);
                values.push(self.below(j));
            }
            pattern.column_start.push(pattern.row.len());
        }
        (pattern, values)
    }

    fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let at = |i: usize| x.get(i).copied().unwrap_or(0.0);
        let before = |i: usize| if i == 0 { 0.0 } else { self.below(i - 1) * x[i - 1] };
        (0..self.n).map(|i| before(i) + self.diagonal(i) * x[i] + self.below(i) * at(i + 1)).collect()
    }
}

/// With a pivot of 1e-20 the multipliers of LDLᵀ are 1e20, and all information about the matrix is lost although it is
/// well conditioned.
#[test]
fn an_inaccurate_factorisation_is_noticed() {
    for n in [2, 40] {
        for pivot in [1.0, 1e-9, 1e-20, -1e-20] {
            let matrix = Pairs { n, pivot, link: 0.25 };
            let (pattern, values) = matrix.pattern_and_values();
            let mut solver = Direct::default();
            solver.analyse(pattern.clone(), (0..n).collect()).unwrap();
            let exact: Vec<f64> = (0..n).map(|i| 1.0 + (i as f64).sin()).collect();
            solver.factorise(&values).unwrap();
            // Solve twice: the second solve must benefit from what the first one revealed.
            for scale in [1.0, 3.0] {
                let b: Vec<f64> = matrix.multiply(&exact).iter().map(|b| b * scale).collect();
                let mut x = b.clone();
                solver.solve(&mut x).unwrap();
                let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
                let out = norm(&mut matrix.multiply(&x).iter().zip(&b).map(|(ax, b)| ax - b));
                let relative = out / norm(&mut b.iter().copied());
                assert!(relative <= 1e-8, "n = {n}, pivot {pivot:e}: residual {relative:e}");
            }
        }
    }
}
