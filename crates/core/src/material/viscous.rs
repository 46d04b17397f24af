//! Viscous regularisation of a law that flows (Duvaut and Lions 1972): the stress relaxes towards the stress of the law
//! instead of meeting it.
//!
//! With the trial elastic strain ε_t and the elastic strain ε_∞ after the return mapping of the law, the elastic strain is
//! (1 − w) ε_∞ + w ε_t. The flow is (1 − w) times that of the law, the overstress w D : (ε_t − ε_∞) is proportional to the
//! increment of plastic strain, and so vanishes with the size of the steps. The tangent is (1 − w) D_∞ + w D, which is
//! not singular where the law has no stiffness.

use super::{Elasticity, Material, MaterialError, Response, StateField};
use crate::tensor::Sym3;

/// A law with viscous regularisation.
#[derive(Debug)]
pub struct Viscous {
    law: Box<dyn Material>,
    /// w, [-]; with 1, the law responds elastically.
    weight: f64,
}

impl Viscous {
    /// The regularisation of a law, with 0 < w ≤ 1; `None` if the law does not flow or is not linear in the logarithmic
    /// elastic strain.
    pub fn new(law: &dyn Material, weight: f64) -> Option<Viscous> {
        law.linear_elasticity(&law.initial_history())?;
        Some(Viscous { law: law.with_strength_divided(1.0)?, weight })
    }

    /// The elastic response of a law; `None` as for [`Viscous::new`].
    pub fn elastic(law: &dyn Material) -> Option<Viscous> {
        Viscous::new(law, 1.0)
    }
}

/// What a state with viscosity exceeds that of the law by.
#[derive(Debug, Clone, Copy)]
pub struct Excess {
    /// Excess of the elastic strain, [-].
    pub strain: Sym3,
    /// Overstress, [stress].
    pub stress: Sym3,
}

impl Viscous {
    /// The excess of a state with viscosity, from its elastic strain and its history variables; `None` if the law has no
    /// viscosity, or if the state is elastic. The return mapping of the law leads from any strain between ε_t and ε_∞ to
    /// ε_∞, but for the change of a strength that softens.
    pub fn excess(law: &dyn Material, elastic_strain: &Sym3, history: &[f64]) -> Option<Excess> {
        let elasticity = law.linear_elasticity(history)?;
        let mut returned = history.to_vec();
        let of_law = law.update(elastic_strain, history, &mut returned).ok()?;
        if returned == history {
            return None;
        }
        let strain = *elastic_strain - of_law.elastic_strain;
        Some(Excess { strain, stress: elasticity.stress(&strain) })
    }
}

impl Material for Viscous {
    fn state_fields(&self) -> &[StateField] {
        self.law.state_fields()
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        let elasticity = self.law.linear_elasticity(old).ok_or(MaterialError::NoResponse)?;
        let w = self.weight;
        if w == 1.0 {
            new.copy_from_slice(old);
            let tau = elasticity.stress(trial);
            return Ok(Response { tau, elastic_strain: *trial, tangent: elasticity.tangent() });
        }
        let of_law = self.law.update(trial, old, new)?;
        if old == new {
            return Ok(of_law);
        }
        for (new, old) in new.iter_mut().zip(old) {
            *new = old + (1.0 - w) * (*new - old);
        }
        let elastic_strain = of_law.elastic_strain * (1.0 - w) + *trial * w;
        Ok(Response {
            tau: of_law.tau * (1.0 - w) + elasticity.stress(trial) * w,
            elastic_strain,
            tangent: of_law.tangent * (1.0 - w) + elasticity.tangent() * w,
        })
    }

    fn linear_elasticity(&self, history: &[f64]) -> Option<Elasticity> {
        self.law.linear_elasticity(history)
    }

    fn elastic_strain(&self, tau: &Sym3, history: &[f64]) -> Result<Sym3, MaterialError> {
        self.law.elastic_strain(tau, history)
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        self.law.energy(elastic_strain, history)
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        self.law.plastic_work(history)
    }

    fn has_yielded(&self, initial: &[f64], history: &[f64]) -> bool {
        self.law.has_yielded(initial, history)
    }

    fn tangent_is_symmetric(&self) -> bool {
        self.law.tangent_is_symmetric()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Friction, MohrCoulomb, Softening, Tresca, VonMises};

    const WEIGHT: f64 = 0.1;

    fn laws() -> Vec<Box<dyn Material>> {
        let sand = Friction { cohesion: 1e3, friction_angle: 35.0, dilation_angle: 5.0 };
        vec![
            Box::new(MohrCoulomb::new(2e7, 0.3, sand)),
            Box::new(MohrCoulomb::new(2e7, 0.3, Friction { cohesion: 0.0, dilation_angle: 0.0, ..sand })),
            Box::new(Tresca::new(1e7, 0.45, 2e4)),
            Box::new(VonMises::new(1e7, 0.3, 2e4)),
        ]
    }

    /// Strains beyond the yield surface: shear under compression and without it, and extension beyond the apex.
    const BEYOND: [Sym3; 3] = [
        Sym3([-2e-2, 9e-3, -6e-3, 1.4e-2, -1e-3, 2e-3]),
        Sym3([-7e-3, 5e-3, 1e-3, 8e-3, -1e-3, 2e-3]),
        Sym3([8e-3, 3e-3, 5e-3, 6e-3, 0.0, 2e-3]),
    ];

