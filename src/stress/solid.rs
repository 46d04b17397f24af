//! The kernel in three dimensions, transcribed equation by equation.

use super::{Contribution, Formulation, Mechanics, PointError, StartOfStep};
use crate::material::Material;
use crate::tensor::{Mat3, Sym3, Tangent, Tensor4, log_derivative, mandel_entry};

/// Three-dimensional solid: nothing is idealised.
#[derive(Debug, Clone, Copy)]
pub struct Solid;

impl Mechanics<3> for Solid {
    fn respond(
        formulation: Formulation,
        start: &StartOfStep,
        dF: &[[f64; 3]; 3],
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<Contribution<3>, PointError> {
        let dF = Self::embed(dF);
        let dJ = dF.determinant();
        let inverse = match dF.try_inverse() {
            Some(inverse) if dJ > 0.0 => inverse,
            _ => return Err(PointError::Inverted { determinant: dJ }),
        };
        let b_n = start.b_n.to_matrix();
        let b = Sym3::symmetric_part(&(dF * b_n * dF.transpose()));
        let trial = b.map_eigenvalues(f64::ln) * 0.5;
        let law = material.update(&trial, old, new)?;
        // ½ D^alg : L, the derivative of τ with respect to b.
        let C = law.tangent * log_derivative(&b) * 0.5;
        let tau = law.tau.to_matrix();
        let (stress, tangent, volume) = match formulation {
            Formulation::PreviouslyConverged => {
                let (stress, tangent) = previous(&C, &tau, &dF, &inverse, &b_n, start.J_n);
                (stress, tangent, start.volume_n)
            }
            Formulation::UpdatedLagrangian => {
                let (stress, tangent) = updated(&C, &tau, &b.to_matrix(), dJ * start.J_n);
                (stress, tangent, dJ * start.volume_n)
            }
        };
        Ok(Contribution { stress, tangent, volume, tau: law.tau, elastic_strain: law.elastic_strain })
    }

    fn embed(dF: &[[f64; 3]; 3]) -> Mat3 {
        Mat3::from_fn(|i, j| dF[i][j])
    }

    fn elastic_left_cauchy_green(elastic_strain: &Sym3) -> Sym3 {
        elastic_strain.map_eigenvalues(|e| (2.0 * e).exp())
    }
}

/// Builds a fourth-order tensor from its entries.
fn tensor4(entry: impl Fn(usize, usize, usize, usize) -> f64) -> Tensor4<3> {
    let index = std::array::from_fn::<usize, 3, _>(|i| i);
    index.map(|i| index.map(|j| index.map(|k| index.map(|l| entry(i, j, k, l)))))
}

/// Sum of `term` over one index.
fn sum(term: impl Fn(usize) -> f64) -> f64 {
    term(0) + term(1) + term(2)
}

fn delta(i: usize, j: usize) -> f64 {
    f64::from(u8::from(i == j))
}

/// C_ijpq B_pqkl with minor symmetries in both.
fn contract(C: &Tangent, B: &Tensor4<3>) -> Tensor4<3> {
    tensor4(|i, j, k, l| sum(|p| sum(|q| mandel_entry(C, i, j, p, q) * B[p][q][k][l])))
}

/// P̃ of eq. (18) and its derivative Ã of eqs. (A.3)-(A.6).
fn previous(
    C: &Tangent,
    tau: &Mat3,
    dF: &Mat3,
    inverse: &Mat3,
    b_n: &Mat3,
    J_n: f64,
) -> ([[f64; 3]; 3], Tensor4<3>) {
    let P = tau * inverse.transpose() / J_n;
    let A = dF * b_n;
    let B = tensor4(|i, j, k, l| delta(i, k) * A[(j, l)] + A[(i, l)] * delta(j, k)); // (A.5)
    let dtau = contract(C, &B); // (A.4)
    let tangent = tensor4(|i, j, k, l| {
        // (A.3) with (A.6): τ_im ∂ΔF⁻¹_jm/∂ΔF_kl = −τ_im ΔF⁻¹_lm ΔF⁻¹_jk.
        sum(|m| dtau[i][m][k][l] * inverse[(j, m)]) / J_n - P[(i, l)] * inverse[(j, k)]
    });
    (std::array::from_fn(|i| std::array::from_fn(|j| P[(i, j)])), tangent)
}

/// σ and the spatial modulus a of eqs. (A.1)-(A.2), with S_ijkl = σ_il δ_jk.
fn updated(C: &Tangent, tau: &Mat3, b: &Mat3, J: f64) -> ([[f64; 3]; 3], Tensor4<3>) {
    let sigma = tau / J;
    let B = tensor4(|p, q, k, l| delta(p, k) * b[(q, l)] + delta(q, k) * b[(p, l)]); // (A.2)
    let CB = contract(C, &B);
    let a = tensor4(|i, j, k, l| CB[i][j][k][l] / J - sigma[(i, l)] * delta(j, k)); // (A.1)
    (std::array::from_fn(|i| std::array::from_fn(|j| sigma[(i, j)])), a)
}
