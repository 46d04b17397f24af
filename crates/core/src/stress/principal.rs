//! Response of laws in principal axes to a trial b, without forming the logarithm of b as a tensor, or its derivative.
//!
//! b, the trial strain and τ have the same axes, so that ∂τ/∂b follows from the modulus of the law and ∂ε_a/∂b_a =
//! 1/(2b_a) for normal components, and from divided differences for shear components.

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use super::{Lane, Lanes, PointError};
use crate::material::{MaterialError, PrincipalLaw, PrincipalResponse, divided_difference};
use crate::tensor::{PrincipalDerivative, Sym3, ln, log_divided_difference, plane};

/// Largest number of history variables of a law that is evaluated for several points at once.
pub(crate) const MAX_HISTORY: usize = 16;

/// τ and the elastic strain as `xx, yy, zz, √2 xy`, and the derivative of the in-plane components `xx, yy, √2 xy`
/// of τ with respect to those of b.
pub(super) struct InPlaneAnswer<T> {
    pub tau: [T; 4],
    pub elastic_strain: [T; 4],
    pub C: [[T; 3]; 3],
}

/// The response of a law on the axes in the plane and along z, in the order of [`plane::Axes`].
struct OnAxes<T> {
    tau: [T; 3],
    elastic_strain: [T; 3],
    /// The modulus on the axes in the plane.
    modulus: [[T; 2]; 2],
    /// (τ_1 − τ_2)/(ε_1 − ε_2) for these axes.
    on_shear: T,
}

/// The response to the logarithm of b on the axes.
#[inline(always)]
fn respond(
    law: &dyn PrincipalLaw,
    logarithm: [f64; 3],
    old: &[f64],
    new: &mut [f64],
) -> Result<OnAxes<f64>, MaterialError> {
    // In descending order: the larger and the smaller value in the plane, with the value along z sorted in.
    let order = if logarithm[2] > logarithm[0] {
        [2, 0, 1]
    } else if logarithm[2] > logarithm[1] {
        [0, 2, 1]
    } else {
        [0, 1, 2]
    };
    let strain = order.map(|k| 0.5 * logarithm[k]);
    if !(strain[0] + strain[1] + strain[2]).is_finite() {
        return Err(MaterialError::NotFinite);
    }
    let PrincipalResponse { tau, elastic_strain, modulus } = law.respond(strain, old, new)?;
    // The positions of the axes in the descending order.
    let [first, second, z] = match order {
        [2, 0, 1] => [1, 2, 0],
        [0, 2, 1] => [0, 2, 1],
        _ => [0, 1, 2],
    };
    let [a, b, c, d] =
        [modulus[first][first], modulus[first][second], modulus[second][first], modulus[second][second]];
    let pair = |all: [f64; 3]| [all[first], all[second]];
    Ok(OnAxes {
        tau: [tau[first], tau[second], tau[z]],
        elastic_strain: [elastic_strain[first], elastic_strain[second], elastic_strain[z]],
        modulus: [[a, b], [c, d]],
        on_shear: divided_difference(pair(tau), pair(strain), 0.5 * (a - b - c + d)),
    })
}

/// Derivative of the shear component of τ between two axes with respect to that of b: (τ_a − τ_b)/(b_a − b_b).
#[inline(always)]
fn on_shear(response: &PrincipalResponse, strain: &[f64; 3], b: &[f64; 3], [i, j]: [usize; 2]) -> f64 {
    let PrincipalResponse { tau, modulus, .. } = response;
    let limit = 0.5 * (modulus[i][i] - modulus[i][j] - modulus[j][i] + modulus[j][j]);
    let per_strain = divided_difference([tau[i], tau[j]], [strain[i], strain[j]], limit);
    0.5 * per_strain * log_divided_difference(b[i], b[j])
}

