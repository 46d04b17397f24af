//! Triangulated surfaces as tools.

use std::sync::Arc;

use super::border::UNSURE;
use super::closest::{Closest, EQUAL, Face, TOUCHING, between_faces};
use super::error::ShapeError;
use super::features::{FeatureKind, Nearest, on_triangle};
use super::shape::{Shape, largest};
use crate::region::surface::{Neighbours, Triangle};
use crate::region::vector::{along, cross, dot, minus, norm};
use crate::region::{Bounds, Facet, Primitive, Surface, area_vector, divided};

/// Distance between the normals of facets up to which they belong to one face, [-].
const SAME_NORMAL: f64 = 1e-9;

/// A closed triangulated surface, for example from an STL file. Part k is triangle k in the given order.
///
/// The sign of the gap follows from angle-weighted pseudonormals (Bærentzen and Aanæs, *IEEE Trans. Vis. Comput.
/// Graph.* 11 (2005) 243), and from the exact test of [`Surface`] where round-off could reverse the sign or sheets
/// touch at a corner.
#[derive(Debug, Clone)]
pub struct TriangulatedSurface {
    surface: Arc<Surface>,
    /// Outward unit normals of the facets, in the order of the tree.
    normals: Vec<[f64; 3]>,
    /// Numbers of the corners of each facet, in the order of the tree.
    corners: Vec<[u32; 3]>,
    /// The facets on the other side of each edge of each facet, in the order of the tree.
    beyond: Vec<[u32; 3]>,
    /// Sum of the normals at each corner, weighted by the angles of the facets; zero where sheets touch.
    pseudonormals: Vec<[f64; 3]>,
}

impl TriangulatedSurface {
    /// A surface of triangles in any order, each with its corners counterclockwise as seen from outside, [length].
    ///
    /// # Errors
    /// [`ShapeError::Surface`], as [`Surface::new`].
    pub fn new(triangles: &[Triangle]) -> Result<Self, ShapeError> {
        Ok(Self::from_surface(Arc::new(Surface::new(triangles)?)))
    }

    /// The tool with this closed surface.
    pub fn from_surface(surface: Arc<Surface>) -> Self {
        let Neighbours { corners, number, beyond, touching } = surface.neighbours();
        let normals: Vec<[f64; 3]> = surface.triangles().iter().map(unit_normal).collect();
        let mut pseudonormals = vec![[0.0; 3]; number];
        for (facet, triangle) in surface.triangles().iter().enumerate() {
            for (k, &corner) in corners[facet].iter().enumerate() {
                let sum = &mut pseudonormals[corner as usize];
                *sum = along(sum, angle(triangle, k), &normals[facet]);
            }
        }
        pseudonormals
            .iter_mut()
            .zip(touching)
            .filter(|(_, touches)| *touches)
            .for_each(|(n, _)| *n = [0.0; 3]);
        TriangulatedSurface { surface, normals, corners, beyond, pseudonormals }
    }

    /// The closest point between all facets that are as near to a position inside as the facet on which one was `found`.
    fn between(&self, x: &[f64; 3], found: Closest<3>) -> Closest<3> {
        let touching = TOUCHING * largest(&self.bounds());
        if found.gap > touching {
            return found;
        }
        let most = found.gap.abs() * (1.0 + EQUAL) + touching;
        let (tree, triangles, mut others) = (self.surface.tree(), self.surface.triangles(), Vec::new());
        tree.approach(x, most * most, |item| {
            let normal = &self.normals[item];
            let feature = on_triangle(x, &triangles[item], normal, most * most);
            if let Some(feature) = feature.filter(|feature| feature.squared <= most * most)
                && dot(&feature.offset, normal) <= touching
                && norm(&minus(normal, &found.normal)) > SAME_NORMAL
            {
                others.push(*normal);
            }
            most * most
        });
        if others.is_empty() { found } else { between_faces(x, &found, &others) }
    }

    /// The surface.
    pub fn surface(&self) -> &Arc<Surface> {
        &self.surface
    }
}

impl Shape<3> for TriangulatedSurface {
    fn bounds(&self) -> Bounds<3> {
        self.surface.tree().bounds()
    }

