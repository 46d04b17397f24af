//! Slivers: basis functions with negligible values and slopes, and nodes that points touch only with such functions.

use std::collections::BTreeMap;

use super::Support;
use crate::grid::Grid;
use crate::ranks::{Ranks, Sharing};
use crate::region::vector::{along, minus, norm};

/// Threshold of the value, and of the slope times the cell size, below which a basis function is a sliver, [-]. It is
/// the relative distance within which points count as lying on grid lines.
const SLIVER: f64 = 1e-8;

/// Threshold of the value, and of the slope times the cell size, below which points touch a node weakly, [-].
const WEAK: f64 = 1e-3;

/// For each sliver node, the nodes with which it moves and their weights, whose sum is 1; grid numbers.
pub(super) type Carriers = BTreeMap<u32, Vec<(u32, f64)>>;

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
/// motion. They are not active; their small contributions go to the nodes of a cell beside them, their carriers.
///
/// No ghost penalty supports a node all of whose cells have inactive corners. Therefore a node that points touch weakly
/// is a sliver node, too, if no touched cell around it has active corners only, or if a group touches it together with
/// a sliver node. Both happen where a surface along a grid line deviates from the line by less than the threshold in
/// one part and by more in another.
#[derive(Default)]
pub(super) struct Slivers {
    /// For each grid node, true if it is a sliver node or no point touches it; empty if there is no sliver node.
    is_sliver_node: Vec<bool>,
    carriers: Carriers,
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
        Slivers {
            is_sliver_node: firmest.iter().map(|touch| *touch == Touch::Sliver).collect(),
            carriers: find_carriers(grid, cells, group_nodes, &firmest, others.ranks),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.is_sliver_node.is_empty()
    }

    /// The carriers of the sliver nodes.
    pub(super) fn into_carriers(self) -> Carriers {
        self.carriers
    }

    /// Moves the contributions of the sliver nodes in the support of a point to their carriers. The remaining basis
    /// functions still sum to one and reproduce linear fields.
    pub(super) fn fold<const D: usize>(&self, support: &mut Support<D>) {
        let is_sliver_node =
            |node: u32| self.is_sliver_node.get(node as usize).is_some_and(|is_sliver_node| *is_sliver_node);
        if self.is_empty() || !support.nodes.iter().any(|node| is_sliver_node(*node)) {
            return;
        }
        let Support { nodes, value, gradient, factors, .. } = support;
        let mut sums: BTreeMap<u32, (f64, [f64; D])> = BTreeMap::new();
        let mut add = |node: u32, weight: f64, value: f64, gradient: &[f64; D]| {
            let sum = sums.entry(node).or_insert((0.0, [0.0; D]));
            sum.0 += weight * value;
            sum.1 = along(&sum.1, weight, gradient);
        };
        for ((node, value), gradient) in nodes.iter().zip(&*value).zip(&*gradient) {
            if is_sliver_node(*node) {
                let carriers = self.carriers.get(node).map_or(&[][..], |carriers| carriers);
                carriers.iter().for_each(|(carrier, weight)| add(*carrier, *weight, *value, gradient));
            } else {
                add(*node, 1.0, *value, gradient);
            }
        }
        nodes.clear();
        value.clear();
        gradient.clear();
        for (node, (sum, slope)) in sums {
            nodes.push(node);
            value.push(sum);
            gradient.push(slope);
        }
        *factors = None;
    }
}