/// As [`respond`] for several points, with bitwise equal results, if none of them flows.
#[inline(always)]
fn without_flow(law: &dyn PrincipalLaw, logarithm: &[Lanes; 3], history: &[Lanes]) -> Option<OnAxes<Lanes>> {
    let strain @ [first, second, z] = [logarithm[0] * 0.5, logarithm[1] * 0.5, logarithm[2] * 0.5];
    let sorted = descending(&strain);
    let elasticity = law.without_flow(&sorted, history)?;
    let pressure = (sorted[0] + sorted[1] + sorted[2]) * elasticity.lambda();
    let twice_shear = 2.0 * elasticity.shear;
    let tau = [first * twice_shear + pressure, second * twice_shear + pressure, z * twice_shear + pressure];
    let (diagonal, aside) = (elasticity.lambda() + twice_shear, elasticity.lambda());
    let limit = 0.5 * (diagonal - aside - aside + diagonal);
    let on_shear = divided_difference([tau[0], tau[1]], [first, second], Lanes::splat(limit));
    let (diagonal, aside) = (Lanes::splat(diagonal), Lanes::splat(aside));
    let modulus = [[diagonal, aside], [aside, diagonal]];
    Some(OnAxes { tau, elastic_strain: [first, second, z], modulus, on_shear })
}

/// The strains of the axes in the plane, in descending order, with the strain along z sorted in.
#[inline(always)]
fn descending([first, second, z]: &[Lanes; 3]) -> [Lanes; 3] {
    let largest = first.where_below(*z, *z, *first);
    let least = z.where_below(*second, *z, *second);
    let middle = first.where_below(*z, *first, second.where_below(*z, *z, *second));
    [largest, middle, least]
}

/// As [`respond`] for several points side by side, with bitwise equal results, if the law has such a form and all
/// points respond. Replaces `history` by its new values.
#[inline(always)]
fn side_by_side(
    law: &dyn PrincipalLaw,
    logarithm: &[Lanes; 3],
    history: &mut [Lanes],
) -> Option<OnAxes<Lanes>> {
    let strain @ [first, second, z] = [logarithm[0] * 0.5, logarithm[1] * 0.5, logarithm[2] * 0.5];
    let mut new = [Lanes::ZERO; MAX_HISTORY];
    let new = new.get_mut(..history.len())?;
    let response = law.respond_in_lanes(&descending(&strain), history, new)?;
    history.copy_from_slice(new);
    // The strain along z is the largest, the least, or between those of the axes in the plane.
    let pick = |above: Lanes, below: Lanes, between: Lanes| {
        first.where_below(z, above, z.where_below(second, below, between))
    };
    let on_axes = |x: &[Lanes; 3]| [pick(x[1], x[0], x[0]), pick(x[2], x[1], x[2]), pick(x[0], x[2], x[1])];
    let [tau, elastic_strain] = [on_axes(&response.tau), on_axes(&response.elastic_strain)];
    let m = &response.modulus;
    let modulus = [
        [pick(m[1][1], m[0][0], m[0][0]), pick(m[1][2], m[0][1], m[0][2])],
        [pick(m[2][1], m[1][0], m[2][0]), pick(m[2][2], m[1][1], m[2][2])],
    ];
    let [[a, b], [c, d]] = modulus;
    let on_shear = divided_difference([tau[0], tau[1]], [first, second], (a - b - c + d) * 0.5);
    Some(OnAxes { tau, elastic_strain, modulus, on_shear })
}

