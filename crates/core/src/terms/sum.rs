//! The sum of all terms in a load step.

use std::collections::BTreeMap;

use crate::assembly::{System, Wanted, with_ties};
use crate::dofs::DofMap;
use crate::model::Model;
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};
use crate::stress::Mechanics;

use super::absorbing::Absorbing;
use super::contact::Contact;
use super::external_force::ExternalForces;
use super::failure::{BeginError, EvaluateError, agree};
use super::ghost::Ghost;
use super::global_unknowns::GlobalMotion;
use super::inertia::Inertia;
use super::ledger::Ledger;
use super::material_points::MaterialPoints;
use super::multipliers::{Augmentation, Multipliers, Response};
use super::report::TermReport;
use super::saved::Saved;
use super::surface::Surfaces;
use super::term::{Coupled, Term};
use super::water::Water;

/// The terms of a model, in the order in which they are added up.
pub type Terms<const D: usize, const N: usize = D> = Vec<Box<dyn Term<D, N>>>;

/// The terms of a model: the terms that every analysis has, the surfaces and the tools.
pub fn model_terms<const D: usize, const N: usize, M: Mechanics<D>>(model: &Model<D>) -> Terms<D, N> {
    let mut terms: Terms<D, N> = vec![
        Box::new(MaterialPoints::<D, M>::default()),
        Box::new(Ghost::default()),
        Box::new(ExternalForces::default()),
    ];
    if model.has_inertia() {
        // It averages what the points alone have added.
        terms.insert(1, Box::new(Inertia::default()));
        terms.push(Box::new(Absorbing::default()));
    }
    if model.water.is_some() || model.has_pore_water() {
        terms.push(Box::new(Water::default()));
    }
    if !model.surfaces.is_empty() {
        terms.push(Box::new(Surfaces::new(model)));
    }
    if !model.tools.is_empty() || !model.contacts.is_empty() {
        terms.push(Box::new(Contact::new(model)));
    }
    terms
}

/// Restores the saved state of each term that has one.
///
/// # Errors
/// The name of a term that does not accept its state, and the reason.
pub fn restore<const D: usize, const N: usize>(
    terms: &mut Terms<D, N>,
    saved: &BTreeMap<String, Saved>,
) -> Result<(), (&'static str, String)> {
    for term in terms {
        if let Some(saved) = saved.get(term.name()) {
            term.restore(&saved.value()).map_err(|reason| (term.name(), reason))?;
        }
    }
    Ok(())
}

/// The states of the terms that have one, by the names of the terms.
pub fn save<const D: usize, const N: usize>(terms: &Terms<D, N>) -> BTreeMap<String, Saved> {
    terms.iter().filter_map(|term| Some((term.name().to_owned(), term.save()?))).collect()
}

/// The motions among the global unknowns of all terms, numbered as unknowns of their sum.
pub fn motions<const D: usize, const N: usize>(terms: &Terms<D, N>, model: &Model<D>) -> Vec<GlobalMotion> {
    let (mut first, mut all) = (0, Vec::new());
    for term in terms {
        let Some(unknowns) = term.global_unknowns() else { continue };
        let own = unknowns.motions(model).into_iter();
        all.extend(own.map(|motion| GlobalMotion { number: first + motion.number, ..motion }));
        first += unknowns.count();
    }
    all
}

/// Adapts the saved states of the terms of the model `before`, as of this time, to the model `now`.
///
/// # Errors
/// The reason why a run cannot go on with the model `now`; the states are then unchanged.
pub fn continue_from<const D: usize>(
    [before, now]: [&Model<D>; 2],
    states: &mut BTreeMap<String, Saved>,
    time: f64,
) -> Result<(), String> {
    Surfaces::continue_from([before, now], states, time)
}

/// The sum of all terms in one load step.
pub struct Sum<const D: usize, const N: usize = D> {
    terms: Terms<D, N>,
    system: System<N>,
}

impl<const D: usize, const N: usize> Sum<D, N> {
    /// Sets up the system of a step; the terms must already have begun this step.
    pub fn new(terms: Terms<D, N>, step: &StepContext<D>, dofs: &DofMap<N>) -> Self {
        let system = Sum::laid_out(&terms, step, dofs);
        Sum { terms, system }
    }

    fn laid_out(terms: &Terms<D, N>, step: &StepContext<D>, dofs: &DofMap<N>) -> System<N> {
        let symmetric = step.links.reduction().all(are_symmetric(terms, step.model));
        let each_coupled =
            |couple: &mut dyn FnMut(Coupled)| terms.iter().for_each(|term| term.couples(couple));
        let mut is_dense = vec![false; step.links.n_groups()];
        each_coupled(&mut |coupled| {
            if let Coupled::Group(group) = coupled {
                is_dense[group] = true;
            }
        });
        let lists = |couple: &mut dyn FnMut(&[u32])| {
            each_coupled(&mut |coupled| {
                if let Coupled::Nodes(nodes) = coupled {
                    couple(nodes);
                }
            });
        };
        let globals = terms.iter().map(|term| n_globals(term.as_ref())).sum();
        let couples = |couple: &mut dyn FnMut(&[u32])| with_ties(dofs, step.links, &lists, couple);
        System::new(step.links, symmetric, &|group| is_dense[group], &couples, globals)
    }

