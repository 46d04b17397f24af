//! Sections of bodies of revolution as tools in axisymmetric analyses.

use std::sync::Arc;

use super::closest::{Closest, Face, TOUCHING, on_axis};
use super::error::NoOutline;
use super::outline::Outline;
use super::shape::{Shape, largest};
use crate::region::{Bounds, Facet, hull};

/// A shape in the half-plane beside an axis of revolution, and its mirror image beyond the axis, because round-off may
/// move corners of domains beyond the axis.
#[derive(Debug, Clone)]
pub struct Section {
    half: Arc<dyn Shape<2>>,
    /// The axis is the line x = `axis`, [length].
    axis: f64,
}

impl Section {
    /// The section of the body of revolution that a shape sweeps about the axis x = `axis`, [length]. A shape that
    /// extends beyond the axis must be symmetric about it.
    pub fn new(half: Arc<dyn Shape<2>>, axis: f64) -> Self {
        Section { half, axis }
    }

    fn mirrored(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [2.0 * self.axis - x, y]
    }
}

impl Shape<2> for Section {
    fn bounds(&self) -> Bounds<2> {
        let [low, high] = self.half.bounds();
        hull([low, high], [self.mirrored([high[0], low[1]]), self.mirrored([low[0], high[1]])])
    }

    fn search(&self, x: &[f64; 2], limit: f64) -> Option<Closest<2>> {
        let beside = x[0] - self.axis;
        let is_beyond = beside < 0.0;
        let touching = TOUCHING * largest(&self.half.bounds());
        if beside.abs() <= touching {
            return on_axis(x, touching, |x| self.half.search(x, limit));
        }
        let mut found = self.half.search(&if is_beyond { self.mirrored(*x) } else { *x }, limit)?;
        if is_beyond {
            found.normal[0] = -found.normal[0];
            found.point = self.mirrored(found.point);
            found.normal_derivative[0][1] = -found.normal_derivative[0][1];
            found.normal_derivative[1][0] = -found.normal_derivative[1][0];
        }
        Some(found)
    }

    fn faces_near(&self, x: &[f64; 2], limit: f64) -> Vec<Face<2>> {
        // On the axis, a face and its mirror image meet: the search treats them.
        if x[0] > self.axis { self.half.faces_near(x, limit) } else { Vec::new() }
    }

    fn crossing(&self, path: &[[f64; 2]; 2]) -> Option<f64> {
        let crossings = [*path, path.map(|x| self.mirrored(x))].map(|path| self.half.crossing(&path));
        crossings.into_iter().flatten().min_by(f64::total_cmp)
    }

    fn pieces(&self, size: f64) -> Option<Vec<Facet<2>>> {
        self.half.pieces(size)
    }

    fn has_edges(&self) -> bool {
        self.half.has_edges()
    }

    fn outline(&self, size: f64) -> Result<Outline<2>, NoOutline> {
        self.half.outline(size)
    }

    fn outline_near(&self, x: [f64; 2], half_width: f64, size: f64) -> Result<Outline<2>, NoOutline> {
        self.half.outline_near(x, half_width, size)
    }
}
