//! The side of a body that faces up, or down, along a direction.

use crate::region::vector::{along, dot, norm};
use crate::region::{Bounds, BoxTree, Facet, area_vector, around};

/// Relative round-off of positions on a sheet, [-].
const SLACK: f64 = 1e-9;
/// Smallest cosine of the angle between the normal of a facet and the direction that it faces, [-].
const STEEPEST: f64 = 1e-6;

/// The facets of a boundary that face along a direction, or against it, for finding their height.
#[derive(Debug, Clone)]
pub struct Sheet<const D: usize> {
    /// The direction in which heights are measured, a unit vector.
    up: [f64; D],
    facets: Vec<[[f64; D]; D]>,
    tree: BoxTree<D>,
    /// Distance within which a line meets the edge of a facet, [length].
    slack: f64,
}

impl<const D: usize> Sheet<D> {
    /// The facets, of a boundary with outward normals, that face along the unit vector `up` or, for a lower side,
    /// against it.
    pub fn new(facets: &[Facet<D>], up: [f64; D], is_lower: bool) -> Self {
        let sign = if is_lower { -1.0 } else { 1.0 };
        let faces = |facet: &&Facet<D>| {
            let area = area_vector(&facet.corners);
            sign * dot(&area, &up) > STEEPEST * norm(&area)
        };
        let chosen: Vec<[[f64; D]; D]> = facets.iter().filter(faces).map(|facet| facet.corners).collect();
        let boxes: Vec<Bounds<D>> = chosen.iter().map(|corners| around(corners)).collect();
        let tree = BoxTree::new(&boxes);
        let [low, high] = around(chosen.as_flattened());
        let extent = (0..D).map(|d| high[d] - low[d]).fold(0.0, f64::max);
        Sheet { up, facets: tree.ordered(&chosen), tree, slack: SLACK * extent }
    }

    /// The centres of the facets, [length].
    pub fn centres(&self) -> impl Iterator<Item = [f64; D]> + '_ {
        self.facets.iter().map(super::centre)
    }

    /// The distances along `up` from a position to the sheet above it, negative below it, [length].
    pub fn heights(&self, x: &[f64; D]) -> Vec<f64> {
        let mut heights = Vec::new();
        let meets = |bounds: &Bounds<D>| is_met(bounds, x, &self.up, self.slack);
        self.tree.visit(meets, |number| {
            let corners = &self.facets[number];
            let area = area_vector(corners);
            let arm: [f64; D] = std::array::from_fn(|d| corners[0][d] - x[d]);
            let height = dot(&arm, &area) / dot(&self.up, &area);
            let on = along(x, height, &self.up);
            // The area of the facet with one of its corners at a position inside is positive for all corners.
            let slack = self.slack * norm(&area).powf((D as f64 - 2.0) / (D as f64 - 1.0)) * norm(&area);
            let is_inside = (0..D).all(|k| {
                let mut part = *corners;
                part[k] = on;
                dot(&area_vector(&part), &area) >= -slack
            });
            heights.extend(is_inside.then_some(height));
        });
        heights
    }

    /// The position on the sheet straight above or below a position and nearest to it, [length]; `None` if there is
    /// none.
    pub fn nearest(&self, x: &[f64; D]) -> Option<[f64; D]> {
        let nearest = self.heights(x).into_iter().min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        Some(along(x, nearest, &self.up))
    }

    /// The first position on the sheet straight below a position or, if there is none, the first above it, [length].
    pub fn below(&self, x: &[f64; D]) -> Option<[f64; D]> {
        let heights = self.heights(x);
        let is_below = |height: &f64| *height <= self.slack;
        let below = heights.iter().copied().filter(is_below).max_by(f64::total_cmp);
        let found = below.or_else(|| heights.into_iter().min_by(f64::total_cmp))?;
        Some(along(x, found, &self.up))
    }
}

/// True if the line through a position along a direction meets a box, to within `slack`, [length].
fn is_met<const D: usize>([low, high]: &Bounds<D>, x: &[f64; D], direction: &[f64; D], slack: f64) -> bool {
    let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
    for d in 0..D {
        let [below, above] = [low[d] - slack - x[d], high[d] + slack - x[d]];
        if direction[d].abs() <= STEEPEST * STEEPEST {
            if below > 0.0 || above < 0.0 {
                return false;
            }
        } else {
            let [a, b] = [below / direction[d], above / direction[d]];
            (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
        }
    }
    from <= to
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::region::{Brick, Polygon, Region};

    #[test]
    fn a_slope_has_its_heights() {
        let region: Region<2> =
            Polygon::new(vec![[0.0, 0.0], [4.0, 0.0], [2.0, 1.0], [0.0, 1.0]]).unwrap().into();
        let facets = region.boundary(0.3).unwrap();
        let [lower, upper] = [true, false].map(|is_lower| Sheet::new(&facets, [0.0, 1.0], is_lower));
        for (x, height) in [(0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (3.0, 0.5), (3.9, 0.05)] {
            let on = upper.nearest(&[x, 7.0]).unwrap();
            assert!((on[1] - height).abs() < 1e-12 && on[0] == x, "{on:?}");
            assert!(lower.below(&[x, 0.01]).unwrap()[1].abs() < 1e-12);
        }
        assert_eq!((upper.nearest(&[4.1, 0.0]), lower.below(&[-0.1, 0.5])), (None, None));
    }

    #[test]
    fn heights_are_measured_along_the_direction() {
        let region: Region<3> = Brick::new([0.0; 3], [2.0, 3.0, 1.0]).unwrap().into();
        let facets = region.boundary(0.7).unwrap();
        let up = [0.6, 0.0, 0.8];
        let upper = Sheet::new(&facets, up, false);
        let on = upper.nearest(&[0.5, 0.1, 0.6]).unwrap();
        assert!((on[2] - 1.0).abs() < 1e-12 && (on[0] - 0.8).abs() < 1e-12, "{on:?}");
        let sideways = Sheet::new(&facets, [-1.0, 0.0, 0.0], true);
        assert!((sideways.below(&[1.0, 2.9, 0.9]).unwrap()[0] - 2.0).abs() < 1e-12);
    }
}
