//! Extruded polygons as tools.

use super::closest::{Closest, TOUCHING, indices};
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

    /// The closest point on the lateral surface, in space, for a position at any height.
    fn lateral(&self, x: &[f64; 3]) -> Option<Closest<3>> {
        let found = self.base.closest(self.prism.across(x))?;
        let axis = self.prism.axis();
        let mut normal_derivative = [[0.0; 3]; 3];
        for (i, j) in indices::<2>() {
            let [i_in_space, j_in_space] = [i, j].map(|k| (0..3).filter(|d| *d != axis).nth(k).unwrap_or(k));
            normal_derivative[i_in_space][j_in_space] = found.normal_derivative[i][j];
        }
        Some(Closest {
            gap: found.gap,
            normal: self.prism.at(found.normal, 0.0),
            point: self.prism.at(found.point, x[axis]),
            part: found.part,
            normal_derivative,
        })
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
        let lateral = self.lateral(x)?;
        let (a, b) = (lateral.gap, end.gap);
        let nearer = if a >= b { lateral } else { end };
        let gap = a.hypot(b);
        if a <= 0.0 || b <= 0.0 || gap <= TOUCHING * largest(&self.bounds()) {
            return Some(nearer);
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

    fn crossing(&self, path: &[[f64; 3]; 2]) -> Option<f64> {
        crossing_of(&self.prism, path)
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<3>>> {
        Some(self.prism.facets(size))
    }
}
