//! Constitutive laws: Kirchhoff stress as a function of elastic strain.
//!
//! A law is implemented once, in three dimensions, in one of two strain measures ([`StrainMeasure`]). Laws in the
//! logarithmic strain have the form of small-strain laws: with the multiplicative decomposition, the return mapping of
//! small-strain plasticity applies at finite strain. Laws in b^e need no eigenvalues of b^e. A law knows neither the
//! grid nor the dimension nor the load step, and its result depends only on its arguments. A law that depends on time
//! provides, for each step, the law of a step of this duration ([`Material::for_duration`]).

mod at_rest;
mod batch;
pub mod conformance;
mod drucker_prager;
mod hencky;
mod initial_state;
mod modified_cam_clay;
mod mohr_coulomb;
mod neo_hookean;
mod principal;
mod softening;
mod soil_plasticity;
mod strength;
#[cfg(test)]
pub(crate) mod tests;
mod tresca;
mod undrained;
mod varying;
mod viscous;
mod von_mises;
mod wedge;

use std::borrow::Cow;

use crate::tensor::{Lane, Lanes, Sym3, Tangent, dyad};

pub use at_rest::{Modulus, axial_modulus_at_rest, axial_modulus_from, shear_modulus_at_rest};
pub(crate) use batch::respond_to_batch;
pub use batch::{BatchError, BatchLaw, respond_alone};
pub use drucker_prager::{DruckerPrager, Match};
pub use hencky::Hencky;
pub use initial_state::{InitialState, initial_state};
pub use modified_cam_clay::{CamClay, ModifiedCamClay};
pub use mohr_coulomb::{Friction, MohrCoulomb, least_softening_strain};
pub use neo_hookean::NeoHookean;
pub(crate) use principal::divided_difference;
pub use principal::{PrincipalLaw, PrincipalResponse, update_in_principal_axes};
pub use softening::Softening;
pub use strength::StrengthMeasure;
pub use tresca::Tresca;
pub use undrained::{EXCESS_PORE_PRESSURE, Undrained};
pub use varying::{PropertiesAt, Varying, VaryingProperty};
pub use viscous::Viscous;
pub use von_mises::VonMises;

/// Boxes laws. The generic code of these laws is compiled here, with full optimisation, and not in the crates that
/// create them.
macro_rules! boxed {
    ($($Law:ty)*) => {$(
        impl From<$Law> for Box<dyn Material> {
            #[inline(never)]
            fn from(law: $Law) -> Self {
                Box::new(law)
            }
        }
    )*};
}

boxed!(DruckerPrager Hencky ModifiedCamClay MohrCoulomb NeoHookean Tresca VonMises);

/// A history variable of a law.
#[derive(Debug, Clone, PartialEq)]
pub struct StateField {
    /// Name in result files.
    pub name: Cow<'static, str>,
    /// Unit as text.
    pub unit: Cow<'static, str>,
    /// Initial value.
    pub initial: f64,
}

impl StateField {
    /// A history variable of a law in Rust, whose name and unit are constants.
    pub const fn new(name: &'static str, unit: &'static str, initial: f64) -> Self {
        StateField { name: Cow::Borrowed(name), unit: Cow::Borrowed(unit), initial }
    }
}

/// Strain measure in which a law is formulated. All measures are zero in the undeformed state and agree at small
/// strain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StrainMeasure {
    /// ε^e = ½ ln b^e.
    Logarithmic,
    /// ½ (b^e − I), for laws formulated in b^e.
    LeftCauchyGreen,
}

impl StrainMeasure {
    /// b^e from a strain in this measure.
    pub fn left_cauchy_green(self, strain: &Sym3) -> Sym3 {
        match self {
            StrainMeasure::Logarithmic => strain.map_eigenvalues(|e| (2.0 * e).exp()),
            StrainMeasure::LeftCauchyGreen => Sym3::IDENTITY + *strain * 2.0,
        }
    }

