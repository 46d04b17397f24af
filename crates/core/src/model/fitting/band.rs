//! The band between an outline and the whole cells inside it, divided into triangles and quadrilaterals.

use spade::handles::{FixedDirectedEdgeHandle, FixedUndirectedEdgeHandle, FixedVertexHandle};
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use crate::region::vector::{minus, norm};

/// Smallest sine of an angle of a quadrilateral that joins two triangles, [-].
const SHAPELY: f64 = 0.35;

/// The triangulation, with the number of each vertex.
struct Band<'a> {
    places: &'a [[f64; 2]],
    mesh: ConstrainedDelaunayTriangulation<Point2<f64>>,
    /// The vertex of each corner, once it is inserted.
    vertices: Vec<Option<FixedVertexHandle>>,
    /// The corner at each vertex.
    corners: Vec<u32>,
}

/// Divides a band into triangles and quadrilaterals, given by their corners counterclockwise. `places` are the positions
/// of corners in cells; the band lies to the left of the `sides`, each given by two corners, and contains the corners
/// `free`. `None` if sides cross each other.
pub(super) fn filled(places: &[[f64; 2]], sides: &[[u32; 2]], free: &[u32]) -> Option<Vec<Vec<u32>>> {
    let mesh = ConstrainedDelaunayTriangulation::new();
    let mut band = Band { places, mesh, vertices: vec![None; places.len()], corners: Vec::new() };
    for &corner in sides.as_flattened().iter().chain(free) {
        band.insert(corner)?;
    }
    let ends = |side: &[u32; 2]| Some([band.vertices[side[0] as usize]?, band.vertices[side[1] as usize]?]);
    let ends: Vec<_> = sides.iter().map(ends).collect::<Option<_>>()?;
    for &[from, to] in &ends {
        if !band.mesh.can_add_constraint(from, to) {
            return None;
        }
        band.mesh.add_constraint(from, to);
    }
    let triangles = band.triangles(&ends)?;
    Some(band.joined(&triangles))
}

impl Band<'_> {
    fn insert(&mut self, corner: u32) -> Option<()> {
        if self.vertices[corner as usize].is_some() {
            return Some(());
        }
        let [x, y] = self.places[corner as usize];
        let vertex = self.mesh.insert(Point2::new(x, y)).ok()?;
        // Another corner at the same place would have given the same vertex.
        if vertex.index() != self.corners.len() {
            return None;
        }
        self.corners.push(corner);
        self.vertices[corner as usize] = Some(vertex);
        Some(())
    }

    /// For each triangle of the triangulation, true if it lies in the band: it does if it lies to the left of a side or
    /// beside such a triangle without a side in between. `None` if a side is no edge.
    fn triangles(&self, sides: &[[FixedVertexHandle; 2]]) -> Option<Vec<bool>> {
        let mut is_inside = vec![false; self.mesh.num_all_faces()];
        let mut next: Vec<FixedDirectedEdgeHandle> = Vec::new();
        for &[from, to] in sides {
            next.push(self.mesh.get_edge_from_neighbors(from, to)?.fix());
        }
        while let Some(edge) = next.pop() {
            let face = self.mesh.directed_edge(edge).face().as_inner()?;
            if std::mem::replace(&mut is_inside[face.fix().index()], true) {
                continue;
            }
            for edge in face.adjacent_edges() {
                if !edge.is_constraint_edge() {
                    next.push(edge.rev().fix());
                }
            }
        }
        Some(is_inside)
    }

    /// The triangles of the band, of which pairs are joined, those that form the best quadrilaterals first.
    fn joined(&self, is_inside: &[bool]) -> Vec<Vec<u32>> {
        let mut pairs: Vec<(f64, FixedUndirectedEdgeHandle)> = Vec::new();
        for edge in self.mesh.undirected_edges().filter(|edge| !edge.is_constraint_edge()) {
            let [left, right] = [edge.as_directed(), edge.as_directed().rev()];
            if [left, right].iter().all(|edge| is_inside[edge.face().fix().index()])
                && let (Some(a), Some(b)) = (left.opposite_vertex(), right.opposite_vertex())
            {
                let quadrilateral =
                    [left.from(), b, left.to(), a].map(|vertex| self.corners[vertex.fix().index()]);
                let shape = self.shape(&quadrilateral);
                if shape >= SHAPELY {
                    pairs.push((shape, edge.fix()));
                }
            }
        }
        // Equal shapes differ by round-off, which must not decide.
        let rank = |shape: f64| (shape * 1e9).round() as i64;
        pairs.sort_by_key(|&(shape, edge)| (std::cmp::Reverse(rank(shape)), edge.index()));
        let mut is_free = is_inside.to_vec();
        let mut found = Vec::new();
        for (_, edge) in pairs {
            let left = self.mesh.undirected_edge(edge).as_directed();
            let right = left.rev();
            let faces = [left, right].map(|edge| edge.face().fix().index());
            if let (Some(a), Some(b), true) =
                (left.opposite_vertex(), right.opposite_vertex(), faces.iter().all(|&face| is_free[face]))
            {
                faces.iter().for_each(|&face| is_free[face] = false);
                let corners = [left.from(), b, left.to(), a];
                found.push(corners.iter().map(|vertex| self.corners[vertex.fix().index()]).collect());
            }
        }
        for face in self.mesh.inner_faces().filter(|face| is_free[face.fix().index()]) {
            found.push(face.vertices().iter().map(|vertex| self.corners[vertex.fix().index()]).collect());
        }
        found
    }

    /// The smallest sine of the angles of a quadrilateral, [-]; negative if it is not convex.
    fn shape(&self, corners: &[u32; 4]) -> f64 {
        let x = corners.map(|corner| self.places[corner as usize]);
        let sine = |k: usize| {
            let (a, b) = (minus(&x[(k + 1) % 4], &x[k]), minus(&x[(k + 3) % 4], &x[k]));
            (a[0] * b[1] - a[1] * b[0]) / (norm(&a) * norm(&b))
        };
        (0..4).map(sine).fold(f64::INFINITY, f64::min)
    }
}
