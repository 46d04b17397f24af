//! Elasticity that softens in shear.

use mpm::material::{Material, MaterialError, Response, StateField};
use mpm::tensor::{Sym3, Tangent, dyad};

/// τ = K tr ε I + 2 G/(1 + a |e|) e with the deviator e of the logarithmic elastic strain ε: the stress-strain curve in
/// shear is a hyperbola that tends to |dev τ| = 2 G/a.
#[derive(Debug, Clone, Copy)]
pub struct Hyperbolic {
    /// Bulk modulus K, [stress].
    pub bulk: f64,
    /// Shear modulus G at zero strain, [stress].
    pub shear: f64,
    /// a, [-].
    pub softening: f64,
}

impl Material for Hyperbolic {
    fn state_fields(&self) -> &[StateField] {
        &[]
    }

    fn update(&self, trial: &Sym3, _: &[f64], _: &mut [f64]) -> Result<Response, MaterialError> {
        let deviator = trial.deviator();
        let norm = deviator.norm();
        if !(norm + trial.trace()).is_finite() {
            return Err(MaterialError::NotFinite);
        }
        let shear = self.shear / (1.0 + self.softening * norm);
        let one = dyad(&Sym3::IDENTITY, &Sym3::IDENTITY);
        let mut tangent = one * (self.bulk - 2.0 / 3.0 * shear) + Tangent::identity() * (2.0 * shear);
        if norm > 0.0 {
            let lost = 2.0 * shear * self.softening / (1.0 + self.softening * norm) / norm;
            tangent -= dyad(&deviator, &deviator) * lost;
        }
        Ok(Response {
            tau: Sym3::IDENTITY * (self.bulk * trial.trace()) + deviator * (2.0 * shear),
            elastic_strain: *trial,
            tangent,
        })
    }

    fn energy(&self, strain: &Sym3, _: &[f64]) -> f64 {
        let (volume, x) = (strain.trace(), self.softening * strain.deviator().norm());
        0.5 * self.bulk * volume * volume + 2.0 * self.shear * (x - x.ln_1p()) / self.softening.powi(2)
    }
}
