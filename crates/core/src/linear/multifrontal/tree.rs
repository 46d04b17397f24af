//! The fronts, whose columns are eliminated together, and their tree, derived from the elimination tree of the nodes.

use super::nodes::{NONE, Nodes, postorder};

// The following values were measured; the performance depends little on them.

/// Constant part of the time of a front, in addition to the parts below, [ns].
const FRONT: f64 = 200.0;
/// Time per entry of the columns of a front, [ns].
const ENTRY: f64 = 0.1;
/// Time per entry of the update of a front, [ns].
const PASSED: f64 = 0.5;
/// Number of operations (additions and multiplications) per nanosecond.
const RATE: f64 = 60.0;

/// The fronts of a factorisation, children before their parents.
pub(super) struct Tree {
    /// Start of the nodes of each front in `node`.
    pub start: Vec<usize>,
    /// Nodes in the order of elimination.
    pub node: Vec<u32>,
    /// Number of unknowns that are eliminated in each front; for the front of the kept unknowns, the number of kept
    /// unknowns.
    pub pivots: Vec<u32>,
    /// Number of rows of each front, including the rows of the pivots.
    pub rows: Vec<u32>,
    /// Parent of each front, or [`NONE`].
    pub parent: Vec<u32>,
}

/// Estimated time of a front, [ns].
pub(super) fn cost(rows: u32, pivots: u32) -> f64 {
    let (m, k) = (f64::from(rows), f64::from(pivots));
    let operations = k * m * m - k * k * m + k * k * k / 3.0;
    FRONT + ENTRY * m * k + PASSED * (m - k) * (m - k) / 2.0 + operations / RATE
}

impl Tree {
    /// Merges nodes whose columns have the same rows, then merges fronts with their children where this saves time.
    pub fn new(nodes: &Nodes) -> Tree {
        let parent = nodes.parents();
        let count = nodes.counts(&parent);
        let mut groups = Groups::chains(nodes, &parent, &count);
        groups.keep(nodes);
        groups.amalgamate(&parent);
        groups.into_tree(nodes, &parent)
    }
}

/// Groups of nodes that are eliminated together, each identified by its last node.
struct Groups {
    /// For each node, its group, or another node that leads to its group.
    into: Vec<u32>,
    pivots: Vec<u32>,
    rows: Vec<u32>,
    /// First of the nodes that are kept.
    kept_from: usize,
}

impl Groups {
    /// Groups each node with the child, if any, whose rows are the rows of the node plus the child itself.
    fn chains(nodes: &Nodes, parent: &[u32], count: &[u32]) -> Groups {
        let n = nodes.len();
        let kept_from = n - nodes.kept;
        let mut into: Vec<u32> = (0..n as u32).collect();
        let mut pivots = nodes.width.clone();
        let mut rows = count.to_vec();
        let mut taken = vec![false; n];
        for node in 0..kept_from {
            let above = parent[node] as usize;
            if above >= kept_from {
                continue; // kept, or NONE
            }
            if !taken[above] && count[node] - nodes.width[node] == count[above] {
                taken[above] = true;
                into[node] = above as u32;
                pivots[above] += pivots[node];
                rows[above] += pivots[node];
            }
        }
        Groups { into, pivots, rows, kept_from }
    }

    /// Makes one group of all nodes that are kept.
    fn keep(&mut self, nodes: &Nodes) {
        let n = nodes.len();
        if self.kept_from < n {
            let all = nodes.width[self.kept_from..].iter().sum();
            self.into[self.kept_from..].fill(n as u32 - 1);
            (self.pivots[n - 1], self.rows[n - 1]) = (all, all);
        }
    }

    /// The group of a node.
    fn group(&mut self, node: u32) -> u32 {
        let mut group = node;
        while self.into[group as usize] != group {
            group = self.into[group as usize];
        }
        let mut below = node;
        while below != group {
            below = std::mem::replace(&mut self.into[below as usize], group);
        }
        group
    }

    fn amalgamate(&mut self, parent: &[u32]) {
        let n = parent.len();
        let (mut child, mut sibling) = (vec![NONE; n], vec![NONE; n]);
        for last in 0..n {
            if self.into[last] != last as u32 {
                continue;
            }
            if last < self.kept_from {
                self.join_children(last, child[last], &sibling);
            }
            if parent[last] != NONE {
                let above = self.group(parent[last]) as usize;
                sibling[last] = std::mem::replace(&mut child[above], last as u32);
            }
        }
    }

    /// Merges a group with each of its children, in the list from `child` on, for which this saves time.
    fn join_children(&mut self, group: usize, child: u32, sibling: &[u32]) {
        let mut next = child;
        while next != NONE {
            let child = next as usize;
            next = sibling[child];
            let together = (self.rows[group] + self.pivots[child], self.pivots[group] + self.pivots[child]);
            let apart =
                cost(self.rows[group], self.pivots[group]) + cost(self.rows[child], self.pivots[child]);
            if cost(together.0, together.1) < apart {
                (self.rows[group], self.pivots[group]) = together;
                self.into[child] = group as u32;
            }
        }
    }

    fn into_tree(mut self, nodes: &Nodes, parent: &[u32]) -> Tree {
        let n = nodes.len();
        let group: Vec<u32> = (0..n as u32).map(|node| self.group(node)).collect();
        let above = |last: usize| match parent[last] {
            NONE => NONE,
            node => group[node as usize],
        };
        let last_nodes = postorder(n, |last| group[last] == last as u32, above);
        let mut tree =
            Tree { start: vec![0], node: vec![0; n], pivots: vec![], rows: vec![], parent: vec![] };
        let mut number = vec![NONE; n];
        for (front, &last) in last_nodes.iter().enumerate() {
            number[last as usize] = front as u32;
        }
        tree.start.resize(last_nodes.len() + 1, 0);
        for node in 0..n {
            tree.start[number[group[node] as usize] as usize + 1] += 1;
        }
        for front in 0..last_nodes.len() {
            tree.start[front + 1] += tree.start[front];
        }
        let mut place = tree.start.clone();
        for node in 0..n {
            let place = &mut place[number[group[node] as usize] as usize];
            tree.node[*place] = node as u32;
            *place += 1;
        }
        for &last in &last_nodes {
            tree.pivots.push(self.pivots[last as usize]);
            tree.rows.push(self.rows[last as usize]);
            tree.parent.push(match above(last as usize) {
                NONE => NONE,
                above => number[above as usize],
            });
        }
        tree
    }
}
