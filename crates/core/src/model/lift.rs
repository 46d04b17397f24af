//! Bodies that a stage adds above others.

use crate::region::vector::{dot, minus};
use crate::surface::Sheet;

/// A body that a stage adds above another one, its ground, as both were drawn.
#[derive(Debug, Clone)]
pub struct Lift<const D: usize> {
    /// Index of the body that is added.
    pub body: usize,
    /// Index of the body below it.
    pub ground: usize,
    /// True if the stage moves the lower side of the body onto the current surface of the ground; otherwise the distance
    /// between them is only checked.
    pub is_placed: bool,
    /// The direction opposite to gravity, a unit vector.
    pub up: [f64; D],
    /// The original lower side of the body.
    pub lower: Sheet<D>,
    /// The original upper side of the ground.
    pub upper: Sheet<D>,
    /// Size of a grid cell at the lower side along `up`, [length].
    pub cell: f64,
}

impl<const D: usize> Lift<D> {
    /// The original distance from the ground up to the lower side of the body, in the column of a position, [length];
    /// negative where they overlap. `None` if one of them is not in this column.
    pub fn original_gap(&self, x: &[f64; D]) -> Option<f64> {
        let foot = self.lower.below(x)?;
        Some(dot(&minus(&foot, &self.upper.nearest(&foot)?), &self.up))
    }
}
