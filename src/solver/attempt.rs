//! A step that did not reach equilibrium.

use crate::basis::Connectivity;

use super::{Nodal, SolveError, Step};

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
