//! The kernel in closed form for plane strain.
//!
//! z stays a principal direction and ΔF_33 = 1, so the in-plane 2×2 blocks decouple and only the in-plane block of
//! D^alg enters the tangent. In-plane symmetric tensors are three numbers `xx, yy, √2 xy`.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use super::{Contribution, Formulation, Mechanics, PointError, StartOfStep};
use crate::material::Material;
use crate::tensor::{Mat3, Sym3, Tangent, Tensor4, plane};

/// Plane strain in x, y.
#[derive(Debug, Clone, Copy)]
pub struct PlaneStrain;

impl Mechanics<2> for PlaneStrain {
    #[inline]
    fn respond(
        formulation: Formulation,
        start: &StartOfStep,
        dF: &[[f64; 2]; 2],
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<Contribution<2>, PointError> {
        let dJ = dF[0][0] * dF[1][1] - dF[0][1] * dF[1][0];
        if dJ.is_nan() || dJ <= 0.0 {
            return Err(PointError::Inverted { determinant: dJ });
        }
        // A = ΔF b_n and the trial b = A ΔFᵀ.
        let b_n = &start.b_n.0;
        let xy = b_n[5] * FRAC_1_SQRT_2;
        let A: [[f64; 2]; 2] =
            std::array::from_fn(|i| [dF[i][0] * b_n[0] + dF[i][1] * xy, dF[i][0] * xy + dF[i][1] * b_n[1]]);
        let b = Sym3([
            A[0][0] * dF[0][0] + A[0][1] * dF[0][1],
            A[1][0] * dF[1][0] + A[1][1] * dF[1][1],
            b_n[2],
            0.0,
            0.0,
            (A[0][0] * dF[1][0] + A[0][1] * dF[1][1]) * SQRT_2,
        ]);
        let (log_b, L) = plane::log_with_derivative(&b);
        let law = material.update(&(log_b * 0.5), old, new)?;
        let C = half_product(&law.tangent, &L);
        let tau_xy = law.tau.0[5] * FRAC_1_SQRT_2;
        let tau = [[law.tau.0[0], tau_xy], [tau_xy, law.tau.0[1]]];
        let (stress, tangent, volume) = match formulation {
            Formulation::PreviouslyConverged => {
                let (stress, tangent) = previous(&C, &tau, dF, dJ, &A, start.J_n);
                (stress, tangent, start.volume_n)
            }
            Formulation::UpdatedLagrangian => {
                let in_plane = [[b.0[0], b.0[5] * FRAC_1_SQRT_2], [b.0[5] * FRAC_1_SQRT_2, b.0[1]]];
                let (stress, tangent) = updated(&C, &tau, &in_plane, dJ * start.J_n);
                (stress, tangent, dJ * start.volume_n)
            }
        };
        Ok(Contribution { stress, tangent, volume, tau: law.tau, elastic_strain: law.elastic_strain })
    }

    fn embed(dF: &[[f64; 2]; 2]) -> Mat3 {
        Mat3::new(dF[0][0], dF[0][1], 0.0, dF[1][0], dF[1][1], 0.0, 0.0, 0.0, 1.0)
    }

    fn elastic_left_cauchy_green(elastic_strain: &Sym3) -> Sym3 {
        plane::exp(&(*elastic_strain * 2.0))
    }
}

/// C = ½ D^alg L on the in-plane components `xx, yy, √2 xy`: the derivative of τ with respect to b.
#[inline]
fn half_product(D: &Tangent, L: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    let rows = [0, 1, 5];
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            0.5 * (D[(rows[r], 0)] * L[0][c] + D[(rows[r], 1)] * L[1][c] + D[(rows[r], 5)] * L[2][c])
        })
    })
}

/// C : B as `[component][k][l]`, with B_ijkl = δ_ik A_jl + A_il δ_jk the derivative of b, eqs. (A.2) and (A.5);
/// components xx, yy, xy of the result.
#[inline]
fn contract(C: &[[f64; 3]; 3], A: &[[f64; 2]; 2]) -> [[[f64; 2]; 2]; 3] {
    std::array::from_fn(|r| {
        let scale = if r == 2 { FRAC_1_SQRT_2 } else { 1.0 };
        let (xx, yy, xy) = (2.0 * scale * C[r][0], 2.0 * scale * C[r][1], SQRT_2 * scale * C[r][2]);
        [
            std::array::from_fn(|l| xx * A[0][l] + xy * A[1][l]),
            std::array::from_fn(|l| yy * A[1][l] + xy * A[0][l]),
        ]
    })
}

/// P̃ of eq. (18) and its derivative Ã of eqs. (A.3)-(A.6).
#[inline]
fn previous(
    C: &[[f64; 3]; 3],
    tau: &[[f64; 2]; 2],
    dF: &[[f64; 2]; 2],
    dJ: f64,
    A: &[[f64; 2]; 2],
    J_n: f64,
) -> ([[f64; 2]; 2], Tensor4<2>) {
    let inverse = [[dF[1][1] / dJ, -dF[0][1] / dJ], [-dF[1][0] / dJ, dF[0][0] / dJ]];
    let per_J = 1.0 / J_n;
    let P: [[f64; 2]; 2] = std::array::from_fn(|i| {
        std::array::from_fn(|j| per_J * (tau[i][0] * inverse[j][0] + tau[i][1] * inverse[j][1]))
    });
    let dtau = contract(C, A); // (A.4)
    let row = |i: usize, m: usize| if i == m { i } else { 2 };
    let tangent = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let (first, second) = (&dtau[row(i, 0)], &dtau[row(i, 1)]);
            let (w0, w1) = (per_J * inverse[j][0], per_J * inverse[j][1]);
            // (A.3) with (A.6): τ_im ∂ΔF⁻¹_jm/∂ΔF_kl = −τ_im ΔF⁻¹_lm ΔF⁻¹_jk.
            std::array::from_fn(|k| {
                std::array::from_fn(|l| w0 * first[k][l] + w1 * second[k][l] - P[i][l] * inverse[j][k])
            })
        })
    });
    (P, tangent)
}

/// σ and the spatial modulus a of eqs. (A.1)-(A.2), with S_ijkl = σ_il δ_jk.
fn updated(C: &[[f64; 3]; 3], tau: &[[f64; 2]; 2], b: &[[f64; 2]; 2], J: f64) -> ([[f64; 2]; 2], Tensor4<2>) {
    let sigma = tau.map(|row| row.map(|x| x / J));
    let CB = contract(C, b);
    let row = |i: usize, j: usize| if i == j { i } else { 2 };
    let tangent = std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            std::array::from_fn(|k| {
                std::array::from_fn(|l| {
                    let geometric = if j == k { sigma[i][l] } else { 0.0 };
                    CB[row(i, j)][k][l] / J - geometric
                })
            })
        })
    });
    (sigma, tangent)
}
