//! Compressible neo-Hookean elasticity.

use super::{Material, MaterialError, Response, StateField, StrainMeasure};
use crate::tensor::{Sym3, Tangent};

/// Compressible neo-Hookean elasticity, W = μ/2 (tr b − 3) − μ ln J + λ/2 (ln J)², given in b and evaluated without its
/// eigenvalues.
#[derive(Debug, Clone)]
pub struct NeoHookean {
    /// λ, [stress].
    lambda: f64,
    /// μ, [stress].
    mu: f64,
}

impl NeoHookean {
    /// From Young's modulus, [stress], and Poisson's ratio, [-], of small strains.
    pub fn new(young: f64, poisson: f64) -> Self {
        NeoHookean {
            lambda: young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
            mu: young / (2.0 * (1.0 + poisson)),
        }
    }
}

/// ln J = ½ ln det(I + 2e) and the inverse of b = I + 2e.
#[inline]
fn log_volume_ratio_and_inverse(e: &Sym3) -> (f64, Sym3) {
    let [x, y, z] = [2.0 * e.0[0], 2.0 * e.0[1], 2.0 * e.0[2]];
    let (xx, yy, zz) = (1.0 + x, 1.0 + y, 1.0 + z);
    let [yz, xz, xy] = [2.0 * e.0[3], 2.0 * e.0[4], 2.0 * e.0[5]]; // √2 times the components
    let (yz2, xz2, xy2) = (0.5 * yz * yz, 0.5 * xz * xz, 0.5 * xy * xy);
    let r = std::f64::consts::FRAC_1_SQRT_2;
    // det b − 1 by the invariants of 2e, so that small strains keep their digits.
    let second = x * y + y * z + z * x - yz2 - xz2 - xy2;
    let third = x * (y * z - yz2) - y * xz2 - z * xy2 + r * yz * xz * xy;
    let growth = x + y + z + second + third;
    let adjugate = Sym3([
        yy * zz - yz2,
        zz * xx - xz2,
        xx * yy - xy2,
        r * xz * xy - xx * yz,
        r * xy * yz - yy * xz,
        r * yz * xz - zz * xy,
    ]);
    (0.5 * growth.ln_1p(), adjugate * (1.0 / (1.0 + growth)))
}

impl Material for NeoHookean {
    fn state_fields(&self) -> &'static [StateField] {
        &[]
    }

    fn strain_measure(&self) -> StrainMeasure {
        StrainMeasure::LeftCauchyGreen
    }

    /// τ = μ (b − I) + λ ln J I and, with the strain e = ½ (b − I), ∂τ/∂e = 2 μ 𝟙 + λ I ⊗ b⁻¹.
    fn update(&self, trial: &Sym3, _old: &[f64], _new: &mut [f64]) -> Result<Response, MaterialError> {
        let (log_j, inverse) = log_volume_ratio_and_inverse(trial);
        if !log_j.is_finite() {
            return Err(MaterialError::NotFinite);
        }
        let mut tangent = Tangent::zeros();
        for (c, entry) in inverse.0.iter().enumerate() {
            for r in 0..3 {
                tangent[(r, c)] = self.lambda * entry;
            }
            tangent[(c, c)] += 2.0 * self.mu;
        }
        let tau = *trial * (2.0 * self.mu) + Sym3::IDENTITY * (self.lambda * log_j);
        Ok(Response { tau, elastic_strain: *trial, tangent })
    }

    fn energy(&self, elastic_strain: &Sym3) -> f64 {
        let (log_j, _) = log_volume_ratio_and_inverse(elastic_strain);
        self.mu * (elastic_strain.trace() - log_j) + 0.5 * self.lambda * log_j * log_j
    }
}
