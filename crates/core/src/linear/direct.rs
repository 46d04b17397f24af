//! Sparse direct solver: multifrontal LLᵀ and LU and, from the faer library, LDLᵀ without pivoting and LU with partial
//! pivoting, behind one interface.

#[cfg(test)]
mod tests;

use crate::memory::{Bound, Memory};

use super::ldlt::Ldlt;
use super::multifrontal::Multifrontal;
use super::pivoted_lu::PivotedLu;
use super::{FactorSize, Factorisation, LinearError, Pattern};

/// Largest relative residual at which a solution from a factorisation without pivoting is accepted.
pub(super) const UNPIVOTED_RESIDUAL: f64 = 1e-8;

/// A factor of at most this size, [byte], is allocated without a check of the available memory.
const LITTLE: u64 = 64 << 20;

/// Unknowns whose diagonal entry is below this fraction of the largest one are weak: they belong to nodes that points
/// hardly touch.
pub(super) const WEAK: f64 = 1e-2;

/// Weak unknowns count as lost if they move more than this many times as far as the others.
pub(super) const LOST: f64 = 1e5;

/// Relative shift of the diagonal entries of weak unknowns that leave the matrix singular.
const SHIFT: f64 = 1e-9;

/// Relative residual below which the shift has only compensated for round-off. Above it, the shift is comparable to an
/// eigenvalue of the matrix, and this eigenvalue may be negative.
const SINGULAR_RESIDUAL: f64 = 1e-10;

/// Largest number of steps of iterative refinement.
pub(super) const REFINEMENTS: usize = 4;
/// Relative residual at which iterative refinement after a shift stops.
const REFINED_RESIDUAL: f64 = 1e-12;

/// Relative residual that iterative refinement of LU without pivoting aims for, to match the accuracy of LU with
/// pivoting.
pub(super) const ROUND_OFF: f64 = 1e-14;

/// A direct solver. It factorises a symmetric matrix by LLᵀ, or by LDLᵀ if the matrix is not positive definite, and any
/// other matrix by LU. If the result is not accurate, it uses LU with pivoting.
///
/// If weak unknowns leave the matrix singular to working precision, their diagonal entries are shifted and solutions
/// are refined until they solve the original equations. This happens if two nodes are touched only by the same corner
/// of one domain: their basis functions are then proportional to each other, so that one combination of the two nodal
/// motions causes no strain and no displacement, and carries no load.
///
/// Threads share the work on the fronts of LLᵀ and LU, and the factor is the same to the last bit for any number of
/// threads; everything else runs on one thread.
#[derive(Default)]
pub struct Direct {
    pattern: Pattern,
    /// Index of the diagonal entry of each unknown, if the pattern has a multifrontal layout.
    diagonal: Vec<usize>,
    /// The unknowns in the order of elimination.
    order: Vec<usize>,
    /// LLᵀ if the matrix is symmetric, LU if only its pattern is; `None` if the pattern is unsymmetric.
    fronts: Option<Multifrontal>,
    ldlt: Option<Ldlt>,
    pivoted: Option<PivotedLu>,
    values: Vec<f64>,
    /// The multifrontal factor or the LDLᵀ factor.
    factor: Vec<f64>,
    work: Vec<f64>,
    kind: Option<Kind>,
    /// True if the factor belongs to a shifted matrix.
    shifted: bool,
    /// Largest norm of the right-hand sides solved with the shifted matrix since the last call of `analyse`.
    largest: f64,
    /// The unknown at which a factorisation without pivoting met a zero pivot.
    suspect: Option<usize>,
}

/// The kind of the current factorisation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// LLᵀ or, for an unsymmetric matrix, LU.
    Fronts,
    Ldlt,
    PivotedLu,
}

/// Returns an error if this number of bytes is not available.
fn ask_for(needed: u64) -> Result<(), LinearError> {
    if is_available(needed, needed) { Ok(()) } else { Err(LinearError::OutOfMemory { needed: Some(needed) }) }
}

