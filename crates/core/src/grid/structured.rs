//! A grid of rectangles (bricks) aligned with the axes, with evenly spaced or graded lines along each axis.

use super::{Axis, CellBasis, Corners, Grid, MAX_CORNERS};

/// A grid of rectangles (bricks) in `D` dimensions. Nodes and cells are numbered with the first axis fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Structured<const D: usize> {
    axes: [Axis; D],
    cells: [usize; D],
}

impl<const D: usize> Structured<D> {
    /// A grid with its lowest corner at `origin`, [length], and `cells` cells of side `spacing`, [length], along each
    /// axis.
    pub fn new(origin: [f64; D], spacing: [f64; D], cells: [usize; D]) -> Self {
        Structured::with_axes(std::array::from_fn(|d| Axis::even(origin[d], spacing[d], cells[d])))
    }

    /// A grid with these lines along each axis.
    pub fn with_axes(axes: [Axis; D]) -> Self {
        let cells = std::array::from_fn(|d| axes[d].n_cells());
        Structured { axes, cells }
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
    fn nearest(&self, position: &[f64; D]) -> ([usize; D], [f64; D]) {
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

impl<const D: usize> Grid<D> for Structured<D> {
    fn n_nodes(&self) -> usize {
        self.cells.iter().map(|n| n + 1).product()
    }

    fn n_cells(&self) -> usize {
        self.cells.iter().product()
    }

    fn node_position(&self, node: usize) -> [f64; D] {
        let index = self.node_index(node);
        std::array::from_fn(|d| self.axes[d].line(index[d]))
    }

    fn bounds(&self) -> [[f64; D]; 2] {
        [self.origin(), self.upper()]
    }

    fn lattice(&self, node: usize) -> [u32; D] {
        self.node_index(node).map(|i| i as u32)
    }

    fn corners(&self, cell: usize) -> Corners {
        let base = self.cell_index(cell);
        let mut nodes = [0; MAX_CORNERS];
        for (corner, node) in nodes.iter_mut().enumerate().take(1 << D) {
            *node = self.corner(base, vtk_corner(corner)) as u32;
        }
        Corners { nodes, n: 1 << D }
    }

    fn size(&self, cell: usize) -> f64 {
        self.sides(self.cell_index(cell)).into_iter().fold(f64::INFINITY, f64::min)
    }

    fn size_around(&self, node: usize) -> f64 {
        self.sides_around(self.node_index(node)).into_iter().fold(f64::INFINITY, f64::min)
    }

    fn volume(&self, cell: usize) -> f64 {
        self.sides(self.cell_index(cell)).iter().product()
    }

    #[inline(always)]
    fn locate(&self, position: &[f64; D], _hint: Option<u32>) -> Option<u32> {
        self.locate_index(position).map(|index| self.cell(index) as u32)
    }

    fn nearest_cell(&self, position: &[f64; D]) -> u32 {
        self.cell(self.nearest(position).0) as u32
    }

    #[inline]
    fn basis_at(&self, cell: u32, position: &[f64; D]) -> CellBasis<D> {
        let base = self.cell_index(cell as usize);
        self.basis_in(base, self.local(base, position), self.per_length(base))
    }

    #[inline(always)]
    fn basis_near(&self, position: &[f64; D], _hint: Option<u32>) -> (u32, CellBasis<D>) {
        let (base, local) = self.nearest(position);
        (self.cell(base) as u32, self.basis_in(base, local, self.per_length(base)))
    }

    fn structured(&self) -> Option<&Structured<D>> {
        Some(self)
    }
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

/// Converts the corner index of a quadrilateral or hexahedron between VTK order and bitwise order (bit d of the index
/// is the side along axis d). The map is its own inverse.
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
#[allow(clippy::unwrap_used)]
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
        let even = Structured::<2>::new([-1.0, 0.0], [0.5, 0.25], [4, 8]);
        let x = Axis::graded(vec![-1.0, -0.75, 0.1, 0.3, 1.0]).unwrap();
        let y = Axis::graded(vec![0.0, 1.0, 1.125, 2.0]).unwrap();
        let graded = Structured::with_axes([x.clone(), y]);
        let mixed = Structured::with_axes([x, Axis::even(0.0, 0.25, 8)]);
        let field = |p: [f64; 2]| [1.0 + 2.0 * p[0] - p[1], 3.0 * p[1]];
        for grid in [even, graded, mixed] {
            for p in [[0.1, 0.3], [-1.2, 0.5], [1.3, 2.4], [-0.5, 1.0], [0.2, 1.1]] {
                let exact = field(p);
                let is_exact = |u: [f64; 2]| (0..2).all(|d| (u[d] - exact[d]).abs() < 1e-14);
                let nodal = |node| field(grid.node_position(node));
                assert!(is_exact(super::super::interpolate(&grid, &p, &nodal)), "{p:?}");
                // This also holds where the basis of a cell is continued beyond the cell.
                for cell in 0..grid.n_cells() as u32 {
                    let basis = grid.basis_at(cell, &p);
                    let mut u = [0.0; 2];
                    for (node, value) in basis.nodes().iter().zip(basis.value()) {
                        let at_node = nodal(*node as usize);
                        (0..2).for_each(|d| u[d] += value * at_node[d]);
                    }
                    let size = 1.0 / grid.size(cell as usize);
                    assert!((0..2).all(|d| (u[d] - exact[d]).abs() < 1e-13 * size), "{cell} {p:?}");
                }
            }
        }
    }

    #[test]
    fn sides_are_those_of_the_cell_at_hand() {
        let x = Axis::graded(vec![0.0, 1.0, 3.0]).unwrap();
        let y = Axis::graded(vec![0.0, 0.5, 4.5]).unwrap();
        let grid = Structured::with_axes([x, y]);
        assert_eq!((0..4).map(|cell| grid.size(cell)).collect::<Vec<_>>(), [0.5, 0.5, 1.0, 2.0]);
        assert_eq!((0..4).map(|cell| grid.volume(cell)).collect::<Vec<_>>(), [0.5, 1.0, 4.0, 8.0]);
        assert_eq!([0, 4, 8].map(|node| grid.size_around(node)), [0.5, 0.5, 2.0]);
        assert_eq!(grid.sides_around([2, 2]), [2.0, 4.0]);
    }
}
