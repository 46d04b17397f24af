//! The forces that a stage releases: those that keep the state in which it begins in equilibrium.

use std::collections::BTreeMap;

use crate::assembly::Wanted;
use crate::basis::{Connectivity, Method};
use crate::dofs::DofMap;
use crate::model::Model;
use crate::points::Points;
use crate::step::{At, Step, StepContext};
use crate::stress::Mechanics;
use crate::terms::{Saved, Sum, of_model, restore};

use super::error::{SolveError, locate_failure};

/// The forces that balance the converged state at a time on the free unknowns: by grid node, [force]. As they decrease, what
/// the state no longer carries is released, and what it has gained begins to act. `saved` is the state of the terms.
///
/// # Errors
/// [`SolveError`] if a point lies outside the grid, constraints contradict each other, or a load is not finite.
pub(super) fn balancing_forces<const D: usize, M: Mechanics<D>>(
    model: &Model<D>,
    points: &mut Points<D>,
    step: Step,
    saved: &BTreeMap<String, Saved>,
) -> Result<Vec<(u32, [f64; D])>, SolveError> {
    let methods: Vec<Method> = model.bodies.iter().map(|body| body.method).collect();
    let links = Connectivity::default()
        .renew(model.grid.as_ref(), points, &methods)
        .map_err(|failure| SolveError::unsupported(model, points, failure, step))?;
    let dofs = DofMap::new(model, points, &links, step.start, step.end)
        .map_err(|error| SolveError::Constraint { step: step.index, error })?;
    let context = StepContext { model, links: &links, step, factor: 0.0 };
    let mut terms = of_model::<D, D, M>(model);
    restore(&mut terms, saved)
        .map_err(|(term, reason)| SolveError::Term { term: term.to_owned(), reason })?;
    let mut sum = Sum::begun(terms, &context, points).map_err(|error| SolveError::begin(error, step))?;
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