/// True if the available memory suffices. `here` is the number of bytes that this process needs; it matters only if the
/// address space is limited. `on_this_machine` is the number for all processes on this machine together.
pub(super) fn is_available(here: u64, on_this_machine: u64) -> bool {
    let has_room = |memory: Memory| {
        let needed = if memory.bound == Bound::AddressSpace { here } else { on_this_machine };
        needed <= memory.available
    };
    on_this_machine <= LITTLE || Memory::this_machine().is_none_or(has_room)
}

impl Direct {
    /// Prepares for matrices of this pattern; `order` lists the unknowns in the order of elimination. Does nothing if
    /// the pattern and the order are the same as in the last analysis; returns false in this case, and true otherwise.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`] if the factor does not fit in memory.
    pub fn analyse(&mut self, pattern: Pattern, order: Vec<usize>) -> Result<bool, LinearError> {
        let is_same = self.pattern == pattern && self.order == order;
        if is_same && (self.fronts.is_some() || self.pivoted.is_some()) {
            self.largest = 0.0; // a resumed run knows nothing of earlier steps
            return Ok(false);
        }
        *self = Direct { pattern, order, ..Direct::default() };
        let pattern = &self.pattern;
        if pattern.n == 0 {
            return Ok(true);
        }
        match Multifrontal::new(pattern, &self.order) {
            Some(fronts) => {
                ask_for(fronts.bytes())?;
                self.factor = vec![0.0; fronts.factor_len()];
                self.fronts = Some(fronts);
                self.diagonal = diagonal(pattern);
            }
            None if pattern.symmetric => return Err(LinearError::OutOfMemory { needed: None }),
            None => self.pivoted = Some(PivotedLu::new(pattern)?),
        }
        Ok(true)
    }

    /// Factorises the matrix with these values, in the order of the pattern.
    ///
    /// # Errors
    /// [`LinearError`] if no factorisation exists.
    pub fn factorise(&mut self, values: &[f64]) -> Result<Factorisation, LinearError> {
        self.kind = None;
        self.suspect = None;
        self.shifted = false;
        self.values.clear();
        self.values.extend_from_slice(values);
        // A matrix that can be factorised only with the small shift may be singular to working precision: the sign of
        // its smallest pivot, and the distance by which LDLᵀ would move weak unknowns, are then round-off.
        if self.pattern.n == 0 || self.factorise_fronts(values) || self.factorise_shifted() {
            self.kind = Some(Kind::Fronts);
        } else if self.pattern.symmetric {
            self.factorise_ldlt()?;
        } else {
            self.factorise_pivoted()?;
        }
        Ok(match self.kind {
            Some(Kind::Fronts) if self.pattern.symmetric => Factorisation::Cholesky,
            Some(Kind::Fronts) if self.has_positive_pivots() => Factorisation::Lu,
            Some(Kind::Ldlt) => Factorisation::Ldlt,
            _ => Factorisation::LuIndefinite,
        })
    }

    /// Replaces the right-hand side by the solution.
    ///
    /// # Errors
    /// [`LinearError`] if the solution is not finite, or if a further factorisation that it needs fails.
    pub fn solve(&mut self, rhs: &mut [f64]) -> Result<(), LinearError> {
        if self.pattern.n == 0 {
            return Ok(());
        }
        if self.kind.is_some() {
            let given = rhs.to_vec();
            if !(self.shifted && self.solve_shifted(rhs) <= SINGULAR_RESIDUAL) {
                rhs.copy_from_slice(&given);
                self.solve_unshifted(&given, rhs)?;
            }
            if rhs.iter().all(|x| x.is_finite()) {
                return Ok(());
            }
        }
        Err(LinearError::Singular { unknown: self.suspect })
    }

    /// The size of the multifrontal factors of the analysed pattern.
    pub fn factor_size(&self) -> FactorSize {
        self.fronts.as_ref().map(Multifrontal::size).unwrap_or_default()
    }

