//! The interface between contact and the shape of a tool.

use std::fmt::Debug;

use super::closest::{Closest, Face, TOUCHING};
use super::error::NoOutline;
use super::outline::Outline;
use crate::region::vector::dot;
use crate::region::{
    Bounds, Facet, Intervals, MAX_FACETS, area_vector, around, boxes_overlap, squared_distance,
};

/// The shape of a rigid tool, in the frame of the tool. In axisymmetry, the plane shapes are sections (r, y).
///
/// Implementors provide [`Shape::bounds`], [`Shape::search`], [`Shape::crossing`] and [`Shape::pieces`]; callers use
/// the other methods, which check their arguments.
pub trait Shape<const D: usize>: Debug + Send + Sync {
    /// Bounding box of the shape, [length]; infinite for half-spaces.
    fn bounds(&self) -> Bounds<D>;

    /// The closest point on the surface for a finite position; may be `None` if |gap| exceeds `limit`, [length].
    fn search(&self, x: &[f64; D], limit: f64) -> Option<Closest<D>>;

    /// The first position where the path between two different finite positions meets the surface, as a fraction of the
    /// path.
    fn crossing(&self, path: &[[f64; D]; 2]) -> Option<f64>;

    /// The surface divided into flat facets, in either orientation, whose edges are at most `size` long, [length];
    /// `None` if the surface extends to infinity.
    fn pieces(&self, size: f64) -> Option<Vec<Facet<D>>>;

    /// True if the surface has edges, corners or ends, which may enter a domain between its corners.
    fn has_edges(&self) -> bool {
        true
    }

    /// The flat faces whose planes, and whose edges within these planes, are no farther than `limit`, [length], from a
    /// position; none of a curved surface.
    fn faces_near(&self, _x: &[f64; D], _limit: f64) -> Vec<Face<D>> {
        Vec::new()
    }

    /// The closest point on the surface. `None` only if a coordinate is not finite, or so large that round-off hides
    /// the shape or the square of the coordinate overflows.
    ///
    /// If there are several closest points or normals (on an edge, at the centre of a circle or on the medial axis),
    /// one is chosen, the same in every call.
    fn closest(&self, x: [f64; D]) -> Option<Closest<D>> {
        self.closest_within(x, f64::INFINITY)
    }

    /// The closest point on the surface; `None` if |gap| exceeds `limit`, [length].
    fn closest_within(&self, x: [f64; D], limit: f64) -> Option<Closest<D>> {
        let bounds = self.bounds();
        let squared = squared_distance(&bounds, &x);
        let is_near = limit >= 0.0 && squared <= limit * limit;
        if !is_near || !x.iter().all(|x| x.is_finite()) {
            return None;
        }
        let found = self.search(&x, limit)?;
        // Far from a thin shape, the distances from its two sides are equal up to round-off.
        let is_hidden = squared > 0.0 && found.gap < -TOUCHING * largest(&bounds);
        (found.gap.abs() <= limit && found.is_finite() && !is_hidden).then_some(found)
    }

    /// The first position where the straight path of a point meets the surface, as a fraction of the path, 0 to 1. A
    /// path that only touches the surface, or stays in it, may count as meeting it.
    fn first_contact(&self, from: [f64; D], to: [f64; D]) -> Option<f64> {
        let path = [from, to];
        let is_path = from != to && path.as_flattened().iter().all(|x| x.is_finite());
        if is_path && boxes_overlap(&around(&path), &self.bounds()) { self.crossing(&path) } else { None }
    }

    /// The surface divided into flat facets with edges of at most `size`, [length], for output.
    ///
    /// # Errors
    /// [`NoOutline`].
    fn outline(&self, size: f64) -> Result<Outline<D>, NoOutline> {
        if !(size > 0.0 && size.is_finite()) {
            return Err(NoOutline::Size { size });
        }
        let [low, high] = self.bounds();
        let extent = (0..D).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        if extent == f64::INFINITY {
            return Err(NoOutline::Unbounded);
        }
        // The surface area of a convex body is at most that of its bounding box.
        if 4.0 * D as f64 * (extent / size).powi(D as i32 - 1) > MAX_FACETS as f64 {
            return Err(NoOutline::TooMany);
        }
        let mut facets = self.pieces(size).ok_or(NoOutline::Unbounded)?;
        for facet in &mut facets {
            if let Some(closest) = self.closest(facet.centre())
                && dot(&closest.normal, &area_vector(&facet.corners)) < 0.0
            {
                *facet = facet.turned();
            }
        }
        Ok(Outline::new(&facets))
    }

    /// The outline of a bounded shape. For an unbounded shape, the part within a square (segment) of this half width,
    /// [length], around the point closest to a position.
    ///
    /// # Errors
    /// [`NoOutline`]; for an unbounded shape, also if the half width is not positive and finite.
    fn outline_near(&self, _x: [f64; D], _half_width: f64, size: f64) -> Result<Outline<D>, NoOutline> {
        self.outline(size)
    }
}

/// The first interval end on a path, as a fraction of the path, 0 to 1.
pub(super) fn first_end(intervals: &Intervals) -> Option<f64> {
    intervals.as_slice().as_flattened().iter().copied().find(|t| (0.0..=1.0).contains(t))
}

/// Largest absolute coordinate of a box.
pub(super) fn largest<const D: usize>(bounds: &Bounds<D>) -> f64 {
    bounds.as_flattened().iter().fold(0.0, |m, x| m.max(x.abs()))
}
