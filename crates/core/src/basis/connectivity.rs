//! The links of a load step: the nodes that each point touches, with basis function values and gradients (section 5.1).

mod divided;

use rayon::prelude::*;

use super::factors::{Form, multiply};
use super::slivers::{SharedTouches, Slivers, Touch};
use super::{Basis, Method, PointGeometry, Support, SupportError};
use crate::grid::Grid;
use crate::points::Points;
use crate::ranks::Halo;

/// Number of groups linked by one parallel task.
const PIECE: usize = 16;

/// Number of pieces linked before they are merged, so that they are merged from the cache.
const ROUND: usize = 32;

/// Base-2 logarithm of the number of points in a block. Offsets in a block fit into 32 bits.
const BLOCK: u32 = 12;

/// Offsets of the first point of a block in each array.
#[derive(Debug, Clone, Copy)]
struct Block {
    link: usize,
    factor: usize,
    local: usize,
}

/// Marks a grid node that no point touches.
const INACTIVE: u32 = u32::MAX;

/// The links between points and grid nodes, built once per load step.
///
/// The points of a grid cell form a group. A group touches few nodes, so its contributions are summed in one dense
/// block before they are scattered. Touched nodes are *active* and are numbered in the order of the grid.
#[derive(Debug, Clone, Default)]
pub struct Connectivity<const D: usize> {
    group_points: Vec<usize>,
    group_node_start: Vec<usize>,
    group_nodes: Vec<u32>,
    /// For each entry of `group_nodes`, how firmly the points of the group touch the node; used while linking.
    touches: Vec<Touch>,
    /// For each group, true if all its points touch all its nodes.
    whole: Vec<bool>,
    /// Start of the data of each point in `value` and `gradient`, or in `factor`; relative to its block.
    start: Vec<u32>,
    form: Vec<Form>,
    /// Start of the node indices of each point in `local`, relative to its block; points with the same nodes share
    /// them.
    local_start: Vec<u32>,
    /// Offsets of each block of points.
    blocks: Vec<Block>,
    local: Vec<u32>,
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
    /// Factors of the basis functions of points on a structured grid in three dimensions. In two dimensions the products
    /// themselves are stored, which take hardly more memory. On a graded grid the factors of each point follow 1/h of
    /// its cell along each axis.
    factor: Vec<f64>,
    /// 1/h of an even grid along each axis, [1/length]; `None` for other grids.
    per_length: Option<[f64; D]>,
    n_links: usize,
    active_nodes: Vec<u32>,
    active_of: Vec<u32>,
    active_cells: Vec<u32>,
    /// Grid nodes touched only by slivers, ascending, each with the node that carries it.
    carried: Vec<[u32; 2]>,
    /// Cells of other ranks beside those of this one, ascending, and their active nodes.
    layer_cells: Vec<u32>,
    layer_nodes: Vec<u32>,
    /// The active nodes that other ranks have, too.
    halo: Halo,
}

/// The basis functions of a point cannot be formed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupportFailure {
    /// Index of the point.
    pub point: usize,
    /// The reason.
    pub error: SupportError,
}

impl SupportFailure {
    /// A failure of which only another rank knows the point.
    const ON_RANK: SupportFailure = SupportFailure { point: 0, error: SupportError::OnRank };

    fn off_grid(point: usize) -> Self {
        SupportFailure { point, error: SupportError::OffGrid }
    }
}

/// Links of one point.
#[derive(Debug, Clone, Copy)]
pub struct Links<'a, const D: usize> {
    /// Indices of the nodes into the node list of the point's group, ascending.
    pub local: &'a [u32],
    /// S_vp, [-].
    pub value: &'a [f64],
    /// ∂S_vp/∂X̃, [1/length].
    pub gradient: &'a [[f64; D]],
}

/// Buffer for the values and gradients of one point, with buffer for all nodes of its group.
pub struct LinkBuffer<'a, const D: usize> {
    /// Buffer for S_vp, [-].
    pub value: &'a mut [f64],
    /// Buffer for ∂S_vp/∂X̃, [1/length].
    pub gradient: &'a mut [[f64; D]],
}

