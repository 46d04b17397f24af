//! An attempt at a step: how it is made, and its outcome, which is equilibrium, progress towards it, or failure.

use crate::basis::Connectivity;
use crate::equilibrium::{Energy, StepReport};
use crate::linear::LinearError;
use crate::model::StiffnessUpdate;
use crate::ranks::Reduction;
use crate::step::{Experiment, Nodal, Step, StepContext};

use super::error::SolveError;
use super::stepping::control::{NoPath, Path};
use super::stepping::pace::Pace;

/// Largest number of linear solves in a thorough attempt, unless the settings allow more.
const MANY_ITERATIONS: usize = 50;
/// Ratio of the allowed number of damped iterations to the allowed number of undamped ones.
const MORE_ITERATIONS: usize = 10;

/// An attempt at a step: the step, and how its iterations are conducted.
#[derive(Clone, Copy)]
pub(super) struct Attempt<'a, const D: usize> {
    /// The step, on its grid.
    pub(super) context: StepContext<'a, D>,
    /// The step size, with the last resort in use.
    pub(super) pace: Pace,
    /// The effort of the iterations.
    pub(super) effort: Effort,
    /// The role of slumping.
    pub(super) slump: Slump,
    /// Largest nodal displacement of damped iterations before the step continues on a fresh grid, [length]; infinite if
    /// the step must stay on its grid.
    pub(super) stride: f64,
    /// Number of iterations of the previous step, 0 before the first one.
    pub(super) last_iterations: usize,
}

impl<const D: usize> Attempt<'_, D> {
    /// Largest residual of eq. (40) that counts as equilibrium, [-].
    pub(super) fn tolerance(&self) -> f64 {
        self.context.model.newton.tolerance
    }

    /// True if iterations are damped.
    pub(super) fn is_damped(&self) -> bool {
        self.pace.is_damped() && self.context.experiment.is_none()
    }

    /// True if line searches begin early.
    pub(super) fn searches_early(&self) -> bool {
        self.pace.has_failed() || self.effort != Effort::Usual
    }

    /// True if line searches follow increments that reduce the residual only little. While strength is reduced, most
    /// attempts that fail have no equilibrium, and more evaluations would not find one.
    pub(super) fn searches_often(&self) -> bool {
        let StepContext { model, step, .. } = self.context;
        self.pace.has_failed()
            && self.effort == Effort::Usual
            && model.stepping.strength_factor(step.end).is_none()
    }

    /// Largest number of linear solves in the attempt, counted anew after each multiplier update.
    pub(super) fn most_iterations(&self) -> usize {
        let asked = self.context.model.newton.max_iterations;
        let most = match self.effort {
            Effort::Usual | Effort::Experiment(_) => asked,
            Effort::Thorough => asked.max(MANY_ITERATIONS),
        };
        if self.is_damped() { MORE_ITERATIONS * most } else { most }
    }

    /// True if the stiffness may be kept from one iteration to the next.
    pub(super) fn may_keep_stiffness(&self) -> bool {
        self.effort == Effort::Usual && self.context.model.newton.tangent == StiffnessUpdate::Kept
    }

    /// Sums, extremes and decisions over the whole run.
    pub(super) fn reduction(&self) -> &Reduction {
        self.context.links.reduction()
    }
}

/// The outcome of an attempt that has not failed.
pub(super) enum Outcome<const D: usize> {
    /// The step is in equilibrium.
    Equilibrium(Box<StepReport<D>>, Path),
    /// Damped iterations have moved the points so far that a fresh grid is needed on the way to equilibrium.
    InProgress(InProgress),
}

/// The role of slumping in an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slump {
    /// Bodies must not slump.
    Forbidden,
    /// Bodies may begin to slump.
    MayBegin,
    /// Bodies are slumping and may continue.
    GoesOn,
    /// Bodies are slumping and must come to rest.
    Ends,
}

impl Slump {
    pub(super) fn may_go_on(self) -> bool {
        matches!(self, Slump::MayBegin | Slump::GoesOn)
    }

    pub(super) fn has_begun(self) -> bool {
        matches!(self, Slump::GoesOn | Slump::Ends)
    }
}

/// The effort of the iterations of an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Effort {
    /// The effort that the settings request.
    Usual,
    /// The stiffness is formed anew in every iteration, line searches begin early and many iterations are allowed, so
    /// that the settings do not decide whether equilibrium is found.
    Thorough,
    /// Changed equations, whose solution is not committed, show why a step has failed.
    Experiment(Experiment),
}

/// The account of a slump before it reaches equilibrium.
pub(super) struct InProgress {
    /// Work so far, and the energy of the last state.
    pub(super) energy: Energy,
    /// Permanent numbers of the points whose torn domains were replaced.
    pub(super) replaced_domains: Vec<u32>,
    /// True if the points have come to rest in an equilibrium that is not stable.
    pub(super) is_at_rest: bool,
}

