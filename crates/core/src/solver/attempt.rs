//! How an attempt at a step ends: in equilibrium, on the way to it, or without.

use crate::basis::Connectivity;

use super::control::{NoPath, Path};
use super::error::SolveError;
use crate::equilibrium::Energy;
use crate::equilibrium::StepReport;
use crate::linear::LinearError;
use crate::step::{Nodal, Step};

/// How an attempt at a step has ended that has not failed.
pub(super) enum Attempt<const D: usize> {
    /// In equilibrium.
    Equilibrium(Box<StepReport<D>>, Path),
    /// Before it, where damped iterations have led the points so far that they need a fresh grid.
    OnTheWay(OnTheWay),
}

/// Whether bodies slump in an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slump {
    /// They may not.
    Forbidden,
    /// They may begin to.
    MayBegin,
    /// They do, and may go on.
    GoesOn,
    /// They do, and have to come to rest.
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

/// What has happened on the way to an equilibrium.
pub(super) struct OnTheWay {
    /// Work so far, and the energy of the last state.
    pub(super) energy: Energy,
    /// Permanent numbers of the points whose torn domains were replaced.
    pub(super) replaced_domains: Vec<u32>,
    /// Whether the points have come to rest in an equilibrium that is not stable.
    pub(super) is_at_rest: bool,
}

impl OnTheWay {
    /// All the way, of which this is the last part.
    pub(super) fn after(mut self, before: OnTheWay) -> OnTheWay {
        self.replaced_domains.extend(before.replaced_domains);
        OnTheWay { energy: self.energy.after(before.energy), ..self }
    }

    /// Adds the way to the account of the equilibrium that it has led to.
    pub(super) fn lead_to<const D: usize>(self, report: &mut StepReport<D>) {
        report.energy = report.energy.after(self.energy);
        report.replaced_domains.extend(self.replaced_domains);
        report.replaced_domains.sort_unstable();
        report.replaced_domains.dedup();
    }
}

/// The fields of the grid where the iterations of a failed step ended. They are not in equilibrium.
#[derive(Debug, Clone)]
pub struct Iterate<const D: usize> {
    /// The links of the step; tells which nodes are active.
    pub links: Connectivity<D>,
    /// Displacement increment of the active nodes, [length].
    pub delta_d: Nodal<D>,
    /// Out-of-balance force on the active nodes, [force]; that before the last iteration where it cannot be evaluated.
    pub out_of_balance: Nodal<D>,
}

/// A step that did not reach equilibrium.
#[non_exhaustive]
#[derive(Debug)]
pub struct FailedAttempt<const D: usize> {
    /// The step, as far as it should have led.
    pub step: Step,
    /// Why.
    pub error: SolveError,
    /// Whether a smaller step may have an equilibrium.
    pub may_succeed_if_smaller: bool,
    /// Residual of every evaluation.
    pub residuals: Vec<f64>,
    /// Iterations of the linear solver in all of them, none where it is direct.
    pub linear_iterations: usize,
    /// Load factor of the attempt, where there is one for all loads and prescribed motions, [-].
    pub load_factor: Option<f64>,
    /// Whether an iteration has met a stiffness that is not positive definite.
    pub indefinite: bool,
    /// Where the iterations ended, if they began.
    pub iterate: Option<Iterate<D>>,
}

impl<const D: usize> FailedAttempt<D> {
    /// An attempt that failed before its iterations: that has nothing to do with the size of the step.
    pub(super) fn at_once(step: Step, error: SolveError) -> Box<Self> {
        Box::new(FailedAttempt {
            step,
            error,
            may_succeed_if_smaller: false,
            residuals: Vec::new(),
            linear_iterations: 0,
            load_factor: None,
            indefinite: false,
            iterate: None,
        })
    }

    /// Whether its residual meets the tolerance, so that what comes after it has failed.
    pub(super) fn is_balanced(&self, tolerance: f64) -> bool {
        self.residuals.last().is_some_and(|residual| *residual <= tolerance)
    }

    /// Whether it met the tolerance, but points or their domains could not follow the grid.
    pub(super) fn has_lost_points(&self, tolerance: f64) -> bool {
        let of_points = matches!(
            self.error,
            SolveError::OffGrid { .. } | SolveError::Domain { .. } | SolveError::Collapsed { .. }
        );
        of_points && self.is_balanced(tolerance)
    }
}

/// How the iterations of a step have ended that have not failed. The points have moved with the grid, in the trial state.
pub(super) enum Ended {
    /// In equilibrium, which is stable if damped iterations have found it.
    Balanced {
        /// Permanent numbers of the points whose torn domains were replaced.
        replaced_domains: Vec<u32>,
    },
    /// Before equilibrium, or in one that is not stable: damped iterations need a fresh grid.
    Strayed {
        /// As above.
        replaced_domains: Vec<u32>,
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
