//! Lines along the axes between which all cells of a grid lie, with the numbers of the nodes and cells among them.

use super::{Axis, CellBasis, CellValues};

/// Evenly spaced or graded lines along each axis. The nodes of the grid are the points where they cross; nodes and cells
/// are numbered with the first axis fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Lines<const D: usize> {
    axes: [Axis; D],
    cells: [usize; D],
}

impl<const D: usize> Lines<D> {
    /// These lines along each axis.
    pub fn new(axes: [Axis; D]) -> Self {
        let cells = std::array::from_fn(|d| axes[d].n_cells());
        Lines { axes, cells }
    }

    /// The lines along each axis.
    #[inline(always)]
    pub fn axes(&self) -> &[Axis; D] {
        &self.axes
    }

    /// True if all cells have the same sides by construction.
    pub fn is_even(&self) -> bool {
        self.axes.iter().all(Axis::is_even)
    }

    /// Lowest corner, [length].
    pub fn origin(&self) -> [f64; D] {
        std::array::from_fn(|d| self.axes[d].line(0))
    }

    /// Sides of the cell with these indices along the axes, [length].
    #[inline(always)]
    pub fn sides(&self, index: [usize; D]) -> [f64; D] {
        std::array::from_fn(|d| self.axes[d].size(index[d]))
    }

    /// Along each axis, the smallest side of the cells around the node with these indices along the axes, [length].
    pub fn sides_around(&self, index: [usize; D]) -> [f64; D] {
        std::array::from_fn(|d| self.axes[d].size_around(index[d]))
    }

    /// Number of cells along each axis.
    pub fn cells(&self) -> [usize; D] {
        self.cells
    }

    /// Highest corner, [length].
    pub fn upper(&self) -> [f64; D] {
        std::array::from_fn(|d| self.axes[d].line(self.cells[d]))
    }

    /// Node number for these indices along the axes.
    #[inline(always)]
    pub fn node(&self, index: [usize; D]) -> usize {
        (0..D).rev().fold(0, |number, d| number * (self.cells[d] + 1) + index[d])
    }

    /// Node number of a corner of the cell with these indices; bit d of the corner is the side along axis d.
    #[inline(always)]
    pub fn corner(&self, cell: [usize; D], corner: usize) -> usize {
        self.node(std::array::from_fn(|d| cell[d] + (corner >> d & 1)))
    }

    /// Indices of a node along the axes.
    #[inline(always)]
    pub fn node_index(&self, node: usize) -> [usize; D] {
        split(node, self.cells.map(|n| n + 1))
    }

    /// Cell number for these indices along the axes.
    #[inline(always)]
    pub fn cell(&self, index: [usize; D]) -> usize {
        (0..D).rev().fold(0, |number, d| number * self.cells[d] + index[d])
    }

    /// Indices of a cell along the axes.
    #[inline(always)]
    pub fn cell_index(&self, cell: usize) -> [usize; D] {
        split(cell, self.cells)
    }

    /// Indices of the cell that contains a position; `None` outside the grid. A position on a grid line belongs to the
    /// upper cell; on the upper boundary of the grid, to the last cell.
    #[inline(always)]
    pub fn locate_index(&self, position: &[f64; D]) -> Option<[usize; D]> {
        let mut index = [0; D];
        for d in 0..D {
            let xi = self.axes[d].coordinate(position[d]);
            let n = self.cells[d];
            if !(0.0..=n as f64).contains(&xi) {
                return None;
            }
            index[d] = (xi as usize).min(n - 1);
        }
        Some(index)
    }

    /// Local coordinates of a position relative to the cell with these indices: from 0 to 1 inside the cell, and beyond
    /// this range outside it.
    #[inline(always)]
    pub fn local(&self, index: [usize; D], position: &[f64; D]) -> [f64; D] {
        // A closure might not be inlined.
        let mut local = [0.0; D];
        for d in 0..D {
            local[d] = self.axes[d].local(index[d], position[d]);
        }
        local
    }

