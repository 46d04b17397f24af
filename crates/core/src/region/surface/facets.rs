//! Triangles with indexed corners.

use super::error::FacetReport;
use super::triangle::Triangle;

/// Triangles with indexed corners.
pub(super) struct Facets {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) corners: Vec<[u32; 3]>,
}

impl Facets {
    pub(super) fn triangle(&self, facet: usize) -> Triangle {
        self.corners[facet].map(|corner| self.positions[corner as usize])
    }

    pub(super) fn triangles(&self) -> Vec<Triangle> {
        (0..self.corners.len()).map(|facet| self.triangle(facet)).collect()
    }

    pub(super) fn report(&self, facet: usize) -> FacetReport {
        FacetReport { facet: facet + 1, corners: self.triangle(facet) }
    }
}
