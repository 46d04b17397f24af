//! Response of laws in principal axes to a trial b, without the logarithm of b as a tensor and its derivative.
//!
//! b, the trial strain and τ have the same axes, so that ∂τ/∂b follows from the modulus of the law by ∂ε_b/∂b_b = 1/(2
//! b_b) on normal components and from divided differences on shears.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use super::PointError;
use crate::material::{PrincipalLaw, PrincipalResponse, divided_difference};
use crate::tensor::{PrincipalDerivative, Sym3, ln, log_divided_difference, plane};

/// τ, the elastic strain, and the derivative of τ with respect to b on the in-plane components `xx, yy, √2 xy`.
pub(super) struct InPlaneAnswer {
    pub tau: Sym3,
    pub elastic_strain: Sym3,
    pub C: [[f64; 3]; 3],
}

/// Derivative of the stresses of two axes with respect to b on their shear: (τ_a − τ_b)/(b_a − b_b).
#[inline(always)]
fn on_shear(response: &PrincipalResponse, strain: &[f64; 3], b: &[f64; 3], pair: (usize, usize)) -> f64 {
    let PrincipalResponse { tau, modulus, .. } = response;
    let (i, j) = pair;
    let limit = || 0.5 * (modulus[i][i] - modulus[i][j] - modulus[j][i] + modulus[j][j]);
    let per_strain = divided_difference([tau[i], tau[j]], [strain[i], strain[j]], limit);
    0.5 * per_strain * log_divided_difference(b[i], b[j])
}

/// The response in the plane; b has the components `xx, yy, zz, √2 xy`.
///
/// # Errors
/// [`PointError::Material`] if the law fails, or b is not positive definite.
#[inline(always)]
pub(super) fn in_plane(
    law: &dyn PrincipalLaw,
    b: &[f64; 4],
    old: &[f64],
    new: &mut [f64],
) -> Result<InPlaneAnswer, PointError> {
    let plane::Axes { values, cosine, sine } = plane::Axes::new(b);
    // In descending order: the larger and the smaller value in the plane, with that of z among them.
    let order = if values[2] > values[0] {
        [2, 0, 1]
    } else if values[2] > values[1] {
        [0, 2, 1]
    } else {
        [0, 1, 2]
    };
    let logarithm = [ln(values[0]) * 0.5, ln(values[1]) * 0.5, ln(values[2]) * 0.5];
    let strain = order.map(|k| logarithm[k]);
    if !(strain[0] + strain[1] + strain[2]).is_finite() {
        return Err(crate::material::MaterialError::NotFinite.into());
    }
    let sorted = law.respond(strain, old, new)?;
    let mut response = sorted;
    for i in 0..3 {
        response.tau[order[i]] = sorted.tau[i];
        response.elastic_strain[order[i]] = sorted.elastic_strain[i];
        for j in 0..3 {
            response.modulus[order[i]][order[j]] = sorted.modulus[i][j];
        }
    }
    let tensor = |[first, second, z]: [f64; 3]| {
        let (mean, radius) = (0.5 * (first + second), 0.5 * (first - second));
        plane::tensor([mean + radius * cosine, mean - radius * cosine, z, SQRT_2 * radius * sine])
    };
    // Unit tensors of the axes and of their shear.
    let shear = sine * FRAC_1_SQRT_2;
    let axes = [
        [0.5 * (1.0 + cosine), 0.5 * (1.0 - cosine), shear],
        [0.5 * (1.0 - cosine), 0.5 * (1.0 + cosine), -shear],
    ];
    let across = [-shear, shear, cosine];
    let on_shear = on_shear(&response, &logarithm, &values, (0, 1));
    let per_b = [0.5 / values[0], 0.5 / values[1]];
    let mut C = [[0.0; 3]; 3];
    for c in 0..3 {
        let along = [axes[0][c] * per_b[0], axes[1][c] * per_b[1]];
        let [first, second] =
            [0, 1].map(|i| response.modulus[i][0] * along[0] + response.modulus[i][1] * along[1]);
        for r in 0..3 {
            C[r][c] = axes[0][r] * first + axes[1][r] * second + across[r] * (on_shear * across[c]);
        }
    }
    Ok(InPlaneAnswer { tau: tensor(response.tau), elastic_strain: tensor(response.elastic_strain), C })
}

/// τ, the elastic strain, and twice the derivative of τ with respect to b, by columns.
///
/// # Errors
/// As [`in_plane`].
#[inline(always)]
pub(super) fn in_space(
    law: &dyn PrincipalLaw,
    b: &Sym3,
    old: &[f64],
    new: &mut [f64],
) -> Result<(Sym3, Sym3, [[f64; 6]; 6]), PointError> {
    let spectrum = b.spectrum().descending();
    let values = spectrum.values;
    let strain = [ln(values[0]) * 0.5, ln(values[1]) * 0.5, ln(values[2]) * 0.5];
    if !(strain[0] + strain[1] + strain[2]).is_finite() {
        return Err(crate::material::MaterialError::NotFinite.into());
    }
    let response = law.respond(strain, old, new)?;
    let mut normal = response.modulus;
    for row in &mut normal {
        for (entry, b) in row.iter_mut().zip(&values) {
            *entry /= *b;
        }
    }
    let across = [(1, 2), (0, 2), (0, 1)].map(|pair| 2.0 * on_shear(&response, &strain, &values, pair));
    let derivative = spectrum.full_derivative(&PrincipalDerivative { normal, across });
    Ok((spectrum.compose(response.tau), spectrum.compose(response.elastic_strain), derivative.data.0))
}
