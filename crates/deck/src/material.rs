//! Materials: constitutive laws and their properties, which may vary in space.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Expression;
use mpm_core::material::{Match, StrengthMeasure};

mod built_law;
mod cell_size;
mod consistency;
mod law;
mod laws;
mod of_points;
mod property;
mod reading;

pub use built_law::BuiltLaw;
pub use cell_size::CellSize;
pub use law::Surroundings;
pub(crate) use of_points::MaterialOfPoints;

/// A constitutive law and its properties. Each number of a built-in law may also be a formula in X, Y (the original
/// position), in space also Z, and the parameters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "model", rename_all = "kebab-case", deny_unknown_fields)]
pub enum MaterialDeck {
    /// Hencky elasticity: Kirchhoff stress linear in the logarithmic strain.
    Hencky {
        /// Young's modulus E, [stress].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [12e6]))]
        young: Expression,
        /// Poisson's ratio ν, [-].
        #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
        poisson: Expression,
        /// Initial mass density ρ₀, [mass/volume]; needed if gravity or a force per mass acts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [2000]))]
        density: Option<Expression>,
    },
    /// Compressible neo-Hookean elasticity: W = μ/2 (tr b − 3) − μ ln J + λ/2 (ln J)², with λ and μ from E and ν.
    NeoHookean {
        /// Young's modulus E at small strains, [stress].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1e6]))]
        young: Expression,
        /// Poisson's ratio ν at small strains, [-].
        #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
        poisson: Expression,
        /// Initial mass density ρ₀, [mass/volume]; needed if gravity or a force per mass acts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [2000]))]
        density: Option<Expression>,
    },
    /// Von Mises plasticity with linear isotropic hardening: f = √(2 J₂) − (ρ_y + H κ) in terms of the Kirchhoff stress
    /// and the equivalent plastic strain κ. Exactly one of `deviatoric_yield_stress`, `yield_stress` and
    /// `undrained_strength` is needed.
    VonMises {
        /// Young's modulus E, [stress].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [12e6]))]
        young: Expression,
        /// Poisson's ratio ν, [-].
        #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
        poisson: Expression,
        /// Deviatoric yield stress ρ_y = √(2 J₂) at yield, [stress].
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e3]))]
        deviatoric_yield_stress: Option<Expression>,
        /// Yield stress σ_y in a tension test, [stress]: ρ_y = √(2/3) σ_y.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [250e6]))]
        yield_stress: Option<Expression>,
        /// Undrained shear strength s_u in plane strain, [stress]: ρ_y = √2 s_u. In triaxial compression, (σ₁ − σ₃)/2
        /// then reaches only √3/2 s_u.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e3]))]
        undrained_strength: Option<Expression>,
        /// Hardening modulus H, the increase in ρ_y per unit of equivalent plastic strain, [stress]; √(2/3) times the
        /// slope of uniaxial stress against plastic strain. 0 means perfect plasticity.
        #[serde(default = "zero")]
        #[schemars(extend("minimum" = 0.0))]
        hardening_modulus: Expression,
        /// Initial mass density ρ₀, [mass/volume]; needed if gravity or a force per mass acts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [2000]))]
        density: Option<Expression>,
    },
    /// Tresca plasticity for undrained clay: f = τ₁ − τ₃ − 2 s_u, with flow at constant volume.
    Tresca {
        /// Young's modulus E, [stress].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [5e6]))]
        young: Expression,
        /// Poisson's ratio ν, [-].
        #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.49]))]
        poisson: Expression,
        /// Undrained shear strength s_u, [stress].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e3, "5e3 + 1.5e3*(10 - Y)"]))]
        cohesion: Expression,
        /// Stress measure that the strength limits.
        #[serde(default)]
        strength: StrengthMeasure,
        /// Loss of strength with plastic strain; without this key, the strength stays constant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        softening: Option<CohesionSofteningDeck>,
        /// Initial mass density ρ₀, [mass/volume]; needed if gravity or a force per mass acts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [1800]))]
        density: Option<Expression>,
    },
    /// Mohr-Coulomb plasticity: f = N τ₁ − τ₃ − 2c√N with N = (1 + sin φ)/(1 − sin φ), flow with the dilation angle ψ
    /// in place of φ and, if stated, a tension cut-off.
    MohrCoulomb {
        /// Young's modulus E, [stress].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e6]))]
        young: Expression,
        /// Poisson's ratio ν, [-].
        #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
        poisson: Expression,
        /// Cohesion c, [stress]; without cohesion, points at a free surface have no stiffness once they yield.
        #[schemars(extend("minimum" = 0.0, "examples" = [5e3]))]
        cohesion: Expression,
        /// Friction angle φ, [degrees].
        #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [30]))]
        friction_angle: Expression,
        /// Dilation angle ψ, [degrees], at most the friction angle.
        #[serde(default = "zero")]
        #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [0]))]
        dilation_angle: Expression,
        /// Tensile strength, [stress]: no principal stress exceeds it. Without this key, or if its value exceeds c cot
        /// φ, the apex of the yield surface limits tension.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [0]))]
        tensile_strength: Option<Expression>,
        /// Stress measure that the strength limits.
        #[serde(default = "cauchy")]
        strength: StrengthMeasure,
        /// Loss of strength with plastic strain; without this key, the strength stays constant.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        softening: Option<FrictionSofteningDeck>,
        /// Initial mass density ρ₀, [mass/volume]; needed if gravity or a force per mass acts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [1800]))]
        density: Option<Expression>,
    },
    /// Drucker-Prager plasticity: f = √J₂ + η p − ξ c with the mean stress p, a cone matched to the Mohr-Coulomb
    /// strength, flow with the dilation angle ψ, and return to the apex.
    DruckerPrager {
        /// Young's modulus E, [stress].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [20e6]))]
        young: Expression,
        /// Poisson's ratio ν, [-].
        #[schemars(extend("exclusiveMinimum" = -1.0, "exclusiveMaximum" = 0.5, "examples" = [0.3]))]
        poisson: Expression,
        /// Cohesion c, [stress].
        #[schemars(extend("minimum" = 0.0, "examples" = [5e3]))]
        cohesion: Expression,
        /// Friction angle φ, [degrees].
        #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [30]))]
        friction_angle: Expression,
        /// Dilation angle ψ, [degrees], at most the friction angle.
        #[serde(default = "zero")]
        #[schemars(extend("minimum" = 0.0, "exclusiveMaximum" = 90.0, "examples" = [0]))]
        dilation_angle: Expression,
        /// Stress states in which the cone has the Mohr-Coulomb strength.
        #[serde(rename = "match")]
        matched: Match,
        /// Stress measure that the strength limits.
        #[serde(default = "cauchy")]
        strength: StrengthMeasure,
        /// Initial mass density ρ₀, [mass/volume]; needed if gravity or a force per mass acts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [1800]))]
        density: Option<Expression>,
    },
    /// Modified Cam-clay at finite strain: f = q²/M² + P (P − P_c) in terms of the Kirchhoff stress, with ln J linear
    /// in ln P. Bodies of this material need an `initial_stress` that is compressive everywhere.
    ModifiedCamClay {
        /// Slope λ̂ of the virgin compression line of ln J against ln P, [-]: λ/(1 + e₀) in terms of the void ratio.
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.09]))]
        compression_index: Expression,
        /// Slope κ̂ of the unloading lines, less than λ̂, [-].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.018]))]
        swelling_index: Expression,
        /// M, the ratio q/P at the critical state, [-]: 6 sin φ/(3 − sin φ) for the friction angle φ in compression.
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1.05]))]
        critical_state_ratio: Expression,
        /// Shear modulus μ₀ at zero pressure, [stress].
        #[serde(default = "zero")]
        #[schemars(extend("minimum" = 0.0, "examples" = [3e6]))]
        shear_modulus: Expression,
        /// Growth α of the shear modulus with pressure, [-]: μ = μ₀ + α P₀ e^(−ε_v/κ̂).
        #[serde(default = "zero")]
        #[schemars(extend("minimum" = 0.0, "examples" = [0]))]
        shear_modulus_ratio: Expression,
        /// Overconsolidation ratio of the initial stress, [-]: the preconsolidation pressure P_c divided by the value
        /// of P_c for which the yield ellipse passes through the initial stress.
        #[serde(default = "unity")]
        #[schemars(extend("minimum" = 1.0, "examples" = [1.5]))]
        overconsolidation_ratio: Expression,
        /// Pressure P₀ at which the elastic strain is zero, [stress]; it affects stresses only through the initial
        /// stresses. It also sets the scale of stabilisations, so choose a pressure that is typical of the body.
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [100e3]))]
        reference_pressure: Expression,
        /// Initial mass density ρ₀, [mass/volume]; needed if gravity or a force per mass acts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [1800]))]
        density: Option<Expression>,
    },
    /// A law of your own in a shared library, written in C, Fortran or another compiled language; its code runs as part
    /// of the program.
    Library {
        /// Path of the library, relative to the deck.
        #[schemars(extend("examples" = ["./law.so"]))]
        file: String,
        /// Values of the parameters of the law, with the names and in the units that the library states.
        #[serde(default)]
        #[schemars(extend("examples" = [{"young": 12e6, "poisson": 0.3}]))]
        parameters: BTreeMap<String, f64>,
        /// Initial mass density ρ₀, [mass/volume]; needed if gravity or a force per mass acts.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("minimum" = 0.0, "examples" = [2000]))]
        density: Option<Expression>,
    },
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

