//! Stepping: the choice of each load step, the response to a failed one, and the commit of a converged one.

use std::collections::BTreeSet;

use crate::basis::Connectivity;
use crate::equilibrium::StepReport;
use crate::linear::Backend;
use crate::model::{GridMotionError, Model};
use crate::points::Points;
use crate::quality::{Code, Location, Measures, Warning};
use crate::ranks::{Halo, Ranks};
use crate::step::Step;
use crate::stress::Mechanics;
use crate::terms::{Terms, of_model, restore};
use crate::timing::{Phase, Timings};

use super::Solvable;
use super::agree::agree;
use super::attempt::{Attempt, Effort, FailedAttempt, OnTheWay, Slump};
use super::control::Path;
use super::damping;
use super::diagnosis::Diagnosis;
use super::equations::{Equations, OfEngine};
use super::error::SolveError;
use super::fields::Fields;
use super::observer::Observer;
use super::splitting;
use super::strength::Movement;
use super::summary::{Reached, Summary};

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
/// There are `D` axes and `N` components at each node: the displacement, and those of further fields.
pub struct Stepper<'a, const D: usize, const N: usize = D> {
    pub(super) model: &'a Model<D>,
    pub(super) points: &'a mut Points<D>,
    pub(super) fields: Fields,
    pub(super) equations: Equations<D, N>,
    /// Links of the previous step, whose memory is reused.
    pub(super) links: Connectivity<D>,
    /// The last step in equilibrium; none while a step is attempted.
    pub(super) report: Option<StepReport<D>>,
    /// The cause of the failure of the present step, kept while last resorts are tried.
    cause: Option<(FailedAttempt<D>, Diagnosis)>,
    /// The error of the last attempt at the present step that failed although it met the tolerance.
    lost_points: Option<SolveError>,
    /// The parts of equilibrium.
    pub(super) terms: Terms<D, N>,
    /// True if terms have been added to those of the model.
    is_extended: bool,
    pub(super) reached: Reached,
}

/// The terms of a model, with kernels compiled for the mechanics of its idealisation.
pub struct Kernels<const D: usize, const N: usize = D>(fn(&Model<D>) -> Terms<D, N>);

impl<const D: usize, const N: usize> Kernels<D, N> {
    /// The kernels for a kind of mechanics.
    pub fn of<M: Mechanics<D>>() -> Self {
        Kernels(of_model::<D, N, M>)
    }

    /// The terms of a model.
    pub(super) fn terms(&self, model: &Model<D>) -> Terms<D, N> {
        (self.0)(model)
    }
}

impl<'a, const D: usize> Stepper<'a, D> {
    /// An analysis that begins with the converged state of `points`.
    pub fn new(model: &'a Model<D>, points: &'a mut Points<D>) -> Self
    where
        Model<D>: Solvable<D>,
    {
        let mut stepper = Stepper::of_fields(model, points, &model.kernels(), Fields::displacement(D));
        if let Some(engine) = &model.engines.0 {
            let (direct, iterative) = (engine.direct(), engine.iterative());
            stepper.equations.use_engine(OfEngine { direct, iterative, algebraic: engine.algebraic() });
        }
        stepper
    }
}

impl<'a, const D: usize, const N: usize> Stepper<'a, D, N> {
    /// An analysis with further fields at the nodes, which terms added later use. The fields must have `N` components
    /// in total, those of the displacement first.
    ///
    /// # Errors
    /// [`SolveError::Term`] if the fields do not have `D` and `N` components.
    pub fn with_fields(
        model: &'a Model<D>,
        points: &'a mut Points<D>,
        kernels: Kernels<D, N>,
        fields: Fields,
    ) -> Result<Self, SolveError> {
        let first = fields.iter().next().map(|(_, components)| components.len());
        if first != Some(D) || fields.n_components() != N {
            return Err(refused(
                "fields",
                "the fields must have one component for each unknown at a node, those of the displacement first",
            ));
        }
        Ok(Stepper::of_fields(model, points, &kernels, fields))
    }

    fn of_fields(
        model: &'a Model<D>,
        points: &'a mut Points<D>,
        kernels: &Kernels<D, N>,
        fields: Fields,
    ) -> Self {
        let reached = Reached::nothing(points);
        Stepper {
            model,
            points,
            terms: kernels.terms(model),
            fields,
            equations: Equations::new(None),
            links: Connectivity::default(),
            report: None,
            cause: None,
            lost_points: None,
            is_extended: false,
            reached,
        }
    }

