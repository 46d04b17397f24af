//! Report of the state at time 0.

use serde::{Deserialize, Serialize};

/// A node that is out of balance. It is stored as a pair.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(from = "(Vec<f64>, Vec<f64>)", into = "(Vec<f64>, Vec<f64>)")]
pub struct UnbalancedNode {
    /// Position, [length].
    pub position: Vec<f64>,
    /// Out-of-balance force, [force].
    pub force: Vec<f64>,
}

impl From<(Vec<f64>, Vec<f64>)> for UnbalancedNode {
    fn from((position, force): (Vec<f64>, Vec<f64>)) -> Self {
        UnbalancedNode { position, force }
    }
}

impl From<UnbalancedNode> for (Vec<f64>, Vec<f64>) {
    fn from(UnbalancedNode { position, force }: UnbalancedNode) -> Self {
        (position, force)
    }
}

/// The initial state of bodies that are stressed at time 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct InitialState {
    /// Residual of eq. (40) at time 0, with reactions that follow from the internal force, [-].
    pub residual: f64,
    /// True if the residual meets the tolerance.
    pub is_balanced: bool,
    /// The node with the largest out-of-balance force.
    pub worst: Option<UnbalancedNode>,
    /// Stored energy of the initial stress, [energy].
    pub energy: f64,
}