    fn search(&self, x: &[f64; 3], limit: f64) -> Option<Closest<3>> {
        let (tree, triangles) = (self.surface.tree(), self.surface.triangles());
        let mut nearest = Nearest::within(limit);
        tree.approach(x, nearest.squared_limit(), |item| {
            let limit = nearest.squared_limit();
            if let Some(feature) = on_triangle(x, &triangles[item], &self.normals[item], limit) {
                nearest.offer(feature, item, tree.order[item]);
            }
            nearest.squared_limit()
        });
        let (feature, item, part) = nearest.found?;
        let (part, normal, offset) = (part as usize, self.normals[item], feature.offset);
        let (pseudonormal, edge) = match feature.kind {
            FeatureKind::Face => {
                let found = Closest::on_plane(x, dot(&offset, &normal), normal, part);
                return Some(self.between(x, found));
            }
            FeatureKind::Edge(k) => {
                let edge = minus(&triangles[item][(k + 1) % 3], &triangles[item][k]);
                let length = norm(&edge);
                let beyond = self.normals[self.beyond[item][k] as usize];
                (along(&normal, 1.0, &beyond), Some(edge.map(|x| x / length)))
            }
            FeatureKind::Corner(k) => (self.pseudonormals[self.corners[item][k] as usize], None),
        };
        let distance = norm(&offset);
        if distance <= TOUCHING * largest(&self.bounds()) {
            return Some(self.between(x, Closest::at_corner(x, normal, part)));
        }
        let height = dot(&offset, &pseudonormal);
        let is_sure = height.abs() > UNSURE * distance;
        let outside = if is_sure { height > 0.0 } else { !self.surface.contains(x) };
        Some(Closest::on_corner(x, &offset, outside, edge.as_ref(), part))
    }

    fn faces_near(&self, x: &[f64; 3], limit: f64) -> Vec<Face<3>> {
        let (tree, triangles, mut faces) =
            (self.surface.tree(), self.surface.triangles(), Vec::<Face<3>>::new());
        let most = 2.0 * limit * limit;
        tree.approach(x, most, |item| {
            let (triangle, normal) = (&triangles[item], &self.normals[item]);
            let gap = dot(&minus(x, &triangle[0]), normal);
            let Some(feature) = on_triangle(x, triangle, normal, limit * limit) else { return most };
            let beside = norm(&along(&feature.offset, -gap, normal));
            if beside > limit {
                return most;
            }
            let closest = Closest::on_plane(x, gap, *normal, tree.order[item] as usize);
            let middle = std::array::from_fn(|d| triangle.iter().map(|x| x[d]).sum::<f64>() / 3.0);
            // The triangles of one plane are one face.
            let is_same = |face: &&mut Face<3>| {
                norm(&minus(&face.closest.normal, normal)) <= SAME_NORMAL
                    && (face.closest.gap - gap).abs() <= SAME_NORMAL * limit
            };
            match faces.iter_mut().find(is_same) {
                Some(face) if face.beside <= beside => {}
                Some(face) => *face = Face { closest, beside, middle },
                None => faces.push(Face { closest, beside, middle }),
            }
            most
        });
        faces
    }

    fn crossing(&self, path: &[[f64; 3]; 2]) -> Option<f64> {
        self.surface.first_crossing(*path)
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<3>>> {
        let mut pieces = Vec::new();
        for (item, triangle) in self.surface.triangles().iter().enumerate() {
            pieces.extend(divided(triangle, size, self.surface.tree().order[item] as usize));
        }
        Some(pieces)
    }
}

fn unit_normal(triangle: &Triangle) -> [f64; 3] {
    let area = area_vector(triangle);
    let length = norm(&area);
    area.map(|x| x / length)
}

/// The angle of a triangle at corner k, [rad].
fn angle(triangle: &Triangle, k: usize) -> f64 {
    let [a, b] = [1, 2].map(|step| minus(&triangle[(k + step) % 3], &triangle[k]));
    norm(&cross(&a, &b)).atan2(dot(&a, &b))
}