    /// Adds terms of equilibrium to those of the model.
    ///
    /// # Errors
    /// [`SolveError::Term`] if two terms have the same name.
    pub fn with_terms(mut self, further: Terms<D, N>) -> Result<Self, SolveError> {
        self.is_extended |= !further.is_empty();
        self.terms.extend(further);
        let mut names = BTreeSet::new();
        match self.terms.iter().find(|term| !names.insert(term.name())) {
            Some(term) => Err(refused(term.name(), "another term has the same name")),
            None => Ok(self),
        }
    }

    /// Solves linear equations by this backend in place of the built-in ones.
    pub fn with_backend(mut self, backend: Box<dyn Backend<D, N>>) -> Self {
        self.equations = Equations::new(Some(backend));
        self
    }

    /// Resumes from a step that has been reached; the points must be in its state. All terms must have been added.
    ///
    /// # Errors
    /// [`SolveError::Term`] if a term cannot resume from its saved state.
    pub fn resume(mut self, reached: Reached) -> Result<Self, SolveError> {
        let is_known = |name: &String| self.terms.iter().any(|term| term.name() == name.as_str());
        if let Some(name) = reached.summary.terms.keys().find(|name| !is_known(name)) {
            return Err(refused(name, "it has a saved state, but has not been added to the analysis"));
        }
        restore(&mut self.terms, &reached.summary.terms).map_err(|(term, reason)| refused(term, &reason))?;
        self.equations.resume(reached.summary.kept.clone());
        self.reached = reached;
        Ok(self)
    }

    /// Solves the next step and commits it: the step that follows the last one in equilibrium or, if it has no
    /// equilibrium, smaller ones as far as the model allows. `None` at the end of the analysis. A grid that moves must have
    /// been moved to its place by [`Model::place_grid`].
    ///
    /// # Errors
    /// [`SolveError`] when there is no equilibrium; the converged state of the points is then the last one in equilibrium.
    pub fn step(&mut self, observer: &mut dyn Observer<D>) -> Result<Option<&StepReport<D>>, SolveError> {
        Ok(self.solve_next_step(observer)?.then_some(self.report.as_ref()).flatten())
    }

    /// Runs to the end of the analysis and reports every event to `observer`. The grid must not move between steps;
    /// [`super::run_stages`] moves it.
    ///
    /// # Errors
    /// As [`Stepper::step`]; [`SolveError::GridMotion`] if the grid moves.
    pub fn run(mut self, observer: &mut dyn Observer<D>) -> Result<Summary, SolveError> {
        if self.model.moving_grid.is_some() {
            let step = self.reached.step.index + 1;
            return Err(SolveError::GridMotion { step, error: GridMotionError::NotPlaced });
        }
        let started = start(self.model, self.points, &mut self.reached, observer);
        let outcome = started.and_then(|()| self.steps_on_grid(observer).map(drop));
        let Stepper { model, points, reached, .. } = self;
        finish(model, points, reached, outcome, observer)
    }

    /// The points; their converged state is that of the last step in equilibrium.
    pub fn points(&self) -> &Points<D> {
        self.points
    }

    /// The last step in equilibrium, and the account of the run so far.
    pub fn reached(&self) -> &Reached {
        &self.reached
    }

    /// Solves the next step; false at the end of the analysis.
    fn solve_next_step(&mut self, observer: &mut dyn Observer<D>) -> Result<bool, SolveError> {
        self.begin_stressed(observer)?;
        let before = self.reached.step.index;
        while self.reached.step.index == before {
            let Some(step) = self.next_interval() else { return Ok(false) };
            if !self.model.has_grid_of(step.start) {
                return Err(SolveError::GridMotion { step: step.index, error: GridMotionError::NotPlaced });
            }
            self.try_step(step, observer)?;
        }
        Ok(true)
    }

    /// Moves the corners of domains that were replaced out of tools.
    fn part_from_tools(&mut self, replaced: &[u32]) {
        let Stepper { model, points, terms, .. } = self;
        splitting::part_from_tools(model, points, terms, replaced);
    }

