//! Constitutive laws: Kirchhoff stress as a function of elastic strain.
//!
//! A law is implemented once, in three dimensions, in one of two strain measures ([`StrainMeasure`]). Laws in the
//! logarithmic strain have the form of small-strain laws: with the multiplicative decomposition, the return mapping of
//! small-strain plasticity applies at finite strain. Laws in b^e avoid its eigenvalues. A law knows neither the grid
//! nor the dimension nor the load step, and its result depends only on its arguments.

mod at_rest;
mod hencky;
mod neo_hookean;
mod von_mises;

use crate::tensor::{Lane, Lanes, Sym3, Tangent, dyad};

pub use at_rest::{axial_modulus_at_rest, shear_modulus_at_rest};
pub use hencky::Hencky;
pub use neo_hookean::NeoHookean;
pub use von_mises::VonMises;

/// A history variable of a law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateField {
    /// Name in result files.
    pub name: &'static str,
    /// Unit as text.
    pub unit: &'static str,
    /// Initial value.
    pub initial: f64,
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

/// Response of a law in the logarithmic strain whose tangent is D^alg = λ I⊗I + 2μ 𝟙 − α n⊗n. Tensors are the first `N`
/// components of a Mandel-like layout, normal components before shears. `T` is one number or one SIMD lane per point.
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

/// A law in the logarithmic strain with a tangent of the form of [`CompactResponse`], evaluated for several points at
/// once.
pub trait VectorisedLaw {
    /// Plane form of [`Material::update`], in components `xx, yy, zz, √2 xy`; replaces `history` by its new values. A
    /// trial strain that is not finite gives a stress that is not finite.
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
}

/// An isotropic constitutive law: Kirchhoff stress as a function of elastic strain.
pub trait Material: Send + Sync + std::fmt::Debug {
    /// History variables with names, units and initial values; their order is the layout of `old` and `new` in
    /// [`Material::update`].
    fn state_fields(&self) -> &'static [StateField];

    /// Strain measure in which the law is formulated.
    fn strain_measure(&self) -> StrainMeasure {
        StrainMeasure::Logarithmic
    }

    /// Return mapping from the trial elastic strain. `old` holds the converged history variables; the trial ones are
    /// written to `new`. The result depends only on the arguments.
    ///
    /// # Errors
    /// [`MaterialError`] if the strain is not finite or the return mapping fails.
    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError>;

    /// Elastic strain, in the measure of the law, whose Kirchhoff stress is `tau`: the inverse of the elastic law. Yield
    /// plays no part; a stress outside the yield surface has a strain, too.
    ///
    /// # Errors
    /// [`MaterialError::NoInverse`] if the law has no inverse, [`MaterialError::NoStrain`] if no strain gives the stress.
    fn elastic_strain(&self, _tau: &Sym3) -> Result<Sym3, MaterialError> {
        Err(MaterialError::NoInverse)
    }

    /// The spatial moduli of the law if they are isotropic, which allows a cheaper evaluation in three dimensions.
    fn isotropic_moduli(&self) -> Option<&dyn IsotropicModuli> {
        None
    }

    /// The vectorised form of the law, if it has one.
    fn vectorised(&self) -> Option<&dyn VectorisedLaw> {
        None
    }

    /// Stored elastic energy per initial volume, [energy/volume].
    fn energy(&self, elastic_strain: &Sym3) -> f64;

    /// Plastic work per initial volume, from the history variables, [energy/volume]. It includes the energy stored by
    /// hardening.
    fn plastic_work(&self, _history: &[f64]) -> f64 {
        0.0
    }

    /// True if Ã always has major symmetry, which requires that D^alg, with respect to the logarithmic strain, has it.
    fn tangent_is_symmetric(&self) -> bool {
        true
    }
}

