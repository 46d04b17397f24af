//! Hencky elasticity.

use super::{CompactResponse, Elasticity, Material, MaterialError, Response, StateField, VectorisedLaw};
use crate::tensor::{Lane, Lanes, Sym3, Tangent};

/// Hencky elasticity: the Kirchhoff stress is linear in the elastic logarithmic strain (section 2).
#[derive(Debug, Clone)]
pub struct Hencky {
    elasticity: Elasticity,
    tangent: Tangent,
}

impl Hencky {
    /// The law with Young's modulus, [stress], and Poisson's ratio, [-].
    pub fn new(young: f64, poisson: f64) -> Self {
        let elasticity = Elasticity::from_young_poisson(young, poisson);
        Hencky { elasticity, tangent: elasticity.tangent() }
    }
}

impl Material for Hencky {
    fn state_fields(&self) -> &[StateField] {
        &[]
    }

    fn update(&self, trial: &Sym3, _old: &[f64], _new: &mut [f64]) -> Result<Response, MaterialError> {
        let tau = self.elasticity.stress(trial);
        if !tau.trace().is_finite() {
            return Err(MaterialError::NotFinite);
        }
        Ok(Response { tau, elastic_strain: *trial, tangent: self.tangent })
    }

    fn elastic_strain(&self, tau: &Sym3, _: &[f64]) -> Result<Sym3, MaterialError> {
        self.elasticity.strain(tau)
    }

    fn vectorised(&self) -> Option<&dyn VectorisedLaw> {
        Some(self)
    }

    fn energy(&self, elastic_strain: &Sym3, _: &[f64]) -> f64 {
        self.elasticity.energy(elastic_strain)
    }
}

impl VectorisedLaw for Hencky {
    fn respond(&self, trial: &[Lanes; 4], _history: &mut [Lanes]) -> CompactResponse<Lanes, 4> {
        CompactResponse {
            tau: self.elasticity.stress_components(trial),
            elastic_strain: *trial,
            lambda: Lanes::splat(self.elasticity.lambda()),
            mu: Lanes::splat(self.elasticity.shear),
            along: Lanes::ZERO,
            n: [Lanes::ZERO; 4],
        }
    }
}