impl<const D: usize> Connectivity<D> {
    /// Groups the points by cell and links them.
    ///
    /// # Errors
    /// The first point that lies outside the grid or whose domain does.
    pub fn new(
        grid: &dyn Grid<D>,
        points: &mut Points<D>,
        methods: &[Method],
    ) -> Result<Self, SupportFailure> {
        Connectivity::default().renew(grid, points, methods)
    }

    /// Like [`Connectivity::new`], but reuses the memory of links that are no longer needed, such as those of the
    /// previous step.
    ///
    /// # Errors
    /// As [`Connectivity::new`].
    pub fn renew(
        mut self,
        grid: &dyn Grid<D>,
        points: &mut Points<D>,
        methods: &[Method],
    ) -> Result<Self, SupportFailure> {
        let group_points = points
            .group_by_cell(grid)
            .map_err(|point| point.map_or(SupportFailure::ON_RANK, SupportFailure::off_grid))?;
        let linked = self.link(grid, points, methods, &group_points, &Slivers::default());
        if points.ranks.any(linked.is_err()) {
            return linked.and(Err(SupportFailure::ON_RANK));
        }
        self = linked?;
        let sharing = self.sharing(&points.ranks, grid.n_nodes());
        let others = SharedTouches { ranks: &points.ranks, sharing: &sharing };
        let groups = (&self.group_node_start[..], &self.group_nodes[..]);
        let slivers = Slivers::new(grid.n_nodes(), groups, &self.touches, &others);
        let linked = match slivers.is_empty() {
            true => Ok(self),
            false => self.link(grid, points, methods, &group_points, &slivers),
        };
        if points.ranks.any(linked.is_err()) {
            return linked.and(Err(SupportFailure::ON_RANK));
        }
        self = linked?;
        self.touches = Vec::new();
        self.carried.sort_unstable();
        self.carried.dedup_by_key(|pair| pair[0]);
        self.group_points = group_points;
        self.group_node_start.push(self.group_nodes.len());
        self.list_active_cells(grid.n_cells());
        if !points.ranks.is_alone() {
            self.add_layer(grid, &points.ranks, &sharing);
        }
        self.number_active_nodes(grid.n_nodes());
        self.agree_on_carriers(&points.ranks);
        self.halo = self.find_halo(&points.ranks, grid.n_nodes());
        Ok(self)
    }

    /// Links the points group by group. Nodes keep their grid numbers for now.
    fn link(
        mut self,
        grid: &dyn Grid<D>,
        points: &Points<D>,
        methods: &[Method],
        group_points: &[usize],
        slivers: &Slivers,
    ) -> Result<Self, SupportFailure> {
        self.clear();
        self.per_length = per_length_if_even(grid);
        let n_groups = group_points.len() - 1;
        let mut all = self;
        // Rounds limit the number of pieces that exist besides the result.
        for round in (0..n_groups).step_by(ROUND * PIECE) {
            let end = (round + ROUND * PIECE).min(n_groups);
            let pieces: Vec<Result<Piece<D>, SupportFailure>> = (round..end)
                .into_par_iter()
                .step_by(PIECE)
                .map(|first| {
                    let groups = &group_points[first..=(first + PIECE).min(end)];
                    Piece::link(grid, points, methods, groups, slivers)
                })
                .collect();
            for piece in pieces {
                all.append(piece?);
            }
        }
        Ok(all)
    }

    /// Removes all links but keeps the memory.
    fn clear(&mut self) {
        self.group_node_start.clear();
        self.group_nodes.clear();
        self.touches.clear();
        self.whole.clear();
        self.start.clear();
        self.form.clear();
        self.local_start.clear();
        self.blocks.clear();
        self.local.clear();
        self.value.clear();
        self.gradient.clear();
        self.factor.clear();
        self.n_links = 0;
        self.active_nodes.clear();
        self.active_of.clear();
        self.active_cells.clear();
        self.carried.clear();
        self.layer_cells.clear();
        self.layer_nodes.clear();
    }

