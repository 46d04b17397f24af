//! The background grid on which equilibrium is solved.

mod axis;
mod bins;
mod carried;
pub mod element;
pub mod gmsh;
mod lines;
pub mod mesh;
mod patches;
pub mod sides;
mod structured;
pub mod subdivide;

pub use axis::{Axis, CoincidentLines, Interval};
pub use carried::{CarriedLines, CarryError, MIN_SIZE};
pub use lines::{Lines, for_each_corner};
pub use mesh::Mesh;
pub(crate) use mesh::distance_squared_of_triangle;
pub use patches::Patches;
pub use structured::{Structured, vtk_corner};

/// Boxes grids. The generic code of these grids is compiled here, with full optimisation, and not in the crates that
/// create them.
macro_rules! boxed {
    ($($Grid:ident<$D:literal>)*) => {$(
        impl From<$Grid<$D>> for Box<dyn Grid<$D>> {
            #[inline(never)]
            fn from(grid: $Grid<$D>) -> Self {
                Box::new(grid)
            }
        }
    )*};
}

boxed!(Structured<2> Structured<3> Mesh<2> Mesh<3>);

/// Relative distance, in units of the cell size, within which a position counts as lying on a grid line.
///
/// All points that lie on a grid line in exact arithmetic must belong to the same cell, whatever their round-off.
/// Otherwise a uniform row of points on a grid line would no longer be in equilibrium. In the simple shear of
/// decision 5, such rows occur in every fifth step.
pub const ON_LINE: f64 = 1e-8;

/// Largest number of corners of a cell.
pub const MAX_CORNERS: usize = 8;

/// Corner nodes of a cell, in VTK order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Corners {
    nodes: [u32; MAX_CORNERS],
    n: usize,
}

impl Corners {
    /// Corners from a list of nodes; at most [`MAX_CORNERS`] are used.
    pub fn new(list: &[u32]) -> Self {
        let mut nodes = [0; MAX_CORNERS];
        let n = list.len().min(MAX_CORNERS);
        nodes[..n].copy_from_slice(&list[..n]);
        Corners { nodes, n }
    }

    /// The nodes.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.n]
    }
}

/// Linear basis of a cell at a position: nodes, values and gradients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellBasis<const D: usize> {
    nodes: [u32; MAX_CORNERS],
    value: [f64; MAX_CORNERS],
    gradient: [[f64; D]; MAX_CORNERS],
    n: usize,
}

impl<const D: usize> Default for CellBasis<D> {
    fn default() -> Self {
        CellBasis { nodes: [0; 8], value: [0.0; 8], gradient: [[0.0; D]; 8], n: 0 }
    }
}

impl<const D: usize> CellBasis<D> {
    /// Adds a node with its value, [-], and gradient, [1/length]; ignored beyond [`MAX_CORNERS`] nodes.
    #[inline(always)]
    pub fn push(&mut self, node: u32, value: f64, gradient: [f64; D]) {
        if self.n < MAX_CORNERS {
            self.nodes[self.n] = node;
            self.value[self.n] = value;
            self.gradient[self.n] = gradient;
            self.n += 1;
        }
    }

    /// The nodes.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.n]
    }

    /// Value at each node, [-].
    pub fn value(&self) -> &[f64] {
        &self.value[..self.n]
    }

    /// Gradient at each node, [1/length].
    pub fn gradient(&self) -> &[[f64; D]] {
        &self.gradient[..self.n]
    }
}

/// Values of the linear basis of a cell at a position, with the nodes, but without gradients.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellValues {
    nodes: [u32; MAX_CORNERS],
    value: [f64; MAX_CORNERS],
    n: usize,
}

impl CellValues {
    /// Values of no node yet.
    pub fn none() -> Self {
        CellValues { nodes: [0; MAX_CORNERS], value: [0.0; MAX_CORNERS], n: 0 }
    }

    /// Adds a node with its value, [-]; ignored beyond [`MAX_CORNERS`] nodes.
    #[inline(always)]
    pub fn push(&mut self, node: u32, value: f64) {
        if self.n < MAX_CORNERS {
            self.nodes[self.n] = node;
            self.value[self.n] = value;
            self.n += 1;
        }
    }

