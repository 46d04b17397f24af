//! The kernel in three dimensions.

use super::principal;
use super::products::{MANDEL_INDEX, full, times};
use super::{
    Current, Deviation, Isotropic, Lane, Lanes, Mechanics, PointError, PointResponse, StartOfStep, WeakForm,
    transposed,
};
use crate::kinematics::Increment;
use crate::material::{Material, StrainMeasure};
use crate::tensor::{Sym3, log_with_derivative};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

/// Three-dimensional solid, without idealisation.
#[derive(Debug, Clone, Copy)]
pub struct Solid;

/// A point in the previously converged formulation, with gradients in the current configuration.
///
/// In V_n ∇S_a·Ã·∇S_b every index that refers to the start of the step can be paired with a ΔF⁻¹: ΔF b_n = b ΔF⁻ᵀ.
/// Moving these to the gradients, g = ∂S/∂X̃ ΔF⁻¹, leaves V_n/J_n g_a·(∂τ/∂ΔF·ΔFᵀ − τ ⊗̄ 1)·g_b, in which b replaces
/// ΔF b_n. This avoids the mapping of a fourth-order tensor, which is most of the work of eqs. (A.3)-(A.6).
#[derive(Debug, Clone, Copy)]
pub struct Spatial {
    /// ΔF⁻¹.
    pub(super) inverse: [[f64; 3]; 3],
    /// Trial b.
    pub(super) b: [[f64; 3]; 3],
    /// V_n τ/J_n.
    pub(super) stress: [[f64; 3]; 3],
    /// V_n/J_n times the change of τ with b. The first index is the component of b that changes, by α_q for b_kq
    /// (k ≠ q) or by 2α_k for b_kk with α = b g; the second index is the component of τ. Both are in the Mandel order.
    pub(super) moduli: [[f64; 6]; 6],
}

impl WeakForm<3> for Spatial {
    type Gradient<T: Lane> = [T; 3];
    type Column = [[[f64; 3]; 3]; 3];

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

    /// V_n Ã·∇S_b with both gradients mapped, `[m][i][k]`: the change of τ due to a motion of node b along k, minus
    /// (τ g_b)_i if m = k, the effect of the change of ΔF⁻¹.
    #[inline(always)]
    fn column(&self, gradient: &[f64; 3], force: &mut [f64; 3]) -> [[[f64; 3]; 3]; 3] {
        let traction = times(&self.stress, gradient);
        for (f, t) in force.iter_mut().zip(traction) {
            *f += t; // (23)
        }
        let alpha = times(&self.b, gradient);
        let change: [[f64; 6]; 3] = std::array::from_fn(|k| {
            let entry = |q: usize| &self.moduli[MANDEL_INDEX[k][q]];
            std::array::from_fn(|r| entry(0)[r] * alpha[0] + entry(1)[r] * alpha[1] + entry(2)[r] * alpha[2])
        });
        let mut column = [[[0.0; 3]; 3]; 3];
        for m in 0..3 {
            for i in 0..3 {
                for k in 0..3 {
                    column[m][i][k] = change[k][MANDEL_INDEX[i][m]];
                }
                column[m][i][m] -= traction[i];
            }
        }
        column
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &[[[f64; 3]; 3]; 3], gradient: &[T; 3], block: &mut [[T; 3]; 3]) {
        let [x, y, z] = column;
        let (x, y, z) = (x.as_flattened(), y.as_flattened(), z.as_flattened());
        for (e, entry) in block.as_flattened_mut().iter_mut().enumerate() {
            *entry += gradient[0] * x[e] + gradient[1] * y[e] + gradient[2] * z[e]; // (21)
        }
    }
}

impl From<&Spatial> for Current<3, 3> {
    #[inline(always)]
    fn from(point: &Spatial) -> Self {
        let Spatial { inverse, b, stress, moduli } = point;
        let entry = |i: usize, j: usize, k: usize, l: usize| {
            let entry = |q: usize| moduli[MANDEL_INDEX[k][q]][MANDEL_INDEX[i][j]];
            let change = entry(0) * b[0][l] + entry(1) * b[1][l] + entry(2) * b[2][l];
            if j == k { change - stress[i][l] } else { change }
        };
        Current::with_tangent(*stress, *inverse, 0.0, entry)
    }
}

/// det(ΔF) and ΔF⁻¹.
#[inline(always)]
fn invert(dF: &[[f64; 3]; 3]) -> Result<(f64, [[f64; 3]; 3]), PointError> {
    let minor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        dF[a][c] * dF[b][d] - dF[a][d] * dF[b][c]
    };
    let cofactors: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| minor(i, j)));
    let dJ = dF[0][0] * cofactors[0][0] + dF[0][1] * cofactors[0][1] + dF[0][2] * cofactors[0][2];
    if dJ.is_nan() || dJ <= 0.0 {
        return Err(PointError::Inverted { determinant: dJ });
    }
    let per_dJ = 1.0 / dJ;
    Ok((dJ, std::array::from_fn(|i| std::array::from_fn(|j| cofactors[j][i] * per_dJ))))
}

