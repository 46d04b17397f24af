//! Tresca plasticity.

use super::wedge::{self, Strength, Wedge};
use super::{
    Elasticity, Material, MaterialError, PrincipalLaw, PrincipalResponse, Response, Softening, StateField,
    StrengthMeasure, update_in_principal_axes,
};
use crate::tensor::Sym3;

/// Tresca plasticity: f = τ₁ − τ₃ − 2c with the largest and the smallest principal stress and the undrained shear strength
/// c, with associated flow, which preserves the volume.
#[derive(Debug, Clone)]
pub struct Tresca {
    elasticity: Elasticity,
    /// c at the start, [stress].
    cohesion: f64,
    /// c in the end, [stress], and the way there.
    softening: Option<(f64, Softening)>,
    measure: StrengthMeasure,
}

impl Tresca {
    /// Perfect plasticity with Young's modulus, [stress], Poisson's ratio, [-], and the undrained shear strength, [stress], of
    /// the Kirchhoff stress.
    pub fn new(young: f64, poisson: f64, cohesion: f64) -> Self {
        let elasticity = Elasticity::from_young_poisson(young, poisson);
        Tresca { elasticity, cohesion, softening: None, measure: StrengthMeasure::Kirchhoff }
    }

    /// The strength decays to this residual, [stress].
    pub fn softening(self, residual: f64, softening: Softening) -> Self {
        Tresca { softening: Some((residual, softening)), ..self }
    }

    /// The stress that the strength limits.
    pub fn limiting(self, measure: StrengthMeasure) -> Self {
        Tresca { measure, ..self }
    }

    /// The law with its strength divided by a factor.
    fn divided(&self, factor: f64) -> Self {
        Tresca {
            cohesion: self.cohesion / factor,
            softening: self.softening.map(|(residual, softening)| (residual / factor, softening)),
            ..*self
        }
    }

    /// Strength and its derivative with respect to the equivalent plastic strain.
    fn strength(&self, kappa: f64) -> [Strength; 2] {
        let [cohesion, rate] = match self.softening {
            None => [self.cohesion, 0.0],
            Some((residual, softening)) => {
                let [share, rate] = softening.share(kappa).map(|x| x * (self.cohesion - residual));
                [residual + share, rate]
            }
        };
        [
            Strength { ratio: 1.0, flow_ratio: 1.0, compressive: 2.0 * cohesion, tensile: f64::INFINITY },
            Strength { ratio: 0.0, flow_ratio: 0.0, compressive: 2.0 * rate, tensile: 0.0 },
        ]
    }
}

impl PrincipalLaw for Tresca {
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError> {
        let Tresca { elasticity, measure, softening, .. } = *self;
        let strength = |kappa| self.strength(kappa);
        Wedge { elasticity, measure, softens: softening.is_some(), strength }.respond(trial, old, new)
    }
}

impl Material for Tresca {
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
        self.measure == StrengthMeasure::Kirchhoff && self.softening.is_none()
    }

    fn with_strength_divided(&self, factor: f64) -> Option<Box<dyn Material>> {
        Some(Box::new(self.divided(factor)))
    }
}
