//! The boundary of a polygon, which may also be the meridional section (r, h) of a body of revolution.

use super::closest::{Closest, TOUCHING};
use super::error::ShapeError;
use super::features::FeatureKind;
use super::segments::{Segments, right_normal};
use super::shape::largest;
use crate::region::vector::{along, dot, minus, norm};
use crate::region::{Bounds, Polygon, Primitive};

/// Sine of the angle between an offset and the plane normal to a pseudonormal, below which the exact test decides on
/// which side a position lies, because round-off could reverse the sign.
pub(super) const UNSURE: f64 = 1e-6;
/// Distance from a corner, relative to the length of an edge, within which the normal between two equally near faces is
/// along their bisector, [-].
const NEAR_CORNER: f64 = 1e-2;
/// Difference between the distances from two faces, relative to the distance from their corner, within which the faces
/// are equally near, [-].
const EQUAL: f64 = 1e-9;

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

/// The direction of the bisector of two unit normals with this sum; `None` if they are opposite.
fn middle(sum: &[f64; 2]) -> Option<[f64; 2]> {
    let size = norm(sum);
    (size > UNSURE).then(|| sum.map(|n| n / size))
}

/// The corner between two equally near faces of a polygon, for a position at or inside the corner: by symmetry, the
/// normal is along the bisector. `ends` are the ends of the edge on which the closest point was `found`.
fn between_faces(
    x: &[f64; 2],
    found: &Closest<2>,
    ends: &[[f64; 2]; 2],
    pseudonormals: &[[f64; 2]; 2],
    touching: f64,
) -> Option<Closest<2>> {
    if found.gap > 0.0 {
        return None;
    }
    let near = NEAR_CORNER * norm(&minus(&ends[1], &ends[0]));
    ends.iter().zip(pseudonormals).find_map(|(corner, sum)| {
        let from_corner = minus(x, corner);
        let (distance, other) = (norm(&from_corner), minus(sum, &found.normal));
        let is_tie = (dot(&from_corner, &other) - found.gap).abs() <= EQUAL * distance + touching;
        let normal = middle(sum).filter(|_| is_tie && distance <= near.max(touching))?;
        // The gap along the bisector; where both faces lie on one line, the gap stays as it is.
        Some(Closest::on_plane(x, found.gap / dot(&normal, &found.normal), normal, found.part))
    })
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
        let (feature, item, edge) = self.edges.nearest(x, limit).found?;
        let part = self.numbers[edge as usize];
        let normal = self.edges.normal(item).map(|x| self.orientation * x);
        let pseudonormals = &self.pseudonormals[edge as usize];
        let touching = TOUCHING * largest(&self.edges.bounds());
        let FeatureKind::Corner(end) = feature.kind else {
            let found = Closest::on_plane(x, dot(&feature.offset, &normal), normal, part);
            return between_faces(x, &found, self.edges.ends(item), pseudonormals, touching).or(Some(found));
        };
        let distance = norm(&feature.offset);
        if distance <= touching {
            return Some(Closest::at_corner(x, middle(&pseudonormals[end]).unwrap_or(normal), part));
        }
        let height = dot(&feature.offset, &pseudonormals[end]);
        let is_sure = height.abs() > UNSURE * distance;
        let outside = if is_sure { height > 0.0 } else { !self.polygon.contains(x) };
        Some(Closest::on_corner(x, &feature.offset, outside, None, part))
    }

    /// The smallest fraction that `meeting` finds among the edges whose bounding boxes meet a given box.
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