/// The carriers of the sliver nodes that points touch. A sliver node moves with the field of the nearest touched cell
/// without sliver nodes, continued to the node, or with the mean of the fields of several cells that are equally near. If
/// there is no such cell near the node, it moves with the nearest other node.
///
/// The carriers depend on the node only, not on the point that touches it: forces that balance at a sliver node, such as
/// those of a uniform stress inside a body and on its surface, also balance at its carriers.
fn find_carriers<const D: usize>(
    grid: &dyn Grid<D>,
    cells: &[u32],
    group_nodes: &[u32],
    firmest: &[Touch],
    ranks: &Ranks,
) -> Carriers {
    let gathered = |mut all: Vec<[u32; 2]>| {
        all.sort_unstable();
        all.dedup();
        if !ranks.is_alone() {
            all = ranks.gather_all(all).concat();
            all.sort_unstable();
            all.dedup();
        }
        all
    };
    let is_sliver = |node: &u32| firmest[*node as usize] == Touch::Sliver;
    let mut is_touched = vec![false; firmest.len()];
    group_nodes.iter().for_each(|node| is_touched[*node as usize] = true);
    let mut pairs = Vec::new();
    for &cell in cells {
        let corners = grid.corners(cell as usize);
        for sliver in corners.nodes().iter().filter(|node| is_sliver(node) && is_touched[**node as usize]) {
            let others = corners.nodes().iter().filter(|node| !is_sliver(node));
            pairs.extend(others.map(|other| [*sliver, *other]));
        }
    }
    let beside = gathered(pairs);
    let mut is_wanted = vec![false; firmest.len()];
    beside.iter().for_each(|[_, other]| is_wanted[*other as usize] = true);
    let mut pairs = Vec::new();
    for &cell in cells {
        let corners = grid.corners(cell as usize);
        if !corners.nodes().iter().any(is_sliver) {
            let wanted = corners.nodes().iter().filter(|node| is_wanted[**node as usize]);
            pairs.extend(wanted.map(|node| [*node, cell]));
        }
    }
    let around = gathered(pairs);
    let cells_around = |node: u32| {
        let first = around.partition_point(|[other, _]| *other < node);
        around[first..].iter().take_while(move |[other, _]| *other == node).map(|[_, cell]| *cell)
    };
    let place = |node: u32| grid.node_position(node as usize);
    let of_node = |beside: &[[u32; 2]]| {
        let position = place(beside[0][0]);
        let mut near: Vec<u32> = beside.iter().flat_map(|[_, other]| cells_around(*other)).collect();
        near.sort_unstable();
        near.dedup();
        let mut carriers: BTreeMap<u32, f64> = BTreeMap::new();
        let nearest =
            nearest(near.into_iter().map(|cell| (cell, norm(&minus(&centre(grid, cell), &position)))));
        for cell in &nearest {
            let basis = grid.basis_at(*cell, &position);
            for (node, value) in basis.nodes().iter().zip(basis.value()) {
                *carriers.entry(*node).or_insert(0.0) += value / nearest.len() as f64;
            }
        }
        if nearest.is_empty() {
            let others = beside.iter().map(|[_, other]| (*other, norm(&minus(&place(*other), &position))));
            let nearest = self::nearest(others);
            carriers.extend(nearest.iter().map(|node| (*node, 1.0 / nearest.len() as f64)));
        }
        (beside[0][0], carriers.into_iter().filter(|(_, weight)| *weight != 0.0).collect())
    };
    beside.chunk_by(|a, b| a[0] == b[0]).map(of_node).collect()
}

/// Those of several candidates whose distance is smallest; distances that differ by round-off count as equal.
fn nearest(candidates: impl Iterator<Item = (u32, f64)>) -> Vec<u32> {
    let candidates: Vec<(u32, f64)> = candidates.collect();
    let least = candidates.iter().fold(f64::INFINITY, |least, (_, distance)| least.min(*distance));
    let near = candidates.into_iter().filter(|(_, distance)| *distance <= (1.0 + SLIVER) * least);
    near.map(|(candidate, _)| candidate).collect()
}

/// The mean position of the corners of a cell, [length].
fn centre<const D: usize>(grid: &dyn Grid<D>, cell: u32) -> [f64; D] {
    let corners = grid.corners(cell as usize);
    let share = 1.0 / corners.nodes().len() as f64;
    let add = |sum: [f64; D], node: &u32| along(&sum, share, &grid.node_position(*node as usize));
    corners.nodes().iter().fold([0.0; D], add)
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
