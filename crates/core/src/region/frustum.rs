//! Cylinders and cones.

use std::f64::consts::PI;

use super::boundary::{chords, parts, quadrilaterals, sine_and_cosine_of_part};
use super::line::{between, not_positive};
use super::vector::{along, cross, dot, minus, norm, unit};
use super::{Facet, Intervals, Level, Levels, Line, Primitive, ShapeError, finite, positive};

/// A right circular cylinder, cone or truncated cone between two centres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frustum {
    start: [f64; 3],
    axis: [f64; 3], // unit vector
    height: f64,
    radii: [f64; 2],
}

impl Frustum {
    /// A frustum with these end centres and end radii, [length]; one radius may be zero (a cone).
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`]; [`ShapeError::NotPositive`] for the height, for a negative radius, or if both radii
    /// are zero.
    pub fn new(start: [f64; 3], end: [f64; 3], radii: [f64; 2]) -> Result<Self, ShapeError> {
        finite("the centre of an end", start)?;
        finite("the centre of an end", end)?;
        finite("the radius", radii)?;
        let axis = minus(&end, &start);
        let height = positive("the height", norm(&axis))?;
        positive("the radius", radii[0].max(radii[1]))?;
        if let Some(&value) = radii.iter().find(|r| **r < 0.0) {
            return Err(ShapeError::NotPositive { what: "the radius", value });
        }
        Ok(Frustum { start, axis: axis.map(|x| x / height), height, radii })
    }

    /// A cylinder with these end centres and this radius, [length].
    ///
    /// # Errors
    /// As [`Frustum::new`].
    pub fn cylinder(start: [f64; 3], end: [f64; 3], radius: f64) -> Result<Self, ShapeError> {
        Self::new(start, end, [radius; 2])
    }

    /// Slope of the radius along the axis, [-].
    fn slope(&self) -> f64 {
        (self.radii[1] - self.radii[0]) / self.height
    }

    /// The centre of the first end, [length].
    pub fn start(&self) -> [f64; 3] {
        self.start
    }

    /// The unit vector from the first end to the second.
    pub fn axis(&self) -> [f64; 3] {
        self.axis
    }

    /// The distance between the ends, [length].
    pub fn height(&self) -> f64 {
        self.height
    }

    /// The radii of the ends, [length].
    pub fn radii(&self) -> [f64; 2] {
        self.radii
    }

    /// Splits a position, relative to the start, into its axial coordinate and its radial vector.
    fn split(&self, x: &[f64; 3]) -> (f64, [f64; 3]) {
        let h = dot(x, &self.axis);
        (h, along(x, -h, &self.axis))
    }
}

impl Primitive<3> for Frustum {
    fn contains(&self, x: &[f64; 3]) -> bool {
        let (h, across) = self.split(&minus(x, &self.start));
        let radius = self.radii[0] + self.slope() * h;
        0.0 <= h && h <= self.height && dot(&across, &across) <= radius * radius
    }

    fn extent(&self, direction: &[f64; 3]) -> [f64; 2] {
        let (along_axis, across) = self.split(direction);
        let (foot, reach) = (dot(&self.start, direction), norm(&across));
        let top = foot + self.height * along_axis;
        let [a, b] = self.radii.map(|r| r * reach);
        [(foot - a).min(top - b), (foot + a).max(top + b)]
    }

    fn volume(&self) -> f64 {
        let [a, b] = self.radii;
        PI * self.height / 3.0 * (a * a + a * b + b * b)
    }

    fn intervals(&self, line: &Line<3>) -> Intervals {
        let (h, w) = self.split(&minus(&line.origin, &self.start));
        let (dh, dw) = self.split(&line.direction);
        let slope = self.slope();
        let (r, dr) = (self.radii[0] + slope * h, slope * dh);
        let inside = not_positive(dot(&dw, &dw) - dr * dr, dot(&w, &dw) - r * dr, dot(&w, &w) - r * r);
        // The slab excludes one nappe of the double cone.
        inside.intersection(&between(h, dh, 0.0, self.height))
    }

    fn facets(&self, spacing: f64) -> Vec<Facet<3>> {
        let widest = self.radii[0].max(self.radii[1]);
        let slant = self.height.hypot(self.radii[1] - self.radii[0]);
        let across = spacing / 2f64.sqrt();
        let (around, up) = (chords(widest, across), parts(slant, across));
        let at = around_axis(self.start, self.axis, around);
        let lateral = |i: usize, j: usize| {
            let height = self.height * j as f64 / up as f64;
            at(i, height, self.radii[0] + self.slope() * height)
        };
        let mut facets = quadrilaterals(around, up, &lateral, 0);
        for (end, height) in [0.0, self.height].into_iter().enumerate() {
            let rings = parts(self.radii[end], across);
            let radius = |j: usize| self.radii[end] * j as f64 / rings as f64;
            facets.extend(quadrilaterals(around, rings, &|i, j| at(i, height, radius(j)), end + 1));
        }
        facets
    }

    fn levels(&self) -> Levels {
        let [start, end] = [0.0, self.height].map(|height| along(&self.start, height, &self.axis));
        let plane = |point| Level::Plane { point, normal: self.axis };
        let side = Level::Cone { start, axis: self.axis, radius: self.radii[0], slope: self.slope() };
        Levels::Curved(vec![side, plane(start), plane(end)])
    }

    fn is_convex(&self) -> bool {
        true
    }
}

/// Positions around an axis, which is given by its start and unit vector. A position is given by its number among the
/// `around` positions of a full turn, its height along the axis and its radius, [length].
pub(crate) fn around_axis(
    start: [f64; 3],
    axis: [f64; 3],
    around: usize,
) -> impl Fn(usize, f64, f64) -> [f64; 3] {
    let least = (0..3).min_by(|&a, &b| axis[a].abs().total_cmp(&axis[b].abs())).unwrap_or(0);
    let first = cross(&axis, &unit(least));
    let first = first.map(|x| x / norm(&first));
    let second = cross(&axis, &first);
    move |turn, height, radius| {
        let [s, c] = sine_and_cosine_of_part(turn % around, around);
        let foot = along(&start, height, &axis);
        along(&along(&foot, radius * c, &first), radius * s, &second)
    }
}
