//! Slivers: nodes that points touch only with negligible parts of their basis functions.

use super::Support;
use crate::grid::Grid;

/// Threshold of value and slope (over a cell) below which a basis function is a sliver, [-]. It is the relative
/// distance within which points count as lying on grid lines.
const SLIVER: f64 = 1e-8;

#[inline]
pub(super) fn is_sliver<const D: usize>(value: f64, gradient: &[f64; D], size: f64) -> bool {
    value.abs() < SLIVER && gradient.iter().all(|slope| slope.abs() * size < SLIVER)
}

/// Grid nodes that points touch only by slivers. Their stiffness would be round-off, and nothing would resist their
/// motion. They are not active; their small contributions go to the other nodes of the point.
#[derive(Default)]
pub(super) struct Slivers {
    /// For each grid node, true if it is a sliver node; empty if there is none.
    is_sliver_node: Vec<bool>,
}

impl Slivers {
    /// Finds the sliver nodes. `holds` is true for the nodes that a group touches by more than a sliver.
    pub(super) fn new(n_nodes: usize, group_nodes: &[u32], holds: &[bool]) -> Slivers {
        if holds.iter().all(|holds| *holds) {
            return Slivers::default();
        }
        let mut is_sliver_node = vec![true; n_nodes];
        for (&node, &holds) in group_nodes.iter().zip(holds) {
            is_sliver_node[node as usize] &= !holds;
        }
        let any = group_nodes.iter().any(|node| is_sliver_node[*node as usize]);
        if any { Slivers { is_sliver_node } } else { Slivers::default() }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.is_sliver_node.is_empty()
    }

    /// Removes sliver nodes from the support of a point and records the node that carries each. A sliver node v moves
    /// with the displacement field of the point, u_v = u_m + (x_v − x_m)·∇u, where m is the node with the largest
    /// value. The remaining basis functions still sum to one and reproduce linear fields.
    pub(super) fn fold<const D: usize>(
        &self,
        grid: &dyn Grid<D>,
        support: &mut Support<D>,
        carried: &mut Vec<[u32; 2]>,
    ) {
        let is_sliver_node =
            |node: u32| self.is_sliver_node.get(node as usize).is_some_and(|is_sliver_node| *is_sliver_node);
        if self.is_empty() || !support.nodes.iter().any(|node| is_sliver_node(*node)) {
            return;
        }
        let Support { nodes, value, gradient, factors, .. } = support;
        let (all, values, slopes) = (nodes.clone(), value.clone(), gradient.clone());
        let most = (0..all.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        let from = grid.node_position(all[most] as usize);
        for v in (0..all.len()).filter(|&v| is_sliver_node(all[v])) {
            carried.push([all[v], all[most]]);
            let position = grid.node_position(all[v] as usize);
            for k in (0..all.len()).filter(|&k| !is_sliver_node(all[k])) {
                let along: f64 = (0..D).map(|d| (position[d] - from[d]) * slopes[k][d]).sum();
                let weight = along + if k == most { 1.0 } else { 0.0 };
                value[k] += values[v] * weight;
                for d in 0..D {
                    gradient[k][d] += slopes[v][d] * weight;
                }
            }
        }
        let mut kept = 0;
        for k in 0..all.len() {
            if !is_sliver_node(all[k]) {
                (nodes[kept], value[kept], gradient[kept]) = (all[k], value[k], gradient[k]);
                kept += 1;
            }
        }
        nodes.truncate(kept);
        value.truncate(kept);
        gradient.truncate(kept);
        *factors = None;
    }
}
