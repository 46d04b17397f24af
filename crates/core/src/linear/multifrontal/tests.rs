#![allow(clippy::unwrap_used)]

use nalgebra::{DMatrix, DVector};

use super::*;
use crate::linear::ordering::nested_dissection;

/// Pseudo-random numbers in (0, 1), the same in each run.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn shuffle(&mut self, items: &mut [usize]) {
        for k in (1..items.len()).rev() {
            items.swap(k, (self.next() * (k + 1) as f64) as usize);
        }
    }
}

/// The lower triangle of a matrix; the diagonal is always part of the pattern.
fn sparse(a: &DMatrix<f64>) -> (Pattern, Vec<f64>) {
    let mut pattern = Pattern { n: a.nrows(), column_start: vec![0], row: vec![], symmetric: true };
    let mut values = vec![];
    for j in 0..pattern.n {
        for i in (j..pattern.n).filter(|&i| i == j || a[(i, j)] != 0.0) {
            pattern.row.push(i);
            values.push(a[(i, j)]);
        }
        pattern.column_start.push(values.len());
    }
    (pattern, values)
}

/// A symmetric, diagonally dominant matrix that couples these pairs of nodes; each node has `width` unknowns.
fn coupled(nodes: usize, width: usize, pairs: &[(usize, usize)], numbers: &mut Numbers) -> DMatrix<f64> {
    let n = nodes * width;
    let mut a = DMatrix::zeros(n, n);
    for &(p, q) in pairs.iter().chain(&(0..nodes).map(|p| (p, p)).collect::<Vec<_>>()) {
        for i in 0..width {
            for k in 0..width {
                let value = numbers.next() - 0.5;
                a[(p * width + i, q * width + k)] = value;
                a[(q * width + k, p * width + i)] = value;
            }
        }
    }
    for i in 0..n {
        a[(i, i)] = 0.1 + a.row(i).iter().map(|v| v.abs()).sum::<f64>();
    }
    a
}

/// An unsymmetric matrix with the pattern and the diagonal of a symmetric matrix.
fn skewed(a: &DMatrix<f64>, numbers: &mut Numbers) -> DMatrix<f64> {
    DMatrix::from_fn(
        a.nrows(),
        a.nrows(),
        |i, j| {
            if i == j { a[(i, j)] } else { a[(i, j)] * 2.0 * numbers.next() }
        },
    )
}

/// All entries of a matrix with a symmetric pattern.
fn full(a: &DMatrix<f64>) -> (Pattern, Vec<f64>) {
    let mut pattern = Pattern { n: a.nrows(), column_start: vec![0], row: vec![], symmetric: false };
    let mut values = vec![];
    for j in 0..pattern.n {
        for i in (0..pattern.n).filter(|&i| i == j || a[(i, j)] != 0.0 || a[(j, i)] != 0.0) {
            pattern.row.push(i);
            values.push(a[(i, j)]);
        }
        pattern.column_start.push(values.len());
    }
    (pattern, values)
}

fn check(a: &DMatrix<f64>, order: &[usize]) {
    check_lu(&skewed(a, &mut Numbers(271828)), order);
    let (pattern, values) = sparse(a);
    let mut llt = Multifrontal::new(&pattern, order).unwrap();
    let mut factor = vec![f64::NAN; llt.factor_len()];
    for _ in 0..2 {
        assert!(llt.factorise(&values, &mut factor));
        let exact = DVector::from_fn(pattern.n, |i, _| (i as f64).sin());
        let mut x = a * &exact;
        llt.solve(&factor, x.as_mut_slice());
        assert!((&x - &exact).amax() < 1e-11, "{:e}", (&x - &exact).amax());
    }
    check_factor(&llt, a, &factor);
}

/// Checks that the factor equals the factor of the dense matrix in the order of elimination.
fn check_factor(llt: &Multifrontal, a: &DMatrix<f64>, factor: &[f64]) {
    let dense = in_order(llt, a).cholesky().unwrap().unpack();
    let found = columns(llt, 0, factor);
    assert!((dense - found).amax() < 1e-13 * a.amax());
}

