//! Bodies of revolution.

use super::border::{self, Border};
use super::closest::{Closest, TOUCHING, indices, on_axis};
use super::error::ShapeError;
use super::segments::right_normal;
use super::shape::{Shape, largest};
use crate::region::vector::{along, dot, frame, minus, norm, unit};
use crate::region::{
    Bounds, Facet, Polygon, around, around_axis, chords, finite, hull, parts, positive, quadrilaterals,
};

/// Tolerance at the ends of an edge, relative to its length, so that no path slips through between two edges.
const END: f64 = 1e-9;

/// A body of revolution. Part k is swept by the edge from corner k to corner k + 1 of the section; edges on the axis
/// have no surface.
#[derive(Debug, Clone)]
pub struct Revolution {
    axis: Axis,
    section: Border,
    bounds: Bounds<3>,
}

/// The axis of a body of revolution.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pub(super) start: [f64; 3],
    /// Unit vector.
    pub(super) direction: [f64; 3],
}

impl Axis {
    /// Splits a position into its height along the axis and the vector from the axis.
    fn split(&self, x: &[f64; 3]) -> (f64, [f64; 3]) {
        let from_start = minus(x, &self.start);
        let height = dot(&from_start, &self.direction);
        (height, along(&from_start, -height, &self.direction))
    }

    /// The position (r, h) in the section.
    fn in_section(&self, x: &[f64; 3]) -> [f64; 2] {
        let (height, across) = self.split(x);
        [norm(&across), height]
    }

    /// Bounding box of the disc with this radius at this height.
    pub(super) fn disc(&self, [r, h]: &[f64; 2]) -> Bounds<3> {
        let centre = along(&self.start, *h, &self.direction);
        let reach = self.direction.map(|a| r * (1.0 - a * a).max(0.0).sqrt());
        [minus(&centre, &reach), along(&centre, 1.0, &reach)]
    }

    /// The closest point on a body of revolution, in the half-plane through the axis and x, from the closest point on
    /// its section. Within `touching` of the axis, [length], x has no radial direction.
    pub(super) fn closest(
        &self,
        x: &[f64; 3],
        touching: f64,
        on_section: impl Fn(&[f64; 2]) -> Option<Closest<2>>,
    ) -> Option<Closest<3>> {
        let (height, across) = self.split(x);
        let radius = norm(&across);
        let outwards = if radius > touching { across.map(|x| x / radius) } else { frame(&self.direction)[0] };
        let section = [radius, height];
        let found =
            if radius > touching { on_section(&section) } else { on_axis(&section, touching, on_section) }?;
        let in_space = |[r, h]: [f64; 2]| along(&outwards.map(|e| r * e), h, &self.direction);
        // The circles around the axis have the curvature n_r / r; near the axis, n_r = r ∂n_r/∂r.
        let [[rr, rh], [_, hh]] = found.normal_derivative;
        let hoop = if radius > touching { found.normal[0] / radius } else { rr };
        let mut normal_derivative = [[0.0; 3]; 3];
        for (i, j) in indices::<3>() {
            let ([e, a], [f, b]) = ([outwards[i], self.direction[i]], [outwards[j], self.direction[j]]);
            let around = unit::<3>(i)[j] - e * f - a * b;
            normal_derivative[i][j] = rr * e * f + rh * (e * b + a * f) + hh * a * b + hoop * around;
        }
        Some(Closest {
            gap: found.gap,
            normal: in_space(found.normal),
            point: along(&in_space(found.point), 1.0, &self.start),
            part: found.part,
            normal_derivative,
        })
    }
}

impl Revolution {
    /// The body that a closed section sweeps around the axis from `start`, [length], along `direction`, a vector of any
    /// length. The corners of the section are (r, h): radius and height along the axis from `start`, r ≥ 0, listed
    /// clockwise or counterclockwise.
    ///
    /// # Errors
    /// As for [`ClosedPolygon::new`](super::ClosedPolygon::new) for the section; [`ShapeError::NegativeRadius`];
    /// [`ShapeError::Primitive`] if the direction is zero or a number is not finite.
    pub fn new(start: [f64; 3], direction: [f64; 3], section: Vec<[f64; 2]>) -> Result<Self, ShapeError> {
        let start = finite("the start of the axis", start)?;
        let largest =
            finite("the direction of the axis", direction)?.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let largest = positive("the length of the direction", largest)?;
        let direction = direction.map(|x| x / largest);
        let length = norm(&direction);
        let direction = direction.map(|x| x / length);
        if let Some(corner) = section.iter().position(|x| x[0] < 0.0) {
            return Err(ShapeError::NegativeRadius { corner, radius: section[corner][0] });
        }
        let section = Border::new(border::polygon(section)?, |ends| ends.iter().all(|x| x[0] == 0.0));
        let axis = Axis { start, direction };
        let corners = section.polygon().vertices();
        let bounds = corners.iter().map(|x| axis.disc(x)).fold(axis.disc(&corners[0]), hull);
        Ok(Revolution { axis, section, bounds })
    }