fn zero() -> Expression {
    Expression::Number(0.0)
}

fn unity() -> Expression {
    Expression::Number(1.0)
}

fn cauchy() -> StrengthMeasure {
    StrengthMeasure::Cauchy
}

impl MaterialDeck {
    /// Young's modulus E, [stress], if the material has one that does not vary.
    pub fn young(&self) -> Option<f64> {
        self.number("young")
    }

    /// Poisson's ratio ν, [-], if the material has one that does not vary.
    pub fn poisson(&self) -> Option<f64> {
        self.number("poisson")
    }

    /// The density, if it is stated.
    pub fn density(&self) -> Option<&Expression> {
        match self {
            MaterialDeck::Hencky { density, .. }
            | MaterialDeck::NeoHookean { density, .. }
            | MaterialDeck::VonMises { density, .. }
            | MaterialDeck::Tresca { density, .. }
            | MaterialDeck::MohrCoulomb { density, .. }
            | MaterialDeck::DruckerPrager { density, .. }
            | MaterialDeck::ModifiedCamClay { density, .. }
            | MaterialDeck::Library { density, .. } => density.as_ref(),
        }
    }

    fn number(&self, key: &str) -> Option<f64> {
        let is_own = |(name, _): &(String, Expression)| name == key && self.library().is_none();
        self.properties().into_iter().find(is_own)?.1.as_number()
    }

