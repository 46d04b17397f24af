//! Modified Cam-clay.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LawDeck, unity, zero};
use crate::material::{Faults, Inconsistency, Reading, Setting, StatedLaw};
use crate::{Drainage, Expression};
use mpm_core::material::{CamClay, ModifiedCamClay};

/// Modified Cam-clay at finite strain: f = q²/M² + P (P − P_c) in terms of the Kirchhoff stress, with ln J linear
/// in ln P. Bodies of this material need an `initial_stress` that is compressive everywhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ModifiedCamClayDeck {
    /// Slope λ̂ of the virgin compression line of ln J against ln P, [-]: λ/(1 + e₀) in terms of the void ratio.
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.09]))]
    pub compression_index: Expression,
    /// Slope κ̂ of the unloading lines, less than λ̂, [-].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.018]))]
    pub swelling_index: Expression,
    /// M, the ratio q/P at the critical state, [-]: 6 sin φ/(3 − sin φ) for the friction angle φ in compression.
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1.05]))]
    pub critical_state_ratio: Expression,
    /// Shear modulus μ₀ at zero pressure, [stress].
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = 0.0, "examples" = [3e6]))]
    pub shear_modulus: Expression,
    /// Growth α of the shear modulus with pressure, [-]: μ = μ₀ + α P₀ e^(−ε_v/κ̂).
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = 0.0, "examples" = [0]))]
    pub shear_modulus_ratio: Expression,
    /// Overconsolidation ratio of the initial stress, [-]: the preconsolidation pressure P_c divided by the value
    /// of P_c for which the yield ellipse passes through the initial stress.
    #[serde(default = "unity")]
    #[schemars(extend("minimum" = 1.0, "examples" = [1.5]))]
    pub overconsolidation_ratio: Expression,
    /// Pressure P₀ at which the elastic strain is zero, [stress]; it affects stresses only through the initial
    /// stresses. It also sets the scale of stabilisations, so choose a pressure that is typical of the body.
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [100e3]))]
    pub reference_pressure: Expression,
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
}

impl LawDeck for ModifiedCamClayDeck {
    fn density(&self) -> Option<&Expression> {
        self.density.as_ref()
    }

    fn read(&self, mut read: Reading) -> Result<StatedLaw, Faults> {
        let settings = Settings {
            compression_index: read.get("compression_index", "-", &self.compression_index),
            swelling_index: read.get("swelling_index", "-", &self.swelling_index),
            critical_state_ratio: read.get("critical_state_ratio", "-", &self.critical_state_ratio),
            shear_modulus: read.get("shear_modulus", "stress", &self.shear_modulus),
            shear_modulus_ratio: read.get("shear_modulus_ratio", "-", &self.shear_modulus_ratio),
            overconsolidation_ratio: read.get("overconsolidation_ratio", "-", &self.overconsolidation_ratio),
            reference_pressure: read.get("reference_pressure", "stress", &self.reference_pressure),
        };
        let (swelling, compression) = (settings.swelling_index, settings.compression_index);
        read.below("swelling_index", swelling, "compression_index", compression);
        read.finish(
            move |p| ModifiedCamClay::new(settings.at(p)),
            move |p| without_shear_stiffness(&settings.at(p)),
        )
    }

    fn needs_initial_stress(&self) -> bool {
        true
    }

    fn keeps_strength(&self) -> bool {
        true
    }
}

/// Settings of [`CamClay`].
#[derive(Clone, Copy)]
struct Settings {
    compression_index: Setting,
    swelling_index: Setting,
    critical_state_ratio: Setting,
    shear_modulus: Setting,
    shear_modulus_ratio: Setting,
    overconsolidation_ratio: Setting,
    reference_pressure: Setting,
}

impl Settings {
    fn at(&self, properties: &[f64]) -> CamClay {
        CamClay {
            compression_index: self.compression_index.at(properties),
            swelling_index: self.swelling_index.at(properties),
            critical_state_ratio: self.critical_state_ratio.at(properties),
            shear_modulus: self.shear_modulus.at(properties),
            shear_modulus_ratio: self.shear_modulus_ratio.at(properties),
            overconsolidation_ratio: self.overconsolidation_ratio.at(properties),
            reference_pressure: self.reference_pressure.at(properties),
        }
    }
}

/// Finds a stiffness in shear that is missing or too small for the critical state.
fn without_shear_stiffness(clay: &CamClay) -> Option<Inconsistency> {
    if clay.shear_modulus > 0.0 && !clay.carries_critical_state() {
        let message =
            "the shear modulus depends too strongly on the pressure: the elastic law cannot reach the \
                       critical state"
                .to_owned();
        let help = "give `shear_modulus` alone, or a larger `shear_modulus` or `shear_modulus_ratio`";
        return Inconsistency::new("shear_modulus_ratio", message, help);
    }
    let (largest, needed) = (clay.largest_stress_ratio(), clay.critical_state_ratio);
    if clay.shear_modulus > 0.0 || largest > needed {
        return None;
    }
    if clay.shear_modulus_ratio > 0.0 {
        let message = format!(
            "the elastic law reaches at most q/p = sqrt(1.5 shear_modulus_ratio swelling_index) = {largest:.4}, but the \
             critical state needs {needed:.4}"
        );
        let least = needed * needed / (1.5 * clay.swelling_index);
        let help = format!("give more than {least:.4}, or `shear_modulus` instead");
        return Inconsistency::new("shear_modulus_ratio", message, &help);
    }
    let message = "the material has no stiffness in shear".to_owned();
    Inconsistency::new("shear_modulus", message, "give `shear_modulus` or `shear_modulus_ratio`")
}
