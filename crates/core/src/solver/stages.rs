//! The transition from one stage to the next: bodies are added and removed, boundary conditions are set and released,
//! and everything that they carried is transferred to forces that decrease to zero over the stage, so that every step
//! is in equilibrium.

use std::collections::BTreeSet;

use crate::dofs::Fields;
use crate::model::{Control, Model, Released, Stage};
use crate::points::Points;
use crate::step::Step;
use crate::tensor::padded;
use crate::terms::Terms;
use crate::timing::Phase;

use super::Solvable;
use super::collective::agree;
use super::error::SolveError;
use super::located::with_energy;
use super::observer::Observer;
use super::placing::place_lifts;
use super::progress::{Progress, Reached, StageReached};
use super::release::{Exchange, RemovedDomains};
use super::residual::MAX_ROUND_OFF;
use super::stepper::{Kernels, Stepper, finish, start};
use super::stepping::control::Path;
use super::stepping::pace::Pace;
use super::stepping::splitting::split_again;
use super::summary::Summary;

/// Fraction of the largest force that bodies have carried below which an out-of-balance force may be round-off, [-].
const LEFT: f64 = 1e-9;

/// Removes and adds the points of the bodies that a stage removes and adds, where they were drawn.
fn change_points<const D: usize>(model: &Model<D>, points: &mut Points<D>, number: usize) {
    let Some(stage) = model.stages.get(number) else { return };
    points.retain_bodies(|body| !stage.removed.contains(&body));
    points.append(&stage.added);
}

/// Like [`change_points`], but places bodies onto others as the stage says, and reports this, see [`place_lifts`].
fn exchange_points<const D: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    number: usize,
    summary: &mut Summary,
    step: usize,
) {
    let Some(stage) = model.stages.get(number).filter(|stage| !stage.lifts.is_empty()) else {
        return change_points(model, points, number);
    };
    points.retain_bodies(|body| !stage.removed.contains(&body));
    let mut added = stage.added.clone();
    let (placed, warnings) = place_lifts(model, points, &mut added, number, step);
    points.append(&added);
    summary.placed.extend(placed);
    summary.warnings.extend(warnings);
}

/// The bodies whose points have a state that belongs to another law when a stage begins. These are the bodies that
/// change their material in this stage, and the bodies that this stage adds after an earlier stage has given them
/// another material: points to be added have the state of the first material of their body.
fn with_new_law<const D: usize>(model: &Model<D>, number: usize) -> BTreeSet<usize> {
    let stage = &model.stages[number];
    let bodies = |stage: &Stage<D>| stage.materials.iter().map(|(body, _)| *body).collect::<BTreeSet<_>>();
    let earlier: BTreeSet<usize> = model.stages[..number].iter().flat_map(bodies).collect();
    let added: BTreeSet<usize> = stage.added.body.iter().map(|body| usize::from(*body)).collect();
    bodies(stage).into_iter().chain(earlier.intersection(&added).copied()).collect()
}

/// Gives the points of bodies with a new law the initial history of this law and the elastic strain for which it gives
/// their stress.
///
/// # Errors
/// [`SolveError::Term`] if the law cannot carry the stress of a point.
fn keep_stress<const D: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    number: usize,
) -> Result<(), SolveError> {
    let bodies = with_new_law(model, number);
    for p in 0..points.len() {
        let body = usize::from(points.body[p]);
        if !bodies.contains(&body) {
            continue;
        }
        let initial = model.law(points, p).initial_history_at(&padded(&points.original_position[p]));
        let history = points.history_of(p);
        history.fill(0.0);
        history.iter_mut().zip(initial).for_each(|(value, initial)| *value = initial);
        let stress = points.converged.kirchhoff_stress[p];
        model.set_initial_stress(points, p, &stress).map_err(|error| {
            let (stage, body) = (&model.stages[number].name, &model.bodies[body].name);
            let reason =
                format!("in stage `{stage}`, the new material of `{body}` cannot carry its stress: {error}");
            SolveError::Term { term: "stages".to_owned(), reason }
        })?;
    }
    Ok(())
}

/// A function that makes the further terms of an analysis, which start without state.
pub type FurtherTerms<'a, const D: usize, const N: usize = D> = &'a dyn Fn(&Model<D>) -> Terms<D, N>;

