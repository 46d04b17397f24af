//! Von Mises plasticity.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{LawDeck, zero};
use crate::material::{Faults, Inconsistency, Reading, Setting, StatedLaw};
use crate::quoting::list;
use crate::{Drainage, Expression};
use mpm_core::material::VonMises;

/// Von Mises plasticity with linear isotropic hardening: f = √(2 J₂) − (ρ_y + H κ) in terms of the Kirchhoff stress
/// and the equivalent plastic strain κ. Exactly one of `deviatoric_yield_stress`, `yield_stress` and
/// `undrained_strength` is needed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VonMisesDeck {
    /// Young's modulus E, [stress].
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [12e6]))]
    pub young: Expression,
    /// Poisson's ratio ν, [-].
    #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
    pub poisson: Expression,
    /// Deviatoric yield stress ρ_y = √(2 J₂) at yield, [stress].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e3]))]
    pub deviatoric_yield_stress: Option<Expression>,
    /// Yield stress σ_y in a tension test, [stress]: ρ_y = √(2/3) σ_y.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [250e6]))]
    pub yield_stress: Option<Expression>,
    /// Undrained shear strength s_u in plane strain, [stress]: ρ_y = √2 s_u. In triaxial compression, (σ₁ − σ₃)/2
    /// then reaches only √3/2 s_u.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e3]))]
    pub undrained_strength: Option<Expression>,
    /// Hardening modulus H, the increase in ρ_y per unit of equivalent plastic strain, [stress]; √(2/3) times the
    /// slope of uniaxial stress against plastic strain. 0 means perfect plasticity.
    #[serde(default = "zero")]
    #[schemars(extend("minimum" = 0.0))]
    pub hardening_modulus: Expression,
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

impl LawDeck for VonMisesDeck {
    fn density(&self) -> Option<&Expression> {
        self.density.as_ref()
    }

    fn read(&self, mut read: Reading) -> Result<StatedLaw, Faults> {
        let [young, poisson] = read.elasticity(&self.young, &self.poisson);
        // Each key, with the ratio of the radius of the yield surface to the stress that the key states.
        let strengths = [
            ("deviatoric_yield_stress", 1.0, &self.deviatoric_yield_stress),
            ("yield_stress", (2.0f64 / 3.0).sqrt(), &self.yield_stress),
            ("undrained_strength", std::f64::consts::SQRT_2, &self.undrained_strength),
        ];
        let mut stated = Vec::new();
        let (mut strength, mut scale) = (Setting::Constant(f64::NAN), 1.0);
        for (key, scale_of_key, value) in strengths {
            if let Some(value) = value {
                stated.push(key);
                (strength, scale) = (read.get(key, "stress", value), scale_of_key);
            }
        }
        let hardening = read.get("hardening_modulus", "stress", &self.hardening_modulus);
        read.finish(
            move |p| {
                let law = VonMises::new(young.at(p), poisson.at(p), scale * strength.at(p));
                law.hardening(hardening.at(p))
            },
            move |_| one_strength(&stated),
        )
    }

    fn flows_at_constant_volume(&self) -> bool {
        true
    }
}

/// Exactly one key must state the strength.
fn one_strength(stated: &[&str]) -> Option<Inconsistency> {
    let help = "give exactly one of `deviatoric_yield_stress`, `yield_stress` and `undrained_strength`";
    match stated {
        [_] => None,
        [] => Inconsistency::new("", "no key states its strength".to_owned(), help),
        [.., last] => {
            let keys = list(stated.iter().copied());
            Inconsistency::new(last, format!("{keys} state its strength more than once"), help)
        }
    }
}
