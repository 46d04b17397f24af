//! The pattern of a matrix by nodes: neighbouring unknowns that are coupled to the same other unknowns, such as the
//! degrees of freedom of a grid node, are merged into one node.

use crate::linear::Pattern;

/// Marks the absence of a node or front.
pub(super) const NONE: u32 = u32::MAX;

/// The couplings of nodes, which are numbered in the order of elimination.
pub(super) struct Nodes {
    /// First unknown of each node.
    pub first: Vec<u32>,
    /// Number of unknowns of each node.
    pub width: Vec<u32>,
    /// Number of nodes at the end whose unknowns are kept.
    pub kept: usize,
    /// Start of the couplings of each node with later nodes.
    start: Vec<usize>,
    coupled: Vec<Coupling>,
}

/// The coupling of a node with a later node.
#[derive(Clone, Copy, Default)]
pub(super) struct Coupling {
    /// The later node.
    pub later: u32,
    /// Index, in the values of the matrix, of the entry that couples the first unknowns of both nodes.
    pub entry: u32,
}

impl Nodes {
    /// Finds the nodes of a symmetric pattern; the unknowns from position `kept_from` of the order on are kept.
    pub fn new(pattern: &Pattern, order: &[usize], kept_from: usize) -> Nodes {
        let mut follows = followers(pattern, order);
        if let Some(&unknown) = order.get(kept_from) {
            follows[unknown] = false;
        }
        let mut number = vec![NONE; pattern.n];
        let (mut first, mut width) = (Vec::new(), Vec::<u32>::new());
        let mut kept = 0;
        for (place, &unknown) in order.iter().enumerate() {
            match width.last_mut() {
                Some(width) if follows[unknown] => *width += 1,
                _ => {
                    kept += usize::from(place >= kept_from);
                    number[unknown] = first.len() as u32;
                    first.push(unknown as u32);
                    width.push(1);
                }
            }
        }
        let mut start = vec![0; first.len() + 1];
        for_each_coupling(pattern, &number, |a, b, _| start[a.min(b) as usize + 1] += 1);
        for node in 0..first.len() {
            start[node + 1] += start[node];
        }
        let mut next = start.clone();
        let mut coupled = vec![Coupling::default(); start[first.len()]];
        for_each_coupling(pattern, &number, |a, b, entry| {
            let next = &mut next[a.min(b) as usize];
            coupled[*next] = Coupling { later: a.max(b), entry: entry as u32 };
            *next += 1;
        });
        Nodes { first, width, kept, start, coupled }
    }

    pub fn len(&self) -> usize {
        self.first.len()
    }

    /// The couplings of a node with later nodes.
    pub fn coupled(&self, node: usize) -> &[Coupling] {
        &self.coupled[self.start[node]..self.start[node + 1]]
    }

    /// The elimination tree (Liu, 1990): for each node, its parent (the lowest later node coupled to it once all nodes
    /// before it have been eliminated), or [`NONE`].
    pub fn parents(&self) -> Vec<u32> {
        let n = self.len();
        let mut start = vec![0; n + 1];
        for coupling in &self.coupled {
            start[coupling.later as usize + 1] += 1;
        }
        for node in 0..n {
            start[node + 1] += start[node];
        }
        let mut earlier = vec![0u32; self.coupled.len()];
        let mut next = start.clone();
        for node in 0..n {
            for coupling in self.coupled(node) {
                let next = &mut next[coupling.later as usize];
                earlier[*next] = node as u32;
                *next += 1;
            }
        }
        let mut parent = vec![NONE; n];
        let mut ancestor = vec![NONE; n];
        for node in 0..n {
            for &earlier in &earlier[start[node]..start[node + 1]] {
                let mut below = earlier as usize;
                while below != node {
                    let above = std::mem::replace(&mut ancestor[below], node as u32);
                    if above == NONE {
                        parent[below] = node as u32;
                        break;
                    }
                    below = above as usize;
                }
            }
        }
        parent
    }

