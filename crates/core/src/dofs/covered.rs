//! Boundary conditions that have no effect because earlier conditions already hold their nodes.

use std::collections::BTreeSet;

use crate::model::{BoundaryCondition, NodeSet};

/// A boundary condition whose nodes are all held along an axis by earlier conditions.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Covered {
    /// Index of the condition.
    pub condition: usize,
    /// Axis along which the nodes are already held.
    pub axis: usize,
    /// Indices of the conditions that hold its nodes in one stage or another, ascending.
    pub by: Vec<usize>,
}

/// The conditions that add nothing to earlier ones along an axis, in any of the stages in which they are set. A node
/// belongs to the first condition that holds it. `stages` states for each stage which conditions are set.
pub fn covered<const D: usize>(conditions: &[BoundaryCondition<D>], stages: &[Vec<bool>]) -> Vec<Covered> {
    let in_stages: Vec<Vec<Covered>> = stages
        .iter()
        .map(|is_set| (0..D).flat_map(|axis| along(conditions, is_set, axis)).collect())
        .collect();
    let mut found: Vec<Covered> = Vec::new();
    for axis in 0..D {
        for condition in 0..conditions.len() {
            let is_it = |covered: &&Covered| (covered.condition, covered.axis) == (condition, axis);
            let mut by = BTreeSet::new();
            let mut is_covered = (0..stages.len()).filter(|&stage| stages[stage][condition]).map(|stage| {
                let here = in_stages[stage].iter().find(is_it);
                here.iter().for_each(|here| by.extend(here.by.iter().copied()));
                here.is_some()
            });
            if is_covered.all(|covered| covered) && !by.is_empty() {
                found.push(Covered { condition, axis, by: by.into_iter().collect() });
            }
        }
    }
    found
}

/// The conditions among those set that add nothing to earlier ones along an axis.
fn along<const D: usize>(conditions: &[BoundaryCondition<D>], is_set: &[bool], axis: usize) -> Vec<Covered> {
    let holding = || {
        let holds = |c: &BoundaryCondition<D>| c.axes.is_none() && c.displacement[axis].is_some();
        conditions.iter().enumerate().filter(move |(number, c)| is_set[*number] && holds(c))
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
