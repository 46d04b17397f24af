//! One attempt at a load step: sections 5 and 6.3.

use crate::basis::{Connectivity, SupportError, SupportFailure};
use crate::model::{Body, Model, Predictor};
use crate::step::{Step, StepContext, displacement};
use crate::stress::CellStrain;
use crate::timing::Phase;

use super::attempt::{Attempt, Effort, FailedAttempt, Iterate, Outcome, Slump};
use super::collective::{agree, reach_out};
use super::conclusion::LastIterate;
use super::course::Course;
use super::damping::STRIDE;
use super::error::SolveError;
use super::line_search::Search;
use super::newton::LoadStep;
use super::observer::Observer;
use super::progress::{Progress, Reached};
use super::step_system::StepSystem;
use super::stepper::Stepper;
use super::unknowns::Unknowns;
use super::update::move_points;

impl<const D: usize, const N: usize> Stepper<'_, D, N> {
    /// Attempts one load step (section 6.3). Writes only the trial state. If bodies may slump, damped iterations stop
    /// when a node has moved by more than [`STRIDE`] cells; the step then continues on a fresh grid.
    pub(super) fn attempt(
        &mut self,
        step: Step,
        slump: Slump,
        effort: Effort,
        observer: &mut dyn Observer<D>,
    ) -> Result<Outcome<D>, Box<FailedAttempt<D>>> {
        let at_once = |error| FailedAttempt::at_once(step, error);
        // The grid is undeformed: S_vp and ∇S_vp are fixed for the step (section 3.1), as is the pattern of K unless
        // terms outgrow it.
        let links = self.link(step).map_err(at_once)?;
        let attempt = Attempt::new(self.model, &links, step, &self.reached.progress, slump, effort);
        let mut load_step = self.begin(attempt, observer).map_err(at_once)?; // C, (29), pattern of K
        let ended = load_step.iterate(); // section 6.3
        let mut last = load_step.into_last_iterate();
        let moved = ended.and_then(|ended| Ok((ended, self.move_points(&last)?))); // section 6.4
        let (points, reached) = (&*self.points, &self.reached);
        let concluded = moved.and_then(|(ended, replaced)| last.outcome(points, reached, ended, replaced));
        let outcome = concluded.map_err(|error| {
            let agreed = agree(links.reduction(), Err::<(), _>(error));
            last.failed(agreed.err().unwrap_or_else(SolveError::elsewhere))
        });
        self.terms = last.into_terms();
        self.with_links(outcome, links)
    }

    /// Links the points with the grid, and adds the nodes that terms need to the links of all ranks.
    ///
    /// # Errors
    /// [`SolveError`] if a rank could not link its points, or a body requests F-bar without basis functions at cell
    /// centres.
    pub(super) fn link(&mut self, step: Step) -> Result<Connectivity<D>, SolveError> {
        let (model, old) = (self.model, self.old_links());
        let old = old.with_body_groups(&model.body_groups.of_body);
        let link = || old.renew(model.grid.as_ref(), self.points, &model.methods());
        let linked = self.reached.summary.timings.measure(Phase::Basis, link);
        let points = &*self.points;
        let lacks_centre = |body: &Body| body.strain == CellStrain::FBar && !body.method.has_centres();
        let lacking = points.body.iter().position(|&body| lacks_centre(&model.bodies[body as usize]));
        let failure = lacking.map(|point| SupportFailure { point, error: SupportError::NoCentre });
        let linked = failure.map_or(linked, Err);
        let linked = linked.map_err(|failure| SolveError::unsupported(model, points, failure, step));
        reach_out(model, points, agree(&points.reduction(), linked)?, &mut self.terms, step)
    }

    /// The links of the last step, whose memory is reused: those of the last report, if there is one.
    fn old_links(&mut self) -> Connectivity<D> {
        let reported = self.report.take().map(|report| report.grid.links);
        reported.unwrap_or_else(|| std::mem::take(&mut self.links))
    }

    /// Begins an attempt, which owns the terms until it ends: sets up the equations, and predicts the first increment.
    fn begin<'s, 'a>(
        &'s mut self,
        attempt: Attempt<'a, D>,
        observer: &'s mut dyn Observer<D>,
    ) -> Result<LoadStep<'s, 'a, D, N>, SolveError> {
        let (points, fields, terms) = (&mut *self.points, &self.fields, &mut self.terms);
        let Reached { progress, summary } = &mut self.reached;
        let begin = || StepSystem::new(&attempt.context, points, progress, fields, terms);
        let system = summary.timings.measure(Phase::SetUp, begin)?;
        let StepContext { model, links, step, factor, .. } = attempt.context;
        let mut unknowns = Unknowns::new(model, factor, links, system.sum.system().border.len());
        let uses_predictor =
            model.newton.predictor == Predictor::LastStep && !model.stepping.control.has_unknown_factor();
        if uses_predictor && !attempt.is_damped() {
            unknowns.predicted = progress.path.motion.extrapolate(links, step);
        }
        Ok(LoadStep {
            attempt,
            points,
            system,
            unknowns,
            course: Course::new(),
            search: Search::default(),
            damping: None,
            equations: &mut self.equations,
            summary,
            observer,
        })
    }

    /// Moves the points with the grid, section 6.4; returns the permanent numbers of the points whose domains were
    /// replaced.
    fn move_points(&mut self, last: &LastIterate<'_, D, N>) -> Result<Vec<u32>, SolveError> {
        let (context, pace) = (&last.attempt.context, last.attempt.pace);
        let points = &mut *self.points;
        self.reached.summary.timings.measure(Phase::Update, || {
            move_points(context, points, &displacement(&last.unknowns.delta_d), pace.is_last_resort())
        })
    }

    /// An outcome with the links that belong to its grid; if it shows no grid, the links are kept for the next attempt.
    fn with_links(
        &mut self,
        outcome: Result<Outcome<D>, Box<FailedAttempt<D>>>,
        links: Connectivity<D>,
    ) -> Result<Outcome<D>, Box<FailedAttempt<D>>> {
        match outcome {
            Ok(Outcome::Equilibrium(mut report, path)) => {
                report.grid.links = links;
                Ok(Outcome::Equilibrium(report, path))
            }
            Ok(Outcome::InProgress(way)) => {
                self.links = links;
                Ok(Outcome::InProgress(way))
            }
            Err(mut failed) => {
                failed.iterate = failed.iterate.map(|iterate| Iterate { links, ..iterate });
                Err(failed)
            }
        }
    }
}

