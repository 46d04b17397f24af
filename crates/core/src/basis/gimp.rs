//! The generalised interpolation material point method (Bardenhagen and Kober, 2004) on a grid with lines along the axes.

use super::factors::Factors;
use super::{Basis, PointGeometry, Support, SupportError};
use crate::grid::{Axis, Grid, Lines};

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
        let lines = grid.lines().ok_or(SupportError::Unstructured)?;
        let mut axes: [AxisSupport; D] = std::array::from_fn(|_| AxisSupport::default());
        for d in 0..D {
            mean_hats(&lines.axes()[d], point.position[d], point.half_lengths[d], &mut axes[d]);
        }
        tensor_product(lines, &axes, out);
        if D > 2 {
            out.factors = Factors::new(axes.each_ref().map(AxisSupport::entries));
        }
        Ok(())
    }

    fn shares(&self, grid: &dyn Grid<D>, point: &PointGeometry<D>) -> Vec<(u32, f64)> {
        let Some(lines) = grid.lines() else { return Vec::new() };
        let axes: [Vec<(usize, f64)>; D] = std::array::from_fn(|d| {
            parts_in_cells(&lines.axes()[d], point.position[d], point.half_lengths[d])
        });
        let mut shares = Vec::new();
        for_each_offset(axes.each_ref().map(Vec::len), |offset| {
            let cell = lines.cell(std::array::from_fn(|d| axes[d][offset[d]].0));
            shares.push((cell as u32, (0..D).map(|d| axes[d][offset[d]].1).product()));
        });
        let inside: f64 = shares.iter().map(|(_, share)| share).sum();
        shares.iter_mut().for_each(|(_, share)| *share /= inside);
        shares
    }
}

/// The grid cells (at least one) that [x − l, x + l] overlaps, each with a weight proportional to the overlap.
fn parts_in_cells(axis: &Axis, x: f64, half_length: f64) -> Vec<(usize, f64)> {
    let n = axis.n_cells();
    let (a, b) = (axis.coordinate(x - half_length), axis.coordinate(x + half_length));
    let cell_of = |coordinate: f64| coordinate.clamp(0.0, n as f64 - 1.0) as usize;
    let (first, last) = (cell_of(a.floor()), cell_of(b.ceil() - 1.0));
    let part = |cell: usize| (b.min(cell as f64 + 1.0) - a.max(cell as f64)) * axis.size(cell);
    let parts: Vec<_> = (first..=last).map(|cell| (cell, part(cell))).filter(|part| part.1 > 0.0).collect();
    if parts.is_empty() { vec![(cell_of(axis.coordinate(x)), 1.0)] } else { parts }
}

/// Tensor product of the supports along all axes.
fn tensor_product<const D: usize>(lines: &Lines<D>, axes: &[AxisSupport; D], out: &mut Support<D>) {
    out.clear();
    let along = axes.each_ref().map(AxisSupport::entries);
    for_each_offset(along.map(<[_]>::len), |offset| {
        let mut value = 1.0;
        let mut gradient = [1.0; D];
        for d in 0..D {
            let (s, ds) = along[d][offset[d]];
            value *= s;
            for (e, g) in gradient.iter_mut().enumerate() {
                *g *= if e == d { ds } else { s };
            }
        }
        let node = lines.node(std::array::from_fn(|d| axes[d].first + offset[d]));
        out.nodes.push(node as u32);
        out.value.push(value);
        out.gradient.push(gradient);
    });
    // The domain touches the cells between the first and the last node of each axis.
    for_each_offset(along.map(|entries| (entries.len() - 1).max(1)), |offset| {
        let cell = std::array::from_fn(|d| (axes[d].first + offset[d]).min(lines.cells()[d] - 1));
        out.cells.push(lines.cell(cell) as u32);
    });
}

/// Visits all multi-indices below `counts`, whose entries are all positive; the first axis varies fastest.
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

/// Largest number of nodes along an axis whose basis functions need no heap memory: enough for domains 6 cells long.
const FEW: usize = 8;

/// Basis functions, with slopes, at consecutive nodes along one axis.
#[derive(Debug, Default)]
struct AxisSupport {
    /// Index of the first node.
    first: usize,
    few: [(f64, f64); FEW],
    many: Vec<(f64, f64)>,
    n: usize,
}

impl AxisSupport {
    /// Value and slope of each function.
    fn entries(&self) -> &[(f64, f64)] {
        if self.n > FEW { &self.many } else { &self.few[..self.n] }
    }

    fn entries_mut(&mut self) -> &mut [(f64, f64)] {
        if self.n > FEW { &mut self.many } else { &mut self.few[..self.n] }
    }
}

/// Mean over [x − l, x + l] of every hat function N_v that overlaps it, and the derivative of the mean with respect to
/// x. With the antiderivative I_v of N_v,
///
/// S_v = [I_v(x + l) − I_v(x − l)] / 2l and dS_v/dx = [N_v(x + l) − N_v(x − l)] / 2l,
///
/// whatever the sizes of the cells and of the domain. Both are summed cell by cell: hat functions are linear in a cell,
/// so their mean over the part of the domain in a cell is the value at the middle of that part, and there is no
/// cancellation for small domains. Outside the grid there are no nodes, so the values at the nodes of a domain that
/// extends beyond the grid sum to less than one.
///
/// `out` must be empty: the values are added to its entries.
fn mean_hats(axis: &Axis, x: f64, half_length: f64, out: &mut AxisSupport) {
    let n_cells = axis.n_cells() as i64;
    let n = n_cells as f64;
    let a = axis.coordinate(x - half_length);
    let b = axis.coordinate(x + half_length);
    // Cells −1 and n_cells each touch one node of the grid. Clamp before converting, because a coordinate can be any
    // number.
    let first = a.floor().clamp(-1.0, n) as i64;
    let last = ((b.ceil() - 1.0).clamp(-1.0, n) as i64).max(first);
    let (low, high) = (first.max(0), (last + 1).min(n_cells));
    (out.first, out.n) = (low as usize, (high - low + 1) as usize);
    if out.n > FEW {
        out.many.resize(out.n, (0.0, 0.0));
    }
    let entries = out.entries_mut();
    let length = axis.distance(a, b);
    for cell in first..=last {
        let (start, end) = (a.max(cell as f64), b.min(cell as f64 + 1.0));
        let share = if length > 0.0 { (end - start) * axis.relative_size(cell) / length } else { 1.0 };
        let xi = 0.5 * (start + end) - cell as f64;
        let h = axis.size(cell.clamp(0, n_cells - 1) as usize);
        for (node, value, slope) in [(cell, 1.0 - xi, -share / h), (cell + 1, xi, share / h)] {
            if (0..=n_cells).contains(&node) {
                let entry = &mut entries[(node - low) as usize];
                entry.0 += value * share;
                entry.1 += slope;
            }
        }
    }
}
