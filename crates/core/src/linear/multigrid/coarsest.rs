//! The direct solution on the coarsest level. If there are several ranks, each rank has the whole matrix of this level.

use super::super::reduction::agree;
use super::super::{Direct, LinearError, Pattern, ordering};
use super::level::Level;

/// The factor of the matrix of the coarsest level, and the nodes of all ranks on this level.
#[derive(Default)]
pub(super) struct Coarsest {
    direct: Direct,
    values: Vec<f64>,
    /// The index, among all nodes, of each node of this rank and of each of its ghosts.
    number: Vec<u32>,
    /// The indices of the own nodes of each rank, if there are several ranks.
    nodes_by_rank: Vec<Vec<u32>>,
    /// The start of the entries of each node among the entries of the matrix.
    start: Vec<usize>,
}

impl Coarsest {
    /// Prepares for the pattern of a level.
    ///
    /// # Errors
    /// [`LinearError::OutOfMemory`], on all ranks.
    pub(super) fn analyse<const D: usize, const N: usize>(
        &mut self,
        level: &Level<D, N>,
    ) -> Result<(), LinearError> {
        self.number = (0..level.lattice.len() as u32).collect();
        let mut gathered = None;
        if let Some(shared) = &level.shared {
            let ranks = &shared.ghosts.ranks;
            let keys = ranks.gather_all(shared.known.key[..shared.known.own].to_vec());
            let mut all = keys.concat();
            all.sort_unstable();
            let number = |key: &u64| all.partition_point(|other| other < key) as u32;
            self.number = shared.known.key.iter().map(number).collect();
            self.nodes_by_rank = keys.iter().map(|keys| keys.iter().map(number).collect()).collect();
            gathered = Some(all.iter().map(|key| level.lattice.place_of(*key)).collect::<Vec<_>>());
        }
        let places = gathered.as_ref().unwrap_or(&level.lattice.place);
        let mut rows: Vec<Vec<u32>> = (0..level.rows.len())
            .map(|node| self.entries(level, node).into_iter().map(|(other, _)| other).collect())
            .collect();
        if let Some(shared) = &level.shared {
            let gathered = shared.ghosts.ranks.gather_all(rows);
            rows = vec![Vec::new(); places.len()];
            for (nodes, columns) in self.nodes_by_rank.iter().zip(gathered) {
                for (node, columns) in nodes.iter().zip(columns) {
                    rows[*node as usize] = columns;
                }
            }
        }
        let pattern = lower_triangle::<N>(&rows);
        self.start = pattern.column_start.iter().copied().step_by(N).collect();
        let nodes = ordering::nested_dissection(places, level.lattice.reach);
        let order = nodes.iter().flat_map(|&node| (0..N).map(move |d| N * node + d)).collect();
        let outcome = self.direct.analyse(pattern, order).map(|_| ());
        match &level.shared {
            None => outcome,
            Some(shared) => agree(&shared.ghosts.ranks, outcome),
        }
    }

    /// The columns of the row of an own node, from the diagonal on: the number of each column, ascending, and its index
    /// in the row.
    fn entries<const D: usize, const N: usize>(&self, level: &Level<D, N>, node: usize) -> Vec<(u32, usize)> {
        let columns = level.rows.columns(node).iter().enumerate();
        let mut entries: Vec<(u32, usize)> = columns
            .map(|(place, other)| (self.number[*other as usize], place))
            .filter(|(other, _)| *other >= self.number[node])
            .collect();
        entries.sort_unstable();
        entries
    }

    /// Factorises the matrix of the level; returns true if it is positive definite.
    ///
    /// # Errors
    /// [`LinearError`], on all ranks.
    pub(super) fn factorise<const D: usize, const N: usize>(
        &mut self,
        level: &Level<D, N>,
    ) -> Result<bool, LinearError> {
        let mut values = std::mem::take(&mut self.values);
        values.clear();
        for node in 0..level.rows.len() {
            let entries = self.entries(level, node);
            for i in 0..N {
                let row = level.rows.component(node, i);
                for (other, place) in &entries {
                    let first = if *other == self.number[node] { i } else { 0 };
                    values.extend((first..N).map(|k| f64::from(row[place * N + k])));
                }
            }
        }
        if let Some(shared) = &level.shared {
            let gathered = shared.ghosts.ranks.gather_all(values);
            values = vec![0.0; self.start.last().copied().unwrap_or(0)];
            for (nodes, entries) in self.nodes_by_rank.iter().zip(&gathered) {
                let mut from = 0;
                for node in nodes {
                    let to = self.start[*node as usize]..self.start[*node as usize + 1];
                    let n = to.len();
                    values[to].copy_from_slice(&entries[from..from + n]);
                    from += n;
                }
            }
        }
        self.values = values;
        let outcome = self.direct.factorise(&self.values).map(|kind| kind.is_definite());
        match &level.shared {
            None => outcome,
            Some(shared) => agree(&shared.ghosts.ranks, outcome),
        }
    }

    /// Solves for the field of the level, given the right-hand side on that level.
    ///
    /// # Errors
    /// [`LinearError`], on all ranks.
    pub(super) fn solve<const D: usize, const N: usize>(
        &mut self,
        level: &mut Level<D, N>,
    ) -> Result<(), LinearError> {
        let Some(shared) = &level.shared else {
            level.x.copy_from_slice(&level.b);
            return self.direct.solve(level.x.as_flattened_mut());
        };
        let ranks = &shared.ghosts.ranks;
        let parts = ranks.gather_all(level.b[..level.rows.len()].as_flattened().to_vec());
        let mut x = vec![0.0; N * self.start.len().saturating_sub(1)];
        let (x, _) = x.as_chunks_mut::<N>();
        for (nodes, part) in self.nodes_by_rank.iter().zip(&parts) {
            for (node, b) in nodes.iter().zip(part.as_chunks::<N>().0) {
                x[*node as usize] = *b;
            }
        }
        agree(ranks, self.direct.solve(x.as_flattened_mut()))?;
        for (to, number) in level.x.iter_mut().zip(&self.number) {
            *to = x[*number as usize];
        }
        Ok(())
    }
}

/// The lower triangle by columns, given the columns of each row from the diagonal on. Rows and columns can be
/// interchanged because the matrix is symmetric.
fn lower_triangle<const N: usize>(rows: &[Vec<u32>]) -> Pattern {
    let n = N * rows.len();
    let mut pattern = Pattern { n, column_start: vec![0], row: Vec::new(), symmetric: true };
    for (node, columns) in rows.iter().enumerate() {
        for i in 0..N {
            for &other in columns {
                let first = if other as usize == node { i } else { 0 };
                pattern.row.extend((first..N).map(|k| N * other as usize + k));
            }
            pattern.column_start.push(pattern.row.len());
        }
    }
    pattern
}
