//! Constitutive laws between the elastic strain and the Kirchhoff stress.
//!
//! A law is written once and in three dimensions, in one of two strains ([`StrainMeasure`]). Laws of the logarithmic
//! strain have small-strain form: the multiplicative decomposition lets the return mapping of small strains serve
//! finite ones. Laws of b^e are evaluated without its eigenvalues. Laws know no grid, dimension or load step, and their
//! result depends on nothing but their arguments.

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
    /// Name as it appears in the results.
    pub name: &'static str,
    /// Unit, in words.
    pub unit: &'static str,
    /// Value at the start.
    pub initial: f64,
}

/// The elastic strain in which a law is written. All measures vanish with the strain and agree when it is small.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StrainMeasure {
    /// ε^e = ½ ln b^e.
    Logarithmic,
    /// ½ (b^e − I), for laws that are given in b^e.
    LeftCauchyGreen,
}

impl StrainMeasure {
    /// b^e of a strain, by its eigenvalues where they are needed.
    pub fn left_cauchy_green(self, strain: &Sym3) -> Sym3 {
        match self {
            StrainMeasure::Logarithmic => strain.map_eigenvalues(|e| (2.0 * e).exp()),
            StrainMeasure::LeftCauchyGreen => Sym3::IDENTITY + *strain * 2.0,
        }
    }

    /// ε^e = ½ ln b^e of a strain.
    pub fn logarithmic(self, strain: &Sym3) -> Sym3 {
        match self {
            StrainMeasure::Logarithmic => *strain,
            StrainMeasure::LeftCauchyGreen => self.left_cauchy_green(strain).map_eigenvalues(f64::ln) * 0.5,
        }
    }
}

/// What a law answers to a trial elastic strain, all strains in the measure of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Kirchhoff stress τ, [stress].
    pub tau: Sym3,
    /// Elastic strain after the return mapping, [-].
    pub elastic_strain: Sym3,
    /// Algorithmic tangent D^alg, the derivative of τ with respect to the trial strain, [stress].
    pub tangent: Tangent,
}

/// What a law with isotropic spatial moduli answers to a trial elastic strain.
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

/// An elastic law without history whose spatial moduli, between the rate of deformation and the Oldroyd rate of τ, are
/// isotropic in every state, λ̂ I⊗I + 2 μ̂ 𝟙 with λ̂ and μ̂ that depend on the state.
pub trait IsotropicModuli {
    /// Stress and moduli at the trial b^e; the same law as [`Material::update`].
    ///
    /// # Errors
    /// [`MaterialError`] when the strain is not finite.
    fn respond(&self, b: &Sym3) -> Result<IsotropicResponse, MaterialError>;
}

/// What a law of the logarithmic strain answers whose tangent is D^alg = λ I⊗I + 2μ 𝟙 − α n⊗n. Tensors are the first `N`
/// components of a layout like Mandel's, the normal ones before the shears; `T` may be several points side by side.
#[derive(Debug, Clone, Copy)]
pub struct ShortResponse<T, const N: usize> {
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

/// A law of the logarithmic strain with a tangent of the form of [`ShortResponse`], on several points side by side.
pub trait SideBySide {
    /// The same as [`Material::update`] in the plane, `xx, yy, zz, √2 xy`; `history` is replaced by its new values. What
    /// is not finite in the trial strain is not in the stress.
    fn respond(&self, trial: &[Lanes; 4], history: &mut [Lanes]) -> ShortResponse<Lanes, 4>;
}

/// A law could not be evaluated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// The trial strain is not a number.
    #[error("the trial elastic strain is not finite")]
    NotFinite,
}

/// An isotropic law between elastic strain and Kirchhoff stress.
pub trait Material: Send + Sync + std::fmt::Debug {
    /// Names, units and initial values of the history variables; the order is the layout of `old` and `new`.
    fn state_fields(&self) -> &'static [StateField];

    /// The strain in which the law is written.
    fn strain_measure(&self) -> StrainMeasure {
        StrainMeasure::Logarithmic
    }

    /// Return mapping from the trial elastic strain; `old` are the converged history variables, `new` receives the
    /// trial ones. Depends on nothing but its arguments.
    ///
    /// # Errors
    /// [`MaterialError`] when the strain is not finite or the return mapping fails.
    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError>;

    /// The law by its spatial moduli if these are isotropic, which makes it cheaper in three dimensions.
    fn isotropic_moduli(&self) -> Option<&dyn IsotropicModuli> {
        None
    }

    /// The law on several points side by side, if it can be written so.
    fn side_by_side(&self) -> Option<&dyn SideBySide> {
        None
    }

    /// Stored elastic energy per initial volume, [energy/volume].
    fn energy(&self, elastic_strain: &Sym3) -> f64;

    /// Work that has gone into plastic flow per initial volume, from the history variables, [energy/volume]. What
    /// hardening stores is part of it.
    fn plastic_work(&self, _history: &[f64]) -> f64 {
        0.0
    }

    /// Whether Ã always has major symmetry: whether D^alg has, taken with respect to the logarithmic strain.
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
    /// From Young's modulus, [stress], and Poisson's ratio, [-].
    pub fn from_young_poisson(young: f64, poisson: f64) -> Self {
        Elasticity { bulk: young / (3.0 * (1.0 - 2.0 * poisson)), shear: young / (2.0 * (1.0 + poisson)) }
    }

