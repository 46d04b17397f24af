//! Extents of bodies and of the grid.

use mpm_core::grid::Axis;

/// A box with extent along every axis.
#[derive(Debug, Clone)]
pub(super) struct Extent {
    pub(super) min: Vec<f64>,
    pub(super) max: Vec<f64>,
}

impl Extent {
    pub(super) fn side(&self, axis: usize) -> f64 {
        self.max[axis] - self.min[axis]
    }
}

/// The region of a structured grid and its lines along each axis.
#[derive(Debug, Clone)]
pub(super) struct GridBox {
    pub(super) extent: Extent,
    pub(super) axes: Vec<Axis>,
}
