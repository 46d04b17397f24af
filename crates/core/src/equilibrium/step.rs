//! A load step, and the vectors that it knows.

use serde::{Deserialize, Serialize};

/// A load step: the time it starts from and the time it reaches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Number, from 1.
    pub index: usize,
    /// Time of the state it starts from.
    pub start: f64,
    /// Time of the state it reaches.
    pub end: f64,
}

/// A vector on the active nodes, one entry per axis.
pub type Nodal<const D: usize> = Vec<[f64; D]>;
