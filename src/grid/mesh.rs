//! Unstructured meshes of triangles and quadrilaterals in the plane.

mod build;
mod error;

use std::collections::BTreeMap;

use super::bins::{Bins, Bounds};
use super::element::{ElementShape, MAX_NODES, cross};
use super::{CellBasis, Grid};

pub use error::{CellReport, MeshError, MeshWarning};

/// A position closer than this to an edge, relative to the size of the cell, counts as lying in the cell.
///
/// Positions that lie on an edge in exact arithmetic must all be given to the same cell, whatever their round-off.
pub const ON_EDGE: f64 = 1e-9;

/// An unstructured mesh in the plane. Cells are counterclockwise and convex; triangles come first, then
/// quadrilaterals, both in the order of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    positions: Vec<[f64; 2]>,
    n_triangles: usize,
    cell_nodes: Vec<u32>,
    area: Vec<f64>,
    largest_size: f64,
    bounds: Bounds,
    bins: Bins,
    boundary: Vec<BoundaryEdge>,
    node_sets: BTreeMap<String, Vec<u32>>,
    edge_sets: BTreeMap<String, Vec<[u32; 2]>>,
    cell_sets: BTreeMap<String, Vec<u32>>,
    warnings: Vec<MeshWarning>,
}

/// An edge that belongs to one cell only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoundaryEdge {
    /// Nodes in the order of the cell: the cell lies to the left.
    pub nodes: [u32; 2],
    /// The cell.
    pub cell: u32,
}

/// Positions of the corners of a cell.
#[derive(Debug, Clone, Copy)]
struct Corners {
    x: [[f64; 2]; MAX_NODES],
    shape: ElementShape,
}

impl std::ops::Deref for Corners {
    type Target = [[f64; 2]];

    fn deref(&self) -> &[[f64; 2]] {
        &self.x[..self.shape.n_nodes()]
    }
}

impl Corners {
    /// The edges as pairs of corners.
    fn edges(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        self.iter().copied().zip(self[1..].iter().chain(&self[..1]).copied())
    }

    /// Whether a position is to the left of the lines through all edges, at a distance of `margin` or more.
    fn contains(&self, x: &[f64; 2], margin: f64) -> bool {
        self.edges().all(|(a, b)| {
            let edge = [b[0] - a[0], b[1] - a[1]];
            let distance = cross(edge, [x[0] - a[0], x[1] - a[1]]);
            distance >= margin * (edge[0] * edge[0] + edge[1] * edge[1]).sqrt()
        })
    }

    /// Whether a position is inside or no farther away than `tolerance`.
    fn touches(&self, x: &[f64; 2], tolerance: f64) -> bool {
        // The lines of a sharp corner come close to positions far beyond the corner, hence the third test.
        self.contains(x, -tolerance)
            && (self.contains(x, 0.0) || self.distance_squared(x) <= tolerance * tolerance)
    }

    /// Square of the distance of a position, zero inside.
    fn distance_squared(&self, x: &[f64; 2]) -> f64 {
        if self.contains(x, 0.0) {
            return 0.0;
        }
        self.edges().map(|(a, b)| distance_squared(x, a, b)).fold(f64::INFINITY, f64::min)
    }
}

/// Square of the distance of a position from a segment.
fn distance_squared(x: &[f64; 2], a: [f64; 2], b: [f64; 2]) -> f64 {
    let (edge, to) = ([b[0] - a[0], b[1] - a[1]], [x[0] - a[0], x[1] - a[1]]);
    let along = (to[0] * edge[0] + to[1] * edge[1]) / (edge[0] * edge[0] + edge[1] * edge[1]);
    let t = along.clamp(0.0, 1.0);
    (to[0] - t * edge[0]).powi(2) + (to[1] - t * edge[1]).powi(2)
}