/// What an analysis has beside its model: the fields of its unknowns, and further terms of equilibrium.
#[derive(Clone)]
pub struct Extension<'a, const D: usize, const N: usize = D> {
    /// The code compiled for `N` components at each node and for the mechanics of the model.
    pub kernels: Kernels<D, N>,
    /// The fields, the displacement first.
    pub fields: Fields,
    /// Makes the further terms anew for each stage, and for each step on a grid that moves; a term that has a state
    /// must save and restore it.
    pub terms: FurtherTerms<'a, D, N>,
}

impl<'a, const D: usize> Extension<'a, D> {
    /// Further terms on the displacement alone.
    fn with_terms(model: &Model<D>, terms: FurtherTerms<'a, D>) -> Self
    where
        Model<D>: Solvable<D>,
    {
        Extension { kernels: model.kernels(), fields: Fields::displacement(D), terms }
    }
}

impl<const D: usize, const N: usize> Extension<'_, D, N> {
    /// A stepper for the current stage of a model.
    ///
    /// # Errors
    /// As for [`Stepper::with_fields`] and [`Stepper::with_terms`].
    pub fn stepper<'b>(
        &self,
        model: &'b Model<D>,
        points: &'b mut Points<D>,
    ) -> Result<Stepper<'b, D, N>, SolveError> {
        Stepper::with_fields(model, points, self.kernels, self.fields.clone())?
            .with_terms((self.terms)(model))
    }
}

/// Begins the next stage; the current one has ended.
///
/// # Errors
/// [`SolveError`] if the state of the new stage cannot be evaluated, or a new material cannot carry the current stress
/// or has no finite energy.
fn enter<const D: usize, const N: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    reached: &mut Reached,
    extension: &Extension<D, N>,
) -> Result<(), SolveError> {
    let number = model.present.stage + 1;
    // A stage with inertia goes on with what the stage at its limit aimed at.
    let aims =
        model.stepping.goes_on_at_limit && model.stages[model.present.stage + 1].stepping.dynamics.is_some();
    let began = model.factors_at_end(if aims { 1.0 } else { reached.progress.path.factor });
    let time = model.stepping.end_time;
    let step = Step { index: reached.progress.step.index + 1, start: time, end: time };
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
    if !points.reduction().any(changes) {
        model.begin_stage(number, &began);
    } else {
        let before = Amount::measured(model, points);
        let removed = RemovedDomains::new(model, points, stage);
        exchange_points(model, points, number, &mut reached.summary, step.index);
        model.begin_stage(number, &began);
        let reduction = points.reduction();
        agree(&reduction, keep_stress(model, points, number))?;
        let now = Amount::measured(model, points);
        let exchanged = now.energy() - before.energy();
        agree(&reduction, with_energy(exchanged, model, points, &points.converged, step))?;
        reached.summary.exchanged_energy += exchanged;
        reached.summary.quality.exchange(now.mass - before.mass, now.volume - before.volume);
        // The loads are still those at the end of the previous stage.
        let control = std::mem::replace(&mut model.stepping.control, Control::Load);
        let (balance, further) = (extension.kernels.balance, (extension.terms)(model));
        // A remainder that the tolerance or round-off has left out of balance is not a force to release.
        let carried = reached.progress.carried.iter().copied().fold(0.0, f64::max);
        let left = model.newton.tolerance.clamp(LEFT, MAX_ROUND_OFF) * carried;
        let exchange = Exchange { removed, left };
        let released = balance(model, points, step, further, &mut reached.progress.terms, &exchange);
        model.stepping.control = control;
        model.present.released = released?;
    }
    let mut splits_before =
        reached.progress.stage.take().map(|stage| stage.splits_before).unwrap_or_default();
    splits_before.push(reached.progress.splits.len());
    reached.progress.stage = Some(StageReached {
        number,
        began,
        released_forces: model.present.released.nodes.iter().map(|(node, f)| (*node, f.to_vec())).collect(),
        released: model.present.released.save(),
        splits_before,
    });
    // A strength reduction ends its stage when equilibrium is lost, before the end time of the stage.
    reached.progress.step.end = time;
    reached.progress.pace = Pace::default();
    reached.progress.path = Path::default();
    Ok(())
}

/// Totals over all points.
pub(super) struct Amount {
    mass: f64,
    volume: f64,
    /// Stored elastic energy, [energy].
    pub stored: f64,
    /// Plastic work, [energy].
    pub plastic: f64,
}

