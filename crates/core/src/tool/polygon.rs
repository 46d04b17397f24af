//! Polygons as tools.

use super::closest::{Closest, TOUCHING};
use super::error::ShapeError;
use super::features::Place;
use super::segments::{Segments, right_normal};
use super::shape::{Shape, largest};
use crate::region::vector::{along, dot, minus, norm};
use crate::region::{Bounds, Facet, Polygon, Primitive, segments_meet};

/// Below this sine, the side of a pseudonormal is left to the exact test: round-off could decide.
pub(super) const UNSURE: f64 = 1e-6;

/// A closed simple polygon. Part k is the edge from corner k to corner k + 1.
#[derive(Debug, Clone)]
pub struct ClosedPolygon {
    polygon: Polygon,
    edges: Segments,
    /// Sum of the outward unit normals of the two edges at each corner.
    pseudonormals: Vec<[f64; 2]>,
    /// −1 if the corners are given clockwise, otherwise 1.
    orientation: f64,
}

impl ClosedPolygon {
    /// A polygon from its corners in either order around it, [length]; it need not be convex.
    ///
    /// # Errors
    /// [`ShapeError::ZeroEdge`]; [`ShapeError::Primitive`] if it has fewer than three corners, crosses or touches itself,
    /// or a coordinate is not finite.
    pub fn new(corners: Vec<[f64; 2]>) -> Result<Self, ShapeError> {
        let n = corners.len();
        if n > 2
            && let Some(edge) = (0..n).find(|&k| corners[k] == corners[(k + 1) % n])
        {
            return Err(ShapeError::ZeroEdge { edge });
        }
        Ok(Self::of(Polygon::new(corners)?))
    }

    /// The tool with the shape of a polygon.
    pub fn of(polygon: Polygon) -> Self {
        let corners = polygon.vertices();
        let n = corners.len();
        let ends: Vec<_> = (0..n).map(|k| [corners[k], corners[(k + 1) % n]]).collect();
        let orientation = if polygon.is_counterclockwise() { 1.0 } else { -1.0 };
        let outward = |k: usize| right_normal(&ends[k % n]).map(|x| orientation * x);
        let pseudonormals = (0..n).map(|k| along(&outward(k), 1.0, &outward(k + n - 1))).collect();
        ClosedPolygon { edges: Segments::new(&ends), pseudonormals, orientation, polygon }
    }

    /// The polygon.
    pub fn polygon(&self) -> &Polygon {
        &self.polygon
    }
}

impl Shape<2> for ClosedPolygon {
    fn bounds(&self) -> Bounds<2> {
        self.edges.bounds()
    }

    fn search(&self, x: &[f64; 2], limit: f64) -> Option<Closest<2>> {
        let (feature, item, edge) = self.edges.nearest(x, limit).found?;
        let (part, normal) = (edge as usize, self.edges.normal(item).map(|x| self.orientation * x));
        let Place::Corner(end) = feature.place else {
            return Some(Closest::on_plane(x, dot(&feature.offset, &normal), normal, part));
        };
        let distance = norm(&feature.offset);
        if distance <= TOUCHING * largest(&self.edges.bounds()) {
            return Some(Closest::at_corner(x, normal, part));
        }
        let pseudonormal = self.pseudonormals[(part + end) % self.pseudonormals.len()];
        let height = dot(&feature.offset, &pseudonormal);
        let is_sure = height.abs() > UNSURE * distance;
        let outside = if is_sure { height > 0.0 } else { !self.polygon.contains(x) };
        Some(Closest::on_corner(x, &feature.offset, outside, None, part))
    }

    fn crossing(&self, path: &[[f64; 2]; 2]) -> Option<f64> {
        let mut first: Option<f64> = None;
        self.edges.each_near(path, 0.0, |edge| {
            if let Some(fraction) = meeting(path, edge) {
                first = Some(first.map_or(fraction, |first| first.min(fraction)));
            }
        });
        first
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<2>>> {
        Some(self.polygon.facets(size))
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
