//! The generalised interpolation material point method (Bardenhagen and Kober, 2004) on a regular grid.

use super::{Basis, OffGrid, Support, tensor_product};
use crate::grid::Grid;

/// Points with a rectangular domain: S_vp is the mean of the linear basis over the domain.
#[derive(Debug, Clone, Copy)]
pub struct Gimp;

impl<const D: usize> Basis<D> for Gimp {
    fn support(
        &self,
        grid: &Grid<D>,
        position: &[f64; D],
        half_lengths: &[f64; D],
        out: &mut Support<D>,
    ) -> Result<(), OffGrid> {
        grid.locate(position).ok_or(OffGrid)?;
        let mut axes: [(usize, Line); D] = std::array::from_fn(|_| (0, Line::default()));
        for d in 0..D {
            axes[d] = mean_hats(grid, d, position[d], half_lengths[d]);
        }
        tensor_product(grid, &std::array::from_fn(|d| (axes[d].0, axes[d].1.entries())), out);
        Ok(())
    }
}

/// Values and slopes of consecutive nodes along one axis; domains up to 6 cells long stay off the heap.
#[derive(Debug, Default)]
struct Line {
    few: [(f64, f64); 8],
    many: Vec<(f64, f64)>,
    n: usize,
}

impl Line {
    fn with_len(n: usize) -> Line {
        let many = if n > 8 { vec![(0.0, 0.0); n] } else { Vec::new() };
        Line { few: [(0.0, 0.0); 8], many, n }
    }

    fn entries(&self) -> &[(f64, f64)] {
        if self.n > 8 { &self.many } else { &self.few[..self.n] }
    }

    fn entries_mut(&mut self) -> &mut [(f64, f64)] {
        if self.n > 8 { &mut self.many } else { &mut self.few[..self.n] }
    }
}

/// The mean over [x − l, x + l] of every hat function that meets it, and the derivative with respect to x.
///
/// Cell by cell the hats are linear, so the mean over the part of the domain inside a cell is the value at its
/// middle; there is no cancellation for small domains. Where the domain reaches outside the grid, nodes that do not
/// exist are left out and the partition of unity is lost by that much.
fn mean_hats<const D: usize>(grid: &Grid<D>, axis: usize, x: f64, half_length: f64) -> (usize, Line) {
    let h = grid.spacing()[axis];
    let n_cells = grid.cells()[axis] as i64;
    let a = grid.cell_coordinate(axis, x - half_length);
    let b = grid.cell_coordinate(axis, x + half_length);
    let first = (a.floor() as i64).max(-1);
    let last = (b.ceil() as i64 - 1).clamp(first, n_cells); // cells −1 and n_cells touch one node of the grid
    let (low, high) = (first.max(0), (last + 1).min(n_cells));
    let mut line = Line::with_len((high - low + 1) as usize);
    let entries = line.entries_mut();
    let length = b - a;
    for cell in first..=last {
        let (start, end) = (a.max(cell as f64), b.min(cell as f64 + 1.0));
        let share = if length > 0.0 { (end - start) / length } else { 1.0 };
        let xi = 0.5 * (start + end) - cell as f64;
        for (node, value, slope) in [(cell, 1.0 - xi, -share / h), (cell + 1, xi, share / h)] {
            if (0..=n_cells).contains(&node) {
                let entry = &mut entries[(node - low) as usize];
                entry.0 += value * share;
                entry.1 += slope;
            }
        }
    }
    (low as usize, line)
}
