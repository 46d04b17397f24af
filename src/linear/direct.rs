//! Sparse direct solver: supernodal LLᵀ, LDLᵀ and LU of the faer library behind one face.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltError;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::supernodal::SupernodalLltRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use super::{Factorisation, LinearError, LinearSolver, Pattern};

/// Largest relative residual of a solution that is accepted from a factorisation without pivoting.
const UNPIVOTED_RESIDUAL: f64 = 1e-8;

/// A pivot of LLᵀ below this multiple of the diagonal entry it comes from is round-off.
const LEAST_PIVOT: f64 = 1e-13;

/// Unknowns whose diagonal entry is below this multiple of the largest are weak: they belong to nodes that points hardly
/// touch.
const WEAK: f64 = 1e-4;

/// What is added to the diagonal entries of weak unknowns, relative to them, where they leave the matrix singular.
const SHIFT: f64 = 1e-9;

/// Steps of iterative refinement that mend a shift, and the relative residual that they must reach.
const REFINEMENTS: usize = 4;
const REFINED_RESIDUAL: f64 = 1e-12;

/// A direct solver. Symmetric matrices get LLᵀ, LDLᵀ when they are not positive definite, LU when that is not
/// accurate; others LU.
///
/// Where weak unknowns leave the matrix singular to working precision, their diagonal entries are shifted and solutions
/// refined until they solve the equations as they are given. That happens where a corner of a domain is all that touches
/// two nodes: their basis functions are the same to every point, so that one combination of them strains nothing, moves
/// nothing and carries no load. Runs on one thread, so that results do not depend on their number.
#[derive(Default)]
pub struct Direct {
    pattern: Pattern,
    symbolic: Option<SymbolicCholesky<usize>>,
    values: Vec<f64>,
    factor: Vec<f64>,
    work: Vec<f64>,
    memory: Option<MemBuffer>,
    kind: Option<Factorisation>,
    /// Whether the factor is that of a shifted matrix.
    shifted: bool,
    /// The unknown at which a factorisation without pivoting met a zero pivot.
    suspect: Option<usize>,
    full: Option<FullMatrix>,
    lu: Option<Lu<usize, f64>>,
}

/// Both triangles of the matrix, which LU needs.
struct FullMatrix {
    pattern: Pattern,
    /// For each entry, its place in the values of the given pattern.
    source: Vec<usize>,
    symbolic: SymbolicLu<usize>,
}

fn out_of_memory<E>(_: E) -> LinearError {
    LinearError::OutOfMemory
}

fn view<'a>(pattern: &'a Pattern, values: &'a [f64]) -> SparseColMatRef<'a, usize, f64> {
    SparseColMatRef::new(symbolic_view(pattern), values)
}

fn symbolic_view(pattern: &Pattern) -> SymbolicSparseColMatRef<'_, usize> {
    SymbolicSparseColMatRef::new_checked(pattern.n, pattern.n, &pattern.column_start, None, &pattern.row)
}

impl LinearSolver for Direct {
    fn analyse(&mut self, pattern: Pattern, order: &dyn Fn() -> Vec<usize>) -> Result<bool, LinearError> {
        if self.pattern == pattern && (self.symbolic.is_some() || !pattern.symmetric) {
            return Ok(false);
        }
        *self = Direct { pattern, ..Direct::default() };
        let pattern = &self.pattern;
        if pattern.symmetric && pattern.n > 0 {
            let order = order();
            let mut inverse = vec![0; order.len()];
            for (place, &unknown) in order.iter().enumerate() {
                inverse[unknown] = place;
            }
            let permutation = PermRef::new_checked(&order, &inverse, pattern.n);
            let symbolic = factorize_symbolic_cholesky(
                symbolic_view(pattern),
                Side::Lower,
                SymmetricOrdering::Custom(permutation),
                CholeskySymbolicParams::default(),
            )
            .map_err(out_of_memory)?;
            self.factor = vec![0.0; symbolic.len_val()];
            let scratch = symbolic
                .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
                .or(symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default()))
                .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
            self.memory = Some(MemBuffer::try_new(scratch).map_err(out_of_memory)?);
            self.symbolic = Some(symbolic);
        }
        Ok(true)
    }

    fn factorise(&mut self, values: &[f64]) -> Result<Factorisation, LinearError> {
        self.kind = None;
        self.suspect = None;
        self.shifted = false;
        let definite = self.pattern.n == 0 || self.pattern.symmetric && self.factorise_llt(values)?;
        let kind = if definite && self.least_pivot(values) > LEAST_PIVOT {
            Factorisation::Cholesky
        } else {
            // What follows may need them again.
            self.values.clear();
            self.values.extend_from_slice(values);
            if self.pattern.symmetric && self.factorise_shifted()?
                || definite && self.factorise_llt(values)?
            {
                Factorisation::Cholesky
            } else if self.pattern.symmetric {
                self.factorise_ldlt()?
            } else {
                self.factorise_lu()?
            }
        };
        self.kind = Some(kind);
        Ok(kind)
    }

    fn solve(&mut self, rhs: &mut [f64]) -> Result<(), LinearError> {
        if self.pattern.n == 0 {
            return Ok(());
        }
        let solved = match self.kind {
            Some(Factorisation::Ldlt) => {
                let given = rhs.to_vec();
                self.back_substitute(rhs);
                // No pivoting took place: believe the solution only if it solves the system.
                if self.residual(&given, rhs) > UNPIVOTED_RESIDUAL {
                    self.factorise_lu()?;
                    self.kind = Some(Factorisation::Lu);
                    rhs.copy_from_slice(&given);
                    self.back_substitute(rhs);
                }
                true
            }
            Some(Factorisation::Cholesky) if self.shifted => self.refine(rhs) <= UNPIVOTED_RESIDUAL,
            Some(_) => {
                self.back_substitute(rhs);
                true
            }
            None => false,
        };
        if solved && rhs.iter().all(|x| x.is_finite()) {
            Ok(())
        } else {
            Err(LinearError::Singular { unknown: self.suspect })
        }
    }
}