fn check_lu(a: &DMatrix<f64>, order: &[usize]) {
    let (pattern, values) = full(a);
    let mut lu = Multifrontal::new(&pattern, order).unwrap();
    let mut factor = vec![f64::NAN; lu.factor_len()];
    for _ in 0..2 {
        assert!(lu.factorise(&values, &mut factor));
        let exact = DVector::from_fn(pattern.n, |i, _| (i as f64).sin());
        let mut x = a * &exact;
        lu.solve(&factor, x.as_mut_slice());
        assert!((&x - &exact).amax() < 1e-11, "{:e}", (&x - &exact).amax());
    }
    // L with the pivots, U with a diagonal of ones; no pivots are exchanged.
    let (mut l, mut u) = (in_order(&lu, a), DMatrix::identity(pattern.n, pattern.n));
    for k in 0..pattern.n {
        for j in k + 1..pattern.n {
            u[(k, j)] = l[(k, j)] / l[(k, k)];
            l[(k, j)] = 0.0;
            for i in k + 1..pattern.n {
                l[(i, j)] -= l[(i, k)] * u[(k, j)];
            }
        }
    }
    assert!((l - columns(&lu, 0, &factor)).amax() < 1e-13 * a.amax());
    assert!((u.transpose() - columns(&lu, 1, &factor)).amax() < 1e-13);
}

/// The matrix in the order of elimination.
fn in_order(llt: &Multifrontal, a: &DMatrix<f64>) -> DMatrix<f64> {
    let unknown = |place: usize| llt.fronts.unknown[place] as usize;
    DMatrix::from_fn(a.nrows(), a.nrows(), |i, j| a[(unknown(i), unknown(j))])
}

/// A factor as a dense matrix.
fn columns(llt: &Multifrontal, number: usize, factor: &[f64]) -> DMatrix<f64> {
    let n = llt.fronts.unknown.len();
    let mut found = DMatrix::zeros(n, n);
    for front in &llt.fronts.front {
        let border = &llt.fronts.border[front.border..front.border + front.border_len()];
        assert!(
            border.is_sorted() && border.iter().all(|&place| place as usize >= front.first + front.pivots)
        );
        let panel = &factor[front.panel + number * dense::room(front.rows, front.pivots)..];
        for c in 0..front.pivots {
            let column = &panel[c * dense::stride(front.rows)..][..front.rows];
            for r in c..front.pivots {
                found[(front.first + r, front.first + c)] = column[r];
            }
            found[(front.first + c, front.first + c)] = 1.0 / column[c];
            for (&place, value) in border.iter().zip(&column[front.pivots..]) {
                found[(place as usize, front.first + c)] = *value;
            }
        }
    }
    found
}

#[test]
fn it_is_the_factor_of_the_dense_matrix_whatever_the_pattern() {
    let mut numbers = Numbers(88172645463325252);
    for width in [1, 2, 3] {
        for nodes in [1usize, 2, 7, 40, 90] {
            let chain: Vec<_> = (1..nodes).map(|p| (p, p - 1)).collect();
            let star: Vec<_> = (1..nodes).map(|p| (p, 0)).collect();
            let all: Vec<_> = (0..nodes).flat_map(|p| (0..p).map(move |q| (p, q))).collect();
            let grid: Vec<_> = all
                .iter()
                .copied()
                .filter(|(p, q)| p / 9 - q / 9 <= 1 && (p % 9).abs_diff(q % 9) <= 1)
                .collect();
            let few: Vec<_> = all.iter().copied().filter(|_| numbers.next() < 2.5 / nodes as f64).collect();
            let apart: Vec<_> = grid.iter().copied().filter(|(p, q)| p / 18 == q / 18).collect();
            for pairs in [&chain, &star, &all, &grid, &few, &apart, &vec![]] {
                let a = coupled(nodes, width, pairs, &mut numbers);
                let mut order: Vec<usize> = (0..nodes * width).collect();
                check(&a, &order);
                order.reverse();
                check(&a, &order);
                numbers.shuffle(&mut order);
                check(&a, &order);
                let mut by_nodes: Vec<usize> = (0..nodes).collect();
                numbers.shuffle(&mut by_nodes);
                order = by_nodes.iter().flat_map(|p| (0..width).map(move |k| p * width + k)).collect();
                check(&a, &order);
            }
        }
    }
}

