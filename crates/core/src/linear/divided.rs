//! The direct backend for several ranks: each rank eliminates the unknowns that only its own matrix couples; pairs of
//! ranks, pairs of pairs and so on eliminate the unknowns that they share. Rank 0 gathers and factorises systems that
//! are small or that cannot be solved in this way.

mod stages;
#[cfg(test)]
mod tests;

use super::backend::{Backend, Layout, Solved, Stiffness};
use super::blocks::BlockMatrix;
use super::direct::{LOST, REFINEMENTS, ROUND_OFF, UNPIVOTED_RESIDUAL, WEAK, is_available};
use super::direct_backend::elimination_order;
use super::multifrontal::Multifrontal;
use super::{Factorisation, FreeEntries, Gathered, LinearError, Numbering, Pattern};
use crate::ranks::{Halo, Ranks, sharing};
use stages::{Stages, key};

/// Rank 0 factorises systems with fewer unknowns than this.
const FEWEST: f64 = 2e4;

/// Solves the equations by a factorisation that is divided between the ranks.
pub struct Divided<const D: usize, const N: usize = D> {
    gathered: Gathered<D, N>,
    /// The divided factorisation; `None` while rank 0 factorises.
    parts: Option<Parts<N>>,
    /// Rank 0 factorises systems with fewer unknowns than this.
    fewest: f64,
    /// True if rank 0 factorised the last matrix and found it not positive definite.
    is_indefinite: bool,
}

/// The factorisation on one rank, and the rank's part in the factorisation of the shared unknowns.
struct Parts<const N: usize> {
    /// The unknowns of this rank: the unknowns that its matrix couples, and the unknowns of its own nodes.
    numbering: Numbering<N>,
    entries: FreeEntries,
    pattern: Pattern,
    /// Keys, ascending, and indices of the unknowns that this rank leaves to the stages on several ranks.
    left: Vec<(u64, usize)>,
    /// True for unknowns whose right-hand side is taken from this rank.
    is_own: Vec<bool>,
    own: Multifrontal,
    stages: Stages,
    factor: Vec<f64>,
    matrix: Matrix,
}

/// The factorised matrix.
#[derive(Default)]
struct Matrix {
    /// Values of the matrix entries of this rank.
    values: Vec<f64>,
    /// Diagonal entries of the whole matrix at the unknowns of this rank, and the limit below which an unknown is weak.
    diagonal: Vec<f64>,
    limit: f64,
    factorised: Option<Factorisation>,
}

impl<const D: usize, const N: usize> Default for Divided<D, N> {
    fn default() -> Self {
        Divided { gathered: Gathered::default(), parts: None, fewest: FEWEST, is_indefinite: false }
    }
}

impl<const D: usize, const N: usize> Divided<D, N> {
    /// This backend, set to divide only systems with at least this number of unknowns.
    #[must_use]
    pub fn from(self, fewest: f64) -> Self {
        Divided { fewest, ..self }
    }

    /// Leaves the equations to rank 0 until the next step.
    fn gather(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.parts = None;
        self.gathered.prepare(layout, matrix)
    }
}

impl<const D: usize, const N: usize> Backend<D, N> for Divided<D, N> {
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let count = |node| (0..N).filter(|c| layout.numbering.unknown(node, *c).is_some()).count() as f64;
        let n = layout.halo.sum_over_nodes(layout.numbering.n_nodes(), count);
        // An indefinite matrix is likely to be followed by another indefinite matrix.
        if layout.halo.ranks().is_alone() || n < self.fewest || self.is_indefinite {
            return self.gather(layout, matrix);
        }
        // Frees the memory of the previous step.
        self.gathered = Gathered::default();
        self.parts = Parts::new(layout, matrix, self.parts.take())?;
        if self.parts.is_none() { self.gather(layout, matrix) } else { Ok(()) }
    }

    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        if let Some(parts) = &mut self.parts {
            if parts.factorise(layout.halo, matrix) {
                return Ok(());
            }
            self.gather(layout, matrix)?;
        }
        self.gathered.factorise(layout, matrix)
    }

    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        if let Some(parts) = &mut self.parts {
            if let Some(factorisation) = parts.solve(layout.halo, b, x) {
                return Ok(Solved { factorisation, iterations: 0 });
            }
            // The current matrix replaces the factorised matrix, which may be an earlier one.
            self.gather(layout, &stiffness.matrix)?;
            self.gathered.factorise(layout, &stiffness.matrix)?;
        }
        let solved = self.gathered.solve(layout, stiffness, b, x, tolerance)?;
        self.is_indefinite = !solved.factorisation.is_definite();
        Ok(solved)
    }

    fn release(&mut self) {
        self.parts = None;
        self.gathered = Gathered::default();
    }

    fn is_iterative(&self) -> bool {
        false
    }
}