    /// ε^e = ½ ln b^e from a strain in this measure.
    pub fn logarithmic(self, strain: &Sym3) -> Sym3 {
        match self {
            StrainMeasure::Logarithmic => *strain,
            StrainMeasure::LeftCauchyGreen => self.left_cauchy_green(strain).map_eigenvalues(f64::ln) * 0.5,
        }
    }
}

/// Response of a law to a trial elastic strain. All strains are in the measure of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Kirchhoff stress τ, [stress].
    pub tau: Sym3,
    /// Elastic strain after the return mapping, [-].
    pub elastic_strain: Sym3,
    /// Algorithmic tangent D^alg, the derivative of τ with respect to the trial strain, [stress].
    pub tangent: Tangent,
}

/// Response of a law with isotropic spatial moduli to a trial elastic strain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IsotropicResponse {
    /// Kirchhoff stress τ, [stress].
    pub tau: Sym3,
    /// Elastic strain, in the measure of the law, [-].
    pub elastic_strain: Sym3,
    /// λ̂, [stress].
    pub lambda: f64,
    /// μ̂, [stress].
    pub mu: f64,
}

/// An elastic law without history whose spatial moduli are isotropic in every state: λ̂ I⊗I + 2 μ̂ 𝟙 with
/// state-dependent λ̂ and μ̂. The moduli map the rate of deformation to the Oldroyd rate of τ.
pub trait IsotropicModuli {
    /// Stress and moduli at the trial b^e, consistent with [`Material::update`].
    ///
    /// # Errors
    /// [`MaterialError`] if the strain is not finite.
    fn respond(&self, b: &Sym3) -> Result<IsotropicResponse, MaterialError>;
}

/// Response of a law in the logarithmic strain whose tangent is D^alg = λ I⊗I + 2μ 𝟙 − α n⊗n. Tensors have `N`
/// components in the Mandel layout, normal components before shears. `T` is a number for one point, or a vector with
/// one SIMD lane per point.
#[derive(Debug, Clone, Copy)]
pub struct CompactResponse<T, const N: usize> {
    /// Kirchhoff stress τ, [stress].
    pub tau: [T; N],
    /// Elastic strain after the return mapping, [-].
    pub elastic_strain: [T; N],
    /// λ, [stress].
    pub lambda: T,
    /// μ, [stress].
    pub mu: T,
    /// α, [stress].
    pub along: T,
    /// n, [-].
    pub n: [T; N],
}

/// A law formulated in logarithmic strain whose tangent has the form of [`CompactResponse`], evaluated for several
/// points at once.
pub trait VectorisedLaw {
    /// Plane form of [`Material::update`], in components `xx, yy, zz, √2 xy`; replaces `history` by its new values. For
    /// a trial strain that is not finite, the stress is not finite.
    fn respond(&self, trial: &[Lanes; 4], history: &mut [Lanes]) -> CompactResponse<Lanes, 4>;
}

/// Failure of a law.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// The trial strain is not finite.
    #[error("the trial elastic strain is not finite")]
    NotFinite,
    /// The law has no inverse from stress to elastic strain.
    #[error("the law cannot compute the elastic strain of a given stress")]
    NoInverse,
    /// No elastic strain of the law gives the stress.
    #[error("no elastic strain gives this stress")]
    NoStrain,
    /// The law has no response to the trial strain.
    #[error("the law has no response to the trial elastic strain")]
    NoResponse,
    /// The elastic stiffness is not positive definite: further strain would reduce the stress without flow.
    #[error(
        "the elasticity of the law is unstable in the state reached from the trial elastic strain: the shear modulus \
         depends too strongly on the pressure"
    )]
    Unstable,
    /// The response of the law is not finite.
    #[error("the response of the law to the trial elastic strain is not finite")]
    ResponseNotFinite,
    /// The law refuses the trial strain with an error number of its own.
    #[error("the law rejects the trial elastic strain (error number {0})")]
    Refused(i32),
    /// The law cannot be evaluated.
    #[error("the evaluation of the law has failed")]
    Failed,
}

