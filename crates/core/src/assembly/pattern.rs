//! The coupled pairs of nodes, and the indices of the blocks of each group.

use std::ops::Range;

use crate::basis::Connectivity;
use crate::linear::{Block, BlockMatrix, Division};

/// Marks a dense pair whose nodes are not coupled within their group.
pub(crate) const UNCOUPLED: u32 = u32::MAX;

/// Calls its argument with ascending lists of active nodes; all nodes of a list are coupled with one another.
pub type Couples<'a> = dyn Fn(&mut dyn FnMut(&[u32])) + 'a;

/// The coupled pairs of active nodes, column by column; in a symmetric system, only the pairs with row ≥ column.
pub(crate) struct NodePairs {
    symmetric: bool,
    column_start: Vec<usize>,
    row: Vec<u32>,
    /// Index, in `position`, of the first dense pair of each group; dense pairs are all pairs of nodes of the group.
    group_start: Vec<usize>,
    /// For each dense pair of each group, its index among the pairs, or [`UNCOUPLED`].
    position: Vec<u32>,
}

/// Index of the dense pair (a, b) in a group of n nodes.
fn dense_pair(symmetric: bool, n: usize, a: usize, b: usize) -> usize {
    if symmetric { a * (a + 1) / 2 + b } else { a * n + b }
}

impl NodePairs {
    /// The pairs of nodes that share a point, all pairs of the groups for which `is_dense` is true, and the pairs that
    /// `couples` lists.
    pub(crate) fn new<const D: usize>(
        links: &Connectivity<D>,
        symmetric: bool,
        is_dense: &dyn Fn(usize) -> bool,
        couples: &Couples,
    ) -> Self {
        let mut group_start = vec![0];
        for group in 0..links.n_groups() {
            let n = links.nodes_of(group).len();
            let dense = if symmetric { n * (n + 1) / 2 } else { n * n };
            group_start.push(group_start[group] + dense);
        }
        let mut pairs = NodePairs {
            symmetric,
            column_start: Vec::new(),
            row: Vec::new(),
            position: vec![UNCOUPLED; group_start[links.n_groups()]],
            group_start,
        };
        pairs.mark_coupled(links, is_dense);
        pairs.collect_columns(links, couples);
        pairs.place(links);
        pairs
    }

    /// Marks with 0 the dense pairs whose nodes share a point, and all pairs of dense groups.
    fn mark_coupled<const D: usize>(&mut self, links: &Connectivity<D>, is_dense: &dyn Fn(usize) -> bool) {
        for group in 0..links.n_groups() {
            let n = links.nodes_of(group).len();
            let marks = &mut self.position[self.group_start[group]..self.group_start[group + 1]];
            if is_dense(group) {
                marks.fill(0);
                continue;
            }
            let mut last: &[u32] = &[];
            for p in links.points_of(group) {
                let local = links.local_nodes(p);
                if local == last {
                    continue; // neighbours in a cell usually touch the same nodes
                }
                last = local;
                for (k, &b) in local.iter().enumerate() {
                    let rows = if self.symmetric { &local[k..] } else { local };
                    for &a in rows {
                        marks[dense_pair(self.symmetric, n, a as usize, b as usize)] = 0;
                    }
                }
            }
        }
    }

    /// Calls `visit(row, column, dense pair)` for the marked pairs of a group, column by column.
    fn coupled_in<const D: usize>(
        &self,
        links: &Connectivity<D>,
        group: usize,
        mut visit: impl FnMut(usize, usize, usize),
    ) {
        let nodes = links.nodes_of(group);
        let start = self.group_start[group];
        for b in 0..nodes.len() {
            for a in if self.symmetric { b } else { 0 }..nodes.len() {
                let pair = start + dense_pair(self.symmetric, nodes.len(), a, b);
                if self.position[pair] != UNCOUPLED {
                    visit(nodes[a] as usize, nodes[b] as usize, pair);
                }
            }
        }
    }

    /// Calls `visit(row, column)` for the pairs that terms and ties couple in addition to the groups.
    fn coupled_by(&self, couples: &Couples, mut visit: impl FnMut(usize, usize)) {
        couples(&mut |nodes: &[u32]| {
            for (a, &row) in nodes.iter().enumerate() {
                for &column in &nodes[..=a] {
                    visit(row as usize, column as usize);
                    if !self.symmetric && row != column {
                        visit(column as usize, row as usize);
                    }
                }
            }
        });
    }

