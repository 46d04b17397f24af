//! The change of a model between two steps of a run: grid lines and surfaces that have moved stay where they are, and
//! bodies keep their stress.

use crate::material::{Material, MaterialError};
use crate::model::Model;
use crate::points::Points;
use crate::tensor::Sym3;
use crate::terms::continue_from;

use super::progress::Reached;
use super::stages::{Amount, resume_stage};

/// Fraction of the elastic strain of a point at which its law responds elastically even if the point yields, [-].
const ELASTIC_PART: f64 = 1e-3;

/// Puts another model of the same analysis in place of the current one. The next step begins from the last one in
/// equilibrium:
///
/// - The lines of a moving grid, and the surfaces on which conditions act, stay where they are and then move by the
///   growth of the displacement that their condition prescribes.
/// - Points of materials whose elasticity has changed keep their stress; their elastic strain changes. The summary
///   counts the change of stored energy and plastic work as exchanged.
///
/// The models must have the same grid, bodies, tools, probes and stages, and the same loads and conditions apart from
/// their values and curves. `differs` states, by name, which materials have other parameters.
///
/// # Errors
/// The reason why the run cannot go on with the other model; nothing has then changed.
pub fn change_model<const D: usize>(
    model: &mut Model<D>,
    mut next: Model<D>,
    points: &mut Points<D>,
    reached: &mut Reached,
    differs: &dyn Fn(&str) -> bool,
) -> Result<(), String> {
    // The points stay; only the model must know its stage.
    resume_stage(&mut next, &mut Points::new(&[]), reached)?;
    let time = reached.progress.step.end;
    let offsets = next.offsets_of_lines(model, time);
    if !offsets.is_empty() {
        next.offset_lines(&offsets)?;
    }
    next.place_grid(time).map_err(|error| error.to_string())?;
    let strains = changed_strains([model, &next], points, differs)?;
    continue_from([model, &next], &mut reached.progress.terms, time)?;
    reached.progress.offsets_of_lines = offsets;
    let before = Amount::measured(model, points);
    *model = next;
    for (p, strain) in strains {
        set_strain(model, points, p, strain);
    }
    let now = Amount::measured(model, points);
    reached.summary.exchanged_energy += now.energy() - before.energy();
    reached.summary.strain_energy += now.stored - before.stored;
    reached.summary.plastic_work += now.plastic - before.plastic;
    Ok(())
}

/// The points whose elastic strain must change so that they keep their stress in the second model, each with its new
/// strain.
///
/// # Errors
/// The reason, if a changed material cannot carry the stress of a point.
fn changed_strains<const D: usize>(
    models: [&Model<D>; 2],
    points: &Points<D>,
    differs: &dyn Fn(&str) -> bool,
) -> Result<Vec<(usize, Sym3)>, String> {
    let [_, next] = models;
    let has_changed: Vec<bool> =
        next.bodies.iter().map(|body| differs(&next.materials[body.material].name)).collect();
    let mut changed = Vec::new();
    for p in (0..points.len()).filter(|&p| has_changed[usize::from(points.body[p])]) {
        let strain = strain_of_stress(models.map(|model| model.law(points, p)), points, p);
        let strain = strain.map_err(|error| {
            let body = &next.bodies[usize::from(points.body[p])].name;
            format!("the changed material of `{body}` cannot carry its stress: {error}")
        })?;
        changed.extend(strain.map(|strain| (p, strain)));
    }
    Ok(changed)
}

/// The elastic strain for which the second law gives the stress of a point; `None` if the first law gives this stress
/// for the same strain.
fn strain_of_stress<const D: usize>(
    laws: [&dyn Material; 2],
    points: &Points<D>,
    p: usize,
) -> Result<Option<Sym3>, MaterialError> {
    let all = &points.converged.history[p * points.history_len..];
    let history = &all[..laws[1].state_fields().len()];
    let stress = &points.converged.kirchhoff_stress[p];
    match laws.map(|law| law.elastic_strain(stress, &all[..law.state_fields().len()])) {
        [before, Ok(now)] => Ok(Some(now).filter(|now| before != Ok(*now))),
        [_, Err(error)] => {
            // A law without an inverse can go on if its elasticity is unchanged. This is judged by its stress at a
            // small fraction of the strain, where even points that yield are elastic.
            let strain = points.converged.elastic_strain[p] * ELASTIC_PART;
            let [before, now] = laws.map(|law| law.update(&strain, history, &mut history.to_vec()));
            let same = before.is_ok_and(|before| now.is_ok_and(|now| now.tau == before.tau));
            if same { Ok(None) } else { Err(error) }
        }
    }
}

/// Gives a point another elastic strain at the same stress and deformation, in its converged and its trial state.
fn set_strain<const D: usize>(model: &Model<D>, points: &mut Points<D>, p: usize, strain: Sym3) {
    let law = model.law(points, p);
    let own = p * points.history_len..p * points.history_len + law.state_fields().len();
    let mut history = points.converged.history[own.clone()].to_vec();
    law.keep_deformation([&points.converged.elastic_strain[p], &strain], &mut history);
    for state in [&mut points.converged, &mut points.trial] {
        state.history[own.clone()].copy_from_slice(&history);
        state.elastic_strain[p] = strain;
    }
}
