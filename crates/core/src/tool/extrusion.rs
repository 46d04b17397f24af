//! Extruded polygons as tools.

use super::closest::{Closest, EQUAL, Face, TOUCHING, between_faces, indices};
use super::error::ShapeError;
use super::polygon::ClosedPolygon;
use super::primitives::crossing_of;
use super::shape::{Shape, largest};
use crate::region::vector::{minus, unit};
use crate::region::{Bounds, Facet, Primitive, Prism};

/// A polygon extruded along an axis. Parts are the edges of the polygon, then the lower and the upper end.
#[derive(Debug, Clone)]
pub struct Extrusion {
    prism: Prism,
    base: ClosedPolygon,
}

impl Extrusion {
    /// A polygon, given by its corners in the other two coordinates in ascending order, [length], extruded along `axis`
    /// (0 to 2) between two heights, [length].
    ///
    /// # Errors
    /// As for [`ClosedPolygon::new`]; [`ShapeError::Primitive`] if there is no such axis or the heights do not ascend.
    pub fn new(corners: Vec<[f64; 2]>, axis: usize, heights: [f64; 2]) -> Result<Self, ShapeError> {
        let base = ClosedPolygon::new(corners)?;
        Ok(Extrusion { prism: Prism::new(base.polygon().clone(), axis, heights)?, base })
    }

    /// The closest point on the lateral surface, in space, for a position at any height, and the normal of a further
    /// lateral face that is equally near.
    fn lateral(&self, x: &[f64; 3]) -> Option<(Closest<3>, Option<[f64; 3]>)> {
        let (found, other) = self.base.on_face(&self.prism.across(x))?;
        let axis = self.prism.axis();
        let mut normal_derivative = [[0.0; 3]; 3];
        for (i, j) in indices::<2>() {
            let [i_in_space, j_in_space] = [i, j].map(|k| (0..3).filter(|d| *d != axis).nth(k).unwrap_or(k));
            normal_derivative[i_in_space][j_in_space] = found.normal_derivative[i][j];
        }
        let lateral = Closest {
            gap: found.gap,
            normal: self.prism.at(found.normal, 0.0),
            point: self.prism.at(found.point, x[axis]),
            part: found.part,
            normal_derivative,
        };
        Some((lateral, other.map(|normal| self.prism.at(normal, 0.0))))
    }
}

impl Shape<3> for Extrusion {
    fn bounds(&self) -> Bounds<3> {
        let ([low, high], [bottom, top]) = (self.base.bounds(), self.prism.heights());
        [self.prism.at(low, bottom), self.prism.at(high, top)]
    }

    fn search(&self, x: &[f64; 3], _: f64) -> Option<Closest<3>> {
        let (axis, [bottom, top]) = (self.prism.axis(), self.prism.heights());
        let [below, above] = [bottom - x[axis], x[axis] - top];
        let upper = above >= below;
        let end = {
            let normal = unit::<3>(axis).map(|e| if upper { e } else { -e });
            let part = self.base.polygon().vertices().len() + usize::from(upper);
            Closest::on_plane(x, above.max(below), normal, part)
        };
        let (lateral, other) = self.lateral(x)?;
        let (a, b) = (lateral.gap, end.gap);
        let nearer = if a >= b { lateral } else { end };
        let (gap, touching) = (a.hypot(b), TOUCHING * largest(&self.bounds()));
        if a <= 0.0 || b <= 0.0 || gap <= touching {
            let is_tie = a.max(b) <= touching && (a - b).abs() <= EQUAL * gap + touching;
            return Some(match other.filter(|_| is_tie || a >= b) {
                Some(other) if is_tie => between_faces(x, &nearer, &[lateral.normal, other, end.normal]),
                Some(other) => between_faces(x, &nearer, &[other]),
                None if is_tie => between_faces(x, &nearer, &[lateral.normal, end.normal]),
                None => nearer,
            });
        }
        // Beyond the edge of an end, with g² = a² + b²: g n = a ∇a + b ∇b, and the derivative of this.
        let offset: [f64; 3] = std::array::from_fn(|d| a * lateral.normal[d] + b * end.normal[d]);
        let normal = offset.map(|x| x / gap);
        let mut normal_derivative = [[0.0; 3]; 3];
        for (i, j) in indices::<3>() {
            let squares = lateral.normal[i] * lateral.normal[j] + end.normal[i] * end.normal[j];
            normal_derivative[i][j] =
                (squares + a * lateral.normal_derivative[i][j] - normal[i] * normal[j]) / gap;
        }
        Some(Closest { gap, normal, point: minus(x, &offset), part: nearer.part, normal_derivative })
    }

    fn faces_near(&self, x: &[f64; 3], limit: f64) -> Vec<Face<3>> {
        let (axis, [bottom, top]) = (self.prism.axis(), self.prism.heights());
        let past = (bottom - x[axis]).max(x[axis] - top).max(0.0);
        let in_space = |face: Face<2>| Face {
            closest: Closest::on_plane(
                x,
                face.closest.gap,
                self.prism.at(face.closest.normal, 0.0),
                face.closest.part,
            ),
            beside: face.beside.hypot(past),
            middle: self.prism.at(face.middle, 0.5 * (bottom + top)),
        };
        let mut faces = Vec::new();
        if past <= limit {
            let across = self.prism.across(x);
            faces.extend(self.base.faces_near(&across, limit).into_iter().map(in_space));
            let beside = self.base.closest(across).map_or(f64::INFINITY, |found| found.gap.max(0.0));
            let edges = self.base.polygon().vertices().len();
            let ends = [(bottom - x[axis], -1.0, edges), (x[axis] - top, 1.0, edges + 1)];
            for (gap, sign, part) in
                ends.into_iter().filter(|(gap, ..)| gap.abs() <= limit && beside <= limit)
            {
                let closest = Closest::on_plane(x, gap, unit::<3>(axis).map(|e| sign * e), part);
                // A position on the face itself, which the base need not contain if it is not convex.
                let middle = closest.point;
                faces.push(Face { closest, beside, middle });
            }
        }
        faces
    }

    fn crossing(&self, path: &[[f64; 3]; 2]) -> Option<f64> {
        crossing_of(&self.prism, path)
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<3>>> {
        Some(self.prism.facets(size))
    }
}
