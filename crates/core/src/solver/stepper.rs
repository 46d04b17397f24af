//! From load step to load step: which is tried, what becomes of one that fails, and what is committed.

use std::collections::BTreeSet;

use crate::basis::Connectivity;
use crate::equilibrium::StepReport;
use crate::model::Model;
use crate::points::Points;
use crate::quality::{Code, Measures, Place, Warning};
use crate::step::Step;
use crate::stress::Mechanics;
use crate::terms::{Terms, of_bodies};
use crate::timing::{Phase, Timings};

use super::attempt::{Attempt, FailedAttempt, OnTheWay, Slump};
use super::control::Path;
use super::damping;
use super::diagnosis::Diagnosis;
use super::equations::Equations;
use super::error::SolveError;
use super::observer::Observer;
use super::summary::{Reached, Summary};

/// What lives from step to step: the linear solvers with their analyses, and how far the run has come.
pub(super) struct Stepper<const D: usize> {
    pub(super) equations: Equations<D>,
    /// Links of the step before, for their memory.
    pub(super) links: Connectivity<D>,
    /// Why the step in hand fails, once last resorts are tried.
    cause: Option<(FailedAttempt<D>, Diagnosis)>,
    /// Why the last attempt at the step in hand that met the tolerance has failed all the same.
    lost_points: Option<SolveError>,
    /// The parts of equilibrium.
    pub(super) terms: Terms<D>,
    /// Whether there are others than those that every analysis has.
    is_extended: bool,
    pub(super) reached: Reached,
}

impl<const D: usize> Stepper<D> {
    /// Goes on from what has been reached, with further terms.
    ///
    /// # Errors
    /// [`SolveError::Term`].
    pub(super) fn new<M: Mechanics<D>>(reached: Reached, further: Terms<D>) -> Result<Self, SolveError> {
        let mut terms = of_bodies::<D, M>();
        let is_extended = !further.is_empty();
        terms.extend(further);
        let refused =
            |term: &str, reason: &str| SolveError::Term { term: term.to_owned(), reason: reason.to_owned() };
        let mut names = BTreeSet::new();
        if let Some(term) = terms.iter().find(|term| !names.insert(term.name())) {
            return Err(refused(term.name(), "another term has its name"));
        }
        if let Some(name) = reached.summary.terms.keys().find(|name| !names.contains(name.as_str())) {
            return Err(refused(name, "what has been reached holds a state of it, but it is not given"));
        }
        for term in &mut terms {
            if let Some(saved) = reached.summary.terms.get(term.name()) {
                term.restore(saved).map_err(|reason| refused(term.name(), &reason))?;
            }
        }
        Ok(Stepper {
            equations: Equations::with(reached.summary.kept.clone()),
            links: Connectivity::default(),
            cause: None,
            lost_points: None,
            terms,
            is_extended,
            reached,
        })
    }

    pub(super) fn observe(
        &mut self,
        tell: impl FnOnce() -> Result<(), std::io::Error>,
    ) -> Result<(), SolveError> {
        self.reached.summary.timings.measure(Phase::Output, tell).map_err(SolveError::Output)
    }

    /// The step that follows the last one in equilibrium; `None` at the end of the analysis.
    pub(super) fn next_step(&self, model: &Model<D>) -> Option<Step> {
        let Reached { step: Step { index, end: start, .. }, summary } = &self.reached;
        let end = summary.pace.end_of_step(&model.stepping, *start)?;
        Some(Step { index: index + 1, start: *start, end })
    }

    /// Solves one step and, only if it is in equilibrium, commits and reports it. One that fails is followed by a smaller
    /// one, if that is allowed and may help.
    ///
    /// # Errors
    /// [`SolveError`] that ends the run.
    pub(super) fn try_step<M: Mechanics<D>>(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        step: Step,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        if observer.interrupted() {
            return Err(SolveError::Interrupted { step: step.index });
        }
        // Whether other terms only weigh on the bodies is not known, and a slump that fails does not take back what they keep.
        let may_slump =
            self.reached.summary.pace.is_damped() && damping::may_slump(model, points) && !self.is_extended;
        let slump = if may_slump { Slump::MayBegin } else { Slump::Forbidden };
        match self.solve_step::<M>(model, points, step, slump, observer) {
            Ok(Attempt::Equilibrium(report, path)) => self.accept(model, points, *report, path, observer),
            Ok(Attempt::OnTheWay(way)) => self.slump::<M>(model, points, step, way, observer),
            Err(failed) => self.refuse(model, points, *failed, observer),
        }
    }

