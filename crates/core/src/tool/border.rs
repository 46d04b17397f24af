//! The boundary of a polygon, which may also be the meridional section (r, h) of a body of revolution.

use super::closest::{Closest, EQUAL, Face, TOUCHING, between_faces};
use super::error::ShapeError;
use super::features::FeatureKind;
use super::segments::{Segments, right_normal};
use super::shape::largest;
use crate::region::vector::{along, dot, minus, norm};
use crate::region::{Bounds, Polygon, Primitive};

/// Sine of the angle between an offset and the plane normal to a pseudonormal, below which the exact test decides on
/// which side a position lies, because round-off could reverse the sign.
pub(super) const UNSURE: f64 = 1e-6;
/// The edges of a polygon; for a meridional section, without the edges on the axis.
#[derive(Debug, Clone)]
pub(super) struct Border {
    polygon: Polygon,
    edges: Segments,
    /// Number of each edge in the polygon.
    numbers: Vec<usize>,
    /// For both ends of each edge, the sum of the outward unit normals of the two edges that meet there.
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
    /// The border of a polygon, without the edges for which `is_axis` is true.
    pub(super) fn new(polygon: Polygon, is_axis: impl Fn(&[[f64; 2]; 2]) -> bool) -> Self {
        let corners = polygon.vertices();
        let n = corners.len();
        let ends: Vec<_> = (0..n).map(|k| [corners[k], corners[(k + 1) % n]]).collect();
        let orientation = if polygon.is_counterclockwise() { 1.0 } else { -1.0 };
        let outward = |k: usize| right_normal(&ends[k % n]).map(|x| orientation * x);
        // Beyond the axis lies the mirror image.
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

    /// The closest point, which may be missing if |gap| exceeds `limit`, [length]. Parts are edge numbers.
    pub(super) fn search(&self, x: &[f64; 2], limit: f64) -> Option<Closest<2>> {
        let (found, other) = self.on_face(x, limit)?;
        Some(other.map_or(found, |other| between_faces(x, &found, &[other])))
    }

    /// The closest point, and the normal of a neighbouring face that is equally near to a position inside.
    pub(super) fn on_face(&self, x: &[f64; 2], limit: f64) -> Option<(Closest<2>, Option<[f64; 2]>)> {
        let (feature, item, edge) = self.edges.nearest(x, limit).found?;
        let part = self.numbers[edge as usize];
        let normal = self.edges.normal(item).map(|x| self.orientation * x);
        let pseudonormals = &self.pseudonormals[edge as usize];
        let touching = TOUCHING * largest(&self.edges.bounds());
        let FeatureKind::Corner(end) = feature.kind else {
            let found = Closest::on_plane(x, dot(&feature.offset, &normal), normal, part);
            let is_equally_near = |(corner, sum): &(&[f64; 2], &[f64; 2])| {
                let (from_corner, other) = (minus(x, corner), minus(sum, &normal));
                let difference = dot(&from_corner, &other) - found.gap;
                found.gap <= touching && difference.abs() <= EQUAL * norm(&from_corner) + touching
            };
            let mut corners = self.edges.ends(item).iter().zip(pseudonormals);
            return Some((found, corners.find(is_equally_near).map(|(_, sum)| minus(sum, &normal))));
        };
        let distance = norm(&feature.offset);
        if distance <= touching {
            let other = minus(&pseudonormals[end], &normal);
            return Some((Closest::at_corner(x, normal, part), Some(other)));
        }
        let height = dot(&feature.offset, &pseudonormals[end]);
        let is_sure = height.abs() > UNSURE * distance;
        let outside = if is_sure { height > 0.0 } else { !self.polygon.contains(x) };
        Some((Closest::on_corner(x, &feature.offset, outside, None, part), None))
    }

    /// The faces near a position, as [`Shape::faces_near`](super::Shape::faces_near).
    pub(super) fn faces_near(&self, x: &[f64; 2], limit: f64) -> Vec<Face<2>> {
        let mut faces = Vec::new();
        self.edges.each_near(&[*x, *x], 2.0 * limit, |item| {
            let [a, b] = self.edges.ends(item);
            let normal = self.edges.normal(item).map(|x| self.orientation * x);
            let (edge, from) = (minus(b, a), minus(x, a));
            let (gap, length) = (dot(&from, &normal), norm(&edge));
            let along_edge = dot(&from, &edge) / length;
            let beside = (-along_edge).max(along_edge - length).max(0.0);
            if gap.abs() <= limit && beside <= limit {
                let part = self.numbers[self.edges.number(item)];
                let closest = Closest::on_plane(x, gap, normal, part);
                faces.push(Face { closest, beside, middle: along(a, 0.5, &edge) });
            }
        });
        faces
    }

    /// The smallest fraction that `meeting` finds among the edges whose bounding boxes meet a given box.
    pub(super) fn first(
        &self,
        bounds: &Bounds<2>,
        meeting: impl Fn(&[[f64; 2]; 2]) -> Option<f64>,
    ) -> Option<f64> {
        let mut first: Option<f64> = None;
        self.edges.each_near(bounds, 0.0, |item| {
            if let Some(fraction) = meeting(self.edges.ends(item)) {
                first = Some(first.map_or(fraction, |first| first.min(fraction)));
            }
        });
        first
    }
}