/// The trial state b = ΔF b_n ΔFᵀ.
#[inline(always)]
fn trial(dF: &[[f64; 3]; 3], b_n: &Sym3) -> Sym3 {
    let b_n = full(b_n, 1.0);
    let A: [[f64; 3]; 3] = std::array::from_fn(|i| times(&b_n, &dF[i]));
    let entry = |i: usize, j: usize| A[i][0] * dF[j][0] + A[i][1] * dF[j][1] + A[i][2] * dF[j][2];
    Sym3([
        entry(0, 0),
        entry(1, 1),
        entry(2, 2),
        SQRT_2 * entry(1, 2),
        SQRT_2 * entry(0, 2),
        SQRT_2 * entry(0, 1),
    ])
}

/// τ and elastic strain of a law at b, and twice the derivative of τ with respect to b, by columns.
#[inline(always)]
fn answer(
    material: &dyn Material,
    b: &Sym3,
    old: &[f64],
    new: &mut [f64],
) -> Result<(Sym3, Sym3, [[f64; 6]; 6]), PointError> {
    if let Some(law) = material.principal() {
        return principal::in_space(law, b, old, new);
    }
    match material.strain_measure() {
        StrainMeasure::Logarithmic => {
            let (log_b, L) = log_with_derivative(b);
            let answer = material.update(&(log_b * 0.5), old, new);
            let law = match &answer {
                Ok(law) => law,
                Err(error) => return Err((*error).into()),
            };
            let (D, L) = (&law.tangent.data.0, &L.data.0);
            let mut product = [[0.0; 6]; 6]; // D^alg : L, (A.4)
            for (column, factors) in product.iter_mut().zip(L) {
                for (row, factor) in D.iter().zip(factors) {
                    for (sum, entry) in column.iter_mut().zip(row) {
                        *sum += entry * factor;
                    }
                }
            }
            Ok((law.tau, law.elastic_strain, product))
        }
        StrainMeasure::LeftCauchyGreen => {
            let law = material.update(&((*b - Sym3::IDENTITY) * 0.5), old, new)?;
            Ok((law.tau, law.elastic_strain, law.tangent.data.0))
        }
    }
}

impl Mechanics<3> for Solid {
    type Previous = Spatial;
    type Isotropic = Isotropic;
    type Current = Current<3, 3>;
    type Averaging = Spatial;
    type AveragingIsotropic = Isotropic;
    type Deviation = Deviation<3, 3>;

    #[inline(always)]
    fn respond(
        start: &StartOfStep,
        increment: &Increment<3>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Spatial>, PointError> {
        let (_, inverse) = invert(&increment.dF)?;
        let b = trial(&increment.dF, &start.b_n);
        let (tau, elastic_strain, derivative) = answer(material, &b, old, new)?;
        let weight = start.volume_n / start.J_n;
        // Converts the doubled derivative from the Mandel layout to tensor components of τ per α.
        let mut moduli = derivative;
        for (s, column) in moduli.iter_mut().enumerate() {
            let scale = if s < 3 { weight } else { weight * FRAC_1_SQRT_2 };
            for (r, entry) in column.iter_mut().enumerate() {
                *entry *= if r < 3 { scale } else { scale * FRAC_1_SQRT_2 };
            }
        }
        let weak = Spatial { inverse, b: full(&b, 1.0), stress: full(&tau, weight), moduli };
        Ok(PointResponse { weak, tau, elastic_strain })
    }

    #[inline(always)]
    fn respond_isotropic(
        start: &StartOfStep,
        increment: &Increment<3>,
        material: &dyn Material,
    ) -> Option<Result<PointResponse<Isotropic>, PointError>> {
        let law = material.isotropic_moduli()?;
        let (_, inverse) = match invert(&increment.dF) {
            Ok(inverted) => inverted,
            Err(error) => return Some(Err(error)),
        };
        let b = trial(&increment.dF, &start.b_n);
        let answer = match law.respond(&b) {
            Ok(answer) => answer,
            Err(error) => return Some(Err(error.into())),
        };
        let weak = Isotropic::new(inverse, &answer, start.volume_n / start.J_n);
        Some(Ok(PointResponse { weak, tau: answer.tau, elastic_strain: answer.elastic_strain }))
    }

    #[inline(always)]
    fn respond_current(
        start: &StartOfStep,
        increment: &Increment<3>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Current<3, 3>>, PointError> {
        Ok(Self::respond(start, increment, material, old, new)?.map(|weak| Current::from(&weak)))
    }

    #[inline(always)]
    fn respond_averaging(
        start: &StartOfStep,
        increment: &Increment<3>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Spatial>, PointError> {
        Self::respond(start, increment, material, old, new)
    }

    #[inline(always)]
    fn respond_averaging_isotropic(
        start: &StartOfStep,
        increment: &Increment<3>,
        material: &dyn Material,
    ) -> Option<Result<PointResponse<Isotropic>, PointError>> {
        Self::respond_isotropic(start, increment, material)
    }
}
