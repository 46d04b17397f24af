//! Report of the state at time 0.

use serde::{Deserialize, Serialize};

/// The initial state of bodies that are stressed at time 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InitialState {
    /// Residual of eq. (40) at time 0, with reactions that follow from the internal force, [-].
    pub residual: f64,
    /// True if the residual meets the tolerance.
    pub is_balanced: bool,
    /// Position of the node with the largest out-of-balance force, [length], and this force, [force].
    pub worst: Option<(Vec<f64>, Vec<f64>)>,
    /// Stored energy of the initial stress, [energy].
    pub energy: f64,
}
