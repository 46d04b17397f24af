//! Experiments with a failed step on the last equilibrium: the step is attempted once more with changed equations, one
//! change at a time. The changes with which it converges show where the cause lies.

use crate::material::Viscous;
use crate::model::Tool;
use crate::step::{Experiment, Step};

use super::attempt::{Effort, FailedAttempt, Outcome, Slump};
use super::diagnosis::Finding;
use super::diagnosis::evidence::points_that_flow;
use super::observer::{Observer, Silent};
use super::stepper::Stepper;

/// Evaluations that experiments may cost: this many, and this share of those of the run.
const EVALUATIONS: usize = 200;
const SHARE: usize = 10;

impl<const D: usize, const N: usize> Stepper<'_, D, N> {
    /// Attempts a failed step with all changes that apply to the model, until they have cost too much or the run is
    /// interrupted. Nothing is committed, and the trial state stays that of the failed attempt.
    pub(super) fn experiments(
        &mut self,
        failed: &FailedAttempt<D>,
        observer: &dyn Observer<D>,
    ) -> Vec<Finding> {
        let reduction = self.points.reduction();
        if !reduction.any(failed.error.is_about_iterations() || failed.error.is_retryable()) {
            return Vec::new();
        }
        let before = self.reached.summary.evaluations;
        let trial = self.points.trial.clone();
        let mut findings = Vec::new();
        for experiment in self.possible_experiments() {
            let cost = self.reached.summary.evaluations - before;
            let is_interrupted = self.points.reduction().any(observer.interrupted());
            if is_interrupted || cost > EVALUATIONS + before / SHARE {
                break;
            }
            let Step { start, end, .. } = failed.step;
            let end = if experiment == Experiment::HalfStep { 0.5 * (start + end) } else { end };
            let step = Step { end, ..failed.step };
            let outcome = self.attempt(step, Slump::Forbidden, Effort::Experiment(experiment), &mut Silent);
            let converges = matches!(outcome, Ok(Outcome::Equilibrium(..)));
            findings.push(Finding { experiment, converges });
        }
        self.points.trial = trial;
        findings
    }

    /// The experiments that change anything in this model.
    fn possible_experiments(&self) -> Vec<Experiment> {
        let (model, points) = (self.model, &*self.points);
        let may_be_elastic = model.materials.iter().any(|of| Viscous::elastic(of.law.as_ref()).is_some());
        let mut possible = Vec::new();
        if may_be_elastic && points.reduction().any(points_that_flow(model, points) > 0) {
            possible.push(Experiment::ElasticMaterials);
        }
        if !model.tools.is_empty() {
            possible.push(Experiment::FrozenContact);
        }
        if model.tools.iter().any(Tool::resists_sliding) {
            possible.push(Experiment::FrozenFriction);
        }
        possible.extend([Experiment::StrongerStabilisation, Experiment::HalfStep]);
        possible
    }
}