    /// Lays out the system anew if its stiffness ceased to be symmetric in the last evaluation, or if terms couple
    /// further nodes; returns true if it has done so.
    pub fn outgrows(&mut self, step: &StepContext<D>, dofs: &DofMap<N>) -> bool {
        let mut layouts = self.terms.iter_mut().filter_map(|term| term.layout());
        let outgrown = layouts.any(|layout| layout.outgrows());
        let outgrown = outgrown || self.system.is_symmetric() && !are_symmetric(&self.terms, step.model);
        let outgrown = step.links.reduction().any(outgrown);
        if outgrown {
            self.terms.iter_mut().filter_map(|term| term.layout()).for_each(|layout| layout.forget_layout());
            self.system = Sum::laid_out(&self.terms, step, dofs);
        }
        outgrown
    }

    /// Begins a step with the terms of its model; returns their sum, without constraints.
    ///
    /// # Errors
    /// [`BeginError`].
    pub fn from_model<M: Mechanics<D>>(
        step: &StepContext<D>,
        points: &Points<D>,
    ) -> Result<Self, BeginError> {
        Sum::begun(model_terms::<D, N, M>(step.model), step, points)
    }

    /// Begins a step with these terms; returns their sum, without constraints.
    ///
    /// # Errors
    /// [`BeginError`].
    pub fn begun(
        mut terms: Terms<D, N>,
        step: &StepContext<D>,
        points: &Points<D>,
    ) -> Result<Self, BeginError> {
        Sum::begin(&mut terms, step, points)?;
        Ok(Sum::new(terms, step, &DofMap::unconstrained(step.links.n_active())))
    }

    /// Tells all terms the constraints of the step.
    pub fn follow_constraints(terms: &mut Terms<D, N>, dofs: &DofMap<N>) {
        terms.iter_mut().for_each(|term| term.follow_constraints(dofs));
    }

    /// Begins a step with all terms.
    ///
    /// # Errors
    /// [`BeginError`].
    pub fn begin(
        terms: &mut Terms<D, N>,
        step: &StepContext<D>,
        points: &Points<D>,
    ) -> Result<(), BeginError> {
        terms.iter_mut().try_for_each(|term| term.begin(step, points))
    }

    /// Evaluates all terms, on the points of this rank.
    ///
    /// # Errors
    /// [`EvaluateError`] of the first term that cannot be evaluated; on all ranks if one rank has an error.
    pub fn evaluate(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
    ) -> Result<(), EvaluateError> {
        self.system.clear(wanted);
        let Sum { terms, system } = self;
        for term in terms {
            let (own, rest) = term_unknowns(term.as_ref(), at, system.border.first);
            let evaluated = term.evaluate(step, points, own, wanted, system);
            agree(step.links.reduction(), evaluated)?;
            system.border.first = rest;
        }
        Ok(())
    }

    /// Updates the multipliers of all terms, once Newton's iterations have converged.
    ///
    /// # Errors
    /// [`EvaluateError`] of the first term whose multipliers do not converge or whose state cannot be accepted, on this
    /// rank or another one.
    pub fn augment(
        &mut self,
        step: &StepContext<D>,
        points: &Points<D>,
        at: At<N>,
    ) -> Result<Augmentation, EvaluateError> {
        let (mut first, mut outcome) = (0, Augmentation::Satisfied);
        for term in &mut self.terms {
            let (own, next) = term_unknowns(term.as_ref(), at, first);
            first = next;
            let Some(multipliers) = term.multipliers() else { continue };
            let augmented = multipliers.augment(step, points, own);
            let reduction = step.links.reduction();
            if reduction.any(agree(reduction, augmented)? == Augmentation::Updated) {
                outcome = Augmentation::Updated;
            }
        }
        Ok(outcome)
    }

    /// Updates the multipliers of all terms along an increment; `update` is the number of previous updates along this
    /// increment. Returns what the update adds to the equations if any multiplier has changed.
    pub fn augment_along(&mut self, increment: At<N>, update: usize) -> Option<Response<N>> {
        let (n_nodes, n_globals) = (increment.delta_d.len(), increment.globals.len());
        let mut added = Response::new(n_nodes, n_globals);
        let mut outcome = Augmentation::Satisfied;
        for term in &mut self.terms {
            let (own, next) = term_unknowns(term.as_ref(), increment, added.first);
            let along =
                |multipliers: &mut dyn Multipliers<D, N>| multipliers.augment_along(own, update, &mut added);
            if term.multipliers().map(along) == Some(Augmentation::Updated) {
                outcome = Augmentation::Updated;
            }
            added.first = next;
        }
        let reduction = self.system.reduction();
        if !reduction.any(outcome == Augmentation::Updated) {
            return None;
        }
        if !reduction.is_alone() {
            reduction.complete(added.force_mut());
            reduction.sum(&mut added.globals);
        }
        Some(added)
    }