/// Isotropic linear elasticity between logarithmic strain and Kirchhoff stress, shared by the laws of this module.
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
    /// [`MaterialError::NoStrain`] if it is not finite.
    pub fn strain(&self, stress: &Sym3) -> Result<Sym3, MaterialError> {
        let volumetric = stress.trace() / (9.0 * self.bulk);
        let strain = Sym3::IDENTITY * volumetric + stress.deviator() * (0.5 / self.shear);
        if strain.norm().is_finite() { Ok(strain) } else { Err(MaterialError::NoStrain) }
    }

    /// As [`Elasticity::stress`] for the first `N` components, normal ones first; `T` is one number or one SIMD lane
    /// per point.
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

/// Conformance test of all properties that the solver relies on. A new law adds one line to the list.
#[cfg(test)]
pub(crate) mod conformance {
    use super::*;
    use crate::tensor::{Mat3, exp_derivative};
    use proptest::prelude::*;

    /// The laws that this test and the test of the weak forms cover.
    pub(crate) fn laws() -> Vec<Box<dyn Material>> {
        vec![
            Box::new(Hencky::new(12e6, 0.2)),
            Box::new(NeoHookean::new(12e6, 0.2)),
            Box::new(NeoHookean::new(1e3, -0.4)),
            Box::new(VonMises::new(1e6, 0.3, 20e3)),
            Box::new(VonMises::new(1e6, 0.3, 20e3).hardening(0.4e6)),
        ]
    }

    /// Converts a logarithmic strain to the measure of a law.
    fn in_measure(law: &dyn Material, logarithmic: &Sym3) -> Sym3 {
        match law.strain_measure() {
            StrainMeasure::Logarithmic => *logarithmic,
            StrainMeasure::LeftCauchyGreen => {
                (logarithmic.map_eigenvalues(|e| (2.0 * e).exp()) - Sym3::IDENTITY) * 0.5
            }
        }
    }

