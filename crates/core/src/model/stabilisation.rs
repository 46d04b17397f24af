//! Where and how strongly cells that hold hardly any material are stabilised.

use serde::{Deserialize, Serialize};

/// Where the stabilisation acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Where {
    /// Nowhere.
    Off,
    /// On the faces of cells that hold less material than `filling` says, or fewer points than resist all motions of their
    /// nodes.
    #[default]
    Auto,
    /// On the faces of all cells at the boundary of the material, too.
    On,
}

/// Ghost stabilisation of cells that hold hardly any material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Stabilisation {
    /// Where it acts.
    pub mode: Where,
    /// Stiffness of the penalty relative to the shear modulus of the material, [-].
    #[cfg_attr(feature = "schema", schemars(range(min = 1e-9, max = 1e3), extend("examples" = [1e-3])))]
    pub parameter: f64,
    /// Filling ratio below which a cell is stabilised with `auto`: the material carried by its weakest node relative to
    /// what it gets where the cell alone is full, [-].
    #[cfg_attr(feature = "schema", schemars(range(min = 0.0, max = 1.0), extend("examples" = [0.1])))]
    pub filling: f64,
}

impl Default for Stabilisation {
    fn default() -> Self {
        Stabilisation { mode: Where::Auto, parameter: 1e-3, filling: 0.1 }
    }
}