#[test]
fn unknowns_of_a_node_with_different_neighbours_stay_apart() {
    let mut numbers = Numbers(1234567);
    let mut a = coupled(30, 2, &(1..30).map(|p| (p, p - 1)).collect::<Vec<_>>(), &mut numbers);
    for (i, j) in [(7, 20), (8, 41), (12, 40), (13, 40)] {
        a[(i, j)] = 0.01;
        a[(j, i)] = 0.01;
    }
    check(&a, &(0..60).collect::<Vec<_>>());
    check(&a, &(0..30).rev().flat_map(|p| [2 * p, 2 * p + 1]).collect::<Vec<_>>());
}

#[test]
fn an_empty_matrix_has_an_empty_factor() {
    let pattern = Pattern { column_start: vec![0], symmetric: true, ..Pattern::default() };
    let mut llt = Multifrontal::new(&pattern, &[]).unwrap();
    assert_eq!(llt.factor_len(), 0);
    assert!(llt.factorise(&[], &mut []));
    llt.solve(&[], &mut []);
}

/// A lattice in space whose nodes are coupled to all surrounding nodes, with three unknowns per node.
fn lattice(m: usize, numbers: &mut Numbers) -> (Pattern, Vec<f64>, Vec<usize>) {
    let place = |p: usize| [(p % m) as u32, (p / m % m) as u32, (p / m / m) as u32];
    let places: Vec<[u32; 3]> = (0..m * m * m).map(place).collect();
    let mut pattern = Pattern { n: 3 * places.len(), column_start: vec![0], row: vec![], symmetric: true };
    let mut values = vec![];
    for j in 0..pattern.n {
        let near = |p: usize| (0..3).all(|d| places[p][d].abs_diff(places[j / 3][d]) <= 1);
        for p in (j / 3..(j / 3 + m * m + m + 2).min(places.len())).filter(|&p| near(p)) {
            for i in (3 * p..3 * p + 3).filter(|&i| i >= j) {
                pattern.row.push(i);
                values.push(if i == j { 45.0 } else { numbers.next() - 0.5 });
            }
        }
        pattern.column_start.push(values.len());
    }
    let nodes = nested_dissection(&places, [1, 1, 1]);
    (pattern, values, nodes.iter().flat_map(|&p| (0..3).map(move |d| 3 * p + d)).collect())
}

/// The same pattern with both triangles, and an unsymmetric matrix.
fn unsymmetric(pattern: &Pattern, values: &[f64]) -> (Pattern, Vec<f64>) {
    let mut columns: Vec<Vec<(usize, f64)>> = vec![vec![]; pattern.n];
    for j in 0..pattern.n {
        for e in pattern.column_start[j]..pattern.column_start[j + 1] {
            let i = pattern.row[e];
            columns[j].push((i, values[e]));
            if i != j {
                columns[i].push((j, values[e] * ((i + 2 * j) % 7) as f64 / 3.0));
            }
        }
    }
    let mut full = Pattern { n: pattern.n, column_start: vec![0], row: vec![], symmetric: false };
    let mut all = vec![];
    for column in &mut columns {
        column.sort_unstable_by_key(|entry| entry.0);
        full.row.extend(column.iter().map(|entry| entry.0));
        all.extend(column.iter().map(|entry| entry.1));
        full.column_start.push(all.len());
    }
    (full, all)
}

fn product(pattern: &Pattern, values: &[f64], x: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; pattern.n];
    for j in 0..pattern.n {
        for e in pattern.column_start[j]..pattern.column_start[j + 1] {
            let i = pattern.row[e];
            product[i] += values[e] * x[j];
            if pattern.symmetric && i != j {
                product[j] += values[e] * x[i];
            }
        }
    }
    product
}

/// True if some of the tasks within run at the same time.
fn is_shared(task: &Task) -> bool {
    task.apart && task.within.len() > 1 || task.within.iter().any(is_shared)
}

#[test]
fn the_number_of_threads_does_not_change_a_bit() {
    let (pattern, values, order) = lattice(13, &mut Numbers(4711));
    check_threads(&pattern, &values, &order);
    let (pattern, values) = unsymmetric(&pattern, &values);
    check_threads(&pattern, &values, &order);
}

