//! Sparse direct solver: LLᵀ by fronts, and LDLᵀ and LU of the faer library, behind one interface.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltError;
use faer::perm::PermRef;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::linalg::solvers::{Lu, SymbolicLu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

use crate::memory::Memory;

use super::multifrontal::Multifrontal;
use super::{FactorSize, Factorisation, LinearError, LinearSolver, Pattern};

/// Largest relative residual of a solution that is accepted from a factorisation without pivoting.
const UNPIVOTED_RESIDUAL: f64 = 1e-8;

/// A factor of fewer bytes is allocated without checking the available memory.
const LITTLE: u64 = 64 << 20;

/// Unknowns whose diagonal entry is below this multiple of the largest are weak: they belong to nodes that points hardly
/// touch.
const WEAK: f64 = 1e-2;

/// Weak unknowns are lost if they move farther than the others by this factor.
const LOST: f64 = 1e5;

/// Relative shift of the diagonal entries of weak unknowns that leave the matrix singular.
const SHIFT: f64 = 1e-9;

/// Relative residual below which the shift has only compensated for round-off. Above it, the shift is as large as a
/// curvature of the matrix, which may be negative.
const SINGULAR_RESIDUAL: f64 = 1e-10;

/// Most steps of iterative refinement that correct for a shift, and the relative residual that they must reach.
const REFINEMENTS: usize = 4;
const REFINED_RESIDUAL: f64 = 1e-12;

/// A direct solver. Symmetric matrices get LLᵀ, LDLᵀ when they are not positive definite, LU when that is not
/// accurate; others LU.
///
/// If weak unknowns leave the matrix singular to working precision, their diagonal entries are shifted and solutions
/// refined until they solve the original equations. This happens if only a corner of a domain touches two nodes: every
/// point sees the same basis function for both, so one combination of them causes no strain and no motion, and carries
/// no load.
///
/// Threads share the fronts of LLᵀ in a way that does not change its bits; everything else runs on one thread.
#[derive(Default)]
pub struct Direct {
    pattern: Pattern,
    /// The unknowns of a symmetric matrix in the order of elimination.
    order: Vec<usize>,
    llt: Option<Multifrontal>,
    ldlt: Option<Ldlt>,
    values: Vec<f64>,
    /// The factor of a symmetric matrix, of whichever kind.
    factor: Vec<f64>,
    work: Vec<f64>,
    kind: Option<Factorisation>,
    /// True if the factor is that of a shifted matrix.
    shifted: bool,
    /// Norm of the largest right-hand side of such a matrix since the last call for analysis.
    largest: f64,
    /// The unknown at which a factorisation without pivoting met a zero pivot.
    suspect: Option<usize>,
    full: Option<FullMatrix>,
    lu: Option<Lu<usize, f64>>,
}

/// The layout of LDLᵀ, and its working space.
struct Ldlt {
    symbolic: SymbolicCholesky<usize>,
    memory: MemBuffer,
}

/// Both triangles of the matrix, which LU needs.
struct FullMatrix {
    pattern: Pattern,
    /// For each entry, its place in the values of the given pattern.
    source: Vec<usize>,
    symbolic: SymbolicLu<usize>,
}

fn out_of_memory<E>(_: E) -> LinearError {
    LinearError::OutOfMemory { needed: None }
}

/// Returns an error if this number of bytes is not available.
fn ask_for(needed: u64) -> Result<(), LinearError> {
    if needed > LITTLE && Memory::of_this_machine().is_some_and(|memory| needed > memory.available) {
        return Err(LinearError::OutOfMemory { needed: Some(needed) });
    }
    Ok(())
}

fn view<'a>(pattern: &'a Pattern, values: &'a [f64]) -> SparseColMatRef<'a, usize, f64> {
    SparseColMatRef::new(symbolic_view(pattern), values)
}

fn symbolic_view(pattern: &Pattern) -> SymbolicSparseColMatRef<'_, usize> {
    SymbolicSparseColMatRef::new_checked(pattern.n, pattern.n, &pattern.column_start, None, &pattern.row)
}

impl LinearSolver for Direct {
    fn analyse(&mut self, pattern: Pattern, order: &dyn Fn() -> Vec<usize>) -> Result<bool, LinearError> {
        if self.pattern == pattern && (self.llt.is_some() || !pattern.symmetric) {
            self.largest = 0.0; // a resumed run knows nothing of earlier steps
            return Ok(false);
        }
        *self = Direct { pattern, ..Direct::default() };
        let pattern = &self.pattern;
        if pattern.symmetric && pattern.n > 0 {
            self.order = order();
            let llt = Multifrontal::new(pattern, &self.order).ok_or_else(|| out_of_memory(()))?;
            ask_for(llt.bytes())?;
            self.factor = vec![0.0; llt.factor_len()];
            self.llt = Some(llt);
        }
        Ok(true)
    }

