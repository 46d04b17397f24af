//! Modified Cam-clay plasticity at finite strain.

mod return_mapping;

use pulp::Arch;

use super::strength::EQUIVALENT;
use super::{
    Material, MaterialError, PrincipalLaw, PrincipalResponse, Response, StateField, update_in_principal_axes,
};
use crate::tensor::{Lanes, Sym3};

/// Modified Cam-clay at finite strain (Borja and Tamagnini 1998, doi 10.1016/S0045-7825(97)00141-2): the ellipse
/// f = q²/M² + P (P − P_c) in terms of the mean pressure P = −tr τ/3 and q = √(3 J₂), associated flow, and
/// bilogarithmic compression.
///
/// On the virgin line, ln J = −λ̂ ln(P/P₀); on unloading, the slope is κ̂. The stored elastic energy is
/// W = P₀ κ̂ e^ω + 3/2 μ ε_s² with ω = −ε_v/κ̂ and μ = μ₀ + α P₀ e^ω (Borja, Tamagnini and Amorosi 1997, doi
/// 10.1061/(ASCE)1090-0241(1997)123:10(948)), so that the bulk modulus grows in proportion to the pressure.
#[derive(Debug, Clone)]
pub struct ModifiedCamClay {
    parameters: CamClay,
    fields: [StateField; 4],
}

/// The parameters of [`ModifiedCamClay`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CamClay {
    /// λ̂, slope of the virgin compression line in a plot of ln J against ln P, [-].
    pub compression_index: f64,
    /// κ̂, slope of the unloading lines, less than λ̂, [-].
    pub swelling_index: f64,
    /// M, the ratio q/P at the critical state, [-].
    pub critical_state_ratio: f64,
    /// μ₀, [stress].
    pub shear_modulus: f64,
    /// α in μ = μ₀ + α P₀ e^ω, [-]; if it is 0, μ is constant.
    pub shear_modulus_ratio: f64,
    /// P_c relative to the size of the ellipse through the initial stress, at least 1, [-].
    pub overconsolidation_ratio: f64,
    /// P₀, the pressure at zero elastic strain, [stress]. It only shifts the origin of strain: stresses depend on
    /// it only through their initial values.
    pub reference_pressure: f64,
}

/// Indices of the history variables.
const PRECONSOLIDATION: usize = 0;
const EQUIVALENT_STRAIN: usize = 1;
const VOLUMETRIC_STRAIN: usize = 2;
const WORK: usize = 3;

impl ModifiedCamClay {
    /// The law with these parameters.
    pub fn new(parameters: CamClay) -> Self {
        let initial = parameters.overconsolidation_ratio * parameters.reference_pressure;
        ModifiedCamClay {
            parameters,
            fields: [
                StateField::new("preconsolidation_pressure", "stress", initial),
                StateField::new("equivalent_plastic_strain", "-", 0.0),
                StateField::new("plastic_volumetric_strain", "-", 0.0),
                StateField::new("plastic_work", "energy/volume", 0.0),
            ],
        }
    }
}

impl PrincipalLaw for ModifiedCamClay {
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError> {
        self.parameters.respond(&trial, old, new)
    }

    fn respond_in_lanes(
        &self,
        trial: &[Lanes; 3],
        old: &[Lanes],
        new: &mut [Lanes],
    ) -> Option<PrincipalResponse<Lanes>> {
        Arch::new().dispatch(
            #[inline(always)]
            || self.parameters.respond(trial, old, new).ok(),
        )
    }
}

impl CamClay {
    /// Largest ratio q/P that the elasticity can carry if μ depends only on the pressure, √(3ακ̂/2), [-].
    pub fn largest_stress_ratio(&self) -> f64 {
        (1.5 * self.shear_modulus_ratio * self.swelling_index).sqrt()
    }

    /// True if the elasticity can carry the critical state P = P₀/2, q = M P₀/2 of the ellipse with P_c = P₀. Other
    /// states may have a larger pressure or stress ratio.
    pub fn carries_critical_state(&self) -> bool {
        let pressure = 0.5 * self.reference_pressure;
        self.strain_of(pressure, self.critical_state_ratio * pressure).is_some()
    }

