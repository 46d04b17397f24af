//! Errors in tool shapes and in their outlines.

use crate::region::surface::SurfaceError;
use crate::region::{self, MAX_FACETS};

/// Invalid parameters of a shape.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// A number, a polygon or another primitive is invalid.
    #[error(transparent)]
    Primitive(#[from] region::ShapeError),
    /// A triangulated surface is open, crosses itself or is otherwise invalid.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
    /// Two successive corners have the same position.
    #[error("the edge from corner {} has no length", .edge + 1)]
    ZeroEdge {
        /// Index of the edge and of its first corner, from 0.
        edge: usize,
    },
    /// A section of a body of revolution extends beyond the axis.
    #[error("corner {} of the section has a negative radius, {radius}", .corner + 1)]
    NegativeRadius {
        /// Index of the corner, from 0.
        corner: usize,
        /// Radius of the corner, [length].
        radius: f64,
    },
    /// A wall has fewer than two corners.
    #[error("a wall needs at least 2 corners, not {corners}")]
    Corners {
        /// Number of corners of the wall.
        corners: usize,
    },
}

/// Reason why a shape has no outline.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum NoOutline {
    /// The shape extends to infinity.
    #[error("the shape extends to infinity; only a part of it can be drawn")]
    Unbounded,
    /// The size of the facets is not positive and finite.
    #[error("the size of the facets must be positive and finite, not {size}")]
    Size {
        /// The size, [length].
        size: f64,
    },
    /// There would be too many facets.
    #[error("it would be divided into more than {MAX_FACETS} facets")]
    TooMany,
}
