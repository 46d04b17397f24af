//! The surface of a tool divided into facets, for output.

use crate::region::vector::norm;
use crate::region::{Facet, area_vector, indexed};

/// A surface divided into flat facets: segments in the plane, triangles in space.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outline<const D: usize> {
    /// Positions of the corners, [length].
    pub vertices: Vec<[f64; D]>,
    /// Indices of the corners of each facet. In the plane, the outside is to the right of the direction from the first
    /// corner to the second; in space, the corners are counterclockwise as seen from outside.
    pub facets: Vec<[u32; D]>,
    /// Area (length in the plane) of each facet, [length^(D−1)].
    pub areas: Vec<f64>,
    /// Index of the part of the surface to which each facet belongs, as in [`Closest::part`](super::Closest::part).
    pub parts: Vec<usize>,
}

impl<const D: usize> Outline<D> {
    /// The outline with these facets; there must be fewer than 2³² / D.
    pub(super) fn new(facets: &[Facet<D>]) -> Self {
        let corners: Vec<_> = facets.iter().map(|facet| facet.corners).collect();
        let (vertices, indices) = indexed(&corners);
        Outline {
            vertices,
            facets: indices,
            areas: facets.iter().map(|facet| norm(&area_vector(&facet.corners))).collect(),
            parts: facets.iter().map(|facet| facet.side).collect(),
        }
    }

    /// Area of the surface (length in the plane), [length^(D−1)].
    pub fn area(&self) -> f64 {
        self.areas.iter().sum()
    }
}
