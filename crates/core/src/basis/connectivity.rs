//! Which nodes every point touches and how strongly, for all points of a load step (section 5.1).

use rayon::prelude::*;

use super::factors::{Form, multiply};
use super::slivers::{Slivers, is_sliver};
use super::{Basis, Method, PointGeometry, Support, SupportError};
use crate::grid::Grid;
use crate::points::Points;

/// Number of groups that are linked as one piece of work.
const PIECE: usize = 16;

/// Number of pieces that are linked before they are put together, while they are still in the cache.
const ROUND: usize = 32;

/// Number of points, as a power of two, whose starts are told from a common one.
const BLOCK: u32 = 12;

/// Where the numbers of the first point of a block start, whichever they are.
#[derive(Debug, Clone, Copy)]
struct Block {
    link: usize,
    factor: usize,
    local: usize,
}

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
    /// While they are linked: whether a point of the group touches the node by more than a sliver.
    holds: Vec<bool>,
    /// Whether all points of a group touch all its nodes.
    whole: Vec<bool>,
    /// Where the numbers of each point start: in `value` and `gradient`, or in `factor`.
    start: Vec<u32>,
    form: Vec<Form>,
    /// Where the places of the nodes of each point start in `local`; neighbours that touch the same nodes share them.
    local_start: Vec<u32>,
    /// What is to be added to these starts, for each block of points.
    blocks: Vec<Block>,
    local: Vec<u32>,
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
    /// In space, what the values and gradients of points on a regular grid are products of. In the plane the products are
    /// kept: they are hardly more than their factors.
    factor: Vec<f64>,
    /// 1/h of a regular grid along each axis, [1/length].
    per_length: Vec<f64>,
    n_links: usize,
    active_nodes: Vec<u32>,
    active_of: Vec<u32>,
    active_cells: Vec<u32>,
    /// Grid nodes that only slivers touch, ascending, each with the node that moves for it.
    carried: Vec<[u32; 2]>,
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

