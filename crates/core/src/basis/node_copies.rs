//! Copies of grid nodes: a node may carry one set of unknowns for each group of bodies.
//!
//! Bodies of one group share the unknowns of a node and therefore move with one continuous displacement field; bodies
//! of different groups may part, slide or be separated by a wall. A node has one copy for each group whose points touch
//! it. The copies of all nodes are the *active nodes*, numbered in the order of the grid; copies of the same node follow
//! one another in the order of their groups. Only [`NodeCopies`] knows which copy a body sees.

use std::ops::Range;

/// Number of a group of bodies that share the unknowns of their nodes.
pub type BodyGroup = u16;

/// Marks a grid node without copies.
const NONE: u32 = u32::MAX;

/// The copies of all grid nodes in a load step.
#[derive(Debug, Clone, Default)]
pub struct NodeCopies {
    /// The group of each body; empty if all bodies are in one group.
    group_of_body: Vec<BodyGroup>,
    /// Grid node of each copy, ascending.
    nodes: Vec<u32>,
    /// The group of each copy; empty if all bodies are in one group.
    groups: Vec<BodyGroup>,
    /// Number of the first copy of each grid node, or [`NONE`].
    first: Vec<u32>,
}

impl NodeCopies {
    /// No copies yet, for bodies in these groups, by body number; without any, all bodies are in one group.
    pub fn new(group_of_body: Vec<BodyGroup>) -> Self {
        let is_one = group_of_body.iter().all(|group| *group == group_of_body[0]);
        NodeCopies { group_of_body: if is_one { Vec::new() } else { group_of_body }, ..NodeCopies::default() }
    }

    /// These copies, or none if the bodies are in other groups than before.
    #[must_use]
    pub fn with_groups(self, group_of_body: &[BodyGroup]) -> Self {
        let other = NodeCopies::new(group_of_body.to_vec());
        if other.group_of_body == self.group_of_body { self } else { other }
    }

    /// The group of each body; empty if all bodies are in one group.
    pub fn group_of_body(&self) -> &[BodyGroup] {
        &self.group_of_body
    }

    /// The group of a body.
    #[inline]
    pub fn group(&self, body: u16) -> BodyGroup {
        self.group_of_body.get(body as usize).copied().unwrap_or(0)
    }

    /// Number of groups of bodies: groups are numbered from 0.
    pub fn n_groups(&self) -> usize {
        self.group_of_body.iter().max().map_or(1, |last| *last as usize + 1)
    }

    /// Removes all copies but keeps the groups and the memory.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.groups.clear();
        self.first.clear();
    }

    /// Numbers the copies of a grid with `n_nodes` nodes from the nodes that points touch, in any order, each with the
    /// number of a body whose points touch it.
    pub fn number(&mut self, n_nodes: usize, touched: impl Iterator<Item = (u32, u16)>) {
        self.clear();
        self.first.resize(n_nodes, NONE);
        if self.group_of_body.is_empty() {
            touched.for_each(|(node, _)| self.first[node as usize] = 0);
            for (node, number) in self.first.iter_mut().enumerate().filter(|(_, number)| **number == 0) {
                *number = self.nodes.len() as u32;
                self.nodes.push(node as u32);
            }
            return;
        }
        let mut copies: Vec<(u32, BodyGroup)> =
            touched.map(|(node, body)| (node, self.group_of_body[body as usize])).collect();
        copies.sort_unstable();
        copies.dedup();
        for (number, (node, group)) in copies.into_iter().enumerate() {
            let first = &mut self.first[node as usize];
            *first = (*first).min(number as u32);
            self.nodes.push(node);
            self.groups.push(group);
        }
    }

    /// Number of nodes of the grid.
    pub fn n_nodes(&self) -> usize {
        self.first.len()
    }

    /// Number of copies.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// True if there are no copies.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// The group of each copy; empty if all bodies are in one group.
    pub fn groups(&self) -> &[BodyGroup] {
        &self.groups
    }

    /// The grid node of each copy, ascending.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// All copies of a grid node; empty if no points touch the node. Boundary conditions and output ask for these.
    #[inline]
    pub fn at_node(&self, node: usize) -> Range<usize> {
        match self.first[node] {
            NONE => 0..0,
            first if self.groups.is_empty() => first as usize..first as usize + 1,
            first => {
                let others = self.nodes[first as usize..].iter().take_while(|other| **other as usize == node);
                first as usize..first as usize + others.count()
            }
        }
    }

    /// The copy of a grid node that a body, and each of its points, sees; `None` if no points of the body's group touch
    /// the node.
    #[inline(always)]
    pub fn seen_by(&self, body: u16, node: usize) -> Option<usize> {
        match self.first[node] {
            NONE => None,
            first if self.groups.is_empty() => Some(first as usize),
            _ => self.of_group(self.group(body), node),
        }
    }

    /// The copy of a grid node for a group of bodies; `None` if no points of the group touch the node.
    pub fn of_group(&self, group: BodyGroup, node: usize) -> Option<usize> {
        let mut copies = self.at_node(node);
        if self.groups.is_empty() { copies.next() } else { copies.find(|copy| self.groups[*copy] == group) }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn bodies_of_one_group_share_the_copies_of_nodes() {
        for groups in [vec![], vec![3, 3]] {
            let mut copies = NodeCopies::new(groups);
            copies.number(6, [(4, 0), (1, 1), (4, 1), (2, 0)].into_iter());
            assert_eq!(copies.nodes(), [1, 2, 4]);
            for body in 0..2 {
                let seen: Vec<_> = (0..6).map(|node| copies.seen_by(body, node)).collect();
                assert_eq!(seen, [None, Some(0), Some(1), None, Some(2), None]);
            }
            assert_eq!((copies.at_node(4), copies.at_node(3).len()), (2..3, 0));
        }
    }

    /// Bodies 0 and 2 are in one group, body 1 in another. All touch node 4, only body 1 touches node 1, and only the
    /// first group touches node 2.
    #[test]
    fn each_group_of_bodies_sees_its_own_copy_of_a_node() {
        let mut copies = NodeCopies::new(vec![0, 1, 0]);
        copies.number(6, [(4, 2), (1, 1), (4, 1), (2, 0), (4, 0), (2, 2)].into_iter());
        assert_eq!(copies.nodes(), [1, 2, 4, 4]);
        assert_eq!(copies.len(), 4);
        let seen = |body: u16| (0..6).map(|node| copies.seen_by(body, node)).collect::<Vec<_>>();
        assert_eq!(seen(0), [None, None, Some(1), None, Some(2), None]);
        assert_eq!(seen(1), [None, Some(0), None, None, Some(3), None]);
        assert_eq!(seen(2), seen(0));
        assert_eq!([1, 2, 4, 5].map(|node| copies.at_node(node)), [0..1, 1..2, 2..4, 0..0]);
    }

    #[test]
    fn numbers_are_renewed_from_step_to_step() {
        let mut copies = NodeCopies::new(vec![0, 1]);
        copies.number(4, [(0, 0), (0, 1), (3, 1)].into_iter());
        copies.number(4, [(3, 0), (2, 1)].into_iter());
        assert_eq!(copies.nodes(), [2, 3]);
        assert_eq!(
            (copies.seen_by(0, 3), copies.seen_by(1, 3), copies.seen_by(1, 2)),
            (Some(1), None, Some(0))
        );
        copies.clear();
        assert!(copies.is_empty());
    }
}
