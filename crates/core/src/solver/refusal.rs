//! Recovery from a failed attempt at a step.

use crate::model::Model;
use crate::points::Points;
use crate::ranks::Reduction;
use crate::step::Step;
use crate::timing::Phase;

use super::attempt::FailedAttempt;
use super::collective::{agree, value_of_first_to_know};
use super::diagnosis::evidence::points_that_flow;
use super::diagnosis::{Diagnosis, Kind};
use super::error::SolveError;
use super::observer::{Cause, Observer};
use super::progress::Reached;
use super::stepper::Stepper;
use super::stepping::pace::Failure;

impl<const D: usize, const N: usize> Stepper<'_, D, N> {
    /// True if a thorough attempt at the same step follows a failed one: while strength is reduced, the settings must
    /// not decide whether a step has an equilibrium.
    pub(super) fn is_repeated(&self, failed: &FailedAttempt<D>) -> bool {
        failed.may_succeed_if_smaller && self.model.stepping.strength_factor(failed.step.end).is_some()
    }

    /// Counts and reports a failed attempt that is followed by a thorough one.
    pub(super) fn announce_repetition(
        &mut self,
        mut failed: FailedAttempt<D>,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        failed.is_repeated = true;
        let (model, points, summary) = (self.model, &*self.points, &mut self.reached.summary);
        summary.failed_attempts += 1;
        let observe = || observer.failed(model, points, &failed, None);
        let observed = summary.timings.measure(Phase::Output, observe).map_err(SolveError::Output);
        agree(&points.reduction(), observed)
    }

    /// Prepares the next attempt (a smaller step or a last resort), ends a strength reduction, or returns the error
    /// that ends the run.
    pub(super) fn refuse(
        &mut self,
        mut failed: FailedAttempt<D>,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        let (model, points) = (self.model, &*self.points);
        let Reached { progress, summary } = &mut self.reached;
        summary.failed_attempts += 1;
        let Step { start, end, .. } = failed.step;
        let failure =
            Failure { is_torn: failed.error.is_torn(), may_relax: may_relax(model, points, &failed) };
        let was_last_resort = progress.pace.is_last_resort();
        let goes_on =
            failed.may_succeed_if_smaller && progress.pace.failed(&model.stepping, start, end, failure);
        // The last attempt before the last resorts shows why the step fails, and each attempt why steps stay short.
        let is_last = !goes_on || progress.pace.is_last_resort();
        let diagnosis = (!was_last_resort && (is_last || progress.pace.is_short())).then(|| {
            // Each rank examines only its own data, because the errors of the ranks may differ, and with them what the
            // ranks look for.
            let reduction = failed.exchange_reduction(Reduction::default());
            let lost_points = self.lost_points.as_ref();
            let diagnosis = Diagnosis::new(model, points, &failed, lost_points, summary.largest_load_factor);
            failed.exchange_reduction(reduction);
            // The rank that has the error passes its diagnosis on; the others know the error in words only.
            let knows = !matches!(failed.error, SolveError::OnRank(_));
            value_of_first_to_know(&points.reduction(), knows, diagnosis)
        });
        if let Some(diagnosis) = &diagnosis {
            let names_nothing = matches!(diagnosis.kind, Kind::Setting | Kind::LargeSteps | Kind::Unknown);
            summary.cut = Some(if names_nothing { failed.error.to_string() } else { diagnosis.to_string() });
        }
        if goes_on {
            let observe = || observer.failed(model, points, &failed, None);
            let observed = summary.timings.measure(Phase::Output, observe).map_err(SolveError::Output);
            let observed = agree(&points.reduction(), observed);
            match diagnosis {
                Some(diagnosis) if is_last => self.cause = Some((failed, diagnosis)),
                _ if failed.has_lost_points(model.newton.tolerance) => self.lost_points = Some(failed.error),
                _ => {}
            }
            return observed;
        }
        if let Some(fails) = model.stepping.strength_factor(end).filter(|_| failed.may_succeed_if_smaller) {
            let from = model.stepping.strength_factor(model.stepping.start_time);
            // The state before the stage is in equilibrium at full strength.
            let step = progress.step.index;
            let stood = step > 0 || summary.initial_state.as_ref().is_some_and(|state| state.is_balanced);
            let bracket = progress.strength_of(model.present.stage);
            bracket.stands = bracket.stands.or(from.filter(|from| stood && *from <= 1.0));
            bracket.fails = Some(fails);
            let short = bracket.stopped_short(step);
            summary.warnings.extend(short);
            let observe = || observer.failed(model, points, &failed, None);
            let observed = summary.timings.measure(Phase::Output, observe).map_err(SolveError::Output);
            return agree(&points.reduction(), observed);
        }
        let cause = self.cause.take().filter(|_| was_last_resort);
        let (attempt, diagnosis) = match cause {
            Some((attempt, diagnosis)) => (Some(attempt), Some(diagnosis)),
            None => (None, diagnosis),
        };
        let experiments = self.experiments(&failed, observer);
        let diagnosis = diagnosis.map(|diagnosis| diagnosis.after(experiments));
        let seen = attempt.as_ref().unwrap_or(&failed);
        let ended = diagnosis.as_ref().map(|diagnosis| Cause { attempt: seen, diagnosis });
        self.reached.summary.diagnosis.clone_from(&diagnosis);
        // The run has failed already, on all ranks.
        let points = &*self.points;
        let observe = || observer.failed(model, points, &failed, ended);
        let _ = self.reached.summary.timings.measure(Phase::Output, observe);
        Err(attempt.map_or(failed.error, |attempt| attempt.error))
    }
}

/// True if viscosity might help where an attempt has failed: bodies flow, and only motions drive them. Bodies that loads
/// push beyond their capacity would go on under stresses that they cannot bear.
fn may_relax<const D: usize>(model: &Model<D>, points: &Points<D>, failed: &FailedAttempt<D>) -> bool {
    let is_driven = model.is_driven() && model.keeps_its_loads();
    is_driven
        && points.reduction().any(failed.error.is_about_iterations() && points_that_flow(model, points) > 0)
}