/// Where the values and gradients of one point are multiplied out: as many places as its group has nodes.
pub struct Room<'a, const D: usize> {
    /// For S_vp.
    pub value: &'a mut [f64],
    /// For ∂S_vp/∂X̃.
    pub gradient: &'a mut [[f64; D]],
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
        let group_points = points
            .group_by_cell(grid)
            .map_err(|point| SupportFailure { point, error: SupportError::OffGrid })?;
        self = self.link(grid, points, methods, &group_points, &Slivers::default())?;
        let slivers = Slivers::new(grid.n_nodes(), &self.group_nodes, &self.holds);
        if !slivers.is_empty() {
            self = self.link(grid, points, methods, &group_points, &slivers)?;
        }
        self.holds = Vec::new();
        self.carried.sort_unstable();
        self.carried.dedup_by_key(|pair| pair[0]);
        self.group_points = group_points;
        self.group_node_start.push(self.group_nodes.len());
        self.number_active_nodes(grid.n_nodes());
        self.list_active_cells(grid.n_cells());
        Ok(self)
    }

    /// Links the points, group by group, in grid node numbers.
    fn link(
        mut self,
        grid: &dyn Grid<D>,
        points: &Points<D>,
        methods: &[Method],
        group_points: &[usize],
        slivers: &Slivers,
    ) -> Result<Self, SupportFailure> {
        self.clear();
        if let Some(grid) = grid.structured() {
            self.per_length.extend(grid.spacing().map(|h| 1.0 / h));
        }
        let n_groups = group_points.len() - 1;
        let mut all = self;
        // In rounds, so that no more than a few pieces exist beside the whole.
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

    /// Forgets all links but keeps the memory.
    fn clear(&mut self) {
        self.group_node_start.clear();
        self.group_nodes.clear();
        self.holds.clear();
        self.whole.clear();
        self.start.clear();
        self.form.clear();
        self.local_start.clear();
        self.blocks.clear();
        self.local.clear();
        self.value.clear();
        self.gradient.clear();
        self.factor.clear();
        self.per_length.clear();
        self.n_links = 0;
        self.active_nodes.clear();
        self.active_of.clear();
        self.active_cells.clear();
        self.carried.clear();
    }

    fn append(&mut self, piece: Piece<D>) {
        let (nodes, places) = (self.group_nodes.len(), self.local.len());
        let (links, factors) = (self.value.len(), self.factor.len());
        self.group_node_start.extend(piece.group_node_start.iter().map(|s| s + nodes));
        self.group_nodes.extend(piece.group_nodes);
        self.holds.extend(piece.holds);
        self.whole.extend(piece.whole);
        // Where the numbers of each kind go on. Places are shared within a group, not only one after the other.
        let mut next = Block { link: links, factor: factors, local: places };
        for ((&start, form), &local) in piece.start.iter().zip(&piece.form).zip(&piece.local_start) {
            let kept_as_they_are = form.is_as_they_are();
            let begin = if kept_as_they_are { &mut next.link } else { &mut next.factor };
            *begin = start + if kept_as_they_are { links } else { factors };
            let begin = *begin;
            if self.start.len().is_multiple_of(1 << BLOCK) {
                self.blocks.push(next);
            }
            let block = self.blocks[self.start.len() >> BLOCK];
            let from = if kept_as_they_are { block.link } else { block.factor };
            // Within a block they are few: a point reaches some hundred nodes at most.
            self.start.push((begin - from) as u32);
            self.local_start.push((local + places - block.local) as u32);
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

    /// Turns the list of cells that were met into an ascending one in which each stands once.
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

    /// The points of a group.
    pub fn points_of(&self, group: usize) -> std::ops::Range<usize> {
        self.group_points[group]..self.group_points[group + 1]
    }

    /// The active nodes that a group touches, ascending.
    pub fn nodes_of(&self, group: usize) -> &[u32] {
        &self.group_nodes[self.group_node_start[group]..self.group_node_start[group + 1]]
    }

    /// Places of the nodes of a point in the node list of its group, ascending.
    #[inline(always)]
    pub fn places(&self, point: usize) -> &[u32] {
        let start = self.blocks[point >> BLOCK].local + self.local_start[point] as usize;
        &self.local[start..][..self.form[point].nodes::<D>()]
    }

    /// The links of a point.
    #[inline(always)]
    pub fn links<'a>(&'a self, point: usize, room: &'a mut Room<'_, D>) -> Links<'a, D> {
        let local = self.places(point);
        let (block, start) = (&self.blocks[point >> BLOCK], self.start[point] as usize);
        if D < 3 || self.form[point].is_as_they_are() {
            let range = block.link + start..block.link + start + local.len();
            return Links { local, value: &self.value[range.clone()], gradient: &self.gradient[range] };
        }
        let (value, gradient) = (&mut room.value[..local.len()], &mut room.gradient[..local.len()]);
        multiply(self.form[point], &self.factor[block.factor + start..], &self.per_length(), value, gradient);
        Links { local, value, gradient }
    }

    /// Calls `visit` with the place of each node of a point in the node list of its group, and S_vp.
    #[inline(always)]
    pub fn for_each_value(&self, point: usize, mut visit: impl FnMut(usize, f64)) {
        self.for_each_link(point, |local, value, _| visit(local, value));
    }

    /// Calls `visit` with the place of each node of a point in the node list of its group, S_vp, and ∂S_vp/∂X̃, [1/length].
    #[inline(always)]
    pub fn for_each_link(&self, point: usize, mut visit: impl FnMut(usize, f64, &[f64; D])) {
        const FEW: usize = 64;
        let n = self.places(point).len();
        let (mut value, mut gradient) = ([0.0; FEW], [[0.0; D]; FEW]);
        // Points with more nodes are kept as they are and need no room.
        let mut room = Room { value: &mut value[..n.min(FEW)], gradient: &mut gradient[..n.min(FEW)] };
        let links = self.links(point, &mut room);
        for ((&local, value), gradient) in links.local.iter().zip(links.value).zip(links.gradient) {
            visit(local as usize, *value, gradient);
        }
    }

    #[inline(always)]
    fn per_length(&self) -> [f64; D] {
        let mut per_length = [0.0; D];
        per_length.copy_from_slice(&self.per_length);
        per_length
    }

    /// Number of links of all points.
    pub fn n_links(&self) -> usize {
        self.n_links
    }

    /// Whether all points of a group touch all its nodes.
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

    /// The grid cells that points or their domains meet, ascending; of domains given by corners, the cells of the point
    /// and of the corners.
    pub fn active_cells(&self) -> &[u32] {
        &self.active_cells
    }

    /// Number of the active node that moves with a grid node: that node, or where only slivers of basis functions touch it
    /// the one that carries it; `None` where no point is near.
    #[inline(always)]
    pub fn moves_with(&self, node: usize) -> Option<usize> {
        match self.active_of[node] {
            INACTIVE if self.carried.is_empty() => None,
            INACTIVE => self.carrier(node),
            number => Some(number as usize),
        }
    }

    /// Number of the active node that carries a grid node which only slivers of basis functions touch.
    #[cold]
    fn carrier(&self, node: usize) -> Option<usize> {
        let place = self.carried.binary_search_by_key(&(node as u32), |pair| pair[0]).ok()?;
        self.active_number(self.carried[place][1] as usize)
    }

    /// Active number of a grid node, if any point touches it by more than a sliver of its basis function.
    #[inline]
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
    /// Whether a point of the group touches the node by more than a sliver.
    holds: Vec<bool>,
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
        let mut holds: Vec<bool> = Vec::new(); // of `touched`, whether it is by more than a sliver
        let mut support = Support::default();
        let mut touched: Vec<u32> = Vec::new(); // grid nodes of one group, point by point where they differ
        let mut nodes: Vec<u32> = Vec::new();
        for range in groups.windows(2).map(|w| w[0]..w[1]) {
            touched.clear();
            holds.clear();
            nodes.clear();
            let mut held_from = 0; // where in `touched` the nodes begin that are known to be touched by more
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
                        let per_length = grid.spacing().map(|h| 1.0 / h);
                        piece.form.push(factors.keep(&per_length, &mut piece.factor));
                    }
                    _ => {
                        piece.start.push(piece.value.len());
                        piece.form.push(Form::as_they_are(support.nodes.len()));
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
                    holds.resize(touched.len(), false);
                    held_from = touched.len();
                }
                let of_point = touched.len() - support.nodes.len();
                if of_point < held_from {
                    let mut all_hold = true;
                    for (k, holds) in holds[of_point..].iter_mut().enumerate() {
                        *holds = *holds || !is_sliver(support.value[k], &support.gradient[k], size);
                        all_hold &= *holds;
                    }
                    if all_hold {
                        held_from = of_point;
                    }
                }
                piece.local_start.push(piece.local.len() + of_point);
            }
            piece.group_node_start.push(piece.group_nodes.len());
            nodes.sort_unstable();
            piece.local.extend(touched.iter().map(|n| nodes.partition_point(|m| m < n) as u32));
            let first = piece.group_nodes.len();
            piece.group_nodes.extend_from_slice(&nodes);
            piece.holds.resize(piece.group_nodes.len(), false);
            let places = &piece.local[piece.local.len() - touched.len()..];
            for (&place, &holds) in places.iter().zip(&holds) {
                piece.holds[first + place as usize] |= holds;
            }
            piece.whole.push(n_links == range.len() * nodes.len());
        }
        Ok(piece)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Structured;
    use crate::points::Seed;

    /// Many points of two methods, some with domains that end at the sides of cells, so that their nodes are among those of
    /// their neighbours.
    fn check<const D: usize>(grid: &Structured<D>, n: usize) {
        let methods = [Method::Mpm, Method::Gimp];
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let seeds: Vec<Seed<D>> = (0..n)
            .map(|k| Seed {
                body: (k % 2) as u16,
                position: std::array::from_fn(|_| 0.5 + 2.0 * (8.0 * next()).floor() / 8.0 + 0.125),
                half_lengths: if k % 2 == 0 { [0.0; D] } else { [0.125; D] },
                corners: Vec::new(),
                volume: 1.0,
                mass: 1.0,
                outer_layer: false,
                history: Vec::new(),
            })
            .collect();
        let mut points = Points::new(&seeds);
        let links = Connectivity::new(grid, &mut points, &methods).unwrap();
        let mut support = Support::default();
        let mut total = 0;
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            let (mut value, mut gradient) = (vec![0.0; nodes.len()], vec![[0.0; D]; nodes.len()]);
            let mut room = Room { value: &mut value, gradient: &mut gradient };
            let mut whole = true;
            for p in links.points_of(group) {
                let point = PointGeometry {
                    cell: points.cell[p],
                    position: &points.converged.position[p],
                    half_lengths: &points.half_lengths(p),
                    corners: &[],
                };
                methods[points.body[p] as usize].basis().support(grid, &point, &mut support).unwrap();
                let found = links.links(p, &mut room);
                let touched: Vec<u32> =
                    found.local.iter().map(|l| links.active_nodes()[nodes[*l as usize] as usize]).collect();
                assert_eq!(touched, support.nodes, "point {p}");
                assert_eq!((found.value, found.gradient), (&support.value[..], &support.gradient[..]));
                whole &= touched.len() == nodes.len();
                total += touched.len();
            }
            assert_eq!(links.is_whole(group), whole);
        }
        assert_eq!(links.n_links(), total);
    }

    /// A domain in the middle of one cell, and one that reaches by a fraction of a cell into its neighbours.
    fn with_sliver(reach: f64) -> Connectivity<2> {
        let grid = Structured::<2>::new([0.0; 2], [1.0; 2], [4, 4]);
        let seed = Seed {
            body: 0,
            position: [1.5 + 0.5 * reach; 2],
            half_lengths: [0.5 + 0.5 * reach; 2],
            corners: Vec::new(),
            volume: 1.0,
            mass: 1.0,
            outer_layer: false,
            history: Vec::new(),
        };
        Connectivity::new(&grid, &mut Points::new(&[seed]), &[Method::Gimp]).unwrap()
    }

    #[test]
    fn nodes_that_only_slivers_touch_are_not_active() {
        // The row above is touched along a whole side; only the node at its corner is one of slivers.
        for (reach, active) in [(1e-9, 4), (1e-4, 8), (0.1, 9)] {
            let links = with_sliver(reach);
            assert_eq!(links.n_active(), active, "{reach}");
            let corner = 3 + 3 * 5;
            assert_eq!(links.active_number(corner).is_some(), reach > 0.01);
            assert_eq!(links.moves_with(corner).is_some(), reach > 1e-8);
            let (mut value, mut gradient) = ([0.0; 9], [[0.0; 2]; 9]);
            let mut room = Room { value: &mut value, gradient: &mut gradient };
            let found = links.links(0, &mut room);
            assert!((found.value.iter().sum::<f64>() - 1.0).abs() < 1e-15);
            assert!((0..2).all(|d| found.gradient.iter().map(|g| g[d]).sum::<f64>().abs() < 1e-15));
        }
    }

    #[test]
    fn links_are_those_of_the_basis() {
        check(&Structured::<2>::new([0.0; 2], [0.5; 2], [6, 6]), 20_000);
        check(&Structured::<3>::new([0.0; 3], [0.5; 3], [6, 6, 6]), 20_000);
    }
}
