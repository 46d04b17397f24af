//! The state of all tools at the last evaluation, with the contact points of all ranks.

use super::Contact;
use super::candidates::Candidate;
use super::evaluation::Trial;
use super::interface::{Mode, Touch};
use super::plain::gathered;
use super::state::{ContactPoint, PartState, ToolState, Touching};
use crate::model::{LoadCurve, Model};
use crate::region::vector::norm;

impl<const D: usize> Contact<D> {
    /// The state of all tools at the last evaluation.
    #[inline(never)]
    pub(super) fn states(&self, model: &Model<D>) -> Vec<ToolState<D>> {
        let mut states: Vec<ToolState<D>> = (self.tools.iter().zip(&model.tools))
            .map(|(moving, tool)| {
                let factor =
                    |curve: &LoadCurve| curve.factor_of_tool(&model.stepping, self.time, self.factor);
                let (load, load_moment) = tool.load_at(factor);
                let (now, original) = (moving.end.position(), moving.original.position());
                ToolState {
                    pose: moving.end,
                    displacement: std::array::from_fn(|d| now[d] - original[d]),
                    rotation: moving.end.rotation_since(&moving.original),
                    force: [0.0; D],
                    moment: [0.0; 3],
                    load,
                    load_moment,
                    overlap: 0.0,
                    allowed_overlap: 0.0,
                    slip: 0.0,
                    augmentations: self.updates,
                    contacts: Vec::new(),
                    parts: vec![PartState::NONE; tool.parts.len()],
                }
            })
            .collect();
        let touching_at = |(_, candidate, trial, touch): (_, &Candidate<D>, &Trial<D>, &Touch<D>)| {
            let number = candidate.key.tool as usize;
            let moving = &self.tools[number];
            let (position, force) = (trial.position, touch.force());
            let tool = &model.tools[number];
            let found = moving.end.closest(tool.shape.as_ref(), position, f64::INFINITY);
            let (part, on_surface) =
                found.map_or((candidate.near.part, position), |found| (found.part, found.point));
            let contact = ContactPoint {
                body: candidate.body,
                point: candidate.key.point,
                part,
                position,
                normal: touch.normal(),
                area: candidate.area,
                force,
                pressure: touch.pressure / candidate.area,
                shear: touch.shear.map(|t| t / candidate.area),
                mode: touch.mode,
            };
            Touching {
                tool: number,
                moment: moving.moment(&position, &force),
                overlap: -touch.gap(),
                allowed_overlap: candidate.allowance,
                slip: if touch.mode == Mode::Stick { norm(&touch.slip()) } else { 0.0 },
                parts: tool.parts_at(part, &moving.end.to_tool(&on_surface)).collect(),
                contact,
            }
        };
        let touching = self.touching().map(touching_at).collect();
        for found in gathered(&self.reduction, touching) {
            states[found.tool].add(found);
        }
        states
    }
}