/// An isotropic constitutive law: Kirchhoff stress as a function of elastic strain.
pub trait Material: Send + Sync + std::fmt::Debug {
    /// History variables with names, units and initial values; their order is the layout of `old` and `new` in
    /// [`Material::update`].
    fn state_fields(&self) -> &[StateField];

    /// Strain measure in which the law is formulated.
    fn strain_measure(&self) -> StrainMeasure {
        StrainMeasure::Logarithmic
    }

    /// Return mapping from the trial elastic strain. `old` contains the converged history variables; the trial history
    /// variables are written to `new`. The result depends only on the arguments.
    ///
    /// # Errors
    /// [`MaterialError`] if the strain is not finite or the return mapping fails.
    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError>;

    /// History variables of a point without initial stress.
    fn initial_history(&self) -> Vec<f64> {
        self.state_fields().iter().map(|field| field.initial).collect()
    }

    /// History variables of a point without initial stress at this original position, for laws whose properties vary in
    /// space.
    fn initial_history_at(&self, _position: &[f64; 3]) -> Vec<f64> {
        self.initial_history()
    }

    /// Adapts the initial history variables of a point to its initial elastic strain, in the measure of the law, and
    /// its volume ratio J.
    fn start_from(&self, _elastic_strain: &Sym3, _volume_ratio: f64, _history: &mut [f64]) {}

    /// Adapts the history variables of a point to a change of its elastic strain, given before and now in the measure of
    /// the law, at constant deformation: the parameters of the law have changed, and the stress stays the same.
    fn keep_deformation(&self, _strains: [&Sym3; 2], _history: &mut [f64]) {}

    /// Elastic strain, in the measure of the law, whose Kirchhoff stress is `tau`: the inverse of the elastic law.
    /// Yielding is disregarded: a stress outside the yield surface also has such a strain.
    ///
    /// # Errors
    /// [`MaterialError::NoInverse`] if the law has no inverse, [`MaterialError::NoStrain`] if no strain gives the
    /// stress.
    fn elastic_strain(&self, _tau: &Sym3, _history: &[f64]) -> Result<Sym3, MaterialError> {
        Err(MaterialError::NoInverse)
    }

    /// J times the excess pressure of pore water that cannot leave, which is part of the stress of the law, [stress]: the
    /// effective Kirchhoff stress is the stress of the law plus this number times I. Points store the effective stress,
    /// which [`Material::elastic_strain`] inverts.
    fn pore_stress(&self, _history: &[f64]) -> f64 {
        0.0
    }

    /// Excess pressure of pore water that cannot leave, [stress].
    fn excess_pore_pressure(&self, _history: &[f64]) -> f64 {
        0.0
    }

    /// The spatial moduli of the law if they are isotropic, which allows a cheaper evaluation in three dimensions.
    fn isotropic_moduli(&self) -> Option<&dyn IsotropicModuli> {
        None
    }

    /// The law in principal axes, if it is formulated in them, which allows a cheaper evaluation.
    fn principal(&self) -> Option<&dyn PrincipalLaw> {
        None
    }

    /// The vectorised form of the law, if it has one.
    fn vectorised(&self) -> Option<&dyn VectorisedLaw> {
        None
    }

    /// The batch form of the law, if the solver must evaluate the law only in batches. [`Material::update`] is then
    /// used for single points outside the iterations; [`respond_alone`] implements it.
    fn batch(&self) -> Option<&dyn BatchLaw> {
        None
    }

    /// The elasticity of the law at a point with these history variables, if its Kirchhoff stress is linear in the
    /// logarithmic elastic strain.
    fn linear_elasticity(&self, _history: &[f64]) -> Option<Elasticity> {
        None
    }

    /// Stored elastic energy per initial volume, [energy/volume].
    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64;

    /// Plastic work per initial volume, from the history variables, [energy/volume]. It includes the energy stored by
    /// hardening.
    fn plastic_work(&self, _history: &[f64]) -> f64 {
        0.0
    }