    /// For each node, the number of rows of the factor in the column of its first unknown, obtained by counting the
    /// leaves of the row subtrees (Gilbert, Ng and Peyton, 1994).
    pub fn counts(&self, parent: &[u32]) -> Vec<u32> {
        let n = self.len();
        let post = postorder(parent.len(), |_| true, |node| parent[node]);
        let mut count = vec![0i64; n];
        let mut descendant = vec![NONE; n];
        for (k, &node) in post.iter().enumerate() {
            let mut above = node as usize;
            if descendant[above] == NONE {
                count[above] = i64::from(self.width[above]);
            }
            while descendant[above] == NONE {
                descendant[above] = k as u32;
                match parent[above] {
                    NONE => break,
                    next => above = next as usize,
                }
            }
        }
        let mut ancestor: Vec<u32> = (0..n as u32).collect();
        // For each row: one more than the index of the first descendant of its last leaf, and the last leaf itself.
        let mut seen = vec![0u32; n];
        let mut leaf = vec![NONE; n];
        for &node in &post {
            let node = node as usize;
            if parent[node] != NONE {
                count[parent[node] as usize] -= i64::from(self.width[node]);
            }
            for coupling in self.coupled(node) {
                let row = coupling.later as usize;
                if descendant[node] < seen[row] {
                    continue;
                }
                let weight = i64::from(self.width[row]);
                seen[row] = descendant[node] + 1;
                count[node] += weight;
                let last = std::mem::replace(&mut leaf[row], node as u32);
                if last != NONE {
                    let mut meet = last as usize;
                    while ancestor[meet] as usize != meet {
                        meet = ancestor[meet] as usize;
                    }
                    let mut below = last as usize;
                    while below != meet {
                        below = std::mem::replace(&mut ancestor[below], meet as u32) as usize;
                    }
                    count[meet] -= weight;
                }
            }
            if parent[node] != NONE {
                ancestor[node] = parent[node];
            }
        }
        for node in 0..n {
            if parent[node] != NONE {
                count[parent[node] as usize] += count[node];
            }
        }
        count.into_iter().map(|c| c as u32).collect()
    }
}

/// Calls `visit(a, b, entry)` for all coupled pairs of different nodes; the unknowns of `a` have lower indices than
/// those of `b`.
fn for_each_coupling(pattern: &Pattern, number: &[u32], mut visit: impl FnMut(u32, u32, usize)) {
    for column in 0..pattern.n {
        let a = number[column];
        if a == NONE {
            continue;
        }
        for entry in pattern.column_start[column]..pattern.column_start[column + 1] {
            let b = number[pattern.row[entry]];
            if b != NONE && b != a {
                visit(a, b, entry);
            }
        }
    }
}

/// True if an unknown belongs to the same node as the previous unknown: it is eliminated directly after that unknown,
/// and both are coupled to the same unknowns.
fn followers(pattern: &Pattern, order: &[usize]) -> Vec<bool> {
    let column = |j: usize| &pattern.row[pattern.column_start[j]..pattern.column_start[j + 1]];
    let mut follows = vec![false; pattern.n + 1];
    for pair in order.windows(2) {
        let (before, unknown) = (pair[0], pair[1]);
        follows[unknown] = unknown == before + 1 && column(before)[1..] == *column(unknown);
    }
    for j in (0..pattern.n).filter(|&j| !follows[j]).collect::<Vec<_>>() {
        let rows = column(j);
        for (place, &row) in rows.iter().enumerate() {
            if follows[row] && (place == 0 || rows[place - 1] + 1 != row) {
                follows[row] = false;
            }
            if follows[row + 1] && rows.get(place + 1) != Some(&(row + 1)) {
                follows[row + 1] = false;
            }
        }
    }
    follows
}

/// The numbers below `n` that are nodes of a forest, in postorder: the descendants of each node come directly before
/// it, without other nodes in between.
pub(super) fn postorder(
    n: usize,
    is_node: impl Fn(usize) -> bool,
    parent: impl Fn(usize) -> u32,
) -> Vec<u32> {
    let (mut child, mut sibling) = (vec![NONE; n], vec![NONE; n]);
    let mut roots = NONE;
    for node in (0..n).rev().filter(|&node| is_node(node)) {
        let list = match parent(node) {
            NONE => &mut roots,
            above => &mut child[above as usize],
        };
        sibling[node] = std::mem::replace(list, node as u32);
    }
    let mut post = Vec::new();
    let mut path = Vec::new();
    let mut next = roots;
    loop {
        while next != NONE {
            path.push(next);
            next = child[next as usize];
        }
        let Some(node) = path.pop() else { return post };
        post.push(node);
        next = sibling[node as usize];
    }
}
