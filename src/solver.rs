//! The analysis: load steps and, within each, Newton iterations to equilibrium (sections 5 and 6.3).

mod equations;
mod error;
mod forcing;
mod report;
mod update;

use serde::{Deserialize, Serialize};

use crate::assembly::System;
use crate::basis::{Connectivity, Method};
use crate::constraints::DofMap;
use crate::linear::LinearError;
use crate::loads::{ExternalForce, external_force};
use crate::model::{Model, Newton};
use crate::points::Points;
use crate::quality::Measures;
use crate::stress::{Axisymmetric, Mechanics, PlaneStrain};
use crate::timing::{Phase, Timings};

pub use error::{CODES, SolveError};
pub use report::{GridFields, Observer, Reached, Silent, StepReport, Summary};

use equations::{Equations, Place, Solved};
use error::locate_failure;
use forcing::Forcing;
use report::{balance_of_energy, reactions_of};

/// A load step: the time it starts from and the time it reaches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Number, from 1.
    pub index: usize,
    /// Time of the state it starts from.
    pub start: f64,
    /// Time of the state it reaches.
    pub end: f64,
}

/// A vector on the active nodes, one entry per axis.
type Nodal<const D: usize> = Vec<[f64; D]>;

/// Runs an analysis from the converged state of `points` to the end, telling `observer` of everything.
///
/// # Errors
/// [`SolveError`] when a step has no equilibrium; `points.converged` then is the last equilibrated state.
pub fn run<const D: usize, M: Mechanics<D>>(
    model: &Model<D>,
    points: &mut Points<D>,
    observer: &mut dyn Observer<D>,
) -> Result<Summary, SolveError> {
    let nothing = Reached::nothing(model, points);
    go_on::<D, M>(model, points, nothing, observer)
}

/// Runs an analysis from the step that has been reached, in whose state `points` are, to the end.
///
/// # Errors
/// As [`run`].
pub fn go_on<const D: usize, M: Mechanics<D>>(
    model: &Model<D>,
    points: &mut Points<D>,
    reached: Reached,
    observer: &mut dyn Observer<D>,
) -> Result<Summary, SolveError> {
    let Reached { step: Step { index: last, .. }, summary } = reached;
    let mut solver = Solver { equations: Equations::default(), links: Connectivity::default(), summary };
    let started = solver.observe(|| observer.started(model, points));
    let mut outcome = started;
    for index in last + 1..=model.n_steps {
        if outcome.is_err() {
            break;
        }
        let time = |k: usize| model.end_time * (k as f64 / model.n_steps as f64);
        let step = Step { index, start: time(index - 1), end: time(index) };
        outcome = solver.advance::<M>(model, points, step, observer);
    }
    let Summary { timings, quality, .. } = &mut solver.summary;
    timings.measure(Phase::Update, || quality.conclude(model, points));
    let finished = solver.summary;
    let told = observer.finished(model, points, &finished, outcome.as_ref().err());
    outcome.and(told.map_err(SolveError::Output)).map(|()| finished)
}

/// Runs an analysis in the plane as [`run`], with the mechanics of its idealisation.
///
/// # Errors
/// As [`run`].
pub fn run_in_plane(
    model: &Model<2>,
    points: &mut Points<2>,
    observer: &mut dyn Observer<2>,
) -> Result<Summary, SolveError> {
    let nothing = Reached::nothing(model, points);
    go_on_in_plane(model, points, nothing, observer)
}

/// As [`go_on`], with the mechanics of the idealisation.
///
/// # Errors
/// As [`run`].
pub fn go_on_in_plane(
    model: &Model<2>,
    points: &mut Points<2>,
    reached: Reached,
    observer: &mut dyn Observer<2>,
) -> Result<Summary, SolveError> {
    if model.revolved {
        go_on::<2, Axisymmetric>(model, points, reached, observer)
    } else {
        go_on::<2, PlaneStrain>(model, points, reached, observer)
    }
}

/// What lives from step to step: the linear solvers with their analyses, and the account of the run.
struct Solver<const D: usize> {
    equations: Equations<D>,
    /// Links of the step before, for their memory.
    links: Connectivity<D>,
    summary: Summary,
}

impl<const D: usize> Solver<D> {
    fn observe(&mut self, tell: impl FnOnce() -> Result<(), std::io::Error>) -> Result<(), SolveError> {
        self.summary.timings.measure(Phase::Output, tell).map_err(SolveError::Output)
    }

