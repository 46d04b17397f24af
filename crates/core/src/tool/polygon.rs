//! Polygons as tools.

use super::border::{self, Border};
use super::closest::{Closest, Face};
use super::error::ShapeError;
use super::segments::right_normal;
use super::shape::Shape;
use crate::region::vector::{dot, minus};
use crate::region::{Bounds, Facet, Polygon, Primitive, around, segments_meet};

/// A closed simple polygon. Part k is the edge from corner k to corner k + 1; edges on an axis of revolution have no
/// surface.
#[derive(Debug, Clone)]
pub struct ClosedPolygon {
    border: Border,
    /// True for each edge on the axis of revolution.
    on_axis: Vec<bool>,
}

impl ClosedPolygon {
    /// A polygon from its corners, [length], listed clockwise or counterclockwise; it need not be convex.
    ///
    /// # Errors
    /// [`ShapeError::ZeroEdge`]; [`ShapeError::Primitive`] if it has fewer than three corners, crosses or touches
    /// itself, or a coordinate is not finite.
    pub fn new(corners: Vec<[f64; 2]>) -> Result<Self, ShapeError> {
        Ok(Self::from_polygon(border::polygon(corners)?))
    }

    /// The section of a body of revolution about the axis x = `axis`, [length]; beyond its edges on the axis lies the
    /// mirror image.
    ///
    /// # Errors
    /// As for [`ClosedPolygon::new`].
    pub fn section(corners: Vec<[f64; 2]>, axis: f64) -> Result<Self, ShapeError> {
        Ok(Self::beside(border::polygon(corners)?, |ends| ends.iter().all(|x| x[0] == axis)))
    }

    /// The tool with the shape of a polygon.
    pub fn from_polygon(polygon: Polygon) -> Self {
        Self::beside(polygon, |_| false)
    }

    fn beside(polygon: Polygon, is_axis: impl Fn(&[[f64; 2]; 2]) -> bool) -> Self {
        let corners = polygon.vertices();
        let ends = |k: usize| [corners[k], corners[(k + 1) % corners.len()]];
        let on_axis = (0..corners.len()).map(|k| is_axis(&ends(k))).collect();
        ClosedPolygon { border: Border::new(polygon, is_axis), on_axis }
    }

    /// The closest point, and the normal of a neighbouring face that is equally near to a position inside.
    pub(super) fn on_face(&self, x: &[f64; 2]) -> Option<(Closest<2>, Option<[f64; 2]>)> {
        self.border.on_face(x, f64::INFINITY)
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

    fn faces_near(&self, x: &[f64; 2], limit: f64) -> Vec<Face<2>> {
        self.border.faces_near(x, limit)
    }

    fn crossing(&self, path: &[[f64; 2]; 2]) -> Option<f64> {
        self.border.first(&around(path), |edge| meeting(path, edge))
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<2>>> {
        let mut facets = self.polygon().facets(size);
        facets.retain(|facet| !self.on_axis[facet.side]);
        Some(facets)
    }
}

/// The position where a path meets an edge, as a fraction of the path; the test of whether they meet is exact.
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