    fn check(law: &dyn Material, logarithmic: Sym3) {
        let old: Vec<f64> = law.state_fields().iter().map(|f| f.initial).collect();
        let trial = in_measure(law, &logarithmic);
        let back = law.strain_measure().logarithmic(&trial);
        assert!((back - logarithmic).norm() < 1e-15 + 1e-14 * logarithmic.norm());

        let mut new = old.clone();
        let response = law.update(&trial, &old, &mut new).unwrap();
        let mut again = old.clone();
        assert_eq!(response, law.update(&trial, &old, &mut again).unwrap(), "not a pure function");
        assert_eq!(new, again);

        let tau = |strain: &Sym3| law.update(strain, &old, &mut old.clone()).unwrap().tau;
        let h = 1e-7;
        let numeric = Tangent::from_fn(|r, c| {
            let (mut p, mut m) = (trial, trial);
            p.0[c] += h;
            m.0[c] -= h;
            (tau(&p).0[r] - tau(&m).0[r]) / (2.0 * h)
        });
        // A law may have no stiffness in some states, such as at the apex of a cone.
        let at_rest = law.update(&Sym3::ZERO, &old, &mut old.clone()).unwrap().tangent.norm();
        let scale = Some(response.tangent.norm()).filter(|norm| *norm > 0.0).unwrap_or(at_rest);
        assert!((numeric - response.tangent).norm() < 1e-6 * scale, "{numeric}{}", response.tangent);
        if law.tangent_is_symmetric() {
            let (tangent, tolerance) = match law.strain_measure() {
                StrainMeasure::Logarithmic => (response.tangent, 1e-15),
                StrainMeasure::LeftCauchyGreen => {
                    (response.tangent * exp_derivative(&(logarithmic * 2.0)), 1e-14)
                }
            };
            assert!((tangent - tangent.transpose()).norm() <= tolerance * tangent.norm());
        }
        if let Some(moduli) = law.isotropic_moduli() {
            let b = law.strain_measure().left_cauchy_green(&trial);
            let spatial = moduli.respond(&b).unwrap();
            assert!((spatial.tau - response.tau).norm() <= 1e-14 * scale);
            assert!((spatial.elastic_strain - response.elastic_strain).norm() <= 1e-15);
            // Rates at a velocity gradient l: ḃ = l b + b lᵀ, and the Oldroyd rate τ̇ − l τ − τ lᵀ of τ.
            let l = Mat3::from_fn(|i, j| ((3 * i + 2 * j) as f64).sin());
            let sheared = |t: &Sym3| Sym3::symmetric_part(&(l * t.to_matrix())) * 2.0;
            let rate = (sheared(&b) * 0.5).contract(&response.tangent) - sheared(&response.tau);
            let d = Sym3::symmetric_part(&l);
            let by_moduli = Sym3::IDENTITY * (spatial.lambda * d.trace()) + d * (2.0 * spatial.mu);
            assert!((by_moduli - rate).norm() < 1e-13 * scale, "{by_moduli:?} {rate:?}");
        }
        if let Some(law) = law.vectorised() {
            check_vectorised(law, &response, &trial, &old, &new);
        }
        // The returned strain is admissible: a second update gives the same stress and no further flow.
        let settled = law.update(&response.elastic_strain, &new, &mut again).unwrap();
        assert!((settled.tau - response.tau).norm() <= 1e-12 * response.tau.norm());
        // The inverse of the elastic law; far from zero strain, another strain may have the same stress.
        let inverse = law.elastic_strain(&response.tau);
        if logarithmic.norm() < 0.02 {
            let error = (inverse.unwrap() - response.elastic_strain).norm();
            assert!(error <= 1e-14 * response.elastic_strain.norm() + 1e-17, "{error:e}");
        } else if let Ok(strain) = inverse {
            let again = law.update(&strain, &new, &mut again).unwrap().tau;
            assert!((again - response.tau).norm() <= 1e-13 * at_rest, "{again:?} {:?}", response.tau);
        }
        // In the elastic range, the energy is the potential of the stress.
        let elastic = law.strain_measure().logarithmic(&response.elastic_strain) * 0.5;
        let energy = |by: f64| law.energy(&in_measure(law, &(elastic + logarithmic * by)));
        let slope = (energy(1e-6) - energy(-1e-6)) / 2e-6;
        let tau = law.update(&in_measure(law, &elastic), &new, &mut again).unwrap().tau;
        let work = tau.dot(&logarithmic);
        assert!((slope - work).abs() <= 1e-7 * scale * logarithmic.dot(&logarithmic), "{slope} {work}");
    }

    /// The vectorised form, evaluated with other strains in the other lanes, agrees with the response in the plane.
    fn check_vectorised(law: &dyn VectorisedLaw, alone: &Response, trial: &Sym3, old: &[f64], new: &[f64]) {
        if !trial.is_plane() {
            return;
        }
        let trial = [0, 1, 2, 5].map(|c| Lanes([0.0, 1e-3, trial.0[c], f64::NAN]));
        let mut history: Vec<Lanes> = old.iter().map(|h| Lanes::splat(*h)).collect();
        let short = law.respond(&trial, &mut history);
        for (a, c) in [0, 1, 2, 5].into_iter().enumerate() {
            assert_eq!(short.tau[a].0[2].to_bits(), alone.tau.0[c].to_bits());
            assert_eq!(short.elastic_strain[a].0[2].to_bits(), alone.elastic_strain.0[c].to_bits());
            for (b, d) in [0, 1, 2, 5].into_iter().enumerate() {
                let [lambda, mu, along] = [short.lambda, short.mu, short.along].map(|x| x.0[2]);
                let normal = if a < 3 && b < 3 { lambda } else { 0.0 };
                let diagonal = if a == b { 2.0 * mu } else { 0.0 };
                let entry = normal + diagonal - along * short.n[a].0[2] * short.n[b].0[2];
                assert!((entry - alone.tangent[(c, d)]).abs() <= 1e-15 * alone.tangent.norm());
            }
        }
        assert!((0..4).any(|c| short.tau[c].0[3].is_nan()), "NaN must propagate");
        assert!(history.iter().map(|h| h.0[2]).eq(new.iter().copied()));
    }

