//! Domains that fill a region in space.

use crate::grid::element::{Collapsed, ElementShape};
use crate::grid::vtk_corner;

/// A domain: corners in the order of [`crate::points::Seed::corners`], [length].
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct SolidDomain {
    pub corners: Vec<[f64; 3]>,
    /// True if a corner lies on the boundary.
    pub is_outer: bool,
}

impl SolidDomain {
    /// The centroid, [length].
    pub(in crate::model) fn centroid(&self) -> [f64; 3] {
        let corners = &self.corners;
        match Collapsed::from_corners::<3>(corners.len()) {
            Some(shape) => shape.centroid(corners),
            None if corners.len() == 8 => {
                let in_order: Vec<[f64; 3]> = (0..8).map(|k| corners[vtk_corner(k)]).collect();
                ElementShape::Box.centroid(&in_order)
            }
            None => ElementShape::Simplex.centroid(corners),
        }
    }
}

/// Domains that fill a region in space.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::model) struct SolidDomains {
    /// In the order of the cells of the lattice.
    pub domains: Vec<SolidDomain>,
    /// The position on a curved face that is farthest from the domains, if these do not follow the face there,
    /// [length].
    pub apart: Option<[f64; 3]>,
}

/// Why domains cannot follow the boundary.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::model) enum NotFitted {
    /// All faces lie on lattice lines, so that the cells of the lattice follow it as they are.
    OnLattice,
    /// The faces of the region are not known.
    Unknown,
    /// The domains at a position would be inverted.
    At([f64; 3]),
}
