//! What Newton's method knows of a part of equilibrium.

use crate::assembly::{System, Wanted};
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};

use super::failure::{LoadNotFinite, PointFailure};
use crate::dofs::{ConstraintError, Constraints};

/// A force on the bodies with the name under which it is reported.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedForce<const D: usize> {
    /// Name.
    pub name: String,
    /// Force, [force].
    pub force: [f64; D],
}

/// The first number of a condition that is not one of the model.
pub const FURTHER: usize = 1 << 15;

/// A part of equilibrium.
///
/// A step calls [`begin`](Term::begin) once, then [`couples`](Term::couples), then [`evaluate`](Term::evaluate) as often as it
/// needs, and [`commit`](Term::commit) where it has reached equilibrium. A step that is given up ends without a call: nothing
/// but what a term keeps until [`commit`](Term::commit) may outlast it.
///
/// There are `D` axes and `N` components at each node, of which the first `D` are the displacement.
pub trait Term<const D: usize, const N: usize = D>: Send {
    /// Name, as errors and checkpoints have it.
    fn name(&self) -> &'static str;

    /// Whether its stiffness is symmetric.
    fn is_symmetric(&self, step: &StepContext<D>) -> bool;

    /// Whether it may hold parts of the bodies that no boundary condition holds. Whether it does shows in the stiffness only.
    fn may_hold(&self) -> bool {
        false
    }

    /// Begins a step, from the converged state of the points.
    ///
    /// # Errors
    /// [`LoadNotFinite`] of a force that has no finite value.
    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), Box<LoadNotFinite>>;

    /// Calls `couple` with lists of active nodes, ascending, all of which it couples with each other in this step, beside the
    /// nodes that share a group of points.
    fn couples(&self, _couple: &mut dyn FnMut(&[u32])) {}

    /// Adds constraints on the active nodes of a step: prescribed values of a further field, or ties. The numbers of its
    /// conditions begin with [`FURTHER`]; no reactions are reported of them.
    ///
    /// # Errors
    /// [`ConstraintError`] where they contradict others.
    fn constrain(
        &self,
        _step: &StepContext<D>,
        _points: &Points<D>,
        _constraints: &mut Constraints<N>,
    ) -> Result<(), ConstraintError> {
        Ok(())
    }

    /// Number of global unknowns that it has, such as the motions of a rigid body; their increments start each step at 0.
    fn n_globals(&self) -> usize {
        0
    }

    /// Adds its force, and if wanted its stiffness, at these unknowns. Of the points it writes the trial state only.
    ///
    /// # Errors
    /// The first point that could not follow the increment.
    fn evaluate(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), PointFailure>;

    /// Adds the external force of the state that the step starts from to `force` on the active nodes, [force].
    fn force_at_start(&self, _force: &mut Nodal<N>) {}

    /// Work and energy at the end of the step, which is in equilibrium at these unknowns and not committed.
    fn ledger(&self, _step: &StepContext<D>, _points: &Points<D>, _at: At<N>) -> Ledger {
        Ledger::default()
    }

    /// The resultants of the loads of the model on the bodies, in their order, by the term that applies them, [force]. Reports
    /// give them by name.
    fn resultants(&self) -> &[[f64; D]] {
        &[]
    }

    /// Further forces on the bodies that reports give by name, [force], such as that of a wall; at the last evaluation.
    fn named_forces(&self) -> Vec<NamedForce<D>> {
        Vec::new()
    }

    /// Number of faces between cells that it stabilises.
    fn stabilised_faces(&self) -> usize {
        0
    }

    /// Frees what only further evaluations of the step would need.
    fn conclude(&mut self) {}

    /// The step is in equilibrium: its end is where the next one starts.
    fn commit(&mut self) {}

    /// What a checkpoint has to hold of it beside the points; none where the converged state says all.
    fn save(&self) -> Option<serde_json::Value> {
        None
    }

    /// Goes on from what [`save`](Term::save) has given.
    ///
    /// # Errors
    /// Why that cannot be.
    fn restore(&mut self, _saved: &serde_json::Value) -> Result<(), String> {
        Err("it keeps nothing".to_owned())
    }
}

/// The parts of the balance of energy that a term knows.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Ledger {
    /// Stored energy, [energy].
    pub stored: f64,
    /// Work that has gone into plastic flow since the start of the analysis, [energy].
    pub plastic: f64,
    /// Work over the step that the next one forgets, [energy].
    pub lost: f64,
}
