//! The closest point on a surface.

use std::cmp::Ordering;

use crate::region::vector::{along, dot, minus, norm, unit};

/// Distance from a point, relative to the largest coordinate of the bounding box, below which the direction away from
/// that point is only round-off, [-].
pub(super) const TOUCHING: f64 = 1e-14;

/// Difference between the distances from two faces, relative to the distance from their common corner, within which the
/// faces are equally near, [-].
pub(super) const EQUAL: f64 = 1e-9;
/// Length of a sum of unit normals below which the sum has no direction, and distance between unit normals below which
/// they are the same, [-].
const NO_DIRECTION: f64 = 1e-6;

/// The point on a surface that is closest to a position x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest<const D: usize> {
    /// Signed distance of x from the surface, [length]; negative inside.
    pub gap: f64,
    /// Outward unit normal n: the gradient of the gap.
    pub normal: [f64; D],
    /// The closest point, x − gap n, [length].
    pub point: [f64; D],
    /// Index of the part of the surface: the `side` of the facets that [`pieces`](super::Shape::pieces) returns.
    pub part: usize,
    /// Derivative ∂n/∂x, the Hessian of the gap, `[i][j]`, symmetric, [1/length]. Zero where the gap has a kink.
    pub normal_derivative: [[f64; D]; D],
}

impl<const D: usize> Closest<D> {
    /// A point on a flat part.
    pub(super) fn on_plane(x: &[f64; D], gap: f64, normal: [f64; D], part: usize) -> Self {
        Closest { gap, normal, point: along(x, -gap, &normal), part, normal_derivative: [[0.0; D]; D] }
    }

    /// A corner, or a point on an edge along the unit vector `edge`. `offset` = x − point must not be zero.
    pub(super) fn on_corner(
        x: &[f64; D],
        offset: &[f64; D],
        outside: bool,
        edge: Option<&[f64; D]>,
        part: usize,
    ) -> Self {
        let distance = norm(offset);
        let gap = if outside { distance } else { -distance };
        let normal = offset.map(|x| x / gap);
        let mut found = Closest { point: along(x, -1.0, offset), ..Self::on_plane(x, gap, normal, part) };
        for (i, j) in indices::<D>() {
            let e_e = edge.map_or(0.0, |e| e[i] * e[j]);
            found.normal_derivative[i][j] = (unit::<D>(i)[j] - normal[i] * normal[j] - e_e) / gap;
        }
        found
    }

    /// A corner or a point on an edge with which x coincides, up to round-off; `normal` is one of the normals there.
    pub(super) fn at_corner(x: &[f64; D], normal: [f64; D], part: usize) -> Self {
        Closest { point: *x, ..Self::on_plane(x, 0.0, normal, part) }
    }

    /// The closest point on the parallel surface at this distance outside.
    pub(super) fn offset(mut self, distance: f64) -> Self {
        self.gap -= distance;
        self.point = along(&self.point, distance, &self.normal);
        self
    }

