//! The links of a load step: the nodes that each point touches, with basis function values and gradients (section 6.1).

mod divided;
mod piece;

use rayon::prelude::*;

use super::factors::{Form, for_each_product, multiply};
use super::node_copies::{BodyGroup, NodeCopies};
use super::slivers::{Carriers, SharedTouches, Slivers, Touch};
use super::{Basis, Method, PointGeometry, Support, SupportError};
use crate::grid::Grid;
use crate::points::Points;
use crate::ranks::{Halo, Ranks, Reduction, Sharing};

use piece::Piece;

/// Number of groups linked by one parallel task.
const PIECE: usize = 16;

/// Number of pieces linked before they are merged, chosen so that they are still in the cache when they are merged.
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

/// The body to which the nodes of other ranks belong: on several ranks, all bodies are in one group.
const ANY_BODY: u16 = 0;

/// The links between points and grid nodes, built once per load step.
///
/// The points of a grid cell, or of a patch of cells, form a group. A group touches few nodes, so its contributions are
/// summed in one dense block before they are scattered. Touched nodes are *active* and are numbered in the order of the
/// grid, except sliver nodes, whose basis functions are negligible.
#[derive(Debug, Clone, Default)]
pub struct Connectivity<const D: usize> {
    group_points: Vec<usize>,
    /// A body of each group of points; all bodies of its points are in one group of bodies.
    body_of_group: Vec<u16>,
    group_node_start: Vec<usize>,
    group_nodes: Vec<u32>,
    /// For each entry of `group_nodes`, how firmly the points of the group touch the node; used only during linking.
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
    /// Factors of the basis functions of points on a structured grid in three dimensions. In two dimensions, the
    /// products themselves are stored because they need hardly more memory. On a graded grid, the factors of each point
    /// are preceded by 1/h of its cell along each axis.
    factor: Vec<f64>,
    /// 1/h of an even grid along each axis, [1/length]; `None` for other grids.
    per_length: Option<[f64; D]>,
    n_links: usize,
    copies: NodeCopies,
    active_cells: Vec<u32>,
    /// For each group of bodies, the grid cells that their points touch, ascending; empty if there is only one group.
    cells_of_bodies: Vec<Vec<u32>>,
    /// The carriers of the sliver nodes, for each group of bodies.
    carriers: Vec<Carriers>,
    /// Cells of other ranks next to the cells of this rank, ascending.
    layer_cells: Vec<u32>,
    /// Active nodes of `layer_cells`, and further nodes that terms need on this rank; grid numbers.
    layer_nodes: Vec<u32>,
    /// The active nodes that other ranks also have.
    reduction: Reduction,
}

/// The basis functions of a point cannot be formed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SupportFailure {
    /// Index of the point.
    pub point: usize,
    /// Reason for the failure.
    pub error: SupportError,
}

impl SupportFailure {
    /// A failure at a point that only another rank knows.
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

/// Buffer for the values and gradients of one point, large enough for all nodes of its group.
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
    /// The first point that lies outside the grid, or whose basis functions cannot be formed.
    pub fn new(
        grid: &dyn Grid<D>,
        points: &mut Points<D>,
        methods: &[Method],
    ) -> Result<Self, SupportFailure> {
        Connectivity::default().renew(grid, points, methods)
    }

    /// These links with the bodies in groups that have unknowns of their own, as [`NodeCopies::new`] takes them, once the
    /// links are renewed.
    #[must_use]
    pub fn with_body_groups(mut self, group_of_body: &[BodyGroup]) -> Self {
        self.copies = self.copies.with_groups(group_of_body);
        self
    }

