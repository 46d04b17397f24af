//! The change of a model between two steps of a run: what the steps so far have moved stays where it is.

use crate::model::Model;
use crate::points::Points;
use crate::terms::Surfaces;

use super::stages::resume_stage;
use super::summary::Reached;

/// Puts another model of the same analysis in place of the current one. The next step begins from the last one in
/// equilibrium: the lines of a moving grid, and the surfaces on which conditions act, stay where they are and then move
/// by the growth of the displacement that their condition prescribes.
///
/// The models must have the same grid, bodies, tools, probes and stages, and the same loads and conditions apart from
/// their values and curves.
///
/// # Errors
/// The reason why the run cannot go on with the other model; nothing has then changed.
pub fn change_model<const D: usize>(
    model: &mut Model<D>,
    mut next: Model<D>,
    reached: &mut Reached,
) -> Result<(), String> {
    // The points stay; only the model must know its stage.
    resume_stage(&mut next, &mut Points::new(&[]), reached)?;
    let time = reached.step.end;
    let offsets = next.offsets_of_lines(model, time);
    if !offsets.is_empty() {
        next.offset_lines(&offsets)?;
    }
    next.place_grid(time).map_err(|error| error.to_string())?;
    Surfaces::continue_from([model, &next], &mut reached.summary.terms, time)?;
    reached.summary.offsets_of_lines = offsets;
    *model = next;
    Ok(())
}
