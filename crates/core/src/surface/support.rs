//! The grid cell that carries a position on a surface, and its basis there.

use std::collections::BTreeMap;

use crate::basis::Connectivity;
use crate::grid::{CellBasis, Grid};
use crate::region::vector::along;

/// Distance by which a position is moved into the body to find its cell, relative to the size of a cell, [-].
const NUDGE: f64 = 1e-7;
/// Largest value of the basis at a position at nodes that do not see it, [-].
const UNSEEN: f64 = 1e-12;
/// Number of equal intervals into which the search for an active cell divides the size of a cell along the inward
/// normal.
const DEPTHS: usize = 8;

/// Linear basis at a position on a surface, N_v and ∂N_v/∂x, in terms of active nodes: those of a cell and, for sliver
/// nodes, their carriers.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Support<const D: usize> {
    nodes: Vec<u32>,
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
}

impl<const D: usize> Support<D> {
    fn push(&mut self, node: u32, value: f64, gradient: [f64; D]) {
        self.nodes.push(node);
        self.value.push(value);
        self.gradient.push(gradient);
    }

    /// The active-node numbers.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// N_v of the nodes, [-].
    pub fn value(&self) -> &[f64] {
        &self.value
    }

    /// ∂N_v/∂x of the nodes, [1/length].
    pub fn gradient(&self) -> &[[f64; D]] {
        &self.gradient
    }
}

/// The basis, at a position x on a surface of a body with the unit normal n, of a cell that has only active nodes.
///
/// A position on the boundary between cells belongs to the cell along −n. If a node of that cell is inactive (because
/// the material points lie inside the surface), the nearest cell along −n that has only active nodes is taken, and its
/// basis is extrapolated to x: it still reproduces a linear displacement exactly, and forces at x keep their resultant
/// and their moment. Before that, the cell along −n suffices if its inactive nodes do not see x, which lies on the other
/// side of the cell: a domain with a corner there has this basis. `None` if there is no such cell within one cell size.
pub fn support<const D: usize>(
    grid: &dyn Grid<D>,
    links: &Connectivity<D>,
    body: u16,
    x: &[f64; D],
    n: &[f64; D],
) -> Option<Support<D>> {
    let (_, cell) = carrying_cell(grid, links, body, x, n)?;
    active(grid.basis_at(cell, x), links, body)
}

/// The cell of [`support`], preceded by the number of positions tried until it was found.
pub(super) fn carrying_cell<const D: usize>(
    grid: &dyn Grid<D>,
    links: &Connectivity<D>,
    body: u16,
    x: &[f64; D],
    n: &[f64; D],
) -> Option<(u32, u32)> {
    let is_active = |node: &u32| links.seen_by(body, *node as usize).is_some();
    let all_active = |cell: u32| grid.corners(cell as usize).nodes().iter().all(is_active);
    let sees_active = |cell: u32| active(grid.basis_at(cell, x), links, body).is_some();
    let size = grid.size(grid.nearest_cell(x) as usize);
    let mut tried = 0;
    let mut search = |depths: std::ops::RangeInclusive<usize>, is_wide: bool, suits: &dyn Fn(u32) -> bool| {
        depths.into_iter().find_map(|depth| {
            let inwards = size * (NUDGE + depth as f64 / DEPTHS as f64);
            let place: [f64; D] = std::array::from_fn(|d| x[d] - inwards * n[d]);
            let by = if is_wide { inwards } else { 2.0 * NUDGE * size };
            aside(place, by).find_map(|place| {
                tried += 1;
                let cell = grid.locate(&place, None).unwrap_or_else(|| grid.nearest_cell(&place));
                suits(cell).then_some((tried, cell))
            })
        })
    };
    // At the rim of a surface, the body has other sides, about which the normal of the surface says nothing. As a last
    // resort, the search also looks for cells along all diagonals.
    search(0..=0, false, &all_active)
        .or_else(|| search(0..=0, false, &sees_active))
        .or_else(|| search(1..=DEPTHS, false, &all_active))
        .or_else(|| search(0..=DEPTHS, true, &all_active))
}

/// A position, followed by the positions on all diagonals that differ from it by `by` along each axis, [length]:
/// corners of bodies lie on boundaries between cells.
fn aside<const D: usize>(place: [f64; D], by: f64) -> impl Iterator<Item = [f64; D]> {
    let diagonal =
        move |number: usize| std::array::from_fn(|d| place[d] + if number >> d & 1 == 1 { by } else { -by });
    std::iter::once(place).chain((0..1usize << D).map(diagonal))
}

/// The basis in terms of the active nodes that a body sees; sliver nodes move with their carriers. `None` if another node
/// with a value at the position is inactive.
pub fn active<const D: usize>(basis: CellBasis<D>, links: &Connectivity<D>, body: u16) -> Option<Support<D>> {
    let mut support = Support::default();
    let all = || basis.nodes().iter().zip(basis.value()).zip(basis.gradient());
    if basis.nodes().iter().all(|&node| links.seen_by(body, node as usize).is_some()) {
        for ((&node, &value), gradient) in all() {
            support.push(links.seen_by(body, node as usize)? as u32, value, *gradient);
        }
        return Some(support);
    }
    let mut sums: BTreeMap<usize, (f64, [f64; D])> = BTreeMap::new();
    for ((&node, &value), gradient) in all() {
        match links.carriers(body, node as usize) {
            Some(carriers) => {
                for (node, weight) in carriers {
                    let sum = sums.entry(node).or_insert((0.0, [0.0; D]));
                    *sum = (sum.0 + weight * value, along(&sum.1, weight, gradient));
                }
            }
            None if value.abs() <= UNSEEN => {}
            None => return None,
        }
    }
    sums.into_iter().for_each(|(node, (value, gradient))| support.push(node as u32, value, gradient));
    Some(support)
}
