//! The interface between Newton's method and a term of equilibrium.

use crate::assembly::{System, Wanted};
use crate::basis::Connectivity;
use crate::model::Model;
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};
use crate::surface::SurfaceFields;

use super::contact::ToolState;
use super::failure::{BeginError, EvaluateError};
use super::saved::Saved;
use crate::dofs::{ConstraintError, Constraints};

/// A force on the bodies, and the name under which it is reported.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedForce<const D: usize> {
    /// Name of the force.
    pub name: String,
    /// Force, [force].
    pub force: [f64; D],
}

/// A component of a motion that is a global unknown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct GlobalMotion {
    /// Number of the unknown among the global unknowns of its term.
    pub number: usize,
    /// Name of what moves: of a rigid tool of the model, or another name that no tool has.
    pub of: String,
    /// Number of the component of the motion: the translations along the axes, then the rotations about x, y and z.
    pub component: usize,
    /// True if equilibrium alone determines the motion; false if the motion follows from the load factor.
    pub is_free: bool,
}

/// The reaction that a boundary condition of the model, imposed on a surface, exerts on the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceReaction<const D: usize> {
    /// Number of the condition.
    pub condition: usize,
    /// Force, [force].
    pub force: [f64; D],
    /// The mean position of the surface at the end of the step, [length].
    pub about: [f64; D],
    /// Moment of the force about this position and the axes x, y and z, [force·length].
    pub moment: [f64; 3],
}

/// A term of equilibrium.
///
/// A step calls [`constrain`](Term::constrain), then [`begin`](Term::begin) once, then [`couples`](Term::couples), then
/// [`evaluate`](Term::evaluate) as often as needed, with [`augment`](Term::augment) whenever the iterations have
/// converged, and [`commit`](Term::commit) once the step is in equilibrium. An abandoned step ends without a call: a
/// term must not change the state that it keeps between steps before [`commit`](Term::commit).
///
/// With several ranks, each rank has the term and its own points, and adds their contributions; the sum over the ranks
/// follows. All ranks call the same methods in the same order. If a term itself exchanges messages, a rank that has
/// found an error must not return before the other ranks have received their messages.
///
/// There are `D` axes and `N` components at each node; the first `D` components are the displacement.
pub trait Term<const D: usize, const N: usize = D>: Send {
    /// Name in errors and checkpoints.
    fn name(&self) -> &'static str;

    /// True if the stiffness of the term is symmetric. If an evaluation makes it unsymmetric, the system of the step is
    /// laid out anew.
    fn is_symmetric(&self, step: &StepContext<D>) -> bool;

    /// True if parts may touch an obstacle or leave it within a step, so that even the first increments overshoot; the
    /// line search then makes more trials and begins with the first increment. The milder kinks of yielding do not
    /// count. The answer must be the same on all ranks, even if only some have points that touch.
    fn has_kinks(&self) -> bool {
        false
    }

    /// True if the force derives from a potential, at least approximately: an indefinite stiffness then shows that an
    /// equilibrium is unstable. Friction has no potential. The answer must be the same on all ranks.
    fn has_potential(&self, _model: &Model<D>) -> bool {
        true
    }

    /// True if the bodies may slump under the term: damped iterations then carry the points from one fresh grid to the
    /// next before the step is in equilibrium. [`begin`](Term::begin) is called on each of these grids, and
    /// [`commit`](Term::commit) only at the end. A term must not allow this if its state has to follow the points from
    /// grid to grid, if it prescribes increments (they would be applied on every grid), or if it exerts a load that the
    /// bodies may be unable to carry. The answer must be the same on all ranks.
    fn may_slump(&self, _model: &Model<D>) -> bool {
        false
    }

    /// True if the term can hold parts of the bodies that no boundary condition holds. Only the stiffness shows whether
    /// it does. The answer must be the same on all ranks.
    fn may_hold(&self) -> bool {
        false
    }

