//! The background grid: a regular grid of rectangles (or bricks) aligned with the axes.
//!
//! Nodes and cells are numbered with the first axis fastest. Point location is arithmetic.

mod bins;
pub mod element;
pub mod gmsh;
pub mod mesh;
pub mod subdivide;

/// A position closer than this to a grid line, relative to the cell size, counts as lying on it.
///
/// Points that sit on a grid line in exact arithmetic must all be given to the same cell, whatever their round-off;
/// otherwise a uniform row of points loses its equilibrium (it happens at every fifth step of simple shear).
pub const ON_LINE: f64 = 1e-8;

/// A regular background grid in `D` dimensions.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid<const D: usize> {
    origin: [f64; D],
    spacing: [f64; D],
    cells: [usize; D],
}

impl<const D: usize> Grid<D> {
    /// A grid with its lowest corner at `origin`, cells of side `spacing` and `cells` of them along each axis.
    pub fn new(origin: [f64; D], spacing: [f64; D], cells: [usize; D]) -> Self {
        Grid { origin, spacing, cells }
    }

    /// Lowest corner, [length].
    pub fn origin(&self) -> [f64; D] {
        self.origin
    }

    /// Sides of a cell, [length].
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

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.cells.iter().map(|n| n + 1).product()
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.cells.iter().product()
    }

    /// Number of the node with these indices along the axes.
    pub fn node(&self, index: [usize; D]) -> usize {
        (0..D).rev().fold(0, |number, d| number * (self.cells[d] + 1) + index[d])
    }

    /// Indices of a node along the axes.
    pub fn node_index(&self, node: usize) -> [usize; D] {
        split(node, self.cells.map(|n| n + 1))
    }

    /// Position of a node, [length].
    pub fn node_position(&self, node: usize) -> [f64; D] {
        let index = self.node_index(node);
        std::array::from_fn(|d| self.origin[d] + self.spacing[d] * index[d] as f64)
    }

    /// Number of the cell with these indices along the axes.
    pub fn cell(&self, index: [usize; D]) -> usize {
        (0..D).rev().fold(0, |number, d| number * self.cells[d] + index[d])
    }

    /// Indices of a cell along the axes.
    pub fn cell_index(&self, cell: usize) -> [usize; D] {
        split(cell, self.cells)
    }

    /// Nodes of a cell in the order of its corners: bit d of the corner number is the offset along axis d.
    pub fn cell_nodes(&self, cell: usize) -> impl Iterator<Item = usize> + '_ {
        let base = self.cell_index(cell);
        (0..1usize << D).map(move |corner| self.node(std::array::from_fn(|d| base[d] + (corner >> d & 1))))
    }

    /// Position in units of cells from the lowest corner, along one axis; snapped to a grid line that it lies on.
    pub fn cell_coordinate(&self, axis: usize, x: f64) -> f64 {
        let xi = (x - self.origin[axis]) / self.spacing[axis];
        let line = xi.round();
        if (xi - line).abs() < ON_LINE { line } else { xi }
    }

    /// The cell that holds a position, or `None` outside the grid. A position on a grid line belongs to the upper
    /// cell, on the upper edge of the grid to the last one.
    pub fn locate(&self, position: &[f64; D]) -> Option<[usize; D]> {
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

    /// Displacement at a position from nodal displacements, by the linear basis of the nearest cell; outside the
    /// grid that cell's basis is continued, so that linear fields are exact everywhere.
    pub fn interpolate(&self, position: &[f64; D], nodal: impl Fn(usize) -> [f64; D]) -> [f64; D] {
        let mut cell = [0; D];
        let mut xi = [0.0; D];
        for d in 0..D {
            let x = self.cell_coordinate(d, position[d]);
            cell[d] = (x.max(0.0) as usize).min(self.cells[d] - 1);
            xi[d] = x - cell[d] as f64;
        }
        let mut value = [0.0; D];
        for corner in 0..1usize << D {
            let mut weight = 1.0;
            for (d, x) in xi.iter().enumerate() {
                weight *= if corner >> d & 1 == 1 { *x } else { 1.0 - x };
            }
            if weight != 0.0 {
                let u = nodal(self.node(std::array::from_fn(|d| cell[d] + (corner >> d & 1))));
                for d in 0..D {
                    value[d] += weight * u[d];
                }
            }
        }
        value
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
        let grid = Grid::<3>::new([0.0; 3], [1.0, 2.0, 3.0], [2, 3, 4]);
        for node in 0..grid.n_nodes() {
            assert_eq!(grid.node(grid.node_index(node)), node);
        }
        for cell in 0..grid.n_cells() {
            assert_eq!(grid.cell(grid.cell_index(cell)), cell);
        }
        assert_eq!(grid.cell_nodes(0).collect::<Vec<_>>(), [0, 1, 3, 4, 12, 13, 15, 16]);
    }

    #[test]
    fn a_point_on_a_grid_line_belongs_to_the_upper_cell_whatever_its_round_off() {
        let grid = Grid::<1>::new([0.0], [0.125], [8]);
        for noise in [-1e-15, 0.0, 1e-15] {
            assert_eq!(grid.locate(&[0.5 + noise]), Some([4]));
            assert_eq!(grid.locate(&[1.0 + noise]), Some([7]));
            assert_eq!(grid.locate(&[0.0 + noise]), Some([0]));
        }
        assert_eq!(grid.locate(&[-1e-6]), None);
        assert_eq!(grid.locate(&[1.0 + 1e-6]), None);
        assert_eq!(grid.locate(&[f64::NAN]), None);
    }

    #[test]
    fn interpolation_reproduces_linear_fields_inside_and_outside() {
        let grid = Grid::<2>::new([-1.0, 0.0], [0.5, 0.25], [4, 8]);
        let field = |p: [f64; 2]| [1.0 + 2.0 * p[0] - p[1], 3.0 * p[1]];
        for p in [[0.1, 0.3], [-1.2, 0.5], [1.3, 2.4], [-0.5, 1.0]] {
            let u = grid.interpolate(&p, |node| field(grid.node_position(node)));
            let exact = field(p);
            assert!((u[0] - exact[0]).abs() < 1e-14 && (u[1] - exact[1]).abs() < 1e-14);
        }
    }
}
