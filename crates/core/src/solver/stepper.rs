//! Stepping: the choice of each load step, the response to a failed one, and the commit of a converged one.

use std::collections::BTreeSet;

use cpu_time::ProcessTime;

use crate::basis::Connectivity;
use crate::dofs::Fields;
use crate::equilibrium::StepReport;
use crate::linear::{Backend, Backends};
use crate::model::{GridMotionError, Model};
use crate::points::Points;
use crate::step::Step;
use crate::stress::Mechanics;
use crate::terms::{Terms, model_terms, restore};
use crate::timing::Phase;

use super::Solvable;
use super::attempt::{Effort, FailedAttempt, InProgress, Outcome, Slump};
use super::collective::agree;
use super::damping;
use super::diagnosis::Diagnosis;
use super::equations::Equations;
use super::error::SolveError;
use super::observer::Observer;
use super::progress::{Progress, Reached};
use super::release::{BalancingForces, balancing_forces};
use super::summary::Summary;

/// An analysis, load step by load step.
///
/// ```
/// # use mpm_core::{model::Model, points::Points, solver::{Silent, SolveError, Stepper}};
/// # fn example(model: &Model<2>, points: &mut Points<2>) -> Result<(), SolveError> {
/// let mut stepper = Stepper::new(model, points);
/// while let Some(report) = stepper.step(&mut Silent)? {
///     println!("step {}: reactions {:?}", report.step.index, report.reactions);
/// }
/// # Ok(())
/// # }
/// ```
///
/// There are `D` axes, and `N` components at each node: the components of the displacement and of further fields.
pub struct Stepper<'a, const D: usize, const N: usize = D> {
    pub(super) model: &'a Model<D>,
    pub(super) points: &'a mut Points<D>,
    pub(super) kernels: Kernels<D, N>,
    pub(super) fields: Fields,
    pub(super) equations: Equations<D, N>,
    /// Links of the previous step, whose memory is reused.
    pub(super) links: Connectivity<D>,
    /// Report of the last converged step; `None` while a step is attempted.
    pub(super) report: Option<StepReport<D>>,
    /// The cause of the failure of the current step, kept while last resorts are tried.
    pub(super) cause: Option<(FailedAttempt<D>, Diagnosis)>,
    /// The error of the last attempt at the current step that failed although it met the tolerance.
    pub(super) lost_points: Option<SolveError>,
    /// The terms of equilibrium.
    pub(super) terms: Terms<D, N>,
    pub(super) reached: Reached,
}

/// The code of an analysis, compiled for `N` components at each node; its terms are compiled for the mechanics of the
/// idealisation.
///
/// Because a step is solved through a function of this struct, the solution of a step for `N = D` is compiled in this
/// crate, with full optimisation. Kernels with further fields are compiled in the crate that asks for them.
#[derive(Clone, Copy)]
pub struct Kernels<const D: usize, const N: usize = D> {
    terms: fn(&Model<D>) -> Terms<D, N>,
    /// Solves the next step; false if none is left.
    pub(super) step: StepFunction<D, N>,
    /// Computes the forces that a stage releases.
    pub(super) balance: BalancingForces<D, N>,
    /// True for bodies of revolution.
    revolved: bool,
}

