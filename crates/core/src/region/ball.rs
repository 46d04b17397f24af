//! Circles and spheres, full and hollow.

use std::f64::consts::{FRAC_PI_2, PI};

use super::boundary::{circle, triangle};
use super::line::not_positive;
use super::vector::{along, dot, minus, norm, unit};
use super::{Curve, Facet, Intervals, Level, Levels, Line, Primitive, ShapeError, finite, positive};

/// A ball: a disc (D = 2) or a solid sphere (D = 3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball<const D: usize> {
    center: [f64; D],
    radius: f64,
}

impl<const D: usize> Ball<D> {
    /// A ball with this centre and radius, [length].
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`]; [`ShapeError::NotPositive`] for the radius.
    pub fn new(center: [f64; D], radius: f64) -> Result<Self, ShapeError> {
        Ok(Ball { center: finite("the centre", center)?, radius: positive("the radius", radius)? })
    }

    /// The centre, [length].
    pub fn center(&self) -> [f64; D] {
        self.center
    }

    /// The radius, [length].
    pub fn radius(&self) -> f64 {
        self.radius
    }
}

impl<const D: usize> Ball<D> {
    /// The sphere, in space.
    fn level(&self) -> Level {
        Level::Sphere { center: std::array::from_fn(|d| self.center[d % D]), radius: self.radius }
    }

    /// The facets of an octahedron, divided evenly and moved outwards onto the sphere.
    fn octants(&self, spacing: f64) -> Vec<Facet<D>> {
        // The edges of an octant are quarter circles; the edges of the octahedron are √2 times the radius.
        let fraction = (spacing / (FRAC_PI_2 * self.radius)).min(0.25);
        let mut facets = Vec::new();
        for signs in (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|bit| 1.0 - 2.0 * bit as f64)) {
            let tips: [[f64; D]; 3] = std::array::from_fn(|d| unit::<D>(d).map(|x| x * signs[d]));
            let [a, b, c] = &tips;
            facets.extend(triangle([a, b, c], fraction * 2f64.sqrt(), 0));
        }
        let onto = |x: [f64; D]| along(&self.center, self.radius / norm(&x), &x);
        facets.iter_mut().for_each(|facet: &mut Facet<D>| facet.corners = facet.corners.map(onto));
        facets
    }
}

impl<const D: usize> Primitive<D> for Ball<D> {
    fn contains(&self, x: &[f64; D]) -> bool {
        let r = minus(x, &self.center);
        dot(&r, &r) <= self.radius * self.radius
    }

    fn extent(&self, direction: &[f64; D]) -> [f64; 2] {
        let (middle, reach) = (dot(&self.center, direction), self.radius * norm(direction));
        [middle - reach, middle + reach]
    }

    fn volume(&self) -> f64 {
        let r = self.radius;
        // π r² (D = 2), 4/3 π r³ (D = 3), and 2 r for an interval (D = 1).
        match D {
            1 => 2.0 * r,
            2 => PI * r * r,
            _ => 4.0 / 3.0 * PI * r * r * r,
        }
    }

    fn intervals(&self, line: &Line<D>) -> Intervals {
        let r = minus(&line.origin, &self.center);
        let a = dot(&line.direction, &line.direction);
        not_positive(a, dot(&r, &line.direction), dot(&r, &r) - self.radius * self.radius)
    }

    fn facets(&self, spacing: f64) -> Vec<Facet<D>> {
        if D == 2 { circle(&self.center, self.radius, spacing, 0) } else { self.octants(spacing) }
    }

    fn curves(&self) -> Vec<Curve> {
        let center = [0, 1].map(|d| self.center[d % D]);
        if D == 2 { vec![Curve::Circle { center, radius: self.radius }] } else { Vec::new() }
    }

    fn levels(&self) -> Levels {
        Levels::Curved(vec![self.level()])
    }

    fn is_convex(&self) -> bool {
        true
    }
}

/// The space between two concentric balls: an annulus (D = 2) or a hollow sphere (D = 3).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HollowBall<const D: usize> {
    outer: Ball<D>,
    inner: Ball<D>,
}

impl<const D: usize> HollowBall<D> {
    /// A hollow ball with this centre, inner and outer radius, [length].
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`]; [`ShapeError::NotPositive`] for the inner radius or the thickness.
    pub fn new(center: [f64; D], inner: f64, outer: f64) -> Result<Self, ShapeError> {
        positive("the thickness", outer - inner)?;
        Ok(HollowBall { outer: Ball::new(center, outer)?, inner: Ball::new(center, inner)? })
    }
}

impl<const D: usize> Primitive<D> for HollowBall<D> {
    fn contains(&self, x: &[f64; D]) -> bool {
        let r = minus(x, &self.inner.center);
        self.outer.contains(x) && dot(&r, &r) >= self.inner.radius * self.inner.radius
    }

    fn extent(&self, direction: &[f64; D]) -> [f64; 2] {
        self.outer.extent(direction)
    }

    fn volume(&self) -> f64 {
        self.outer.volume() - self.inner.volume()
    }

    fn intervals(&self, line: &Line<D>) -> Intervals {
        self.outer.intervals(line).minus(&self.inner.intervals(line))
    }

    fn facets(&self, spacing: f64) -> Vec<Facet<D>> {
        let inner = self.inner.facets(spacing).into_iter().map(|facet| Facet { side: 1, ..facet });
        self.outer.facets(spacing).into_iter().chain(inner).collect()
    }

    fn levels(&self) -> Levels {
        Levels::Curved(vec![self.outer.level(), self.inner.level()])
    }

    fn curves(&self) -> Vec<Curve> {
        [self.outer.curves(), self.inner.curves()].concat()
    }
}
