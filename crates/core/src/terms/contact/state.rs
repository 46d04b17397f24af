//! The state of tools and of the contact points that touch them, for results.

use crate::model::{LoadCurve, Model};
use crate::region::vector::norm;
use crate::tool::Pose;

use super::Contact;
use super::candidates::Candidate;
use super::evaluation::Trial;
use super::interface::{Mode, Touch};
use super::ranks::{Plain, gathered, plain_parts};

plain_parts!([const D: usize] ContactPoint<D>, {
    body, point, part, position, normal, area, force, pressure, shear, mode
});
plain_parts!([const D: usize] Touching<D>, { tool, contact, moment, parts, overlap, allowed_overlap, slip });

/// A tool at the end of a step.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolState<const D: usize> {
    /// Pose of the tool.
    pub pose: Pose<D>,
    /// Displacement of the reference point since the start of the analysis, [length].
    pub displacement: [f64; D],
    /// Rotation vector since the start of the analysis, [rad]; in the plane, including full turns.
    pub rotation: [f64; 3],
    /// Force of the tool on the bodies, [force].
    pub force: [f64; D],
    /// Moment of the forces of the tool on the bodies about the reference point and the axes x, y and z,
    /// [force·length].
    pub moment: [f64; 3],
    /// Force that the loads of the tool exert on it, [force].
    pub load: [f64; D],
    /// Moment of the loads of the tool about the reference point, [force·length].
    pub load_moment: [f64; 3],
    /// Largest overlap with a body that contact forces have left, [length]; 0 if there is none.
    pub overlap: f64,
    /// Largest additional overlap that a touching contact point may keep in the step, [length]: the update of box and
    /// CPDI1 domains left this overlap, which vanishes along the path of the contact point.
    pub allowed_overlap: f64,
    /// Largest slip in the step of a contact point that sticks, [length].
    pub slip: f64,
    /// Number of updates of the multipliers in the step, for all tools together, without those along an increment.
    pub augmentations: usize,
    /// The contact points that touch the tool.
    pub contacts: Vec<ContactPoint<D>>,
    /// The forces on the named parts of the tool, in the order of the model.
    pub parts: Vec<PartState<D>>,
}

/// The forces on a named part of a tool at the end of a step.
#[derive(Debug, Clone, PartialEq)]
pub struct PartState<const D: usize> {
    /// Force of the part on the bodies, [force].
    pub force: [f64; D],
    /// Moment of the forces of the part on the bodies about the reference point of the tool and the axes x, y and z,
    /// [force·length].
    pub moment: [f64; 3],
    /// Number of contact points that touch the part.
    pub contacts: usize,
}

/// A contact point on a body that touches a tool.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactPoint<const D: usize> {
    /// Number of the body.
    pub body: usize,
    /// Permanent number of the material point to whose domain the contact point belongs.
    pub point: u32,
    /// Number of the part of the tool surface, as in [`crate::tool::Closest::part`].
    pub part: usize,
    /// Position, [length].
    pub position: [f64; D],
    /// Unit normal pointing out of the tool.
    pub normal: [f64; D],
    /// Area that the contact point stands for, [length²]: for unit thickness in the plane, over the full circle for
    /// bodies of revolution. 0 for one whose sides others bear; its stresses refer to the area of its penalty.
    pub area: f64,
    /// Force of the tool on the body, [force].
    pub force: [f64; D],
    /// Pressure, [stress]; negative for tension.
    pub pressure: f64,
    /// Shear stress on the body, [stress].
    pub shear: [f64; D],
    /// The mode of the contact point: it sticks, slides or parts.
    pub mode: Mode,
}

/// A contact point that touches a tool.
pub(super) struct Touching<const D: usize> {
    pub(super) tool: usize,
    pub(super) contact: ContactPoint<D>,
    /// Moment of the force of the contact point about the reference point, [force·length].
    pub(super) moment: [f64; 3],
    /// The named parts that the contact point touches.
    pub(super) parts: Vec<usize>,
    /// Overlap, the further overlap that the contact point may keep, and slip if it sticks, [length].
    pub(super) overlap: f64,
    pub(super) allowed_overlap: f64,
    pub(super) slip: f64,
}

impl<const D: usize> ToolState<D> {
    /// Adds a contact point that touches the tool.
    pub(super) fn add(&mut self, place: Touching<D>) {
        let Touching { tool: _, contact, moment, parts, overlap, allowed_overlap, slip } = place;
        self.overlap = self.overlap.max(overlap);
        self.allowed_overlap = self.allowed_overlap.max(allowed_overlap);
        self.slip = self.slip.max(slip);
        let ContactPoint { force, .. } = &contact;
        add(&mut self.force, force);
        add(&mut self.moment, &moment);
        for number in parts {
            let part = &mut self.parts[number];
            add(&mut part.force, force);
            add(&mut part.moment, &moment);
            part.contacts += 1;
        }
        self.contacts.push(contact);
    }

    /// Force of one part of the tool surface on the bodies, [force].
    pub fn force_of_part(&self, part: usize) -> [f64; D] {
        let on_part = self.contacts.iter().filter(|contact| contact.part == part);
        on_part.fold([0.0; D], |sum, contact| std::array::from_fn(|d| sum[d] + contact.force[d]))
    }
}

impl<const D: usize> PartState<D> {
    /// A part that touches nothing.
    pub(super) const NONE: Self = PartState { force: [0.0; D], moment: [0.0; 3], contacts: 0 };
}

fn add<const N: usize>(sum: &mut [f64; N], other: &[f64; N]) {
    (0..N).for_each(|d| sum[d] += other[d]);
}

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
        let forces = self.distributed();
        let touching_at =
            |((_, candidate, trial, touch), force): ((_, &Candidate<D>, &Trial<D>, &Touch<D>), &[f64; D])| {
                let number = candidate.key.tool as usize;
                let moving = &self.tools[number];
                let (position, force) = (trial.position, *force);
                let (pressure, shear) = touch.parts(&force);
                let tool = &model.tools[number];
                let closest = || moving.end.closest(tool.shape.as_ref(), position, f64::INFINITY);
                let found = if candidate.keeps_face { None } else { closest() };
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
                    pressure: pressure / candidate.area_for_stress(),
                    shear: shear.map(|t| t / candidate.area_for_stress()),
                    mode: touch.mode,
                };
                Touching {
                    tool: number,
                    moment: moving.moment(&position, &force),
                    overlap: -touch.gap(),
                    allowed_overlap: candidate.allowance.max(0.0),
                    slip: if touch.mode == Mode::Stick { norm(&touch.slip()) } else { 0.0 },
                    parts: tool.parts_at(part, &moving.end.to_tool(&on_surface)).collect(),
                    contact,
                }
            };
        let of_tools =
            self.touching().zip(&forces).filter(|((_, candidate, ..), _)| candidate.facet.is_none());
        let touching = of_tools.map(touching_at).collect();
        for found in gathered(&self.reduction, touching) {
            states[found.tool].add(found);
        }
        states
    }
}
