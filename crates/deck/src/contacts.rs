//! Contact between the bodies of a deck.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::tools::FrictionDeck;

/// Contact between two bodies: they may touch, slide on each other and part. Bodies without contact stick together where
/// they share nodes of the grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyContactDeck {
    /// Names of the two bodies, or `all` for all pairs of bodies that no other entry names.
    #[schemars(extend("examples" = [["block", "ground"], "all"]))]
    pub between: Between,
    /// Coefficient of friction, [-], or `rough`: the surfaces stick as long as they touch. 0 by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [0.3, "rough"]))]
    pub friction: Option<FrictionDeck>,
    /// Shear strength that does not depend on the pressure, [stress]; 0 by default. The shear stress is at most (1 +
    /// `friction`) times the sum of the pressure and the tension, or ten times this sum on rough surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [5e3]))]
    pub adhesion: Option<f64>,
    /// Largest tension, [stress]; 0 by default. It acts once the surfaces have touched, until they separate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [1e3]))]
    pub tension: Option<f64>,
    /// Penalty stiffness of the contact per unit area, as a multiple of 4G/h, with the shear modulus G of the softer body
    /// and the cell size h, [-]; results do not depend on it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-3, max = 1e6), extend("examples" = [10]))]
    pub penalty: Option<f64>,
    /// Largest mean overlap around a node that a converged step may have, relative to the cell size, [-]; 1e-9 by
    /// default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1e-12, max = 0.1), extend("examples" = [1e-9]))]
    pub overlap: Option<f64>,
}

/// The bodies between which contact is given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Between {
    /// Two bodies by name.
    Bodies([String; 2]),
    /// All pairs that are not named.
    All(All),
}

impl Between {
    /// The names of the two bodies; `None` for all pairs.
    pub fn pair(&self) -> Option<&[String; 2]> {
        match self {
            Between::Bodies(pair) => Some(pair),
            Between::All(_) => None,
        }
    }
}

/// All pairs of bodies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum All {
    /// All pairs of bodies.
    All,
}