    /// Splits the points whose domains have become too long. The next step begins as a run begins that is resumed here.
    fn split_long_domains(&mut self) {
        let Stepper { model, points, reached, terms, .. } = self;
        splitting::split_long(model, points, terms, &mut reached.summary.splits);
    }

    /// Solves all steps on the present grid: up to the end of the analysis or stage, or only the next one if the grid moves.
    /// Returns false at the end.
    ///
    /// # Errors
    /// As [`Stepper::step`].
    pub(super) fn steps_on_grid(&mut self, observer: &mut dyn Observer<D>) -> Result<bool, SolveError> {
        while self.solve_next_step(observer)? {
            if self.model.moving_grid.is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The last step in equilibrium, and the account of the run so far.
    pub(super) fn into_reached(self) -> Reached {
        self.reached
    }

    /// The step that follows the last one in equilibrium; `None` at the end of the analysis.
    fn next_interval(&self) -> Option<Step> {
        let Reached { step: Step { index, end: start, .. }, summary } = &self.reached;
        let stage = self.model.present.stage;
        if summary.strength.iter().any(|of| of.stage == stage && of.bracket.fails.is_some()) {
            return None;
        }
        let end = summary.pace.end_of_step(&self.model.stepping, *start)?;
        Some(Step { index: index + 1, start: *start, end })
    }

    /// Solves one step and, only if it is in equilibrium, commits and reports it. One that fails is followed by a smaller
    /// one, if that is allowed and may help.
    ///
    /// # Errors
    /// [`SolveError`] that ends the run.
    fn try_step(&mut self, step: Step, observer: &mut dyn Observer<D>) -> Result<(), SolveError> {
        if self.points.ranks.any(observer.interrupted()) {
            return Err(SolveError::Interrupted { step: step.index });
        }
        // It is unknown whether other terms only load the bodies, and a failed slump does not restore their state.
        let may_slump = self.reached.summary.pace.is_damped()
            && damping::may_slump(self.model, self.points)
            && !self.is_extended;
        let slump = if may_slump { Slump::MayBegin } else { Slump::Forbidden };
        let mut attempted = self.attempt(step, slump, Effort::Usual, observer);
        if let Err(failed) = &mut attempted
            && failed.may_succeed_if_smaller
            && self.model.stepping.strength_factor(step.end).is_some()
        {
            self.announce_repetition(failed, observer)?;
            attempted = self.attempt(step, slump, Effort::Thorough, observer);
        }
        match attempted {
            Ok(Attempt::Equilibrium(report, path)) => {
                if self.hides_a_slide(step) {
                    self.links = report.grid.links;
                    return self.announce_bisection(step, observer);
                }
                self.accept(*report, path, observer)
            }
            Ok(Attempt::OnTheWay(way)) => self.slump(step, way, observer),
            Err(failed) => self.refuse(*failed, observer),
        }
    }

    /// True if bodies begin to slide in a step in equilibrium, which is not committed, and a smaller one can show where; the
    /// next attempt then is that one.
    fn hides_a_slide(&mut self, step: Step) -> bool {
        let (model, points) = (self.model, &*self.points);
        if model.stepping.strength_factor(step.end).is_none() {
            return false;
        }
        let movement = Movement::of(model, points, step);
        let summary = &mut self.reached.summary;
        summary.strength_of(model.present.stage).begins_to_slide(movement)
            && summary.pace.halve(&model.stepping, step.start, step.end)
    }

    /// Reports that a smaller step follows one in equilibrium in which bodies begin to slide.
    fn announce_bisection(&mut self, step: Step, observer: &mut dyn Observer<D>) -> Result<(), SolveError> {
        let (model, points) = (self.model, &*self.points);
        let timings = &mut self.reached.summary.timings;
        let observed = timings.measure(Phase::Output, || observer.bisected(model, points, step));
        agree(&points.ranks, observed.map_err(SolveError::Output))
    }

    /// Counts and reports a failed attempt that a thorough one follows.
    fn announce_repetition(
        &mut self,
        failed: &mut FailedAttempt<D>,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        failed.is_repeated = true;
        let (model, points, summary) = (self.model, &*self.points, &mut self.reached.summary);
        summary.failed_attempts += 1;
        let observe = || observer.failed(model, points, failed, None);
        let observed = summary.timings.measure(Phase::Output, observe).map_err(SolveError::Output);
        agree(&points.ranks, observed)
    }

    /// Continues from the positions to which damped iterations have moved the points, on one fresh grid after another,
    /// until the step is in equilibrium. If this fails, the points are restored.
    fn slump(
        &mut self,
        step: Step,
        first: OnTheWay,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        let before = self.points.clone();
        let mut way = first;
        let (mut grids, mut rests) = (0, 0);
        loop {
            self.points.commit();
            if self.points.ranks.any(observer.interrupted()) {
                *self.points = before;
                return Err(SolveError::Interrupted { step: step.index });
            }
            grids += 1;
            rests = if way.is_at_rest { rests + 1 } else { 0 };
            let goes_on = grids < damping::MOST_GRIDS && rests < damping::MOST_RESTS;
            let slump = if goes_on { Slump::GoesOn } else { Slump::Ends };
            match self.attempt(step, slump, Effort::Usual, observer) {
                Ok(Attempt::Equilibrium(mut report, path)) => {
                    way.lead_to(&mut report);
                    return self.accept(*report, path, observer);
                }
                Ok(Attempt::OnTheWay(more)) => way = more.after(way),
                Err(mut failed) => {
                    *self.points = before;
                    // The iterate belongs to a state of the points that no longer exists.
                    failed.iterate = None;
                    return self.refuse(*failed, observer);
                }
            }
        }
    }

    /// The trial state of a step in equilibrium becomes the converged state.
    fn accept(
        &mut self,
        report: StepReport<D>,
        path: Path,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        self.judge(&report);
        self.points.commit();
        self.terms.iter_mut().for_each(|term| term.commit());
        self.part_from_tools(&report.replaced_domains);
        self.split_long_domains();
        let (model, points) = (self.model, &*self.points);
        let Reached { step, summary } = &mut self.reached;
        summary.terms =
            (self.terms.iter()).filter_map(|term| Some((term.name().to_owned(), term.save()?))).collect();
        *step = report.step;
        summary.path = path;
        self.cause = None;
        self.lost_points = None;
        summary.kept = self.equations.kept();
        summary.pace.succeeded(&model.stepping, report.most_solves);
        summary.accept(&report);
        let balance = summary.balance();
        let raised = summary.quality.judge_balances(model, points, &balance, report.step.index);
        summary.warnings.extend(raised);
        let mut timings = Timings::default();
        let observed = timings.measure(Phase::Output, || observer.converged(model, points, &report, summary));
        summary.timings.add(&timings);
        self.report = Some(report);
        agree(&points.ranks, observed.map_err(SolveError::Output))
    }

    /// Makes the next step smaller, or returns the error that ends the run.
    fn refuse(
        &mut self,
        mut failed: FailedAttempt<D>,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        let (model, points) = (self.model, &*self.points);
        let Reached { summary, step } = &mut self.reached;
        summary.failed_attempts += 1;
        let Step { start, end, .. } = failed.step;
        let is_torn = failed.error.is_torn();
        let was_last_resort = summary.pace.is_last_resort();
        let goes_on =
            failed.may_succeed_if_smaller && summary.pace.failed(&model.stepping, start, end, is_torn);
        // The last attempt before the last resorts shows why a step fails.
        let diagnosis = (!was_last_resort && (!goes_on || summary.pace.is_last_resort())).then(|| {
            // Each rank looks at what it has: their errors may differ, and with them what they look for.
            let halo = failed.exchange_halo(Halo::default());
            let lost_points = self.lost_points.as_ref();
            let diagnosis = Diagnosis::new(model, points, &failed, lost_points, summary.largest_load_factor);
            failed.exchange_halo(halo);
            of_failing_rank(&points.ranks, &failed, diagnosis)
        });
        if goes_on {
            let observe = || observer.failed(model, points, &failed, None);
            let observed = summary.timings.measure(Phase::Output, observe).map_err(SolveError::Output);
            let observed = agree(&points.ranks, observed);
            match diagnosis {
                Some(diagnosis) => self.cause = Some((failed, diagnosis)),
                None if failed.has_lost_points(model.newton.tolerance) => {
                    self.lost_points = Some(failed.error)
                }
                None => {}
            }
            return observed;
        }
        if let Some(fails) = model.stepping.strength_factor(end).filter(|_| failed.may_succeed_if_smaller) {
            let from = model.stepping.strength_factor(model.stepping.start_time);
            // The state before the stage is in equilibrium at full strength.
            let stood =
                step.index > 0 || summary.initial_state.as_ref().is_some_and(|state| state.is_balanced);
            let bracket = summary.strength_of(model.present.stage);
            bracket.stands = bracket.stands.or(from.filter(|from| stood && *from <= 1.0));
            bracket.fails = Some(fails);
            let short = bracket.stopped_short(step.index);
            summary.warnings.extend(short);
            let observe = || observer.failed(model, points, &failed, None);
            let observed = summary.timings.measure(Phase::Output, observe).map_err(SolveError::Output);
            return agree(&points.ranks, observed);
        }
        let cause = self.cause.take().filter(|_| was_last_resort);
        let ended = match (&cause, &diagnosis) {
            (Some((cause, diagnosis)), _) => Some((cause, diagnosis)),
            (None, Some(diagnosis)) => Some((&failed, diagnosis)),
            (None, None) => None,
        };
        self.reached.summary.diagnosis = ended.map(|(_, diagnosis)| diagnosis.clone());
        // The run has failed already, on all ranks.
        let observe = || observer.failed(model, points, &failed, ended);
        let _ = self.reached.summary.timings.measure(Phase::Output, observe);
        Err(cause.map_or(failed.error, |(cause, _)| cause.error))
    }

    /// Measures a step in equilibrium before it is committed.
    fn judge(&mut self, report: &StepReport<D>) {
        let (model, points) = (self.model, &*self.points);
        let Summary { timings, quality, warnings, .. } = &mut self.reached.summary;
        let raised = timings.measure(Phase::Update, || {
            let moved = model.grid_at(report.step.end).ok().flatten();
            let next_grid = moved.as_ref().map_or(model.grid.as_ref(), |grid| grid as _);
            let measures = Measures::new(model, points, &report.grid.links, next_grid);
            let mut raised = quality.accept(model, report.step.index, &measures, &report.residuals);
            raised.extend(quality.watch(model, points, report));
            raised
        });
        warnings.extend(raised);
        if let Some(factor) = report.strength_factor {
            let movement = Movement::of(model, points, report.step);
            let from = model.stepping.strength_factor(model.stepping.start_time).unwrap_or(factor);
            let slumped = self.reached.summary.damped - usize::from(report.damped);
            let bracket = self.reached.summary.strength_of(model.present.stage);
            let begun = bracket.begins(slumped, report.step.index);
            let slides = bracket.stood(factor, from, movement, report.step.index);
            self.reached.summary.warnings.extend(begun.into_iter().chain(slides));
        }
        let Summary { quality, warnings, .. } = &mut self.reached.summary;
        if let Some(error) = self.equations.unreported_turn()
            && quality.is_first(Code::Factorised)
        {
            let step = report.step.index;
            warnings.push(Warning {
                code: Code::Factorised,
                step,
                location: Location::default(),
                value: None,
                threshold: None,
                message: format!(
                    "iterations cannot solve the equations, which are factorised instead: {error}"
                ),
                detail: None,
            });
        }
    }
}

/// The diagnosis of the rank that has the error; the others know it in words only.
fn of_failing_rank<const D: usize>(ranks: &Ranks, failed: &FailedAttempt<D>, own: Diagnosis) -> Diagnosis {
    if ranks.is_alone() {
        return own;
    }
    let is_known = !matches!(failed.error, SolveError::OnRank(_));
    let told = ranks.first(is_known.then(|| serde_json::to_string(&own).unwrap_or_default()));
    told.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or(own)
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
    agree(&points.ranks, started.map_err(SolveError::Output))
}

/// Concludes the account of a run that has ended, and reports it.
pub(super) fn finish<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    mut reached: Reached,
    outcome: Result<(), SolveError>,
    observer: &mut dyn Observer<D>,
) -> Result<Summary, SolveError> {
    let Summary { timings, quality, .. } = &mut reached.summary;
    timings.measure(Phase::Update, || quality.conclude(model, points));
    let finished = reached.summary;
    let reported = observer.finished(model, points, &finished, outcome.as_ref().err());
    outcome.and(agree(&points.ranks, reported.map_err(SolveError::Output))).map(|()| finished)
}

fn refused(term: &str, reason: &str) -> SolveError {
    SolveError::Term { term: term.to_owned(), reason: reason.to_owned() }
}
