//! The closest point on a surface.

use crate::region::vector::{along, dot, norm, unit};

/// Distance from a point, relative to the largest coordinate of the bounding box, below which the direction away from
/// that point is only round-off, [-].
pub(super) const TOUCHING: f64 = 1e-14;

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

/// The pairs of indices of a matrix, row by row.
pub(super) fn indices<const D: usize>() -> impl Iterator<Item = (usize, usize)> {
    (0..D).flat_map(|i| (0..D).map(move |j| (i, j)))
}
