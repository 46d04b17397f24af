//! The sides of a body that may touch another body.

use crate::basis::Method;
use crate::region::vector::{along, dot, minus};

use super::carriers::Carriers;

/// Distance from the end of a side, relative to its length, within which a place is at its end, [-].
pub(super) const AT_END: f64 = 1e-7;

/// An outer side of a body that may touch another body.
pub(super) struct Side<const D: usize> {
    pub(super) p: usize,
    /// Number of the side in its domain.
    pub(super) number: usize,
    /// In cyclic order, counterclockwise as seen from outside, [length].
    pub(super) corners: Vec<[f64; D]>,
    /// For each corner, the material point and the number of the corner in its domain that stand for it.
    pub(super) owners: Vec<(u32, u32)>,
    /// The nodes that carry each corner.
    pub(super) carriers: Vec<Carriers>,
    /// Outward unit normal.
    pub(super) normal: [f64; D],
    /// Size of the cell of its material point, [length].
    pub(super) size: f64,
    /// Stiffness of a cell of its material, [force/length³].
    pub(super) stiffness: f64,
    pub(super) method: Method,
}

/// The crossings of a segment with lines of the grid, as fractions of its length.
pub(super) type Crossings<'a, const D: usize> = dyn Fn(&[f64; D], &[f64; D]) -> Vec<f64> + 'a;

/// A place on two sides that face each other, at these fractions of both.
#[derive(Clone, Copy)]
pub(super) struct PlaceOnSides {
    pub(super) first: f64,
    pub(super) second: f64,
}

impl<const D: usize> Side<D> {
    /// D_mk: the shares of the corners in the edges ∂x/∂η_m of the side.
    pub(super) fn slopes(&self) -> &'static [[f64; 2]] {
        match self.corners.len() {
            2 => &[[-1.0, 0.0], [1.0, 0.0]],
            3 => &[[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]],
            _ => &[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]],
        }
    }

    pub(super) fn edge(&self) -> [f64; D] {
        minus(&self.corners[1], &self.corners[0])
    }

    pub(super) fn position(&self, fraction: f64) -> [f64; D] {
        along(&self.corners[0], fraction, &self.edge())
    }

    /// The fraction of the side at which a position projects on it.
    pub(super) fn fraction(&self, x: &[f64; D]) -> f64 {
        let edge = self.edge();
        dot(&minus(x, &self.corners[0]), &edge) / dot(&edge, &edge)
    }

    /// The corner at a fraction of the side, if it lies at an end.
    pub(super) fn corner_at(fraction: f64) -> Option<usize> {
        if fraction.abs() <= AT_END { Some(0) } else { ((fraction - 1.0).abs() <= AT_END).then_some(1) }
    }

    /// The places that bound the pieces of this side over another one, at the first of which it begins; fewer than two if
    /// they do not lie over each other.
    pub(super) fn places_over(&self, other: &Side<D>, lines: &Crossings<D>) -> Vec<PlaceOnSides> {
        let [from, to] = [0, 1].map(|k| other.fraction(&self.corners[k]));
        let (low, high) = (from.min(to).max(0.0), from.max(to).min(1.0));
        let overlap = high - low;
        if overlap.is_nan() || overlap <= AT_END || (to - from).abs() <= AT_END {
            return Vec::new();
        }
        let on_first = |second: f64| (second - from) / (to - from);
        let ends = [on_first(low), on_first(high)];
        let mut first = vec![ends[0].min(ends[1]), ends[0].max(ends[1])];
        if [self.method, other.method].contains(&Method::Gimp) {
            let [a, b] = [0, 1].map(|k| self.position(first[k]));
            let (start, length) = (first[0], first[1] - first[0]);
            let inner = lines(&a, &b).into_iter().filter(|t| (AT_END..1.0 - AT_END).contains(t));
            first.extend(inner.map(|t| start + t * length));
            first.sort_by(f64::total_cmp);
        }
        let snapped = |x: f64| Side::<D>::corner_at(x).map_or(x, |corner| corner as f64);
        first
            .into_iter()
            .map(|first| PlaceOnSides { first: snapped(first), second: snapped(from + first * (to - from)) })
            .collect()
    }
}
