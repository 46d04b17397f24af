//! A point in three dimensions whose law has isotropic spatial moduli.

use super::products::{full, times};
use super::{Lane, Lanes, WeakForm, transposed};
use crate::material::IsotropicResponse;

/// A point in the previously converged formulation, with gradients in the current configuration, g = ∂S/∂X̃ ΔF⁻¹.
///
/// With the spatial moduli c, which map the rate of deformation to the Oldroyd rate of τ, the stiffness between two
/// nodes of eqs. (A.3)-(A.6) is V_n/J_n (g_a·c·g_b + (g_a·τ·g_b) 1). For c = λ̂ 1⊗1 + 2 μ̂ 𝟙, it reduces to products
/// of two vectors: V_n/J_n (λ̂ g_a⊗g_b + μ̂ g_b⊗g_a + (g_a·(τ + μ̂ 1)·g_b) 1).
#[derive(Debug, Clone, Copy)]
pub struct Isotropic {
    /// ΔF⁻¹.
    pub(super) inverse: [[f64; 3]; 3],
    /// V_n τ/J_n.
    pub(super) stress: [[f64; 3]; 3],
    /// V_n λ̂/J_n.
    pub(super) lambda: f64,
    /// V_n μ̂/J_n.
    pub(super) mu: f64,
}

impl Isotropic {
    /// Builds the point from ΔF⁻¹, the response of the law, and `weight` = V_n/J_n.
    #[inline(always)]
    pub(super) fn new(inverse: [[f64; 3]; 3], answer: &IsotropicResponse, weight: f64) -> Self {
        let IsotropicResponse { tau, lambda, mu, .. } = answer;
        Isotropic { inverse, stress: full(tau, weight), lambda: lambda * weight, mu: mu * weight }
    }
}

/// Contribution of node b to the stiffness of all pairs with this node; all vectors are multiplied by V_n/J_n.
#[derive(Debug, Clone, Copy)]
pub struct Vectors {
    /// λ̂ g_b.
    lambda: [f64; 3],
    /// μ̂ g_b.
    mu: [f64; 3],
    /// (τ + μ̂ 1) g_b.
    diagonal: [f64; 3],
}

impl WeakForm<3> for Isotropic {
    type Gradient<T: Lane> = [T; 3];
    type Column = Vectors;

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; 3]; 3]> {
        Some(&self.inverse)
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; 3], _value: f64) -> [f64; 3] {
        *gradient
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; 3]]) -> [Lanes; 3] {
        transposed(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; 3], force: &mut [f64; 3]) -> Vectors {
        let traction = times(&self.stress, gradient);
        for (f, t) in force.iter_mut().zip(traction) {
            *f += t;
        }
        let mu = std::array::from_fn(|i| self.mu * gradient[i]);
        Vectors {
            lambda: std::array::from_fn(|i| self.lambda * gradient[i]),
            mu,
            diagonal: std::array::from_fn(|i| traction[i] + mu[i]),
        }
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &Vectors, gradient: &[T; 3], block: &mut [[T; 3]; 3]) {
        let Vectors { lambda, mu, diagonal } = column;
        let on_diagonal = gradient[0] * diagonal[0] + gradient[1] * diagonal[1] + gradient[2] * diagonal[2];
        for i in 0..3 {
            for k in 0..3 {
                let off_diagonal = gradient[i] * lambda[k] + gradient[k] * mu[i];
                block[i][k] += if i == k { off_diagonal + on_diagonal } else { off_diagonal };
            }
        }
    }
}