    /// K − 2G/3, [stress].
    #[inline(always)]
    pub fn lambda(&self) -> f64 {
        self.bulk - 2.0 / 3.0 * self.shear
    }

    /// τ = K tr(ε) I + 2 G dev(ε).
    #[inline]
    pub fn stress(&self, strain: &Sym3) -> Sym3 {
        Sym3(self.stress_components(&strain.0))
    }

    /// The same of as many components as there are, normal ones first; perhaps of several points side by side.
    #[inline(always)]
    pub fn stress_components<T: Lane, const N: usize>(&self, strain: &[T; N]) -> [T; N] {
        let pressure = (strain[0] + strain[1] + strain[2]) * self.lambda();
        let mut tau = strain.map(|x| x * (2.0 * self.shear));
        for normal in &mut tau[..3] {
            *normal += pressure;
        }
        tau
    }

    /// D = (K − 2G/3) I ⊗ I + 2 G 𝟙.
    pub fn tangent(&self) -> Tangent {
        dyad(&Sym3::IDENTITY, &Sym3::IDENTITY) * self.lambda() + Tangent::identity() * (2.0 * self.shear)
    }

    /// ½ ε : D : ε per initial volume.
    pub fn energy(&self, strain: &Sym3) -> f64 {
        0.5 * self.stress(strain).dot(strain)
    }
}

/// One check of everything the solver relies on, run over every law: a new law adds one line to the list.
#[cfg(test)]
mod conformance {
    use super::*;
    use crate::tensor::{Mat3, exp_derivative};
    use proptest::prelude::*;

    fn laws() -> Vec<Box<dyn Material>> {
        vec![
            Box::new(Hencky::new(12e6, 0.2)),
            Box::new(NeoHookean::new(12e6, 0.2)),
            Box::new(NeoHookean::new(1e3, -0.4)),
            Box::new(VonMises::new(1e6, 0.3, 20e3)),
            Box::new(VonMises::new(1e6, 0.3, 20e3).hardening(0.4e6)),
        ]
    }

    /// A strain in the measure of a law from a logarithmic one.
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
        let scale = response.tangent.norm();
        assert!((numeric - response.tangent).norm() < 1e-6 * scale, "{numeric}{}", response.tangent);
        if law.tangent_is_symmetric() {
            let (tangent, tolerance) = match law.strain_measure() {
                StrainMeasure::Logarithmic => (response.tangent, 1e-15),
                StrainMeasure::LeftCauchyGreen => {
                    (response.tangent * exp_derivative(&(logarithmic * 2.0)), 1e-14)
                }
            };
            assert!((tangent - tangent.transpose()).norm() < tolerance * tangent.norm());
        }
        if let Some(moduli) = law.isotropic_moduli() {
            let b = law.strain_measure().left_cauchy_green(&trial);
            let spatial = moduli.respond(&b).unwrap();
            assert!((spatial.tau - response.tau).norm() <= 1e-14 * scale);
            assert!((spatial.elastic_strain - response.elastic_strain).norm() <= 1e-15);
            // ḃ = l b + b lᵀ and the Oldroyd rate of τ, τ̇ − l τ − τ lᵀ, at any velocity gradient l.
            let l = Mat3::from_fn(|i, j| ((3 * i + 2 * j) as f64).sin());
            let sheared = |t: &Sym3| Sym3::symmetric_part(&(l * t.to_matrix())) * 2.0;
            let rate = (sheared(&b) * 0.5).contract(&response.tangent) - sheared(&response.tau);
            let d = Sym3::symmetric_part(&l);
            let by_moduli = Sym3::IDENTITY * (spatial.lambda * d.trace()) + d * (2.0 * spatial.mu);
            assert!((by_moduli - rate).norm() < 1e-13 * scale, "{by_moduli:?} {rate:?}");
        }
        if let Some(law) = law.side_by_side() {
            side_by_side(law, &response, &trial, &old, &new);
        }
        // The returned strain is admissible: applied anew it gives the same stress and no further flow.
        let settled = law.update(&response.elastic_strain, &new, &mut again).unwrap();
        assert!((settled.tau - response.tau).norm() <= 1e-12 * response.tau.norm());
        // The energy is the potential of the stress in the elastic range.
        let elastic = law.strain_measure().logarithmic(&response.elastic_strain) * 0.5;
        let energy = |by: f64| law.energy(&in_measure(law, &(elastic + logarithmic * by)));
        let slope = (energy(1e-6) - energy(-1e-6)) / 2e-6;
        let tau = law.update(&in_measure(law, &elastic), &new, &mut again).unwrap().tau;
        let work = tau.dot(&logarithmic);
        assert!((slope - work).abs() <= 1e-7 * scale * logarithmic.dot(&logarithmic), "{slope} {work}");
    }

    /// Side by side with other strains, what a law answers in the plane is what it answers alone.
    fn side_by_side(law: &dyn SideBySide, alone: &Response, trial: &Sym3, old: &[f64], new: &[f64]) {
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
        assert!((0..4).any(|c| short.tau[c].0[3].is_nan()), "no number must not become one");
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

    /// Uniaxial stress: Kirchhoff stress σ along x and plastic logarithmic strain κ there, by bisection in the transverse
    /// strain. Beyond yield σ rises by √(3/2) H per unit of κ.
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

    /// A large step gives what many small ones do, as the direction stays: the return mapping is exact for it.
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
