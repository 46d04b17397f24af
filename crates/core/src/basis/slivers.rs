//! Slivers: basis functions with negligible values and slopes, and nodes that points touch only with such functions.

use std::collections::BTreeMap;

use super::Support;
use crate::grid::Grid;
use crate::ranks::{Ranks, Sharing};
use crate::region::vector::{along, dot, minus};

/// Threshold of the value, and of the slope times the cell size, below which a basis function is a sliver, [-]. It is
/// the relative distance within which points count as lying on grid lines.
const SLIVER: f64 = 1e-8;

/// Threshold of the value, and of the slope times the cell size, below which points touch a node weakly, [-].
const WEAK: f64 = 1e-3;

/// Number of iterations that determine the displacement field without the sliver nodes.
const ROUNDS: usize = 10;

/// How firmly the points of a group touch a grid node.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Touch {
    /// By slivers only.
    #[default]
    Sliver,
    /// Weakly: the node is active if a ghost penalty can support it and no sliver nodes are next to it.
    Weak,
    /// Firmly enough to hold the node in any case.
    Firm,
}

impl Touch {
    /// Returns how firmly a basis function touches its node; `size` is the cell size h.
    #[inline]
    pub(super) fn new<const D: usize>(value: f64, gradient: &[f64; D], size: f64) -> Touch {
        let below =
            |limit: f64| value.abs() < limit && gradient.iter().all(|slope| slope.abs() * size < limit);
        if !below(WEAK) {
            Touch::Firm
        } else if !below(SLIVER) {
            Touch::Weak
        } else {
            Touch::Sliver
        }
    }
}

/// How firmly other ranks touch the grid nodes that this rank touches.
pub(super) struct SharedTouches<'a> {
    pub ranks: &'a Ranks,
    pub sharing: &'a Sharing,
}

impl SharedTouches<'_> {
    /// Combines how firmly this rank touches each shared node with how firmly the other ranks touch it; true if any
    /// value has changed.
    fn merge(&self, touches: &mut [Touch], with: impl Fn(Touch, Touch) -> Touch) -> bool {
        let Some(communicator) = self.ranks.communicator() else { return false };
        let mut messages: BTreeMap<usize, Vec<u8>> = BTreeMap::new();
        for (node, sharers) in self.sharing {
            for rank in
                sharers.iter().map(|sharer| sharer.rank as usize).filter(|rank| *rank != self.ranks.own())
            {
                messages.entry(rank).or_default().push(touches[*node as usize] as u8);
            }
        }
        let mut changes = false;
        for (rank, message) in communicator.exchange(messages.into_iter().collect()) {
            let with_rank = self
                .sharing
                .iter()
                .filter(|(_, sharers)| sharers.iter().any(|sharer| sharer.rank as usize == rank));
            for ((node, _), byte) in with_rank.zip(message) {
                let other = [Touch::Sliver, Touch::Weak, Touch::Firm][usize::from(byte).min(2)];
                let merged = with(touches[*node as usize], other);
                changes |= std::mem::replace(&mut touches[*node as usize], merged) != merged;
            }
        }
        changes
    }
}

/// Grid nodes that points touch only by slivers. Their stiffness would be round-off, and nothing would resist their
/// motion. They are not active; their small contributions go to the other nodes of each point.
///
/// No ghost penalty supports a node all of whose cells have inactive corners. Therefore a node that points touch weakly
/// is a sliver node, too, if no touched cell around it has active corners only, or if a group touches it together with
/// a sliver node. Both happen where a surface along a grid line deviates from the line by less than the threshold in
/// one part and by more in another.
#[derive(Default)]
pub(super) struct Slivers {
    /// For each grid node, true if it is a sliver node or no point touches it; empty if there is no sliver node.
    is_sliver_node: Vec<bool>,
}

