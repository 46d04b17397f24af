//! Constitutive laws between the elastic logarithmic strain and the Kirchhoff stress.
//!
//! A law is written once, in small-strain form and in three dimensions: the multiplicative decomposition with
//! logarithmic strains lets the return mapping of small strains serve finite ones. Laws know no grid, dimension or
//! load step, and their result depends on nothing but their arguments.

mod hencky;
mod von_mises;

use crate::tensor::{Sym3, Tangent, dyad};

pub use hencky::Hencky;
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

/// What a law answers to a trial elastic strain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Kirchhoff stress τ, [stress].
    pub tau: Sym3,
    /// Elastic logarithmic strain after the return mapping, [-].
    pub elastic_strain: Sym3,
    /// Algorithmic tangent D^alg = ∂τ/∂ε^e_trial, [stress].
    pub tangent: Tangent,
}

/// A law could not be evaluated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum MaterialError {
    /// The trial strain is not a number.
    #[error("the trial elastic strain is not finite")]
    NotFinite,
}

/// An isotropic law between elastic logarithmic strain and Kirchhoff stress, in small-strain form.
pub trait Material: Send + Sync + std::fmt::Debug {
    /// Names, units and initial values of the history variables; the order is the layout of `old` and `new`.
    fn state_fields(&self) -> &'static [StateField];

    /// Return mapping from the trial elastic strain; `old` are the converged history variables, `new` receives the
    /// trial ones. Depends on nothing but its arguments.
    ///
    /// # Errors
    /// [`MaterialError`] when the strain is not finite or the return mapping fails.
    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError>;

    /// Stored elastic energy per initial volume, [energy/volume].
    fn energy(&self, elastic_strain: &Sym3) -> f64;

    /// Whether D^alg always has major symmetry.
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

    /// τ = K tr(ε) I + 2 G dev(ε).
    #[inline]
    pub fn stress(&self, strain: &Sym3) -> Sym3 {
        let lame = self.bulk - 2.0 / 3.0 * self.shear;
        Sym3::IDENTITY * (lame * strain.trace()) + *strain * (2.0 * self.shear)
    }

    /// D = (K − 2G/3) I ⊗ I + 2 G 𝟙.
    pub fn tangent(&self) -> Tangent {
        let lame = self.bulk - 2.0 / 3.0 * self.shear;
        dyad(&Sym3::IDENTITY, &Sym3::IDENTITY) * lame + Tangent::identity() * (2.0 * self.shear)
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
    use proptest::prelude::*;

    fn laws() -> Vec<Box<dyn Material>> {
        vec![Box::new(Hencky::new(12e6, 0.2)), Box::new(VonMises::new(1e6, 0.3, 20e3))]
    }

    fn check(law: &dyn Material, trial: Sym3) {
        let old: Vec<f64> = law.state_fields().iter().map(|f| f.initial).collect();
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
            assert!((response.tangent - response.tangent.transpose()).norm() < 1e-15 * scale);
        }
        // The returned strain is admissible: applied anew it gives the same stress and no further flow.
        let settled = law.update(&response.elastic_strain, &new, &mut again).unwrap();
        assert!((settled.tau - response.tau).norm() <= 1e-12 * response.tau.norm());
        // The energy is the potential of the stress in the elastic range.
        let e = response.elastic_strain * 0.5;
        let slope = (law.energy(&(e + trial * 1e-6)) - law.energy(&(e - trial * 1e-6))) / 2e-6;
        assert!((slope - tau(&e).dot(&trial)).abs() <= 1e-7 * scale * trial.dot(&trial));
    }

    proptest! {
        #[test]
        fn every_law_conforms(e in prop::array::uniform6(-0.3..0.3f64)) {
            for law in laws() {
                check(law.as_ref(), Sym3(e));
                check(law.as_ref(), Sym3(e) * 1e-2);
            }
        }
    }
}
