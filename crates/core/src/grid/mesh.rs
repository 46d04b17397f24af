//! Unstructured meshes: triangles and quadrilaterals in the plane, tetrahedra and hexahedra in space.

mod build;
mod cell;
mod error;
mod fit;
mod sides;

use std::collections::BTreeMap;

use super::bins::{Bins, Bounds};
use super::element::{ElementShape, MAX_NODES};
use super::{CellBasis, Grid, Patches};

use cell::Cell;
pub(crate) use cell::distance_squared_of_triangle;
pub use error::{CellReport, HangingNode, MeshError, MeshWarning};
pub use sides::{BoundarySide, Side};

/// Relative distance, in units of the cell size, within which a position counts as lying on the boundary of a cell.
///
/// All positions that lie on such a boundary in exact arithmetic must belong to the same cell, whatever their
/// round-off.
pub const ON_EDGE: f64 = 1e-9;

/// An unstructured mesh. Cells have positive volume and do not overlap; quadrilaterals are convex and hexahedra do not
/// fold; connected cells share whole sides. Triangles (tetrahedra) come first, then quadrilaterals (hexahedra), both in
/// file order.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh<const D: usize> {
    positions: Vec<[f64; D]>,
    n_simplices: usize,
    cell_nodes: Vec<u32>,
    volume: Vec<f64>,
    /// Size of the smallest cell around each node, [length].
    node_size: Vec<f64>,
    largest_size: f64,
    /// Median cell size, [length].
    usual_size: f64,
    bounds: Bounds<D>,
    bins: Bins<D>,
    boundary: Vec<BoundarySide>,
    /// Nodes of the groups whose name one dimension has.
    node_sets: BTreeMap<String, Vec<u32>>,
    /// Nodes of all groups, by name and dimension.
    nodes_of_groups: BTreeMap<String, BTreeMap<u8, Vec<u32>>>,
    side_sets: BTreeMap<String, Vec<Side>>,
    cell_sets: BTreeMap<String, Vec<u32>>,
    warnings: Vec<MeshWarning>,
    patches: Option<Patches>,
}

/// All methods panic if a node or cell does not exist.
impl<const D: usize> Mesh<D> {
    /// The mesh with its triangles or tetrahedra joined into patches, over which bodies can average their dilatation.
    pub fn with_patches(mut self) -> Self {
        self.patches = Some(Patches::new::<D>(&self));
        self
    }

    /// Number of nodes.
    pub fn n_nodes(&self) -> usize {
        self.positions.len()
    }

    /// Number of cells.
    pub fn n_cells(&self) -> usize {
        self.volume.len()
    }

    /// Position of a node, [length].
    pub fn node_position(&self, node: usize) -> [f64; D] {
        self.positions[node]
    }

    /// Shape of a cell.
    pub fn cell_shape(&self, cell: u32) -> ElementShape {
        if (cell as usize) < self.n_simplices { ElementShape::Simplex } else { ElementShape::Box }
    }

    /// Nodes of a cell in VTK order.
    pub fn cell_nodes(&self, cell: u32) -> &[u32] {
        let cell = cell as usize;
        let (small, large) = (D + 1, 1 << D);
        match cell.checked_sub(self.n_simplices) {
            None => &self.cell_nodes[small * cell..][..small],
            Some(k) => &self.cell_nodes[small * self.n_simplices + large * k..][..large],
        }
    }

    /// Positions of the nodes of a cell in VTK order, [length].
    pub fn cell_corners(&self, cell: u32) -> impl std::ops::Deref<Target = [[f64; D]]> + use<D> {
        self.cell(cell)
    }

    fn cell(&self, cell: u32) -> Cell<D> {
        let mut x = [[0.0; D]; MAX_NODES];
        for (x, node) in x.iter_mut().zip(self.cell_nodes(cell)) {
            *x = self.positions[*node as usize];
        }
        Cell { x, shape: self.cell_shape(cell) }
    }

    /// Volume (area) of a cell, [length^`D`].
    pub fn volume(&self, cell: u32) -> f64 {
        self.volume[cell as usize]
    }

