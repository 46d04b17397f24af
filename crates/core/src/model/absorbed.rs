//! Boundaries that absorb waves.

use super::LoadCurve;

/// A boundary that absorbs waves in place of a boundary condition.
#[derive(Debug, Clone, PartialEq)]
pub struct Absorbed<const D: usize> {
    /// Number of the condition, on given nodes, which no longer acts.
    pub condition: usize,
    /// The wave that comes in: the direction of its motion, and its velocity over time, [length/time].
    pub incoming: Option<([f64; D], LoadCurve)>,
}
