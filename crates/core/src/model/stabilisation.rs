//! Settings of the ghost stabilisation.

use serde::{Deserialize, Serialize};

/// Where the ghost stabilisation acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum StabilisationMode {
    /// Nowhere.
    Off,
    /// On the faces of cells whose filling ratio is below `filling`, or that have too few points to resist every motion
    /// of their nodes.
    #[default]
    Auto,
    /// In addition to `Auto`, on the faces of all cells at the boundary of the material.
    On,
}

/// Ghost stabilisation of cells with little material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Stabilisation {
    /// Where it acts.
    pub mode: StabilisationMode,
    /// Penalty stiffness relative to the shear modulus of the material, [-].
    #[cfg_attr(feature = "schema", schemars(range(min = 1e-9, max = 1e3), extend("examples" = [1e-3])))]
    pub parameter: f64,
    /// Filling ratio below which `auto` stabilises a cell: the material volume assigned to its node with the least
    /// material, relative to the volume that would be assigned to the node if only this cell were full, [-].
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 1.0), extend("examples" = [0.1])))]
    pub filling: f64,
}

impl Default for Stabilisation {
    fn default() -> Self {
        Stabilisation { mode: StabilisationMode::Auto, parameter: 1e-3, filling: 0.1 }
    }
}
