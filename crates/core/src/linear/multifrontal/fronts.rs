//! The layout of the factorisation: the rows of each front, its matrix entries, the rows to which it adds the updates
//! of its children, and its location in memory.

use std::ops::Range;

use super::dense;
use super::mirror::Mirror;
use super::nodes::{NONE, Nodes};
use super::tree::{self, Tree};
use crate::linear::Pattern;

/// A front: unknowns that are eliminated together, and a border of the later unknowns to which they are coupled.
#[derive(Debug, Clone, Default)]
pub(super) struct Front {
    /// Position of its first unknown in the order of elimination.
    pub first: usize,
    /// Number of unknowns that are eliminated.
    pub pivots: usize,
    /// Number of rows: pivots and border.
    pub rows: usize,
    /// Number of factors, each with columns and an update of its own: one for LLᵀ, two for LU.
    pub factors: usize,
    /// Start of its border in the lists of borders.
    pub border: usize,
    /// Start of its columns in the factor.
    pub panel: usize,
    /// Start of its update in the working space of its task.
    pub update: usize,
    /// Start of its update in the working space of the task of its parent.
    pub passed: usize,
    /// Its parent, or [`NONE`].
    pub parent: u32,
    /// Range of its children in the list of all children.
    pub children: Range<usize>,
    /// Estimated time for this front and all its descendants, [ns].
    pub cost: f64,
    /// First of its descendants, or this front if it has none; the other descendants lie in between.
    pub descendants: usize,
}

impl Front {
    /// Number of values in its columns, summed over all factors.
    pub fn panel_len(&self) -> usize {
        self.factors * dense::room(self.rows, self.pivots)
    }

    /// Number of rows of its border.
    pub fn border_len(&self) -> usize {
        self.rows - self.pivots
    }

    /// Number of values in its update, summed over all factors.
    pub fn update_len(&self) -> usize {
        self.factors * dense::room(self.border_len(), self.border_len())
    }
}

/// An entry of the matrix in a column of a front.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Entry {
    /// Row in the front.
    pub row: u32,
    /// Index in the values of the matrix.
    pub source: u32,
}

/// The fronts of a pattern, children before their parents.
pub(super) struct Fronts {
    pub front: Vec<Front>,
    /// The children of all fronts.
    pub children: Vec<u32>,
    /// Unknowns in the order of elimination.
    pub unknown: Vec<u32>,
    /// The borders of all fronts: positions of the unknowns in the order of elimination, ascending.
    pub border: Vec<u32>,
    /// The borders of all fronts: rows in the parent.
    pub relative: Vec<u32>,
    /// Start of the entries of each column.
    pub column_start: Vec<usize>,
    /// For each factor, the matrix entries by columns: the entries for L, then the entries for Uᵀ.
    pub entry: Vec<Vec<Entry>>,
    /// Number of unknowns at the end of the order that are kept. If there are any, the last front has no pivots, and
    /// these unknowns are its border; its update is the matrix left for them.
    pub kept: usize,
}

impl Fronts {
    /// The fronts for the lower triangle of a pattern; the last `kept` unknowns of the order are kept. The fronts are
    /// for LU if the mirror images of the entries are given.
    pub fn new(pattern: &Pattern, order: &[usize], kept: usize, mirror: Option<&Mirror>) -> Fronts {
        let nodes = Nodes::new(pattern, order, order.len() - kept);
        let tree = Tree::new(&nodes);
        let factors = if mirror.is_some() { 2 } else { 1 };
        let mut fronts = Fronts::lay_out(&nodes, &tree, pattern, factors, kept);
        let borders = Borders::new(&nodes, &tree);
        fronts.fill(pattern, &nodes, &tree, &borders, mirror);
        fronts
    }

