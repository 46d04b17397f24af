//! The division of the loading into load steps, as a deck states it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Axis;

/// Division of the loading into load steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StepsDeck {
    /// Number of equal load steps.
    #[schemars(range(min = 1, max = 10_000_000), extend("examples" = [50]))]
    pub count: u32,
    /// Time at the end of the analysis, [time]; it only orders the loading.
    #[serde(default = "unit_time")]
    #[schemars(range(min = 1e-100, max = 1e100))]
    pub end_time: f64,
    /// A step without equilibrium is tried again in halves, down to this part of a step, [-]; with 1 it is not.
    #[serde(default = "thousandth")]
    #[schemars(range(min = 1e-6, max = 1.0), extend("examples" = [0.001]))]
    pub smallest: f64,
    /// Whether a step that fails at its smallest is tried once more with damped iterations, and with new domains in place of
    /// torn ones, for loads and motions that are prescribed. The run warns where that was needed (W013, W014).
    #[serde(default = "yes")]
    pub damping: bool,
    /// Steps that converge in few iterations grow up to this many times a step, [-]; with 1 they only grow back to that. Times
    /// of output and kinks of load curves are met exactly.
    #[serde(default = "whole")]
    #[schemars(range(min = 1.0, max = 1e6), extend("examples" = [1, 8]))]
    pub largest: f64,
    /// What is prescribed along the steps.
    #[serde(default)]
    pub control: ControlDeck,
}

/// What is prescribed along the steps, and what follows from equilibrium.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ControlDeck {
    /// Loads and prescribed displacements by their curves; the displacements follow.
    Load {},
    /// The displacement of a probe grows in proportion to time; one factor of all loads follows, which may fall again.
    Displacement {
        /// Name of the probe, one of `output: {probes: ...}`.
        probe: String,
        /// The axis along which it moves.
        axis: Axis,
        /// Its displacement at the end of the analysis, [length].
        #[schemars(extend("examples" = [-0.5]))]
        to: f64,
    },
    /// The length of the path of all displacements grows in proportion to time; one factor of all loads follows, which may
    /// fall again. Without `length` the first step takes the part of the loads that it has of the time, and sets the pace.
    ArcLength {
        /// Length of the path at the end of the analysis, [length]: the sum over the steps of √(Σ V |Δu|² / V₀) over the
        /// nodes, V the volume that a node carries at the start of the step, Δu its displacement in the step, less what
        /// the forces move that the reset of the grid leaves out of balance, and V₀ the original volume of all points. A
        /// body that moves as a whole by u has come along u.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.5]))]
        length: Option<f64>,
    },
}

impl Default for ControlDeck {
    fn default() -> Self {
        ControlDeck::Load {}
    }
}

fn unit_time() -> f64 {
    1.0
}

fn thousandth() -> f64 {
    1e-3
}

fn yes() -> bool {
    true
}

fn whole() -> f64 {
    1.0
}