    /// Multifrontal LLᵀ or LU; false if the matrix has no such factor.
    fn factorise_fronts(&mut self, values: &[f64]) -> bool {
        self.fronts.as_mut().is_some_and(|fronts| fronts.factorise(values, &mut self.factor))
    }

    fn has_positive_pivots(&self) -> bool {
        self.fronts.as_ref().is_none_or(|fronts| fronts.has_positive_pivots(&self.factor))
    }

    /// Replaces the right-hand side by the solution; `given` is a copy of the right-hand side.
    fn solve_unshifted(&mut self, given: &[f64], rhs: &mut [f64]) -> Result<(), LinearError> {
        if self.shifted {
            // If the shifted factor does not solve the equations, a load acts on a motion with zero, little or negative
            // resistance.
            self.shifted = false;
            if self.pattern.symmetric { self.factorise_ldlt()? } else { self.factorise_pivoted()? }
        }
        // A solution by LU or LDLᵀ without pivoting is accepted only if it solves the system.
        let is_accurate = match self.kind {
            Some(Kind::Fronts) if !self.pattern.symmetric => {
                self.refine(rhs, ROUND_OFF) <= UNPIVOTED_RESIDUAL
            }
            Some(Kind::Ldlt) => {
                self.back_substitute(rhs);
                self.residual(given, rhs) <= UNPIVOTED_RESIDUAL
            }
            _ => {
                self.back_substitute(rhs);
                true
            }
        };
        if !is_accurate {
            self.factorise_pivoted()?;
            rhs.copy_from_slice(given);
            self.back_substitute(rhs);
        }
        if self.is_lost(rhs) {
            self.find(rhs, given)?;
        }
        Ok(())
    }

    /// The diagonal entry below which an unknown is weak.
    fn limit_of_weakness(&self) -> f64 {
        WEAK * self.diagonal.iter().map(|&place| self.values[place]).fold(0.0, f64::max)
    }

    /// True if a solution is not finite, or moves weak unknowns so much farther than the others that the matrix must be
    /// singular.
    fn is_lost(&self, x: &[f64]) -> bool {
        let limit = self.limit_of_weakness();
        let (mut weak, mut strong) = (0.0f64, 0.0f64);
        for (x, &place) in x.iter().zip(&self.diagonal) {
            let group = if self.values[place] < limit { &mut weak } else { &mut strong };
            *group = group.max(x.abs());
            if !x.is_finite() {
                return true;
            }
        }
        weak > LOST * strong
    }

    /// Replaces a lost solution by one computed with the factor of the shifted matrix, provided that the new solution
    /// satisfies the original equations.
    fn find(&mut self, solution: &mut [f64], given: &[f64]) -> Result<(), LinearError> {
        let kind = self.kind;
        if self.factorise_shifted() {
            self.kind = Some(Kind::Fronts);
            let mut other = given.to_vec();
            // Near equilibrium, a right-hand side consists of the round-off of larger right-hand sides.
            if self.solve_shifted(&mut other) * norm(given) <= UNPIVOTED_RESIDUAL * self.largest {
                solution.copy_from_slice(&other);
                return Ok(());
            }
        }
        self.shifted = false;
        self.kind = kind;
        // The shifted factor has overwritten the factor of the given matrix.
        match kind {
            Some(Kind::Fronts) => {
                let values = std::mem::take(&mut self.values);
                self.factorise_fronts(&values);
                self.values = values;
                Ok(())
            }
            Some(Kind::Ldlt) => self.factorise_ldlt(),
            Some(Kind::PivotedLu) | None => Ok(()),
        }
    }

    /// Replaces the right-hand side by the solution computed with the factor of the shifted matrix; returns the
    /// relative residual of the solution.
    fn solve_shifted(&mut self, rhs: &mut [f64]) -> f64 {
        self.largest = self.largest.max(norm(rhs));
        self.refine(rhs, REFINED_RESIDUAL)
    }