impl<const N: usize> Parts<N> {
    /// Analyses the pattern of this rank, unless the patterns of all ranks are the same as in `last`. Returns `None` if
    /// the pattern of any rank has no multifrontal layout.
    fn new<const D: usize>(
        layout: &Layout<D, N>,
        matrix: &BlockMatrix<N>,
        last: Option<Self>,
    ) -> Result<Option<Self>, LinearError> {
        let (halo, ranks) = (layout.halo, layout.halo.ranks());
        let takes_part = nodes_in(matrix, halo);
        let is_unknown = |node: usize, c| takes_part[node] && layout.numbering.unknown(node, c).is_some();
        let numbering = Numbering::new(takes_part.len(), is_unknown);
        let mut entries = FreeEntries::new(matrix, &numbering);
        let pattern = std::mem::take(&mut entries.pattern);
        let left = left_of(layout, &numbering, &takes_part);
        let mut is_own = Vec::with_capacity(numbering.count());
        numbering.for_each(|node, _, unknown| {
            if unknown.is_some() {
                is_own.push(halo.is_own(node));
            }
        });
        let last =
            last.filter(|last| last.pattern == pattern && last.left == left && last.numbering == numbering);
        if ranks.all(last.is_some()) {
            return Ok(last.map(|last| Parts { entries, is_own, ..last }));
        }
        drop(last);
        let own = fronts_of(layout, matrix, &numbering, &pattern, &left);
        if !ranks.all(own.is_some()) {
            return Ok(None);
        }
        let Some(own) = own else { return Ok(None) };
        let stages = Stages::new(ranks, left.iter().map(|(key, _)| *key).collect(), pattern.symmetric);
        let needed = bytes(&own, &stages);
        let on_this_machine = ranks.total_on_this_machine(needed);
        if !ranks.all(is_available(needed, on_this_machine)) {
            let most = ranks.largest(on_this_machine as f64);
            return Err(LinearError::OutOfMemory { needed: Some(most as u64) });
        }
        let factor = vec![0.0; own.factor_len()];
        let matrix = Matrix::default();
        Ok(Some(Parts { numbering, entries, pattern, left, is_own, own, stages, factor, matrix }))
    }

    /// Factorises the matrix; false if it has no factor on some rank.
    fn factorise(&mut self, halo: &Halo, matrix: &BlockMatrix<N>) -> bool {
        let Some(communicator) = halo.ranks().communicator() else { return false };
        self.entries.values(matrix, &mut self.matrix.values);
        self.stages.release();
        let is_good = self.own.factorise(&self.matrix.values, &mut self.factor);
        let is_good = self.stages.factorise(communicator, self.own.take_left()) && is_good;
        if !halo.ranks().all(is_good) {
            return false;
        }
        let is_positive = self.own.has_positive_pivots(&self.factor) && self.stages.has_positive_pivots();
        self.matrix.factorised = Some(match (self.pattern.symmetric, halo.ranks().all(is_positive)) {
            (true, _) => Factorisation::Cholesky,
            (false, true) => Factorisation::Lu,
            (false, false) => Factorisation::LuIndefinite,
        });
        self.find_diagonal(halo);
        true
    }

    fn find_diagonal(&mut self, halo: &Halo) {
        let pattern = &self.pattern;
        let diagonal = |j: usize| {
            let rows = pattern.column_start[j]..pattern.column_start[j + 1];
            rows.clone().find(|e| pattern.row[*e] == j).map_or(0.0, |e| self.matrix.values[e])
        };
        let own: Vec<f64> = (0..pattern.n).map(diagonal).collect();
        let mut field = vec![[0.0; N]; self.numbering.n_nodes()];
        self.spread(&own, &mut field);
        halo.add(&mut field);
        let diagonal = self.take(&field);
        self.matrix.limit = WEAK * halo.ranks().largest(diagonal.iter().copied().fold(0.0, f64::max));
        self.matrix.diagonal = diagonal;
    }