    /// Solves one step and, only if it is in equilibrium, commits and reports it.
    fn advance<M: Mechanics<D>>(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        step: Step,
        observer: &mut dyn Observer<D>,
    ) -> Result<(), SolveError> {
        if observer.interrupted() {
            return Err(SolveError::Interrupted { step: step.index });
        }
        let report = self.solve_step::<M>(model, points, step, observer)?;
        self.judge(model, points, &report);
        points.commit(); // the trial state becomes the converged state
        self.summary.accept(&report);
        let summary = &self.summary;
        let mut timings = Timings::default();
        let told = timings.measure(Phase::Output, || observer.converged(model, points, &report, summary));
        self.summary.timings.add(&timings);
        self.links = report.grid.links;
        told.map_err(SolveError::Output)
    }

    /// Takes the measures of a step in equilibrium, before it is committed.
    fn judge(&mut self, model: &Model<D>, points: &Points<D>, report: &StepReport<D>) {
        let Summary { timings, quality, warnings, .. } = &mut self.summary;
        let raised = timings.measure(Phase::Update, || {
            let measures = Measures::new(model, points, &report.grid.links);
            quality.accept(model, report.step.index, &measures, &report.residuals)
        });
        warnings.extend(raised);
        if let Some(error) = self.equations.news() {
            let step = report.step.index;
            warnings.push(format!(
                "step {step}: conjugate gradients cannot solve the equations, which are factorised instead: {error}"
            ));
        }
    }

    /// Newton iterations until the out-of-balance force of eq. (40) meets the tolerance. Writes the trial state only.
    fn solve_step<M: Mechanics<D>>(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        step: Step,
        observer: &mut dyn Observer<D>,
    ) -> Result<StepReport<D>, SolveError> {
        let Newton { tolerance, max_iterations, .. } = model.newton;
        let timings = &mut self.summary.timings;
        // The grid is undeformed: S_vp, ∇S_vp and the pattern of K are fixed for the step (section 5.1).
        let methods: Vec<Method> = model.bodies.iter().map(|b| b.method).collect();
        let old = std::mem::take(&mut self.links);
        let links = timings
            .measure(Phase::Basis, || old.renew(model.grid.as_ref(), points, &methods))
            .map_err(|failure| SolveError::unsupported(model, points, failure, step))?;
        let set_up = timings.measure(Phase::SetUp, || StepSystem::new::<M>(model, points, &links, step));
        let StepSystem { dofs, mut system, f_ext, f_ext_start, applied } = set_up?;
        let place = Place { model, links: &links, dofs: &dofs };
        timings
            .measure(Phase::Analyse, || self.equations.prepare(place, &system))
            .map_err(|e| SolveError::linear(e, place, step))?;

        let mut unknowns = Unknowns::new(model, &links);
        let mut residuals = Vec::new();
        let mut solved = Vec::new();
        let mut forcing = Forcing::default();
        let mut f_int_start = Vec::new();
        for iteration in 0..=max_iterations {
            let timings = &mut self.summary.timings;
            timings
                .measure(Phase::Assembly, || system.assemble::<M>(model, points, &links, &unknowns.delta_d))
                .map_err(|f| locate_failure(f, model, points, step, iteration, &residuals))?;
            self.summary.evaluations += 1;
            let out_of_balance = unknowns.balance(&f_ext, system.internal_force());
            let residual = unknowns.relative_norm(&out_of_balance, &f_ext, &system, tolerance);
            residuals.push(residual);
            observer.iteration(step, iteration, residual);
            if iteration == 0 {
                f_int_start = system.internal_force().to_vec();
            }
            if iteration > 0 && residual <= tolerance {
                timings.measure(Phase::Update, || {
                    update::move_points::<D, M>(model, points, &links, &unknowns.delta_d, step)
                })?;
                let reaction_field = reactions_of(&f_ext, system.internal_force(), &dofs);
                let reaction_start = reactions_of(&f_ext_start, &f_int_start, &dofs);
                return Ok(StepReport {
                    step,
                    reactions: report::named_reactions(model, &reaction_field, &dofs),
                    applied,
                    energy: balance_of_energy(
                        model,
                        points,
                        &unknowns.delta_d,
                        [(&f_ext_start, &reaction_start), (&f_ext, &reaction_field)],
                    ),
                    unknowns: dofs.n_free(),
                    grid: GridFields { links, delta_d: unknowns.delta_d, reaction: reaction_field },
                    residuals,
                    factorisations: solved.iter().map(|s: &Solved| s.factorisation).collect(),
                    linear_iterations: solved.iter().map(|s| s.iterations).sum(),
                });
            }
            if iteration == max_iterations || !residual.is_finite() {
                return Err(SolveError::not_converged(model, &links, step, residuals, &out_of_balance));
            }
            let iterate = Iterate { out_of_balance: &out_of_balance, residual, iteration };
            let used = self
                .newton_step(&mut unknowns, &mut system, place, &iterate, &mut forcing)
                .map_err(|e| SolveError::linear(e, place, step))?;
            solved.push(used);
        }
        Err(SolveError::not_converged(model, &links, step, residuals, &[])) // max_iterations ≥ 1: not reached
    }

