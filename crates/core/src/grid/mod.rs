//! The background grid on which equilibrium is solved.

mod axis;
mod bins;
mod carried;
pub mod element;
pub mod gmsh;
pub mod mesh;
mod patches;
pub mod sides;
mod structured;
pub mod subdivide;

pub use axis::{Axis, CoincidentLines, Interval};
pub use carried::{CarriedLines, CarryError, MIN_SIZE};
pub use mesh::Mesh;
pub use patches::Patches;
pub use structured::{Structured, for_each_corner, vtk_corner};

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

/// A background grid in `D` dimensions: nodes, cells, and a linear basis in each cell.
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

    /// Size of the smallest cell around a node, [length].
    fn size_around(&self, node: usize) -> f64;

    /// Volume (area) of a cell, [volume].
    fn volume(&self, cell: usize) -> f64;

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

    /// Nodes of a named set of an imported grid.
    fn node_set(&self, _name: &str) -> Option<&[u32]> {
        None
    }

    /// Cells of a named set of an imported grid.
    fn cell_set(&self, _name: &str) -> Option<&[u32]> {
        None
    }

    /// Names of all sets of an imported grid.
    fn set_names(&self) -> Vec<&str> {
        Vec::new()
    }

    /// Groups of cells whose points are evaluated together; `None` if each cell is a group.
    fn patches(&self) -> Option<&Patches> {
        None
    }

    /// The grid as a structured grid, which GIMP requires; `None` for other grids.
    fn structured(&self) -> Option<&Structured<D>> {
        None
    }
}

/// Interpolates a nodal field at a position, using the basis of the cell that contains the position or is nearest to
/// it. Linear fields are reproduced everywhere.
pub fn interpolate<const D: usize, G: Grid<D> + ?Sized>(
    grid: &G,
    position: &[f64; D],
    nodal: &impl Fn(usize) -> [f64; D],
) -> [f64; D] {
    let (_, basis) = grid.basis_near(position, None);
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
