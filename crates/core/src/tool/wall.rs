//! Thin walls in the plane.

use std::f64::consts::{PI, TAU};

use super::closest::{Closest, TOUCHING};
use super::error::ShapeError;
use super::features::FeatureKind;
use super::segments::{Segments, right_normal};
use super::shape::{Shape, first_end, largest};
use crate::region::vector::{along, cross, dot, minus, norm};
use crate::region::{
    Ball, Bounds, Facet, Intervals, Line, Primitive, around, between, chords, divided, finite, positive,
};

/// A wall of constant thickness along an open polyline, with round ends and bends: all positions at most half the
/// thickness away from the polyline. The wall may cross itself. Part k is the segment from corner k to corner k + 1, on
/// both sides.
///
/// The gap is the distance from the polyline minus half the thickness; outside, this is the distance from the wall. At
/// a position inside the wall, where a path may end, the normal points to the side of the polyline on which the
/// position lies.
#[derive(Debug, Clone)]
pub struct Wall {
    corners: Vec<[f64; 2]>,
    radius: f64,
    segments: Segments,
}

impl Wall {
    /// A wall along a polyline with these corners and this thickness, [length].
    ///
    /// # Errors
    /// [`ShapeError::Corners`] for fewer than two corners, [`ShapeError::ZeroEdge`]; [`ShapeError::Primitive`] if a
    /// number is not finite or the thickness is not positive.
    pub fn new(corners: Vec<[f64; 2]>, thickness: f64) -> Result<Self, ShapeError> {
        if corners.len() < 2 {
            return Err(ShapeError::Corners { corners: corners.len() });
        }
        for &corner in &corners {
            finite("a corner", corner)?;
        }
        let radius = 0.5 * positive("the thickness", thickness)?;
        if let Some(edge) = (0..corners.len() - 1).find(|&k| corners[k] == corners[k + 1]) {
            return Err(ShapeError::ZeroEdge { edge });
        }
        let ends: Vec<_> = corners.windows(2).map(|ends| [ends[0], ends[1]]).collect();
        Ok(Wall { segments: Segments::new(&ends), corners, radius })
    }

    /// The intervals of a line that are no farther from a segment than half the thickness of the wall.
    fn intervals(&self, [a, b]: &[[f64; 2]; 2], line: &Line<2>) -> Intervals {
        let disc = |centre: &[f64; 2]| {
            Ball::new(*centre, self.radius).map(|ball| ball.intervals(line)).unwrap_or_default()
        };
        let (edge, from, normal) = (minus(b, a), minus(&line.origin, a), right_normal(&[*a, *b]));
        let beside = between(dot(&from, &normal), dot(&line.direction, &normal), -self.radius, self.radius);
        let level = between(dot(&from, &edge), dot(&line.direction, &edge), 0.0, dot(&edge, &edge));
        // The three parts overlap and their union is convex, so it is one interval, which round-off must not divide.
        let parts = [disc(a), disc(b), beside.intersection(&level)];
        let ends = parts.iter().flat_map(|part| part.as_slice().as_flattened());
        let [low, high] = ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(*x), b.max(*x)]);
        Intervals::one(low, high)
    }

    /// The arc around a corner: the direction of its middle and half of its opening angle, [rad].
    fn arc(&self, corner: usize) -> [f64; 2] {
        let direction = |k: usize| minus(&self.corners[k + 1], &self.corners[k]);
        let angle = |d: [f64; 2]| d[1].atan2(d[0]);
        if corner == 0 {
            return [angle(direction(0)) + PI, 0.5 * PI];
        }
        if corner == self.corners.len() - 1 {
            return [angle(direction(corner - 1)), 0.5 * PI];
        }
        // The outer side of the bend is to the right of a left turn.
        let (before, after) = (direction(corner - 1), direction(corner));
        let turn = cross_2d(&before, &after).atan2(dot(&before, &after));
        let to_outside = if turn > 0.0 { -0.5 * PI } else { 0.5 * PI };
        [angle(before) + 0.5 * turn + to_outside, 0.5 * turn.abs()]
    }

    /// The chords of the arc around a corner, with the midpoints of their arcs.
    fn chords_around(&self, corner: usize, size: f64) -> Vec<([f64; 2], Facet<2>)> {
        let [middle, half] = self.arc(corner);
        let n = ((chords(self.radius, size) as f64 * 2.0 * half / TAU - 1e-9).ceil() as usize).max(1);
        let at = |k: f64| {
            let (s, c) = (middle + half * (2.0 * k / n as f64 - 1.0)).sin_cos();
            along(&self.corners[corner], self.radius, &[c, s])
        };
        let side = corner.min(self.corners.len() - 2);
        let chord = |k: usize| {
            let k = k as f64;
            (at(k + 0.5), Facet { corners: [at(k), at(k + 1.0)], side })
        };
        if half > 0.0 { (0..n).map(chord).collect() } else { Vec::new() }
    }

    /// Length by which a side of a segment is cut at a corner, on the inner side of the bend.
    fn cut(&self, corner: usize, is_right: bool) -> f64 {
        if corner == 0 || corner == self.corners.len() - 1 {
            return 0.0;
        }
        let before = minus(&self.corners[corner], &self.corners[corner - 1]);
        let after = minus(&self.corners[corner + 1], &self.corners[corner]);
        let turn = cross_2d(&before, &after).atan2(dot(&before, &after));
        // If the inner sides do not meet, each ends within the other segment.
        let length = self.radius * (0.5 * turn.abs()).tan();
        let is_inner = (turn < 0.0) == is_right && turn != 0.0;
        if is_inner && length < norm(&before).min(norm(&after)) { length } else { 0.0 }
    }
}

