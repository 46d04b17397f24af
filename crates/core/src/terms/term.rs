//! The interface between Newton's method and a term of equilibrium.

use crate::assembly::{System, Wanted};
use crate::dofs::{ConstraintError, Constraints, DofMap};
use crate::model::Model;
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};

use super::attached::{Attached, Obstacle};
use super::failure::{BeginError, EvaluateError};
use super::global_unknowns::GlobalUnknowns;
use super::layout::Layout;
use super::ledger::Ledger;
use super::multipliers::Multipliers;
use super::report::TermReport;
use super::saved::Saved;

/// What the iterations must know about a term. The answers must be the same on all ranks, even if only some have points
/// on which the term acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Character {
    /// True if the stiffness of the term is symmetric. If an evaluation makes it unsymmetric, the system of the step is
    /// laid out anew.
    pub is_symmetric: bool,
    /// True if parts may touch an obstacle or leave it within a step, so that even the first increments overshoot; the
    /// line search then makes more trials and begins with the first increment. The milder kinks of yielding do not
    /// count.
    pub has_kinks: bool,
    /// True if the force derives from a potential, at least approximately: an indefinite stiffness then shows that an
    /// equilibrium is unstable. Friction has no potential.
    pub has_potential: bool,
    /// True if the bodies may slump under the term: damped iterations then carry the points from one fresh grid to the
    /// next before the step is in equilibrium. [`Term::begin`] is called on each of these grids, and [`Term::commit`]
    /// only at the end. A term must not allow this if its state has to follow the points from grid to grid, if it
    /// prescribes increments (they would be applied on every grid), or if it exerts a load that the bodies may be
    /// unable to carry.
    pub may_slump: bool,
    /// True if the term can hold parts of the bodies that no boundary condition holds. Only the stiffness shows whether
    /// it does.
    pub may_hold: bool,
}

impl Character {
    /// The character of a smooth force with a potential and a symmetric stiffness, which holds nothing.
    pub const SMOOTH: Character = Character {
        is_symmetric: true,
        has_kinks: false,
        has_potential: true,
        may_slump: false,
        may_hold: false,
    };
}

/// What a term couples in addition to nodes that share a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coupled<'a> {
    /// Active nodes, ascending, that the term couples with each other.
    Nodes(&'a [u32]),
    /// All nodes of a group of points, by the number of the group.
    Group(usize),
}

/// A term of equilibrium.
///
/// A step calls [`constrain`](Term::constrain), then [`begin`](Term::begin) once, then
/// [`follow_constraints`](Term::follow_constraints), then [`couples`](Term::couples), then
/// [`evaluate`](Term::evaluate) as often as needed, and [`commit`](Term::commit) once the step is in equilibrium. An
/// abandoned step ends without a call: a term must not change the state that it keeps between steps before
/// [`commit`](Term::commit).
///
/// What only some terms have, they offer through traits of their own: [`multipliers`](Term::multipliers),
/// [`global_unknowns`](Term::global_unknowns), [`attached`](Term::attached), [`obstacle`](Term::obstacle) and
/// [`layout`](Term::layout).
///
/// With several ranks, each rank has the term and its own points, and adds their contributions; the sum over the ranks
/// follows. All ranks call the same methods in the same order. If a term itself exchanges messages, a rank that has
/// found an error must not return before the other ranks have received their messages.
///
/// There are `D` axes and `N` components at each node; the first `D` components are the displacement.
pub trait Term<const D: usize, const N: usize = D>: Send {
    /// Name in errors and checkpoints.
    fn name(&self) -> &'static str;

    /// What the iterations must know about the term in its present state.
    fn character(&self, model: &Model<D>) -> Character;

    /// Begins a step from the converged state of the points.
    ///
    /// # Errors
    /// [`BeginError`] if the term cannot begin the step.
    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError>;

    /// Called after [`begin`](Term::begin) with the constraints of the step, for terms that solve equations of their own
    /// at the nodes.
    fn follow_constraints(&mut self, _dofs: &DofMap<N>) {}

    /// Calls `couple` with each list of nodes that the term couples in this step, in addition to nodes that share a
    /// point.
    fn couples(&self, _couple: &mut dyn FnMut(Coupled)) {}

    /// Adds constraints on the active nodes of a step: prescribed values of an additional field, or ties. The term names
    /// its conditions, by whose names reactions are reported, with [`Constraints::condition`].
    ///
    /// # Errors
    /// [`ConstraintError`] if the constraints contradict other constraints.
    fn constrain(
        &self,
        _step: &StepContext<D>,
        _points: &Points<D>,
        _constraints: &mut Constraints<N>,
    ) -> Result<(), ConstraintError> {
        Ok(())
    }

    /// Adds the force of the term at these unknowns, either to the internal or to the external force of `sum`, and, if
    /// wanted, its stiffness ∂(f^int − f^ext)/∂Δd. The term may change only the trial state of the points.
    ///
    /// # Errors
    /// [`EvaluateError`] if the term cannot be evaluated, for example because a point cannot follow the increment.
    fn evaluate(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError>;

    /// Adds to `force`, on the active nodes, the external force of the state from which the step starts, [force].
    fn force_at_start(&self, _force: &mut Nodal<N>) {}

    /// Work and energy at the end of the step, which is in equilibrium at these unknowns but not yet committed.
    fn ledger(&self, _step: &StepContext<D>, _points: &Points<D>, _at: At<N>) -> Ledger {
        Ledger::default()
    }

    /// By how much the step is too long for the term, although it is in equilibrium at these unknowns: its error relative
    /// to the error that the term may have, [-]. Above 1, the step is repeated in halves where it may be cut; all ranks
    /// return the same number.
    fn excess(&self, _step: &StepContext<D>, _points: &Points<D>, _at: At<N>) -> f64 {
        0.0
    }

    /// Adds what the term reports of the step, at the last evaluation.
    fn report(&self, _model: &Model<D>, _report: &mut TermReport<D>) {}

    /// Called when the step is in equilibrium, before the trial state of the points becomes their converged state: the
    /// next step starts at the end of this one. The term may complete its own fields in the trial state.
    fn commit(&mut self, _step: &StepContext<D>, _points: &mut Points<D>) {}

    /// The state that a checkpoint must store in addition to the points; `None` if there is none.
    fn save(&self) -> Option<Saved> {
        None
    }

    /// Restores the state that [`save`](Term::save) returned.
    ///
    /// # Errors
    /// The reason why the state cannot be restored.
    fn restore(&mut self, _saved: &serde_json::Value) -> Result<(), String> {
        Err("it has no state to restore".to_owned())
    }

    /// The multipliers that are constant during the iterations, if the term has any.
    fn multipliers(&mut self) -> Option<&mut dyn Multipliers<D, N>> {
        None
    }

    /// The unknowns that belong to no node, if the term has any.
    fn global_unknowns(&self) -> Option<&dyn GlobalUnknowns<D>> {
        None
    }

    /// The places on the bodies to which the term is attached, if there are any.
    fn attached(&mut self) -> Option<&mut dyn Attached<D>> {
        None
    }

    /// The obstacle that the term is for the bodies, if it is one.
    fn obstacle(&self) -> Option<&dyn Obstacle<D>> {
        None
    }

    /// What the term keeps about the system of the step, if it keeps anything.
    fn layout(&mut self) -> Option<&mut dyn Layout> {
        None
    }
}