    /// Like [`Connectivity::new`], but reuses the memory of links that are no longer needed, such as the links of the
    /// previous step.
    ///
    /// # Errors
    /// The same as for [`Connectivity::new`].
    #[inline(never)]
    pub fn renew(
        mut self,
        grid: &dyn Grid<D>,
        points: &mut Points<D>,
        methods: &[Method],
    ) -> Result<Self, SupportFailure> {
        let groups = points
            .group_by_cell(grid, self.copies.group_of_body())
            .map_err(|point| point.map_or(SupportFailure::ON_RANK, SupportFailure::off_grid))?;
        let points = &*points;
        let per_length = per_length_if_even(grid);
        self.body_of_group = groups[..groups.len() - 1].iter().map(|first| points.body[*first]).collect();
        let (group_of_body, n_body_groups) = (self.copies.group_of_body().to_vec(), self.copies.n_groups());
        let body_group = |body: u16| group_of_body.get(body as usize).map_or(0, |group| *group as usize);
        let link = |groups: &[usize], slivers: &[Slivers]| -> Result<Piece<D>, SupportFailure> {
            let (mut piece, mut support) = (Piece::new(per_length), Support::default());
            for group in groups.windows(2).map(|ends| ends[0]..ends[1]) {
                piece.begin_group(grid.size(points.cell[group.start] as usize));
                let slivers = &slivers[body_group(points.body[group.start])];
                for p in group {
                    let basis: &dyn Basis<D> = methods[points.body[p] as usize].basis();
                    let supported = basis.support(grid, &PointGeometry::converged(points, p), &mut support); // S_vp, ∇S_vp
                    supported.map_err(|error| SupportFailure { point: p, error })?;
                    slivers.fold(&mut support);
                    piece.add(grid, points.cell[p], &support);
                }
                piece.end_group();
            }
            Ok(piece)
        };
        let mut slivers: Vec<Slivers> = (0..n_body_groups).map(|_| Slivers::default()).collect();
        let mut sharing = Sharing::default();
        // The first pass finds the slivers; if there are any, a second pass folds them into other nodes.
        for pass in 0..2 {
            self.clear();
            self.per_length = per_length;
            let n_groups = groups.len() - 1;
            // Working in rounds limits the number of pieces that exist in addition to the result.
            let linked = (0..n_groups).step_by(ROUND * PIECE).try_for_each(|round| {
                let end = (round + ROUND * PIECE).min(n_groups);
                let firsts = (round..end).into_par_iter().step_by(PIECE);
                let pieces = firsts.map(|first| link(&groups[first..=(first + PIECE).min(end)], &slivers));
                let pieces: Vec<Result<Piece<D>, SupportFailure>> = pieces.collect();
                pieces.into_iter().try_for_each(|piece| piece.map(|piece| self.append(piece)))
            });
            if points.ranks.any(linked.is_err()) {
                return linked.and(Err(SupportFailure::ON_RANK));
            }
            if pass == 0 {
                sharing = self.sharing(&points.ranks, grid.n_nodes());
                let others = SharedTouches { ranks: &points.ranks, sharing: &sharing };
                slivers = self.find_slivers(grid, &others);
            }
            if slivers.iter().all(Slivers::is_empty) {
                break;
            }
        }
        if !slivers.iter().all(Slivers::is_empty) {
            sharing = self.sharing(&points.ranks, grid.n_nodes());
        }
        self.carriers = slivers.into_iter().map(Slivers::into_carriers).collect();
        self.group_points = groups;
        Ok(self.numbered(grid, &points.ranks, &sharing))
    }

