//! A regular grid of rectangles (bricks) aligned with the axes. Cells are located by arithmetic.

use super::{CellBasis, Corners, Grid, MAX_CORNERS, ON_LINE};

/// A regular grid in `D` dimensions. Nodes and cells are numbered with the first axis fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Structured<const D: usize> {
    origin: [f64; D],
    spacing: [f64; D],
    cells: [usize; D],
}

impl<const D: usize> Structured<D> {
    /// A grid with its lowest corner at `origin`, [length], and `cells` cells of side `spacing`, [length], along each
    /// axis.
    pub fn new(origin: [f64; D], spacing: [f64; D], cells: [usize; D]) -> Self {
        Structured { origin, spacing, cells }
    }

    /// Lowest corner, [length].
    pub fn origin(&self) -> [f64; D] {
        self.origin
    }

    /// Sides of a cell, [length].
    #[inline(always)]
    pub fn spacing(&self) -> [f64; D] {
        self.spacing
    }

    /// Number of cells along each axis.
    pub fn cells(&self) -> [usize; D] {
        self.cells
    }

    /// Highest corner, [length].
    pub fn upper(&self) -> [f64; D] {
        std::array::from_fn(|d| self.origin[d] + self.spacing[d] * self.cells[d] as f64)
    }

    /// Number of the node with these indices along the axes.
    #[inline(always)]
    pub fn node(&self, index: [usize; D]) -> usize {
        (0..D).rev().fold(0, |number, d| number * (self.cells[d] + 1) + index[d])
    }

    /// Indices of a node along the axes.
    #[inline(always)]
    pub fn node_index(&self, node: usize) -> [usize; D] {
        split(node, self.cells.map(|n| n + 1))
    }

    /// Number of the cell with these indices along the axes.
    #[inline(always)]
    pub fn cell(&self, index: [usize; D]) -> usize {
        (0..D).rev().fold(0, |number, d| number * self.cells[d] + index[d])
    }

    /// Indices of a cell along the axes.
    #[inline(always)]
    pub fn cell_index(&self, cell: usize) -> [usize; D] {
        split(cell, self.cells)
    }

    /// Cell coordinate along one axis: distance from the lowest corner in units of cells, snapped to a grid line within
    /// [`ON_LINE`].
    #[inline(always)]
    pub fn cell_coordinate(&self, axis: usize, x: f64) -> f64 {
        let xi = (x - self.origin[axis]) / self.spacing[axis];
        let line = nearest_whole(xi);
        if (xi - line).abs() < ON_LINE { line } else { xi }
    }

    /// Indices of the cell that contains a position; `None` outside the grid. A position on a grid line belongs to the
    /// upper cell, on the upper border of the grid to the last cell.
    #[inline]
    pub fn locate_index(&self, position: &[f64; D]) -> Option<[usize; D]> {
        let mut index = [0; D];
        for d in 0..D {
            let xi = self.cell_coordinate(d, position[d]);
            let n = self.cells[d];
            if !(0.0..=n as f64).contains(&xi) {
                return None;
            }
            index[d] = (xi as usize).min(n - 1);
        }
        Some(index)
    }

    /// Indices of the cell nearest to a position given in cell coordinates.
    #[inline(always)]
    fn nearest_index(&self, coordinates: [f64; D]) -> [usize; D] {
        std::array::from_fn(|d| (coordinates[d].max(0.0) as usize).min(self.cells[d] - 1))
    }

    /// Basis of a cell at a position given in cell coordinates; continued outside the cell.
    #[inline(always)]
    pub fn basis_in(&self, base: [usize; D], coordinates: [f64; D]) -> CellBasis<D> {
        let mut basis = CellBasis::default();
        let hats: [[f64; 2]; D] = std::array::from_fn(|d| {
            let xi = coordinates[d] - base[d] as f64;
            [1.0 - xi, xi]
        });
        let slopes = self.spacing.map(|h| {
            let slope = 1.0 / h;
            [-slope, slope]
        });
        for corner in 0..1usize << D {
            let upper = |d: usize| corner >> d & 1;
            let (hat, slope) = (|d: usize| hats[d][upper(d)], |d: usize| slopes[d][upper(d)]);
            let node = self.node(std::array::from_fn(|d| base[d] + upper(d)));
            let value = (0..D).map(hat).product();
            let gradient =
                std::array::from_fn(|d| (0..D).map(|e| if e == d { slope(e) } else { hat(e) }).product());
            basis.push(node as u32, value, gradient);
        }
        basis
    }

    /// Range of the grid lines between two coordinates, enlarged by at least one line on both sides.
    fn lines_near(&self, axis: usize, low: f64, high: f64) -> std::ops::Range<usize> {
        let n = self.cells[axis];
        let line = |x: f64| ((x - self.origin[axis]) / self.spacing[axis]).clamp(-2.0, n as f64 + 2.0);
        let first = (line(low).floor() - 1.0).max(0.0) as usize;
        let last = (line(high).ceil() + 1.0).max(0.0) as usize;
        first.min(n + 1)..(last + 1).min(n + 1)
    }

    /// All nodes within bounds, [length], and some just outside; ascending.
    pub fn nodes_near(&self, [low, high]: &[[f64; D]; 2]) -> impl Iterator<Item = usize> + use<'_, D> {
        let ranges = std::array::from_fn(|d| self.lines_near(d, low[d], high[d]));
        indices(ranges).map(|index| self.node(index))
    }

    /// All cells that may overlap bounds, [length], and some beside them; ascending.
    pub fn cells_near(&self, [low, high]: &[[f64; D]; 2]) -> impl Iterator<Item = usize> + use<'_, D> {
        let ranges = std::array::from_fn(|d| {
            let lines = self.lines_near(d, low[d], high[d]);
            lines.start..lines.end.min(self.cells[d])
        });
        indices(ranges).map(|index| self.cell(index))
    }
}