impl<'a, const D: usize> Attempt<'a, D> {
    fn new(
        model: &'a Model<D>,
        links: &'a Connectivity<D>,
        step: Step,
        progress: &Progress,
        slump: Slump,
        effort: Effort,
    ) -> Self {
        let Progress { pace, path, last_iterations, .. } = progress;
        let experiment = match effort {
            Effort::Experiment(experiment) => Some(experiment),
            Effort::Usual | Effort::Thorough => None,
        };
        let growth = pace.viscosity().filter(|_| experiment.is_none());
        let viscosity = growth.map_or(0.0, |growth| model.stepping.viscous_weight(growth, step.duration()));
        let may_stray = pace.is_damped() && slump.may_go_on();
        Attempt {
            context: StepContext { model, links, step, factor: path.factor, viscosity, experiment },
            pace: *pace,
            effort,
            slump,
            stride: if may_stray { STRIDE * smallest_cell(model, links) } else { f64::INFINITY },
            last_iterations: *last_iterations,
        }
    }
}

/// Size of the smallest active cell, [length].
pub(super) fn smallest_cell<const D: usize>(model: &Model<D>, links: &Connectivity<D>) -> f64 {
    let sizes = links.active_cells().iter().map(|&cell| model.grid.size(cell as usize));
    links.reduction().smallest(sizes.fold(f64::INFINITY, f64::min))
}