    proptest! {
        #[test]
        fn every_law_conforms(e in prop::array::uniform6(-0.3..0.3f64)) {
            for law in laws() {
                check(law.as_ref(), Sym3(e));
                check(law.as_ref(), Sym3([e[0], e[1], e[2], 0.0, 0.0, e[5]]));
                check(law.as_ref(), Sym3(e) * 1e-2);
            }
        }
    }

    #[test]
    fn small_strains_have_the_stiffness_of_linear_elasticity() {
        let linear = Elasticity::from_young_poisson(12e6, 0.2);
        for law in laws().iter().take(2) {
            let at_rest = law.update(&Sym3::ZERO, &[], &mut []).unwrap();
            assert_eq!(at_rest.tau, Sym3::ZERO);
            assert!((at_rest.tangent - linear.tangent()).norm() < 1e-15 * linear.tangent().norm());
        }
    }

    #[test]
    fn a_strain_that_is_no_number_is_an_error() {
        for law in laws() {
            let old: Vec<f64> = law.state_fields().iter().map(|f| f.initial).collect();
            let bad = Sym3([f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0]);
            assert_eq!(law.update(&bad, &old, &mut old.clone()), Err(MaterialError::NotFinite));
        }
        let inside_out = Sym3([-0.6, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let law = NeoHookean::new(1.0, 0.3);
        assert_eq!(law.update(&inside_out, &[], &mut []), Err(MaterialError::NotFinite));
    }

    /// Uniaxial stress: Kirchhoff stress σ and plastic logarithmic strain κ along x, by bisection in the transverse
    /// strain. Beyond yield, σ grows by √(3/2) H per unit of κ.
    #[test]
    fn hardening_is_linear_in_uniaxial_tension() {
        let (young, poisson, radius, modulus) = (1e6, 0.3, 20e3, 0.4e6);
        let law = VonMises::new(young, poisson, radius).hardening(modulus);
        for axial in [0.03, 0.05, 0.2, 0.5] {
            let at = |across: f64| {
                let mut kappa = [0.0];
                let trial = Sym3([axial, across, across, 0.0, 0.0, 0.0]);
                let response = law.update(&trial, &[0.0], &mut kappa).unwrap();
                (response.tau, kappa[0])
            };
            let (mut low, mut high) = (-axial, 0.0);
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                *if at(middle).0.0[1] > 0.0 { &mut high } else { &mut low } = middle;
            }
            let (tau, kappa) = at(low);
            let expected = 1.5f64.sqrt() * (radius + modulus * kappa);
            assert!(kappa > 0.0 && (tau.0[0] / expected - 1.0).abs() < 1e-10, "{tau:?} {kappa}");
            assert!(
                (axial - kappa - tau.0[0] / young).abs() < 1e-10,
                "elastic and plastic strain make up the whole"
            );
        }
    }

    /// One large step equals many small ones if the flow direction is constant: the return mapping is then exact.
    #[test]
    fn proportional_flow_does_not_depend_on_the_steps() {
        let law = VonMises::new(1e6, 0.3, 20e3).hardening(0.4e6);
        let direction = Sym3([0.1, -0.03, -0.07, 0.02, 0.01, -0.04]);
        let mut whole = [0.0];
        let one = law.update(&direction, &[0.0], &mut whole).unwrap();
        let (mut elastic, mut old) = (Sym3::ZERO, [0.0]);
        for _ in 0..10 {
            let mut new = [0.0];
            elastic = law.update(&(elastic + direction * 0.1), &old, &mut new).unwrap().elastic_strain;
            old = new;
        }
        assert!((old[0] - whole[0]).abs() < 1e-14 && (elastic - one.elastic_strain).norm() < 1e-15);
    }
}
