//! Gravity.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ActionDeck, LoadCurve, LoadKeys};
use crate::Vector;
use crate::gates::{Builds, Checks};
use crate::per_axis::array;
use mpm_core::model::Action;

/// Weight: the constant mass of each point times the acceleration.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GravityDeck {
    /// Name, unique among the loads.
    pub name: String,
    /// Acceleration at load factor 1, [length/time²], one number per axis.
    #[schemars(with = "Vector", extend("examples" = [[0, -9.81]]))]
    pub acceleration: Vec<f64>,
    /// Names of the bodies it acts on; all bodies by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bodies: Option<Vec<String>>,
    /// Load factor over time; by default, a linear ramp from 0 to 1, or 1 from time 0 on if the load acts on a body
    /// with `initial_stress`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<LoadCurve>,
}

impl LoadKeys for GravityDeck {
    fn name(&self) -> &str {
        &self.name
    }

    fn curve(&self) -> Option<&LoadCurve> {
        self.curve.as_ref()
    }

    fn bodies(&self) -> Option<&[String]> {
        self.bodies.as_deref()
    }

    fn acceleration(&self) -> Option<&[f64]> {
        Some(&self.acceleration)
    }

    fn magnitude(&self) -> (&'static str, bool) {
        ("acceleration", self.acceleration.iter().all(|a| *a == 0.0))
    }

    fn check(&self, check: &mut dyn Checks, pointer: &str) {
        check.vector(&format!("{pointer}/acceleration"), &self.acceleration);
        check.targets(&format!("{pointer}/bodies"), self.bodies.as_deref());
        check.weight(pointer, &self.name, self.bodies.as_deref());
    }
}

impl<const D: usize> ActionDeck<D> for GravityDeck {
    fn action(&self, _: &mut dyn Builds, _: &str) -> Option<Action<D>> {
        Some(Action::Gravity(array(&self.acceleration)))
    }
}
