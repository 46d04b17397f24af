//! Polygons as tools.

use super::border::{self, Border};
use super::closest::Closest;
use super::error::ShapeError;
use super::segments::right_normal;
use super::shape::Shape;
use crate::region::vector::{dot, minus};
use crate::region::{Bounds, Facet, Polygon, Primitive, around, segments_meet};

/// A closed simple polygon. Part k is the edge from corner k to corner k + 1.
#[derive(Debug, Clone)]
pub struct ClosedPolygon {
    border: Border,
}

impl ClosedPolygon {
    /// A polygon from its corners in either order around it, [length]; it need not be convex.
    ///
    /// # Errors
    /// [`ShapeError::ZeroEdge`]; [`ShapeError::Primitive`] if it has fewer than three corners, crosses or touches itself,
    /// or a coordinate is not finite.
    pub fn new(corners: Vec<[f64; 2]>) -> Result<Self, ShapeError> {
        Ok(Self::of(border::polygon(corners)?))
    }

    /// The tool with the shape of a polygon.
    pub fn of(polygon: Polygon) -> Self {
        ClosedPolygon { border: Border::new(polygon, |_| false) }
    }

    /// The polygon.
    pub fn polygon(&self) -> &Polygon {
        self.border.polygon()
    }
}

impl Shape<2> for ClosedPolygon {
    fn bounds(&self) -> Bounds<2> {
        self.border.bounds()
    }

    fn search(&self, x: &[f64; 2], limit: f64) -> Option<Closest<2>> {
        self.border.search(x, limit)
    }

    fn crossing(&self, path: &[[f64; 2]; 2]) -> Option<f64> {
        self.border.first(&around(path), |edge| meeting(path, edge))
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<2>>> {
        Some(self.polygon().facets(size))
    }
}

/// The place where a path meets an edge, as a fraction of the path; whether they meet is exact.
fn meeting(path @ [from, to]: &[[f64; 2]; 2], edge @ [a, b]: &[[f64; 2]; 2]) -> Option<f64> {
    if !segments_meet([from, to], [a, b]) {
        return None;
    }
    let normal = right_normal(edge);
    let [start, end] = path.map(|x| dot(&minus(&x, a), &normal));
    let fraction = if start == end {
        // The path runs along the edge.
        let way = minus(to, from);
        let ends = [a, b].map(|x| dot(&minus(x, from), &way) / dot(&way, &way));
        ends[0].min(ends[1])
    } else {
        start / (start - end)
    };
    Some(fraction.clamp(0.0, 1.0))
}
