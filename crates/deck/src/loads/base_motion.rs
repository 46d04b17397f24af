//! The motion of a rigid base.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ActionDeck, LoadCurve, LoadKeys};
use crate::MotionDeck;
use crate::gates::{Builds, Checks};
use mpm_core::model::Action;

/// Motion of the rigid base on which the bodies stand. The analysis follows the base: its acceleration acts on the bodies
/// as a force per mass in the opposite direction, and all displacements and velocities are relative to the base. For a
/// base that is not rigid, let a stage `absorb` waves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BaseMotionDeck {
    /// Name, unique among the loads.
    pub name: String,
    /// The motion.
    pub motion: MotionDeck,
    /// Names of the bodies it acts on; all bodies by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bodies: Option<Vec<String>>,
}

impl LoadKeys for BaseMotionDeck {
    fn name(&self) -> &str {
        &self.name
    }

    fn curve(&self) -> Option<&LoadCurve> {
        None
    }

    fn follows_time(&self) -> bool {
        true
    }

    fn bodies(&self) -> Option<&[String]> {
        self.bodies.as_deref()
    }

    fn magnitude(&self) -> (&'static str, bool) {
        ("motion/scale", self.motion.scale == 0.0)
    }

    fn check(&self, check: &mut dyn Checks, pointer: &str) {
        if self.motion.axis as usize >= check.dimensions() {
            check.wrong_dimension(&format!("{pointer}/motion/axis"), "the axis `z`", 3);
        }
        check.targets(&format!("{pointer}/bodies"), self.bodies.as_deref());
        check.weight(pointer, &self.name, self.bodies.as_deref());
    }
}

impl<const D: usize> ActionDeck<D> for BaseMotionDeck {
    fn action(&self, _: &mut dyn Builds, _: &str) -> Option<Action<D>> {
        let axis = self.motion.axis as usize;
        Some(Action::Gravity(std::array::from_fn(|d| if d == axis { -1.0 } else { 0.0 })))
    }
}
