//! Hencky elasticity.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawDeck;
use crate::material::{Faults, Reading, StatedLaw, consistent};
use crate::{Drainage, Expression};
use mpm_core::material::Hencky;

/// Hencky elasticity: Kirchhoff stress linear in the logarithmic strain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HenckyDeck {
    /// Young's modulus E, [stress].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [12e6]))]
    pub young: Expression,
    /// Poisson's ratio ν, [-].
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
    pub poisson: Expression,
    /// Initial mass density ρ₀, [mass/volume], without the water of a `level` in the pores; needed if gravity or a
    /// force per mass acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [2000]))]
    pub density: Option<Expression>,
    /// Share n₀ of the pores in the initial volume, [-]; needed in bodies that the water of the deck reaches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0, "examples" = [0.4]))]
    pub porosity: Option<f64>,
    /// What the water in the pores does; `drained` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = ["undrained"]))]
    pub drainage: Option<Drainage>,
    /// Poisson's ratio ν_u of the whole without drainage, [-], above `poisson`: states the stiffness of the pore water of
    /// an undrained material in place of the bulk modulus of the water and the porosity.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.495]))]
    pub undrained_poisson: Option<f64>,
}

impl LawDeck for HenckyDeck {
    fn density(&self) -> Option<&Expression> {
        self.density.as_ref()
    }

    fn read(&self, mut read: Reading) -> Result<StatedLaw, Faults> {
        let [young, poisson] = read.elasticity(&self.young, &self.poisson);
        read.finish(move |p| Hencky::new(young.at(p), poisson.at(p)), consistent)
    }
}
