//! The sum of all terms in a load step.

use crate::assembly::{System, Wanted};
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};
use crate::stress::Mechanics;

use super::external_force::ExternalForces;
use super::failure::{LoadNotFinite, PointFailure};
use super::ghost::Ghost;
use super::material_points::MaterialPoints;
use super::term::{Ledger, Term};

/// The terms of a model, in the order in which they are added up.
pub type Terms<const D: usize> = Vec<Box<dyn Term<D>>>;

/// The terms that every analysis has.
pub fn of_bodies<const D: usize, M: Mechanics<D>>() -> Terms<D> {
    vec![
        Box::new(MaterialPoints::<D, M>::default()),
        Box::new(Ghost::default()),
        Box::new(ExternalForces::default()),
    ]
}

/// The sum of all terms in one load step.
pub struct Sum<const D: usize> {
    terms: Terms<D>,
    system: System<D>,
}

impl<const D: usize> Sum<D> {
    /// Begins a step with these terms, and lays out the system.
    ///
    /// # Errors
    /// [`LoadNotFinite`], with the terms.
    pub fn new(
        mut terms: Terms<D>,
        step: &StepContext<D>,
        points: &Points<D>,
    ) -> Result<Self, (Box<LoadNotFinite>, Terms<D>)> {
        for k in 0..terms.len() {
            if let Err(error) = terms[k].begin(step, points) {
                return Err((error, terms));
            }
        }
        let symmetric = terms.iter().all(|term| term.is_symmetric(step));
        let system =
            System::new(step.links, symmetric, &|couple| terms.iter().for_each(|term| term.couples(couple)));
        Ok(Sum { terms, system })
    }

    /// The sum of the terms that every analysis has, for a model whose loads are finite.
    ///
    /// # Errors
    /// [`LoadNotFinite`].
    pub fn of_bodies<M: Mechanics<D>>(
        step: &StepContext<D>,
        points: &Points<D>,
    ) -> Result<Self, Box<LoadNotFinite>> {
        Sum::new(of_bodies::<D, M>(), step, points).map_err(|(error, _)| error)
    }

    /// Evaluates all terms.
    ///
    /// # Errors
    /// The first point that could not follow the increment.
    pub fn evaluate(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<D>,
        wanted: Wanted,
    ) -> Result<(), PointFailure> {
        self.system.clear(wanted);
        let Sum { terms, system } = self;
        terms.iter_mut().try_for_each(|term| term.evaluate(step, points, at, wanted, system))
    }

    /// What the terms have added in the last evaluation.
    pub fn system(&self) -> &System<D> {
        &self.system
    }

    /// The same, to solve with.
    pub fn system_mut(&mut self) -> &mut System<D> {
        &mut self.system
    }

    /// The external force of the state that the step starts from, [force].
    pub fn external_force_at_start(&self) -> Nodal<D> {
        let mut force = vec![[0.0; D]; self.system.internal_force().len()];
        self.terms.iter().for_each(|term| term.force_at_start(&mut force));
        force
    }

    /// Work and energy of all terms.
    pub fn ledger(&self, step: &StepContext<D>, points: &Points<D>, at: At<D>) -> Ledger {
        self.terms.iter().fold(Ledger::default(), |sum, term| {
            let own = term.ledger(step, points, at);
            Ledger {
                stored: sum.stored + own.stored,
                plastic: sum.plastic + own.plastic,
                lost: sum.lost + own.lost,
            }
        })
    }

    /// The resultants of the `n` loads of the model, [force].
    pub fn resultants(&self, n: usize) -> Vec<[f64; D]> {
        self.terms.iter().flat_map(|term| term.resultants()).take(n).copied().collect()
    }

    /// Number of faces between cells that are stabilised.
    pub fn stabilised_faces(&self) -> usize {
        self.terms.iter().map(|term| term.stabilised_faces()).sum()
    }

    /// Frees what only further evaluations would need.
    pub fn conclude(&mut self) {
        self.system.conclude();
        self.terms.iter_mut().for_each(|term| term.conclude());
    }

    /// The terms, for the next step.
    pub fn into_terms(self) -> Terms<D> {
        self.terms
    }
}
