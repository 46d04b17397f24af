//! The background grid on which equilibrium is solved.

mod bins;
pub mod element;
pub mod gmsh;
pub mod mesh;
mod structured;
pub mod subdivide;

pub use mesh::Mesh;
pub use structured::{Structured, vtk_corner};

/// A position closer than this to a grid line, relative to the cell size, counts as lying on it.
///
/// Points that sit on a grid line in exact arithmetic must all be given to the same cell, whatever their round-off;
/// otherwise a uniform row of points loses its equilibrium (it happens at every fifth step of simple shear).
pub const ON_LINE: f64 = 1e-8;

/// Most corners of a cell.
pub const MAX_CORNERS: usize = 8;

/// The corner nodes of a cell, in the order of the VTK cell of its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Corners {
    nodes: [u32; MAX_CORNERS],
    n: usize,
}

impl Corners {
    /// From a list of at most [`MAX_CORNERS`] nodes; more are left out.
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

/// The basis of one cell at a position: nodes, values and gradients.
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
    /// Adds a node with value, [-], and gradient, [1/length]; beyond [`MAX_CORNERS`] it is left out.
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

/// A background grid in `D` dimensions: nodes, cells between them, and the linear basis of each cell.
pub trait Grid<const D: usize>: std::fmt::Debug + Send + Sync {
    /// Number of nodes.
    fn n_nodes(&self) -> usize;

    /// Number of cells.
    fn n_cells(&self) -> usize;

    /// Position of a node, [length].
    fn node_position(&self, node: usize) -> [f64; D];

    /// Lowest and highest coordinates, [length].
    fn bounds(&self) -> [[f64; D]; 2];

    /// Place of a node on a lattice of about the spacing of the grid; orders the elimination of unknowns.
    fn lattice(&self, node: usize) -> [u32; D];

    /// Corner nodes of a cell.
    fn corners(&self, cell: usize) -> Corners;

    /// Size of a cell, [length].
    fn size(&self, cell: usize) -> f64;

    /// Size of the smallest cell around a node, [length]: what is much nearer than this lies at the node.
    fn size_around(&self, node: usize) -> f64;

    /// Volume (area) of a cell, [volume].
    fn volume(&self, cell: usize) -> f64;

    /// The cell that holds a position, or `None` outside the grid; `hint` is a cell where to look first. A position
    /// on the border of cells belongs to one of them whatever its round-off.
    fn locate(&self, position: &[f64; D], hint: Option<u32>) -> Option<u32>;

    /// The cell nearest to a position, which may be outside the grid.
    fn nearest_cell(&self, position: &[f64; D]) -> u32;

    /// The linear basis of a cell at a position; outside the cell it is continued.
    fn basis_at(&self, cell: u32, position: &[f64; D]) -> CellBasis<D>;

    /// The cell that holds a position, or is nearest to it, and its basis there; `hint` is a cell where to look first.
    fn basis_near(&self, position: &[f64; D], hint: Option<u32>) -> (u32, CellBasis<D>) {
        let cell = self.locate(position, hint).unwrap_or_else(|| self.nearest_cell(position));
        (cell, self.basis_at(cell, position))
    }

    /// Names and nodes of the node sets of an imported grid.
    fn node_set(&self, _name: &str) -> Option<&[u32]> {
        None
    }

    /// Names and cells of the cell sets of an imported grid.
    fn cell_set(&self, _name: &str) -> Option<&[u32]> {
        None
    }

    /// Names of all sets of an imported grid.
    fn set_names(&self) -> Vec<&str> {
        Vec::new()
    }

    /// The grid as a structured one, which GIMP needs.
    fn structured(&self) -> Option<&Structured<D>> {
        None
    }
}

/// A nodal field at a position, by the basis of the cell that holds it or is nearest; linear fields are exact
/// everywhere.
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