    fn lay_out(nodes: &Nodes, tree: &Tree, pattern: &Pattern, factors: usize, kept: usize) -> Fronts {
        let n = tree.pivots.len();
        let mut front: Vec<Front> = Vec::with_capacity(n);
        let (mut first, mut border, mut panel) = (0, 0, 0);
        let mut children_start = vec![0; n + 1];
        for f in 0..n {
            let rows = tree.rows[f] as usize;
            let pivots = if kept > 0 && f + 1 == n { 0 } else { tree.pivots[f] as usize };
            let cost = tree::cost(tree.rows[f], pivots as u32);
            let parent = tree.parent[f];
            let new = Front {
                first,
                pivots,
                rows,
                factors,
                border,
                panel,
                parent,
                cost,
                descendants: f,
                ..Front::default()
            };
            first += pivots;
            border += new.border_len();
            panel += new.panel_len();
            front.push(new);
            if parent != NONE {
                children_start[parent as usize + 1] += 1;
            }
        }
        for f in 0..n {
            children_start[f + 1] += children_start[f];
            front[f].children = children_start[f]..children_start[f];
        }
        let mut children = vec![0; children_start[n]];
        for f in 0..n {
            if front[f].parent != NONE {
                let (cost, descendants) = (front[f].cost, front[f].descendants);
                let parent = &mut front[tree.parent[f] as usize];
                parent.cost += cost;
                parent.descendants = parent.descendants.min(descendants);
                children[parent.children.end] = f as u32;
                parent.children.end += 1;
            }
        }
        let mut unknown = Vec::with_capacity(pattern.n);
        for &node in &tree.node {
            let first = nodes.first[node as usize];
            unknown.extend(first..first + nodes.width[node as usize]);
        }
        let n_entries = pattern.row.len();
        Fronts {
            front,
            children,
            unknown,
            border: Vec::with_capacity(border),
            relative: vec![0; border],
            column_start: Vec::with_capacity(pattern.n + 1),
            entry: vec![Vec::with_capacity(n_entries); factors],
            kept,
        }
    }

    /// One dense front without entries, whose border is kept.
    pub fn dense(rows: usize, pivots: usize, factors: usize) -> Fronts {
        let kept = rows - pivots;
        let own = Front { pivots, rows, factors, parent: NONE, ..Front::default() };
        let panel = own.panel_len();
        let left = Front { first: pivots, pivots: 0, rows: kept, panel, ..own.clone() };
        Fronts {
            front: [own, left].into_iter().take(if kept > 0 { 2 } else { 1 }).collect(),
            children: Vec::new(),
            unknown: (0..rows as u32).collect(),
            border: (pivots as u32..rows as u32).collect(),
            relative: Vec::new(),
            column_start: Vec::new(),
            entry: Vec::new(),
            kept,
        }
    }

    /// The fronts whose unknowns are eliminated.
    pub fn eliminated(&self) -> &[Front] {
        &self.front[..self.front.len() - usize::from(self.kept > 0)]
    }

    /// True for the front of the unknowns that are kept.
    pub fn is_kept(&self, front: &Front) -> bool {
        self.kept > 0 && front.first + self.kept == self.unknown.len()
    }

    /// The only child of the front of the kept unknowns, if its border consists of all kept unknowns. The update of
    /// this child then becomes, in place, the update of the front of the kept unknowns.
    pub fn before_kept(&self) -> Option<&Front> {
        let kept = self.front.last().filter(|front| self.is_kept(front))?;
        let [child] = self.children[kept.children.clone()] else { return None };
        Some(&self.front[child as usize]).filter(|child| child.border_len() == self.kept)
    }

    /// Lists, for all fronts, the rows, the entries and the rows of the updates.
    fn fill(
        &mut self,
        pattern: &Pattern,
        nodes: &Nodes,
        tree: &Tree,
        borders: &Borders,
        mirror: Option<&Mirror>,
    ) {
        // Row of each node in the front.
        let mut row_of = vec![0u32; nodes.len()];
        // Position of the first unknown of each node in the order of elimination.
        let mut place_of = vec![0u32; nodes.len()];
        let mut place = 0;
        for &node in &tree.node {
            place_of[node as usize] = place;
            place += nodes.width[node as usize];
        }
        self.column_start.push(0);
        for f in 0..self.front.len() {
            let own = &tree.node[tree.start[f]..tree.start[f + 1]];
            let mut row = 0;
            for &node in own {
                row_of[node as usize] = row;
                row += nodes.width[node as usize];
            }
            for &number in borders.border(f) {
                let node = tree.node[number as usize] as usize;
                row_of[node] = row;
                row += nodes.width[node];
                self.border.extend(place_of[node]..place_of[node] + nodes.width[node]);
            }
            let front = &self.front[f];
            if self.is_kept(front) {
                self.border.extend(front.first as u32..self.unknown.len() as u32);
            }
            for &child in &self.children[front.children.clone()] {
                let mut relative = self.relative[self.front[child as usize].border..].iter_mut();
                for &number in borders.border(child as usize) {
                    let node = tree.node[number as usize] as usize;
                    for (k, relative) in (0..nodes.width[node]).zip(&mut relative) {
                        *relative = row_of[node] + k;
                    }
                }
            }
            for &node in own {
                self.take_entries(pattern, nodes, node as usize, &row_of, mirror);
            }
        }
    }

