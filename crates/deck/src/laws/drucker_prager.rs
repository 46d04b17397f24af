//! Drucker-Prager plasticity.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LawDeck, cauchy, zero};
use crate::material::{Faults, Reading, StatedLaw};
use crate::{Drainage, Expression};
use mpm_core::material::{DruckerPrager, Match, StrengthMeasure};

/// Drucker-Prager plasticity: f = √J₂ + η p − ξ c with the mean stress p, a cone matched to the Mohr-Coulomb
/// strength, flow with the dilation angle ψ, and return to the apex.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DruckerPragerDeck {
    /// Young's modulus E, [stress].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e6]))]
    pub young: Expression,
    /// Poisson's ratio ν, [-].
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
    pub poisson: Expression,
    /// Cohesion c, [stress].
    #[schemars(extend("minimum" = 0.0, "examples" = [5e3]))]
    pub cohesion: Expression,
    /// Friction angle φ, [degrees].
    #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [30]))]
    pub friction_angle: Expression,
    /// Dilation angle ψ, [degrees], at most the friction angle.
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [0]))]
    pub dilation_angle: Expression,
    /// Stress states in which the cone has the Mohr-Coulomb strength.
    #[serde(rename = "match")]
    pub matched: Match,
    /// Stress measure that the strength limits.
    #[serde(default = "cauchy")]
    pub strength: StrengthMeasure,
    /// Initial mass density ρ₀, [mass/volume], without the water of a `level` in the pores; needed if gravity or a
    /// force per mass acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [1800]))]
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

impl LawDeck for DruckerPragerDeck {
    fn density(&self) -> Option<&Expression> {
        self.density.as_ref()
    }

    fn read(&self, mut read: Reading) -> Result<StatedLaw, Faults> {
        let [young, poisson] = read.elasticity(&self.young, &self.poisson);
        let friction = read.friction(&self.cohesion, &self.friction_angle, &self.dilation_angle);
        let (matched, measure) = (self.matched, self.strength);
        read.finish(
            move |p| {
                let law = DruckerPrager::new(young.at(p), poisson.at(p), friction.at(p), matched);
                law.limiting(measure)
            },
            move |p| friction.without_strength(p),
        )
    }

    fn flows_at_constant_volume(&self) -> bool {
        self.dilation_angle.as_number() == Some(0.0)
    }

    fn dilation_angle(&self) -> f64 {
        self.dilation_angle.as_number().unwrap_or(0.0)
    }

    fn is_associated(&self) -> bool {
        self.friction_angle == self.dilation_angle
    }
}
