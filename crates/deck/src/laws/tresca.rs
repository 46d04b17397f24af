//! Tresca plasticity.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawDeck;
use crate::material::{Decay, Faults, Reading, Setting, StatedLaw, too_steep};
use crate::{Drainage, Expression};
use mpm_core::material::{Friction, StrengthMeasure, Tresca};

/// Tresca plasticity for undrained clay: f = τ₁ − τ₃ − 2 s_u, with flow at constant volume.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TrescaDeck {
    /// Young's modulus E, [stress].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [5e6]))]
    pub young: Expression,
    /// Poisson's ratio ν, [-].
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.49]))]
    pub poisson: Expression,
    /// Undrained shear strength s_u, [stress].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e3, "5e3 + 1.5e3*(10 - Y)"]))]
    pub cohesion: Expression,
    /// Stress measure that the strength limits.
    #[serde(default)]
    pub strength: StrengthMeasure,
    /// Loss of strength with plastic strain; without this key, the strength stays constant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub softening: Option<CohesionSofteningDeck>,
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

/// Loss of undrained strength: s_u = s_r + (s_p − s_r) e^(−3κ/κ₉₅) with the equivalent plastic strain κ.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CohesionSofteningDeck {
    /// Equivalent plastic strain κ₉₅ after which 95 % of the loss has occurred, [-]; in simple shear, √3 κ is the
    /// plastic shear strain.
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.5]))]
    pub strain: Expression,
    /// Remoulded strength, [stress].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [5e3]))]
    pub residual_cohesion: Expression,
    /// Width of the shear band for which `strain` is given, [length]: in cells of size h, `strain` is multiplied by
    /// band/h, so that the displacement that softens a band one cell wide does not depend on the grid. Without this
    /// key, results depend on the grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.1]))]
    pub band: Option<f64>,
}

impl LawDeck for TrescaDeck {
    fn density(&self) -> Option<&Expression> {
        self.density.as_ref()
    }

    fn read(&self, mut read: Reading) -> Result<StatedLaw, Faults> {
        let [young, poisson] = read.elasticity(&self.young, &self.poisson);
        let cohesion = read.get("cohesion", "stress", &self.cohesion);
        let softening = self.softening.as_ref().map(|given| given.read(&mut read, cohesion));
        let measure = self.strength;
        let steep = move |p: &[f64]| {
            let (residual, decay) = softening.as_ref()?;
            let [peak, residual] = [cohesion, *residual].map(|cohesion| Friction {
                cohesion: cohesion.at(p),
                friction_angle: 0.0,
                dilation_angle: 0.0,
            });
            too_steep(decay, p, [young.at(p), poisson.at(p)], [peak, residual])
        };
        let law = move |p: &[f64]| {
            let law = Tresca::new(young.at(p), poisson.at(p), cohesion.at(p)).limiting(measure);
            match &softening {
                Some((residual, decay)) => law.softening(residual.at(p), decay.at(p)),
                None => law,
            }
        };
        read.finish(law, steep)
    }

    fn flows_at_constant_volume(&self) -> bool {
        true
    }

    fn softening(&self) -> Option<Option<f64>> {
        self.softening.as_ref().map(|softening| softening.band)
    }
}

impl CohesionSofteningDeck {
    /// Reads the residual cohesion and κ₉₅; `cohesion` is that at the peak.
    fn read(&self, read: &mut Reading, cohesion: Setting) -> (Setting, Decay) {
        let residual = read.get("softening/residual_cohesion", "stress", &self.residual_cohesion);
        read.at_most("softening/residual_cohesion", residual, "cohesion", cohesion);
        let strain = read.get("softening/strain", "-", &self.strain);
        (residual, read.decay(strain, self.band))
    }
}
