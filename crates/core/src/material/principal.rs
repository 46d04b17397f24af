//! Laws in principal axes: isotropic laws in the logarithmic strain, whose stress has the principal axes of the trial
//! strain.

use super::{Elasticity, MaterialError, Response};
use crate::tensor::{Lane, Lanes, PrincipalDerivative, Sym3};

/// Response of a law to the principal values of a trial elastic strain; `T` is a number for one point, or a vector with
/// one SIMD lane for each of several points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalResponse<T = f64> {
    /// Principal Kirchhoff stresses, [stress].
    pub tau: [T; 3],
    /// Principal elastic strains after the return mapping, [-].
    pub elastic_strain: [T; 3],
    /// Derivative of stress `i` with respect to trial strain `j`, `[i][j]`, [stress].
    pub modulus: [[T; 3]; 3],
}

/// A law in the logarithmic strain that is formulated in principal axes.
pub trait PrincipalLaw: Send + Sync {
    /// Principal form of [`Material::update`](super::Material::update). The trial strains are in descending order; the
    /// stresses belong to the same axes.
    ///
    /// # Errors
    /// [`MaterialError`] if the strain is not finite or the return mapping fails.
    fn respond(
        &self,
        trial: [f64; 3],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PrincipalResponse, MaterialError>;

    /// The elasticity of several points if none of them flows, so that their response needs no return mapping: stress
    /// and modulus follow from this elasticity, and the history does not change. `None` if a point may flow, or if a
    /// strain is not finite.
    fn without_flow(&self, _trial: &[Lanes; 3], _old: &[Lanes]) -> Option<Elasticity> {
        None
    }

    /// The same as [`PrincipalLaw::respond`], bit for bit, for several points at once. `None` if the law has no such
    /// form, or if a point has no response.
    fn respond_in_lanes(
        &self,
        _trial: &[Lanes; 3],
        _old: &[Lanes],
        _new: &mut [Lanes],
    ) -> Option<PrincipalResponse<Lanes>> {
        None
    }
}

/// [`Material::update`](super::Material::update) of a law in principal axes: D^alg consists of the modulus for the
/// normal components n_a ⊗ n_a and of the divided differences (τ_a − τ_b)/(ε_a − ε_b) for the shear components.
///
/// # Errors
/// [`MaterialError::NotFinite`] if the strain is not finite, and the errors of the law.
pub fn update_in_principal_axes(
    law: &impl PrincipalLaw,
    trial: &Sym3,
    old: &[f64],
    new: &mut [f64],
) -> Result<Response, MaterialError> {
    let spectrum = trial.spectrum().descending();
    if !spectrum.values.iter().all(|e| e.is_finite()) {
        return Err(MaterialError::NotFinite);
    }
    let PrincipalResponse { tau, elastic_strain, modulus } = law.respond(spectrum.values, old, new)?;
    let across = [(1, 2), (0, 2), (0, 1)].map(|(a, b)| {
        let [e_a, e_b] = [spectrum.values[a], spectrum.values[b]];
        let limit = 0.5 * (modulus[a][a] - modulus[a][b] - modulus[b][a] + modulus[b][b]);
        divided_difference([tau[a], tau[b]], [e_a, e_b], limit)
    });
    Ok(Response {
        tau: spectrum.compose(tau),
        elastic_strain: spectrum.compose(elastic_strain),
        tangent: spectrum.full_derivative(&PrincipalDerivative { normal: modulus, across }),
    })
}

/// Two strains count as equal if they differ by less than this, relative to the larger of the two, [-].
const EQUAL: f64 = 1e-8;

/// (τ_a − τ_b)/(ε_a − ε_b), or its limit if the difference between the strains is round-off.
#[inline(always)]
pub(crate) fn divided_difference<T: Lane>(tau: [T; 2], strain: [T; 2], limit: T) -> T {
    let gap = strain[0] - strain[1];
    let size = strain[0].abs().where_below(strain[1].abs(), strain[1].abs(), strain[0].abs());
    (size * EQUAL).where_below(gap.abs(), (tau[0] - tau[1]) / gap, limit)
}

impl Elasticity {
    /// The same as [`Elasticity::stress`] in principal axes.
    #[inline]
    pub fn principal_stress(&self, strain: [f64; 3]) -> [f64; 3] {
        self.stress_components(&strain)
    }

    /// The same as [`Elasticity::strain`] in principal axes; not finite if the stress is not finite.
    #[inline]
    pub fn principal_strain(&self, stress: [f64; 3]) -> [f64; 3] {
        let mean = (stress[0] + stress[1] + stress[2]) / 3.0;
        stress.map(|tau| (tau - mean) * (0.5 / self.shear) + mean / (3.0 * self.bulk))
    }

    /// The modulus in principal axes, λ + 2G δ_ij, [stress].
    #[inline]
    pub fn principal_modulus(&self) -> [[f64; 3]; 3] {
        let lambda = self.lambda();
        std::array::from_fn(|i| {
            std::array::from_fn(|j| if i == j { lambda + 2.0 * self.shear } else { lambda })
        })
    }
}
