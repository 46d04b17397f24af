//! Multipliers that are constant during Newton's iterations and are updated when these have converged.

use crate::assembly::System;
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};

use super::failure::EvaluateError;

/// Multipliers of a term that Newton's iterations hold constant: the forces of an augmented Lagrangian, or conditions
/// that are checked in equilibrium.
pub trait Multipliers<const D: usize, const N: usize = D> {
    /// Updates the multipliers once the iterations have converged at the unknowns of the last evaluation. After an
    /// update, the iterations continue.
    ///
    /// # Errors
    /// [`EvaluateError`] if the multipliers do not converge, or the state cannot be accepted.
    fn augment(
        &mut self,
        step: &StepContext<D>,
        points: &Points<D>,
        at: At<N>,
    ) -> Result<Augmentation, EvaluateError>;

    /// Updates the multipliers to their values at the end of an increment from the unknowns of the last evaluation,
    /// according to the linearised equations, if this is possible without a change of state. Adds the resulting
    /// change of the equations to `_added`; the solver adds the response to this change to the increment. `_update` is
    /// the number of previous updates along this increment.
    fn augment_along(&mut self, _increment: At<N>, _update: usize, _added: &mut Response<N>) -> Augmentation {
        Augmentation::Satisfied
    }

    /// Withdraws the updates along the last increment, which is about to be shortened.
    fn withdraw(&mut self) {}

    /// Replaces conditions that keep the iterations from converging by simpler ones for the rest of the step, at the last
    /// evaluation; false if there are none, or if they have been replaced already. The multipliers are final only once
    /// the solution satisfies the original conditions, too, up to what the documentation of the term states.
    fn hold(&mut self, _step: &StepContext<D>) -> bool {
        false
    }

    /// Adds stiffness, at the last evaluation, where the state of the term leaves bodies without resistance; returns
    /// true if it added any. This changes only the path of the iterations, not the solution.
    fn support(&self, _sum: &mut System<N>) -> bool {
        false
    }
}

/// The state of the multipliers of a term when Newton's iterations have converged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Augmentation {
    /// The multipliers are final.
    Satisfied,
    /// The multipliers have changed: the state is no longer in equilibrium.
    Updated,
}

/// What a change of multipliers adds to the equations.
#[derive(Debug, Clone)]
pub struct Response<const N: usize> {
    n_nodes: usize,
    /// The external force on the active nodes, [force]; empty until a term requests it.
    pub(crate) force: Nodal<N>,
    /// The residuals of the global equations of all terms.
    pub(crate) globals: Vec<f64>,
    /// Index of the first global unknown of the term that is currently processed.
    pub(crate) first: usize,
}

impl<const N: usize> Response<N> {
    /// An empty response for this number of active nodes and global unknowns.
    pub(crate) fn new(n_nodes: usize, n_globals: usize) -> Self {
        Response { n_nodes, force: Vec::new(), globals: vec![0.0; n_globals], first: 0 }
    }

    /// The external force on the active nodes, [force], to which a term adds its own.
    pub fn force_mut(&mut self) -> &mut [[f64; N]] {
        self.force.resize(self.n_nodes, [0.0; N]);
        &mut self.force
    }

    /// Adds to the residual of global equation `i` of the term.
    pub fn add_residual(&mut self, i: usize, residual: f64) {
        self.globals[self.first + i] += residual;
    }
}
