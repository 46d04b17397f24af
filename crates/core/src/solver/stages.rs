//! From stage to stage: bodies are added and removed, boundary conditions set and released, and all that these carried is
//! handed over to forces that decrease to zero over the stage, so that every step is in equilibrium.

use serde::{Deserialize, Serialize};

use crate::assembly::Wanted;
use crate::basis::{Connectivity, Method};
use crate::dofs::DofMap;
use crate::model::{Control, Factors, Model, Present};
use crate::points::Points;
use crate::step::{At, Step, StepContext};
use crate::stress::Mechanics;
use crate::terms::Sum;

use super::Solvable;
use super::control::Path;
use super::error::{SolveError, locate_failure};
use super::observer::Observer;
use super::pace::Pace;
use super::stepper::{Kernels, Stepper};
use super::summary::{Reached, Summary};

/// The stage of a run, as checkpoints store it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StageReached {
    /// Number of the stage, from 0.
    pub number: usize,
    /// The factors with which it began.
    pub began: Factors,
    /// Grid nodes, and the forces on them that are released over the stage, [force].
    released_forces: Vec<(u32, Vec<f64>)>,
}

/// The forces that balance the converged state at a time on the free unknowns: by grid node, [force]. As they decrease, what
/// the state no longer carries is released, and what it has gained begins to act.
///
/// # Errors
/// [`SolveError`] if a point lies outside the grid, constraints contradict each other, or a load is not finite.
pub(super) fn balancing_forces<const D: usize, M: Mechanics<D>>(
    model: &Model<D>,
    points: &mut Points<D>,
    step: Step,
) -> Result<Vec<(u32, [f64; D])>, SolveError> {
    let methods: Vec<Method> = model.bodies.iter().map(|body| body.method).collect();
    let links = Connectivity::default()
        .renew(model.grid.as_ref(), points, &methods)
        .map_err(|failure| SolveError::unsupported(model, points, failure, step))?;
    let dofs = DofMap::new(model, points, &links, step.start, step.end)
        .map_err(|error| SolveError::Constraint { step: step.index, error })?;
    let context = StepContext { model, links: &links, step, factor: 0.0 };
    let mut sum = Sum::<D>::of_bodies::<M>(&context, points)
        .map_err(|error| SolveError::Load { step: step.index, error })?;
    let none = vec![[0.0; D]; links.n_active()];
    sum.evaluate(&context, points, At::new(&none), Wanted::Force)
        .map_err(|failure| locate_failure(failure, model, points, step, 0, &[]))?;
    let (f_ext, f_int) = (sum.system().external_force(), sum.system().internal_force());
    let mut forces = Vec::new();
    for (active, &node) in links.active_nodes().iter().enumerate() {
        let lacking: [f64; D] = std::array::from_fn(|d| f_int[active][d] - f_ext[active][d]);
        let held = dofs.held_part(active, &lacking);
        let force: [f64; D] = std::array::from_fn(|d| lacking[d] - held[d]);
        if force != [0.0; D] {
            forces.push((node, force));
        }
    }
    Ok(forces)
}

/// Puts the points of a stage in place of those of the stage before.
fn change_points<const D: usize>(model: &Model<D>, points: &mut Points<D>, number: usize) {
    let Some(stage) = model.stages.get(number) else { return };
    points.retain_bodies(|body| !stage.removed.contains(&body));
    points.append(&stage.added);
}