    /// The response to a strain beyond the yield surface, and the history variables.
    fn evaluated(law: &dyn Material, trial: &Sym3) -> (Response, Vec<f64>) {
        let (response, new) = respond(law, trial);
        assert_ne!(new, law.initial_history(), "{law:?} does not yield at {trial:?}");
        (response, new)
    }

    fn respond(law: &dyn Material, trial: &Sym3) -> (Response, Vec<f64>) {
        let old = law.initial_history();
        let mut new = old.clone();
        (law.update(trial, &old, &mut new).unwrap(), new)
    }

    #[test]
    fn the_strain_lies_between_that_of_the_law_and_the_trial_strain() {
        for law in laws() {
            let viscous = Viscous::new(law.as_ref(), WEIGHT).unwrap();
            for trial in &BEYOND {
                let [(sharp, end), (smooth, history)] =
                    [law.as_ref(), &viscous].map(|law: &dyn Material| evaluated(law, trial));
                let between = sharp.elastic_strain * (1.0 - WEIGHT) + *trial * WEIGHT;
                assert!((smooth.elastic_strain - between).norm() < 1e-15);
                let elasticity = law.linear_elasticity(&history).unwrap();
                assert!((smooth.tau - elasticity.stress(&between)).norm() < 1e-9 * smooth.tau.norm());
                let start = law.initial_history();
                for ((history, end), start) in history.iter().zip(&end).zip(&start) {
                    assert!((history - start - (1.0 - WEIGHT) * (end - start)).abs() <= 1e-12 * end.abs());
                }
            }
            // An elastic strain is left as it is.
            let inside = Sym3([-1e-4, -1.1e-4, -1e-4, 1e-6, 0.0, 0.0]);
            assert_eq!(respond(law.as_ref(), &inside).1, law.initial_history(), "{law:?}");
            assert_eq!(respond(law.as_ref(), &inside).0, respond(&viscous, &inside).0);
        }
    }

    #[test]
    fn the_tangent_is_the_derivative_of_the_stress() {
        for law in laws() {
            let viscous = Viscous::new(law.as_ref(), WEIGHT).unwrap();
            for trial in &BEYOND {
                let tangent = evaluated(&viscous, trial).0.tangent;
                for k in 0..6 {
                    let mut step = [0.0; 6];
                    step[k] = 1e-8;
                    let [after, before] =
                        [1.0, -1.0].map(|sign| evaluated(&viscous, &(*trial + Sym3(step) * sign)).0.tau);
                    let difference = (after - before) * 0.5e8;
                    let predicted = Sym3((tangent * nalgebra::SVector::from(step) * 1e8).into());
                    assert!(
                        (difference - predicted).norm() < 1e-5 * 1e7,
                        "{law:?} {k}: {difference:?} {predicted:?}"
                    );
                }
            }
        }
    }

    /// The work on the plastic strain is that of the stress of the law, which the history records, and of the overstress.
    #[test]
    fn the_excess_and_its_dissipation_follow_from_the_state() {
        for law in &laws()[..3] {
            let viscous = Viscous::new(law.as_ref(), WEIGHT).unwrap();
            for trial in &BEYOND {
                let [(sharp, _), (smooth, history)] =
                    [law.as_ref(), &viscous].map(|law: &dyn Material| evaluated(law, trial));
                let excess = Viscous::excess(law.as_ref(), &smooth.elastic_strain, &history).unwrap();
                let expected = (*trial - sharp.elastic_strain) * WEIGHT;
                assert!((excess.strain - expected).norm() < 1e-9 * expected.norm(), "{law:?}");
                let flow = *trial - smooth.elastic_strain;
                let dissipated = excess.stress.dot(&excess.strain) * (1.0 - WEIGHT) / WEIGHT;
                let work = smooth.tau.dot(&flow);
                assert!((law.plastic_work(&history) + dissipated - work).abs() < 1e-9 * work, "{law:?}");
            }
            assert!(Viscous::excess(law.as_ref(), &Sym3::ZERO, &law.initial_history()).is_none());
        }
    }

    #[test]
    fn a_law_that_softens_is_regularised_too() {
        let sand = Friction { cohesion: 2e3, friction_angle: 35.0, dilation_angle: 5.0 };
        let residual = Friction { cohesion: 1e3, friction_angle: 30.0, dilation_angle: 0.0 };
        let law = MohrCoulomb::new(2e7, 0.3, sand).softening(residual, Softening::over(0.5));
        let viscous = Viscous::new(&law, WEIGHT).unwrap();
        let (smooth, history) = evaluated(&viscous, &BEYOND[0]);
        let excess = Viscous::excess(&law, &smooth.elastic_strain, &history).unwrap();
        let expected = (BEYOND[0] - evaluated(&law, &BEYOND[0]).0.elastic_strain) * WEIGHT;
        assert!((excess.strain - expected).norm() < 0.05 * expected.norm());
    }

    #[test]
    fn elastic_laws_have_no_viscosity() {
        assert!(Viscous::new(&crate::material::Hencky::new(1e6, 0.3), WEIGHT).is_none());
    }
}
