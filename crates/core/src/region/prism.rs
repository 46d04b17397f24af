//! Polygons extruded along an axis.

use super::boundary::{parallelogram, triangle};
use super::vector::minus;
use super::{Facet, Intervals, Levels, Line, Polygon, Primitive, ShapeError, finite, positive};

/// A polygon extruded along an axis between two heights.
#[derive(Debug, Clone, PartialEq)]
pub struct Prism {
    base: Polygon,
    axis: usize,
    heights: [f64; 2],
}

impl Prism {
    /// A prism with base `base`, extruded along `axis` (0 to 2) between two heights, [length]. The base is given in the
    /// other two coordinates in ascending order: (y, z), (x, z) or (x, y).
    ///
    /// # Errors
    /// [`ShapeError::NoAxis`], [`ShapeError::NotFinite`]; [`ShapeError::NotPositive`] for the height.
    pub fn new(base: Polygon, axis: usize, heights: [f64; 2]) -> Result<Self, ShapeError> {
        if axis > 2 {
            return Err(ShapeError::NoAxis { axis });
        }
        finite("the end of the extrusion", heights)?;
        positive("the height of the extrusion", heights[1] - heights[0])?;
        Ok(Prism { base, axis, heights })
    }

    /// The base.
    pub fn base(&self) -> &Polygon {
        &self.base
    }

    /// The lower and the upper end along the axis, [length].
    pub fn heights(&self) -> [f64; 2] {
        self.heights
    }

    /// The index of the axis, from 0.
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// The coordinates of a position in the plane of the base.
    pub(crate) fn across(&self, x: &[f64; 3]) -> [f64; 2] {
        match self.axis {
            0 => [x[1], x[2]],
            1 => [x[0], x[2]],
            _ => [x[0], x[1]],
        }
    }

    /// The position with these coordinates in the plane of the base and this height.
    pub(crate) fn at(&self, [a, b]: [f64; 2], height: f64) -> [f64; 3] {
        match self.axis {
            0 => [height, a, b],
            1 => [a, height, b],
            _ => [a, b, height],
        }
    }
}

impl Primitive<3> for Prism {
    fn contains(&self, x: &[f64; 3]) -> bool {
        let h = x[self.axis];
        self.heights[0] <= h && h <= self.heights[1] && self.base.contains(&self.across(x))
    }

    fn extent(&self, direction: &[f64; 3]) -> [f64; 2] {
        let [low, high] = self.base.extent(&self.across(direction));
        let [a, b] = self.heights.map(|h| h * direction[self.axis]);
        [low + a.min(b), high + a.max(b)]
    }

    fn volume(&self) -> f64 {
        self.base.volume() * (self.heights[1] - self.heights[0])
    }

    fn intervals(&self, line: &Line<3>) -> Intervals {
        let flat = Line { origin: self.across(&line.origin), direction: self.across(&line.direction) };
        let slab = line.slab(self.axis, self.heights[0], self.heights[1]);
        self.base.intervals(&flat).intersection(&slab)
    }

    fn facets(&self, spacing: f64) -> Vec<Facet<3>> {
        let [low, high] = self.heights;
        let up = minus(&self.at([0.0; 2], high), &self.at([0.0; 2], low));
        let corners = self.base.vertices();
        let mut facets = Vec::new();
        for (side, a) in corners.iter().enumerate() {
            let foot = self.at(*a, low);
            let edge = minus(&self.at(corners[(side + 1) % corners.len()], low), &foot);
            facets.extend(parallelogram(&foot, [&edge, &up], spacing, side));
        }
        for (end, &height) in self.heights.iter().enumerate() {
            for [a, b, c] in self.base.triangles() {
                let [a, b, c] = [a, b, c].map(|corner| self.at(corner, height));
                facets.extend(triangle([&a, &b, &c], spacing, corners.len() + end));
            }
        }
        facets
    }

    fn levels(&self) -> Levels {
        Levels::Plane
    }

    fn corners(&self) -> Vec<[f64; 3]> {
        let base = self.base.corners();
        self.heights.iter().flat_map(|&h| base.iter().map(move |&x| self.at(x, h))).collect()
    }
}