    /// Lists the entries of the columns of a node, given the rows of nodes in its front.
    fn take_entries(
        &mut self,
        pattern: &Pattern,
        nodes: &Nodes,
        node: usize,
        row_of: &[u32],
        mirror: Option<&Mirror>,
    ) {
        let (first, width) = (nodes.first[node], nodes.width[node]);
        let start = |unknown: u32| pattern.column_start[unknown as usize] as u32;
        for k in 0..width {
            let diagonal = start(first + k);
            for r in k..width {
                self.take(mirror, row_of[node] + r, diagonal + r - k, false);
            }
            for coupling in nodes.coupled(node) {
                let later = coupling.later as usize;
                let row = row_of[later];
                if nodes.first[later] > first {
                    let source = coupling.entry - start(first) + diagonal - k;
                    for r in 0..nodes.width[later] {
                        self.take(mirror, row + r, source + r, false);
                    }
                } else {
                    let column = nodes.first[later];
                    for r in 0..nodes.width[later] {
                        let source = coupling.entry - start(column) + start(column + r) - r + k;
                        self.take(mirror, row + r, source, true);
                    }
                }
            }
            self.column_start.push(self.entry[0].len());
        }
    }

    /// Lists an entry of the lower triangle of the matrix: it lies in the row of the later unknown or, if
    /// `is_transposed`, in the column of that unknown.
    fn take(&mut self, mirror: Option<&Mirror>, row: u32, source: u32, is_transposed: bool) {
        let Some(Mirror { below, above, .. }) = mirror else {
            self.entry[0].push(Entry { row, source });
            return;
        };
        let (below, above) = (below[source as usize], above[source as usize]);
        let (lower, upper) = if is_transposed { (above, below) } else { (below, above) };
        self.entry[0].push(Entry { row, source: lower });
        self.entry[1].push(Entry { row, source: upper });
    }
}

/// The borders of all fronts in terms of nodes, given by their positions in the order of elimination.
struct Borders {
    start: Vec<usize>,
    number: Vec<u32>,
}

impl Borders {
    fn new(nodes: &Nodes, tree: &Tree) -> Borders {
        let mut number_of = vec![0u32; nodes.len()];
        for (number, &node) in tree.node.iter().enumerate() {
            number_of[node as usize] = number as u32;
        }
        let n = tree.pivots.len();
        let mut borders = Borders { start: vec![0], number: Vec::new() };
        // For each node, the last front so far that contains it.
        let mut met = vec![NONE; nodes.len()];
        let (mut child, mut sibling) = (vec![NONE; n], vec![NONE; n]);
        for f in 0..n {
            let begin = borders.number.len();
            let own = tree.start[f]..tree.start[f + 1];
            met[own.clone()].fill(f as u32);
            for &node in &tree.node[own] {
                for coupling in nodes.coupled(node as usize) {
                    let number = number_of[coupling.later as usize];
                    if met[number as usize] != f as u32 {
                        met[number as usize] = f as u32;
                        borders.number.push(number);
                    }
                }
            }
            let mut next = child[f];
            while next != NONE {
                for k in borders.start[next as usize]..borders.start[next as usize + 1] {
                    let number = borders.number[k];
                    if met[number as usize] != f as u32 {
                        met[number as usize] = f as u32;
                        borders.number.push(number);
                    }
                }
                next = sibling[next as usize];
            }
            borders.number[begin..].sort_unstable();
            borders.start.push(borders.number.len());
            if tree.parent[f] != NONE {
                sibling[f] = std::mem::replace(&mut child[tree.parent[f] as usize], f as u32);
            }
        }
        borders
    }

    fn border(&self, front: usize) -> &[u32] {
        &self.number[self.start[front]..self.start[front + 1]]
    }
}
