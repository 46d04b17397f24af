//! One attempt at a load step: sections 5 and 6.3.

use crate::basis::{Connectivity, SupportError, SupportFailure};
use crate::model::{Body, Model, Predictor};
use crate::points::Points;
use crate::step::{Step, StepContext};
use crate::stress::Volumetric;
use crate::timing::Phase;

use super::agree::agree;
use super::attempt::{Attempt, Effort, FailedAttempt, Iterate, Slump};
use super::conclusion::LastIterate;
use super::course::{Course, Search};
use super::damping::{Damping, STRIDE};
use super::equations::Equations;
use super::error::SolveError;
use super::forcing::Forcing;
use super::observer::Observer;
use super::progress::{Progress, Reached};
use super::reach::reach_out;
use super::step_system::StepSystem;
use super::stepper::Stepper;
use super::summary::Summary;
use super::unknowns::Unknowns;

/// An attempt at a load step, from the converged state of the points, on a fresh grid.
pub(super) struct LoadStep<'a, const D: usize, const N: usize> {
    pub(super) context: StepContext<'a, D>,
    pub(super) points: &'a mut Points<D>,
    pub(super) system: StepSystem<D, N>,
    pub(super) unknowns: Unknowns<N>,
    pub(super) course: Course<N>,
    pub(super) forcing: Forcing,
    pub(super) damping: Option<Damping<N>>,
    pub(super) effort: Effort,
    pub(super) search: Search,
    /// Largest nodal displacement of damped iterations before the step continues on a fresh grid, [length]; infinite if
    /// the step must stay on its grid.
    pub(super) stride: f64,
    /// True if the last iterative increment was a prediction.
    pub(super) is_predicted: bool,
    /// True if the system has been laid out anew since the equations were prepared for it.
    pub(super) is_laid_out_anew: bool,
    pub(super) equations: &'a mut Equations<D, N>,
    pub(super) progress: &'a Progress,
    pub(super) summary: &'a mut Summary,
    pub(super) observer: &'a mut dyn Observer<D>,
}