    /// The same point in another frame: `rotation` converts the components of vectors from this frame to the other, and
    /// `to` converts positions.
    pub(super) fn turned(&self, rotation: &[[f64; D]; D], to: impl Fn(&[f64; D]) -> [f64; D]) -> Self {
        let mut derivative = [[0.0; D]; D];
        for (i, j) in indices::<D>() {
            let row: [f64; D] = std::array::from_fn(|k| dot(&rotation[j], &self.normal_derivative[k]));
            derivative[i][j] = dot(&rotation[i], &row);
        }
        Closest {
            normal: std::array::from_fn(|d| dot(&rotation[d], &self.normal)),
            point: to(&self.point),
            normal_derivative: derivative,
            ..*self
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        let numbers = self.normal.iter().chain(&self.point).chain(self.normal_derivative.as_flattened());
        self.gap.is_finite() && numbers.into_iter().all(|x| x.is_finite())
    }
}

/// The closest point in the section (r, h) of a body of revolution for a position on its axis. Inside a tip, all points
/// of a circle are equally close, so by symmetry the normal is along the axis. `touching` is round-off, [length].
pub(super) fn on_axis(
    x: &[f64; 2],
    touching: f64,
    search: impl Fn(&[f64; 2]) -> Option<Closest<2>>,
) -> Option<Closest<2>> {
    let found = search(x)?;
    let axial = found.normal[1];
    if found.gap > 0.0 || axial == 0.0 {
        return Some(found);
    }
    let along_axis = Closest::on_plane(x, found.gap / axial.abs(), [0.0, axial.signum()], found.part);
    // If this is not a tip, the closest part of the surface does not reach the axis.
    let is_tip = search(&along_axis.point).is_some_and(|tip| tip.gap.abs() <= 1e3 * touching);
    Some(if is_tip { along_axis } else { found })
}

/// The closest point between faces that are equally near to a position in or on a body: by symmetry, the normal is along
/// the middle of their normals, and the gap is measured in this direction. `found` lies on one of these faces, and
/// `others` are the outward unit normals of further ones. Neither the order of the faces nor their division matters.
pub(super) fn between_faces<const D: usize>(
    x: &[f64; D],
    found: &Closest<D>,
    others: &[[f64; D]],
) -> Closest<D> {
    let mut normals = vec![found.normal];
    for other in others {
        if normals.iter().all(|normal| norm(&along(other, -1.0, normal)) > NO_DIRECTION) {
            normals.push(*other);
        }
    }
    if normals.len() == 1 {
        return *found;
    }
    normals.sort_by(order);
    let sum = normals.iter().fold([0.0; D], |sum, normal| along(&sum, 1.0, normal));
    let size = norm(&sum);
    if size <= NO_DIRECTION {
        // Between opposite faces there is no middle: one of them is chosen, whatever their order.
        let last = normals.last().copied().unwrap_or(found.normal);
        return Closest::on_plane(x, found.gap, last, found.part);
    }
    let normal = sum.map(|n| n / size);
    Closest::on_plane(x, found.gap / dot(&normal, &found.normal).max(NO_DIRECTION), normal, found.part)
}

/// A flat face near a position.
#[derive(Debug, Clone, Copy)]
pub struct Face<const D: usize> {
    /// The closest point on the plane of the face.
    pub closest: Closest<D>,
    /// Distance of this point from the face, [length]: 0 if it lies on it.
    pub beside: f64,
    /// A position on the face away from its edges, [length].
    pub middle: [f64; D],
}

impl<const D: usize> Face<D> {
    /// True if each of two faces lies in front of the other.
    fn faces(&self, other: &Self) -> bool {
        let is_before =
            |a: &Self, b: &Self| dot(&minus(&b.middle, &a.closest.point), &a.closest.normal) > 0.0;
        is_before(self, other) && is_before(other, self)
    }
}

/// Cosine of the angle between normals above which two faces are too much alike for a body to touch both, [-].
const ALIKE: f64 = 0.87;

/// Of the faces near a position, those nearest ones that all face each other, as in a re-entrant corner, at most one for
/// each axis, in an order that does not depend on theirs; empty if there are fewer than two. `depth` is the depth of the
/// position below the surface, [length]: a position beside a face by no more than twice this counts as in front of it.
pub fn facing_each_other<const D: usize>(faces: &[Face<D>], depth: f64) -> Vec<Closest<D>> {
    let by_normal = |a: &Closest<D>, b: &Closest<D>| order(&a.normal, &b.normal);
    let is_before = |face: &&Face<D>| {
        face.beside <= 2.0 * depth + EQUAL * norm(&minus(&face.middle, &face.closest.point))
    };
    let mut fronts: Vec<&Face<D>> = faces.iter().filter(is_before).collect();
    fronts.sort_by(|a, b| {
        let [near, far] = [a, b].map(|front| front.closest.gap.abs());
        near.total_cmp(&far).then(by_normal(&a.closest, &b.closest))
    });
    let mut chosen: Vec<&Face<D>> = Vec::new();
    for front in fronts {
        let suits = |other: &&Face<D>| {
            dot(&front.closest.normal, &other.closest.normal) < ALIKE && front.faces(other)
        };
        if chosen.len() < D && chosen.iter().all(suits) {
            chosen.push(front);
        }
    }
    if chosen.len() < 2 {
        return Vec::new();
    }
    let mut found: Vec<Closest<D>> = chosen.into_iter().map(|front| front.closest).collect();
    found.sort_by(by_normal);
    found
}

/// The order of vectors by their components.
fn order<const D: usize>(a: &[f64; D], b: &[f64; D]) -> Ordering {
    a.iter().zip(b).map(|(a, b)| a.total_cmp(b)).find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
}

/// The pairs of indices of a matrix, row by row.
pub(super) fn indices<const D: usize>() -> impl Iterator<Item = (usize, usize)> {
    (0..D).flat_map(|i| (0..D).map(move |j| (i, j)))
}
