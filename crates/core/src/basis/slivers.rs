//! Nodes that points touch by slivers of their basis functions only.

use super::Support;
use crate::grid::Grid;

/// Basis functions of a point whose value and slope over a cell are below this are slivers, [-]: the distance, relative to a
/// cell, within which points lie on grid lines.
const SLIVER: f64 = 1e-8;

#[inline]
pub(super) fn is_sliver<const D: usize>(value: f64, gradient: &[f64; D], size: f64) -> bool {
    value.abs() < SLIVER && gradient.iter().all(|slope| slope.abs() * size < SLIVER)
}

/// Nodes that points touch by slivers only: their stiffness would be round-off, and nothing would resist their motion. They
/// are not active; what little they would get goes to the other nodes of the point.
#[derive(Default)]
pub(super) struct Slivers {
    /// For each grid node whether it is one; empty where none is.
    is_one: Vec<bool>,
}

impl Slivers {
    /// From the nodes of all groups and whether the group touches them by more.
    pub(super) fn new(n_nodes: usize, group_nodes: &[u32], holds: &[bool]) -> Slivers {
        if holds.iter().all(|holds| *holds) {
            return Slivers::default();
        }
        let mut is_one = vec![true; n_nodes];
        for (&node, &holds) in group_nodes.iter().zip(holds) {
            is_one[node as usize] &= !holds;
        }
        let any = group_nodes.iter().any(|node| is_one[*node as usize]);
        if any { Slivers { is_one } } else { Slivers::default() }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.is_one.is_empty()
    }

    /// Takes them out of the support of a point, and notes which node carries each. A sliver node v moves as the field of
    /// the point says, u_v = u_m + (x_v − x_m)·∇u with the node m that the point touches most, so that basis functions still
    /// add up to one and reproduce linear fields.
    pub(super) fn fold<const D: usize>(
        &self,
        grid: &dyn Grid<D>,
        support: &mut Support<D>,
        carried: &mut Vec<[u32; 2]>,
    ) {
        let is_one = |node: u32| self.is_one.get(node as usize).is_some_and(|is_one| *is_one);
        if self.is_empty() || !support.nodes.iter().any(|node| is_one(*node)) {
            return;
        }
        let Support { nodes, value, gradient, factors, .. } = support;
        let (all, values, slopes) = (nodes.clone(), value.clone(), gradient.clone());
        let most = (0..all.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
        let from = grid.node_position(all[most] as usize);
        for v in (0..all.len()).filter(|&v| is_one(all[v])) {
            carried.push([all[v], all[most]]);
            let place = grid.node_position(all[v] as usize);
            for k in (0..all.len()).filter(|&k| !is_one(all[k])) {
                let along: f64 = (0..D).map(|d| (place[d] - from[d]) * slopes[k][d]).sum();
                let weight = along + if k == most { 1.0 } else { 0.0 };
                value[k] += values[v] * weight;
                for d in 0..D {
                    gradient[k][d] += slopes[v][d] * weight;
                }
            }
        }
        let mut kept = 0;
        for k in 0..all.len() {
            if !is_one(all[k]) {
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
