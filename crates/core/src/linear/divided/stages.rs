//! The fronts of the unknowns that several ranks couple, along a binary tree of the ranks: at stage s, rank r with r
//! mod 2ˢ⁺¹ = 0 takes over the matrix that remains on rank r + 2ˢ, and eliminates the unknowns that only ranks from r
//! to r + 2ˢ⁺¹ − 1 couple.

use crate::linear::multifrontal::{Columns, Multifrontal, Numbers, forget, messages};
use crate::ranks::{Communicator, Ranks};

/// Lowest of the bits of a key that hold the stage at which its unknown is eliminated; the bits below hold the name.
const STAGE: u32 = 56;

/// The key of the unknown with this name, given the ranks that couple it. Shared unknowns are ordered by their keys.
pub(super) fn key(name: u64, ranks: impl Iterator<Item = u32> + Clone) -> u64 {
    let (low, high) = (ranks.clone().min().unwrap_or(0), ranks.max().unwrap_or(0));
    // Two ranks meet at stage s if bit s is the highest bit in which their numbers differ.
    let stage = u64::from(u32::BITS - (low ^ high).leading_zeros());
    stage.saturating_sub(1) << STAGE | name
}

/// The tasks of one rank in the tree, after its own factorisation.
#[derive(Default)]
pub(super) struct Stages {
    taken: Vec<Stage>,
    given: Option<Given>,
    /// Number of factors: one for LLᵀ, two for LU.
    factors: usize,
}

/// A stage, at which two matrices are combined into one front.
struct Stage {
    /// The rank that provides the other matrix.
    from: usize,
    /// Row indices in the front for the unknowns of this rank's matrix and of the other matrix, ascending.
    rows: [Vec<u32>; 2],
    /// Number of unknowns that are eliminated.
    pivots: usize,
    front: Multifrontal,
    /// True if the other matrix adds no unknowns and all unknowns are eliminated: the factor then replaces this rank's
    /// matrix in place.
    is_in_place: bool,
    /// The factor; empty before each factorisation.
    factor: Vec<f64>,
    /// Right-hand side and solution on the unknowns of the front.
    x: Vec<f64>,
}

/// The remaining matrix, which is sent to another rank.
struct Given {
    to: usize,
    /// Order of the matrix.
    n: usize,
    /// Number of its unknowns that the other rank eliminates.
    pivots: usize,
}

impl Stages {
    /// The stages after the factorisation of a rank that leaves unknowns with these keys, ascending. All ranks must
    /// call this.
    pub fn new(ranks: &Ranks, mut keys: Vec<u64>, symmetric: bool) -> Self {
        let mut stages = Stages { factors: if symmetric { 1 } else { 2 }, ..Stages::default() };
        let own = ranks.own();
        for stage in (0..).take_while(|stage| 1 << stage < ranks.count()) {
            let distance: usize = 1 << stage;
            let end = (stage + 1) << STAGE;
            let gives = own.is_multiple_of(distance) && !own.is_multiple_of(2 * distance);
            let given = gives.then(|| {
                let pivots = keys.partition_point(|key| *key < end);
                stages.given = Some(Given { to: own - distance, n: keys.len(), pivots });
                (own - distance, std::mem::take(&mut keys))
            });
            for (from, others) in ranks.exchange(given.into_iter().collect()) {
                let mut all = [&keys[..], &others[..]].concat();
                all.sort_unstable();
                all.dedup();
                let pivots = all.partition_point(|key| *key < end);
                let row = |key: &u64| all.partition_point(|other| other < key) as u32;
                stages.taken.push(Stage {
                    from,
                    rows: [keys.iter().map(row).collect(), others.iter().map(row).collect()],
                    pivots,
                    front: Multifrontal::dense(all.len(), pivots, symmetric),
                    is_in_place: pivots == keys.len() && keys.len() == all.len(),
                    factor: Vec::new(),
                    x: vec![0.0; all.len()],
                });
                keys = all.split_off(pivots);
            }
        }
        stages
    }

    /// Number of values in the factors.
    #[cfg(test)]
    pub fn factor_len(&self) -> usize {
        self.taken.iter().map(|stage| stage.front.factor_len()).sum()
    }

    /// Peak memory of a factorisation that starts with a matrix of this many values, [byte].
    pub fn bytes(&self, left: usize) -> u64 {
        let (mut kept, mut left, mut most) = (0, left, left);
        for stage in &self.taken {
            let (factor, above) = (stage.front.factor_len(), stage.front.left_len());
            let border = stage.rows[0].len() - stage.border_of(&stage.rows[0]);
            let rest = left * border / stage.rows[0].len().max(1);
            let stage_most = if stage.is_in_place { left } else { factor + left.max(above + rest) };
            most = most.max(kept + stage_most);
            kept += factor;
            left = above;
        }
        8 * most as u64
    }

    /// Frees the factors.
    pub fn release(&mut self) {
        self.taken.iter_mut().for_each(|stage| stage.factor = Vec::new());
    }