    /// The section (r, h).
    pub fn section(&self) -> &Polygon {
        self.section.polygon()
    }

    /// The position where a path meets the surface swept by an edge, as a fraction of the path.
    ///
    /// Along the path, the distance from the line of the edge in the plane (r, h) is convex or concave, because r is
    /// convex. The distance therefore has at most one zero between its extremum and either end.
    fn meeting(&self, path: &[[f64; 3]; 2], edge: &[[f64; 2]; 2]) -> Option<f64> {
        let (normal, side) = (right_normal(edge), minus(&edge[1], &edge[0]));
        let way = minus(&path[1], &path[0]);
        let at = |t: f64| minus(&self.axis.in_section(&along(&path[0], t, &way)), &edge[0]);
        let distance = |t: f64| dot(&at(t), &normal);
        let is_on_edge = |t: f64| {
            let along_edge = dot(&at(t), &side) / dot(&side, &side);
            (-END..=1.0 + END).contains(&along_edge)
        };
        let middle = self.extremum(path, &normal).unwrap_or(0.0);
        [[0.0, middle], [middle, 1.0]]
            .iter()
            .filter_map(|ends| zero_between(&distance, *ends))
            .find(|&t| is_on_edge(t))
    }

    /// The fraction of a path at which n · (r, h) has an extremum, if it lies on the path.
    fn extremum(&self, path: &[[f64; 3]; 2], normal: &[f64; 2]) -> Option<f64> {
        let ((h, w), (end, v)) = (self.axis.split(&path[0]), self.axis.split(&path[1]));
        let (rise, v) = (end - h, minus(&v, &w));
        // With the closest approach r_c to the axis at t_c: r² = r_c² + |v|² (t − t_c)². At the extremum,
        // dr/dt = −n_h rise / n_r.
        let speed = norm(&v);
        let t_c = -dot(&w, &v) / (speed * speed);
        let (r_c, slope) = (norm(&along(&w, t_c, &v)), -normal[1] * rise / normal[0]);
        let t = t_c + slope * r_c / (speed * (speed * speed - slope * slope).sqrt());
        // Without an extremum, t is NaN or infinite and lies in no interval.
        (0.0..=1.0).contains(&t).then_some(t)
    }
}

/// The zero of a monotone function on an interval, by bisection.
fn zero_between(f: &impl Fn(f64) -> f64, [mut low, mut high]: [f64; 2]) -> Option<f64> {
    let (at_low, at_high) = (f(low), f(high));
    if at_low == 0.0 {
        return Some(low);
    }
    if at_high == 0.0 {
        return Some(high);
    }
    if (at_low > 0.0) == (at_high > 0.0) {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if (f(middle) > 0.0) == (at_low > 0.0) { low = middle } else { high = middle }
    }
    Some(high)
}

impl Shape<3> for Revolution {
    fn bounds(&self) -> Bounds<3> {
        self.bounds
    }

    fn search(&self, x: &[f64; 3], limit: f64) -> Option<Closest<3>> {
        let touching = TOUCHING * largest(&self.bounds);
        self.axis.closest(x, touching, |section| self.section.search(section, limit))
    }

    fn crossing(&self, path: &[[f64; 3]; 2]) -> Option<f64> {
        let ends = path.map(|x| self.axis.in_section(&x));
        let mut bounds = around(&ends);
        // Between its ends the path may come closer to the axis; the radius changes by at most the length of the path.
        let length = norm(&minus(&path[1], &path[0]));
        bounds[0][0] = (0.5 * (ends[0][0] + ends[1][0] - length)).clamp(0.0, bounds[0][0]);
        self.section.first(&bounds, |edge| self.meeting(path, edge))
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<3>>> {
        // The diagonal of a piece is at most `size` long.
        let size = size / 2f64.sqrt();
        let corners = self.section().vertices();
        let n = chords(self.section.bounds()[1][0], size);
        let at = around_axis(self.axis.start, self.axis.direction, n);
        let mut pieces = Vec::new();
        for (side, a) in corners.iter().enumerate() {
            let b = corners[(side + 1) % corners.len()];
            let edge = minus(&b, a);
            let up = parts(norm(&edge), size);
            let place = |i: usize, j: usize| {
                let [r, h] = if j == up { b } else { along(a, j as f64 / up as f64, &edge) };
                at(i, h, r)
            };
            if a[0] != 0.0 || b[0] != 0.0 {
                pieces.extend(quadrilaterals(n, up, &place, side));
            }
        }
        Some(pieces)
    }
}