type StepFunction<const D: usize, const N: usize> =
    fn(&mut Stepper<'_, D, N>, &mut dyn Observer<D>) -> Result<bool, SolveError>;

impl<const D: usize, const N: usize> Kernels<D, N> {
    /// The kernels for a kind of mechanics.
    pub fn new<M: Mechanics<D>>() -> Self {
        Kernels {
            terms: model_terms::<D, N, M>,
            step: |stepper, observer| stepper.solve_step(observer),
            balance: balancing_forces::<D, N, M>,
            revolved: M::REVOLVED,
        }
    }
}

impl<'a, const D: usize> Stepper<'a, D> {
    /// An analysis that begins with the converged state of `points`.
    pub fn new(model: &'a Model<D>, points: &'a mut Points<D>) -> Self
    where
        Model<D>: Solvable<D>,
    {
        let backends = model.engines.0.as_ref().map(|engine| engine.backends()).unwrap_or_default();
        Stepper::assembled(model, points, model.kernels(), Fields::displacement(D), backends)
    }
}

impl<'a, const D: usize, const N: usize> Stepper<'a, D, N> {
    /// An analysis with further fields at the nodes, for terms that are added later. The fields must have `N`
    /// components in total and different names, and the displacement must come first.
    ///
    /// # Errors
    /// [`SolveError::Term`] if the displacement does not have `D` components, if all fields together do not have `N`,
    /// if two have the same name, if the kernels belong to another idealisation, if the library that solves the
    /// equations of several ranks cannot solve for `N` components, or if iterations may be damped although fields are
    /// multipliers: damping looks for a minimum, not for a saddle point.
    pub fn with_fields(
        model: &'a Model<D>,
        points: &'a mut Points<D>,
        kernels: Kernels<D, N>,
        fields: Fields,
    ) -> Result<Self, SolveError> {
        let first = fields.iter().next().map(|(field, _)| field.components);
        if first != Some(D) || fields.n_components() != N {
            return Err(refused(
                "fields",
                "the fields must have one component for each unknown at a node, and the displacement must come first",
            ));
        }
        if kernels.revolved != model.revolved {
            return Err(refused("kernels", "the kernels belong to another idealisation than the model"));
        }
        let mut names = BTreeSet::new();
        if let Some((field, _)) = fields.iter().find(|(field, _)| !names.insert(&field.name)) {
            return Err(refused(&field.name, "another field has the same name"));
        }
        if fields.have_multipliers() && model.stepping.damping {
            return Err(refused(
                "fields",
                "the equations of multipliers cannot be solved by damped iterations",
            ));
        }
        let Some(backends) = model.engines.backends() else {
            let reason = format!("the solvers of this run cannot solve for {N} unknowns at each node");
            return Err(refused("fields", &reason));
        };
        Ok(Stepper::assembled(model, points, kernels, fields, backends))
    }

    fn assembled(
        model: &'a Model<D>,
        points: &'a mut Points<D>,
        kernels: Kernels<D, N>,
        fields: Fields,
        backends: Backends<D, N>,
    ) -> Self {
        let has_multipliers = fields.have_multipliers();
        if model.takes_means() {
            points.prepare_deviations();
        }
        if model.has_inertia() {
            points.prepare_motion();
        }
        let reached = Reached::nothing(points);
        Stepper {
            model,
            points,
            terms: (kernels.terms)(model),
            kernels,
            fields,
            equations: Equations::new(None).with_engine(backends).with_multipliers(has_multipliers),
            links: Connectivity::default(),
            report: None,
            cause: None,
            lost_points: None,
            reached,
        }
    }

    /// Adds terms of equilibrium to the terms of the model.
    ///
    /// # Errors
    /// [`SolveError::Term`] if two terms have the same name.
    pub fn with_terms(mut self, further: Terms<D, N>) -> Result<Self, SolveError> {
        self.terms.extend(further);
        let mut names = BTreeSet::new();
        match self.terms.iter().find(|term| !names.insert(term.name())) {
            Some(term) => Err(refused(term.name(), "another term has the same name")),
            None => Ok(self),
        }
    }

    /// Solves linear equations with this backend in place of the built-in ones.
    pub fn with_backend(mut self, backend: Box<dyn Backend<D, N>>) -> Self {
        self.equations = Equations::new(Some(backend));
        self
    }

    /// Resumes from a step that a run has reached; the points must be in the state at the end of that step, and all
    /// terms must have been added.
    ///
    /// # Errors
    /// [`SolveError::Term`] if a term cannot resume from its saved state, or if a saved state belongs to no term.
    pub fn resume(mut self, reached: Reached) -> Result<Self, SolveError> {
        let is_known = |name: &String| self.terms.iter().any(|term| term.name() == name.as_str());
        if let Some(name) = reached.progress.terms.keys().find(|name| !is_known(name)) {
            return Err(refused(name, "it has a saved state, but has not been added to the analysis"));
        }
        restore(&mut self.terms, &reached.progress.terms).map_err(|(term, reason)| refused(term, &reason))?;
        self.reached = reached;
        Ok(self)
    }

    /// Solves the step that follows the last one in equilibrium and commits it; if the step has no equilibrium, smaller
    /// ones are tried as far as the model allows. `None` at the end of the analysis or of the current stage. A moving
    /// grid must have been placed by [`Model::place_grid`].
    ///
    /// # Errors
    /// [`SolveError`] if there is no equilibrium; the converged state of the points is then the last state in
    /// equilibrium.
    pub fn step(&mut self, observer: &mut dyn Observer<D>) -> Result<Option<&StepReport<D>>, SolveError> {
        let is_solved = (self.kernels.step)(self, observer)?;
        Ok(self.report.as_ref().filter(|_| is_solved))
    }

    /// Solves the next step as [`Stepper::step`] does; false if none is left.
    fn solve_step(&mut self, observer: &mut dyn Observer<D>) -> Result<bool, SolveError> {
        self.begin_stressed(observer)?;
        let (before, mut effort) = (self.reached.progress.step.index, Effort::Usual);
        while self.reached.progress.step.index == before {
            let Some(step) = self.next_step(effort, observer)? else { return Ok(false) };
            let attempted = self.counted_attempt(step, effort, observer);
            let was = std::mem::replace(&mut effort, Effort::Usual);
            match attempted {
                Ok(Outcome::Equilibrium(report, _)) if self.hides_a_slide(step) => {
                    self.bisect(*report, observer)?;
                }
                Ok(Outcome::Equilibrium(report, _)) if self.is_too_long(step, report.excess) => {
                    self.bisect(*report, observer)?;
                }
                Ok(Outcome::Equilibrium(report, path)) => self.accept(*report, path, observer)?,
                Ok(Outcome::InProgress(way)) => self.slump(step, way, observer)?,
                Err(failed) if was == Effort::Usual && self.is_repeated(&failed) => {
                    self.announce_repetition(*failed, observer)?;
                    effort = Effort::Thorough;
                }
                Err(failed) => self.refuse(*failed, observer)?,
            }
        }
        Ok(true)
    }

    /// Attempts a step; if the strength is reduced, the attempt counts as a part of the search.
    fn counted_attempt(
        &mut self,
        step: Step,
        effort: Effort,
        observer: &mut dyn Observer<D>,
    ) -> Result<Outcome<D>, Box<FailedAttempt<D>>> {
        let (evaluations, cpu) = (self.reached.summary.evaluations, ProcessTime::now());
        let attempted = self.attempt(step, self.role_of_slumping(), effort, observer);
        if self.model.stepping.strength_factor(step.end).is_some() {
            let (stage, Reached { progress, summary }) = (self.model.present.stage, &mut self.reached);
            progress.strength_of(stage).count(summary.evaluations - evaluations);
            summary.spend_on_search(stage, cpu.elapsed());
        }
        attempted
    }

    /// Runs to the end of the analysis, or of its current stage, and reports every event to `observer`. The grid must
    /// not move between steps; [`super::run_stages`] moves it and begins further stages.
    ///
    /// # Errors
    /// As for [`Stepper::step`]; [`SolveError::GridMotion`] if the grid moves.
    pub fn run(mut self, observer: &mut dyn Observer<D>) -> Result<Reached, SolveError> {
        self.expect_fixed_grid()?;
        let started = self.start(observer);
        let step = self.kernels.step;
        let outcome = started.and_then(|()| {
            while step(&mut self, observer)? {}
            Ok(())
        });
        self.finish(outcome, observer)
    }

    /// Refuses a grid that moves between steps, which one stepper cannot follow.
    ///
    /// # Errors
    /// [`SolveError::GridMotion`].
    pub(super) fn expect_fixed_grid(&self) -> Result<(), SolveError> {
        let (step, error) = (self.reached.progress.step.index + 1, GridMotionError::NotPlaced);
        if self.model.moving_grid.is_some() { Err(SolveError::GridMotion { step, error }) } else { Ok(()) }
    }

    /// Reports that the run starts.
    ///
    /// # Errors
    /// [`SolveError::Output`].
    pub(super) fn start(&mut self, observer: &mut dyn Observer<D>) -> Result<(), SolveError> {
        start(self.model, self.points, &mut self.reached, observer)
    }

    /// Concludes the summary of the run, and reports it.
    pub(super) fn finish(
        self,
        outcome: Result<(), SolveError>,
        observer: &mut dyn Observer<D>,
    ) -> Result<Reached, SolveError> {
        finish(self.model, self.points, self.reached, outcome, observer)
    }

    /// The points; their converged state is the state at the end of the last converged step.
    pub fn points(&self) -> &Points<D> {
        self.points
    }

    /// The last converged step: the progress and the summary of the run so far.
    pub fn reached(&self) -> &Reached {
        &self.reached
    }

    /// The last converged step: the progress and the summary of the run so far.
    pub(super) fn into_reached(self) -> Reached {
        self.reached
    }

    /// The next step to attempt; `None` at the end of the analysis or of the current stage.
    ///
    /// # Errors
    /// [`SolveError`] if the observer interrupts the run, or the grid has not been placed.
    fn next_step(&self, effort: Effort, observer: &mut dyn Observer<D>) -> Result<Option<Step>, SolveError> {
        let Progress { step: Step { index, end: start, .. }, strength, limits, rests, pace, .. } =
            &self.reached.progress;
        let stage = self.model.present.stage;
        let stops = self.model.stepping.stops_after_slide();
        if strength.iter().any(|found| found.stage == stage && found.bracket.is_final(stops)) {
            return Ok(None);
        }
        if limits.iter().any(|found| found.stage == stage && found.limit.is_reached()) {
            return Ok(None);
        }
        if rests.iter().any(|found| found.stage == stage && found.is_reached()) {
            return Ok(None);
        }
        let Some(end) = pace.end_of_step(&self.model.stepping, *start) else { return Ok(None) };
        let step = Step { index: index + 1, start: *start, end };
        if !self.model.has_grid_of(step.start) {
            return Err(SolveError::GridMotion { step: step.index, error: GridMotionError::NotPlaced });
        }
        // A thorough attempt belongs to the failed one before it; a run is not interrupted between them.
        if effort == Effort::Usual && self.points.reduction().any(observer.interrupted()) {
            return Err(SolveError::Interrupted { step: step.index });
        }
        Ok(Some(step))
    }

    /// The role of slumping in the next attempt.
    fn role_of_slumping(&self) -> Slump {
        let may_slump = self.reached.progress.pace.is_damped()
            && damping::may_slump(self.model, self.points, &self.terms);
        if may_slump { Slump::MayBegin } else { Slump::Forbidden }
    }

    /// Continues from the positions to which damped iterations have moved the points, on one fresh grid after another,
    /// until the step is in equilibrium. If this fails, the points are restored.
    fn slump(
        &mut self,
        step: Step,
        first: InProgress,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        let before = self.points.clone();
        let mut way = first;
        let (mut grids, mut rests) = (0, 0);
        loop {
            self.points.commit();
            if self.points.reduction().any(observer.interrupted()) {
                *self.points = before;
                return Err(SolveError::Interrupted { step: step.index });
            }
            grids += 1;
            rests = if way.is_at_rest { rests + 1 } else { 0 };
            let goes_on = grids < damping::MAX_GRIDS && rests < damping::MAX_RESTS;
            let slump = if goes_on { Slump::GoesOn } else { Slump::Ends };
            match self.attempt(step, slump, Effort::Usual, observer) {
                Ok(Outcome::Equilibrium(mut report, path)) => {
                    way.lead_to(&mut report);
                    return self.accept(*report, path, observer);
                }
                Ok(Outcome::InProgress(more)) => way = more.after(way),
                Err(mut failed) => {
                    *self.points = before;
                    // The iterate belongs to a state of the points that no longer exists.
                    failed.iterate = None;
                    return self.refuse(*failed, observer);
                }
            }
        }
    }
}

/// Reports that a run starts.
///
/// # Errors
/// [`SolveError::Output`].
pub(super) fn start<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    reached: &mut Reached,
    observer: &mut dyn Observer<D>,
) -> Result<(), SolveError> {
    let started = reached.summary.timings.measure(Phase::Output, || observer.started(model, points));
    agree(&points.reduction(), started.map_err(SolveError::Output))
}

/// Concludes the summary of a run that has ended, and reports it.
pub(super) fn finish<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    mut reached: Reached,
    outcome: Result<(), SolveError>,
    observer: &mut dyn Observer<D>,
) -> Result<Reached, SolveError> {
    let Summary { timings, quality, .. } = &mut reached.summary;
    timings.measure(Phase::Update, || quality.conclude(model, points));
    let reported = observer.finished(model, points, &reached, outcome.as_ref().err());
    outcome.and(agree(&points.reduction(), reported.map_err(SolveError::Output))).map(|()| reached)
}

fn refused(term: &str, reason: &str) -> SolveError {
    SolveError::Term { term: term.to_owned(), reason: reason.to_owned() }
}
