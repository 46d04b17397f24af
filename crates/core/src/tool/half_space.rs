//! Half-planes and half-spaces.

use super::closest::Closest;
use super::error::{NoOutline, ShapeError};
use super::outline::Outline;
use super::shape::Shape;
use crate::region::vector::{along, dot, frame, minus, norm};
use crate::region::{Bounds, Facet, MAX_FACETS, divided, finite, positive};

/// The half-plane (D = 2) or half-space (D = 3) behind a line or plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpace<const D: usize> {
    point: [f64; D],
    normal: [f64; D],
}

impl<const D: usize> HalfSpace<D> {
    /// The half-space whose surface passes through a point, [length], with this outward normal of any length.
    ///
    /// # Errors
    /// [`ShapeError::Primitive`] if a number is not finite or the normal is zero.
    pub fn new(point: [f64; D], normal: [f64; D]) -> Result<Self, ShapeError> {
        let point = finite("the point of the plane", point)?;
        // Scaling comes first: the squares of very large or small numbers overflow or underflow.
        let largest = finite("the normal", normal)?.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let largest = positive("the length of the normal", largest)?;
        let normal = normal.map(|x| x / largest);
        let length = norm(&normal);
        Ok(HalfSpace { point, normal: normal.map(|x| x / length) })
    }

    fn height(&self, x: &[f64; D]) -> f64 {
        dot(&minus(x, &self.point), &self.normal)
    }
}

impl<const D: usize> Shape<D> for HalfSpace<D> {
    fn bounds(&self) -> Bounds<D> {
        [[f64::NEG_INFINITY; D], [f64::INFINITY; D]]
    }

    fn search(&self, x: &[f64; D], _: f64) -> Option<Closest<D>> {
        Some(Closest::on_plane(x, self.height(x), self.normal, 0))
    }

    fn crossing(&self, path: &[[f64; D]; 2]) -> Option<f64> {
        let [from, to] = path.map(|x| self.height(&x));
        let crosses = from.min(to) <= 0.0 && from.max(to) >= 0.0;
        crosses.then(|| if from == to { 0.0 } else { from / (from - to) })
    }

    fn has_edges(&self) -> bool {
        false
    }

    fn pieces(&self, _: f64) -> Option<Vec<Facet<D>>> {
        None
    }

    fn outline_near(&self, x: [f64; D], half_width: f64, size: f64) -> Result<Outline<D>, NoOutline> {
        for length in [half_width, size] {
            if !(length > 0.0 && length.is_finite()) {
                return Err(NoOutline::Size { size: length });
            }
        }
        if 4.0 * D as f64 * (2.0 * half_width / size).powi(D as i32 - 1) > MAX_FACETS as f64 {
            return Err(NoOutline::TooMany);
        }
        let foot = along(&x, -self.height(&x), &self.normal);
        let n = self.normal;
        let facets: Vec<Facet<D>> = if D == 2 {
            let tangent: [f64; D] = std::array::from_fn(|d| if d == 0 { -n[1] } else { n[0] });
            let [a, b] = [-half_width, half_width].map(|t| along(&foot, t, &tangent));
            divided(&[a, b], size, 0)
        } else {
            let [e, f] = frame(&std::array::from_fn(|d| n[d % D]));
            let corner = |s: f64, t: f64| -> [f64; D] {
                std::array::from_fn(|d| foot[d] + half_width * (s * e[d] + t * f[d]))
            };
            let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            divided(&corners, size, 0)
        };
        Ok(Outline::new(&facets))
    }
}