fn check_threads(pattern: &Pattern, values: &[f64], order: &[usize]) {
    let exact: Vec<f64> = (0..pattern.n).map(|i| (i as f64).sin()).collect();
    let rhs = product(pattern, values, &exact);
    let mut first: Option<(Vec<f64>, Vec<f64>)> = None;
    for threads in [1, 2, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut llt = Multifrontal::new(pattern, order).unwrap();
        // The test must cover tasks that run at the same time, tasks that run one after another, and shared fronts.
        assert!(!llt.task.apart && llt.task.within.len() > 1);
        assert!(is_shared(&llt.task));
        assert!(llt.fronts.front.iter().any(|front| front.pivots > 400));
        let mut factor = vec![0.0; llt.factor_len()];
        let mut x = rhs.clone();
        pool.install(|| {
            assert!(llt.factorise(values, &mut factor));
            llt.solve(&factor, &mut x);
        });
        let error = x.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-12, "{error:e}");
        match &first {
            None => first = Some((factor, x)),
            Some((other, y)) => {
                let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
                assert!(same(&factor, other) && same(&x, y), "{threads} threads");
            }
        }
    }
}

#[test]
fn a_matrix_that_is_not_positive_definite_is_found_wherever_that_shows() {
    let (pattern, values, order) = lattice(9, &mut Numbers(99));
    let mut llt = Multifrontal::new(&pattern, &order).unwrap();
    let mut factor = vec![0.0; llt.factor_len()];
    for place in [0, 1, pattern.n / 3, pattern.n / 2, pattern.n - 100, pattern.n - 1] {
        let entry = pattern.column_start[order[place]];
        for wrong in [0.0, -1.0, f64::NAN, f64::NEG_INFINITY] {
            let mut values = values.clone();
            values[entry] = wrong;
            assert!(!llt.factorise(&values, &mut factor), "{place}: {wrong}");
        }
    }
    assert!(llt.factorise(&values, &mut factor), "nothing is left of the failures");
}

#[test]
fn a_zero_pivot_of_an_unsymmetric_matrix_is_found_wherever_it_shows() {
    let (pattern, values, order) = lattice(9, &mut Numbers(99));
    let (pattern, values) = unsymmetric(&pattern, &values);
    let mut lu = Multifrontal::new(&pattern, &order).unwrap();
    let mut factor = vec![0.0; lu.factor_len()];
    for place in [0, 1, pattern.n / 3, pattern.n / 2, pattern.n - 100, pattern.n - 1] {
        let unknown = order[place];
        let mut without = values.clone();
        for j in 0..pattern.n {
            for e in pattern.column_start[j]..pattern.column_start[j + 1] {
                if j == unknown || pattern.row[e] == unknown {
                    without[e] = 0.0;
                }
            }
        }
        assert!(!lu.factorise(&without, &mut factor), "{place}");
        let mut values = values.clone();
        values[pattern.column_start[unknown]] = f64::NAN;
        assert!(!lu.factorise(&values, &mut factor), "{place}");
    }
    assert!(lu.factorise(&values, &mut factor), "nothing is left of the failures");
}

#[test]
fn a_pattern_without_a_mirror_image_is_refused() {
    let (pattern, values) = full(&coupled(4, 1, &[(1, 0), (3, 2)], &mut Numbers(3)));
    let order = [0, 1, 2, 3];
    assert_eq!(values.len(), 8);
    assert!(Multifrontal::new(&pattern, &order).is_some());
    for removed in 0..values.len() {
        let column = pattern.column_start.iter().rposition(|&start| start <= removed).unwrap();
        let mut other = pattern.clone();
        other.row.remove(removed);
        other.column_start[column + 1..].iter_mut().for_each(|start| *start -= 1);
        assert!(Multifrontal::new(&other, &order).is_none(), "{removed}");
    }
}

#[test]
fn memory_is_known_before_it_is_taken() {
    for m in [3, 9] {
        let (pattern, values, order) = lattice(m, &mut Numbers(5));
        for (pattern, values) in [unsymmetric(&pattern, &values), (pattern, values)] {
            let mut llt = Multifrontal::new(&pattern, &order).unwrap();
            let bytes = llt.bytes();
            let mut factor = vec![0.0; llt.factor_len()];
            assert!(llt.factorise(&values, &mut factor));
            llt.solve(&factor, &mut vec![1.0; pattern.n]);
            assert_eq!(bytes, 8 * (factor.len() + llt.passed.len() + llt.solution.len()) as u64);
        }
    }
}
