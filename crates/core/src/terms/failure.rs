//! Reasons why a term cannot be evaluated.

use crate::points::coordinates;
use crate::stress::PointError;

/// A body force has no finite value at a point.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "load `{load}` is not finite at point {point} of body `{body}` at {}: the formula `{formula}` gives {value} at \
     load factor {factor}",
    coordinates(.position)
)]
pub struct LoadNotFinite {
    /// Name of the load.
    pub load: String,
    /// Name of the body.
    pub body: String,
    /// Permanent number of the point.
    pub point: u32,
    /// Position of the point, [length].
    pub position: Vec<f64>,
    /// The load factor.
    pub factor: f64,
    /// Text of the first formula without a finite value, which may be an intermediate one.
    pub formula: String,
    /// Its value.
    pub value: f64,
}

/// A point failed during assembly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointFailure {
    /// Index of the point.
    pub point: usize,
    /// The failure.
    pub error: PointError,
}
