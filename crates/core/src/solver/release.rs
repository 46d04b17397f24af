//! The forces that a stage releases: those that keep its initial state in equilibrium.

mod carriers;

use std::collections::BTreeMap;

use crate::assembly::Wanted;
use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::model::{Model, Released};
use crate::points::{Displaced, Points};
use crate::step::{At, Step, StepContext};
use crate::stress::Mechanics;
use crate::terms::{Saved, Sum, Terms, model_terms, restore, save};

use super::collective::{agree, begin, forces_on_all_nodes, reach_out};
use super::error::SolveError;
use super::located::locate_failure;
use carriers::carried_by_material;

/// The function [`balancing_forces`] for one kind of mechanics; its arguments are the model, its points, the step, the
/// terms beside those of the model, the saved state of all terms, and what the stage has exchanged.
pub(super) type BalancingForces<const D: usize, const N: usize> = fn(
    &Model<D>,
    &mut Points<D>,
    Step,
    Terms<D, N>,
    &mut BTreeMap<String, Saved>,
    &Exchange<D>,
) -> Result<Released<D>, SolveError>;

pub(super) use carriers::{Exchange, RemovedDomains};

/// Tells the terms which bodies the present stage has removed, and which it has placed onto others; true if there are
/// any.
fn adapt_to_stage<const D: usize, const N: usize>(
    model: &Model<D>,
    points: &Points<D>,
    terms: &mut Terms<D, N>,
) -> bool {
    let Some(stage) = model.stages.get(model.present.stage) else { return false };
    let mut attached: Vec<_> = terms.iter_mut().filter_map(|term| term.attached()).collect();
    if !stage.removed.is_empty() {
        attached.iter_mut().for_each(|attached| attached.forget_bodies(model, &stage.removed));
    }
    for lift in stage.lifts.iter().filter(|lift| lift.is_placed) {
        let placed = Displaced::gathered(&[points], lift.body, lift.cell, |_| true);
        let moved = |x: &[f64; D]| placed.position(x);
        attached.iter_mut().for_each(|attached| attached.place_body(model, lift.body, &moved));
    }
    !stage.removed.is_empty() || stage.lifts.iter().any(|lift| lift.is_placed)
}

/// The forces on the free unknowns that balance the converged state at the time of `step`, and the material that
/// carries them. As these forces decrease, what was removed from the state gradually ceases to act, and what was added
/// begins to act. The terms of the model and `further` terms are in the state `saved`, from which they discard the
/// bodies that the present stage has removed. Fields beside the displacement release nothing: they begin the stage from
/// the state that their terms keep.
///
/// # Errors
/// [`SolveError`] if a point lies outside the grid, constraints contradict each other, or a load is not finite.
pub(super) fn balancing_forces<const D: usize, const N: usize, M: Mechanics<D>>(
    model: &Model<D>,
    points: &mut Points<D>,
    step: Step,
    further: Terms<D, N>,
    saved: &mut BTreeMap<String, Saved>,
    exchange: &Exchange<D>,
) -> Result<Released<D>, SolveError> {
    let mut terms = model_terms::<D, N, M>(model);
    terms.extend(further);
    let methods = model.methods();
    let reduction = points.reduction();
    let links = Connectivity::default().with_body_groups(&model.body_groups.of_body);
    let linked = links.renew(model.grid.as_ref(), points, &methods);
    let links =
        agree(&reduction, linked.map_err(|failure| SolveError::unsupported(model, points, failure, step)))?;
    restore(&mut terms, saved)
        .map_err(|(term, reason)| SolveError::Term { term: term.to_owned(), reason })?;
    if adapt_to_stage(model, points, &mut terms) {
        *saved = save(&terms);
    }
    let links = reach_out(model, points, links, &mut terms, step)?;
    let dofs = DofMap::new(model, points, &links, step.start, step.end)
        .map_err(|error| SolveError::Constraint { step: step.index, error });
    let dofs = agree(&reduction, dofs)?;
    let context = StepContext { model, links: &links, step, factor: 0.0, viscosity: 0.0, experiment: None };
    begin(&mut terms, &context, points)?;
    let mut sum = Sum::new(terms, &context, &DofMap::unconstrained(links.n_active()));
    let none = vec![[0.0; N]; links.n_active()];
    let evaluated = sum.evaluate(&context, points, At::new(&none), Wanted::Force);
    let evaluated = evaluated.map_err(|failure| locate_failure(failure, model, points, step, 0, &[]));
    agree(&reduction, evaluated)?;
    sum.system_mut().complete();
    let (f_ext, f_int) = (sum.system().external_force(), sum.system().internal_force());
    let mut forces = Vec::new();
    for active in 0..links.n_active() {
        let lacking: [f64; N] = std::array::from_fn(|d| f_int[active][d] - f_ext[active][d]);
        let held = dofs.held_part(active, &lacking);
        let force: [f64; D] = std::array::from_fn(|d| lacking[d] - held[d]);
        if force != [0.0; D] && links.reduction().counts(active) {
            forces.push((links.lasting_number(active), force));
        }
    }
    let forces = forces_on_all_nodes(&reduction, forces);
    Ok(carried_by_material(model, points, &links, forces, exchange))
}
