//! Multifrontal factorisations of sparse matrices (Duff and Reid, 1983): LLᵀ, and LU without pivoting of a matrix with
//! a symmetric pattern (Duff and Reid, 1984).
//!
//! Unknowns with the same neighbours are eliminated together, as the pivots of a front. A front is a small dense matrix
//! of their rows and of the border: the rows of the later unknowns to which they are coupled. The update of the border
//! is added to the parent: the front of the first unknown of the border. Two fronts are independent if neither is a
//! descendant of the other.
//!
//! All expensive operations are products of small dense matrices. The division of work between threads depends only
//! on sizes, and every sum has a fixed order, so the factor is the same to the last bit for any number of threads.

mod dense;
mod elimination;
mod fronts;
mod mirror;
mod nodes;
mod separator;
mod substitution;
mod tasks;
#[cfg(test)]
mod tests;
mod tree;

use super::{FactorSize, Pattern};
use elimination::Elimination;
use fronts::{Front, Fronts};
use mirror::Mirror;
use nodes::NONE;
pub(super) use separator::{Columns, Numbers, forget, messages};
use substitution::{Pass, substitute};
use tasks::Task;

/// The layout of the factor for a pattern, and working space. The caller stores the factor itself.
pub(super) struct Multifrontal {
    fronts: Fronts,
    task: Task,
    /// The updates that fronts pass to their parents.
    passed: Vec<f64>,
    /// Working space for a solution and for the rows of one front.
    solution: Vec<f64>,
}

impl Multifrontal {
    /// Lays out LLᵀ for a symmetric pattern, or LU for any other pattern. Unknowns are eliminated in this order, except
    /// that independent unknowns can be exchanged. `None` if an index needs more than 32 bits, or if a pattern that is
    /// not stored as symmetric lacks a diagonal entry or the mirror image of an entry.
    pub fn new(pattern: &Pattern, order: &[usize]) -> Option<Multifrontal> {
        Multifrontal::partial(pattern, order, 0)
    }

    /// The same as [`Multifrontal::new`], for a factorisation that does not eliminate the last `kept` unknowns of the
    /// order and forms the matrix left for them.
    pub fn partial(pattern: &Pattern, order: &[usize], kept: usize) -> Option<Multifrontal> {
        if pattern.n.max(pattern.row.len()) >= NONE as usize {
            return None;
        }
        let mut fronts = if pattern.symmetric {
            Fronts::new(pattern, order, kept, None)
        } else {
            let mirror = Mirror::new(pattern)?;
            Fronts::new(&mirror.lower, order, kept, Some(&mirror))
        };
        let task = Task::new(&mut fronts);
        Some(Multifrontal { fronts, task, passed: Vec::new(), solution: Vec::new() })
    }

    /// The layout of one dense front: `rows` unknowns, of which the first `pivots` are eliminated and the others kept.
    pub fn dense(rows: usize, pivots: usize, symmetric: bool) -> Multifrontal {
        let fronts = Fronts::dense(rows, pivots, if symmetric { 1 } else { 2 });
        Multifrontal { fronts, task: Task::default(), passed: Vec::new(), solution: Vec::new() }
    }

    /// Number of values in the factor.
    pub fn factor_len(&self) -> usize {
        self.fronts.front.last().map_or(0, |last| last.panel + last.panel_len())
    }

    /// Number of values in the matrix left for the kept unknowns: [`dense::room`] for each factor.
    pub fn left_len(&self) -> usize {
        if self.fronts.kept > 0 { self.fronts.front.last().map_or(0, Front::update_len) } else { 0 }
    }

    /// Number of entries of the factor, and of operations that compute it, without the padding of fronts.
    pub fn size(&self) -> FactorSize {
        let mut size = FactorSize::default();
        for front in self.fronts.eliminated() {
            let (k, m) = (front.pivots as f64, front.rows as f64);
            let per_factor = front.pivots * front.rows - front.pivots * (front.pivots.max(1) - 1) / 2;
            size.entries += front.factors * per_factor;
            // Column j of the pivots needs a root, m − j − 1 quotients, and a product and a sum for each entry below
            // and to the right.
            size.operations += front.factors as f64 * (k * m * m - k * k * m + k * k * k / 3.0);
        }
        size
    }

    /// Memory for the factor and working space, [byte].
    pub fn bytes(&self) -> u64 {
        8 * (self.factor_len() + self.solution_len()) as u64 + self.working_bytes()
    }

    /// Memory for the working space of the factorisation, which at the end contains the matrix left for the kept
    /// unknowns, [byte].
    pub fn working_bytes(&self) -> u64 {
        8 * self.task.room as u64
    }

    fn solution_len(&self) -> usize {
        let longest = self.fronts.front.iter().map(|front| front.rows).max();
        self.fronts.unknown.len() + dense::stride(longest.unwrap_or(0))
    }

    /// Writes the factor of the matrix with these values; false if the matrix is not positive definite or, for LU, if a
    /// pivot is zero or not finite.
    pub fn factorise(&mut self, values: &[f64], factor: &mut [f64]) -> bool {
        if self.passed.len() < self.task.room {
            self.passed = vec![0.0; self.task.room];
        }
        let elimination = Elimination { fronts: &self.fronts, values };
        self.fronts.front.is_empty() || elimination.run(&self.task, factor, &mut self.passed)
    }

    /// The matrix that the last factorisation left for the kept unknowns; the call frees the working space. After a
    /// failed factorisation, the values have no meaning; a second call returns no values.
    pub fn take_left(&mut self) -> Vec<f64> {
        let mut left = std::mem::take(&mut self.passed);
        left.truncate(self.left_len());
        left.shrink_to_fit();
        left
    }

    /// True if all pivots of a factor are positive; the pivots of LLᵀ are always positive.
    pub fn has_positive_pivots(&self, factor: &[f64]) -> bool {
        self.fronts.eliminated().iter().all(|front| {
            let panel = &factor[front.panel..front.panel + front.panel_len()];
            let column = dense::stride(front.rows);
            (0..front.pivots).all(|c| panel[c * column + c] > 0.0)
        })
    }

    /// Replaces the right-hand side by the solution.
    pub fn solve(&mut self, factor: &[f64], rhs: &mut [f64]) {
        self.forward(factor, rhs);
        self.backward(factor, &[], rhs);
    }

    /// Forward substitution; returns the reduced right-hand side of the kept unknowns, in the order of these unknowns.
    pub fn forward(&mut self, factor: &[f64], rhs: &[f64]) -> &[f64] {
        if self.solution.is_empty() {
            self.solution = vec![0.0; self.solution_len()];
        }
        let Multifrontal { fronts, solution, .. } = self;
        let (x, y) = solution.split_at_mut(rhs.len());
        for (x, &unknown) in x.iter_mut().zip(&fronts.unknown) {
            *x = rhs[unknown as usize];
        }
        substitute(Pass::Forward, fronts, factor, x, y);
        &x[rhs.len() - fronts.kept..]
    }

    /// Backward substitution after forward substitution, given the solution for the kept unknowns; writes the solution
    /// for all unknowns.
    pub fn backward(&mut self, factor: &[f64], kept: &[f64], solution: &mut [f64]) {
        let (x, y) = self.solution.split_at_mut(solution.len());
        x[solution.len() - kept.len()..].copy_from_slice(kept);
        substitute(Pass::Backward, &self.fronts, factor, x, y);
        for (x, &unknown) in x.iter().zip(&self.fronts.unknown) {
            solution[unknown as usize] = *x;
        }
    }
}