impl Slivers {
    /// Finds the sliver nodes. `cells` are the cells that points touch, and `touches` states how firmly each group
    /// touches each of its nodes. The nodes of group g are `group_nodes[starts[g]..starts[g + 1]]`; the nodes of the
    /// last group extend to the end.
    pub(super) fn new<const D: usize>(
        grid: &dyn Grid<D>,
        cells: &[u32],
        starts: &[usize],
        group_nodes: &[u32],
        touches: &[Touch],
        others: &SharedTouches,
    ) -> Slivers {
        if others.ranks.all(touches.iter().all(|touch| *touch == Touch::Firm)) {
            return Slivers::default();
        }
        let mut firmest = vec![Touch::Sliver; grid.n_nodes()];
        for (&node, &touch) in group_nodes.iter().zip(touches) {
            firmest[node as usize] = firmest[node as usize].max(touch);
        }
        others.merge(&mut firmest, Touch::max);
        let least = |firmest: &[Touch]| group_nodes.iter().map(|node| firmest[*node as usize]).min();
        if others.ranks.all(least(&firmest).is_none_or(|least| least == Touch::Firm)) {
            return Slivers::default();
        }
        let ends = starts.iter().skip(1).copied().chain([group_nodes.len()]);
        let groups: Vec<&[u32]> =
            starts.iter().zip(ends).map(|(&start, end)| &group_nodes[start..end]).collect();
        let mut spreads = true;
        while spreads {
            spreads = drop_unsupported(grid, cells, group_nodes, &mut firmest, others);
            for nodes in &groups {
                if nodes.iter().any(|node| firmest[*node as usize] == Touch::Sliver) {
                    for node in *nodes {
                        let touch = &mut firmest[*node as usize];
                        spreads |= *touch == Touch::Weak;
                        *touch = if *touch == Touch::Weak { Touch::Sliver } else { *touch };
                    }
                }
            }
            spreads |= others.merge(&mut firmest, Touch::min);
            spreads = others.ranks.any(spreads);
        }
        if others.ranks.all(least(&firmest).is_none_or(|least| least > Touch::Sliver)) {
            return Slivers::default();
        }
        Slivers { is_sliver_node: firmest.iter().map(|touch| *touch == Touch::Sliver).collect() }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.is_sliver_node.is_empty()
    }

    /// Removes sliver nodes from the support of a point and records the carrier node of each. A sliver node v moves
    /// with the displacement field of the point, u_v = u_m + (x_v − x_m)·∇u, where m is the node with the largest
    /// value. The remaining basis functions still sum to one and reproduce linear fields.
    ///
    /// The field follows from the other nodes alone: ∇u = Σ s_k u_k + Σ s_v (u_m + d_v·∇u) over the other nodes k and
    /// the sliver nodes v, with the slopes s and d_v = x_v − x_m.
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
        let slivers: Vec<(usize, [f64; D])> = (0..all.len())
            .filter(|&v| is_sliver_node(all[v]))
            .map(|v| (v, minus(&grid.node_position(all[v] as usize), &from)))
            .collect();
        carried.extend(slivers.iter().map(|(v, _)| [all[*v], all[most]]));
        for k in (0..all.len()).filter(|&k| !is_sliver_node(all[k])) {
            let mut start = slopes[k];
            if k == most {
                slivers.iter().for_each(|(v, _)| start = along(&start, 1.0, &slopes[*v]));
            }
            // The slopes of sliver nodes are small: each iteration reduces the error to about a hundredth or less.
            let mut carried_slope = start;
            for _ in 0..ROUNDS {
                let before = carried_slope;
                carried_slope = start;
                for (v, way) in &slivers {
                    carried_slope = along(&carried_slope, dot(way, &before), &slopes[*v]);
                }
            }
            gradient[k] = carried_slope;
            for (v, way) in &slivers {
                value[k] += values[*v] * (dot(way, &carried_slope) + if k == most { 1.0 } else { 0.0 });
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

/// Turns weakly touched nodes into sliver nodes if no touched cell around them has active corners only; true if there
/// were any.
fn drop_unsupported<const D: usize>(
    grid: &dyn Grid<D>,
    cells: &[u32],
    group_nodes: &[u32],
    firmest: &mut [Touch],
    others: &SharedTouches,
) -> bool {
    let mut supported = vec![Touch::Sliver; firmest.len()];
    for &cell in cells {
        let corners = grid.corners(cell as usize);
        if corners.nodes().iter().all(|node| firmest[*node as usize] > Touch::Sliver) {
            corners.nodes().iter().for_each(|node| supported[*node as usize] = Touch::Firm);
        }
    }
    others.merge(&mut supported, Touch::max);
    let mut any = false;
    for &node in group_nodes {
        let touch = &mut firmest[node as usize];
        if *touch == Touch::Weak && supported[node as usize] == Touch::Sliver {
            *touch = Touch::Sliver;
            any = true;
        }
    }
    any
}
