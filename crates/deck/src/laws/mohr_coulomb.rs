//! Mohr-Coulomb plasticity.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LawDeck, cauchy, zero};
use crate::material::{Decay, Faults, FrictionSettings, Reading, StatedLaw, too_steep};
use crate::{Drainage, Expression};
use mpm_core::material::{MohrCoulomb, StrengthMeasure};

/// Mohr-Coulomb plasticity: f = N τ₁ − τ₃ − 2c√N with N = (1 + sin φ)/(1 − sin φ), flow with the dilation angle ψ
/// in place of φ and, if stated, a tension cut-off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MohrCoulombDeck {
    /// Young's modulus E, [stress].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e6]))]
    pub young: Expression,
    /// Poisson's ratio ν, [-].
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
    pub poisson: Expression,
    /// Cohesion c, [stress]; without cohesion, points at a free surface have no stiffness once they yield.
    #[schemars(extend("minimum" = 0.0, "examples" = [5e3]))]
    pub cohesion: Expression,
    /// Friction angle φ, [degrees].
    #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [30]))]
    pub friction_angle: Expression,
    /// Dilation angle ψ, [degrees], at most the friction angle.
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [0]))]
    pub dilation_angle: Expression,
    /// Tensile strength, [stress]: no principal stress exceeds it. Without this key, or if its value exceeds c cot
    /// φ, the apex of the yield surface limits tension.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [0]))]
    pub tensile_strength: Option<Expression>,
    /// Stress measure that the strength limits.
    #[serde(default = "cauchy")]
    pub strength: StrengthMeasure,
    /// Loss of strength with plastic strain; without this key, the strength stays constant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub softening: Option<FrictionSofteningDeck>,
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

/// Loss of strength: c, tan φ and tan ψ decay from their peak to a residual value with the factor e^(−3κ/κ₉₅), where κ
/// is the equivalent plastic strain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionSofteningDeck {
    /// Equivalent plastic strain κ₉₅ after which 95 % of the loss has occurred, [-].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.5]))]
    pub strain: Expression,
    /// Residual cohesion, [stress]; the tensile strength decays in proportion to the cohesion.
    #[schemars(extend("minimum" = 0.0, "examples" = [1e3]))]
    pub residual_cohesion: Expression,
    /// Residual friction angle, [degrees].
    #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [25]))]
    pub residual_friction_angle: Expression,
    /// Residual dilation angle, [degrees].
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [0]))]
    pub residual_dilation_angle: Expression,
    /// Width of the shear band for which `strain` is given, [length]: in cells of size h, `strain` is multiplied by
    /// band/h, so that the displacement that softens a band one cell wide does not depend on the grid. Without this
    /// key, results depend on the grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.1]))]
    pub band: Option<f64>,
}

impl LawDeck for MohrCoulombDeck {
    fn density(&self) -> Option<&Expression> {
        self.density.as_ref()
    }

    fn read(&self, mut read: Reading) -> Result<StatedLaw, Faults> {
        let [young, poisson] = read.elasticity(&self.young, &self.poisson);
        let friction = read.friction(&self.cohesion, &self.friction_angle, &self.dilation_angle);
        let tensile = self.tensile_strength.as_ref();
        let tensile = tensile.map(|tensile| read.get("tensile_strength", "stress", tensile));
        let softening = self.softening.as_ref().map(|given| given.read(&mut read, &friction));
        let measure = self.strength;
        let law = move |p: &[f64]| {
            let law = MohrCoulomb::new(young.at(p), poisson.at(p), friction.at(p)).limiting(measure);
            let law = tensile.map_or(law.clone(), |tensile| law.tensile_strength(tensile.at(p)));
            match &softening {
                Some((residual, decay)) => law.softening(residual.at(p), decay.at(p)),
                None => law,
            }
        };
        let steep = move |p: &[f64]| {
            let (residual, decay): &(FrictionSettings, Decay) = softening.as_ref()?;
            too_steep(decay, p, [young.at(p), poisson.at(p)], [friction.at(p), residual.at(p)])
        };
        read.finish(law, move |p| friction.without_strength(p).or_else(|| steep(p)))
    }

    fn flows_at_constant_volume(&self) -> bool {
        self.dilation_angle.as_number() == Some(0.0)
    }

    fn dilation_angle(&self) -> f64 {
        self.dilation_angle.as_number().unwrap_or(0.0)
    }

    fn is_associated(&self) -> bool {
        let is_same_after = |softening: &FrictionSofteningDeck| {
            softening.residual_friction_angle == softening.residual_dilation_angle
        };
        self.friction_angle == self.dilation_angle && self.softening.as_ref().is_none_or(is_same_after)
    }

    fn softening(&self) -> Option<Option<f64>> {
        self.softening.as_ref().map(|softening| softening.band)
    }
}

impl FrictionSofteningDeck {
    /// Reads the residual strength and κ₉₅; `peak` is the strength at the peak.
    fn read(&self, read: &mut Reading, peak: &FrictionSettings) -> (FrictionSettings, Decay) {
        let residual = FrictionSettings {
            cohesion: read.get("softening/residual_cohesion", "stress", &self.residual_cohesion),
            friction_angle: read.get(
                "softening/residual_friction_angle",
                "degrees",
                &self.residual_friction_angle,
            ),
            dilation_angle: read.get(
                "softening/residual_dilation_angle",
                "degrees",
                &self.residual_dilation_angle,
            ),
        };
        read.at_most("softening/residual_cohesion", residual.cohesion, "cohesion", peak.cohesion);
        read.at_most(
            "softening/residual_friction_angle",
            residual.friction_angle,
            "friction_angle",
            peak.friction_angle,
        );
        read.at_most(
            "softening/residual_dilation_angle",
            residual.dilation_angle,
            "residual_friction_angle",
            residual.friction_angle,
        );
        let strain = read.get("softening/strain", "-", &self.strain);
        (residual, read.decay(strain, self.band))
    }
}
