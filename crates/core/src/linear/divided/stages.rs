//! The fronts of the unknowns that several ranks couple, along a binary tree of the ranks: at stage s, rank r with r mod 2ˢ⁺¹ = 0
//! takes what rank r + 2ˢ has left, and eliminates the unknowns that only ranks from r to r + 2ˢ⁺¹ − 1 couple.

use crate::linear::multifrontal::{Columns, Multifrontal, Numbers, messages};
use crate::ranks::{Communicator, Ranks};

/// The stage at which an unknown is eliminated is kept in the bits of its key from this one on; the others are its name.
const STAGE: u32 = 56;

/// The key of an unknown with this name, by which shared unknowns are ordered, if these ranks couple it.
pub(super) fn key(name: u64, ranks: impl Iterator<Item = u32> + Clone) -> u64 {
    let (low, high) = (ranks.clone().min().unwrap_or(0), ranks.max().unwrap_or(0));
    // Numbers of ranks that differ in bit s, and in no higher one, meet at stage s.
    let stage = u64::from(u32::BITS - (low ^ high).leading_zeros());
    stage.saturating_sub(1) << STAGE | name
}

/// The part of a rank in the tree, from its own factorisation on.
#[derive(Default)]
pub(super) struct Stages {
    taken: Vec<Stage>,
    given: Option<Given>,
    /// Number of factors: one of LLᵀ, two of LU.
    factors: usize,
}

/// Two matrices become one front.
struct Stage {
    /// The rank that gives the other matrix.
    from: usize,
    /// Rows in the front of the unknowns of the own matrix and of the other one, ascending.
    rows: [Vec<u32>; 2],
    /// Number of unknowns that are eliminated.
    pivots: usize,
    front: Multifrontal,
    /// True if the front takes the place of what the rank's own factorisation has left.
    is_in_place: bool,
    /// The factor, unless it is in that place.
    factor: Vec<f64>,
    /// Right-hand side and solution on the unknowns of the front.
    x: Vec<f64>,
}

/// The matrix that is left goes to another rank.
struct Given {
    to: usize,
    /// Order of the matrix.
    n: usize,
    /// Number of its unknowns which that rank eliminates.
    pivots: usize,
}

impl Stages {
    /// The stages above a rank that leaves unknowns with these keys, ascending. All ranks must call this.
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
                    is_in_place: stages.taken.is_empty() && pivots == keys.len() && keys.len() == all.len(),
                    factor: Vec::new(),
                    x: vec![0.0; all.len()],
                });
                keys = all.split_off(pivots);
            }
        }
        stages
    }

    /// Memory for the factors, [byte].
    pub fn bytes(&self) -> u64 {
        let in_addition = self.taken.iter().filter(|stage| !stage.is_in_place);
        8 * in_addition.map(|stage| stage.front.factor_len() as u64).sum::<u64>()
    }

    /// Factorises the matrix that this rank has left, in its place. All ranks must call this. False if this rank has met a pivot
    /// that is not positive, or is zero.
    pub fn factorise(&mut self, communicator: &dyn Communicator, left: &mut [f64]) -> bool {
        let mut is_good = true;
        let mut below = left;
        for stage in &mut self.taken {
            is_good &= stage.factorise(communicator, self.factors, below);
            let rest = stage.front.left();
            below = if stage.is_in_place { &mut [] } else { &mut stage.factor[rest..] };
        }
        if let Some(Given { to, n, pivots }) = self.given {
            for (range, _) in messages(n, pivots, self.factors) {
                let columns = Columns { n, range, numbers: Numbers::Whole(below) };
                communicator.swap(&[to], &[columns.packed(self.factors)], &mut [Vec::new()]);
            }
        }
        is_good
    }

    /// True if all pivots of the factors of this rank are positive.
    pub fn has_positive_pivots(&self, left: &[f64]) -> bool {
        self.taken.iter().all(|stage| stage.front.has_positive_pivots(stage.factor_in(left)))
    }

    /// Replaces the right-hand sides of the unknowns that this rank has left by the solution. All ranks must call this.
    pub fn solve(&mut self, communicator: &dyn Communicator, left: &[f64], x: &mut [f64]) {
        let mut below = x.to_vec();
        for stage in &mut self.taken {
            below = stage.forward(communicator, left, &below);
        }
        if let Some(Given { to, .. }) = self.given {
            communicator.swap(&[to], &[below.clone()], &mut [Vec::new()]);
            let mut solution = [below];
            communicator.swap(&[to], &[Vec::new()], &mut solution);
            [below] = solution;
        }
        for stage in self.taken.iter_mut().rev() {
            below = stage.backward(communicator, left, &below);
        }
        x.copy_from_slice(&below);
    }
}

