//! Polygons in the plane.

use robust::{Coord, orient2d};

use super::boundary::divide;
use super::vector::{dot, minus};
use super::{Curve, Facet, Intervals, Line, Primitive, ShapeError, finite, positive};

/// Largest number of corners for which the kinks that they cause in integrals are treated individually.
const MAX_CORNERS: usize = 64;

/// A simple polygon.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon {
    corners: Vec<[f64; 2]>,
}

impl Polygon {
    /// A closed polygon, given by its corners in clockwise or counterclockwise order, [length].
    ///
    /// # Errors
    /// [`ShapeError::Corners`], [`ShapeError::NotFinite`], [`ShapeError::SelfCrossing`]; [`ShapeError::NotPositive`] if
    /// its area is zero.
    pub fn new(corners: Vec<[f64; 2]>) -> Result<Self, ShapeError> {
        if corners.len() < 3 {
            return Err(ShapeError::Corners { corners: corners.len() });
        }
        for &corner in &corners {
            finite("a corner", corner)?;
        }
        if let Some(sides) = crossing_sides(&corners) {
            return Err(ShapeError::SelfCrossing { sides });
        }
        let polygon = Polygon { corners };
        positive("the area", polygon.volume())?;
        Ok(polygon)
    }

    /// The corners, [length].
    pub fn vertices(&self) -> &[[f64; 2]] {
        &self.corners
    }

    /// True if the corners are given counterclockwise.
    pub(crate) fn is_counterclockwise(&self) -> bool {
        self.signed_area() > 0.0
    }

    fn signed_area(&self) -> f64 {
        signed_area(&self.corners)
    }

    /// The polygon divided into triangles. A convex corner is cut off if the triangle that it forms with its two
    /// neighbours contains no other corner; this is repeated for the remaining polygon.
    pub(super) fn triangles(&self) -> Vec<[[f64; 2]; 3]> {
        let mut rest = self.corners.clone();
        if !self.is_counterclockwise() {
            rest.reverse();
        }
        let mut triangles = Vec::new();
        while rest.len() >= 3 {
            let n = rest.len();
            let around = |k: usize| [&rest[(k + n - 1) % n], &rest[k], &rest[(k + 1) % n]];
            let is_free = |k: usize| {
                let [a, b, c] = around(k);
                let inside =
                    |x: &[f64; 2]| turn(a, b, x) >= 0.0 && turn(b, c, x) >= 0.0 && turn(c, a, x) >= 0.0;
                turn(a, b, c) > 0.0 && !rest.iter().any(|x| ![a, b, c].contains(&x) && inside(x))
            };
            // A corner on a straight side adds no triangle.
            let is_straight = |k: usize| {
                let [a, b, c] = around(k);
                turn(a, b, c) == 0.0
            };
            let ear = (0..n).find(|&k| is_free(k)).or_else(|| (0..n).find(|&k| is_straight(k)));
            let Some(k) = ear else { break };
            let [a, b, c] = around(k).map(|x| *x);
            if turn(&a, &b, &c) > 0.0 {
                triangles.push([a, b, c]);
            }
            rest.remove(k);
        }
        triangles
    }

    fn sides(&self) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
        sides(&self.corners)
    }
}

impl Primitive<2> for Polygon {
    fn contains(&self, x: &[f64; 2]) -> bool {
        self.sides().filter(|(a, b)| passes_right_of(a, b, x)).count() % 2 == 1
    }

    fn extent(&self, direction: &[f64; 2]) -> [f64; 2] {
        extent_of(&self.corners, direction)
    }

    fn volume(&self) -> f64 {
        self.signed_area().abs()
    }

    fn intervals(&self, line: &Line<2>) -> Intervals {
        let Line { origin, direction } = line;
        let squared = dot(direction, direction);
        if squared == 0.0 {
            return if self.contains(origin) { Intervals::whole() } else { Intervals::default() };
        }
        // Coordinates across and along the line. Every corner lies on one side or the other, so crossings come in
        // pairs.
        let coordinates = |x: [f64; 2]| {
            let r = minus(&x, origin);
            (direction[0] * r[1] - direction[1] * r[0], dot(direction, &r) / squared)
        };
        let crossing = |(a, b): ([f64; 2], [f64; 2])| {
            let ((u, s), (v, t)) = (coordinates(a), coordinates(b));
            ((u > 0.0) != (v > 0.0)).then(|| s + (t - s) * (u / (u - v)))
        };
        Intervals::from_crossings(self.sides().filter_map(crossing).collect())
    }