    /// Adds support to the last stiffness where terms leave bodies without resistance; returns true if it added any.
    pub fn support(&mut self) -> bool {
        let Sum { terms, system } = self;
        let mut supports = false;
        for multipliers in terms.iter_mut().filter_map(|term| term.multipliers()) {
            supports |= multipliers.support(system);
        }
        system.reduction().any(supports)
    }

    /// Lets the terms replace conditions that keep the iterations from converging; false if no term does.
    pub fn hold(&mut self, step: &StepContext<D>) -> bool {
        let mut holds = false;
        for multipliers in self.terms.iter_mut().filter_map(|term| term.multipliers()) {
            holds |= multipliers.hold(step);
        }
        step.links.reduction().any(holds)
    }

    /// Withdraws the updates of multipliers along the last increment.
    pub fn withdraw_augmentation(&mut self) {
        self.terms
            .iter_mut()
            .filter_map(|term| term.multipliers())
            .for_each(|multipliers| multipliers.withdraw());
    }

    /// The sum of all terms in the last evaluation.
    pub fn system(&self) -> &System<N> {
        &self.system
    }

    /// The sum of all terms in the last evaluation, for the solver.
    pub fn system_mut(&mut self) -> &mut System<N> {
        &mut self.system
    }

    /// The external force of the state from which the step starts, condensed like the forces at the end of the step,
    /// [force].
    pub fn external_force_at_start(&self, dofs: &DofMap<N>) -> Nodal<N> {
        let mut force = vec![[0.0; N]; self.system.internal_force().len()];
        self.terms.iter().for_each(|term| term.force_at_start(&mut force));
        self.system.reduction().complete(&mut force);
        dofs.condense(&mut force);
        force
    }

    /// Work and energy of all terms.
    pub fn ledger(&self, step: &StepContext<D>, points: &Points<D>, at: At<N>) -> Ledger {
        let (mut first, mut sum) = (0, Ledger::default());
        for term in &self.terms {
            let (at, next) = term_unknowns(term.as_ref(), at, first);
            first = next;
            term.ledger(step, points, at).iter().for_each(|energy| sum.add(energy.clone()));
        }
        sum
    }

    /// The largest number by which the step is too long for a term, see [`Term::excess`].
    pub fn excess(&self, step: &StepContext<D>, points: &Points<D>, at: At<N>) -> f64 {
        let (mut first, mut largest) = (0, 0.0f64);
        for term in &self.terms {
            let (at, next) = term_unknowns(term.as_ref(), at, first);
            first = next;
            largest = largest.max(term.excess(step, points, at));
        }
        largest
    }

    /// What the terms report of the step, at the last evaluation.
    pub fn report(&self, model: &Model<D>) -> TermReport<D> {
        let mut report = TermReport { loads: vec![[0.0; D]; model.loads.len()], ..TermReport::default() };
        self.terms.iter().for_each(|term| term.report(model, &mut report));
        report
    }

    /// The motions among the global unknowns of all terms.
    pub fn motions(&self, model: &Model<D>) -> Vec<GlobalMotion> {
        motions(&self.terms, model)
    }

    /// True if the sum derives from a potential, at least approximately.
    pub fn has_potential(&self, model: &Model<D>) -> bool {
        self.terms.iter().all(|term| term.character(model).has_potential)
    }

    /// True if a term has kinks, see [`Character::has_kinks`](super::Character::has_kinks).
    pub fn has_kinks(&self, model: &Model<D>) -> bool {
        self.terms.iter().any(|term| term.character(model).has_kinks)
    }

    /// Frees memory that only further evaluations would need.
    pub fn free_matrices(&mut self) {
        self.system.conclude();
        self.terms.iter_mut().filter_map(|term| term.layout()).for_each(|layout| layout.conclude());
    }

    /// The terms, for the next step.
    pub fn into_terms(self) -> Terms<D, N> {
        self.terms
    }
}

/// The unknowns at which a term is evaluated, and the index of the first global unknown of the next term; `first` is
/// the index of the first global unknown of this term.
fn term_unknowns<'a, const D: usize, const N: usize>(
    term: &dyn Term<D, N>,
    at: At<'a, N>,
    first: usize,
) -> (At<'a, N>, usize) {
    let next = first + n_globals(term);
    (At { globals: at.globals.get(first..next).unwrap_or_default(), ..at }, next)
}

/// Number of global unknowns of a term in the current step.
fn n_globals<const D: usize, const N: usize>(term: &dyn Term<D, N>) -> usize {
    term.global_unknowns().map_or(0, |unknowns| unknowns.count())
}

/// True if the stiffness of all terms is symmetric.
fn are_symmetric<const D: usize, const N: usize>(terms: &Terms<D, N>, model: &Model<D>) -> bool {
    terms.iter().all(|term| term.character(model).is_symmetric)
}