    /// Goes on to the equilibrium of a step from where damped iterations have led the points, on one fresh grid after another;
    /// without success the points are as they were.
    fn slump<M: Mechanics<D>>(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        step: Step,
        first: OnTheWay,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        let before = points.clone();
        let mut way = first;
        let (mut grids, mut rests) = (0, 0);
        loop {
            points.commit();
            if observer.interrupted() {
                *points = before;
                return Err(SolveError::Interrupted { step: step.index });
            }
            grids += 1;
            rests = if way.is_at_rest { rests + 1 } else { 0 };
            let goes_on = grids < damping::MOST_GRIDS && rests < damping::MOST_RESTS;
            let slump = if goes_on { Slump::GoesOn } else { Slump::Ends };
            match self.solve_step::<M>(model, points, step, slump, observer) {
                Ok(Attempt::Equilibrium(mut report, path)) => {
                    way.lead_to(&mut report);
                    return self.accept(model, points, *report, path, observer);
                }
                Ok(Attempt::OnTheWay(more)) => way = more.after(way),
                Err(mut failed) => {
                    *points = before;
                    // It has the points of a state that is gone.
                    failed.iterate = None;
                    return self.refuse(model, points, *failed, observer);
                }
            }
        }
    }

    /// The trial state of a step in equilibrium becomes the converged state.
    fn accept(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        report: StepReport<D>,
        path: Path,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        self.judge(model, points, &report);
        points.commit();
        self.terms.iter_mut().for_each(|term| term.commit());
        let Reached { step, summary } = &mut self.reached;
        summary.terms =
            (self.terms.iter()).filter_map(|term| Some((term.name().to_owned(), term.save()?))).collect();
        *step = report.step;
        summary.path = path;
        self.cause = None;
        self.lost_points = None;
        summary.kept = self.equations.kept();
        summary.pace.succeeded(&model.stepping, report.residuals.len() - 1);
        summary.accept(&report);
        let balance = summary.balance();
        let raised = summary.quality.judge_balances(model, points, &balance, report.step.index);
        summary.warnings.extend(raised);
        let mut timings = Timings::default();
        let told = timings.measure(Phase::Output, || observer.converged(model, points, &report, summary));
        summary.timings.add(&timings);
        self.links = report.grid.links;
        told.map_err(SolveError::Output)
    }

    /// Makes the next step smaller, or says why the run ends.
    fn refuse(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        failed: FailedAttempt<D>,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        let Reached { summary, .. } = &mut self.reached;
        summary.failed_attempts += 1;
        let Step { start, end, .. } = failed.step;
        let is_torn = matches!(failed.error, SolveError::Domain { .. });
        let was_last_resort = summary.pace.is_last_resort();
        let goes_on =
            failed.may_succeed_if_smaller && summary.pace.failed(&model.stepping, start, end, is_torn);
        // Why a step fails shows in the last attempt before the last resorts.
        let diagnosis = (!was_last_resort && (!goes_on || summary.pace.is_last_resort())).then(|| {
            Diagnosis::new(model, points, &failed, self.lost_points.as_ref(), summary.largest_load_factor)
        });
        if goes_on {
            let told = self.observe(|| observer.failed(model, points, &failed, None));
            match diagnosis {
                Some(diagnosis) => self.cause = Some((failed, diagnosis)),
                None if failed.has_lost_points(model.newton.tolerance) => {
                    self.lost_points = Some(failed.error)
                }
                None => {}
            }
            return told;
        }
        let cause = self.cause.take().filter(|_| was_last_resort);
        let ended = match (&cause, &diagnosis) {
            (Some((cause, diagnosis)), _) => Some((cause, diagnosis)),
            (None, Some(diagnosis)) => Some((&failed, diagnosis)),
            (None, None) => None,
        };
        self.reached.summary.diagnosis = ended.map(|(_, diagnosis)| diagnosis.clone());
        // The run has failed already.
        let _ = self.observe(|| observer.failed(model, points, &failed, ended));
        Err(cause.map_or(failed.error, |(cause, _)| cause.error))
    }

    /// Takes the measures of a step in equilibrium, before it is committed.
    fn judge(&mut self, model: &Model<D>, points: &Points<D>, report: &StepReport<D>) {
        let Summary { timings, quality, warnings, .. } = &mut self.reached.summary;
        let raised = timings.measure(Phase::Update, || {
            let measures = Measures::new(model, points, &report.grid.links);
            let mut raised = quality.accept(model, report.step.index, &measures, &report.residuals);
            raised.extend(quality.watch(model, points, report));
            raised
        });
        warnings.extend(raised);
        if let Some(error) = self.equations.news()
            && quality.is_first(Code::Factorised)
        {
            let step = report.step.index;
            warnings.push(Warning {
                code: Code::Factorised,
                step,
                place: Place::default(),
                value: None,
                threshold: None,
                message: format!("iterations cannot solve the equations, which are factorised instead: {error}"),
                help: "the results are not affected; for less memory and time see what makes the equations ill-conditioned \
                       (`mpm explain W004`)"
                    .to_owned(),
            });
        }
    }
}
