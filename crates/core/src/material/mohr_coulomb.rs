//! Mohr-Coulomb plasticity.

use super::wedge::{self, Strength, Wedge};
use super::{
    Elasticity, Material, MaterialError, PrincipalLaw, PrincipalResponse, Response, Softening, StateField,
    StrengthMeasure, update_in_principal_axes,
};
use crate::tensor::Sym3;

/// Shear strength of Mohr and Coulomb, with the flow that belongs to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Cohesion c, [stress].
    pub cohesion: f64,
    /// Friction angle φ, [degrees], from 0 to below 90.
    pub friction_angle: f64,
    /// Dilation angle ψ, [degrees], from 0 to φ.
    pub dilation_angle: f64,
}

/// The same with tangents of the angles.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Slopes {
    cohesion: f64,
    friction: f64,
    dilation: f64,
}

impl From<Friction> for Slopes {
    fn from(given: Friction) -> Self {
        let tangent = |degrees: f64| degrees.to_radians().tan();
        Slopes {
            cohesion: given.cohesion,
            friction: tangent(given.friction_angle),
            dilation: tangent(given.dilation_angle),
        }
    }
}

impl Slopes {
    /// c/F and tan φ/F; the dilation angle stays, but does not exceed the friction angle.
    fn divided(&self, factor: f64) -> Slopes {
        let friction = self.friction / factor;
        Slopes { cohesion: self.cohesion / factor, friction, dilation: self.dilation.min(friction) }
    }
}

/// No change.
const STILL: Slopes = Slopes { cohesion: 0.0, friction: 0.0, dilation: 0.0 };
const NONE: Strength = Strength { ratio: 0.0, flow_ratio: 0.0, compressive: 0.0, tensile: 0.0 };

/// √N = tan φ + 1/cos φ and its derivative with respect to tan φ.
fn root_of_ratio(slope: f64) -> [f64; 2] {
    let secant = (1.0 + slope * slope).sqrt();
    [secant + slope, 1.0 + slope / secant]
}

/// Mohr-Coulomb plasticity: f = N τ₁ − τ₃ − 2c√N with N = (1 + sin φ)/(1 − sin φ) and the largest and the smallest
/// principal stress, tension positive; flow with the dilation angle in place of φ; and, if stated, τ₁ ≤ T with associated
/// flow.
#[derive(Debug, Clone)]
pub struct MohrCoulomb {
    elasticity: Elasticity,
    peak: Slopes,
    /// Infinite without cut-off, [stress].
    tensile: f64,
    /// The strength in the end, and the way there.
    softening: Option<(Slopes, Softening)>,
    measure: StrengthMeasure,
    /// The strength at the peak.
    at_peak: Strength,
}

impl MohrCoulomb {
    /// Perfect plasticity with Young's modulus, [stress], Poisson's ratio, [-], and the strength in terms of the Cauchy
    /// stress.
    pub fn new(young: f64, poisson: f64, friction: Friction) -> Self {
        MohrCoulomb {
            elasticity: Elasticity::from_young_poisson(young, poisson),
            peak: friction.into(),
            tensile: f64::INFINITY,
            softening: None,
            measure: StrengthMeasure::Cauchy,
            at_peak: NONE,
        }
        .prepared()
    }

    /// The law with the strength at the peak as the properties have it.
    fn prepared(self) -> Self {
        let [at_peak, _] = self.strength_of(&self.peak, &STILL);
        MohrCoulomb { at_peak, ..self }
    }

    /// Principal stresses do not exceed this tensile strength, [stress], zero or positive. It has no effect where it
    /// exceeds that of the cone, c cot φ. With softening, it decays with the cohesion.
    pub fn tensile_strength(self, tensile: f64) -> Self {
        MohrCoulomb { tensile, ..self }.prepared()
    }

    /// The strength decays to this residual: cohesion and the tangents of both angles.
    pub fn softening(self, residual: Friction, softening: Softening) -> Self {
        MohrCoulomb { softening: Some((residual.into(), softening)), ..self }
    }

