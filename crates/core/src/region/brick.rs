//! Axis-aligned boxes.

use super::boundary::{divide, parallelogram};
use super::vector::unit;
use super::{
    Bounds, Curve, Facet, Intervals, Levels, Line, Primitive, ShapeError, corners, finite, positive,
};

/// An axis-aligned box (rectangle in the plane).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Brick<const D: usize> {
    bounds: Bounds<D>,
}

impl<const D: usize> Brick<D> {
    /// A box with this lowest and highest corner, [length].
    ///
    /// # Errors
    /// [`ShapeError::NotFinite`]; [`ShapeError::NotPositive`] for a side.
    pub fn new(min: [f64; D], max: [f64; D]) -> Result<Self, ShapeError> {
        finite("the lowest corner", min)?;
        finite("the highest corner", max)?;
        for d in 0..D {
            positive("the side of the box", max[d] - min[d])?;
        }
        Ok(Brick { bounds: [min, max] })
    }

    /// The lowest and the highest corner, [length].
    pub fn bounds(&self) -> Bounds<D> {
        self.bounds
    }

    /// A corner of a rectangle, counterclockwise from the lowest one, as for a polygon.
    fn turning(&self, k: usize) -> [f64; D] {
        std::array::from_fn(|d| self.bounds[[[0, 1, 1, 0], [0, 0, 1, 1]][d % 2][k % 4]][d])
    }
}

impl<const D: usize> Primitive<D> for Brick<D> {
    fn contains(&self, x: &[f64; D]) -> bool {
        (0..D).all(|d| self.bounds[0][d] <= x[d] && x[d] <= self.bounds[1][d])
    }

    fn extent(&self, direction: &[f64; D]) -> [f64; 2] {
        let mut extent = [0.0; 2];
        for d in 0..D {
            let (a, b) = (direction[d] * self.bounds[0][d], direction[d] * self.bounds[1][d]);
            extent[0] += a.min(b);
            extent[1] += a.max(b);
        }
        extent
    }

    fn volume(&self) -> f64 {
        (0..D).map(|d| self.bounds[1][d] - self.bounds[0][d]).product()
    }

    fn intervals(&self, line: &Line<D>) -> Intervals {
        let slab = |d: usize| line.slab(d, self.bounds[0][d], self.bounds[1][d]);
        (1..D).fold(slab(0), |inside, d| inside.intersection(&slab(d)))
    }

    fn facets(&self, spacing: f64) -> Vec<Facet<D>> {
        let [low, high] = self.bounds;
        if D == 2 {
            let corner = |k: usize| self.turning(k);
            return (0..4).flat_map(|k| divide(&corner(k), &corner(k + 1), spacing, k)).collect();
        }
        let edge = |d: usize| unit::<D>(d).map(|x| x * (high[d] - low[d]));
        let side = |number: usize| {
            let axis = number / 2;
            let (i, j) = ((axis + 1) % D, (axis + 2) % D);
            let mut corner = low;
            corner[axis] = self.bounds[number % 2][axis];
            parallelogram(&corner, [&edge(i), &edge(j)], spacing, number)
        };
        (0..2 * D).flat_map(side).collect()
    }

    fn curves(&self) -> Vec<Curve> {
        let corner = |k: usize| [0, 1].map(|d| self.turning(k)[d % D]);
        if D == 2 { vec![Curve::Polygon((0..4).map(corner).collect())] } else { Vec::new() }
    }

    fn levels(&self) -> Levels {
        Levels::Plane
    }

    fn is_convex(&self) -> bool {
        true
    }

    fn corners(&self) -> Vec<[f64; D]> {
        corners(&self.bounds).collect()
    }
}