    /// The nodes.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.n]
    }

    /// Value at each node, [-].
    pub fn value(&self) -> &[f64] {
        &self.value[..self.n]
    }
}

impl<const D: usize> From<CellBasis<D>> for CellValues {
    fn from(basis: CellBasis<D>) -> Self {
        CellValues { nodes: basis.nodes, value: basis.value, n: basis.n }
    }
}

/// A background grid in `D` dimensions: nodes, cells, and a linear basis in each cell.
///
/// Every grid answers all questions. A property that some grids lack is an `Option` or has a default; the methods of
/// this crate ask for the property, not for the kind of grid that has it.
pub trait Grid<const D: usize>: std::fmt::Debug + Send + Sync {
    /// Number of nodes.
    fn n_nodes(&self) -> usize;

    /// Number of cells.
    fn n_cells(&self) -> usize;

    /// Position of a node, [length].
    fn node_position(&self, node: usize) -> [f64; D];

    /// Lowest and highest coordinates, [length].
    fn bounds(&self) -> [[f64; D]; 2];

    /// Integer coordinates of a node on a lattice with about the spacing of the grid. Linear solvers use them to order
    /// the unknowns and to form coarser levels.
    fn lattice(&self, node: usize) -> [u32; D];

    /// True if the nodes fill a lattice with the coordinates of [`Grid::lattice`], so that every second line along each
    /// axis gives a coarser grid.
    fn coarsens(&self) -> bool {
        false
    }

    /// The lines along the axes between which all cells lie; `None` if the cells do not lie between such lines. GIMP
    /// integrates basis functions along them, and lines can follow boundary conditions.
    fn lines(&self) -> Option<&Lines<D>> {
        None
    }

    /// Integer coordinates of a cell below 2^`bits`, with the same scale along all axes. The grid is divided between
    /// ranks along them.
    fn cell_lattice(&self, cell: usize, bits: u32) -> [u32; D] {
        let ([low, high], centre) = (self.bounds(), self.centre(cell));
        let widest = (0..D).map(|d| high[d] - low[d]).fold(f64::MIN_POSITIVE, f64::max);
        let steps = f64::from(1u32 << bits) - 1.0;
        std::array::from_fn(|d| (steps * (centre[d] - low[d]) / widest) as u32)
    }

    /// Corner nodes of a cell.
    fn corners(&self, cell: usize) -> Corners;

    /// Mean position of the corners of a cell, [length].
    fn centre(&self, cell: usize) -> [f64; D] {
        let corners = self.corners(cell);
        let mut centre = [0.0; D];
        for &node in corners.nodes() {
            let position = self.node_position(node as usize);
            (0..D).for_each(|d| centre[d] += position[d] / corners.nodes().len() as f64);
        }
        centre
    }

    /// Size of a cell, [length].
    fn size(&self, cell: usize) -> f64;

    /// Size of the smallest cell, [length].
    fn smallest_size(&self) -> f64 {
        (0..self.n_cells()).map(|cell| self.size(cell)).fold(f64::INFINITY, f64::min)
    }

    /// Size of a cell along each axis, [length]: the sides of a brick, otherwise the size of the cell.
    fn spacing(&self, cell: usize) -> [f64; D] {
        [self.size(cell); D]
    }

    /// The diagonal of a brick, otherwise the size of the cell, [length].
    fn diagonal(&self, cell: usize) -> f64 {
        self.size(cell)
    }

    /// Size of the smallest cell around a node, [length].
    fn size_around(&self, node: usize) -> f64;

    /// Smallest size along each axis of the cells around a node, [length]; see [`Grid::spacing`].
    fn spacing_around(&self, node: usize) -> [f64; D] {
        [self.size_around(node); D]
    }

    /// Volume (area) of a cell, [volume].
    fn volume(&self, cell: usize) -> f64;