    /// Eq. (26): K δd = f_ext − f_int on the free degrees of freedom, with the whole prescribed increment in the
    /// first iteration; eq. (30) for the sum, and the linearised change of the reactions.
    ///
    /// Where δd is not exact, what it leaves of the equations of the free degrees of freedom stays in their
    /// out-of-balance force: only prescribed ones have a reaction, and that is the one which K and this δd give.
    fn newton_step(
        &mut self,
        unknowns: &mut Unknowns<D>,
        system: &mut System<D>,
        place: Place<D>,
        iterate: &Iterate<D>,
        forcing: &mut Forcing,
    ) -> Result<Solved, LinearError> {
        let Place { dofs, .. } = place;
        let Iterate { out_of_balance, residual, iteration } = *iterate;
        let Unknowns { iterative: delta, k_delta, rhs, .. } = unknowns;
        let timings = &mut self.summary.timings;
        let tolerance = timings.measure(Phase::Solve, || {
            delta.fill([0.0; D]);
            k_delta.fill([0.0; D]);
            if iteration == 0 {
                // The motion of the prescribed degrees of freedom loads the free ones through K.
                let mut moves = false;
                for_each_dof(dofs, |node, axis, _| {
                    delta[node][axis] = dofs.prescribed(node, axis).map_or(0.0, |(increment, _)| increment);
                    moves |= delta[node][axis] != 0.0;
                });
                if moves {
                    system.multiply(delta, k_delta);
                }
            }
            for_each_dof(dofs, |node, axis, free| {
                let force = out_of_balance[node][axis] - k_delta[node][axis];
                rhs[node][axis] = if free.is_some() { force } else { 0.0 };
            });
            forcing.next(norm(rhs.iter().flatten().copied()), residual, place.model.newton.tolerance)
        });
        let solved = self.equations.solve(place, system, rhs, delta, tolerance, timings)?;
        self.summary.linear_solves += 1;
        timings.measure(Phase::Solve, || {
            // Only a motion that nothing resists carries a node that far.
            let far = |u: &f64| u.abs() > unknowns.far;
            let carried = (0..delta.len())
                .find_map(|node| delta[node].iter().position(far).and_then(|axis| dofs.free(node, axis)));
            if let Some(unknown) = carried {
                return Err(LinearError::Singular { unknown: Some(unknown) });
            }
            system.multiply(delta, k_delta);
            for_each_dof(dofs, |node, axis, free| {
                unknowns.delta_d[node][axis] += delta[node][axis]; // (30)
                if free.is_none() {
                    unknowns.reaction[node][axis] += k_delta[node][axis] - out_of_balance[node][axis];
                }
            });
            Ok(solved)
        })
    }
}

/// Where the Newton iterations stand.
struct Iterate<'a, const D: usize> {
    out_of_balance: &'a Nodal<D>,
    /// Eq. (40).
    residual: f64,
    iteration: usize,
}

fn for_each_dof<const D: usize>(dofs: &DofMap<D>, mut visit: impl FnMut(usize, usize, Option<usize>)) {
    for node in 0..dofs.n_nodes() {
        for axis in 0..D {
            visit(node, axis, dofs.free(node, axis));
        }
    }
}

/// What is set up once per step.
struct StepSystem<const D: usize> {
    dofs: DofMap<D>,
    system: System<D>,
    f_ext: Nodal<D>,
    /// External force of the state the step starts from, on the nodes of this step.
    f_ext_start: Nodal<D>,
    /// Sum of the loads at the end of the step, [force].
    applied: [f64; D],
}

