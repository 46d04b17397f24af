//! The mean of the basis of the grid over the side of a domain.

use std::collections::BTreeMap;

use super::{Support, unit};
use crate::grid::{CellBasis, Grid};
use crate::region::vector::{along, minus, norm};
use crate::region::{Bounds, area_vector, around, squared_distance};

/// Distance from a side, relative to its length, at which the cell that carries it is sought, [-].
const INSIDE: f64 = 1e-6;
/// Distance of a crossing from the end of a segment, relative to its length, up to which the segment ends there, [-].
const ROUND_OFF: f64 = 1e-9;

/// A piece of a side that lies in one cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct PieceOfSide {
    pub(super) cell: u32,
    /// Its ends along both edges of the side at the first corner, as fractions of the side.
    ends: [[f64; 2]; 2],
}

/// The position at these fractions of a side with these corners, as [`mean_over_side`] takes them, [length].
fn on_side<const D: usize>(corners: &[[f64; D]], [s, t]: [f64; 2]) -> [f64; D] {
    std::array::from_fn(|d| {
        let along = |from: usize, to: usize| corners[from][d] + s * (corners[to][d] - corners[from][d]);
        if D == 2 { along(0, 1) } else { (1.0 - t) * along(0, 1) + t * along(3, 2) }
    })
}

/// The pieces between the grid lines that a side crosses; the arguments are those of [`mean_over_side`]. `None` if a piece
/// lies in no cell.
pub(super) fn pieces_of_side<const D: usize>(
    grid: &dyn Grid<D>,
    corners: &[[f64; D]],
    cells: &[u32],
) -> Option<Vec<PieceOfSide>> {
    let bounds: Vec<_> = cells.iter().map(|&cell| bounds_of_cell(grid, cell)).collect();
    let outward = unit(&area_vector(&std::array::from_fn(|k| corners[k])));
    let inside = INSIDE * norm(&minus(&corners[1], &corners[0]));
    let across = if D == 2 { vec![0.0, 1.0] } else { crossings(grid, &corners[0], &corners[3]) };
    let mut pieces = Vec::new();
    for s in crossings(grid, &corners[0], &corners[1]).windows(2) {
        for t in across.windows(2) {
            let middle = on_side(corners, [0.5 * (s[0] + s[1]), 0.5 * (t[0] + t[1])]);
            let away = |k: usize| squared_distance(&bounds[k], &middle);
            let nearest = (0..cells.len()).min_by(|&a, &b| away(a).total_cmp(&away(b))).unwrap_or(0);
            let cell = if away(nearest) <= inside * inside {
                cells[nearest]
            } else {
                grid.locate(&along(&middle, -inside, &outward), Some(cells[nearest]))?
            };
            pieces.push(PieceOfSide { cell, ends: [[s[0], s[1]], [t[0], t[1]]] });
        }
    }
    Some(pieces)
}

/// The nodes of a side with the mean of N_v over it, by Simpson's rule between the grid lines that it crosses. The side
/// has these corners, [length], two in the plane and four in cyclic order in space, counterclockwise as seen from outside
/// the body, which these cells carry; other cells between them are sought just inside. `active` gives the basis of a cell
/// in terms of active nodes; `None` if it does.
pub fn mean_over_side<const D: usize>(
    grid: &dyn Grid<D>,
    corners: &[[f64; D]],
    cells: &[u32],
    active: impl Fn(CellBasis<D>) -> Option<Support<D>>,
) -> Option<Vec<(u32, f64)>> {
    let mut mean: BTreeMap<u32, f64> = BTreeMap::new();
    for PieceOfSide { cell, ends: [s, t] } in pieces_of_side(grid, corners, cells)? {
        for (s, weight_s) in simpson(&s) {
            for (t, weight_t) in simpson(&t) {
                let basis = active(grid.basis_at(cell, &on_side(corners, [s, t])))?;
                for (&node, value) in basis.nodes().iter().zip(basis.value()) {
                    *mean.entry(node).or_insert(0.0) += weight_s * weight_t * value;
                }
            }
        }
    }
    Some(mean.into_iter().filter(|(_, value)| *value != 0.0).collect())
}

/// True if a side with these corners, as [`mean_over_side`] takes them, crosses no line of the grid: the mean over it is
/// then that over its corners.
pub fn lies_in_one_cell<const D: usize>(grid: &dyn Grid<D>, corners: &[[f64; D]]) -> bool {
    let is_inside = |t: &&f64| (ROUND_OFF..1.0 - ROUND_OFF).contains(*t);
    corners[1..]
        .iter()
        .all(|corner| crossings(grid, &corners[0], corner).iter().filter(is_inside).count() == 0)
}

/// The ends of a segment and its crossings with grid lines, as fractions of its length, ascending.
pub(crate) fn crossings<const D: usize>(grid: &dyn Grid<D>, a: &[f64; D], b: &[f64; D]) -> Vec<f64> {
    let mut at = vec![0.0];
    for (d, axis) in grid.lines().into_iter().flat_map(|lines| lines.axes().iter().enumerate()) {
        let [from, to] = [axis.coordinate(a[d]), axis.coordinate(b[d])];
        let mut line = from.min(to).floor() + 1.0;
        while line < from.max(to) {
            at.push((axis.position(line) - a[d]) / (b[d] - a[d]));
            line += 1.0;
        }
    }
    at.retain(|t| (0.0..1.0).contains(t));
    at.push(1.0);
    at.sort_by(f64::total_cmp);
    at
}

/// The places and weights of Simpson's rule between two ends.
fn simpson(ends: &[f64]) -> [(f64, f64); 3] {
    let (from, to) = (ends[0], ends[1]);
    let sixth = (to - from) / 6.0;
    [(from, sixth), (0.5 * (from + to), 4.0 * sixth), (to, sixth)]
}

/// The box around a cell, [length].
fn bounds_of_cell<const D: usize>(grid: &dyn Grid<D>, cell: u32) -> Bounds<D> {
    let nodes = grid.corners(cell as usize);
    let place = |&node: &u32| grid.node_position(node as usize);
    around(&nodes.nodes().iter().map(place).collect::<Vec<_>>())
}