impl<const D: usize, const N: usize> Stepper<'_, D, N> {
    /// Attempts one load step (section 6.3). Writes only the trial state. If bodies may slump, damped iterations stop
    /// when a node has moved by more than [`STRIDE`] cells; the step then continues on a fresh grid.
    pub(super) fn attempt(
        &mut self,
        step: Step,
        slump: Slump,
        effort: Effort,
        observer: &mut dyn Observer<D>,
    ) -> Result<Attempt<D>, Box<FailedAttempt<D>>> {
        let at_once = |error| FailedAttempt::at_once(step, error);
        let (model, old) = (self.model, self.old_links());
        // The grid is undeformed: S_vp and ∇S_vp are fixed for the step (section 3.1), as is the pattern of K unless
        // terms outgrow it.
        let link = || old.renew(model.grid.as_ref(), self.points, &model.methods());
        let linked = self.reached.summary.timings.measure(Phase::Basis, link);
        let links = self.complete_links(linked, step).map_err(at_once)?;
        let context = StepContext { model, links: &links, step, factor: self.reached.progress.path.factor };
        let mut load_step = self.begin(context, slump, effort, observer).map_err(at_once)?; // C, (29), pattern of K
        let ended = load_step.iterate(); // section 6.3
        let ended = ended.and_then(|ended| Ok((ended, load_step.move_points()?))); // section 6.4
        let mut last = load_step.into_last_iterate();
        let (points, reached) = (&*self.points, &self.reached);
        let concluded = ended.and_then(|ended| last.outcome(&context, points, reached, slump, ended));
        let outcome = concluded.map_err(|error| {
            let agreed = agree(links.halo().ranks(), Err::<(), _>(error));
            last.failed(&context, agreed.err().unwrap_or_else(SolveError::elsewhere))
        });
        self.terms = last.into_terms();
        self.with_links(outcome, links)
    }

    /// An outcome with the links that belong to its grid; if it shows no grid, the links are kept for the next attempt.
    fn with_links(
        &mut self,
        outcome: Result<Attempt<D>, Box<FailedAttempt<D>>>,
        links: Connectivity<D>,
    ) -> Result<Attempt<D>, Box<FailedAttempt<D>>> {
        match outcome {
            Ok(Attempt::Equilibrium(mut report, path)) => {
                report.grid.links = links;
                Ok(Attempt::Equilibrium(report, path))
            }
            Ok(Attempt::OnTheWay(way)) => {
                self.links = links;
                Ok(Attempt::OnTheWay(way))
            }
            Err(mut failed) => {
                failed.iterate = failed.iterate.map(|iterate| Iterate { links, ..iterate });
                Err(failed)
            }
        }
    }

    /// The links of the last step, whose memory is reused: those of the last report, if there is one.
    pub(super) fn old_links(&mut self) -> Connectivity<D> {
        let of_report = self.report.take().map(|report| report.grid.links);
        of_report.unwrap_or_else(|| std::mem::take(&mut self.links))
    }

    /// Adds the nodes that terms need to the links of all ranks.
    ///
    /// # Errors
    /// [`SolveError`] if a rank could not link its points, or a body requests F-bar without basis functions at cell
    /// centres.
    pub(super) fn complete_links(
        &mut self,
        linked: Result<Connectivity<D>, SupportFailure>,
        step: Step,
    ) -> Result<Connectivity<D>, SolveError> {
        let (model, points) = (self.model, &*self.points);
        let lacks_centre = |body: &Body| body.volumetric == Volumetric::FBar && !body.method.has_centres();
        let lacking = points.body.iter().position(|&body| lacks_centre(&model.bodies[body as usize]));
        let failure = lacking.map(|point| SupportFailure { point, error: SupportError::NoCentre });
        let linked = failure.map_or(linked, Err);
        let linked = linked.map_err(|failure| SolveError::unsupported(model, points, failure, step));
        reach_out(model, points, agree(&points.ranks, linked)?, &mut self.terms, step)
    }

    /// Begins an attempt, which owns the terms until it ends.
    fn begin<'a>(
        &'a mut self,
        context: StepContext<'a, D>,
        slump: Slump,
        effort: Effort,
        observer: &'a mut dyn Observer<D>,
    ) -> Result<LoadStep<'a, D, N>, SolveError> {
        let (points, fields, terms) = (&mut *self.points, &self.fields, &mut self.terms);
        let reached = &mut self.reached;
        let begin = || StepSystem::new(&context, points, &reached.progress, fields, terms);
        let system = reached.summary.timings.measure(Phase::SetUp, begin)?;
        let load_step = LoadStep::new(context, points, system, slump, &mut self.equations, reached, observer);
        Ok(LoadStep { effort, ..load_step })
    }
}

impl<'a, const D: usize, const N: usize> LoadStep<'a, D, N> {
    fn new(
        context: StepContext<'a, D>,
        points: &'a mut Points<D>,
        system: StepSystem<D, N>,
        slump: Slump,
        equations: &'a mut Equations<D, N>,
        reached: &'a mut Reached,
        observer: &'a mut dyn Observer<D>,
    ) -> Self {
        let StepContext { model, links, step, factor } = context;
        let mut unknowns = Unknowns::new(model, factor, links, system.sum.system().border.len());
        let Reached { progress, summary } = reached;
        let damped = progress.pace.is_damped();
        let uses_predictor =
            model.newton.predictor == Predictor::LastStep && !model.stepping.control.has_unknown_factor();
        if uses_predictor && !damped {
            unknowns.predicted = progress.path.motion.extrapolate(links, step);
        }
        let stride =
            if damped && slump.may_go_on() { STRIDE * smallest_cell(model, links) } else { f64::INFINITY };
        LoadStep {
            context,
            points,
            system,
            unknowns,
            course: Course::new(),
            forcing: Forcing::default(),
            damping: None,
            effort: Effort::Usual,
            search: Search::default(),
            stride,
            is_predicted: false,
            is_laid_out_anew: false,
            equations,
            progress,
            summary,
            observer,
        }
    }

    fn into_last_iterate(self) -> LastIterate<D, N> {
        LastIterate { system: self.system, unknowns: self.unknowns, course: self.course }
    }
}

/// Size of the smallest active cell, [length].
pub(super) fn smallest_cell<const D: usize>(model: &Model<D>, links: &Connectivity<D>) -> f64 {
    let sizes = links.active_cells().iter().map(|&cell| model.grid.size(cell as usize));
    links.halo().ranks().smallest(sizes.fold(f64::INFINITY, f64::min))
}