    /// The sliver nodes of each group of bodies.
    fn find_slivers(&self, grid: &dyn Grid<D>, others: &SharedTouches) -> Vec<Slivers> {
        if self.cells_of_bodies.is_empty() {
            let (starts, nodes) = (&self.group_node_start, &self.group_nodes);
            return vec![Slivers::new(grid, &self.active_cells, starts, nodes, &self.touches, others)];
        }
        let ends = self.group_node_start.iter().skip(1).copied().chain([self.group_nodes.len()]);
        let groups: Vec<_> =
            self.group_node_start.iter().copied().zip(ends).zip(&self.body_of_group).collect();
        let of_bodies = |(bodies, cells): (usize, &Vec<u32>)| {
            let (mut starts, mut nodes, mut touches) = (Vec::new(), Vec::new(), Vec::new());
            for ((start, end), body) in &groups {
                if self.copies.group(**body) as usize == bodies {
                    starts.push(nodes.len());
                    nodes.extend_from_slice(&self.group_nodes[*start..*end]);
                    touches.extend_from_slice(&self.touches[*start..*end]);
                }
            }
            Slivers::new(grid, cells, &starts, &nodes, &touches, others)
        };
        self.cells_of_bodies.iter().enumerate().map(of_bodies).collect()
    }

    /// Completes the links: lists the active cells, adds what ranks share, and gives the nodes their active numbers.
    fn numbered(mut self, grid: &dyn Grid<D>, ranks: &Ranks, sharing: &Sharing) -> Self {
        self.touches = Vec::new();
        self.group_node_start.push(self.group_nodes.len());
        self.list_active_cells(grid.n_cells());
        if !ranks.is_alone() {
            self.add_layer(grid, ranks, sharing);
            self.add_carriers(ranks, grid.n_nodes());
        }
        self.number_active_nodes(grid.n_nodes());
        self.reduction = Reduction::new(self.find_halo(ranks, grid.n_nodes()));
        self
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
        self.copies.clear();
        self.active_cells.clear();
        self.cells_of_bodies.clear();
        self.carriers.clear();
        self.layer_cells.clear();
        self.layer_nodes.clear();
    }

    fn append(&mut self, piece: Piece<D>) {
        self.append_cells(&piece);
        let (nodes, locals) = (self.group_nodes.len(), self.local.len());
        let (links, factors) = (self.value.len(), self.factor.len());
        self.group_node_start.extend(piece.group_node_start.iter().map(|s| s + nodes));
        self.group_nodes.extend(piece.group_nodes);
        self.touches.extend(piece.touches);
        self.whole.extend(piece.whole);
        // Offsets of the next data of each kind. The offset of the node indices stays at the start of the piece,
        // because a point can share the indices of an earlier point of its group.
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
            // Offsets within a block fit: each point stores far fewer than 2²⁰ numbers.
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
    }

    /// Adds the cells of a piece to those of the groups of bodies to which its groups belong, if there are several.
    fn append_cells(&mut self, piece: &Piece<D>) {
        if self.copies.n_groups() == 1 {
            return;
        }
        self.cells_of_bodies.resize(self.copies.n_groups(), Vec::new());
        let ends = piece.cell_start.iter().skip(1).copied().chain([piece.cells.len()]);
        let first = self.group_node_start.len();
        for (k, (start, end)) in piece.cell_start.iter().copied().zip(ends).enumerate() {
            let bodies = self.copies.group(self.body_of_group[first + k]) as usize;
            self.cells_of_bodies[bodies].extend_from_slice(&piece.cells[start..end]);
        }
    }