/// Rounds a number below 2⁵¹ in magnitude to the nearest integer by adding and subtracting 1.5 × 2⁵², which needs no
/// function call on older instruction sets.
#[inline]
fn nearest_whole(x: f64) -> f64 {
    const SHIFT: f64 = 6_755_399_441_055_744.0; // 1.5 × 2⁵²
    (x + SHIFT) - SHIFT
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

impl<const D: usize> Grid<D> for Structured<D> {
    fn n_nodes(&self) -> usize {
        self.cells.iter().map(|n| n + 1).product()
    }

    fn n_cells(&self) -> usize {
        self.cells.iter().product()
    }

    fn node_position(&self, node: usize) -> [f64; D] {
        let index = self.node_index(node);
        std::array::from_fn(|d| self.origin[d] + self.spacing[d] * index[d] as f64)
    }

    fn bounds(&self) -> [[f64; D]; 2] {
        [self.origin, self.upper()]
    }

    fn lattice(&self, node: usize) -> [u32; D] {
        self.node_index(node).map(|i| i as u32)
    }

    fn corners(&self, cell: usize) -> Corners {
        let base = self.cell_index(cell);
        let mut nodes = [0; MAX_CORNERS];
        for (corner, node) in nodes.iter_mut().enumerate().take(1 << D) {
            let offset = vtk_corner(corner);
            *node = self.node(std::array::from_fn(|d| base[d] + (offset >> d & 1))) as u32;
        }
        Corners { nodes, n: 1 << D }
    }

    fn size(&self, _cell: usize) -> f64 {
        self.spacing.iter().copied().fold(f64::INFINITY, f64::min)
    }

    fn size_around(&self, _node: usize) -> f64 {
        self.size(0)
    }

    fn volume(&self, _cell: usize) -> f64 {
        self.spacing.iter().product()
    }

    #[inline]
    fn locate(&self, position: &[f64; D], _hint: Option<u32>) -> Option<u32> {
        self.locate_index(position).map(|index| self.cell(index) as u32)
    }

    fn nearest_cell(&self, position: &[f64; D]) -> u32 {
        let coordinates = std::array::from_fn(|d| self.cell_coordinate(d, position[d]));
        self.cell(self.nearest_index(coordinates)) as u32
    }

    #[inline]
    fn basis_at(&self, cell: u32, position: &[f64; D]) -> CellBasis<D> {
        let base = self.cell_index(cell as usize);
        self.basis_in(base, std::array::from_fn(|d| self.cell_coordinate(d, position[d])))
    }

    #[inline(always)]
    fn basis_near(&self, position: &[f64; D], _hint: Option<u32>) -> (u32, CellBasis<D>) {
        let coordinates: [f64; D] = std::array::from_fn(|d| self.cell_coordinate(d, position[d]));
        let base = self.nearest_index(coordinates);
        (self.cell(base) as u32, self.basis_in(base, coordinates))
    }

    fn structured(&self) -> Option<&Structured<D>> {
        Some(self)
    }
}

/// Maps between VTK order and bitwise order (bit d of the number is the side along axis d) of the corners of a
/// quadrilateral or hexahedron; its own inverse.
pub fn vtk_corner(corner: usize) -> usize {
    match corner % 4 {
        2 => corner + 1,
        3 => corner - 1,
        _ => corner,
    }
}

fn split<const D: usize>(mut number: usize, counts: [usize; D]) -> [usize; D] {
    counts.map(|n| {
        let index = number % n;
        number /= n;
        index
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbering_is_its_own_inverse() {
        let grid = Structured::<3>::new([0.0; 3], [1.0, 2.0, 3.0], [2, 3, 4]);
        for node in 0..grid.n_nodes() {
            assert_eq!(grid.node(grid.node_index(node)), node);
        }
        for cell in 0..grid.n_cells() {
            assert_eq!(grid.cell(grid.cell_index(cell)), cell);
        }
        assert_eq!(grid.corners(0).nodes(), [0, 1, 4, 3, 12, 13, 16, 15]);
    }

    #[test]
    fn a_point_on_a_grid_line_belongs_to_the_upper_cell_whatever_its_round_off() {
        let grid = Structured::<1>::new([0.0], [0.125], [8]);
        for noise in [-1e-15, 0.0, 1e-15] {
            assert_eq!(grid.locate(&[0.5 + noise], None), Some(4));
            assert_eq!(grid.locate(&[1.0 + noise], None), Some(7));
            assert_eq!(grid.locate(&[0.0 + noise], None), Some(0));
        }
        assert_eq!(grid.locate(&[-1e-6], None), None);
        assert_eq!(grid.locate(&[1.0 + 1e-6], None), None);
        assert_eq!(grid.locate(&[f64::NAN], None), None);
    }

    #[test]
    fn interpolation_reproduces_linear_fields_inside_and_outside() {
        let grid = Structured::<2>::new([-1.0, 0.0], [0.5, 0.25], [4, 8]);
        let field = |p: [f64; 2]| [1.0 + 2.0 * p[0] - p[1], 3.0 * p[1]];
        for p in [[0.1, 0.3], [-1.2, 0.5], [1.3, 2.4], [-0.5, 1.0]] {
            let u = super::super::interpolate(&grid, &p, &|node| field(grid.node_position(node)));
            let exact = field(p);
            assert!((u[0] - exact[0]).abs() < 1e-14 && (u[1] - exact[1]).abs() < 1e-14);
        }
    }
}