    /// Grid nodes that the term needs on this rank in addition to the nodes of `links`. Called before
    /// [`begin`](Term::begin), only if there are several ranks, and then on all ranks.
    ///
    /// # Errors
    /// [`BeginError`] if the term cannot begin the step.
    fn reach(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _links: &Connectivity<D>,
    ) -> Result<Vec<u32>, BeginError> {
        Ok(Vec::new())
    }

    /// Begins a step from the converged state of the points.
    ///
    /// # Errors
    /// [`BeginError`] if the term cannot begin the step.
    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError>;

    /// True if the term couples all nodes of a group of points with each other, not only those that share a point.
    fn couples_group(&self, _group: usize) -> bool {
        false
    }

    /// Calls `couple` with each list of active nodes, ascending, that the term couples with each other in this step, in
    /// addition to nodes that share a point.
    fn couples(&self, _couple: &mut dyn FnMut(&[u32])) {}

    /// True if the term couples more nodes than when the system was laid out; [`couples`](Term::couples) then lists
    /// these nodes, too.
    fn outgrows(&self) -> bool {
        false
    }

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

    /// Number of global unknowns of the term, such as the motions of a rigid body; their increments start each step at
    /// 0.
    fn n_globals(&self) -> usize {
        0
    }

    /// Those global unknowns of the term that are motions, by name. If the displacement of a tool determines the load,
    /// its unknown is found here, and if nothing resists the free ones, an error names them.
    fn motions(&self, _model: &Model<D>) -> Vec<GlobalMotion> {
        Vec::new()
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

    /// Updates multipliers that are constant during Newton's iterations, once these have converged at the unknowns of
    /// the last evaluation. After an update, the iterations continue.
    ///
    /// # Errors
    /// [`EvaluateError`] if the multipliers do not converge, or the state cannot be accepted.
    fn augment(
        &mut self,
        _step: &StepContext<D>,
        _points: &Points<D>,
        _at: At<N>,
    ) -> Result<Augmentation, EvaluateError> {
        Ok(Augmentation::Satisfied)
    }

    /// Updates multipliers to their values at the end of an increment from the unknowns of the last evaluation,
    /// according to the linearised equations, if this is possible without a change of state. Adds the resulting
    /// change of the equations to `_added`; the solver adds the response to this change to the increment. `_update` is
    /// the number of previous updates along this increment.
    fn augment_along(&mut self, _increment: At<N>, _update: usize, _added: &mut Response<N>) -> Augmentation {
        Augmentation::Satisfied
    }

    /// Adds stiffness, at the last evaluation, where the state of the term leaves bodies without resistance; returns
    /// true if it added any. This changes only the path of the iterations, not the solution.
    fn support(&self, _sum: &mut System<N>) -> bool {
        false
    }

    /// Withdraws the updates along the last increment, which is about to be shortened.
    fn withdraw_augmentation(&mut self) {}

    /// Adds to `force`, on the active nodes, the external force of the state from which the step starts, [force].
    fn force_at_start(&self, _force: &mut Nodal<N>) {}

    /// Work and energy at the end of the step, which is in equilibrium at these unknowns but not yet committed.
    fn ledger(&self, _step: &StepContext<D>, _points: &Points<D>, _at: At<N>) -> Ledger {
        Ledger::default()
    }

    /// Adds what the term reports of the step, at the last evaluation.
    fn report(&self, _model: &Model<D>, _report: &mut TermReport<D>) {}

    /// The position nearest to `place`, [length], that the body can occupy at the last commit: outside all obstacles.
    fn nearest_allowed(&self, _model: &Model<D>, _body: usize, place: [f64; D]) -> [f64; D] {
        place
    }

    /// Called when the system has been laid out anew: indices of blocks are no longer valid.
    fn forget_layout(&mut self) {}

    /// Frees memory that only further evaluations of the step would need.
    fn conclude(&mut self) {}

    /// Called when the step is in equilibrium: the next step starts at its end.
    fn commit(&mut self) {}

    /// Discards what the term keeps from earlier steps about bodies that a stage removes: if they are added again, in
    /// this stage or later, they begin anew. Called between two stages, after [`restore`](Term::restore).
    fn forget_bodies(&mut self, _model: &Model<D>, _removed: &[usize]) {}

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
}

/// What the terms report of a step.
#[derive(Debug, Clone, Default)]
pub struct TermReport<const D: usize> {
    /// Resultants of the loads of the model, in their order, of the points of this rank, [force].
    pub(crate) loads: Vec<[f64; D]>,
    /// Further forces on the bodies.
    pub(crate) forces: Vec<NamedForce<D>>,
    /// Reactions, on all ranks, of the boundary conditions of the model that are imposed on surfaces.
    pub(crate) reactions: Vec<SurfaceReaction<D>>,
    /// The surfaces of the model on all ranks, in order.
    pub(crate) surfaces: Vec<SurfaceFields<D>>,
    /// The rigid tools of the model on all ranks, in order.
    pub(crate) tools: Vec<ToolState<D>>,
    /// Number of faces between cells that are stabilised on this rank.
    pub(crate) stabilised_faces: usize,
}

impl<const D: usize> TermReport<D> {
    /// Resultants of the loads of the model, in their order, of the points of this rank, [force].
    pub fn loads(&self) -> &[[f64; D]] {
        &self.loads
    }