impl Stage {
    /// The factor, which is in the place of what the factorisation below has left, or here.
    fn factor_in<'a>(&'a self, left: &'a [f64]) -> &'a [f64] {
        if self.is_in_place { left } else { &self.factor }
    }

    fn factorise(&mut self, communicator: &dyn Communicator, factors: usize, below: &mut [f64]) -> bool {
        if self.is_in_place {
            return self.take_others(communicator, factors, below);
        }
        let mut factor = std::mem::take(&mut self.factor);
        factor.resize(self.front.factor_len(), 0.0);
        self.front.clear_pivots(&mut factor);
        let (own, numbers) = (&self.rows[0], Numbers::Whole(below));
        let (n, border) = (own.len(), self.border_of(own));
        self.front.add_columns(&mut factor, &Columns { n, range: 0..border, numbers }, own);
        let is_good = self.take_others(communicator, factors, &mut factor);
        self.front.add_columns(&mut factor, &Columns { n, range: border..n, numbers }, own);
        self.factor = factor;
        is_good
    }

    /// Number of the columns with these rows that belong to pivots; the others belong to the border.
    fn border_of(&self, rows: &[u32]) -> usize {
        rows.partition_point(|row| (*row as usize) < self.pivots)
    }

    /// Adds the columns of the other rank, and eliminates the pivots before those of the border.
    fn take_others(&self, communicator: &dyn Communicator, factors: usize, factor: &mut [f64]) -> bool {
        let rows = &self.rows[1];
        let border = self.border_of(rows);
        let mut is_eliminated = None;
        for (range, len) in messages(rows.len(), border, factors) {
            if range.start >= border {
                is_eliminated.get_or_insert_with(|| self.front.eliminate(factor));
            }
            let mut message = [vec![0.0; len]];
            communicator.swap(&[self.from], &[Vec::new()], &mut message);
            let columns = Columns { n: rows.len(), range, numbers: Numbers::Packed(&message[0]) };
            self.front.add_columns(factor, &columns, rows);
        }
        is_eliminated.unwrap_or_else(|| self.front.eliminate(factor))
    }

    /// Forward substitution; returns the right-hand sides that are left.
    fn forward(&mut self, communicator: &dyn Communicator, left: &[f64], below: &[f64]) -> Vec<f64> {
        let mut other = [vec![0.0; self.rows[1].len()]];
        communicator.swap(&[self.from], &[Vec::new()], &mut other);
        self.x.fill(0.0);
        for (rows, numbers) in self.rows.iter().zip([below, &other[0]]) {
            rows.iter().zip(numbers).for_each(|(row, number)| self.x[*row as usize] += number);
        }
        let factor = if self.is_in_place { left } else { &self.factor };
        self.front.forward(factor, &self.x).to_vec()
    }

    /// Backward substitution, given the solution for the unknowns that were left; returns that for the own unknowns below.
    fn backward(&mut self, communicator: &dyn Communicator, left: &[f64], above: &[f64]) -> Vec<f64> {
        let factor = if self.is_in_place { left } else { &self.factor };
        self.front.backward(factor, above, &mut self.x);
        let [below, other] =
            self.rows.each_ref().map(|rows| rows.iter().map(|row| self.x[*row as usize]).collect());
        communicator.swap(&[self.from], &[other], &mut [Vec::new()]);
        below
    }
}
