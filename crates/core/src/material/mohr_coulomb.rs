//! Mohr-Coulomb plasticity.

use super::strength::EQUIVALENT;
use super::wedge::{Strength, WedgeLaw, WedgeSettings};
use super::{Elasticity, Softening, StrengthMeasure};

/// Mohr-Coulomb shear strength, with the dilation angle of the plastic flow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Cohesion c, [stress].
    pub cohesion: f64,
    /// Friction angle φ, [degrees], from 0 to below 90.
    pub friction_angle: f64,
    /// Dilation angle ψ, [degrees], from 0 to φ.
    pub dilation_angle: f64,
}

/// The properties of [`Friction`], with the tangents of the angles in place of the angles.
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
    /// c/F and tan φ/F; the dilation angle is unchanged unless it would exceed the friction angle, to which it is then
    /// limited.
    fn divided(&self, factor: f64) -> Slopes {
        let friction = self.friction / factor;
        Slopes { cohesion: self.cohesion / factor, friction, dilation: self.dilation.min(friction) }
    }
}

/// Rates of properties that do not change.
const STILL: Slopes = Slopes { cohesion: 0.0, friction: 0.0, dilation: 0.0 };
const NONE: Strength = Strength { ratio: 0.0, flow_ratio: 0.0, compressive: 0.0, tensile: 0.0 };

/// √N = tan φ + 1/cos φ and its derivative with respect to tan φ.
fn root_of_ratio(slope: f64) -> [f64; 2] {
    let secant = (1.0 + slope * slope).sqrt();
    [secant + slope, 1.0 + slope / secant]
}

/// The largest κ₉₅ of [`Softening`] at which a point loses strength faster than its elastic stress can fall, [-]. The
/// point flows from the peak while its least compressive principal stress is zero; the flow has no solution if κ₉₅ is
/// at or below this value. With n = ∂f/∂τ and m the direction of flow, C the elastic stiffness and κ' = √(2/3) |dev m|,
/// the loss ∂f/∂κ κ' must stay below n·C m; if both angles are zero, this value is √3 (c_p − c_r)/G. Under compression,
/// the reduction of friction adds to the loss, so that a larger κ₉₅ may be necessary there. The first argument holds
/// Young's modulus, [stress], and Poisson's ratio, [-]; the second holds the peak and the residual strength.
pub fn least_softening_strain([young, poisson]: [f64; 2], [peak, residual]: [Friction; 2]) -> f64 {
    let elasticity = Elasticity::from_young_poisson(young, poisson);
    let (shear, lambda) = (elasticity.shear, elasticity.lambda());
    let [peak, residual] = [Slopes::from(peak), Slopes::from(residual)];
    let [root, root_by_slope] = root_of_ratio(peak.friction);
    let [flow_root, _] = root_of_ratio(peak.dilation);
    let [ratio, flow_ratio] = [root * root, flow_root * flow_root];
    let unloading = lambda * (ratio - 1.0) * (flow_ratio - 1.0) + 2.0 * shear * (ratio * flow_ratio + 1.0);
    let deviator = flow_ratio * flow_ratio + 1.0 - (flow_ratio - 1.0).powi(2) / 3.0;
    // At the peak, dX/dκ = −3 (X_p − X_r)/κ₉₅.
    let loss = (peak.cohesion - residual.cohesion) * root
        + peak.cohesion * root_by_slope * (peak.friction - residual.friction);
    3.0 * 2.0 * loss * EQUIVALENT * deviator.sqrt() / unloading
}

/// Mohr-Coulomb plasticity: f = N τ₁ − τ₃ − 2c√N with N = (1 + sin φ)/(1 − sin φ) and the largest and smallest
/// principal stresses τ₁ and τ₃, tension positive; the flow has the dilation angle in place of φ. If a tensile strength
/// T is set, τ₁ ≤ T with associated flow.
#[derive(Debug, Clone)]
pub struct MohrCoulomb {
    settings: WedgeSettings,
    peak: Slopes,
    /// Tensile strength, [stress]; infinite without a cut-off.
    tensile: f64,
    /// The residual strength and the softening towards it.
    softening: Option<(Slopes, Softening)>,
    /// The strength at the peak.
    at_peak: Strength,
}

impl MohrCoulomb {
    /// Perfect plasticity with Young's modulus, [stress], Poisson's ratio, [-], and the strength in terms of the Cauchy
    /// stress.
    pub fn new(young: f64, poisson: f64, friction: Friction) -> Self {
        let elasticity = Elasticity::from_young_poisson(young, poisson);
        MohrCoulomb {
            settings: WedgeSettings { elasticity, measure: StrengthMeasure::Cauchy, softens: false },
            peak: friction.into(),
            tensile: f64::INFINITY,
            softening: None,
            at_peak: NONE,
        }
        .prepared()
    }

    /// The law, with the peak strength computed from its properties.
    fn prepared(self) -> Self {
        let [at_peak, _] = self.strength_of(&self.peak, &STILL);
        MohrCoulomb { at_peak, ..self }
    }

    /// Limits principal stresses to this tensile strength, [stress], which is zero or positive. It has no effect if it
    /// exceeds the stress at the apex, c cot φ. With softening, the tensile strength decays with the cohesion.
    pub fn tensile_strength(self, tensile: f64) -> Self {
        MohrCoulomb { tensile, ..self }.prepared()
    }

    /// Lets the strength decay to this residual strength: the cohesion and the tangents of both angles decay.
    pub fn softening(self, residual: Friction, softening: Softening) -> Self {
        let settings = WedgeSettings { softens: true, ..self.settings };
        MohrCoulomb { settings, softening: Some((residual.into(), softening)), ..self }
    }

    /// Sets the stress measure that the strength limits.
    pub fn limiting(self, measure: StrengthMeasure) -> Self {
        MohrCoulomb { settings: WedgeSettings { measure, ..self.settings }, ..self }
    }

    /// The strength for the properties `now`, and its derivative, where `rate` is the derivative of the properties.
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

impl WedgeLaw for MohrCoulomb {
    fn settings(&self) -> &WedgeSettings {
        &self.settings
    }

    fn is_associated(&self) -> bool {
        self.peak.friction == self.peak.dilation
    }

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

    fn reduced(&self, factor: f64) -> Self {
        MohrCoulomb {
            peak: self.peak.divided(factor),
            tensile: self.tensile / factor,
            softening: self.softening.map(|(residual, softening)| (residual.divided(factor), softening)),
            ..*self
        }
        .prepared()
    }
}