    /// True if a point with the history variables `history`, which had the values `initial` at the start, has yielded
    /// since. By default, any change of a history variable counts; a law some of whose variables also change without
    /// flow must tell the difference.
    fn has_yielded(&self, initial: &[f64], history: &[f64]) -> bool {
        initial != history
    }

    /// The law with its strength divided by a factor: cohesion, tensile strength and the tangent of the friction angle,
    /// or yield stress and hardening modulus; `None` if the law has no such strength.
    fn with_strength_divided(&self, _factor: f64) -> Option<Box<dyn Material>> {
        None
    }

    /// The law for a step of this duration, in the unit of time of the analysis, if its response depends on time; `None`
    /// if it does not. It has the history variables, the energy and the plastic work of the law itself. A law that is
    /// evaluated in batches must answer `None`.
    fn for_duration(&self, _duration: f64) -> Option<Box<dyn Material>> {
        None
    }

    /// True if Ã always has major symmetry. This requires the major symmetry of D^alg with respect to the logarithmic
    /// strain.
    fn tangent_is_symmetric(&self) -> bool {
        true
    }
}

/// The effective Kirchhoff stress where a law gives the stress `tau`, with these history variables, [stress].
pub fn effective(law: &dyn Material, tau: Sym3, history: &[f64]) -> Sym3 {
    match law.pore_stress(history) {
        0.0 => tau,
        water => tau + Sym3::IDENTITY * water,
    }
}

/// Isotropic linear elasticity between logarithmic strain and Kirchhoff stress, shared by several laws.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Elasticity {
    /// Bulk modulus K, [stress].
    pub bulk: f64,
    /// Shear modulus G, [stress].
    pub shear: f64,
}

impl Elasticity {
    /// Elasticity with Young's modulus, [stress], and Poisson's ratio, [-].
    pub fn from_young_poisson(young: f64, poisson: f64) -> Self {
        Elasticity { bulk: young / (3.0 * (1.0 - 2.0 * poisson)), shear: young / (2.0 * (1.0 + poisson)) }
    }

    /// First Lamé parameter K − 2G/3, [stress].
    #[inline(always)]
    pub fn lambda(&self) -> f64 {
        self.bulk - 2.0 / 3.0 * self.shear
    }

    /// Stress τ = K tr(ε) I + 2 G dev(ε), [stress].
    #[inline]
    pub fn stress(&self, strain: &Sym3) -> Sym3 {
        Sym3(self.stress_components(&strain.0))
    }

    /// Strain ε = tr(τ)/(9K) I + dev(τ)/(2G), the inverse of [`Elasticity::stress`], [-].
    ///
    /// # Errors
    /// [`MaterialError::NoStrain`] if the strain is not finite.
    pub fn strain(&self, stress: &Sym3) -> Result<Sym3, MaterialError> {
        let volumetric = stress.trace() / (9.0 * self.bulk);
        let strain = Sym3::IDENTITY * volumetric + stress.deviator() * (0.5 / self.shear);
        if strain.norm().is_finite() { Ok(strain) } else { Err(MaterialError::NoStrain) }
    }

    /// The same as [`Elasticity::stress`] for `N` components, normal components first; `T` is a number for one point,
    /// or a vector with one SIMD lane per point.
    #[inline(always)]
    pub fn stress_components<T: Lane, const N: usize>(&self, strain: &[T; N]) -> [T; N] {
        let pressure = (strain[0] + strain[1] + strain[2]) * self.lambda();
        let mut tau = strain.map(|x| x * (2.0 * self.shear));
        for normal in &mut tau[..3] {
            *normal += pressure;
        }
        tau
    }

    /// Elastic tangent D = (K − 2G/3) I ⊗ I + 2 G 𝟙, [stress].
    pub fn tangent(&self) -> Tangent {
        dyad(&Sym3::IDENTITY, &Sym3::IDENTITY) * self.lambda() + Tangent::identity() * (2.0 * self.shear)
    }

    /// Stored energy ½ ε : D : ε per initial volume, [energy/volume].
    pub fn energy(&self, strain: &Sym3) -> f64 {
        0.5 * self.stress(strain).dot(strain)
    }
}
