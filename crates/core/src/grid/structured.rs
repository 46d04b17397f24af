//! A grid of rectangles (bricks) aligned with the axes, with evenly spaced or graded lines along each axis.

use super::{Axis, CellBasis, CellValues, Corners, Grid, Lines, MAX_CORNERS};

/// A grid of rectangles (bricks) in `D` dimensions, which is given by its lines.
#[derive(Debug, Clone, PartialEq)]
pub struct Structured<const D: usize> {
    lines: Lines<D>,
}

impl<const D: usize> Structured<D> {
    /// A grid with its lowest corner at `origin`, [length], and `cells` cells of side `spacing`, [length], along each
    /// axis.
    pub fn new(origin: [f64; D], spacing: [f64; D], cells: [usize; D]) -> Self {
        Structured::with_axes(std::array::from_fn(|d| Axis::even(origin[d], spacing[d], cells[d])))
    }

    /// A grid with these lines along each axis.
    pub fn with_axes(axes: [Axis; D]) -> Self {
        Structured { lines: Lines::new(axes) }
    }
}

impl<const D: usize> std::ops::Deref for Structured<D> {
    type Target = Lines<D>;

    #[inline(always)]
    fn deref(&self) -> &Lines<D> {
        &self.lines
    }
}

impl<const D: usize> Grid<D> for Structured<D> {
    fn n_nodes(&self) -> usize {
        self.cells().iter().map(|n| n + 1).product()
    }

    fn n_cells(&self) -> usize {
        self.cells().iter().product()
    }

    fn node_position(&self, node: usize) -> [f64; D] {
        let index = self.node_index(node);
        std::array::from_fn(|d| self.axes()[d].line(index[d]))
    }

    fn bounds(&self) -> [[f64; D]; 2] {
        [self.origin(), self.upper()]
    }

    fn lattice(&self, node: usize) -> [u32; D] {
        self.node_index(node).map(|i| i as u32)
    }

    fn coarsens(&self) -> bool {
        true
    }

    fn lines(&self) -> Option<&Lines<D>> {
        Some(&self.lines)
    }

    /// In cells or, if there are very many, in groups of cells.
    fn cell_lattice(&self, cell: usize, bits: u32) -> [u32; D] {
        let most = self.cells().into_iter().max().unwrap_or(0);
        let shift = (usize::BITS - most.leading_zeros()).saturating_sub(bits);
        self.cell_index(cell).map(|k| (k >> shift) as u32)
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
        least(self.spacing(cell))
    }

    fn smallest_size(&self) -> f64 {
        let [low, high] = self.bounds();
        least::<D>(std::array::from_fn(|d| self.axes()[d].smallest_within(low[d], high[d])))
    }

    fn spacing(&self, cell: usize) -> [f64; D] {
        self.sides(self.cell_index(cell))
    }

    fn diagonal(&self, cell: usize) -> f64 {
        self.spacing(cell).iter().fold(0.0, |length: f64, side| length.hypot(*side))
    }

    fn size_around(&self, node: usize) -> f64 {
        least(self.spacing_around(node))
    }

    fn spacing_around(&self, node: usize) -> [f64; D] {
        self.sides_around(self.node_index(node))
    }

    fn volume(&self, cell: usize) -> f64 {
        self.spacing(cell).iter().product()
    }

    fn total_volume(&self) -> f64 {
        if self.is_even() {
            return self.n_cells() as f64 * self.volume(0);
        }
        let [low, high] = self.bounds();
        (0..D).map(|d| high[d] - low[d]).product()
    }

    fn thickness(&self, cells: [usize; 2], area: f64) -> f64 {
        let [a, b] = cells.map(|cell| self.volume(cell));
        a.min(b) / area
    }

    fn is_at_edge(&self, nodes: &[u32]) -> bool {
        let indices = || nodes.iter().map(|n| self.node_index(*n as usize));
        (0..D).any(|d| {
            let last = self.cells()[d];
            indices().all(|index| index[d] == 0) || indices().all(|index| index[d] == last)
        })
    }

    fn has_simplices(&self) -> bool {
        false
    }

    fn nodes_near(&self, bounds: &[[f64; D]; 2]) -> Box<dyn Iterator<Item = usize> + '_> {
        Box::new(self.lines.nodes_near(bounds))
    }

    fn cells_near(&self, bounds: &[[f64; D]; 2]) -> Box<dyn Iterator<Item = usize> + '_> {
        Box::new(self.lines.cells_near(bounds))
    }

    #[inline(always)]
    fn locate(&self, position: &[f64; D], _hint: Option<u32>) -> Option<u32> {
        self.locate_index(position).map(|index| self.cell(index) as u32)
    }

    fn nearest_cell(&self, position: &[f64; D]) -> u32 {
        self.cell(self.lines.nearest(position).0) as u32
    }

    #[inline]
    fn basis_at(&self, cell: u32, position: &[f64; D]) -> CellBasis<D> {
        let base = self.cell_index(cell as usize);
        self.basis_in(base, self.local(base, position), self.per_length(base))
    }

    #[inline(always)]
    fn basis_near(&self, position: &[f64; D], _hint: Option<u32>) -> (u32, CellBasis<D>) {
        let (base, local) = self.lines.nearest(position);
        (self.cell(base) as u32, self.basis_in(base, local, self.per_length(base)))
    }

    #[inline(always)]
    fn values_near(&self, position: &[f64; D], _hint: Option<u32>) -> (u32, CellValues) {
        let (base, local) = self.lines.nearest(position);
        (self.cell(base) as u32, self.values_in(base, local))
    }
}

fn least<const D: usize>(sides: [f64; D]) -> f64 {
    sides.into_iter().fold(f64::INFINITY, f64::min)
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

    #[test]
    fn a_structured_grid_answers_from_its_lines() {
        let x = Axis::graded(vec![0.0, 1.0, 3.0]).unwrap();
        let y = Axis::graded(vec![0.0, 0.5, 4.5]).unwrap();
        let grid: Box<dyn Grid<2>> = Structured::with_axes([x, y]).into();
        assert_eq!((grid.smallest_size(), grid.total_volume()), (0.5, 13.5));
        assert_eq!((grid.spacing(3), grid.spacing_around(4)), ([2.0, 4.0], [1.0, 0.5]));
        assert!((grid.diagonal(2) - 17.0_f64.sqrt()).abs() < 1e-15);
        // The smaller of two cells with a common side of length 0.5.
        assert_eq!(grid.thickness([0, 1], 0.5), 1.0);
        assert!(grid.is_at_edge(&[0, 1]) && grid.is_at_edge(&[2, 5]) && !grid.is_at_edge(&[1, 4]));
        assert!(grid.coarsens() && !grid.has_simplices() && grid.set_names().is_none());
        assert_eq!((grid.cell_lattice(3, 2), grid.cell_lattice(3, 1)), ([1, 1], [0, 0]));
        assert_eq!(grid.cells_near(&[[1.5, 1.0], [2.0, 2.0]]).last(), Some(3));
        for place in [[0.3, 0.2], [2.9, 4.4], [-0.1, 5.0]] {
            let ((cell, basis), (same, values)) =
                (grid.basis_near(&place, None), grid.values_near(&place, None));
            assert_eq!((cell, CellValues::from(basis)), (same, values));
        }
    }
}
