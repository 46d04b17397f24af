//! Which nodes every point touches and how strongly, for all points of a load step (section 5.1).

use rayon::prelude::*;

use super::{Basis, Method, PointGeometry, Support, SupportError};
use crate::grid::Grid;
use crate::points::Points;

/// Number of groups that are linked as one piece of work.
const PIECE: usize = 16;

/// Number of pieces that are linked before they are put together, while they are still in the cache.
const ROUND: usize = 32;

/// Marks a grid node that no point touches.
const INACTIVE: u32 = u32::MAX;

/// The links between points and grid nodes; built once per load step, then constant.
///
/// Points come in groups: those whose home is the same grid cell. A group touches few nodes, so its points
/// accumulate one dense block before anything is scattered. Nodes that are touched are *active* and numbered in the
/// order of the grid.
#[derive(Debug, Clone, Default)]
pub struct Connectivity<const D: usize> {
    group_points: Vec<usize>,
    group_node_start: Vec<usize>,
    group_nodes: Vec<u32>,
    link_start: Vec<usize>,
    /// Where the places of the nodes of each point start in `local`; neighbours that touch the same nodes share them.
    local_start: Vec<usize>,
    local: Vec<u32>,
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
    active_nodes: Vec<u32>,
    active_of: Vec<u32>,
    active_cells: Vec<u32>,
}

/// The basis functions of a point cannot be formed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupportFailure {
    /// Index of the point.
    pub point: usize,
    /// Why.
    pub error: SupportError,
}

/// The links of one point.
#[derive(Debug, Clone, Copy)]
pub struct Links<'a, const D: usize> {
    /// Places of the nodes in the node list of the point's group, ascending.
    pub local: &'a [u32],
    /// S_vp, [-].
    pub value: &'a [f64],
    /// ∂S_vp/∂X̃, [1/length].
    pub gradient: &'a [[f64; D]],
}

impl<const D: usize> Connectivity<D> {
    /// Links all points; groups them by cell first.
    ///
    /// # Errors
    /// The first point that is outside the grid or whose domain is.
    pub fn new(
        grid: &dyn Grid<D>,
        points: &mut Points<D>,
        methods: &[Method],
    ) -> Result<Self, SupportFailure> {
        Connectivity::default().renew(grid, points, methods)
    }

    /// The same in the memory of links that are no longer needed, as those of the step before.
    ///
    /// # Errors
    /// As [`Connectivity::new`].
    pub fn renew(
        mut self,
        grid: &dyn Grid<D>,
        points: &mut Points<D>,
        methods: &[Method],
    ) -> Result<Self, SupportFailure> {
        self.clear();
        let group_points = points
            .group_by_cell(grid)
            .map_err(|point| SupportFailure { point, error: SupportError::OffGrid })?;
        let points = &*points;
        let n_groups = group_points.len() - 1;
        let mut all = self;
        // In rounds, so that no more than a few pieces exist beside the whole.
        for round in (0..n_groups).step_by(ROUND * PIECE) {
            let end = (round + ROUND * PIECE).min(n_groups);
            let pieces: Vec<Result<Piece<D>, SupportFailure>> = (round..end)
                .into_par_iter()
                .step_by(PIECE)
                .map(|first| {
                    Piece::link(grid, points, methods, &group_points[first..=(first + PIECE).min(end)])
                })
                .collect();
            for piece in pieces {
                all.append(piece?);
            }
        }
        all.group_points = group_points;
        all.group_node_start.push(all.group_nodes.len());
        all.link_start.push(all.value.len());
        all.number_active_nodes(grid.n_nodes());
        all.active_cells.sort_unstable();
        all.active_cells.dedup();
        Ok(all)
    }

    /// Forgets all links but keeps the memory.
    fn clear(&mut self) {
        self.group_node_start.clear();
        self.group_nodes.clear();
        self.link_start.clear();
        self.local_start.clear();
        self.local.clear();
        self.value.clear();
        self.gradient.clear();
        self.active_nodes.clear();
        self.active_of.clear();
        self.active_cells.clear();
    }

    fn append(&mut self, piece: Piece<D>) {
        let (nodes, links, places) = (self.group_nodes.len(), self.value.len(), self.local.len());
        self.group_node_start.extend(piece.group_node_start.iter().map(|s| s + nodes));
        self.group_nodes.extend(piece.group_nodes);
        self.link_start.extend(piece.link_start.iter().map(|s| s + links));
        self.local_start.extend(piece.local_start.iter().map(|s| s + places));
        self.local.extend(piece.local);
        self.value.extend(piece.value);
        self.gradient.extend(piece.gradient);
        self.active_cells.extend(piece.cells);
    }

    /// Numbers the touched nodes in grid order and turns the node lists of the groups into these numbers.
    fn number_active_nodes(&mut self, n_nodes: usize) {
        self.active_of.resize(n_nodes, INACTIVE);
        for &node in &self.group_nodes {
            self.active_of[node as usize] = 0;
        }
        for (node, number) in self.active_of.iter_mut().enumerate() {
            if *number == 0 {
                *number = self.active_nodes.len() as u32;
                self.active_nodes.push(node as u32);
            }
        }
        for node in &mut self.group_nodes {
            *node = self.active_of[*node as usize];
        }
    }

