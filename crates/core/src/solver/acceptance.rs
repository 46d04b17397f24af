//! The commit of a converged step.

use crate::equilibrium::StepReport;
use crate::quality::{Code, Location, Measures, Warning};
use crate::step::{Step, StepContext};
use crate::terms::save;
use crate::timing::{Phase, Timings};

use super::collective::agree;
use super::control::Path;
use super::error::SolveError;
use super::observer::Observer;
use super::progress::Reached;
use super::splitting;
use super::stepper::Stepper;
use super::strength::Movement;
use super::summary::Summary;

impl<const D: usize, const N: usize> Stepper<'_, D, N> {
    /// Makes the trial state of a converged step the converged state.
    pub(super) fn accept(
        &mut self,
        report: StepReport<D>,
        path: Path,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        self.judge(&report);
        self.commit(&report);
        self.push_out_of_tools(&report.replaced_domains);
        self.split_long_domains();
        let (model, points) = (self.model, &*self.points);
        self.cause = None;
        self.lost_points = None;
        let Reached { progress, summary } = &mut self.reached;
        progress.terms = save(&self.terms);
        progress.step = report.step;
        progress.path = path;
        progress.pace.succeeded(&model.stepping, report.most_solves);
        progress.carried.clone_from(&report.carried);
        progress.last_iterations = report.solves();
        summary.accept(&report);
        let balance = summary.balance();
        let raised = summary.quality.judge_balances(model, points, &balance, report.step.index);
        summary.warnings.extend(raised);
        let mut timings = Timings::default();
        let reached = &self.reached;
        let observed = timings.measure(Phase::Output, || observer.converged(model, points, &report, reached));
        self.reached.summary.timings.add(&timings);
        self.report = Some(report);
        agree(&points.reduction(), observed.map_err(SolveError::Output))
    }

    /// Commits the terms, then the points.
    fn commit(&mut self, report: &StepReport<D>) {
        let Stepper { model, points, reached, terms, .. } = self;
        let links = &report.grid.links;
        let context = StepContext { model, links, step: report.step, factor: reached.progress.path.factor };
        terms.iter_mut().for_each(|term| term.commit(&context, points));
        points.commit();
    }

    /// Moves the corners of replaced domains out of obstacles.
    fn push_out_of_tools(&mut self, replaced: &[u32]) {
        let Stepper { model, points, terms, .. } = self;
        splitting::push_out_of_tools(model, points, terms, replaced);
    }

    /// Splits the points whose domains have become too long. The next step then begins as it would in a run resumed
    /// from this state.
    fn split_long_domains(&mut self) {
        let Stepper { model, points, reached, terms, .. } = self;
        splitting::split_long(model, points, terms, &mut reached.progress.splits);
    }

    /// True if bodies begin to slide in a step that is in equilibrium but not committed, and a smaller step can narrow
    /// down the strength factor at which they begin to slide; the smaller step is then attempted next.
    pub(super) fn hides_a_slide(&mut self, step: Step) -> bool {
        let (model, points) = (self.model, &*self.points);
        if model.stepping.strength_factor(step.end).is_none() {
            return false;
        }
        let movement = Movement::measured(model, points, step);
        let progress = &mut self.reached.progress;
        progress.strength_of(model.present.stage).begins_to_slide(movement)
            && progress.pace.halve(&model.stepping, step.start, step.end)
    }

    /// Reports that a smaller step replaces a converged step in which bodies begin to slide.
    pub(super) fn bisect(
        &mut self,
        report: StepReport<D>,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        self.links = report.grid.links;
        let step = report.step;
        let (model, points) = (self.model, &*self.points);
        let timings = &mut self.reached.summary.timings;
        let observed = timings.measure(Phase::Output, || observer.bisected(model, points, step));
        agree(&points.reduction(), observed.map_err(SolveError::Output))
    }

    /// Measures a converged step before it is committed.
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
            let movement = Movement::measured(model, points, report.step);
            let from = model.stepping.strength_factor(model.stepping.start_time).unwrap_or(factor);
            // Damped iterations never act while the strength is reduced, so damped steps precede the reduction.
            let Reached { progress, summary } = &mut self.reached;
            let slumped = summary.damped;
            let bracket = progress.strength_of(model.present.stage);
            let begun = bracket.begins(slumped, report.step.index);
            let slides = bracket.stood(factor, from, movement, report.step.index);
            summary.warnings.extend(begun.into_iter().chain(slides));
        }
        let Summary { quality, warnings, .. } = &mut self.reached.summary;
        if let Some(error) = self.equations.unreported_fallback()
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
                    "the iterative solver cannot solve the linear equations, so the stiffness matrix is factorised instead: \
                     {error}"
                ),
                detail: None,
            });
        }
    }
}