/// Numbers of nodes and cells that do not exist are a mistake of the caller: all methods panic on them.
impl Mesh {
    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.positions.len()
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.area.len()
    }

    /// Position of a node, [length].
    pub fn node_position(&self, node: usize) -> [f64; 2] {
        self.positions[node]
    }

    /// Shape of a cell.
    pub fn cell_shape(&self, cell: u32) -> ElementShape {
        if (cell as usize) < self.n_triangles { ElementShape::Triangle } else { ElementShape::Quadrilateral }
    }

    /// Nodes of a cell, counterclockwise.
    pub fn cell_nodes(&self, cell: u32) -> &[u32] {
        let cell = cell as usize;
        match cell.checked_sub(self.n_triangles) {
            None => &self.cell_nodes[3 * cell..3 * cell + 3],
            Some(k) => &self.cell_nodes[3 * self.n_triangles + 4 * k..][..4],
        }
    }

    /// Positions of the nodes of a cell, counterclockwise, [length].
    pub fn cell_corners(&self, cell: u32) -> impl std::ops::Deref<Target = [[f64; 2]]> + use<> {
        self.corners(cell)
    }

    fn corners(&self, cell: u32) -> Corners {
        let mut x = [[0.0; 2]; MAX_NODES];
        for (x, node) in x.iter_mut().zip(self.cell_nodes(cell)) {
            *x = self.positions[*node as usize];
        }
        Corners { x, shape: self.cell_shape(cell) }
    }

    /// Area of a cell, [length²].
    pub fn area(&self, cell: u32) -> f64 {
        self.area[cell as usize]
    }

    /// Size of a cell: the square root of its area, [length].
    pub fn size(&self, cell: u32) -> f64 {
        self.area(cell).sqrt()
    }

    /// Centre of mass of a cell, [length].
    pub fn centroid(&self, cell: u32) -> [f64; 2] {
        let corners = self.corners(cell);
        corners.shape.centroid(&corners)
    }

    /// Lower and upper corner of the box around the mesh, [length].
    pub fn bounds(&self) -> [[f64; 2]; 2] {
        self.bounds
    }

    /// Edges that belong to one cell only, ascending by their nodes.
    pub fn boundary_edges(&self) -> &[BoundaryEdge] {
        &self.boundary
    }

    /// Nodes of each physical group, ascending.
    pub fn node_sets(&self) -> &BTreeMap<String, Vec<u32>> {
        &self.node_sets
    }

    /// Edges of each physical group of curves, as pairs of nodes in the direction of the file; ascending.
    pub fn edge_sets(&self) -> &BTreeMap<String, Vec<[u32; 2]>> {
        &self.edge_sets
    }

    /// Cells of each physical group of surfaces, ascending.
    pub fn cell_sets(&self) -> &BTreeMap<String, Vec<u32>> {
        &self.cell_sets
    }

    /// What is allowed but probably not meant.
    pub fn warnings(&self) -> &[MeshWarning] {
        &self.warnings
    }

    /// The cell that holds a position, or `None` outside the mesh.
    ///
    /// A position within [`ON_EDGE`] of several cells belongs to the one with the lowest number. The `hint`, a cell
    /// that may hold the position, makes no difference to the answer, only to the time it takes.
    pub fn locate(&self, x: &[f64; 2], hint: Option<u32>) -> Option<u32> {
        if let Some(cell) = hint.filter(|cell| (*cell as usize) < self.n_cells()) {
            // Too far from the edges for any neighbour, however large, to claim the position.
            if self.corners(cell).contains(x, 2.0 * ON_EDGE * self.largest_size) {
                return Some(cell);
            }
        }
        let mut candidates = self.bins.at(x).iter().copied();
        candidates.find(|&cell| self.corners(cell).touches(x, ON_EDGE * self.size(cell)))
    }

    /// The cell nearest to a position, inside or outside the mesh; of several as near within [`ON_EDGE`], the one
    /// with the lowest number.
    pub fn nearest_cell(&self, x: &[f64; 2]) -> u32 {
        if let Some(cell) = self.locate(x, None) {
            return cell;
        }
        let mut least = f64::INFINITY;
        let mut near = Vec::new();
        self.bins.outwards(x, |cells, bound| {
            for &cell in cells {
                let distance = self.corners(cell).distance_squared(x).sqrt();
                least = least.min(distance);
                near.push((cell, distance));
            }
            near.retain(|(cell, distance)| *distance <= least + ON_EDGE * self.size(*cell));
            least * least > bound
        });
        near.iter().map(|(cell, _)| *cell).min().unwrap_or(0)
    }

    /// The basis of a cell at a position inside it, or outside by continuation.
    ///
    /// So far outside a quadrilateral that its map has no inverse, the linear basis of its nearer half stands in:
    /// it still reproduces linear fields.
    pub fn shape(&self, cell: u32, x: &[f64; 2]) -> CellBasis<2> {
        let corners = self.corners(cell);
        let shape = corners.shape;
        let basis = |value: [f64; MAX_NODES], gradient: [[f64; 2]; MAX_NODES]| {
            let mut basis = CellBasis::default();
            for (k, &node) in self.cell_nodes(cell).iter().enumerate() {
                basis.push(node, value[k], gradient[k]);
            }
            basis
        };
        if let Some(xi) = shape.inverse(&corners, x) {
            return basis(shape.values(xi), shape.gradients(&corners, xi));
        }
        let [p, q, r, s] = corners.x;
        let near = |a, b| distance_squared(x, a, b);
        let half =
            if near(p, q).min(near(q, r)) <= near(r, s).min(near(s, p)) { [0, 1, 2] } else { [0, 2, 3] };
        let part = half.map(|k| corners.x[k]);
        let (mut values, mut gradients) = ([0.0; MAX_NODES], [[0.0; 2]; MAX_NODES]);
        let triangle = ElementShape::Triangle;
        let xi = triangle.inverse(&part, x).unwrap_or(triangle.centre());
        let (value, gradient) = (triangle.values(xi), triangle.gradients(&part, xi));
        for (k, corner) in half.into_iter().enumerate() {
            values[corner] = value[k];
            gradients[corner] = gradient[k];
        }
        basis(values, gradients)
    }
}