    /// Size of a cell, [length]: the side of a square (cube) of the same volume.
    pub fn size(&self, cell: u32) -> f64 {
        Cell::<D>::size_of(self.volume(cell))
    }

    /// Centroid of a cell, [length].
    pub fn centroid(&self, cell: u32) -> [f64; D] {
        let corners = self.cell(cell);
        corners.shape.centroid(&corners)
    }

    /// Lower and upper corner of the bounding box, [length].
    pub fn bounds(&self) -> [[f64; D]; 2] {
        self.bounds
    }

    /// Edges (faces) that belong to one cell only, sorted by their nodes.
    pub fn boundary(&self) -> &[BoundarySide] {
        &self.boundary
    }

    /// Nodes of each physical group, ascending.
    pub fn node_sets(&self) -> &BTreeMap<String, Vec<u32>> {
        &self.node_sets
    }

    /// Sides of each physical group, sorted, with their nodes in file order: edges of curve groups in the plane, faces
    /// of surface groups in space.
    pub fn side_sets(&self) -> &BTreeMap<String, Vec<Side>> {
        &self.side_sets
    }

    /// Cells of each physical group, ascending: surface groups in the plane, volume groups in space.
    pub fn cell_sets(&self) -> &BTreeMap<String, Vec<u32>> {
        &self.cell_sets
    }

    /// Valid but suspicious properties of the mesh.
    pub fn warnings(&self) -> &[MeshWarning] {
        &self.warnings
    }

    /// The cell that contains a position; `None` outside the mesh.
    ///
    /// A position within [`ON_EDGE`] of several cells belongs to the cell with the lowest number. A good `hint` makes
    /// the search faster; it never changes the result.
    pub fn locate(&self, x: &[f64; D], hint: Option<u32>) -> Option<u32> {
        if let Some(cell) = hint.filter(|cell| (*cell as usize) < self.n_cells()) {
            // Beyond this distance from the boundary, no other cell, however large, can claim the position.
            if self.cell(cell).holds(x, 2.0 * ON_EDGE * self.largest_size) {
                return Some(cell);
            }
        }
        let mut candidates = self.bins.at(x).iter().copied();
        candidates.find(|&cell| self.cell(cell).touches(x, ON_EDGE * self.size(cell)))
    }

    /// The cell nearest to a position inside or outside the mesh; if several cells are at equal distance, within
    /// [`ON_EDGE`], the cell with the lowest number.
    pub fn nearest_cell(&self, x: &[f64; D]) -> u32 {
        if let Some(cell) = self.locate(x, None) {
            return cell;
        }
        let mut least = f64::INFINITY;
        let mut near = Vec::new();
        self.bins.outwards(x, |cells, bound| {
            for &cell in cells {
                let distance = self.cell(cell).distance_squared(x).sqrt();
                least = least.min(distance);
                near.push((cell, distance));
            }
            near.retain(|(cell, distance)| *distance <= least + ON_EDGE * self.size(*cell));
            least * least > bound
        });
        near.iter().map(|(cell, _)| *cell).min().unwrap_or(0)
    }

    /// The basis of a cell at a position, continued outside the cell. A position within [`ON_EDGE`] of the boundary of
    /// the cell counts as lying on it: nodes off that part of the boundary get exactly zero, so that round-off never
    /// activates a node with negligible stiffness.
    ///
    /// Far outside a quadrilateral or hexahedron, where the map has no inverse, the linear basis of a part of the cell
    /// is used, which still reproduces linear fields.
    pub fn shape(&self, cell: u32, x: &[f64; D]) -> CellBasis<D> {
        let corners = self.cell(cell);
        let shape = corners.shape;
        let basis = |value: [f64; MAX_NODES], gradient: [[f64; D]; MAX_NODES]| {
            let mut basis = CellBasis::default();
            for (k, &node) in self.cell_nodes(cell).iter().enumerate() {
                basis.push(node, value[k], gradient[k]);
            }
            basis
        };
        if let Some(xi) = shape.inverse(&corners, x) {
            let (xi, values) = on_border(shape, xi);
            return basis(values, shape.gradients(&corners, xi));
        }
        let part_corners = corners.linear_part(x);
        let part = part_corners.map(|k| corners.x[k]);
        let simplex = ElementShape::Simplex;
        let xi = simplex.inverse(&part[..=D], x).unwrap_or(simplex.centre());
        let (value, gradient) = (simplex.values(xi), simplex.gradients(&part[..=D], xi));
        let (mut values, mut gradients) = ([0.0; MAX_NODES], [[0.0; D]; MAX_NODES]);
        for (k, corner) in part_corners.into_iter().enumerate().take(D + 1) {
            values[corner] = value[k];
            gradients[corner] = gradient[k];
        }
        basis(values, gradients)
    }
}