    fn factorise(&mut self, values: &[f64]) -> Result<Factorisation, LinearError> {
        self.kind = None;
        self.suspect = None;
        self.shifted = false;
        self.values.clear();
        self.values.extend_from_slice(values);
        // A matrix that becomes positive definite by such a small shift may be singular to working precision: the sign
        // of its smallest pivot, and the distance by which LDLᵀ would move weak unknowns, are then round-off.
        let definite = self.pattern.n == 0
            || self.pattern.symmetric && (self.factorise_llt(values)? || self.factorise_shifted()?);
        let kind = if definite {
            Factorisation::Cholesky
        } else if self.pattern.symmetric {
            self.factorise_ldlt()?
        } else {
            self.factorise_lu()?
        };
        self.kind = Some(kind);
        Ok(kind)
    }

    fn solve(&mut self, rhs: &mut [f64]) -> Result<(), LinearError> {
        if self.pattern.n == 0 {
            return Ok(());
        }
        let solved = match self.kind {
            Some(_) if self.pattern.symmetric => {
                let given = rhs.to_vec();
                if !(self.shifted && self.solve_shifted(rhs) <= SINGULAR_RESIDUAL) {
                    rhs.copy_from_slice(&given);
                    self.solve_unshifted(rhs)?;
                }
                true
            }
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
    /// The size of the factor LLᵀ of the analysed pattern.
    pub fn factor_size(&self) -> FactorSize {
        self.llt.as_ref().map(Multifrontal::size).unwrap_or_default()
    }

    /// LLᵀ; false if the matrix is not positive definite.
    fn factorise_llt(&mut self, values: &[f64]) -> Result<bool, LinearError> {
        let Some(llt) = &mut self.llt else { return Err(LinearError::Singular { unknown: None }) };
        Ok(llt.factorise(values, &mut self.factor))
    }

    /// Replaces the right-hand side of symmetric equations by their solution.
    fn solve_unshifted(&mut self, rhs: &mut [f64]) -> Result<(), LinearError> {
        let given = rhs.to_vec();
        if self.shifted {
            // A load acts on a motion with no, little or negative resistance.
            self.shifted = false;
            self.kind = Some(self.factorise_ldlt()?);
        }
        self.back_substitute(rhs);
        // Without pivoting, the solution is accepted only if it solves the system.
        if self.kind == Some(Factorisation::Ldlt) && self.residual(&given, rhs) > UNPIVOTED_RESIDUAL {
            self.factorise_lu()?;
            self.kind = Some(Factorisation::Lu);
            rhs.copy_from_slice(&given);
            self.back_substitute(rhs);
        }
        if self.is_lost(rhs) {
            self.find(rhs, &given)?;
        }
        Ok(())
    }

    /// The diagonal entry below which an unknown is weak.
    fn limit_of_weakness(&self) -> f64 {
        let diagonal = |j: usize| self.values[self.pattern.column_start[j]];
        WEAK * (0..self.pattern.n).map(diagonal).fold(0.0, f64::max)
    }

    /// True if a solution moves weak unknowns so much farther than the others that the matrix must be singular.
    fn is_lost(&self, x: &[f64]) -> bool {
        let limit = self.limit_of_weakness();
        let (mut weak, mut strong) = (0.0f64, 0.0f64);
        for (j, x) in x.iter().enumerate() {
            let group =
                if self.values[self.pattern.column_start[j]] < limit { &mut weak } else { &mut strong };
            *group = group.max(x.abs());
            if !x.is_finite() {
                return true;
            }
        }
        weak > LOST * strong
    }

    /// Replaces a lost solution by that with the factor of the shifted matrix, if that solves the equations.
    fn find(&mut self, solution: &mut [f64], given: &[f64]) -> Result<(), LinearError> {
        let kind = self.kind;
        if self.factorise_shifted()? {
            self.kind = Some(Factorisation::Cholesky);
            let mut other = given.to_vec();
            // Near equilibrium a right-hand side is round-off of larger ones.
            if self.solve_shifted(&mut other) * norm(given) <= UNPIVOTED_RESIDUAL * self.largest {
                solution.copy_from_slice(&other);
                return Ok(());
            }
        }
        self.shifted = false;
        self.kind = kind;
        // The shifted factor has overwritten the factor of the given matrix.
        match kind {
            Some(Factorisation::Cholesky) => {
                let values = std::mem::take(&mut self.values);
                let outcome = self.factorise_llt(&values);
                self.values = values;
                outcome.map(|_| ())
            }
            Some(Factorisation::Ldlt) => self.factorise_ldlt().map(|_| ()),
            _ => Ok(()),
        }
    }

    /// Replaces the right-hand side by the solution with the factor of the shifted matrix; returns its relative residual.
    fn solve_shifted(&mut self, rhs: &mut [f64]) -> f64 {
        self.largest = self.largest.max(norm(rhs));
        self.refine(rhs)
    }

    /// LLᵀ with the diagonal entries of weak unknowns shifted; false if there are none, or if this does not solve the
    /// equations for a right-hand side that has a solution.
    fn factorise_shifted(&mut self) -> Result<bool, LinearError> {
        let n = self.pattern.n;
        let diagonal = |j: usize| self.pattern.column_start[j];
        let limit = self.limit_of_weakness();
        let mut values = self.values.clone();
        let mut weak = 0;
        for j in 0..n {
            let value = &mut values[diagonal(j)];
            if *value > 0.0 && *value < limit {
                *value *= 1.0 + SHIFT;
                weak += 1;
            }
        }
        if weak == 0 || !self.factorise_llt(&values)? {
            return Ok(false);
        }
        self.kind = Some(Factorisation::Cholesky);
        // The matrix times an arbitrary vector.
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

    /// Sets up the layout of LDLᵀ once for each pattern.
    fn analyse_ldlt(&mut self) -> Result<(), LinearError> {
        if self.ldlt.is_some() {
            return Ok(());
        }
        let mut inverse = vec![0; self.order.len()];
        for (place, &unknown) in self.order.iter().enumerate() {
            inverse[unknown] = place;
        }
        let symbolic = factorize_symbolic_cholesky(
            symbolic_view(&self.pattern),
            Side::Lower,
            SymmetricOrdering::Custom(PermRef::new_checked(&self.order, &inverse, self.pattern.n)),
            CholeskySymbolicParams::default(),
        )
        .map_err(out_of_memory)?;
        let scratch = symbolic
            .factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default())
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let more = symbolic.len_val().saturating_sub(self.factor.len());
        ask_for(8 * more as u64 + scratch.unaligned_bytes_required() as u64)?;
        if more > 0 {
            self.factor = vec![0.0; symbolic.len_val()];
        }
        let memory = MemBuffer::try_new(scratch).map_err(out_of_memory)?;
        self.ldlt = Some(Ldlt { symbolic, memory });
        Ok(())
    }

    fn factorise_ldlt(&mut self) -> Result<Factorisation, LinearError> {
        self.analyse_ldlt()?;
        let Some(Ldlt { symbolic, memory }) = &mut self.ldlt else {
            return Err(LinearError::Singular { unknown: None });
        };
        let matrix = view(&self.pattern, &self.values);
        let ldlt = symbolic.factorize_numeric_ldlt(
            &mut self.factor[..symbolic.len_val()],
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

    /// The first unknown whose row and column contain only zeros.
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
        let Some(full) = &self.full else { return Err(LinearError::OutOfMemory { needed: None }) };
        let values: Vec<f64> = full.source.iter().map(|&s| self.values[s]).collect();
        let matrix = view(&full.pattern, &values);
        let lu = Lu::try_new_with_symbolic(full.symbolic.clone(), matrix)
            .map_err(|_| LinearError::Singular { unknown: self.suspect })?;
        self.lu = Some(lu);
        Ok(Factorisation::Lu)
    }

    fn back_substitute(&mut self, rhs: &mut [f64]) {
        let n = self.pattern.n;
        match (self.kind, &mut self.llt, &mut self.ldlt, &self.lu) {
            (Some(Factorisation::Cholesky), Some(llt), _, _) => llt.solve(&self.factor, rhs),
            (Some(Factorisation::Ldlt), _, Some(Ldlt { symbolic, memory }), _) => {
                let x = MatMut::from_column_major_slice_mut(rhs, n, 1);
                let factor = LdltRef::new(symbolic, &self.factor[..symbolic.len_val()]);
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
        let residual = norm(&self.work) / norm(b);
        if residual.is_nan() {
            if b.iter().all(|v| *v == 0.0) { 0.0 } else { f64::INFINITY }
        } else {
            residual
        }
    }
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
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