    fn append(&mut self, piece: Piece<D>) {
        let (nodes, locals) = (self.group_nodes.len(), self.local.len());
        let (links, factors) = (self.value.len(), self.factor.len());
        self.group_node_start.extend(piece.group_node_start.iter().map(|s| s + nodes));
        self.group_nodes.extend(piece.group_nodes);
        self.touches.extend(piece.touches);
        self.whole.extend(piece.whole);
        // Offsets of the next data of each kind. Node indices may be shared with any earlier point of the group.
        let mut next = Block { link: links, factor: factors, local: locals };
        for ((&start, form), &local) in piece.start.iter().zip(&piece.form).zip(&piece.local_start) {
            let explicit = form.is_explicit();
            let begin = if explicit { &mut next.link } else { &mut next.factor };
            *begin = start + if explicit { links } else { factors };
            let begin = *begin;
            if self.start.len().is_multiple_of(1 << BLOCK) {
                self.blocks.push(next);
            }
            let block = self.blocks[self.start.len() >> BLOCK];
            let from = if explicit { block.link } else { block.factor };
            // Offsets within a block fit: a point touches a few hundred nodes at most.
            self.start.push((begin - from) as u32);
            self.local_start.push((local + locals - block.local) as u32);
        }
        self.n_links += piece.form.iter().map(|form| form.nodes::<D>()).sum::<usize>();
        self.form.extend(piece.form);
        self.local.extend(piece.local);
        self.value.extend(piece.value);
        self.gradient.extend(piece.gradient);
        self.factor.extend(piece.factor);
        self.active_cells.extend(piece.cells);
        self.carried.extend(piece.carried);
    }

    /// Numbers the touched nodes in grid order and converts the node lists of the groups to these numbers.
    fn number_active_nodes(&mut self, n_nodes: usize) {
        self.active_of.resize(n_nodes, INACTIVE);
        for &node in self.group_nodes.iter().chain(&self.layer_nodes) {
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

    /// Sorts the list of touched cells and removes duplicates.
    fn list_active_cells(&mut self, n_cells: usize) {
        let mut is_met = vec![false; n_cells];
        for &cell in &self.active_cells {
            is_met[cell as usize] = true;
        }
        self.active_cells.clear();
        self.active_cells.extend((0..n_cells as u32).filter(|&cell| is_met[cell as usize]));
    }

    /// Number of groups.
    pub fn n_groups(&self) -> usize {
        self.group_points.len() - 1
    }

    /// Range of the points of a group.
    pub fn points_of(&self, group: usize) -> std::ops::Range<usize> {
        self.group_points[group]..self.group_points[group + 1]
    }

    /// The active nodes that a group touches, ascending.
    pub fn nodes_of(&self, group: usize) -> &[u32] {
        &self.group_nodes[self.group_node_start[group]..self.group_node_start[group + 1]]
    }

    /// Indices of the nodes of a point into the node list of its group, ascending.
    #[inline(always)]
    pub fn local_nodes(&self, point: usize) -> &[u32] {
        let start = self.blocks[point >> BLOCK].local + self.local_start[point] as usize;
        &self.local[start..][..self.form[point].nodes::<D>()]
    }

    /// Links of a point; `buffer` holds values and gradients that are stored as factors.
    #[inline(always)]
    pub fn links<'a>(&'a self, point: usize, buffer: &'a mut LinkBuffer<'_, D>) -> Links<'a, D> {
        let local = self.local_nodes(point);
        let (block, start) = (&self.blocks[point >> BLOCK], self.start[point] as usize);
        if D < 3 || self.form[point].is_explicit() {
            let range = block.link + start..block.link + start + local.len();
            return Links { local, value: &self.value[range.clone()], gradient: &self.gradient[range] };
        }
        let (value, gradient) = (&mut buffer.value[..local.len()], &mut buffer.gradient[..local.len()]);
        let mut numbers = &self.factor[block.factor + start..];
        let per_length = self.per_length.unwrap_or_else(|| {
            let (of_cell, rest) = numbers.split_at(D);
            numbers = rest;
            std::array::from_fn(|d| of_cell[d])
        });
        multiply(self.form[point], numbers, &per_length, value, gradient);
        Links { local, value, gradient }
    }