/// Begins the stage after the present one, which has ended.
///
/// # Errors
/// Those of [`balancing_forces`].
fn enter<const D: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    kernels: &Kernels<D>,
    reached: &mut Reached,
) -> Result<(), SolveError> {
    let number = model.present.stage + 1;
    let began = model.factors_at_end(reached.summary.path.factor);
    let time = model.stepping.end_time;
    let step = Step { index: reached.step.index + 1, start: time, end: time };
    let ended = &model.stages[model.present.stage];
    if ended.resets_displacement {
        points.reset_displacement();
    }
    let stage = &model.stages[number];
    let changes = !stage.removed.is_empty()
        || !stage.added.is_empty()
        || !stage.released.is_empty()
        || !stage.set.is_empty()
        || !stage.materials.is_empty();
    if !changes {
        model.begin_stage(number, &began);
    } else {
        let before = Amount::of(model, points);
        change_points(model, points, number);
        model.begin_stage(number, &began);
        let now = Amount::of(model, points);
        reached.summary.exchanged_energy += now.energy - before.energy;
        reached.summary.quality.exchange(now.mass - before.mass, now.volume - before.volume);
        // The loads still stand where the stage before has left them.
        let control = std::mem::replace(&mut model.stepping.control, Control::Load);
        let forces = (kernels.balancing_forces)(model, points, step);
        model.stepping.control = control;
        model.present.released_forces = forces?;
    }
    reached.summary.stage = Some(StageReached {
        number,
        began,
        released_forces: model.present.released_forces.iter().map(|(node, f)| (*node, f.to_vec())).collect(),
    });
    reached.summary.pace = Pace::default();
    reached.summary.path = Path::default();
    Ok(())
}

/// What all points have in sum.
struct Amount {
    mass: f64,
    volume: f64,
    /// Stored energy and plastic work, [energy].
    energy: f64,
}

impl Amount {
    fn of<const D: usize>(model: &Model<D>, points: &Points<D>) -> Amount {
        let n = points.history_len;
        let energy = |p: usize| {
            let law = model.law(points, p);
            let history = &points.converged.history[p * n..][..law.state_fields().len()];
            let density = law.energy(&points.converged.elastic_strain[p]) + law.plastic_work(history);
            density * points.original_volume[p]
        };
        Amount {
            mass: points.mass.iter().sum(),
            volume: (0..points.len()).map(|p| points.volume(p)).sum(),
            energy: (0..points.len()).map(energy).sum(),
        }
    }
}

/// Brings a newly built model and its points to the stage in which a run was interrupted; the state of the points remains to
/// be restored.
///
/// # Errors
/// A reason, if no run of this model can have reached the stage.
pub fn resume_stage<const D: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    reached: &Reached,
) -> Result<(), String> {
    let Some(StageReached { number, began, released_forces }) = &reached.summary.stage else { return Ok(()) };
    let of_model = [model.loads.len(), model.boundary_conditions.len()];
    if *number >= model.stages.len() || [began.loads.len(), began.boundary_conditions.len()] != of_model {
        return Err("it belongs to other stages".to_owned());
    }
    for stage in 1..=*number {
        change_points(model, points, stage);
        model.begin_stage(stage, began);
    }
    let n_nodes = model.grid.n_nodes();
    let force = |(node, force): &(u32, Vec<f64>)| {
        let force: [f64; D] = force.as_slice().try_into().ok()?;
        ((*node as usize) < n_nodes && force.iter().all(|f| f.is_finite())).then_some((*node, force))
    };
    let forces: Option<Vec<_>> = released_forces.iter().map(force).collect();
    let Some(released_forces) = forces else { return Err("its released forces are invalid".to_owned()) };
    model.present = Present { released_forces, ..std::mem::take(&mut model.present) };
    Ok(())
}

/// Runs an analysis from a step that has been reached to the end of its last stage, and reports every event to `observer`.
///
/// # Errors
/// As [`super::run`].
pub fn run_stages<const D: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    mut reached: Reached,
    observer: &mut dyn Observer<D>,
) -> Result<Summary, SolveError>
where
    Model<D>: Solvable<D>,
{
    observer.started(model, points).map_err(SolveError::Output)?;
    loop {
        let mut stepper = Stepper::new(model, points).resume(reached)?;
        let outcome = stepper.steps(observer);
        reached = stepper.into_reached();
        if outcome.is_err() || model.present.stage + 1 >= model.stages.len() {
            return super::stepper::finish(model, points, reached, outcome, observer);
        }
        let kernels = model.kernels();
        if let Err(error) = enter(model, points, &kernels, &mut reached) {
            return super::stepper::finish(model, points, reached, Err(error), observer);
        }
    }
}
