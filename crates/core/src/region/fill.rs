//! Filling of regions: grid cells are divided into parts, and the parts with their centres in a region are collected.

use std::ops::Range;

use rayon::prelude::*;

use super::{Bounds, Region};
use crate::grid::{Grid, Lines};
use crate::ranks::Ranks;

/// Number of cells that are filled in parallel before their parts are collected.
const CELLS_AT_A_TIME: usize = 4096;

/// A part of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellPart<const D: usize> {
    /// Centre of the part, [length].
    pub position: [f64; D],
    /// Volume (area) of the part, [volume].
    pub volume: f64,
}

/// A cell with parts in a region.
#[derive(Debug, Clone, PartialEq)]
pub struct FilledCell {
    /// Index of the cell.
    pub cell: u32,
    /// Range of its parts in [`Filled::parts`].
    pub parts: Range<usize>,
    /// True if all parts of the cell are in the region.
    pub full: bool,
}

/// Parts and cells of a grid that lie in a region.
#[derive(Debug, Clone, PartialEq)]
pub struct Filled<P> {
    /// Parts that have their centres in the region, in the order of the cells.
    pub parts: Vec<P>,
    /// Cells with such parts, ascending.
    pub cells: Vec<FilledCell>,
}

/// Divides grid cells into parts and collects the parts that have their centres in a region.
///
/// - `divide` returns the parts of a cell; `centre` returns the centre of a part.
/// - `in_group(key, cell)` is true if a cell belongs to the group `key` of the region.
/// - Each of several ranks fills its share of the cells; the shares follow one another in the order of the cells.
///
/// Cells are processed in parallel; the result does not depend on the number of threads.
///
/// # Errors
/// The error of `divide` for the first cell that may overlap the region and cannot be divided.
pub fn fill<const D: usize, P: Send, I: IntoIterator<Item = P>, E: Send>(
    region: &Region<D>,
    grid: &dyn Grid<D>,
    in_group: impl Fn(usize, usize) -> bool + Sync,
    divide: impl Fn(usize) -> Result<I, E> + Sync,
    centre: impl Fn(&P) -> [f64; D] + Sync,
    ranks: &Ranks,
) -> Result<Filled<P>, E> {
    let one_cell = |cell: usize| -> Result<(Vec<P>, bool), E> {
        if !region.may_meet_cell(&bounds_of_cell(grid, cell), &|key| in_group(key, cell)) {
            return Ok((Vec::new(), false));
        }
        let holds = |x: &[f64; D]| contains_in_cell(region, grid, x, cell, &in_group);
        let (mut parts, mut full) = (Vec::new(), true);
        for part in divide(cell)? {
            if holds(&centre(&part)) {
                parts.push(part);
            } else {
                full = false;
            }
        }
        Ok((parts, full))
    };
    let candidates: Vec<usize> = grid.cells_near(&region.bounds()).collect();
    let mut filled = Filled { parts: Vec::new(), cells: Vec::new() };
    // Cells are filled in chunks, so that at most one chunk of parts is stored twice.
    let own = &candidates[ranks.share(candidates.len())];
    for chunk in own.chunks(CELLS_AT_A_TIME) {
        let by_cell: Vec<_> = chunk.par_iter().map(|&cell| one_cell(cell)).collect();
        for (&cell, parts) in chunk.iter().zip(by_cell) {
            let (parts, full) = parts?;
            let start = filled.parts.len();
            filled.parts.extend(parts);
            if filled.parts.len() > start {
                filled.cells.push(FilledCell { cell: cell as u32, parts: start..filled.parts.len(), full });
            }
        }
    }
    Ok(filled)
}

/// True if a position in a cell lies in a region; `in_group` as in [`fill`].
pub fn contains_in_cell<const D: usize>(
    region: &Region<D>,
    grid: &dyn Grid<D>,
    x: &[f64; D],
    cell: usize,
    in_group: impl Fn(usize, usize) -> bool,
) -> bool {
    region.contains_with(x, &|key, y| {
        // A position on a cell boundary belongs to the given cell; only a position in a moved group needs a search.
        if y == x {
            in_group(key, cell)
        } else {
            grid.locate(y, None).is_some_and(|c| in_group(key, c as usize))
        }
    })
}

/// Lowest and highest coordinates of a cell.
fn bounds_of_cell<const D: usize>(grid: &dyn Grid<D>, cell: usize) -> Bounds<D> {
    let corners = grid.corners(cell);
    let positions = corners.nodes().iter().map(|&node| grid.node_position(node as usize));
    positions.fold([[f64::INFINITY; D], [f64::NEG_INFINITY; D]], |[low, high], x| {
        [std::array::from_fn(|d| low[d].min(x[d])), std::array::from_fn(|d| high[d].max(x[d]))]
    })
}

/// Divides a cell between lines into `per_cell` equal parts along each axis; the first axis varies fastest.
pub fn brick_parts<const D: usize>(
    lines: &Lines<D>,
    per_cell: [usize; D],
    cell: usize,
) -> impl Iterator<Item = CellPart<D>> + use<'_, D> {
    let index = lines.cell_index(cell);
    let n: usize = per_cell.iter().product();
    let volume = lines.sides(index).iter().product::<f64>() / n as f64;
    (0..n).map(move |part| {
        let mut rest = part;
        let position = std::array::from_fn(|d| {
            let k = rest % per_cell[d];
            rest /= per_cell[d];
            lines.axes()[d].position(index[d] as f64 + (k as f64 + 0.5) / per_cell[d] as f64)
        });
        CellPart { position, volume }
    })
}
