//! Compressible neo-Hookean elasticity.

use super::{
    IsotropicModuli, IsotropicResponse, Material, MaterialError, Response, StateField, StrainMeasure,
};
use crate::tensor::{Sym3, Tangent};

/// Largest number of iterations to find the volume ratio for a stress.
const MAX_ITERATIONS: usize = 60;
/// Largest residual of the iterations that counts as round-off, relative to the strain, [-].
const SETTLED: f64 = 1e-14;

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
    fn state_fields(&self) -> &[StateField] {
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

    /// τ = μ (b − I) + λ ln J I determines b for a given ℓ = ln J, so that the equation ½ ln det b(ℓ) − ℓ = 0 remains.
    /// Its left-hand side is concave. Newton's method converges to the root with a negative slope, which is the state
    /// that a path from the undeformed state reaches.
    fn elastic_strain(&self, tau: &Sym3, _: &[f64]) -> Result<Sym3, MaterialError> {
        let strain = |log_j: f64| (*tau - Sym3::IDENTITY * (self.lambda * log_j)) * (0.5 / self.mu);
        // μ times the smallest eigenvalue of b at ℓ = 0.
        let smallest = self.mu + tau.spectrum().values.into_iter().fold(f64::INFINITY, f64::min);
        let is_positive = |log_j: f64| smallest - self.lambda * log_j > 0.0;
        let mut log_j = match smallest {
            _ if is_positive(0.0) => 0.0,
            // b is positive definite below (λ > 0) or above (λ < 0) the value at which its smallest eigenvalue
            // vanishes.
            smallest if self.lambda > 0.0 => smallest / self.lambda - 1.0,
            smallest if self.lambda < 0.0 => smallest / self.lambda + 1.0,
            _ => return Err(MaterialError::NoStrain),
        };
        // If the stress exceeds the moduli by many orders of magnitude, the 1 above is lost in round-off.
        if !is_positive(log_j) {
            return Err(MaterialError::NoStrain);
        }
        for _ in 0..MAX_ITERATIONS {
            let e = strain(log_j);
            let slope = -1.0 - 0.5 * self.lambda / self.mu * inverse(&e).trace();
            let mut change = (log_j - log_volume_ratio(&e)) / slope;
            if !(slope < 0.0 && change.is_finite()) {
                return Err(MaterialError::NoStrain);
            }
            while !is_positive(log_j + change) {
                change *= 0.5;
            }
            log_j += change;
            if change.abs() <= f64::EPSILON * log_j.abs() {
                return Ok(strain(log_j));
            }
        }
        // Round-off can keep the final changes just above the bound.
        let e = strain(log_j);
        let is_settled = (log_volume_ratio(&e) - log_j).abs() <= SETTLED * (e.norm() + log_j.abs());
        if is_settled { Ok(e) } else { Err(MaterialError::NoStrain) }
    }

    fn isotropic_moduli(&self) -> Option<&dyn IsotropicModuli> {
        Some(self)
    }

    fn energy(&self, elastic_strain: &Sym3, _: &[f64]) -> f64 {
        let log_j = log_volume_ratio(elastic_strain);
        self.mu * (elastic_strain.trace() - log_j) + 0.5 * self.lambda * log_j * log_j
    }
}

impl IsotropicModuli for NeoHookean {
    /// λ̂ = λ and μ̂ = μ − λ ln J.
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
