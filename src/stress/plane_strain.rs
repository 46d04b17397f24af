//! The kernel in closed form for plane strain.
//!
//! z stays a principal direction and ΔF_33 = 1, so the in-plane 2×2 blocks decouple and only the in-plane block of
//! D^alg enters the tangent. In-plane symmetric tensors are three numbers `xx, yy, √2 xy`.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use super::{Contribution, Mechanics, PointError, PointResponse, StartOfStep};
use crate::kinematics::Increment;
use crate::material::{Material, StrainMeasure};
use crate::tensor::{Mat3, Sym3, Tangent, Tensor4, plane};

/// Plane strain in x, y.
#[derive(Debug, Clone, Copy)]
pub struct PlaneStrain;

/// The trial state and what the law answers to it.
struct Answer {
    dJ: f64,
    /// ΔF b_n.
    A: [[f64; 2]; 2],
    b: Sym3,
    /// τ and the elastic strain of the law.
    law: (Sym3, Sym3),
    /// Derivative of τ with respect to b on the in-plane components.
    C: [[f64; 3]; 3],
    tau: [[f64; 2]; 2],
}

#[inline(always)]
fn answer(
    start: &StartOfStep,
    dF: &[[f64; 2]; 2],
    material: &dyn Material,
    old: &[f64],
    new: &mut [f64],
) -> Result<Answer, PointError> {
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
    let measure = material.strain_measure();
    let (trial, L) = match measure {
        StrainMeasure::Logarithmic => {
            let (log_b, L) = plane::log_with_derivative(&b);
            (log_b * 0.5, L)
        }
        StrainMeasure::LeftCauchyGreen => ((b - Sym3::IDENTITY) * 0.5, [[0.0; 3]; 3]),
    };
    // By reference: the tangent of six by six entries is better not moved about.
    let answer = material.update(&trial, old, new);
    let law = match &answer {
        Ok(law) => law,
        Err(error) => return Err((*error).into()),
    };
    let C = match measure {
        StrainMeasure::Logarithmic => half_product(&law.tangent, &L),
        StrainMeasure::LeftCauchyGreen => IN_PLANE.map(|r| IN_PLANE.map(|c| 0.5 * law.tangent[(r, c)])),
    };
    let tau_xy = law.tau.0[5] * FRAC_1_SQRT_2;
    let tau = [[law.tau.0[0], tau_xy], [tau_xy, law.tau.0[1]]];
    let law = (law.tau, law.elastic_strain);
    Ok(Answer { dJ, A, b, law, C, tau })
}

impl Mechanics<2> for PlaneStrain {
    type Previous = Contribution<2, 2>;
    type Isotropic = Contribution<2, 2>;
    type Updated = Contribution<2, 2>;

    #[inline(always)]
    fn respond(
        start: &StartOfStep,
        increment: &Increment<2>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Contribution<2, 2>>, PointError> {
        let dF = &increment.dF;
        let Answer { dJ, A, law, C, tau, .. } = answer(start, dF, material, old, new)?;
        let (stress, tangent) = previous(&C, &tau, dF, dJ, &A, start.J_n);
        let weak = Contribution { stress, tangent, volume: start.volume_n, inverse: None, per_radius: 0.0 };
        Ok(PointResponse { weak, tau: law.0, elastic_strain: law.1 })
    }

    fn respond_updated(
        start: &StartOfStep,
        increment: &Increment<2>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Contribution<2, 2>>, PointError> {
        let dF = &increment.dF;
        let Answer { dJ, b, law, C, tau, .. } = answer(start, dF, material, old, new)?;
        let in_plane = [[b.0[0], b.0[5] * FRAC_1_SQRT_2], [b.0[5] * FRAC_1_SQRT_2, b.0[1]]];
        let (stress, tangent) = updated(&C, &tau, &in_plane, dJ * start.J_n);
        let weak = Contribution {
            stress,
            tangent,
            volume: dJ * start.volume_n,
            inverse: Some(invert(dF, dJ)),
            per_radius: 0.0,
        };
        Ok(PointResponse { weak, tau: law.0, elastic_strain: law.1 })
    }

    fn embed(increment: &Increment<2>) -> Mat3 {
        let [[xx, xy], [yx, yy]] = increment.dF;
        Mat3::new(xx, xy, 0.0, yx, yy, 0.0, 0.0, 0.0, 1.0)
    }

    fn elastic_left_cauchy_green(measure: StrainMeasure, elastic_strain: &Sym3) -> Sym3 {
        match measure {
            StrainMeasure::Logarithmic => plane::exp(&(*elastic_strain * 2.0)),
            StrainMeasure::LeftCauchyGreen => measure.left_cauchy_green(elastic_strain),
        }
    }
}

/// Rows of the in-plane components in the Mandel layout.
const IN_PLANE: [usize; 3] = [0, 1, 5];

#[inline(always)]
fn invert(dF: &[[f64; 2]; 2], dJ: f64) -> [[f64; 2]; 2] {
    [[dF[1][1] / dJ, -dF[0][1] / dJ], [-dF[1][0] / dJ, dF[0][0] / dJ]]
}

/// C = ½ D^alg L on the in-plane components `xx, yy, √2 xy`: the derivative of τ with respect to b.
#[inline(always)]
fn half_product(D: &Tangent, L: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    IN_PLANE.map(|r| {
        std::array::from_fn(|c| 0.5 * (D[(r, 0)] * L[0][c] + D[(r, 1)] * L[1][c] + D[(r, 5)] * L[2][c]))
    })
}

/// C : B as `[component][k][l]`, with B_ijkl = δ_ik A_jl + A_il δ_jk the derivative of b, eqs. (A.2) and (A.5);
/// components xx, yy, xy of the result.
#[inline(always)]
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
#[inline(always)]
fn previous(
    C: &[[f64; 3]; 3],
    tau: &[[f64; 2]; 2],
    dF: &[[f64; 2]; 2],
    dJ: f64,
    A: &[[f64; 2]; 2],
    J_n: f64,
) -> ([[f64; 2]; 2], Tensor4<2>) {
    let inverse = invert(dF, dJ);
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