impl Grid<2> for Mesh {
    fn n_nodes(&self) -> usize {
        self.n_nodes()
    }

    fn n_cells(&self) -> usize {
        self.n_cells()
    }

    fn node_position(&self, node: usize) -> [f64; 2] {
        self.node_position(node)
    }

    fn bounds(&self) -> [[f64; 2]; 2] {
        self.bounds()
    }

    fn lattice(&self, node: usize) -> [u32; 2] {
        let x = self.node_position(node);
        let low = self.bounds()[0];
        std::array::from_fn(|d| ((x[d] - low[d]) / self.largest_size) as u32)
    }

    fn corners(&self, cell: usize) -> super::Corners {
        super::Corners::new(self.cell_nodes(cell as u32))
    }

    fn size(&self, cell: usize) -> f64 {
        self.size(cell as u32)
    }

    fn volume(&self, cell: usize) -> f64 {
        self.area(cell as u32)
    }

    fn locate(&self, position: &[f64; 2], hint: Option<u32>) -> Option<u32> {
        self.locate(position, hint)
    }

    fn nearest_cell(&self, position: &[f64; 2]) -> u32 {
        self.nearest_cell(position)
    }

    fn basis_at(&self, cell: u32, position: &[f64; 2]) -> CellBasis<2> {
        self.shape(cell, position)
    }

    fn node_set(&self, name: &str) -> Option<&[u32]> {
        self.node_sets.get(name).map(Vec::as_slice)
    }

    fn cell_set(&self, name: &str) -> Option<&[u32]> {
        self.cell_sets.get(name).map(Vec::as_slice)
    }

    fn set_names(&self) -> Vec<&str> {
        self.node_sets.keys().map(String::as_str).collect()
    }
}

#[cfg(test)]
mod tests;