impl Amount {
    pub fn measured<const D: usize>(model: &Model<D>, points: &Points<D>) -> Amount {
        let n = points.history_len;
        let [mut stored, mut plastic] = [0.0; 2];
        for p in 0..points.len() {
            let law = model.law(points, p);
            let history = &points.converged.history[p * n..][..law.state_fields().len()];
            stored += law.energy(&points.converged.elastic_strain[p], history) * points.original_volume[p];
            plastic += law.plastic_work(history) * points.original_volume[p];
        }
        let reduction = &points.reduction();
        Amount {
            mass: reduction.total(points.mass.iter().sum()),
            volume: reduction.total((0..points.len()).map(|p| points.volume(p)).sum()),
            stored: reduction.total(stored),
            plastic: reduction.total(plastic),
        }
    }

    /// Stored energy and plastic work, [energy].
    pub fn energy(&self) -> f64 {
        self.stored + self.plastic
    }
}

/// Brings a newly built model and its points to the stage in which a run was interrupted; the state of the points
/// remains to be restored.
///
/// # Errors
/// The reason, if no run of this model can have reached the stage.
pub fn resume_stage<const D: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    reached: &Reached,
) -> Result<(), String> {
    let Progress { splits, offsets_of_lines, stage, .. } = &reached.progress;
    if !offsets_of_lines.is_empty() {
        model.offset_lines(offsets_of_lines)?;
    }
    let Some(StageReached { number, began, released_forces, released, splits_before }) = stage else {
        return split_again(model, points, splits);
    };
    let counts = [model.loads.len(), model.boundary_conditions.len()];
    if *number >= model.stages.len() || [began.loads.len(), began.boundary_conditions.len()] != counts {
        return Err("it belongs to other stages".to_owned());
    }
    // A body that has been removed and added again has split anew each time it was present.
    let mut repeated = 0;
    for stage in 1..=*number {
        let before = splits_before.get(stage - 1).copied().unwrap_or(repeated);
        let Some(earlier) = splits.get(repeated..before) else {
            return Err("its splits belong to other stages".to_owned());
        };
        split_again(model, points, earlier)?;
        repeated = before;
        change_points(model, points, stage);
        model.begin_stage(stage, began);
    }
    let mut present = Released { cuts_before: points.cuts.len(), ..Released::default() };
    split_again(model, points, &splits[repeated..])?;
    // Each group of bodies has its own copies of the nodes.
    let n_groups = model.body_groups.of_body.iter().max().map_or(1, |last| usize::from(*last) + 1);
    let n_nodes = n_groups * model.grid.n_nodes();
    let force = |(node, force): &(u32, Vec<f64>)| {
        let force: [f64; D] = force.as_slice().try_into().ok()?;
        ((*node as usize) < n_nodes && force.iter().all(|f| f.is_finite())).then_some((*node, force))
    };
    let forces: Option<Vec<_>> = released_forces.iter().map(force).collect();
    let (Some(nodes), Some(())) = (forces, present.restore(released)) else {
        return Err("its released forces are invalid".to_owned());
    };
    model.present.released = Released { nodes, ..present };
    Ok(())
}

/// Runs an analysis from the step that it has reached to the end of its last stage, and reports every event to
/// `observer`.
///
/// # Errors
/// As for [`super::run`].
pub fn run_stages<const D: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    reached: Reached,
    observer: &mut dyn Observer<D>,
) -> Result<Reached, SolveError>
where
    Model<D>: Solvable<D>,
{
    run_with_changes(model, points, reached, observer, &mut |_, _, _| Ok(false))
}

/// Like [`run_stages`], but with further terms of equilibrium. `further` makes them anew for each stage, and for each
/// step on a grid that moves; a term that has a state must save and restore it.
///
/// # Errors
/// The errors of [`run_stages`]; [`SolveError::Term`] if two terms have the same name.
pub fn run_stages_with_terms<const D: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    reached: Reached,
    further: FurtherTerms<D>,
    observer: &mut dyn Observer<D>,
) -> Result<Reached, SolveError>
where
    Model<D>: Solvable<D>,
{
    let extension = Extension::with_terms(model, further);
    run_extended(model, points, reached, &extension, observer, &mut |_, _, _| Ok(false))
}

/// A function that may change a model between two steps, given the points and the last converged step.
pub type Change<'a, const D: usize> =
    &'a mut dyn FnMut(&mut Model<D>, &mut Points<D>, &mut Reached) -> Result<bool, SolveError>;