/// The tensors of a response, and the derivative of τ.
#[inline(always)]
fn in_components<T: Lane>(axes: &plane::Axes<T>, response: &OnAxes<T>) -> InPlaneAnswer<T> {
    let plane::Axes { values, cosine, sine, on_shear, .. } = *axes;
    // Unit tensors of the axes and of their shear.
    let (one, shear) = (T::splat(1.0), sine * FRAC_1_SQRT_2);
    let (more, less) = ((one + cosine) * 0.5, (one - cosine) * 0.5);
    let opposite = shear * -1.0;
    let units = [[more, less, shear], [less, more, opposite]];
    let across = [opposite, shear, cosine];
    let per_shear = response.on_shear * on_shear * 0.5;
    let half = T::splat(0.5);
    let per_b = [half / values[0], half / values[1]];
    let [[m11, m12], [m21, m22]] = response.modulus;
    let mut C = [across; 3];
    for c in 0..3 {
        let (along, aside) = (units[0][c] * per_b[0], units[1][c] * per_b[1]);
        let (first, second) = (m11 * along + m12 * aside, m21 * along + m22 * aside);
        let sheared = per_shear * across[c];
        for r in 0..3 {
            C[r][c] = units[0][r] * first + units[1][r] * second + across[r] * sheared;
        }
    }
    InPlaneAnswer {
        tau: tensor(&response.tau, cosine, sine),
        elastic_strain: tensor(&response.elastic_strain, cosine, sine),
        C,
    }
}

/// The tensor with these values on the axes, as `xx, yy, zz, √2 xy`.
#[inline(always)]
fn tensor<T: Lane>(values: &[T; 3], cosine: T, sine: T) -> [T; 4] {
    let [first, second, z] = *values;
    let (mean, radius) = ((first + second) * 0.5, (first - second) * 0.5);
    [mean + radius * cosine, mean - radius * cosine, z, radius * sine * SQRT_2]
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
) -> Result<InPlaneAnswer<f64>, PointError> {
    let axes = plane::Axes::new(b);
    let response = respond(law, axes.logarithm, old, new)?;
    Ok(in_components(&axes, &response))
}

/// As [`in_plane`] for several points of one law: axes and tensors for all points at once, return mappings one by one
/// unless the law has a form for several points. Replaces `history` by its new values. `None` if a point fails.
#[inline(always)]
pub(super) fn in_lanes(
    law: &dyn PrincipalLaw,
    b: &[Lanes; 4],
    history: &mut [Lanes],
) -> Option<InPlaneAnswer<Lanes>> {
    let axes = plane::Axes::new(b);
    if let Some(elastic) = without_flow(law, &axes.logarithm, history) {
        return Some(in_components(&axes, &elastic));
    }
    if let Some(all) = side_by_side(law, &axes.logarithm, history) {
        return Some(in_components(&axes, &all));
    }
    let (zero, kept) = (Lanes::ZERO, history.len());
    let mut all =
        OnAxes { tau: [zero; 3], elastic_strain: [zero; 3], modulus: [[zero; 2]; 2], on_shear: zero };
    let (mut old, mut new) = ([0.0; MAX_HISTORY], [0.0; MAX_HISTORY]);
    for l in 0..Lanes::WIDTH {
        for (old, lanes) in old.iter_mut().zip(&*history) {
            *old = lanes.0[l];
        }
        let logarithm = axes.logarithm.map(|lanes| lanes.0[l]);
        let one = respond(law, logarithm, old.get(..kept)?, new.get_mut(..kept)?).ok()?;
        for (lanes, new) in history.iter_mut().zip(&new) {
            lanes.0[l] = *new;
        }
        for i in 0..3 {
            (all.tau[i].0[l], all.elastic_strain[i].0[l]) = (one.tau[i], one.elastic_strain[i]);
        }
        for i in 0..2 {
            for j in 0..2 {
                all.modulus[i][j].0[l] = one.modulus[i][j];
            }
        }
        all.on_shear.0[l] = one.on_shear;
    }
    Some(in_components(&axes, &all))
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
        return Err(MaterialError::NotFinite.into());
    }
    let response = law.respond(strain, old, new)?;
    let mut normal = response.modulus;
    for row in &mut normal {
        for (entry, b) in row.iter_mut().zip(&values) {
            *entry /= *b;
        }
    }
    let across = [[1, 2], [0, 2], [0, 1]].map(|pair| 2.0 * on_shear(&response, &strain, &values, pair));
    let derivative = spectrum.full_derivative(&PrincipalDerivative { normal, across });
    Ok((spectrum.compose(response.tau), spectrum.compose(response.elastic_strain), derivative.data.0))
}
