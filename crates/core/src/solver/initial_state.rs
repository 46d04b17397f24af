//! Equilibrium of bodies that are stressed and loaded at time 0.

use crate::assembly::Wanted;
use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::equilibrium::{InitialState, reactions_of};
use crate::model::InitialImbalance;
use crate::step::{Nodal, Step, StepContext, displacement};
use crate::terms::Ledger;
use crate::timing::Phase;

use super::collective::agree;
use super::error::SolveError;
use super::located::{locate_failure, with_energy, worst};
use super::observer::Observer;
use super::progress::Reached;
use super::residual::Forces;
use super::residual::round_off::EvaluatedAt;
use super::step_system::StepSystem;
use super::stepper::Stepper;
use super::unknowns::Unknowns;

impl<const D: usize, const N: usize> Stepper<'_, D, N> {
    /// Evaluates the initial state before the first step, if bodies are stressed at time 0.
    ///
    /// # Errors
    /// [`SolveError::InitialState`] if the state is out of balance and the model does not permit this, and the errors
    /// of a first step that cannot begin.
    pub(super) fn begin_stressed(&mut self, observer: &mut dyn Observer<D>) -> Result<(), SolveError> {
        let Some(treatment) = self.model.initial_imbalance else { return Ok(()) };
        if self.reached.progress.step.index > 0 || self.reached.summary.initial_state.is_some() {
            return Ok(());
        }
        let state = self.initial_state()?;
        observer.initial_state(&state);
        let tolerance = self.model.newton.tolerance;
        let InitialState { residual, is_balanced, ref worst, energy } = state;
        let refused = (treatment == InitialImbalance::Refuse && !is_balanced)
            .then(|| SolveError::InitialState { residual, tolerance, worst: worst.clone() });
        let summary = &mut self.reached.summary;
        summary.strain_energy = energy;
        summary.initial_state = Some(state);
        refused.map_or(Ok(()), Err)
    }

    /// Evaluates f_int, f_ext and the reactions of eq. (28) at time 0 and Δd = 0. Writes only the trial state.
    fn initial_state(&mut self) -> Result<InitialState, SolveError> {
        let step = Step { index: 1, start: 0.0, end: 0.0 };
        let (model, links) = (self.model, self.link(step)?);
        let points = &mut *self.points;
        let context =
            StepContext { model, links: &links, step, factor: 0.0, viscosity: 0.0, experiment: None };
        let Reached { progress, summary } = &mut self.reached;
        let mut system = StepSystem::new(&context, points, progress, &self.fields, &mut self.terms)?;
        let n_globals = system.sum.system().border.len();
        let mut unknowns = Unknowns::<N>::new(model, 0.0, &links, n_globals);
        let evaluate = || system.sum.evaluate(&context, points, unknowns.at(), Wanted::Stiffness);
        let evaluated = summary.timings.measure(Phase::Assembly, evaluate);
        let state = evaluated
            .map_err(|failure| locate_failure(failure, model, points, step, 0, &[]))
            .and_then(|()| {
                system.complete();
                let forces = system.sum.system();
                let f_ext = forces.external_force();
                unknowns.reaction = reactions_of(f_ext, forces.internal_force(), &system.dofs);
                let out_of_balance = without_contact(unknowns.balance(forces), &links, &system.dofs);
                let tolerance = model.newton.tolerance;
                let reaction = &unknowns.reaction;
                let at =
                    EvaluatedAt { model, points, links: &links, system: forces, delta_d: &unknowns.delta_d };
                let measured = Forces {
                    out_of_balance: &out_of_balance,
                    f_ext,
                    reaction,
                    holding: forces.holding_force(),
                    scale: forces.scale_force(),
                }
                .measure(&system.parts, tolerance, &at);
                let ledger = system.sum.ledger(&context, points, unknowns.at());
                let reduction = links.reduction();
                let stored = ledger.energy(Ledger::ELASTIC);
                let law_energy = stored + ledger.energy(Ledger::PLASTIC);
                agree(reduction, with_energy(law_energy, model, points, &points.trial, step))?;
                Ok(InitialState {
                    residual: measured.residual,
                    is_balanced: measured.residual <= tolerance,
                    worst: worst(model, &links, &displacement(&out_of_balance)),
                    energy: reduction.total(stored),
                })
            });
        let state = agree(links.reduction(), state);
        self.terms = system.sum.into_terms();
        self.links = links;
        state
    }
}

/// The forces out of balance without those that contact between bodies can transfer: of the copies of a node, only the
/// sum has to be in balance, and nothing along axes along which a copy is held.
fn without_contact<const D: usize, const N: usize>(
    mut force: Nodal<N>,
    links: &Connectivity<D>,
    dofs: &DofMap<N>,
) -> Nodal<N> {
    if links.n_body_groups() < 2 {
        return force;
    }
    for &node in links.active_nodes() {
        let copies = links.copies(node as usize);
        if copies.len() < 2 {
            continue;
        }
        for axis in 0..D {
            let is_held = copies.clone().any(|copy| dofs.is_held_along(copy, axis));
            let sum: f64 = copies.clone().map(|copy| force[copy][axis]).sum();
            copies.clone().for_each(|copy| force[copy][axis] = 0.0);
            force[copies.start][axis] = if is_held { 0.0 } else { sum };
        }
    }
    force
}