impl<const D: usize> StepSystem<D> {
    fn new<M: Mechanics<D>>(
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        step: Step,
    ) -> Result<Self, SolveError> {
        let dofs = DofMap::new(model, points, links, step.start, step.end)
            .map_err(|error| SolveError::Constraint { step: step.index, error })?;
        let system = System::new::<M>(model, points, links);
        // A ring resists its own motion outwards.
        let rigid = usize::from(M::REVOLVED)..D;
        if let Some((node, axis)) = dofs.unheld(&links.parts(), rigid) {
            let place = model.grid.node_position(links.active_nodes()[node] as usize);
            return Err(SolveError::Unheld { step: step.index, node: place.to_vec(), axis });
        }
        let load = |time| {
            external_force(model, points, links, time) // (24), (25), (29)
                .map_err(|error| SolveError::Load { step: step.index, error: Box::new(error) })
        };
        let ExternalForce { nodal: f_ext, applied } = load(step.end)?;
        // At time 0 nothing is loaded yet, whatever the curves say.
        let f_ext_start =
            if step.start > 0.0 { load(step.start)?.nodal } else { vec![[0.0; D]; f_ext.len()] };
        Ok(StepSystem { dofs, system, f_ext, f_ext_start, applied })
    }
}

/// The unknowns of a load step and the vectors that an iteration works with.
struct Unknowns<const D: usize> {
    /// Displacement increment Δd of the active nodes, [length].
    delta_d: Nodal<D>,
    /// Reactions, from the linearised equations of the iterations so far, [force].
    reaction: Nodal<D>,
    iterative: Nodal<D>,
    k_delta: Nodal<D>,
    rhs: Nodal<D>,
    /// A displacement that no equilibrium in this grid can have, [length].
    far: f64,
}

/// An iterative displacement of so many diameters of the grid is the work of a singular stiffness.
const FAR: f64 = 1e6;

/// Forces below this multiple of round-off in K Δd are no measure of the load.
const ROUND_OFF: f64 = 64.0 * f64::EPSILON;

impl<const D: usize> Unknowns<D> {
    fn new(model: &Model<D>, links: &Connectivity<D>) -> Self {
        let zero = vec![[0.0; D]; links.n_active()];
        let [low, high] = model.grid.bounds();
        let diameter = norm((0..D).map(|d| high[d] - low[d]));
        Unknowns {
            delta_d: zero.clone(),
            reaction: zero.clone(),
            iterative: zero.clone(),
            k_delta: zero.clone(),
            rhs: zero,
            far: FAR * diameter,
        }
    }

    /// f_ext − f_int + f_react over all degrees of freedom, constrained ones included; eq. (28) with the sign that
    /// eq. (26) needs.
    fn balance(&self, f_ext: &Nodal<D>, f_int: &[[f64; D]]) -> Nodal<D> {
        (0..f_ext.len())
            .map(|n| std::array::from_fn(|d| f_ext[n][d] - f_int[n][d] + self.reaction[n][d]))
            .collect()
    }

    /// Eq. (40): the out-of-balance force relative to external forces and reactions together.
    ///
    /// Where neither exists (a free body that moves rigidly, or is unloaded) the forces that remain are round-off of
    /// K Δd, and they are measured against that.
    fn relative_norm(
        &self,
        out_of_balance: &Nodal<D>,
        f_ext: &Nodal<D>,
        system: &System<D>,
        tolerance: f64,
    ) -> f64 {
        let out = norm(out_of_balance.iter().flatten().copied());
        let total = f_ext.iter().flatten().zip(self.reaction.iter().flatten());
        let force = norm(total.map(|(f, r)| f + r));
        if out <= tolerance * force || out == 0.0 {
            return if out == 0.0 { 0.0 } else { out / force };
        }
        let stiff = system.diagonal();
        let motion = stiff.iter().flatten().zip(self.delta_d.iter().flatten());
        let scale = ROUND_OFF / tolerance * norm(motion.map(|(k, u)| k * u));
        let reference = force.max(scale);
        if reference > 0.0 {
            out / reference
        } else {
            // Nothing moves and nothing pulls: measured against the internal force itself.
            out / norm(system.internal_force().iter().flatten().copied())
        }
    }
}

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|x| x * x).sum::<f64>().sqrt()
}
