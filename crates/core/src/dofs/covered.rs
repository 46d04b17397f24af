//! Boundary conditions that have no effect because earlier conditions already hold their nodes.

use crate::model::{BoundaryCondition, NodeSet};

/// A boundary condition whose nodes are all held along an axis by earlier conditions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Covered {
    /// Index of the condition.
    pub condition: usize,
    /// Axis along which the nodes are already held.
    pub axis: usize,
    /// Indices of the conditions that hold its nodes, ascending.
    pub by: Vec<usize>,
}

/// The conditions that add nothing to earlier ones along an axis. A node belongs to the first condition that holds it.
pub fn covered<const D: usize>(conditions: &[BoundaryCondition<D>]) -> Vec<Covered> {
    (0..D).flat_map(|axis| along(conditions, axis)).collect()
}

fn along<const D: usize>(conditions: &[BoundaryCondition<D>], axis: usize) -> Vec<Covered> {
    let holding = || {
        let holds = |c: &BoundaryCondition<D>| c.axes.is_none() && c.displacement[axis].is_some();
        conditions.iter().enumerate().filter(move |(_, c)| holds(c))
    };
    let mut nodes: Vec<(u32, u32)> = Vec::new();
    let mut found = Vec::new();
    for (number, condition) in holding() {
        match &condition.nodes {
            NodeSet::Surface(_) => {}
            NodeSet::Fixed(list) => nodes.extend(list.iter().map(|&node| (node, number as u32))),
            // These nodes change from step to step, so only a condition with the same selection covers them.
            NodeSet::OuterLayer(_) => {
                let earlier = holding().take_while(|(other, _)| *other < number);
                let same =
                    earlier.filter(|(_, other)| other.nodes == condition.nodes).map(|(other, _)| other);
                found.extend(same.take(1).map(|other| Covered { condition: number, axis, by: vec![other] }));
            }
        }
    }
    nodes.sort_unstable();
    let mut by: Vec<Vec<usize>> = vec![Vec::new(); conditions.len()];
    let mut is_first = vec![false; conditions.len()];
    for same in nodes.chunk_by(|a, b| a.0 == b.0) {
        let first = same[0].1 as usize;
        is_first[first] = true;
        for (_, later) in &same[1..] {
            let by = &mut by[*later as usize];
            if !by.contains(&first) {
                by.push(first);
            }
        }
    }
    for (condition, mut by) in by.into_iter().enumerate().filter(|(k, by)| !is_first[*k] && !by.is_empty()) {
        by.sort_unstable();
        found.push(Covered { condition, axis, by });
    }
    found
}