impl Shape<2> for Wall {
    fn bounds(&self) -> Bounds<2> {
        let [low, high] = self.segments.bounds();
        [low.map(|x| x - self.radius), high.map(|x| x + self.radius)]
    }

    /// At a position on the polyline, the normal points to the right of the direction of the polyline.
    fn search(&self, x: &[f64; 2], limit: f64) -> Option<Closest<2>> {
        let (feature, item, part) = self.segments.nearest(x, limit + self.radius).found?;
        let (part, right) = (part as usize, self.segments.normal(item));
        let on_polyline = match feature.kind {
            FeatureKind::Face => {
                let height = dot(&feature.offset, &right);
                let side = if height < 0.0 { -1.0 } else { 1.0 };
                Closest::on_plane(x, side * height, right.map(|x| side * x), part)
            }
            _ if norm(&feature.offset) <= TOUCHING * largest(&self.segments.bounds()) => {
                Closest::at_corner(x, right, part)
            }
            _ => Closest::on_corner(x, &feature.offset, true, None, part),
        };
        Some(on_polyline.offset(self.radius))
    }

    fn crossing(&self, path: &[[f64; 2]; 2]) -> Option<f64> {
        let line = Line { origin: path[0], direction: minus(&path[1], &path[0]) };
        let mut inside = Intervals::default();
        self.segments.each_near(&around(path), self.radius, |item| {
            let segment = self.segments.ends(item);
            inside = inside.union(&self.intervals(segment, &line));
        });
        first_end(&inside)
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<2>>> {
        let mut pieces: Vec<([f64; 2], Facet<2>)> = Vec::new();
        for (k, ends) in self.corners.windows(2).enumerate() {
            let (edge, right) = (minus(&ends[1], &ends[0]), right_normal(&[ends[0], ends[1]]));
            let length = norm(&edge);
            for (is_right, side) in [(true, self.radius), (false, -self.radius)] {
                let [from, to] = [self.cut(k, is_right), length - self.cut(k + 1, is_right)]
                    .map(|t| along(&along(&ends[0], t / length, &edge), side, &right));
                // Together, the two cuts may be longer than a short segment.
                if dot(&minus(&to, &from), &edge) > 0.0 {
                    pieces.extend(divided(&[from, to], size, k).into_iter().map(|f| (f.centre(), f)));
                }
            }
        }
        pieces.extend((0..self.corners.len()).flat_map(|corner| self.chords_around(corner, size)));
        // A piece that lies within another part of the wall is not part of the surface.
        let is_surface =
            |x: &[f64; 2]| self.search(x, f64::INFINITY).is_some_and(|found| found.gap > -1e-9 * self.radius);
        Some(pieces.into_iter().filter(|(middle, _)| is_surface(middle)).map(|(_, facet)| facet).collect())
    }
}

fn cross_2d(a: &[f64; 2], b: &[f64; 2]) -> f64 {
    cross(&[a[0], a[1], 0.0], &[b[0], b[1], 0.0])[2]
}