    /// Numbers the touched nodes in grid order and converts the node lists of the groups to these numbers.
    fn number_active_nodes(&mut self, n_nodes: usize) {
        let Connectivity { copies, group_nodes, layer_nodes, body_of_group, group_node_start, .. } = self;
        let ranges = || group_node_start.windows(2).map(|ends| ends[0]..ends[1]).zip(&*body_of_group);
        let touched = ranges().flat_map(|(range, body)| group_nodes[range].iter().map(|node| (*node, *body)));
        copies.number(n_nodes, touched.chain(layer_nodes.iter().map(|node| (*node, ANY_BODY))));
        for (range, body) in ranges() {
            for node in &mut group_nodes[range] {
                *node = copies.seen_by(*body, *node as usize).map_or(u32::MAX, |number| number as u32);
            }
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
        for cells in &mut self.cells_of_bodies {
            cells.sort_unstable();
            cells.dedup();
        }
    }

    /// Number of groups of bodies that have unknowns of their own.
    pub fn n_body_groups(&self) -> usize {
        self.copies.n_groups()
    }

    /// The group of a body.
    #[inline]
    pub fn bodies_with(&self, body: u16) -> BodyGroup {
        self.copies.group(body)
    }

    /// The grid cells that points of a group of bodies touch, ascending.
    pub fn cells_of_bodies(&self, group: BodyGroup) -> &[u32] {
        self.cells_of_bodies.get(group as usize).unwrap_or(&self.active_cells)
    }

    /// The active node that a group of bodies sees at a grid node; `None` if there is none.
    #[inline]
    pub fn of_bodies(&self, group: BodyGroup, node: usize) -> Option<usize> {
        self.copies.of_group(group, node)
    }

    /// Number of groups.
    pub fn n_groups(&self) -> usize {
        self.group_points.len() - 1
    }

    /// Range of the points of a group.
    pub fn points_of(&self, group: usize) -> std::ops::Range<usize> {
        self.group_points[group]..self.group_points[group + 1]
    }

    /// The group of a point.
    pub fn group_of(&self, p: usize) -> usize {
        // The last group that begins at or before the point.
        self.group_points.partition_point(|first| *first <= p) - 1
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

    /// Links of a point; `buffer` receives the values and gradients if they are stored as factors.
    #[inline(always)]
    pub fn links<'a>(&'a self, point: usize, buffer: &'a mut LinkBuffer<'_, D>) -> Links<'a, D> {
        let local = self.local_nodes(point);
        if let Some((value, gradient)) = self.explicit(point, local.len()) {
            return Links { local, value, gradient };
        }
        let (value, gradient) = (&mut buffer.value[..local.len()], &mut buffer.gradient[..local.len()]);
        let (numbers, per_length) = self.factors(point);
        multiply(self.form[point], numbers, &per_length, value, gradient);
        Links { local, value, gradient }
    }

    /// Values and gradients of a point at its `n` nodes, if they are stored explicitly.
    #[inline(always)]
    fn explicit(&self, point: usize, n: usize) -> Option<(&[f64], &[[f64; D]])> {
        let is_explicit = D < 3 || self.form[point].is_explicit();
        is_explicit.then(|| {
            let first = self.blocks[point >> BLOCK].link + self.start[point] as usize;
            (&self.value[first..first + n], &self.gradient[first..first + n])
        })
    }

    /// The factors of a point, and 1/h along each axis.
    #[inline(always)]
    fn factors(&self, point: usize) -> (&[f64], [f64; D]) {
        let mut numbers = &self.factor[self.blocks[point >> BLOCK].factor + self.start[point] as usize..];
        let per_length = self.per_length.unwrap_or_else(|| {
            let (cell_numbers, rest) = numbers.split_at(D);
            numbers = rest;
            std::array::from_fn(|d| cell_numbers[d])
        });
        (numbers, per_length)
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
        let local = self.local_nodes(point);
        if let Some((values, gradients)) = self.explicit(point, local.len()) {
            for ((&local, value), gradient) in local.iter().zip(values).zip(gradients) {
                visit(local as usize, *value, gradient);
            }
            return;
        }
        let (numbers, per_length) = self.factors(point);
        for_each_product(self.form[point], numbers, &per_length, |k, value, gradient| {
            visit(local[k] as usize, value, &gradient);
        });
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
        self.copies.len()
    }

    /// Grid numbers of the active nodes, ascending.
    pub fn active_nodes(&self) -> &[u32] {
        self.copies.nodes()
    }

    /// The group of bodies that sees each active node; empty if all bodies are in one group.
    pub fn groups_of_active_nodes(&self) -> &[BodyGroup] {
        self.copies.groups()
    }