impl Direct {
    /// LLᵀ; false if the matrix is not positive definite.
    fn factorise_llt(&mut self, values: &[f64]) -> Result<bool, LinearError> {
        let (Some(symbolic), Some(memory)) = (&self.symbolic, &mut self.memory) else {
            return Err(LinearError::Singular { unknown: None });
        };
        let llt = symbolic.factorize_numeric_llt(
            &mut self.factor,
            view(&self.pattern, values),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(memory),
            Default::default(),
        );
        Ok(llt.is_ok())
    }

    /// Smallest pivot of LLᵀ relative to the diagonal entry that it comes from.
    fn least_pivot(&self, values: &[f64]) -> f64 {
        let Some(symbolic) = &self.symbolic else { return f64::INFINITY };
        let order = symbolic.perm().map(|perm| perm.arrays().0);
        let relative = |place: usize, l: f64| {
            let unknown = order.map_or(place, |order| order[place]);
            // The diagonal entry is the first of its column.
            l * l / values[self.pattern.column_start[unknown]]
        };
        match symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(simplicial) => {
                (simplicial.col_ptr().iter().take(self.pattern.n).enumerate())
                    .map(|(place, &first)| relative(place, self.factor[first]))
                    .fold(f64::INFINITY, f64::min)
            }
            SymbolicCholeskyRaw::Supernodal(supernodal) => {
                let factor = SupernodalLltRef::new(supernodal, &self.factor);
                let mut least = f64::INFINITY;
                for s in 0..supernodal.n_supernodes() {
                    let (start, block) = (factor.supernode(s).start(), factor.supernode(s).val());
                    for j in 0..block.ncols() {
                        least = least.min(relative(start + j, block[(j, j)]));
                    }
                }
                least
            }
        }
    }

    /// LLᵀ with the diagonal entries of weak unknowns shifted; false where there are none, or where that does not solve
    /// the equations for a right-hand side that has a solution.
    fn factorise_shifted(&mut self) -> Result<bool, LinearError> {
        let n = self.pattern.n;
        let diagonal = |j: usize| self.pattern.column_start[j];
        let largest = (0..n).map(|j| self.values[diagonal(j)]).fold(0.0, f64::max);
        let mut values = self.values.clone();
        let mut weak = 0;
        for j in 0..n {
            let value = &mut values[diagonal(j)];
            if *value > 0.0 && *value < WEAK * largest {
                *value *= 1.0 + SHIFT;
                weak += 1;
            }
        }
        if weak == 0 || !self.factorise_llt(&values)? {
            return Ok(false);
        }
        self.kind = Some(Factorisation::Cholesky);
        // Some vector times the matrix.
        let some: Vec<f64> = (0..n).map(|j| 1.0 + (j % 7) as f64).collect();
        let mut trial = vec![0.0; n];
        self.residual(&trial, &some);
        trial.copy_from_slice(&self.work);
        self.shifted = self.refine(&mut trial) <= UNPIVOTED_RESIDUAL;
        self.kind = None;
        Ok(self.shifted)
    }

    /// Replaces the right-hand side by the solution of the equations without the shift; returns its relative residual.
    fn refine(&mut self, rhs: &mut [f64]) -> f64 {
        let given = rhs.to_vec();
        self.back_substitute(rhs);
        let mut residual = self.residual(&given, rhs);
        for _ in 0..REFINEMENTS {
            if residual <= REFINED_RESIDUAL {
                break;
            }
            let mut correction: Vec<f64> = self.work.iter().map(|r| -r).collect();
            self.back_substitute(&mut correction);
            let better: Vec<f64> = rhs.iter().zip(&correction).map(|(x, dx)| x + dx).collect();
            let now = self.residual(&given, &better);
            if now >= residual {
                break;
            }
            residual = now;
            rhs.copy_from_slice(&better);
        }
        residual
    }

    fn factorise_ldlt(&mut self) -> Result<Factorisation, LinearError> {
        let (Some(symbolic), Some(memory)) = (&self.symbolic, &mut self.memory) else {
            return Err(LinearError::Singular { unknown: None });
        };
        let matrix = view(&self.pattern, &self.values);
        let ldlt = symbolic.factorize_numeric_ldlt(
            &mut self.factor,
            matrix,
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(memory),
            Default::default(),
        );
        match ldlt {
            Ok(_) => Ok(Factorisation::Ldlt),
            Err(LdltError::ZeroPivot { index }) => {
                // faer counts pivots from 1 in its simplicial factorisation and from 0 in the supernodal one.
                let place = match symbolic.raw() {
                    SymbolicCholeskyRaw::Simplicial(_) => index.saturating_sub(1),
                    SymbolicCholeskyRaw::Supernodal(_) => index,
                };
                self.suspect = symbolic.perm().and_then(|perm| perm.arrays().0.get(place).copied());
                match self.empty_column() {
                    Some(unknown) => Err(LinearError::Singular { unknown: Some(unknown) }),
                    None => self.factorise_lu(),
                }
            }
        }
    }

    /// The first unknown whose row and column hold nothing but zeros.
    fn empty_column(&self) -> Option<usize> {
        let mut empty = vec![true; self.pattern.n];
        for j in 0..self.pattern.n {
            for e in self.pattern.column_start[j]..self.pattern.column_start[j + 1] {
                if self.values[e] != 0.0 {
                    empty[j] = false;
                    empty[self.pattern.row[e]] = false;
                }
            }
        }
        empty.iter().position(|e| *e)
    }

    fn factorise_lu(&mut self) -> Result<Factorisation, LinearError> {
        if self.full.is_none() {
            let (pattern, source) = both_triangles(&self.pattern);
            let symbolic = SymbolicLu::try_new(symbolic_view(&pattern)).map_err(out_of_memory)?;
            self.full = Some(FullMatrix { pattern, source, symbolic });
        }
        let Some(full) = &self.full else { return Err(LinearError::OutOfMemory) };
        let values: Vec<f64> = full.source.iter().map(|&s| self.values[s]).collect();
        let matrix = view(&full.pattern, &values);
        let lu = Lu::try_new_with_symbolic(full.symbolic.clone(), matrix)
            .map_err(|_| LinearError::Singular { unknown: self.suspect })?;
        self.lu = Some(lu);
        Ok(Factorisation::Lu)
    }

    fn back_substitute(&mut self, rhs: &mut [f64]) {
        let n = self.pattern.n;
        match (self.kind, &self.symbolic, &mut self.memory, &self.lu) {
            (Some(Factorisation::Cholesky), Some(symbolic), Some(memory), _) => {
                let x = MatMut::from_column_major_slice_mut(rhs, n, 1);
                let factor = LltRef::new(symbolic, &self.factor);
                factor.solve_in_place_with_conj(Conj::No, x, Par::Seq, MemStack::new(memory));
            }
            (Some(Factorisation::Ldlt), Some(symbolic), Some(memory), _) => {
                let x = MatMut::from_column_major_slice_mut(rhs, n, 1);
                let factor = LdltRef::new(symbolic, &self.factor);
                factor.solve_in_place_with_conj(Conj::No, x, Par::Seq, MemStack::new(memory));
            }
            (Some(Factorisation::Lu), _, _, Some(lu)) => {
                use faer::linalg::solvers::SolveCore;
                lu.solve_in_place_with_conj(Conj::No, MatMut::from_column_major_slice_mut(rhs, n, 1));
            }
            _ => rhs.fill(f64::NAN),
        }
    }

    /// |A x − b| / |b|.
    fn residual(&mut self, b: &[f64], x: &[f64]) -> f64 {
        self.work.clear();
        self.work.extend(b.iter().map(|v| -v));
        for j in 0..self.pattern.n {
            for e in self.pattern.column_start[j]..self.pattern.column_start[j + 1] {
                let (i, a) = (self.pattern.row[e], self.values[e]);
                self.work[i] += a * x[j];
                if self.pattern.symmetric && i != j {
                    self.work[j] += a * x[i];
                }
            }
        }
        let norm = |v: &[f64]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let residual = norm(&self.work) / norm(b);
        if residual.is_nan() {
            if b.iter().all(|v| *v == 0.0) { 0.0 } else { f64::INFINITY }
        } else {
            residual
        }
    }
}

/// The full pattern of a matrix, and for each of its entries the place in the given one.
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