    /// Indices of the cell nearest to a position, and the local coordinates of the position, which are continued
    /// outside the cell.
    #[inline(always)]
    pub(super) fn nearest(&self, position: &[f64; D]) -> ([usize; D], [f64; D]) {
        let coordinates: [f64; D] = std::array::from_fn(|d| self.axes[d].coordinate(position[d]));
        let index: [usize; D] = std::array::from_fn(|d| self.axes[d].cell_of(coordinates[d]));
        (index, std::array::from_fn(|d| coordinates[d] - index[d] as f64))
    }

    /// 1/h of the cell with these indices along each axis, [1/length].
    #[inline(always)]
    pub fn per_length(&self, index: [usize; D]) -> [f64; D] {
        self.sides(index).map(|h| 1.0 / h)
    }

    /// Basis of the cell with these indices at these local coordinates; the functions are continued outside the cell.
    /// `per_length` is 1/h of the cell along each axis, [1/length].
    #[inline(always)]
    pub fn basis_in(&self, base: [usize; D], local: [f64; D], per_length: [f64; D]) -> CellBasis<D> {
        let mut basis = CellBasis::default();
        for_each_corner(local, &per_length, |corner, value, gradient| {
            basis.push(self.corner(base, corner) as u32, value, gradient);
        });
        basis
    }

    /// Values of the basis of the cell with these indices at these local coordinates; see [`Lines::basis_in`].
    #[inline(always)]
    pub fn values_in(&self, base: [usize; D], local: [f64; D]) -> CellValues {
        let mut values = CellValues::none();
        for_each_corner(local, &[1.0; D], |corner, value, _| {
            values.push(self.corner(base, corner) as u32, value);
        });
        values
    }

    /// All nodes within bounds, [length], and some just outside; ascending.
    pub fn nodes_near(&self, [low, high]: &[[f64; D]; 2]) -> impl Iterator<Item = usize> + use<'_, D> {
        let ranges = std::array::from_fn(|d| self.axes[d].lines_near(low[d], high[d]));
        indices(ranges).map(|index| self.node(index))
    }

    /// All cells that may overlap bounds, [length], and some next to them; ascending.
    pub fn cells_near(&self, [low, high]: &[[f64; D]; 2]) -> impl Iterator<Item = usize> + use<'_, D> {
        let ranges = std::array::from_fn(|d| {
            let lines = self.axes[d].lines_near(low[d], high[d]);
            lines.start..lines.end.min(self.cells[d])
        });
        indices(ranges).map(|index| self.cell(index))
    }
}

/// All multi-indices in these ranges; the first axis varies fastest.
fn indices<const D: usize>(ranges: [std::ops::Range<usize>; D]) -> impl Iterator<Item = [usize; D]> {
    let lengths = ranges.clone().map(|range| range.len());
    let first = ranges.map(|range| range.start);
    (0..lengths.iter().product()).map(move |number| {
        let index = split(number, lengths);
        std::array::from_fn(|d| first[d] + index[d])
    })
}

/// Calls `visit` with the index of each corner of a cell, and with the value, [-], and the gradient, [1/length], of its
/// basis function at local coordinates; `per_length` is 1/h along each axis. Bit d of the index is the side along axis
/// d.
#[inline(always)]
pub fn for_each_corner<const D: usize>(
    local: [f64; D],
    per_length: &[f64; D],
    mut visit: impl FnMut(usize, f64, [f64; D]),
) {
    let mut hats = [[0.0; 2]; D];
    for d in 0..D {
        hats[d] = [1.0 - local[d], local[d]];
    }
    for corner in 0..1 << D {
        let mut value = 1.0;
        let mut gradient = [1.0; D];
        for d in 0..D {
            let upper = corner >> d & 1;
            let (hat, slope) = (hats[d][upper], if upper == 1 { per_length[d] } else { -per_length[d] });
            value *= hat;
            for e in 0..D {
                gradient[e] *= if e == d { slope } else { hat };
            }
        }
        visit(corner, value, gradient);
    }
}

fn split<const D: usize>(mut number: usize, counts: [usize; D]) -> [usize; D] {
    counts.map(|n| {
        let index = number % n;
        number /= n;
        index
    })
}