    /// Factorises the matrix that remains on this rank. All ranks must call this. Returns false if, on this rank, a
    /// pivot of LLᵀ is not positive, or a pivot of LU is zero or not finite.
    pub fn factorise(&mut self, communicator: &dyn Communicator, mut left: Vec<f64>) -> bool {
        let mut is_good = true;
        for stage in &mut self.taken {
            is_good &= stage.factorise(communicator, self.factors, &mut left);
        }
        if let Some(Given { to, n, pivots }) = self.given {
            for (range, _) in messages(n, pivots, self.factors) {
                let columns = Columns { n, range, numbers: Numbers::From(0, &left) };
                communicator.swap(&[to], &[columns.packed(self.factors)], &mut [Vec::new()]);
            }
        }
        is_good
    }

    /// True if all pivots of the factors of this rank are positive.
    pub fn has_positive_pivots(&self) -> bool {
        self.taken.iter().all(|stage| stage.front.has_positive_pivots(&stage.factor))
    }

    /// Replaces the right-hand sides of the unknowns that remain on this rank by the solution. All ranks must call
    /// this.
    pub fn solve(&mut self, communicator: &dyn Communicator, x: &mut [f64]) {
        let mut below = x.to_vec();
        for stage in &mut self.taken {
            below = stage.forward(communicator, &below);
        }
        if let Some(Given { to, .. }) = self.given {
            communicator.swap(&[to], &[below.clone()], &mut [Vec::new()]);
            let mut solution = [below];
            communicator.swap(&[to], &[Vec::new()], &mut solution);
            [below] = solution;
        }
        for stage in self.taken.iter_mut().rev() {
            below = stage.backward(communicator, &below);
        }
        x.copy_from_slice(&below);
    }
}

impl Stage {
    /// Replaces the matrix left by the previous factorisation by the matrix that this stage leaves; returns false in
    /// the same cases as [`Multifrontal::factorise`].
    fn factorise(&mut self, communicator: &dyn Communicator, factors: usize, left: &mut Vec<f64>) -> bool {
        if self.is_in_place {
            self.factor = std::mem::take(left);
            return self.take_others(communicator, factors, left);
        }
        self.factor = vec![0.0; self.front.factor_len()];
        let (n, border) = (self.rows[0].len(), self.border_of(&self.rows[0]));
        let own = Columns { n, range: 0..border, numbers: Numbers::From(0, left) };
        self.front.add_columns(&mut self.factor, &mut [], &own, &self.rows[0]);
        forget(left, n, border, factors);
        let mut above = vec![0.0; self.front.left_len()];
        let is_good = self.take_others(communicator, factors, &mut above);
        let own = Columns { n, range: border..n, numbers: Numbers::From(border, left) };
        self.front.add_columns(&mut self.factor, &mut above, &own, &self.rows[0]);
        *left = above;
        is_good
    }

    /// Number of columns that belong to pivots, among columns with these row indices; the others belong to the border.
    fn border_of(&self, rows: &[u32]) -> usize {
        rows.partition_point(|row| (*row as usize) < self.pivots)
    }

    /// Adds the columns of the other rank; eliminates the pivots before the columns of the border are added to the
    /// remaining matrix.
    fn take_others(&mut self, communicator: &dyn Communicator, factors: usize, left: &mut [f64]) -> bool {
        let rows = &self.rows[1];
        let border = self.border_of(rows);
        let mut is_eliminated = None;
        for (range, len) in messages(rows.len(), border, factors) {
            if range.start >= border {
                is_eliminated.get_or_insert_with(|| self.front.eliminate(&mut self.factor, left));
            }
            let mut message = [vec![0.0; len]];
            communicator.swap(&[self.from], &[Vec::new()], &mut message);
            let columns = Columns { n: rows.len(), range, numbers: Numbers::Packed(&message[0]) };
            self.front.add_columns(&mut self.factor, left, &columns, rows);
        }
        is_eliminated.unwrap_or_else(|| self.front.eliminate(&mut self.factor, left))
    }

    /// Forward substitution; returns the reduced right-hand side of the unknowns that are left.
    fn forward(&mut self, communicator: &dyn Communicator, below: &[f64]) -> Vec<f64> {
        let mut other = [vec![0.0; self.rows[1].len()]];
        communicator.swap(&[self.from], &[Vec::new()], &mut other);
        self.x.fill(0.0);
        for (rows, numbers) in self.rows.iter().zip([below, &other[0]]) {
            rows.iter().zip(numbers).for_each(|(row, number)| self.x[*row as usize] += number);
        }
        self.front.forward(&self.factor, &self.x).to_vec()
    }

    /// Backward substitution, given the solution for the unknowns that were left; returns the solution for the unknowns
    /// of this rank's matrix.
    fn backward(&mut self, communicator: &dyn Communicator, above: &[f64]) -> Vec<f64> {
        self.front.backward(&self.factor, above, &mut self.x);
        let [below, other] =
            self.rows.each_ref().map(|rows| rows.iter().map(|row| self.x[*row as usize]).collect());
        communicator.swap(&[self.from], &[other], &mut [Vec::new()]);
        below
    }
}