    /// Number of groups.
    pub fn n_groups(&self) -> usize {
        self.group_points.len() - 1
    }

    /// The points of a group.
    pub fn points_of(&self, group: usize) -> std::ops::Range<usize> {
        self.group_points[group]..self.group_points[group + 1]
    }

    /// The active nodes that a group touches, ascending.
    pub fn nodes_of(&self, group: usize) -> &[u32] {
        &self.group_nodes[self.group_node_start[group]..self.group_node_start[group + 1]]
    }

    /// The links of a point.
    #[inline(always)]
    pub fn links(&self, point: usize) -> Links<'_, D> {
        let range = self.link_start[point]..self.link_start[point + 1];
        Links {
            local: &self.local[self.local_start[point]..][..range.len()],
            value: &self.value[range.clone()],
            gradient: &self.gradient[range],
        }
    }

    /// Number of links before a point: where its first link stands in arrays that run over all links.
    pub fn link_start(&self, point: usize) -> usize {
        self.link_start[point]
    }

    /// Number of links of all points.
    pub fn n_links(&self) -> usize {
        self.value.len()
    }

    /// Whether all points of a group touch all its nodes.
    #[inline]
    pub fn is_whole(&self, group: usize) -> bool {
        let points = self.points_of(group);
        let n_links = self.link_start[points.end] - self.link_start[points.start];
        n_links == points.len() * self.nodes_of(group).len()
    }

    /// Number of active nodes.
    pub fn n_active(&self) -> usize {
        self.active_nodes.len()
    }

    /// Grid numbers of the active nodes, ascending.
    pub fn active_nodes(&self) -> &[u32] {
        &self.active_nodes
    }

    /// The grid cells that points or their domains meet, ascending; of domains given by corners, the cells of the point
    /// and of the corners.
    pub fn active_cells(&self) -> &[u32] {
        &self.active_cells
    }

    /// Connected parts of the active nodes: for each node the lowest node that is coupled to it, directly or through
    /// others. Two nodes are coupled when a point touches both.
    pub fn parts(&self) -> Vec<usize> {
        fn find(root: &mut [usize], mut node: usize) -> usize {
            while root[node] != node {
                root[node] = root[root[node]];
                node = root[node];
            }
            node
        }
        let mut root: Vec<usize> = (0..self.n_active()).collect();
        for group in 0..self.n_groups() {
            let nodes = self.nodes_of(group);
            let mut last: &[u32] = &[];
            for p in self.points_of(group) {
                let local = self.links(p).local;
                if local == last {
                    continue; // neighbours in a cell mostly touch the same nodes
                }
                last = local;
                for pair in local.windows(2) {
                    let [a, b] = [pair[0], pair[1]].map(|k| find(&mut root, nodes[k as usize] as usize));
                    root[a.max(b)] = a.min(b);
                }
            }
        }
        (0..root.len()).map(|node| find(&mut root, node)).collect()
    }

    /// Active number of a grid node, if any point touches it.
    pub fn active_number(&self, node: usize) -> Option<usize> {
        match self.active_of[node] {
            INACTIVE => None,
            number => Some(number as usize),
        }
    }
}

/// The links of consecutive groups, in grid node numbers.
#[derive(Default)]
struct Piece<const D: usize> {
    group_node_start: Vec<usize>,
    group_nodes: Vec<u32>,
    link_start: Vec<usize>,
    local_start: Vec<usize>,
    local: Vec<u32>,
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
    cells: Vec<u32>,
}

impl<const D: usize> Piece<D> {
    fn link(
        grid: &dyn Grid<D>,
        points: &Points<D>,
        methods: &[Method],
        groups: &[usize],
    ) -> Result<Self, SupportFailure> {
        let mut piece = Piece::default();
        let mut support = Support::default();
        let mut touched: Vec<u32> = Vec::new(); // grid nodes of one group, point by point where they differ
        let mut nodes: Vec<u32> = Vec::new();
        for range in groups.windows(2).map(|w| w[0]..w[1]) {
            touched.clear();
            nodes.clear();
            for p in range {
                let basis: &dyn Basis<D> = methods[points.body[p] as usize].basis();
                let point = PointGeometry {
                    cell: points.cell[p],
                    position: &points.converged.position[p],
                    half_lengths: &points.converged.half_lengths[p],
                    corners: points.corners(p),
                };
                basis
                    .support(grid, &point, &mut support)
                    .map_err(|error| SupportFailure { point: p, error })?;
                piece.link_start.push(piece.value.len());
                if !touched.ends_with(&support.nodes) {
                    nodes.extend_from_slice(&support.nodes);
                    piece.cells.extend_from_slice(&support.cells);
                    touched.extend_from_slice(&support.nodes);
                }
                piece.local_start.push(piece.local.len() + touched.len() - support.nodes.len());
                piece.value.extend_from_slice(&support.value);
                piece.gradient.extend_from_slice(&support.gradient);
            }
            piece.group_node_start.push(piece.group_nodes.len());
            nodes.sort_unstable();
            nodes.dedup();
            piece.local.extend(touched.iter().map(|n| nodes.partition_point(|m| m < n) as u32));
            piece.group_nodes.extend_from_slice(&nodes);
        }
        Ok(piece)
    }
}
