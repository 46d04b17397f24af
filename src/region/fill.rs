//! Parts of grid cells whose centres lie in a region.

use rayon::prelude::*;

use super::{Accuracy, Bounds, Region, Volume};
use crate::grid::{Grid, Structured};

/// A part of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part<const D: usize> {
    /// Its centre, [length].
    pub position: [f64; D],
    /// Its volume (area), [volume].
    pub volume: f64,
}

/// What of a grid lies in a region.
#[derive(Debug, Clone, PartialEq)]
pub struct Filled<P> {
    /// The parts whose centres are inside, in the order of the cells.
    pub parts: Vec<P>,
    /// The cell of each part.
    pub cells: Vec<u32>,
    /// For each cell of the grid, whether all of its parts are inside.
    pub full: Vec<bool>,
    /// Volume of the parts, [volume].
    pub volume: f64,
    /// Volume of the region, [volume]; `None` where it is not known.
    pub exact: Option<Volume>,
}

impl<P> Filled<P> {
    /// Volume that the parts have beyond that of the region, relative to it, [-]; negative where they have less.
    pub fn excess(&self) -> Option<f64> {
        self.exact.filter(|exact| exact.value > 0.0).map(|exact| self.volume / exact.value - 1.0)
    }
}

/// The parts of the cells of a grid whose centres lie in a region.
///
/// - `divide` gives the parts of a cell, `place` the centre and volume of a part.
/// - `groups[key][cell]` says whether a cell belongs to the group `key` of the region.
///
/// Parallel over cells; the result does not depend on the number of threads.
///
/// # Errors
/// Those of `divide`, of the first cell that has one and may meet the region.
pub fn fill<const D: usize, P: Send, E: Send>(
    region: &Region<D>,
    grid: &dyn Grid<D>,
    groups: &[Vec<bool>],
    divide: impl Fn(usize) -> Result<Vec<P>, E> + Sync,
    place: impl Fn(&P) -> ([f64; D], f64) + Sync,
) -> Result<Filled<P>, E> {
    let member =
        |key: usize, cell: usize| groups.get(key).is_some_and(|group| group.get(cell) == Some(&true));
    let one_cell = |cell: usize| -> Result<(Vec<P>, bool), E> {
        if !region.may_meet(&bounds_of_cell(grid, cell)) {
            return Ok((Vec::new(), false));
        }
        let mut parts = divide(cell)?;
        let all = parts.len();
        parts.retain(|part| {
            let (x, _) = place(part);
            region.contains_with(&x, &|key, y| {
                // A part belongs to its cell even where it lies on the border; only moved groups need a search.
                if *y == x {
                    member(key, cell)
                } else {
                    grid.locate(y, None).is_some_and(|c| member(key, c as usize))
                }
            })
        });
        let full = parts.len() == all;
        Ok((parts, full))
    };
    let by_cell: Vec<(Vec<P>, bool)> = (0..grid.n_cells())
        .into_par_iter()
        .map(one_cell)
        .collect::<Vec<_>>()
        .into_iter()
        .collect::<Result<_, E>>()?;
    let mut filled = Filled {
        parts: Vec::new(),
        cells: Vec::new(),
        full: Vec::with_capacity(by_cell.len()),
        volume: 0.0,
        exact: region.volume(Accuracy::default()),
    };
    for (cell, (parts, full)) in by_cell.into_iter().enumerate() {
        filled.volume += parts.iter().map(|part| place(part).1).sum::<f64>();
        filled.parts.extend(parts);
        filled.cells.resize(filled.parts.len(), cell as u32);
        filled.full.push(full);
    }
    Ok(filled)
}

/// Lowest and highest coordinates of a cell.
fn bounds_of_cell<const D: usize>(grid: &dyn Grid<D>, cell: usize) -> Bounds<D> {
    let corners = grid.corners(cell);
    let positions = corners.nodes().iter().map(|&node| grid.node_position(node as usize));
    positions.fold([[f64::INFINITY; D], [f64::NEG_INFINITY; D]], |[low, high], x| {
        [std::array::from_fn(|d| low[d].min(x[d])), std::array::from_fn(|d| high[d].max(x[d]))]
    })
}

/// The even division of a cell of a structured grid into `per_cell` parts along each axis, first axis fastest.
pub fn brick_parts<const D: usize>(
    grid: &Structured<D>,
    per_cell: [usize; D],
    cell: usize,
) -> impl Iterator<Item = Part<D>> + use<'_, D> {
    let index = grid.cell_index(cell);
    let (origin, spacing) = (grid.origin(), grid.spacing());
    let n: usize = per_cell.iter().product();
    let volume = spacing.iter().product::<f64>() / n as f64;
    (0..n).map(move |part| {
        let mut rest = part;
        let position = std::array::from_fn(|d| {
            let k = rest % per_cell[d];
            rest /= per_cell[d];
            origin[d] + spacing[d] * (index[d] as f64 + (k as f64 + 0.5) / per_cell[d] as f64)
        });
        Part { position, volume }
    })
}