/// Shape functions at local coordinates, snapped to the boundary of the cell if they are within round-off of it; the
/// coordinates of a quadrilateral or hexahedron are snapped as well.
fn on_border<const D: usize>(shape: ElementShape, mut xi: [f64; D]) -> ([f64; D], [f64; MAX_NODES]) {
    if shape == ElementShape::Box {
        for x in xi.iter_mut().filter(|x| (x.abs() - 1.0).abs() < 2.0 * ON_EDGE) {
            *x = x.signum();
        }
        return (xi, shape.values(xi));
    }
    let mut values = shape.values(xi);
    let largest = (1..=D).fold(0, |largest, k| if values[k] > values[largest] { k } else { largest });
    for k in (0..=D).filter(|k| *k != largest) {
        if values[k].abs() < ON_EDGE {
            values[largest] += values[k];
            values[k] = 0.0;
        }
    }
    (xi, values)
}

impl<const D: usize> Grid<D> for Mesh<D> {
    fn n_nodes(&self) -> usize {
        self.n_nodes()
    }

    fn n_cells(&self) -> usize {
        self.n_cells()
    }

    fn node_position(&self, node: usize) -> [f64; D] {
        self.node_position(node)
    }

    fn bounds(&self) -> [[f64; D]; 2] {
        self.bounds()
    }

    fn lattice(&self, node: usize) -> [u32; D] {
        let x = self.node_position(node);
        let low = self.bounds()[0];
        std::array::from_fn(|d| ((x[d] - low[d]) / self.usual_size) as u32)
    }

    fn corners(&self, cell: usize) -> super::Corners {
        super::Corners::new(self.cell_nodes(cell as u32))
    }

    fn size(&self, cell: usize) -> f64 {
        self.size(cell as u32)
    }

    fn size_around(&self, node: usize) -> f64 {
        self.node_size[node]
    }

    fn volume(&self, cell: usize) -> f64 {
        self.volume(cell as u32)
    }

    fn locate(&self, position: &[f64; D], hint: Option<u32>) -> Option<u32> {
        self.locate(position, hint)
    }

    fn nearest_cell(&self, position: &[f64; D]) -> u32 {
        self.nearest_cell(position)
    }

    fn basis_at(&self, cell: u32, position: &[f64; D]) -> CellBasis<D> {
        self.shape(cell, position)
    }

    fn has_simplices(&self) -> bool {
        self.n_simplices > 0
    }

    fn node_set(&self, name: &str) -> Option<&[u32]> {
        self.node_sets.get(name).map(Vec::as_slice)
    }

    fn node_sets_named(&self, name: &str) -> Vec<(u8, &[u32])> {
        let groups = self.nodes_of_groups.get(name).into_iter().flatten();
        groups.map(|(dimension, nodes)| (*dimension, nodes.as_slice())).collect()
    }

    fn cell_set(&self, name: &str) -> Option<&[u32]> {
        self.cell_sets.get(name).map(Vec::as_slice)
    }

    fn patches(&self) -> Option<&Patches> {
        self.patches.as_ref()
    }

    fn set_names(&self) -> Option<Vec<&str>> {
        Some(self.nodes_of_groups.keys().map(String::as_str).collect())
    }
}

#[cfg(test)]
pub(crate) mod tests;