/// Like [`run_stages`], but whenever the observer has interrupted the run between two steps, `change` may exchange the
/// model by [`change_model`](super::change_model), and the run goes on if `change` returns true.
///
/// # Errors
/// The errors of [`run_stages`] and those of `change`.
pub fn run_with_changes<const D: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    reached: Reached,
    observer: &mut dyn Observer<D>,
    change: Change<'_, D>,
) -> Result<Reached, SolveError>
where
    Model<D>: Solvable<D>,
{
    let extension = Extension::with_terms(model, &|_| Terms::new());
    run_extended(model, points, reached, &extension, observer, change)
}

/// Runs all stages of any analysis: with its fields and further terms, and with changes between steps, see
/// [`run_with_changes`].
///
/// # Errors
/// The errors of [`run_with_changes`] and of [`Extension::stepper`].
pub fn run_extended<const D: usize, const N: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    mut reached: Reached,
    extension: &Extension<D, N>,
    observer: &mut dyn Observer<D>,
    change: Change<'_, D>,
) -> Result<Reached, SolveError> {
    // A saved state that does not match ends the run before anything is reported.
    extension.stepper(model, points)?.resume(reached.clone())?;
    // A grid that cannot move is reported when its step begins.
    let _ = model.place_grid(reached.progress.step.end);
    let started = start(model, points, &mut reached, observer);
    let outcome = started.and_then(|()| {
        loop {
            match all_stages(model, points, &mut reached, extension, observer) {
                Err(SolveError::Interrupted { .. }) if change(model, points, &mut reached)? => {}
                outcome => return outcome,
            }
        }
    });
    finish(model, points, reached, outcome, observer)
}

/// True if the next stage takes over where the current one finds no further equilibrium.
fn goes_on_at_limit<const D: usize>(model: &Model<D>, error: &SolveError) -> bool {
    model.stepping.goes_on_at_limit && model.present.stage + 1 < model.stages.len() && error.is_retryable()
}

/// Keeps the strength divided in stages with inertia that follow a strength reduction and go on from its limit: by the
/// factor that the reduction aimed at.
fn hold_strength<const D: usize>(model: &mut Model<D>) {
    let stage = model.present.stage;
    let stepping = |stage: usize| model.stages.get(stage).map(|stage| &stage.stepping);
    let has_inertia = |stage: usize| stepping(stage).is_some_and(|stepping| stepping.dynamics.is_some());
    let before = (0..stage).rev().find(|earlier| !has_inertia(*earlier)).filter(|_| has_inertia(stage));
    let held = before.and_then(stepping).filter(|stepping| stepping.goes_on_at_limit);
    let aimed_at = held.and_then(|stepping| match stepping.control {
        Control::StrengthReduction { to, .. } => Some(to),
        Control::Load | Control::Displacement { .. } | Control::ArcLength { .. } => None,
    });
    model.stepping.held_strength = aimed_at;
}

/// Solves all steps from the current one to the end of the last stage; each stage, and each step on a grid that moves,
/// has its own stepper.
///
/// # Errors
/// As for [`Stepper::step`].
fn all_stages<const D: usize, const N: usize>(
    model: &mut Model<D>,
    points: &mut Points<D>,
    reached: &mut Reached,
    extension: &Extension<D, N>,
    observer: &mut dyn Observer<D>,
) -> Result<(), SolveError> {
    loop {
        let Step { index, end, .. } = reached.progress.step;
        model.place_grid(end).map_err(|error| SolveError::GridMotion { step: index + 1, error })?;
        hold_strength(model);
        let before = std::mem::replace(reached, Reached::nothing(points));
        let mut stepper = extension.stepper(model, points)?.resume(before)?;
        let outcome = loop {
            match stepper.step(observer) {
                Ok(Some(_)) if model.moving_grid.is_none() => {}
                outcome => break outcome.map(|report| report.is_some()),
            }
        };
        *reached = stepper.into_reached();
        match outcome {
            Ok(true) => continue, // The grid moves before the next step.
            Err(error) if !goes_on_at_limit(model, &error) => return Err(error),
            Ok(false) | Err(_) => {}
        }
        if model.present.stage + 1 >= model.stages.len() {
            return Ok(());
        }
        let observe = || observer.stage_ended(model, points);
        let observed = reached.summary.timings.measure(Phase::Output, observe);
        agree(&points.reduction(), observed.map_err(SolveError::Output))?;
        let entered = enter(model, points, reached, extension);
        observer.stage_began(entered.is_ok().then_some(&*reached));
        entered?;
    }
}
