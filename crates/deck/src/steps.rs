//! The load steps of a deck.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Axis, yes};
use mpm_core::model::AfterSlide;

/// Division of the loading into load steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StepsDeck {
    /// Number of equal load steps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 10_000_000), extend("examples" = [50]))]
    pub count: Option<u32>,
    /// Duration of a requested step, [time], in place of `count`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-100, max = 1e100), extend("examples" = [0.01]))]
    pub size: Option<f64>,
    /// Time at the end of the analysis, [time]. In statics, time only orders the loading.
    #[serde(default = "unit_time")]
    #[schemars(range(min = 1e-100, max = 1e100))]
    pub end_time: f64,
    /// Smallest step, as a fraction of a requested step, [-]: a step that does not converge is halved down to this
    /// size. 1 disables halving.
    #[serde(default = "thousandth")]
    #[schemars(range(min = 1e-6, max = 1.0), extend("examples" = [0.001]))]
    pub smallest: f64,
    /// If a step fails at its smallest size under prescribed loads and motions, it is retried with damped iterations,
    /// and with new domains in place of torn ones. The run warns if this was needed (W013, W014).
    #[serde(default = "yes")]
    pub damping: bool,
    /// Viscosity, for bodies that flow plastically in a way that iterations cannot follow: the time in which stresses
    /// beyond the strength relax, as a fraction of a requested step, [-]. Where only motions drive the bodies and a step of
    /// an eighth of the requested size fails, or a larger one after sixteen steps of at most a quarter, steps continue with
    /// viscosity until they succeed without it. The run warns of it (W024). 0 rules it out.
    #[serde(default = "hundredth")]
    #[schemars(range(min = 0.0, max = 1.0), extend("examples" = [0.01]))]
    pub viscosity: f64,
    /// Largest step, as a multiple of a requested step, [-]: steps that converge in few iterations grow up to this
    /// size. With 1, cut steps only grow back to the requested size. Times of output and kinks of load curves are met
    /// exactly.
    #[serde(default = "whole")]
    #[schemars(range(min = 1.0, max = 1e6), extend("examples" = [1, 8]))]
    pub largest: f64,
    /// Quantity prescribed along the steps.
    #[serde(default)]
    pub control: ControlDeck,
    /// Where the steps end: at `end_time`, or before it once the load no longer grows. The load is the force that the
    /// prescribed motions need or, with displacement and arc-length control, the load factor; it no longer grows if its
    /// rise with the displacement stays below 1 % of its steepest rise in two steps. Only the last stage can end so.
    /// Stages with inertia can end once the bodies are at rest.
    #[serde(default, skip_serializing_if = "is_default")]
    pub until: Until,
}

/// Where the load steps end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Until {
    /// At the end time.
    #[default]
    End,
    /// Once the load no longer grows with the displacement, or at the end time.
    Limit,
    /// Once bodies that move with inertia are at rest, or at the end time: their kinetic energy has fallen below 1e-6 of
    /// the energy that the motion has set free.
    Rest,
}

/// Quantity prescribed along the steps; the others follow from equilibrium.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ControlDeck {
    /// Load control: loads and prescribed displacements follow their curves.
    Load {},
    /// Displacement control: the displacement of a probe or a tool grows in proportion to time; the common factor of
    /// all loads, and of prescribed motions of tools, follows from equilibrium and may decrease.
    Displacement {
        /// Name of the probe, one of those under `output: {probes: ...}`. Exactly one of `probe` and `tool` is needed.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        probe: Option<String>,
        /// Name of the tool: the displacement of its reference point is controlled, along an axis that is free or along
        /// which a motion is prescribed.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("examples" = ["footing"]))]
        tool: Option<String>,
        /// Axis of the displacement.
        axis: Axis,
        /// Displacement at the end of the analysis, [length].
        #[schemars(extend("examples" = [-0.5]))]
        to: f64,
    },
    /// Arc-length control: the length of the path of all displacements grows in proportion to time; the common factor
    /// of all loads follows from equilibrium and may decrease. Without `length`, the linear response of the first step
    /// to its share of the loads sets the path length of every step.
    ArcLength {
        /// Length of the path at the end of the analysis, [length]: the sum over the steps of √(Σ V |Δu|² / V₀) over
        /// the nodes. V is the volume assigned to a node at the start of the step, V₀ the original volume of all
        /// points, and Δu the displacement of the node in the step, less the displacement due to the out-of-balance
        /// forces that resetting the grid leaves. For a rigid translation by u the length is |u|.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.5]))]
        length: Option<f64>,
    },
    /// Strength reduction: the strength of the materials, such as the cohesion and the tangent of the friction angle,
    /// is divided by a factor F that grows linearly with time, until no equilibrium is found. The factor of safety lies
    /// between the last F with equilibrium and the first F without it; the stage then ends. Loads stay constant, and so
    /// does the strength of the models `library` and `modified-cam-clay`.
    StrengthReduction {
        /// Factor at the start, [-]. If no equilibrium is found there, the search goes back towards 1.
        #[serde(default = "whole")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1]))]
        from: f64,
        /// Factor at which the search ends, [-].
        #[schemars(extend("exclusiveMinimum" = 0.0, "maximum" = 1000.0, "examples" = [3]))]
        to: f64,
        /// Largest accepted difference between the factors with and without equilibrium, [-].
        #[serde(default = "half_percent")]
        #[schemars(range(min = 1e-6, max = 1.0))]
        tolerance: f64,
        /// What follows once bodies have slid; `stop` by default.
        #[serde(default, skip_serializing_if = "is_default")]
        after_slide: AfterSlide,
    },
}

impl Default for ControlDeck {
    fn default() -> Self {
        ControlDeck::Load {}
    }
}

pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn half_percent() -> f64 {
    0.005
}

fn unit_time() -> f64 {
    1.0
}

fn thousandth() -> f64 {
    1e-3
}

fn hundredth() -> f64 {
    0.01
}

fn whole() -> f64 {
    1.0
}