    /// Multifrontal LLᵀ or LU with the diagonal entries of weak unknowns shifted; false if there are no weak unknowns,
    /// if the shifted matrix has no such factor, or if the factor does not solve the equations for a right-hand side
    /// that has a solution.
    fn factorise_shifted(&mut self) -> bool {
        let n = self.pattern.n;
        let limit = self.limit_of_weakness();
        let mut values = self.values.clone();
        let mut weak = 0;
        for &place in &self.diagonal {
            let value = &mut values[place];
            if *value > 0.0 && *value < limit {
                *value *= 1.0 + SHIFT;
                weak += 1;
            }
        }
        if weak == 0 || !self.factorise_fronts(&values) {
            return false;
        }
        self.kind = Some(Kind::Fronts);
        // The right-hand side is the matrix times an arbitrary vector.
        let some: Vec<f64> = (0..n).map(|j| 1.0 + (j % 7) as f64).collect();
        let mut trial = vec![0.0; n];
        self.residual(&trial, &some);
        trial.copy_from_slice(&self.work);
        self.shifted = self.refine(&mut trial, REFINED_RESIDUAL) <= UNPIVOTED_RESIDUAL;
        self.kind = None;
        self.shifted
    }

    /// Replaces the right-hand side by the solution of the equations without the shift, refined until its relative
    /// residual is at most `enough`, if possible; returns the residual reached.
    fn refine(&mut self, rhs: &mut [f64], enough: f64) -> f64 {
        let given = rhs.to_vec();
        self.back_substitute(rhs);
        let mut residual = self.residual(&given, rhs);
        for _ in 0..REFINEMENTS {
            if residual <= enough {
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

    /// LDLᵀ, or LU with pivoting if it meets a zero pivot.
    fn factorise_ldlt(&mut self) -> Result<(), LinearError> {
        let mut ldlt = match self.ldlt.take() {
            Some(ldlt) => ldlt,
            None => Ldlt::new(&self.pattern, &self.order, self.factor.len(), ask_for)?,
        };
        if self.factor.len() < ldlt.factor_len() {
            self.factor = vec![0.0; ldlt.factor_len()];
        }
        let outcome = ldlt.factorise(&self.pattern, &self.values, &mut self.factor);
        self.ldlt = Some(ldlt);
        match outcome {
            Ok(()) => {
                self.kind = Some(Kind::Ldlt);
                Ok(())
            }
            Err(zero) => {
                self.suspect = zero.unknown;
                self.factorise_pivoted()
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

    /// LU with pivoting.
    fn factorise_pivoted(&mut self) -> Result<(), LinearError> {
        if let Some(unknown) = self.empty_column() {
            return Err(LinearError::Singular { unknown: Some(unknown) });
        }
        let mut pivoted = match self.pivoted.take() {
            Some(pivoted) => pivoted,
            None => PivotedLu::new(&self.pattern)?,
        };
        let is_regular = pivoted.factorise(&self.values);
        self.pivoted = Some(pivoted);
        if !is_regular {
            return Err(LinearError::Singular { unknown: self.suspect });
        }
        self.kind = Some(Kind::PivotedLu);
        Ok(())
    }

    fn back_substitute(&mut self, rhs: &mut [f64]) {
        match (self.kind, &mut self.fronts, &mut self.ldlt, &self.pivoted) {
            (Some(Kind::Fronts), Some(fronts), _, _) => fronts.solve(&self.factor, rhs),
            (Some(Kind::Ldlt), _, Some(ldlt), _) => ldlt.solve(&self.factor, rhs),
            (Some(Kind::PivotedLu), _, _, Some(pivoted)) => pivoted.solve(rhs),
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

/// The index of the diagonal entry of each unknown; a pattern with a multifrontal layout has all diagonal entries.
fn diagonal(pattern: &Pattern) -> Vec<usize> {
    let place = |j: usize| {
        let start = pattern.column_start[j];
        start + pattern.row[start..pattern.column_start[j + 1]].partition_point(|&i| i < j)
    };
    (0..pattern.n).map(place).collect()
}