    /// Volume (area) of all cells, [volume].
    fn total_volume(&self) -> f64 {
        (0..self.n_cells()).map(|cell| self.volume(cell)).sum()
    }

    /// Thickness of two cells normal to the face that they share, [length], given the area (length) of the face: the
    /// mean or, if both are bricks, that of the smaller one.
    fn thickness(&self, cells: [usize; 2], area: f64) -> f64 {
        let [a, b] = cells.map(|cell| self.volume(cell));
        (a + b) / (2.0 * area)
    }

    /// True if nodes lie on one of the planes (lines) that bound the grid, where no cell is cut. Only grids with
    /// [`Grid::lines`] have such planes.
    fn is_at_edge(&self, _nodes: &[u32]) -> bool {
        false
    }

    /// True if some cells are triangles or tetrahedra.
    fn has_simplices(&self) -> bool {
        (0..self.n_cells()).any(|cell| self.corners(cell).nodes().len() == D + 1)
    }

    /// All nodes within bounds, [length], and some or all others; ascending.
    fn nodes_near(&self, _bounds: &[[f64; D]; 2]) -> Box<dyn Iterator<Item = usize> + '_> {
        Box::new(0..self.n_nodes())
    }

    /// All cells that may overlap bounds, [length], and some or all others; ascending.
    fn cells_near(&self, _bounds: &[[f64; D]; 2]) -> Box<dyn Iterator<Item = usize> + '_> {
        Box::new(0..self.n_cells())
    }

    /// The cell that contains a position; `None` outside the grid. The search starts at `hint`. A position on the
    /// boundary between cells always belongs to the same one of them, whatever its round-off.
    fn locate(&self, position: &[f64; D], hint: Option<u32>) -> Option<u32>;

    /// The cell nearest to a position inside or outside the grid.
    fn nearest_cell(&self, position: &[f64; D]) -> u32;

    /// The linear basis of a cell at a position; continued outside the cell.
    fn basis_at(&self, cell: u32, position: &[f64; D]) -> CellBasis<D>;

    /// The cell that contains a position or is nearest to it, and its basis there; the search starts at `hint`.
    fn basis_near(&self, position: &[f64; D], hint: Option<u32>) -> (u32, CellBasis<D>) {
        let cell = self.locate(position, hint).unwrap_or_else(|| self.nearest_cell(position));
        (cell, self.basis_at(cell, position))
    }

    /// The same as [`Grid::basis_near`], without gradients.
    fn values_near(&self, position: &[f64; D], hint: Option<u32>) -> (u32, CellValues) {
        let (cell, basis) = self.basis_near(position, hint);
        (cell, basis.into())
    }

    /// Nodes of a named set of an imported grid.
    fn node_set(&self, _name: &str) -> Option<&[u32]> {
        None
    }

    /// The nodes of the groups with this name, each with the dimension of its group: several dimensions may share a
    /// name.
    fn node_sets_named(&self, _name: &str) -> Vec<(u8, &[u32])> {
        Vec::new()
    }

    /// Cells of a named set of an imported grid.
    fn cell_set(&self, _name: &str) -> Option<&[u32]> {
        None
    }

    /// Names of all sets of an imported grid; `None` for other grids, which have no sets.
    fn set_names(&self) -> Option<Vec<&str>> {
        None
    }

    /// Groups of cells whose points are evaluated together; `None` if each cell is a group.
    fn patches(&self) -> Option<&Patches> {
        None
    }
}

/// Interpolates a nodal field at a position, using the basis of the cell that contains the position or is nearest to
/// it. Linear fields are reproduced everywhere.
pub fn interpolate<const D: usize>(
    grid: &dyn Grid<D>,
    position: &[f64; D],
    nodal: &impl Fn(usize) -> [f64; D],
) -> [f64; D] {
    let (_, basis) = grid.values_near(position, None);
    let mut sum = [0.0; D];
    for (&node, &value) in basis.nodes().iter().zip(basis.value()) {
        if value != 0.0 {
            let at_node = nodal(node as usize);
            for d in 0..D {
                sum[d] += value * at_node[d];
            }
        }
    }
    sum
}