    /// Solves for `x`; `None` if the solution is inaccurate, or shows that the matrix must be singular.
    fn solve(&mut self, halo: &Halo, b: &[[f64; N]], x: &mut [[f64; N]]) -> Option<Factorisation> {
        let given = self.take(b);
        let mut solution = self.substitute(halo.ranks(), &given);
        if !self.pattern.symmetric && !self.refine(halo, &given, &mut solution) {
            return None;
        }
        if self.is_lost(halo.ranks(), &solution) {
            return None;
        }
        x.fill([0.0; N]);
        self.spread(&solution, x);
        halo.copy(x);
        self.matrix.factorised
    }

    /// Forward and backward substitution on the unknowns of this rank.
    fn substitute(&mut self, ranks: &Ranks, b: &[f64]) -> Vec<f64> {
        let Some(communicator) = ranks.communicator() else { return b.to_vec() };
        let mut x: Vec<f64> =
            b.iter().zip(&self.is_own).map(|(b, own)| if *own { *b } else { 0.0 }).collect();
        let mut left = self.own.forward(&self.factor, &x).to_vec();
        self.stages.solve(communicator, &mut left);
        self.own.backward(&self.factor, &left, &mut x);
        x
    }

    /// Refines a solution; false if its residual stays large.
    fn refine(&mut self, halo: &Halo, b: &[f64], x: &mut Vec<f64>) -> bool {
        let size = self.norm(halo.ranks(), b);
        let mut rest = self.rest(halo, b, x);
        let mut residual = self.norm(halo.ranks(), &rest);
        for _ in 0..REFINEMENTS {
            if residual <= ROUND_OFF * size || !residual.is_finite() {
                break;
            }
            let mut better = self.substitute(halo.ranks(), &rest);
            better.iter_mut().zip(&*x).for_each(|(change, x)| *change += x);
            let new = self.rest(halo, b, &better);
            let now = self.norm(halo.ranks(), &new);
            if now.is_nan() || now >= residual {
                break;
            }
            (*x, rest, residual) = (better, new, now);
        }
        residual <= UNPIVOTED_RESIDUAL * size
    }

    /// b − A x; the vectors contain the values at the unknowns of this rank.
    fn rest(&self, halo: &Halo, b: &[f64], x: &[f64]) -> Vec<f64> {
        let pattern = &self.pattern;
        let mut product = vec![0.0; pattern.n];
        for j in 0..pattern.n {
            for e in pattern.column_start[j]..pattern.column_start[j + 1] {
                let (i, a) = (pattern.row[e], self.matrix.values[e]);
                product[i] += a * x[j];
                if pattern.symmetric && i != j {
                    product[j] += a * x[i];
                }
            }
        }
        let mut field = vec![[0.0; N]; self.numbering.n_nodes()];
        self.spread(&product, &mut field);
        halo.add(&mut field);
        self.take(&field).iter().zip(b).map(|(product, b)| b - product).collect()
    }

    /// The Euclidean norm over the unknowns of all ranks, each counted once.
    fn norm(&self, ranks: &Ranks, x: &[f64]) -> f64 {
        let squares = x.iter().zip(&self.is_own).filter(|(_, own)| **own).map(|(x, _)| x * x);
        ranks.total(squares.sum()).sqrt()
    }

    /// True if a solution is not finite, or moves weak unknowns so much farther than other unknowns that the matrix
    /// must be singular.
    fn is_lost(&self, ranks: &Ranks, x: &[f64]) -> bool {
        let mut most = [0.0f64; 2];
        for (x, diagonal) in x.iter().zip(&self.matrix.diagonal) {
            let most = &mut most[usize::from(*diagonal < self.matrix.limit)];
            *most = if x.is_nan() { f64::INFINITY } else { most.max(x.abs()) };
        }
        ranks.maximum(&mut most);
        let [strong, weak] = most;
        !strong.is_finite() || !weak.is_finite() || weak > LOST * strong
    }