    /// Calls `visit` for each node of a point with its index into the node list of the group, and S_vp.
    #[inline(always)]
    pub fn for_each_value(&self, point: usize, mut visit: impl FnMut(usize, f64)) {
        self.for_each_link(point, |local, value, _| visit(local, value));
    }

    /// Calls `visit` for each node of a point with its index into the node list of the group, S_vp, and ∂S_vp/∂X̃,
    /// [1/length].
    #[inline(always)]
    pub fn for_each_link(&self, point: usize, mut visit: impl FnMut(usize, f64, &[f64; D])) {
        const FEW: usize = 64;
        let n = self.local_nodes(point).len();
        let (mut value, mut gradient) = ([0.0; FEW], [[0.0; D]; FEW]);
        // Points with more nodes are stored explicitly and need no buffer.
        let mut buffer =
            LinkBuffer { value: &mut value[..n.min(FEW)], gradient: &mut gradient[..n.min(FEW)] };
        let links = self.links(point, &mut buffer);
        for ((&local, value), gradient) in links.local.iter().zip(links.value).zip(links.gradient) {
            visit(local as usize, *value, gradient);
        }
    }

    /// Total number of links.
    pub fn n_links(&self) -> usize {
        self.n_links
    }

    /// True if all points of a group touch all its nodes.
    #[inline]
    pub fn is_whole(&self, group: usize) -> bool {
        self.whole[group]
    }

    /// Number of active nodes.
    pub fn n_active(&self) -> usize {
        self.active_nodes.len()
    }

    /// Grid numbers of the active nodes, ascending.
    pub fn active_nodes(&self) -> &[u32] {
        &self.active_nodes
    }

    /// The active nodes that other ranks have, too. With other ranks, this one has the nodes that its points touch and those of one
    /// layer of cells beside them.
    pub fn halo(&self) -> &Halo {
        &self.halo
    }

    /// Cells that points of other ranks touch, beside the active ones, ascending.
    pub fn layer_cells(&self) -> &[u32] {
        &self.layer_cells
    }

    /// Grid cells touched by points or their domains, ascending. A domain with corners touches the cells of the point
    /// and of its corners.
    pub fn active_cells(&self) -> &[u32] {
        &self.active_cells
    }

    /// Active number of the node that moves with a grid node: the node itself, or its carrier if only slivers of basis
    /// functions touch it; `None` if no point is near.
    #[inline(always)]
    pub fn moves_with(&self, node: usize) -> Option<usize> {
        match self.active_of[node] {
            INACTIVE if self.carried.is_empty() => None,
            INACTIVE => self.carrier(node),
            number => Some(number as usize),
        }
    }

    /// Active number of the node that carries a grid node touched only by slivers.
    #[cold]
    fn carrier(&self, node: usize) -> Option<usize> {
        let index = self.carried.binary_search_by_key(&(node as u32), |pair| pair[0]).ok()?;
        self.active_number(self.carried[index][1] as usize)
    }

    /// Active number of a grid node; `None` if points touch it by slivers only, or not at all.
    #[inline]
    pub fn active_number(&self, node: usize) -> Option<usize> {
        match self.active_of[node] {
            INACTIVE => None,
            number => Some(number as usize),
        }
    }
}

/// 1/h of an even grid along each axis, [1/length].
fn per_length_if_even<const D: usize>(grid: &dyn Grid<D>) -> Option<[f64; D]> {
    grid.structured().filter(|grid| grid.is_even()).map(|grid| grid.sides([0; D]).map(|h| 1.0 / h))
}

/// Links of consecutive groups, with grid node numbers.
#[derive(Default)]
struct Piece<const D: usize> {
    group_node_start: Vec<usize>,
    group_nodes: Vec<u32>,
    /// As [`Connectivity::touches`].
    touches: Vec<Touch>,
    whole: Vec<bool>,
    start: Vec<usize>,
    form: Vec<Form>,
    local_start: Vec<usize>,
    local: Vec<u32>,
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
    factor: Vec<f64>,
    cells: Vec<u32>,
    carried: Vec<[u32; 2]>,
}