impl InProgress {
    /// Prepends the account of the slump so far to this account.
    pub(super) fn after(mut self, before: InProgress) -> InProgress {
        self.replaced_domains.extend(before.replaced_domains);
        InProgress { energy: self.energy.after(before.energy), ..self }
    }

    /// Adds this account to the report of the equilibrium that the slump has reached.
    pub(super) fn lead_to<const D: usize>(self, report: &mut StepReport<D>) {
        report.energy = std::mem::take(&mut report.energy).after(self.energy);
        report.replaced_domains.extend(self.replaced_domains);
        report.replaced_domains.sort_unstable();
        report.replaced_domains.dedup();
    }
}

/// The grid fields at which the iterations of a failed step ended. They are not in equilibrium.
#[derive(Debug, Clone)]
pub struct Iterate<const D: usize> {
    /// The links of the step, which determine the active nodes.
    pub links: Connectivity<D>,
    /// Displacement increment of the active nodes, [length].
    pub delta_d: Nodal<D>,
    /// Out-of-balance force on the active nodes, [force]; if it cannot be evaluated, the force before the last
    /// iteration.
    pub out_of_balance: Nodal<D>,
}

/// A step that did not reach equilibrium.
#[non_exhaustive]
#[derive(Debug)]
pub struct FailedAttempt<const D: usize> {
    /// The step that was attempted.
    pub step: Step,
    /// The reason.
    pub error: SolveError,
    /// True if a smaller step may have an equilibrium.
    pub may_succeed_if_smaller: bool,
    /// True if the same step is attempted once more, with a fresh stiffness in every iteration and many iterations
    /// allowed.
    pub is_repeated: bool,
    /// Residual of every evaluation.
    pub residuals: Vec<f64>,
    /// Number of multiplier updates; after each, the residual is evaluated before the next linear solve.
    pub augmentations: usize,
    /// Number of iterations of the linear solver in the whole attempt; 0 for a direct solver.
    pub linear_iterations: usize,
    /// Load factor of the attempt, [-]; `None` unless all loads and prescribed motions share one.
    pub load_factor: Option<f64>,
    /// True if the stiffness of an iteration showed an instability; see
    /// [`Factorisation::shows_instability`](crate::linear::Factorisation::shows_instability).
    pub indefinite: bool,
    /// The fields at which the iterations ended; `None` if they did not begin, or if the points of a failed slump have
    /// been restored.
    pub iterate: Option<Iterate<D>>,
}

impl<const D: usize> FailedAttempt<D> {
    /// An attempt that failed before its first iteration, for a reason that does not depend on the step size.
    pub(super) fn at_once(step: Step, error: SolveError) -> Box<Self> {
        Box::new(FailedAttempt {
            step,
            error,
            may_succeed_if_smaller: false,
            is_repeated: false,
            residuals: Vec::new(),
            augmentations: 0,
            linear_iterations: 0,
            load_factor: None,
            indefinite: false,
            iterate: None,
        })
    }

    /// Replaces the reduction of the iterate's links and returns the previous one.
    pub(super) fn exchange_reduction(&mut self, reduction: Reduction) -> Reduction {
        match &mut self.iterate {
            Some(iterate) => iterate.links.exchange_reduction(reduction),
            None => Reduction::default(),
        }
    }

    /// Number of iterations: linear solves and, with a predictor, the predicted increment.
    pub fn solves(&self) -> usize {
        self.residuals.len().saturating_sub(1 + self.augmentations)
    }

    /// True if the last residual meets the tolerance, so that the attempt failed only after the iterations.
    pub(super) fn is_balanced(&self, tolerance: f64) -> bool {
        self.residuals.last().is_some_and(|residual| *residual <= tolerance)
    }

    /// True if the attempt met the tolerance, but points or their domains could not follow the grid.
    pub(super) fn has_lost_points(&self, tolerance: f64) -> bool {
        let has_lost_points = match &self.error {
            SolveError::OnRank(error) => error.has_lost_points,
            error => matches!(
                error,
                SolveError::OffGrid { .. } | SolveError::Domain { .. } | SolveError::Collapsed { .. }
            ),
        };
        has_lost_points && self.is_balanced(tolerance)
    }
}

/// The outcome of iterations that have not failed.
pub(super) enum Ended {
    /// The iterations reached equilibrium, which is stable if damped iterations found it.
    Balanced,
    /// Damped iterations need a fresh grid: they have found no equilibrium, or only an unstable one.
    Strayed {
        /// True if no node has moved farther than a stride.
        is_at_rest: bool,
    },
}

/// The reason why an iteration has no increment.
pub(super) enum NoIncrement {
    Linear(LinearError),
    Path(NoPath),
}

impl From<LinearError> for NoIncrement {
    fn from(error: LinearError) -> Self {
        NoIncrement::Linear(error)
    }
}