    /// The elastic strain invariants of a stress, found by bisection in ε_s if μ depends on the pressure; `None` if
    /// the elasticity cannot carry the stress.
    fn strain_of(&self, pressure: f64, shear: f64) -> Option<[f64; 2]> {
        let CamClay { swelling_index, shear_modulus, shear_modulus_ratio, reference_pressure, .. } = *self;
        // P = C (1 + 3α ε_s²/(2κ̂)) and q = 3 (μ₀ + α C) ε_s with C = P₀ e^ω.
        let confined =
            |strain: f64| pressure / (1.0 + 1.5 * shear_modulus_ratio * strain * strain / swelling_index);
        let stress = |strain: f64| 3.0 * (shear_modulus + shear_modulus_ratio * confined(strain)) * strain;
        let (mut low, mut high) = (0.0, shear / (3.0 * shear_modulus.max(f64::MIN_POSITIVE)));
        if shear_modulus_ratio > 0.0 {
            high = f64::min(high, self.strain_at_largest_shear(pressure));
        }
        if shear > 0.0 && shear_modulus_ratio > 0.0 {
            if stress(high) < shear * (1.0 - 1e-12) {
                return None;
            }
            while high - low > 1e-16 * high {
                let middle = 0.5 * (low + high);
                if middle <= low || middle >= high {
                    break;
                }
                *if stress(middle) < shear { &mut low } else { &mut high } = middle;
            }
        }
        let strain = high;
        Some([-swelling_index * (confined(strain) / reference_pressure).ln(), strain])
    }

    /// ε_s at the first maximum of q at this pressure, up to which the stored energy is convex; infinite if q grows
    /// without limit. With x = 3α ε_s²/(2κ̂), dq/dε_s has the sign of μ₀ (1 + x)² + α P (1 − x), as has the determinant
    /// of the second derivatives of W. The expression is positive for all x ≥ 0 if α P < 8 μ₀.
    fn strain_at_largest_shear(&self, pressure: f64) -> f64 {
        let (constant, confined) = (self.shear_modulus, self.shear_modulus_ratio * pressure);
        if confined < 8.0 * constant {
            return f64::INFINITY;
        }
        // The smaller root, in the form that has no cancellation and is 1 for μ₀ = 0.
        let root = (confined * (confined - 8.0 * constant)).sqrt();
        let x = 2.0 * (constant + confined) / (confined - 2.0 * constant + root);
        (2.0 * self.swelling_index / (3.0 * self.shear_modulus_ratio) * x).sqrt()
    }
}

impl Material for ModifiedCamClay {
    fn state_fields(&self) -> &[StateField] {
        &self.fields
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        update_in_principal_axes(self, trial, old, new)
    }

    fn principal(&self) -> Option<&dyn PrincipalLaw> {
        Some(self)
    }

    /// Starts with the ellipse through the stress, its size multiplied by the overconsolidation ratio.
    fn start_from(&self, elastic_strain: &Sym3, volume_ratio: f64, history: &mut [f64]) {
        let volumetric = elastic_strain.trace();
        let law = &self.parameters;
        let elastic = law.elastic(volumetric, EQUIVALENT * elastic_strain.deviator().norm());
        let ratio = elastic.shear / law.critical_state_ratio;
        let size = elastic.pressure + ratio * ratio / elastic.pressure;
        history[PRECONSOLIDATION] = law.overconsolidation_ratio * size;
        history[VOLUMETRIC_STRAIN] = volume_ratio.ln() - volumetric;
    }

    fn keep_deformation(&self, [before, now]: [&Sym3; 2], history: &mut [f64]) {
        history[VOLUMETRIC_STRAIN] -= (*now - *before).trace();
    }

    fn elastic_strain(&self, tau: &Sym3, _: &[f64]) -> Result<Sym3, MaterialError> {
        let (pressure, deviator) = (-tau.trace() / 3.0, tau.deviator());
        if pressure.is_nan() || pressure <= 0.0 {
            return Err(MaterialError::NoStrain);
        }
        let norm = deviator.norm();
        let [volumetric, shear] =
            self.parameters.strain_of(pressure, norm / EQUIVALENT).ok_or(MaterialError::NoStrain)?;
        let per_stress = if norm > 0.0 { shear / (EQUIVALENT * norm) } else { 0.0 };
        let strain = Sym3::IDENTITY * (volumetric / 3.0) + deviator * per_stress;
        if strain.norm().is_finite() { Ok(strain) } else { Err(MaterialError::NoStrain) }
    }

    fn energy(&self, elastic_strain: &Sym3, _: &[f64]) -> f64 {
        let CamClay { swelling_index, reference_pressure, .. } = self.parameters;
        let volumetric = elastic_strain.trace();
        let shear = EQUIVALENT * elastic_strain.deviator().norm();
        let confined = reference_pressure * (-volumetric / swelling_index).exp();
        let modulus = self.parameters.elastic(volumetric, shear).modulus;
        confined * swelling_index + 1.5 * modulus * shear * shear
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        history[WORK]
    }

    /// The other variables also start from an initial stress.
    fn has_yielded(&self, initial: &[f64], history: &[f64]) -> bool {
        initial[EQUIVALENT_STRAIN] != history[EQUIVALENT_STRAIN]
    }

    /// Implicit hardening couples the flow direction to P_c although the flow is associated.
    fn tangent_is_symmetric(&self) -> bool {
        false
    }
}
