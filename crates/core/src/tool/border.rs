//! The border of a polygon, also as the section (r, h) of a body of revolution.

use super::closest::{Closest, TOUCHING};
use super::error::ShapeError;
use super::features::Place;
use super::segments::{Segments, right_normal};
use super::shape::largest;
use crate::region::vector::{along, dot, norm};
use crate::region::{Bounds, Polygon, Primitive};

/// Below this sine, the side of a pseudonormal is left to the exact test: round-off could decide.
pub(super) const UNSURE: f64 = 1e-6;

/// The edges of a polygon; those on the axis are left out of a section.
#[derive(Debug, Clone)]
pub(super) struct Border {
    polygon: Polygon,
    edges: Segments,
    /// Number of each edge in the polygon.
    numbers: Vec<usize>,
    /// Sum of the outward unit normals of the two edges at both ends of each edge.
    pseudonormals: Vec<[[f64; 2]; 2]>,
    /// −1 if the corners are given clockwise, otherwise 1.
    orientation: f64,
}

/// A polygon from its corners, with edges of positive length.
pub(super) fn polygon(corners: Vec<[f64; 2]>) -> Result<Polygon, ShapeError> {
    let n = corners.len();
    if n > 2
        && let Some(edge) = (0..n).find(|&k| corners[k] == corners[(k + 1) % n])
    {
        return Err(ShapeError::ZeroEdge { edge });
    }
    Ok(Polygon::new(corners)?)
}

impl Border {
    /// The edges for which `is_axis` is false.
    pub(super) fn new(polygon: Polygon, is_axis: impl Fn(&[[f64; 2]; 2]) -> bool) -> Self {
        let corners = polygon.vertices();
        let n = corners.len();
        let ends: Vec<_> = (0..n).map(|k| [corners[k], corners[(k + 1) % n]]).collect();
        let orientation = if polygon.is_counterclockwise() { 1.0 } else { -1.0 };
        let outward = |k: usize| right_normal(&ends[k % n]).map(|x| orientation * x);
        // Beyond the axis follows the mirror image.
        let beside = |k: usize, other: usize| {
            let [r, h] = outward(k);
            if is_axis(&ends[other % n]) { [-r, h] } else { outward(other) }
        };
        let numbers: Vec<usize> = (0..n).filter(|&k| !is_axis(&ends[k])).collect();
        let sum = |k: usize, other: usize| along(&outward(k), 1.0, &beside(k, other));
        let pseudonormals = numbers.iter().map(|&k| [sum(k, k + n - 1), sum(k, k + 1)]).collect();
        let kept: Vec<_> = numbers.iter().map(|&k| ends[k]).collect();
        Border { edges: Segments::new(&kept), numbers, pseudonormals, orientation, polygon }
    }

    pub(super) fn polygon(&self) -> &Polygon {
        &self.polygon
    }

    pub(super) fn bounds(&self) -> Bounds<2> {
        self.edges.bounds()
    }

    /// The closest point; it may be missing if |gap| exceeds `limit`, [length]. Parts are numbers of edges.
    pub(super) fn search(&self, x: &[f64; 2], limit: f64) -> Option<Closest<2>> {
        let (feature, item, edge) = self.edges.nearest(x, limit).found?;
        let part = self.numbers[edge as usize];
        let normal = self.edges.normal(item).map(|x| self.orientation * x);
        let Place::Corner(end) = feature.place else {
            return Some(Closest::on_plane(x, dot(&feature.offset, &normal), normal, part));
        };
        let distance = norm(&feature.offset);
        if distance <= TOUCHING * largest(&self.edges.bounds()) {
            return Some(Closest::at_corner(x, normal, part));
        }
        let height = dot(&feature.offset, &self.pseudonormals[edge as usize][end]);
        let is_sure = height.abs() > UNSURE * distance;
        let outside = if is_sure { height > 0.0 } else { !self.polygon.contains(x) };
        Some(Closest::on_corner(x, &feature.offset, outside, None, part))
    }

    /// The smallest fraction that `meeting` finds among the edges whose boxes meet a box.
    pub(super) fn first(
        &self,
        bounds: &Bounds<2>,
        meeting: impl Fn(&[[f64; 2]; 2]) -> Option<f64>,
    ) -> Option<f64> {
        let mut first: Option<f64> = None;
        self.edges.each_near(bounds, 0.0, |edge| {
            if let Some(fraction) = meeting(edge) {
                first = Some(first.map_or(fraction, |first| first.min(fraction)));
            }
        });
        first
    }
}