    /// A number that identifies an active node from step to step: that of its grid node, to which each further group of
    /// bodies adds the number of nodes of the grid.
    pub fn lasting_number(&self, active: usize) -> u32 {
        let group = self.copies.groups().get(active).copied().unwrap_or(0);
        self.copies.nodes()[active] + u32::from(group) * self.copies.n_nodes() as u32
    }

    /// The active node with this lasting number; `None` if no points touch it.
    pub fn with_lasting_number(&self, number: u32) -> Option<usize> {
        let n_nodes = self.copies.n_nodes().max(1) as u32;
        self.of_bodies((number / n_nodes) as BodyGroup, (number % n_nodes) as usize)
    }

    /// The active nodes that other ranks also have. If there are other ranks, this rank has the nodes that its points
    /// touch, the active nodes of one layer of adjacent cells, and those that [`Connectivity::with_nodes`] has added.
    pub fn halo(&self) -> &Halo {
        self.reduction.halo()
    }

    /// Sums, extremes and decisions over the points and active nodes of the whole run.
    pub fn reduction(&self) -> &Reduction {
        &self.reduction
    }

    /// Cells that points of other ranks touch, next to the active cells of this rank, ascending.
    pub fn layer_cells(&self) -> &[u32] {
        &self.layer_cells
    }

    /// Grid cells touched by points or their domains, ascending. A domain with corners touches the cells of the point
    /// and of its corners.
    pub fn active_cells(&self) -> &[u32] {
        &self.active_cells
    }

    /// The active node that a grid node mostly moves with, as a body sees it: the body's copy of the grid node if there
    /// is one, else its copy of the carrier with the largest weight; `None` if there is no carrier either.
    #[inline(always)]
    pub fn moves_with(&self, body: u16, node: usize) -> Option<usize> {
        match self.copies.seen_by(body, node) {
            None if self.carriers.iter().all(Carriers::is_empty) => None,
            None => self.main_carrier(body, node),
            number => number,
        }
    }

    #[cold]
    fn main_carrier(&self, body: u16, node: usize) -> Option<usize> {
        let carriers = self.carriers_of(body)?.get(&(node as u32))?;
        let (carrier, _) = carriers.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
        self.seen_by(body, *carrier as usize)
    }

    /// The active nodes with which a grid node moves, as a body sees them, with their weights: the node itself, or the
    /// carriers of a sliver node. `None` for other inactive nodes.
    pub fn carriers(&self, body: u16, node: usize) -> Option<Vec<(usize, f64)>> {
        if let Some(number) = self.seen_by(body, node) {
            return Some(vec![(number, 1.0)]);
        }
        let carriers = self.carriers_of(body)?.get(&(node as u32))?;
        carriers.iter().map(|(node, weight)| Some((self.seen_by(body, *node as usize)?, *weight))).collect()
    }

    /// The carriers of the sliver nodes of the group of a body.
    fn carriers_of(&self, body: u16) -> Option<&Carriers> {
        self.carriers.get(self.copies.group(body) as usize)
    }

    /// The active node that a body sees at a grid node; `None` if there is none. See [`NodeCopies::seen_by`].
    #[inline]
    pub fn seen_by(&self, body: u16, node: usize) -> Option<usize> {
        self.copies.seen_by(body, node)
    }

    /// All active nodes at a grid node, one for each group of bodies. See [`NodeCopies::at_node`].
    #[inline]
    pub fn copies(&self, node: usize) -> std::ops::Range<usize> {
        self.copies.at_node(node)
    }

    /// True if a grid node is active.
    #[inline]
    pub fn is_active(&self, node: usize) -> bool {
        !self.copies.at_node(node).is_empty()
    }
}

/// 1/h of an even grid along each axis, [1/length].
fn per_length_if_even<const D: usize>(grid: &dyn Grid<D>) -> Option<[f64; D]> {
    grid.lines().filter(|lines| lines.is_even()).map(|lines| lines.per_length([0; D]))
}

#[cfg(test)]
mod tests;
