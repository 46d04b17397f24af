//! Von Mises perfect plasticity.

use super::{Elasticity, Material, MaterialError, Response, StateField};
use crate::tensor::{Sym3, Tangent, dyad};

/// A stress this little beyond the yield surface, relative to ρ_y, is still elastic.
///
/// A point that has yielded starts the next step on the surface up to round-off; without this margin round-off would
/// decide between its elastic and its plastic tangent, and with it how Newton's iterations run.
const ON_SURFACE: f64 = 1e-10;

/// Von Mises elastic, perfectly plastic: f = ρ − ρ_y with ρ = √(2 J₂) of the Kirchhoff stress, eq. (43).
#[derive(Debug, Clone)]
pub struct VonMises {
    elasticity: Elasticity,
    /// Deviatoric yield stress ρ_y, [stress].
    yield_radius: f64,
    elastic_tangent: Tangent,
}

impl VonMises {
    /// From Young's modulus, [stress], Poisson's ratio, [-], and the deviatoric yield stress ρ_y, [stress].
    pub fn new(young: f64, poisson: f64, deviatoric_yield_stress: f64) -> Self {
        let elasticity = Elasticity::from_young_poisson(young, poisson);
        VonMises { elasticity, yield_radius: deviatoric_yield_stress, elastic_tangent: elasticity.tangent() }
    }
}

impl Material for VonMises {
    fn state_fields(&self) -> &'static [StateField] {
        &[StateField { name: "equivalent_plastic_strain", unit: "-", initial: 0.0 }]
    }

    /// Radial return: the trial deviator s = 2 G dev(ε) is scaled back to ρ_y along n = s/|s|, and
    /// D^alg = K I⊗I + 2 G (ρ_y/|s|) (𝟙_dev − n⊗n).
    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        let Elasticity { bulk, shear } = self.elasticity;
        let s = trial.deviator() * (2.0 * shear);
        let rho = s.norm();
        if !(rho + trial.trace()).is_finite() {
            return Err(MaterialError::NotFinite);
        }
        new.copy_from_slice(old);
        if rho <= self.yield_radius * (1.0 + ON_SURFACE) {
            let tau = self.elasticity.stress(trial);
            return Ok(Response { tau, elastic_strain: *trial, tangent: self.elastic_tangent });
        }
        let flow = (rho - self.yield_radius) / (2.0 * shear); // |Δε^p|
        let n = s * (1.0 / rho);
        new[0] = old[0] + (2.0f64 / 3.0).sqrt() * flow;
        let shrink = self.yield_radius / rho;
        let shear_now = shear * shrink;
        let tangent = Elasticity { bulk, shear: shear_now }.tangent() - dyad(&n, &n) * (2.0 * shear_now);
        Ok(Response {
            tau: Sym3::IDENTITY * (bulk * trial.trace()) + n * self.yield_radius,
            elastic_strain: *trial - n * flow,
            tangent,
        })
    }

    fn energy(&self, elastic_strain: &Sym3) -> f64 {
        self.elasticity.energy(elastic_strain)
    }
}