    /// The stress that the strength limits.
    pub fn limiting(self, measure: StrengthMeasure) -> Self {
        MohrCoulomb { measure, ..self }
    }

    fn divided(&self, factor: f64) -> Self {
        MohrCoulomb {
            peak: self.peak.divided(factor),
            tensile: self.tensile / factor,
            softening: self.softening.map(|(residual, softening)| (residual.divided(factor), softening)),
            ..*self
        }
        .prepared()
    }

    /// Strength and its derivative with respect to the equivalent plastic strain.
    fn strength(&self, kappa: f64) -> [Strength; 2] {
        let (peak, Some((residual, softening))) = (&self.peak, &self.softening) else {
            return [self.at_peak, NONE];
        };
        let [share, rate] = softening.share(kappa);
        let between = |share: f64, from: &Slopes| Slopes {
            cohesion: from.cohesion + share * (peak.cohesion - residual.cohesion),
            friction: from.friction + share * (peak.friction - residual.friction),
            dilation: from.dilation + share * (peak.dilation - residual.dilation),
        };
        self.strength_of(&between(share, residual), &between(rate, &STILL))
    }

    /// Strength with these properties, and its derivative where these are the derivatives of the properties.
    fn strength_of(&self, now: &Slopes, rate: &Slopes) -> [Strength; 2] {
        let peak = &self.peak;
        let [root, root_by_slope] = root_of_ratio(now.friction);
        let [flow_root, flow_root_by_slope] = root_of_ratio(now.dilation);
        let root_rate = root_by_slope * rate.friction;
        let per_cohesion = if peak.cohesion > 0.0 { self.tensile / peak.cohesion } else { 0.0 };
        let is_cut = self.tensile.is_finite();
        let kept = if peak.cohesion > 0.0 { now.cohesion / peak.cohesion } else { 1.0 };
        [
            Strength {
                ratio: root * root,
                flow_ratio: flow_root * flow_root,
                compressive: 2.0 * now.cohesion * root,
                tensile: if is_cut { self.tensile * kept } else { f64::INFINITY },
            },
            Strength {
                ratio: 2.0 * root * root_rate,
                flow_ratio: 2.0 * flow_root * flow_root_by_slope * rate.dilation,
                compressive: 2.0 * (rate.cohesion * root + now.cohesion * root_rate),
                tensile: if is_cut { per_cohesion * rate.cohesion } else { 0.0 },
            },
        ]
    }
}

impl PrincipalLaw for MohrCoulomb {
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError> {
        let MohrCoulomb { elasticity, measure, softening, .. } = self;
        let (softens, strength) = (softening.is_some(), |kappa| self.strength(kappa));
        Wedge { elasticity: *elasticity, measure: *measure, softens, strength }.respond(trial, old, new)
    }
}

impl Material for MohrCoulomb {
    fn state_fields(&self) -> &[StateField] {
        const { &wedge::FIELDS }
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        update_in_principal_axes(self, trial, old, new)
    }

    fn principal(&self) -> Option<&dyn PrincipalLaw> {
        Some(self)
    }

    fn start_from(&self, elastic_strain: &Sym3, volume_ratio: f64, history: &mut [f64]) {
        wedge::start_from(elastic_strain.trace(), volume_ratio, history);
    }

    fn elastic_strain(&self, tau: &Sym3, _: &[f64]) -> Result<Sym3, MaterialError> {
        self.elasticity.strain(tau)
    }

    fn energy(&self, elastic_strain: &Sym3, _: &[f64]) -> f64 {
        self.elasticity.energy(elastic_strain)
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        history[wedge::PLASTIC_WORK]
    }

    fn tangent_is_symmetric(&self) -> bool {
        let is_associated = self.peak.friction == self.peak.dilation;
        is_associated && self.measure == StrengthMeasure::Kirchhoff && self.softening.is_none()
    }

    fn with_strength_divided(&self, factor: f64) -> Option<Box<dyn Material>> {
        Some(Box::new(self.divided(factor)))
    }
}
