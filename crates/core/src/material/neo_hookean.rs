//! Compressible neo-Hookean elasticity.

use super::{
    IsotropicModuli, IsotropicResponse, Material, MaterialError, Response, StateField, StrainMeasure,
};
use crate::tensor::{Sym3, Tangent};

/// Compressible neo-Hookean elasticity, W = μ/2 (tr b − 3) − μ ln J + λ/2 (ln J)², formulated in b and evaluated
/// without its eigenvalues.
#[derive(Debug, Clone)]
pub struct NeoHookean {
    /// λ, [stress].
    lambda: f64,
    /// μ, [stress].
    mu: f64,
}

impl NeoHookean {
    /// The law with Young's modulus, [stress], and Poisson's ratio, [-], at small strain.
    pub fn new(young: f64, poisson: f64) -> Self {
        NeoHookean {
            lambda: young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
            mu: young / (2.0 * (1.0 + poisson)),
        }
    }
}

/// det b − 1 for b = I + 2e, from the invariants of 2e to avoid cancellation at small strain.
#[inline]
fn growth(e: &Sym3) -> f64 {
    let [x, y, z] = [2.0 * e.0[0], 2.0 * e.0[1], 2.0 * e.0[2]];
    let [yz, xz, xy] = [2.0 * e.0[3], 2.0 * e.0[4], 2.0 * e.0[5]]; // √2 times the components
    let (yz2, xz2, xy2) = (0.5 * yz * yz, 0.5 * xz * xz, 0.5 * xy * xy);
    let second = x * y + y * z + z * x - yz2 - xz2 - xy2;
    let third = x * (y * z - yz2) - y * xz2 - z * xy2 + std::f64::consts::FRAC_1_SQRT_2 * yz * xz * xy;
    x + y + z + second + third
}

/// Logarithmic volume ratio ln J = ½ ln det(I + 2e).
#[inline]
fn log_volume_ratio(e: &Sym3) -> f64 {
    0.5 * growth(e).ln_1p()
}

/// The inverse of b = I + 2e.
#[inline]
fn inverse(e: &Sym3) -> Sym3 {
    let [xx, yy, zz] = [1.0 + 2.0 * e.0[0], 1.0 + 2.0 * e.0[1], 1.0 + 2.0 * e.0[2]];
    let [yz, xz, xy] = [2.0 * e.0[3], 2.0 * e.0[4], 2.0 * e.0[5]]; // √2 times the components
    let r = std::f64::consts::FRAC_1_SQRT_2;
    let adjugate = Sym3([
        yy * zz - 0.5 * yz * yz,
        zz * xx - 0.5 * xz * xz,
        xx * yy - 0.5 * xy * xy,
        r * xz * xy - xx * yz,
        r * xy * yz - yy * xz,
        r * yz * xz - zz * xy,
    ]);
    adjugate * (1.0 / (1.0 + growth(e)))
}

impl Material for NeoHookean {
    fn state_fields(&self) -> &'static [StateField] {
        &[]
    }

    fn strain_measure(&self) -> StrainMeasure {
        StrainMeasure::LeftCauchyGreen
    }

    /// τ = μ (b − I) + λ ln J I; with the strain e = ½ (b − I), ∂τ/∂e = 2 μ 𝟙 + λ I ⊗ b⁻¹.
    fn update(&self, trial: &Sym3, _old: &[f64], _new: &mut [f64]) -> Result<Response, MaterialError> {
        let log_j = log_volume_ratio(trial);
        if !log_j.is_finite() {
            return Err(MaterialError::NotFinite);
        }
        let mut tangent = Tangent::zeros();
        for (c, entry) in inverse(trial).0.iter().enumerate() {
            for r in 0..3 {
                tangent[(r, c)] = self.lambda * entry;
            }
            tangent[(c, c)] += 2.0 * self.mu;
        }
        let tau = *trial * (2.0 * self.mu) + Sym3::IDENTITY * (self.lambda * log_j);
        Ok(Response { tau, elastic_strain: *trial, tangent })
    }

    fn isotropic_moduli(&self) -> Option<&dyn IsotropicModuli> {
        Some(self)
    }

    fn energy(&self, elastic_strain: &Sym3) -> f64 {
        let log_j = log_volume_ratio(elastic_strain);
        self.mu * (elastic_strain.trace() - log_j) + 0.5 * self.lambda * log_j * log_j
    }
}

impl IsotropicModuli for NeoHookean {
    /// λ̂ = λ and μ̂ = μ − λ ln J.
    #[inline]
    fn respond(&self, b: &Sym3) -> Result<IsotropicResponse, MaterialError> {
        let elastic_strain = (*b - Sym3::IDENTITY) * 0.5;
        let log_j = log_volume_ratio(&elastic_strain);
        if !log_j.is_finite() {
            return Err(MaterialError::NotFinite);
        }
        Ok(IsotropicResponse {
            tau: elastic_strain * (2.0 * self.mu) + Sym3::IDENTITY * (self.lambda * log_j),
            elastic_strain,
            lambda: self.lambda,
            mu: self.mu - self.lambda * log_j,
        })
    }
}
