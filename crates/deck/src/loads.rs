//! The loads of a deck, each in a file of its own: its keys, its checks, and the action that it becomes in a model.
//!
//! Another load needs its file, its `mod` line, a variant of [`LoadDeck`] and an arm of `LoadDeck::action_deck`;
//! nothing else lists the loads.

mod base_motion;
mod body_force;
mod gravity;
mod point_force;
mod pressure;
mod traction;

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mpm_core::model::{self, Action};

use super::Expression;
use super::gates::{Builds, Checks};
use super::span::escape;

pub use base_motion::BaseMotionDeck;
pub use body_force::{BodyForceDeck, Per};
pub use gravity::GravityDeck;
pub use point_force::{PointForceDeck, PointSelector};
pub use pressure::{HydrostaticDeck, PressureDeck};
pub use traction::TractionDeck;

/// Load factor over time as a table of [time, factor] pairs, linear in between. Times must increase and cover the
/// analysis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(extend("examples" = [[[0, 0], [1, 1]]]))]
pub struct LoadCurve(#[schemars(length(min = 2))] pub Vec<[f64; 2]>);

/// The load curve of a deck; by default, a ramp from 0 to 1 over the analysis.
pub(crate) fn load_curve(curve: Option<&LoadCurve>, end_time: f64) -> model::LoadCurve {
    match curve {
        Some(LoadCurve(pairs)) => model::LoadCurve::table(pairs.clone()),
        None => model::LoadCurve::ramp(end_time),
    }
}

/// An external force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case")]
#[allow(missing_docs, reason = "the mapping of each load describes it, here and in the schema")]
pub enum LoadDeck {
    Gravity(GravityDeck),
    BodyForce(BodyForceDeck),
    PointForce(PointForceDeck),
    Traction(TractionDeck),
    Pressure(PressureDeck),
    BaseMotion(BaseMotionDeck),
}

/// What a deck asks of each load.
pub(crate) trait LoadKeys {
    /// Name of the load.
    fn name(&self) -> &str;

    /// Load factor over time, if it is stated.
    fn curve(&self) -> Option<&LoadCurve>;

    /// True if the load has its own course over time.
    fn follows_time(&self) -> bool {
        self.curve().is_some()
    }

    /// Names of the bodies on whose points the load acts; `None` for all bodies, and empty for a load on a surface.
    fn bodies(&self) -> Option<&[String]>;

    /// Name of the surface on which the load acts; `None` if it acts on points.
    fn surface(&self) -> Option<&str> {
        None
    }

    /// Acceleration at load factor 1, [length/time²]; `None` if the load is not gravity.
    fn acceleration(&self) -> Option<&[f64]> {
        None
    }

    /// The components that may be formulas, with their keys relative to the load.
    fn components(&self) -> Vec<(String, &Expression)> {
        Vec::new()
    }

    /// Named intermediate values for use in the components.
    fn intermediate(&self) -> Option<&BTreeMap<String, Expression>> {
        None
    }

    /// Key of the magnitude, and true if the magnitude is zero at every load factor.
    fn magnitude(&self) -> (&'static str, bool);

    /// Checks the keys of the load, which stands at `pointer`.
    fn check(&self, check: &mut dyn Checks, pointer: &str);
}

/// A load that becomes an action in a model with `D` axes.
pub(crate) trait ActionDeck<const D: usize>: LoadKeys {
    /// The action; `None` if the load has faults, which have then been reported to the builder.
    fn action(&self, builder: &mut dyn Builds, pointer: &str) -> Option<Action<D>>;
}

impl LoadDeck {
    /// The load: the only match over the loads.
    fn action_deck<const D: usize>(&self) -> &dyn ActionDeck<D> {
        match self {
            LoadDeck::Gravity(load) => load,
            LoadDeck::BodyForce(load) => load,
            LoadDeck::PointForce(load) => load,
            LoadDeck::Traction(load) => load,
            LoadDeck::Pressure(load) => load,
            LoadDeck::BaseMotion(load) => load,
        }
    }

    /// The load without the action that it becomes, and so without a number of axes.
    fn keys(&self) -> &dyn LoadKeys {
        self.action_deck::<3>()
    }

    /// Name of the load.
    pub fn name(&self) -> &str {
        self.keys().name()
    }

    /// Load factor over time, if it is stated.
    pub fn curve(&self) -> Option<&LoadCurve> {
        self.keys().curve()
    }

    /// True if the load has its own course over time.
    pub(crate) fn follows_time(&self) -> bool {
        self.keys().follows_time()
    }

    /// Names of the bodies on whose points the load acts; `None` for all bodies, and empty for a load on a surface.
    pub(crate) fn bodies(&self) -> Option<&[String]> {
        self.keys().bodies()
    }

    /// Name of the surface on which the load acts; `None` if it acts on points.
    pub(crate) fn surface(&self) -> Option<&str> {
        self.keys().surface()
    }

    /// Acceleration at load factor 1, [length/time²]; `None` if the load is not gravity.
    pub(crate) fn acceleration(&self) -> Option<&[f64]> {
        self.keys().acceleration()
    }

    /// True for the pressure of a liquid at rest.
    pub(crate) fn is_hydrostatic(&self) -> bool {
        self.keys().magnitude().0 == "hydrostatic"
    }

    /// The expressions that may be formulas, with their keys relative to the load.
    pub(crate) fn expressions(&self) -> Vec<(String, &Expression)> {
        let intermediate = self.keys().intermediate().into_iter().flatten();
        let intermediate = intermediate.map(|(name, text)| (format!("where/{}", escape(name)), text));
        self.keys().components().into_iter().chain(intermediate).collect()
    }

    /// Key of the magnitude, and true if the magnitude is zero at every load factor.
    pub(crate) fn magnitude(&self) -> (&'static str, bool) {
        self.keys().magnitude()
    }

    /// Checks the keys of the load, which stands at `pointer`.
    pub(crate) fn check(&self, check: &mut dyn Checks, pointer: &str) {
        self.keys().check(check, pointer);
    }

    /// The action of the load in a model; `None` if the load has faults, which have then been reported to the builder.
    pub(crate) fn action<const D: usize>(
        &self,
        builder: &mut dyn Builds,
        pointer: &str,
    ) -> Option<Action<D>> {
        self.action_deck::<D>().action(builder, pointer)
    }
}

/// The components of a vector, each with its key.
fn component_keys<'a>(key: &str, vector: &'a [Expression]) -> Vec<(String, &'a Expression)> {
    vector.iter().enumerate().map(|(axis, component)| (format!("{key}/{axis}"), component)).collect()
}
