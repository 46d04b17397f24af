//! LU with partial pivoting, from the faer library, for matrices that cannot be solved by a factorisation without
//! pivoting.

use faer::linalg::solvers::SolveCore;
use faer::sparse::SparseColMatRef;
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::{Conj, MatMut};
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::{LinearError, Pattern};

/// The factors of a matrix, and the layout of both its triangles.
pub(super) struct PivotedLu {
    pattern: Pattern,
    /// The index of each entry in the values of the given pattern.
    source: Vec<usize>,
    symbolic: SymbolicLu<usize>,
    factors: Option<Lu<usize, f64>>,
    /// A pool of one thread for faer, which would otherwise divide sums between all threads, so that the last bits of
    /// its results would depend on the number of threads.
    pool: ThreadPool,
}

impl PivotedLu {
    /// Lays out the factors of matrices of this pattern.
    pub fn new(pattern: &Pattern) -> Result<PivotedLu, LinearError> {
        let (pattern, source) = both_triangles(pattern);
        let symbolic =
            SymbolicLu::try_new(pattern.view()).map_err(|_| LinearError::OutOfMemory { needed: None })?;
        let pool = ThreadPoolBuilder::new().num_threads(1).build();
        let pool = pool.map_err(|_| LinearError::OutOfMemory { needed: None })?;
        Ok(PivotedLu { pattern, source, symbolic, factors: None, pool })
    }

    /// Factorises the matrix with these values of the given pattern; false if it is singular.
    pub fn factorise(&mut self, values: &[f64]) -> bool {
        let values: Vec<f64> = self.source.iter().map(|&s| values[s]).collect();
        let matrix = SparseColMatRef::new(self.pattern.view(), &values[..]);
        let symbolic = self.symbolic.clone();
        self.factors = self.pool.install(|| Lu::try_new_with_symbolic(symbolic, matrix).ok());
        self.factors.is_some()
    }

    /// Replaces the right-hand side by the solution, or by NaN if there are no factors.
    pub fn solve(&self, rhs: &mut [f64]) {
        match &self.factors {
            Some(lu) => {
                let rhs = MatMut::from_column_major_slice_mut(rhs, self.pattern.n, 1);
                self.pool.install(|| lu.solve_in_place_with_conj(Conj::No, rhs));
            }
            None => rhs.fill(f64::NAN),
        }
    }
}

/// The full pattern of a matrix, and the index of each of its entries in the given pattern.
fn both_triangles(pattern: &Pattern) -> (Pattern, Vec<usize>) {
    let mut columns: Vec<Vec<(usize, usize)>> = vec![Vec::new(); pattern.n];
    for j in 0..pattern.n {
        for e in pattern.column_start[j]..pattern.column_start[j + 1] {
            let i = pattern.row[e];
            columns[j].push((i, e));
            if pattern.symmetric && i != j {
                columns[i].push((j, e));
            }
        }
    }
    let mut full = Pattern { n: pattern.n, column_start: vec![0], row: Vec::new(), symmetric: false };
    let mut source = Vec::new();
    for column in &mut columns {
        column.sort_unstable();
        full.row.extend(column.iter().map(|c| c.0));
        source.extend(column.iter().map(|c| c.1));
        full.column_start.push(full.row.len());
    }
    (full, source)
}