    /// The index of a pair; `None` if its nodes are not coupled, or if row < column in a symmetric system.
    pub(crate) fn place_of(&self, row: u32, column: u32) -> Option<usize> {
        let first = self.column_start[column as usize];
        let rows = &self.row[first..self.column_start[column as usize + 1]];
        rows.binary_search(&row).ok().map(|at| first + at)
    }

    /// Merges the pairs of all groups and the pairs that terms and ties couple into sorted columns.
    fn collect_columns<const D: usize>(&mut self, links: &Connectivity<D>, couples: &Couples) {
        let n = links.n_active();
        let mut count = vec![0usize; n + 1];
        for group in 0..links.n_groups() {
            self.coupled_in(links, group, |_, column, _| count[column + 1] += 1);
        }
        self.coupled_by(couples, |_, column| count[column + 1] += 1);
        for c in 0..n {
            count[c + 1] += count[c];
        }
        let mut next = count.clone();
        let mut rows = vec![0u32; count[n]];
        for group in 0..links.n_groups() {
            self.coupled_in(links, group, |row, column, _| {
                rows[next[column]] = row as u32;
                next[column] += 1;
            });
        }
        self.coupled_by(couples, |row, column| {
            rows[next[column]] = row as u32;
            next[column] += 1;
        });
        self.column_start.push(0);
        for c in 0..n {
            let column = &mut rows[count[c]..count[c + 1]];
            column.sort_unstable();
            let mut previous = None;
            for &row in column.iter() {
                if previous != Some(row) {
                    self.row.push(row);
                    previous = Some(row);
                }
            }
            self.column_start.push(self.row.len());
        }
    }

    /// Gives every marked dense pair its index among the pairs.
    fn place<const D: usize>(&mut self, links: &Connectivity<D>) {
        let mut position = std::mem::take(&mut self.position);
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            let start = self.group_start[group];
            for b in 0..nodes.len() {
                let column = nodes[b] as usize;
                let first = self.column_start[column];
                let rows = &self.row[first..self.column_start[column + 1]];
                let mut at = 0; // both the nodes of a group and the rows of a column ascend
                for a in if self.symmetric { b } else { 0 }..nodes.len() {
                    let pair = &mut position[start + dense_pair(self.symmetric, nodes.len(), a, b)];
                    if *pair != UNCOUPLED {
                        while rows[at] < nodes[a] {
                            at += 1;
                        }
                        *pair = (first + at) as u32;
                    }
                }
            }
        }
        self.position = position;
    }

    pub(crate) fn symmetric(&self) -> bool {
        self.symmetric
    }

    pub(crate) fn n_pairs(&self) -> usize {
        self.row.len()
    }

    /// Range of the dense pairs of some groups among the dense pairs of all groups.
    pub(crate) fn dense_range(&self, groups: Range<usize>) -> Range<usize> {
        self.group_start[groups.start]..self.group_start[groups.end]
    }

    /// Indices of the dense pairs of a group.
    pub(crate) fn positions(&self, group: usize) -> &[u32] {
        &self.position[self.group_start[group]..self.group_start[group + 1]]
    }

    /// The matrix with these blocks at the coupled pairs.
    pub(crate) fn matrix<'a, const D: usize>(&'a self, blocks: &'a [Block<D>]) -> BlockMatrix<'a, D> {
        BlockMatrix { symmetric: self.symmetric, column_start: &self.column_start, row: &self.row, blocks }
    }

    /// The division of the matrix columns into tasks, for products with a vector.
    pub(crate) fn division<const D: usize>(&self) -> Division<D> {
        Division::new(&self.column_start, &self.row)
    }

    /// Calls `visit(row, column, index)` for every pair.
    pub(crate) fn for_each(&self, mut visit: impl FnMut(usize, usize, usize)) {
        for column in 0..self.column_start.len() - 1 {
            for place in self.column_start[column]..self.column_start[column + 1] {
                visit(self.row[place] as usize, column, place);
            }
        }
    }
}