    /// The values of a nodal field at the unknowns of this rank.
    fn take(&self, field: &[[f64; N]]) -> Vec<f64> {
        let mut values = Vec::with_capacity(self.numbering.count());
        self.numbering.for_each(|node, component, unknown| {
            if unknown.is_some() {
                values.push(field[node][component]);
            }
        });
        values
    }

    /// Writes values at the unknowns of this rank to a nodal field.
    fn spread(&self, values: &[f64], field: &mut [[f64; N]]) {
        self.numbering.for_each(|node, component, unknown| {
            if let Some(unknown) = unknown {
                field[node][component] = values[unknown];
            }
        });
    }
}

/// Peak memory of a factorisation, [byte]. Its working space and the matrices of the stages are not needed at the same
/// time.
fn bytes(own: &Multifrontal, stages: &Stages) -> u64 {
    own.bytes() - own.working_bytes() + own.working_bytes().max(stages.bytes(own.left_len()))
}

/// The multifrontal layout of a rank, without elimination of the unknowns that other ranks also couple; `None` if the
/// pattern of the rank has no such layout.
fn fronts_of<const D: usize, const N: usize>(
    layout: &Layout<D, N>,
    matrix: &BlockMatrix<N>,
    numbering: &Numbering<N>,
    pattern: &Pattern,
    left: &[(u64, usize)],
) -> Option<Multifrontal> {
    let mut is_left = vec![false; numbering.count()];
    left.iter().for_each(|(_, unknown)| is_left[*unknown] = true);
    let is_inside = |node| {
        let mut unknowns = (0..N).filter_map(|c| numbering.unknown(node, c)).peekable();
        unknowns.peek().is_some() && unknowns.all(|unknown| !is_left[unknown])
    };
    let mut order = elimination_order(layout.lattice, numbering, matrix, is_inside);
    order.extend(left.iter().map(|(_, unknown)| *unknown));
    if has_diagonal(pattern) { Multifrontal::partial(pattern, &order, left.len()) } else { None }
}

/// True for each node that has an entry in the matrix of this rank, or belongs to this rank.
fn nodes_in<const N: usize>(matrix: &BlockMatrix<N>, halo: &Halo) -> Vec<bool> {
    let n = matrix.column_start.len() - 1;
    let mut is_in: Vec<bool> = (0..n).map(|node| halo.is_own(node)).collect();
    matrix.for_each(|row, column, _| {
        is_in[row] = true;
        is_in[column] = true;
    });
    is_in
}

/// The unknowns of nodes that other ranks also have in their matrices: their keys, ascending, and their indices.
fn left_of<const D: usize, const N: usize>(
    layout: &Layout<D, N>,
    numbering: &Numbering<N>,
    takes_part: &[bool],
) -> Vec<(u64, usize)> {
    let (nodes, ranks) = (layout.nodes, layout.halo.ranks());
    let mut border: Vec<u32> = layout.halo.neighbours().flat_map(|(_, nodes)| nodes).copied().collect();
    border.sort_unstable();
    border.dedup();
    let here = border.iter().filter(|node| takes_part[**node as usize]);
    let here: Vec<(u32, bool)> = here.map(|node| (nodes[*node as usize], true)).collect();
    let n_nodes = 1.0 + ranks.largest(nodes.last().map_or(0.0, |node| f64::from(*node)));
    let mut left = Vec::new();
    for (node, sharers) in sharing(ranks, &here, n_nodes as usize) {
        let Ok(active) = nodes.binary_search(&node) else { continue };
        for component in 0..N {
            if let Some(unknown) = numbering.unknown(active, component) {
                let name = u64::from(node) * N as u64 + component as u64;
                left.push((key(name, sharers.iter().map(|sharer| sharer.rank)), unknown));
            }
        }
    }
    left.sort_unstable();
    left
}

/// True if each unknown has a diagonal entry.
fn has_diagonal(pattern: &Pattern) -> bool {
    (0..pattern.n)
        .all(|j| pattern.row[pattern.column_start[j]..pattern.column_start[j + 1]].binary_search(&j).is_ok())
}