impl<const D: usize> Piece<D> {
    fn link(
        grid: &dyn Grid<D>,
        points: &Points<D>,
        methods: &[Method],
        groups: &[usize],
        slivers: &Slivers,
    ) -> Result<Self, SupportFailure> {
        let mut piece = Piece::default();
        let even = per_length_if_even(grid);
        let mut touches: Vec<Touch> = Vec::new(); // for each entry of `touched`
        let mut support = Support::default();
        let mut touched: Vec<u32> = Vec::new(); // grid nodes of one group, listed for each point unless equal to those before
        let mut nodes: Vec<u32> = Vec::new();
        for range in groups.windows(2).map(|w| w[0]..w[1]) {
            touched.clear();
            touches.clear();
            nodes.clear();
            let mut firm_from = 0; // from here on, all entries of `touched` are known to be firm
            let size = range.clone().next().map_or(0.0, |p| grid.size(points.cell[p] as usize));
            let mut n_links = 0;
            for p in range.clone() {
                let half_lengths = points.half_lengths(p);
                let basis: &dyn Basis<D> = methods[points.body[p] as usize].basis();
                let point = PointGeometry {
                    cell: points.cell[p],
                    position: &points.converged.position[p],
                    half_lengths: &half_lengths,
                    corners: points.corners(p),
                };
                basis
                    .support(grid, &point, &mut support)
                    .map_err(|error| SupportFailure { point: p, error })?;
                slivers.fold(grid, &mut support, &mut piece.carried);
                n_links += support.nodes.len();
                match (&support.factors, grid.structured()) {
                    (Some(factors), Some(grid)) => {
                        piece.start.push(piece.factor.len());
                        let per_length = even.unwrap_or_else(|| {
                            let sides = grid.sides(grid.cell_index(points.cell[p] as usize));
                            let per_length = sides.map(|h| 1.0 / h);
                            piece.factor.extend(per_length);
                            per_length
                        });
                        piece.form.push(factors.keep(&per_length, &mut piece.factor));
                    }
                    _ => {
                        piece.start.push(piece.value.len());
                        piece.form.push(Form::explicit(support.nodes.len()));
                        piece.value.extend_from_slice(&support.value);
                        piece.gradient.extend_from_slice(&support.gradient);
                    }
                }
                if !touched.ends_with(&support.nodes) {
                    for node in &support.nodes {
                        if !nodes.contains(node) {
                            nodes.push(*node);
                        }
                    }
                    piece.cells.extend_from_slice(&support.cells);
                    touched.extend_from_slice(&support.nodes);
                    touches.resize(touched.len(), Touch::Sliver);
                    firm_from = touched.len();
                }
                let of_point = touched.len() - support.nodes.len();
                if of_point < firm_from {
                    let mut all_firm = true;
                    for (k, touch) in touches[of_point..].iter_mut().enumerate() {
                        if *touch < Touch::Firm {
                            *touch = (*touch).max(Touch::of(support.value[k], &support.gradient[k], size));
                        }
                        all_firm &= *touch == Touch::Firm;
                    }
                    if all_firm {
                        firm_from = of_point;
                    }
                }
                piece.local_start.push(piece.local.len() + of_point);
            }
            piece.group_node_start.push(piece.group_nodes.len());
            nodes.sort_unstable();
            piece.local.extend(touched.iter().map(|n| nodes.partition_point(|m| m < n) as u32));
            let first = piece.group_nodes.len();
            piece.group_nodes.extend_from_slice(&nodes);
            piece.touches.resize(piece.group_nodes.len(), Touch::Sliver);
            let locals = &piece.local[piece.local.len() - touched.len()..];
            for (&local, &touch) in locals.iter().zip(&touches) {
                let firmest = &mut piece.touches[first + local as usize];
                *firmest = (*firmest).max(touch);
            }
            piece.whole.push(n_links == range.len() * nodes.len());
        }
        Ok(piece)
    }
}

#[cfg(test)]
mod tests;