    /// True if the material flows plastically at constant volume.
    pub fn flows_at_constant_volume(&self) -> bool {
        let is_zero = |angle: &Expression| angle.as_number() == Some(0.0);
        match self {
            MaterialDeck::VonMises { .. } | MaterialDeck::Tresca { .. } => true,
            MaterialDeck::MohrCoulomb { dilation_angle, .. }
            | MaterialDeck::DruckerPrager { dilation_angle, .. } => is_zero(dilation_angle),
            _ => false,
        }
    }

    /// True if the dilation angle equals the friction angle, both at the peak and after softening. Otherwise, factors
    /// of safety depend on the cell size.
    pub fn is_associated(&self) -> bool {
        match self {
            MaterialDeck::MohrCoulomb { friction_angle, dilation_angle, softening, .. } => {
                let is_same_after = softening.as_ref().is_none_or(|softening| {
                    softening.residual_friction_angle == softening.residual_dilation_angle
                });
                friction_angle == dilation_angle && is_same_after
            }
            MaterialDeck::DruckerPrager { friction_angle, dilation_angle, .. } => {
                friction_angle == dilation_angle
            }
            MaterialDeck::Hencky { .. }
            | MaterialDeck::NeoHookean { .. }
            | MaterialDeck::VonMises { .. }
            | MaterialDeck::Tresca { .. }
            | MaterialDeck::ModifiedCamClay { .. }
            | MaterialDeck::Library { .. } => true,
        }
    }

    /// Path of the library of the law, relative to the deck; `None` for built-in laws.
    pub fn library(&self) -> Option<&str> {
        match self {
            MaterialDeck::Library { file, .. } => Some(file),
            _ => None,
        }
    }

    /// True if bodies of this material need an initial stress.
    pub fn needs_initial_stress(&self) -> bool {
        matches!(self, MaterialDeck::ModifiedCamClay { .. })
    }

    /// Width of the shear band, [length]: `Some(None)` if it is not stated, `None` if the material does not soften.
    pub fn softening(&self) -> Option<Option<f64>> {
        match self {
            MaterialDeck::Tresca { softening, .. } => softening.as_ref().map(|softening| softening.band),
            MaterialDeck::MohrCoulomb { softening, .. } => softening.as_ref().map(|softening| softening.band),
            _ => None,
        }
    }
}