    /// Further forces on the bodies, on this rank.
    pub fn forces(&self) -> &[NamedForce<D>] {
        &self.forces
    }

    /// Adds to the resultant of a load of the model what the term applies on this rank, [force]; a number that no load
    /// has is ignored.
    pub fn add_to_load(&mut self, load: usize, force: [f64; D]) {
        if let Some(sum) = self.loads.get_mut(load) {
            (0..D).for_each(|d| sum[d] += force[d]);
        }
    }

    /// Adds a further force on the bodies, reported under this name; for example, the force from a wall. A term states
    /// the force on this rank, [force], and the same names in the same order on all ranks. Forces of the same name are
    /// added up.
    pub fn add_force(&mut self, name: &str, force: [f64; D]) {
        match self.forces.iter_mut().find(|named| named.name == name) {
            Some(named) => (0..D).for_each(|d| named.force[d] += force[d]),
            None => self.forces.push(NamedForce { name: name.to_owned(), force }),
        }
    }
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

/// The state of the multipliers of a term when Newton's iterations have converged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Augmentation {
    /// The multipliers are final.
    Satisfied,
    /// The multipliers have changed: the state is no longer in equilibrium.
    Updated,
}

/// The contributions of a term to the energy balance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Ledger {
    /// Stored energy, [energy].
    pub stored: f64,
    /// Plastic work since the start of the analysis, [energy].
    pub plastic: f64,
    /// Part of the growth of `plastic` in this step that is not actual work, [energy]: the plastic work of a law
    /// follows from its history variables at full strength, but the strength was reduced.
    pub undone: f64,
    /// Work during the step that is lost in the next one, [energy].
    pub lost: f64,
    /// Energy dissipated by friction during the step, [energy]: work of the tools that does not reach the bodies.
    pub friction: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reported_forces_add_up() {
        let mut report = TermReport::<2> { loads: vec![[1.0, 2.0]], ..TermReport::default() };
        report.add_to_load(0, [0.5, -2.0]);
        report.add_to_load(1, [9.0; 2]);
        assert_eq!(report.loads(), [[1.5, 0.0]]);
        report.add_force("wall", [1.0, 0.0]);
        report.add_force("anchor", [0.0, 1.0]);
        report.add_force("wall", [1.0, 3.0]);
        let found: Vec<_> = report.forces().iter().map(|named| (named.name.as_str(), named.force)).collect();
        assert_eq!(found, [("wall", [2.0, 3.0]), ("anchor", [0.0, 1.0])]);
    }
}