    fn facets(&self, spacing: f64) -> Vec<Facet<2>> {
        let sides = self.sides().enumerate();
        sides.flat_map(|(side, (a, b))| divide(&a, &b, spacing, side)).collect()
    }

    fn curves(&self) -> Vec<Curve> {
        vec![Curve::Polygon(self.corners.clone())]
    }

    fn corners(&self) -> Vec<[f64; 2]> {
        if self.corners.len() <= MAX_CORNERS { self.corners.clone() } else { Vec::new() }
    }
}

/// The area inside a polygon, [length²]; negative if its corners are in clockwise order.
pub(crate) fn signed_area(corners: &[[f64; 2]]) -> f64 {
    let Some(about) = corners.first() else { return 0.0 };
    let twice = |(a, b): ([f64; 2], [f64; 2])| {
        let (a, b) = (minus(&a, about), minus(&b, about));
        a[0] * b[1] - a[1] * b[0]
    };
    0.5 * sides(corners).map(twice).sum::<f64>()
}

/// The sides of a closed polygon, each from its start to its end.
pub(super) fn sides(corners: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> + '_ {
    corners.iter().zip(corners.iter().cycle().skip(1)).map(|(a, b)| (*a, *b))
}

/// Minimum and maximum of x · `direction` over some positions.
pub(super) fn extent_of<const D: usize>(positions: &[[f64; D]], direction: &[f64; D]) -> [f64; 2] {
    positions
        .iter()
        .map(|x| dot(x, direction))
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
}

/// True if the side from `a` to `b` crosses the ray from `x` along the first axis.
///
/// A ray through a corner counts as passing just above the corner; a ray from a side counts as starting just to the
/// right of the side. The decision is exact and independent of the direction of the side, so that a position lies in
/// exactly one part of a divided polygon.
pub(super) fn passes_right_of(a: &[f64; 2], b: &[f64; 2], x: &[f64; 2]) -> bool {
    if (a[1] > x[1]) == (b[1] > x[1]) {
        return false;
    }
    let (low, high) = if a[1] < b[1] { (a, b) } else { (b, a) };
    turn(low, high, x) > 0.0
}

/// Positive if a, b, c are counterclockwise; the sign is exact.
pub(super) fn turn(a: &[f64; 2], b: &[f64; 2], c: &[f64; 2]) -> f64 {
    let at = |x: &[f64; 2]| Coord { x: x[0], y: x[1] };
    orient2d(at(a), at(b), at(c))
}

/// Finds two sides of a closed polygon that meet anywhere other than at the corner that neighbours share; returns the
/// indices of the first corners of these sides. The test is exact.
pub fn crossing_sides(x: &[[f64; 2]]) -> Option<[usize; 2]> {
    let n = x.len();
    let end = |k: usize| (k + 1) % n;
    let left = |k: usize| x[k][0].min(x[end(k)][0]);
    let right = |k: usize| x[k][0].max(x[end(k)][0]);
    let mut order: Vec<usize> = (0..n).collect();
    order.sort_by(|&a, &b| left(a).total_cmp(&left(b)));
    for (index, &a) in order.iter().enumerate() {
        for &b in order[index + 1..].iter().take_while(|&&b| left(b) <= right(a)) {
            let meet = if end(a) == b {
                folds(&x[a], &x[b], &x[end(b)])
            } else if end(b) == a {
                folds(&x[b], &x[a], &x[end(a)])
            } else {
                segments_meet([&x[a], &x[end(a)]], [&x[b], &x[end(b)]])
            };
            if meet {
                return Some([a.min(b), a.max(b)]);
            }
        }
    }
    None
}

/// True if the side from b to c folds back onto the side from a to b, or if one of them has zero length.
fn folds(a: &[f64; 2], b: &[f64; 2], c: &[f64; 2]) -> bool {
    a == b || b == c || (turn(a, b, c) == 0.0 && dot(&minus(b, a), &minus(c, b)) <= 0.0)
}

/// True if two segments have a common position; exact.
pub(crate) fn segments_meet([a, b]: [&[f64; 2]; 2], [c, d]: [&[f64; 2]; 2]) -> bool {
    let apart = |i: usize| a[i].max(b[i]) < c[i].min(d[i]) || c[i].max(d[i]) < a[i].min(b[i]);
    let sides = |p, q, r, s| opposite(turn(p, q, r), turn(p, q, s));
    !apart(0) && !apart(1) && sides(a, b, c, d) && sides(c, d, a, b)
}

/// True if two numbers have opposite signs or one is zero. Avoids their product, which may underflow.
pub(super) fn opposite(a: f64, b: f64) -> bool {
    !(a > 0.0 && b > 0.0 || a < 0.0 && b < 0.0)
}
