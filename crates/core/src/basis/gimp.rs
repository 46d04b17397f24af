//! The generalised interpolation material point method (Bardenhagen and Kober, 2004) on a structured grid.

use super::factors::Factors;
use super::{Basis, PointGeometry, Support, SupportError};
use crate::grid::{Axis, Grid, Structured};

/// Points with a rectangular domain: S_vp is the mean of the linear basis over the domain.
#[derive(Debug, Clone, Copy)]
pub struct Gimp;

impl<const D: usize> Basis<D> for Gimp {
    fn support(
        &self,
        grid: &dyn Grid<D>,
        point: &PointGeometry<D>,
        out: &mut Support<D>,
    ) -> Result<(), SupportError> {
        let grid = grid.structured().ok_or(SupportError::Unstructured)?;
        let mut axes: [(usize, AxisSupport); D] = std::array::from_fn(|_| (0, AxisSupport::default()));
        for d in 0..D {
            axes[d] = mean_hats(&grid.axes()[d], point.position[d], point.half_lengths[d], hats);
        }
        let axes = std::array::from_fn(|d| (axes[d].0, axes[d].1.entries()));
        tensor_product(grid, &axes, out);
        if D > 2 {
            out.factors = Factors::new(&axes);
        }
        Ok(())
    }

    fn at_centres(&self, grid: &dyn Grid<D>, point: &PointGeometry<D>, revolved: bool, out: &mut Support<D>) {
        out.clear();
        let Some(grid) = grid.structured() else { return };
        let (x, l) = (point.position, point.half_lengths);
        let axes: [(usize, AxisSupport); D] =
            std::array::from_fn(|d| mean_hats(&grid.axes()[d], x[d], l[d], |_, _| [0.5; 2]));
        tensor_product(grid, &std::array::from_fn(|d| (axes[d].0, axes[d].1.entries())), out);
        if !revolved {
            return;
        }
        let axis = &grid.axes()[0];
        let per_radius = |cell: i64| {
            let cell = cell.clamp(0, axis.n_cells() as i64 - 1) as usize;
            1.0 / (axis.line(cell) + 0.5 * axis.size(cell))
        };
        let (_, hoop) = mean_hats(axis, x[0], l[0], |cell, _| [0.5 * per_radius(cell); 2]);
        let hoop = hoop.entries();
        for (k, value) in out.value.iter_mut().enumerate() {
            let transverse: f64 = (1..D).map(|d| axes[d].1.entries()[k / hoop.len()].0).product();
            *value = hoop[k % hoop.len()].0 * transverse;
        }
    }
}

/// The values of the two hat functions of a cell at a local coordinate, 0 to 1.
#[inline(always)]
fn hats(_cell: i64, xi: f64) -> [f64; 2] {
    [1.0 - xi, xi]
}

/// Tensor product of one-dimensional supports, each given as `(first node, [(S, dS/dx)])`.
fn tensor_product<const D: usize>(
    grid: &Structured<D>,
    axes: &[(usize, &[(f64, f64)]); D],
    out: &mut Support<D>,
) {
    out.clear();
    for_each_offset(axes.map(|(_, line)| line.len()), |offset| {
        let mut value = 1.0;
        let mut gradient = [1.0; D];
        for d in 0..D {
            let (s, ds) = axes[d].1[offset[d]];
            value *= s;
            for (e, g) in gradient.iter_mut().enumerate() {
                *g *= if e == d { ds } else { s };
            }
        }
        let node = grid.node(std::array::from_fn(|d| axes[d].0 + offset[d]));
        out.nodes.push(node as u32);
        out.value.push(value);
        out.gradient.push(gradient);
    });
    // The domain touches the cells between the first and the last node of each axis.
    for_each_offset(axes.map(|(_, line)| (line.len() - 1).max(1)), |offset| {
        let cell = std::array::from_fn(|d| (axes[d].0 + offset[d]).min(grid.cells()[d] - 1));
        out.cells.push(grid.cell(cell) as u32);
    });
}

/// Visits all multi-indices below `counts`, none of which is zero; the first axis varies fastest.
#[inline(always)]
fn for_each_offset<const D: usize>(counts: [usize; D], mut visit: impl FnMut([usize; D])) {
    let mut offset = [0; D];
    loop {
        visit(offset);
        let mut axis = 0;
        while axis < D {
            offset[axis] += 1;
            if offset[axis] < counts[axis] {
                break;
            }
            offset[axis] = 0;
            axis += 1;
        }
        if axis == D {
            return;
        }
    }
}

/// Values and slopes of consecutive nodes along one axis. Domains up to 6 cells long need no heap memory.
#[derive(Debug, Default)]
struct AxisSupport {
    few: [(f64, f64); 8],
    many: Vec<(f64, f64)>,
    n: usize,
}

impl AxisSupport {
    fn with_len(n: usize) -> AxisSupport {
        let many = if n > 8 { vec![(0.0, 0.0); n] } else { Vec::new() };
        AxisSupport { few: [(0.0, 0.0); 8], many, n }
    }

    fn entries(&self) -> &[(f64, f64)] {
        if self.n > 8 { &self.many } else { &self.few[..self.n] }
    }

    fn entries_mut(&mut self) -> &mut [(f64, f64)] {
        if self.n > 8 { &mut self.many } else { &mut self.few[..self.n] }
    }
}

/// Mean over [x − l, x + l] of every hat function N_v that overlaps it, and the derivative of the mean with respect to
/// x. With the antiderivative I_v of N_v,
///
/// S_v = [I_v(x + l) − I_v(x − l)] / 2l and dS_v/dx = [N_v(x + l) − N_v(x − l)] / 2l,
///
/// whatever the sizes of the cells and of the domain. Both are summed cell by cell: hat functions are linear in a cell,
/// so their mean over the part of the domain in a cell is the value at the middle of that part, and there is no
/// cancellation for small domains. Outside the grid there are no nodes; a domain that reaches there loses the partition
/// of unity accordingly. `values` gives the two values in a cell at the middle of that part: [`hats`], or others for
/// another mean.
#[inline(always)]
fn mean_hats(
    axis: &Axis,
    x: f64,
    half_length: f64,
    values: impl Fn(i64, f64) -> [f64; 2],
) -> (usize, AxisSupport) {
    let n_cells = axis.n_cells() as i64;
    let n = n_cells as f64;
    let a = axis.coordinate(x - half_length);
    let b = axis.coordinate(x + half_length);
    // Cells −1 and n_cells each touch one node of the grid. Clamp before converting: a coordinate may be any number.
    let first = a.floor().clamp(-1.0, n) as i64;
    let last = ((b.ceil() - 1.0).clamp(-1.0, n) as i64).max(first);
    let (low, high) = (first.max(0), (last + 1).min(n_cells));
    let mut line = AxisSupport::with_len((high - low + 1) as usize);
    let entries = line.entries_mut();
    let length = axis.distance(a, b);
    for cell in first..=last {
        let (start, end) = (a.max(cell as f64), b.min(cell as f64 + 1.0));
        let share = if length > 0.0 { (end - start) * axis.relative_size(cell) / length } else { 1.0 };
        let [left, right] = values(cell, 0.5 * (start + end) - cell as f64);
        let h = axis.size(cell.clamp(0, n_cells - 1) as usize);
        for (node, value, slope) in [(cell, left, -share / h), (cell + 1, right, share / h)] {
            if (0..=n_cells).contains(&node) {
                let entry = &mut entries[(node - low) as usize];
                entry.0 += value * share;
                entry.1 += slope;
            }
        }
    }
    (low as usize, line)
}
