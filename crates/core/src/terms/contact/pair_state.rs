//! The state of the contact between bodies, for results.

use crate::model::Model;
use crate::region::vector::norm;

use super::Contact;
use super::interface::Mode;
use super::ranks::{Plain, gathered, plain_parts};
use super::state::ContactPoint;

plain_parts!([const D: usize] FacetPoint<D>, { pair, contact, gap, slip });

/// Two bodies in contact at the end of a step.
#[derive(Debug, Clone, PartialEq)]
pub struct PairState<const D: usize> {
    /// Force of the first body of the pair on the second, [force].
    pub force: [f64; D],
    /// Largest overlap that contact forces have left, [length]; 0 if there is none.
    pub overlap: f64,
    /// Largest slip in the step of a contact point that sticks, [length].
    pub slip: f64,
    /// Area over which the bodies touch, [length²]: for unit thickness in the plane, over the full circle for bodies of
    /// revolution.
    pub area: f64,
    /// The contact points of both bodies that touch.
    pub contacts: Vec<FacetPoint<D>>,
}

/// A contact point on a body that touches another body.
#[derive(Debug, Clone, PartialEq)]
pub struct FacetPoint<const D: usize> {
    /// Number of the pair of bodies.
    pub pair: usize,
    /// The contact point; its force and its stresses act on its own body, and the normal points out of the other body.
    pub contact: ContactPoint<D>,
    /// Gap, [length]; negative for an overlap.
    pub gap: f64,
    /// Motion along the other body in the step, [length].
    pub slip: f64,
}

impl<const D: usize> Contact<D> {
    /// The state of all pairs of bodies at the last evaluation. All ranks must call this together.
    pub(super) fn pair_states(&self, model: &Model<D>) -> Vec<PairState<D>> {
        let none = PairState { force: [0.0; D], overlap: 0.0, slip: 0.0, area: 0.0, contacts: Vec::new() };
        let mut states = vec![none; model.contacts.len()];
        if states.is_empty() {
            return states;
        }
        let forces = self.distributed();
        let between_bodies =
            self.touching().zip(&forces).filter(|((_, candidate, ..), _)| candidate.facet.is_some());
        let found = between_bodies.map(|((_, candidate, trial, touch), force)| {
            let (pressure, shear) = touch.parts(force);
            let per_area = 1.0 / candidate.area_for_stress();
            FacetPoint {
                pair: candidate.key.tool as usize - model.tools.len(),
                contact: ContactPoint {
                    body: candidate.body,
                    point: candidate.key.point,
                    part: 0,
                    position: trial.position,
                    normal: touch.normal(),
                    area: candidate.area,
                    force: *force,
                    pressure: pressure * per_area,
                    shear: shear.map(|t| t * per_area),
                    mode: touch.mode,
                },
                gap: touch.gap(),
                slip: norm(&touch.slip()),
            }
        });
        for found in gathered(&self.reduction, found.collect()) {
            let (state, second) = (&mut states[found.pair], model.contacts[found.pair].bodies[1]);
            let FacetPoint { contact, gap, slip, .. } = &found;
            let sign = if contact.body == second { 1.0 } else { -1.0 };
            (0..D).for_each(|d| state.force[d] += sign * contact.force[d]);
            state.overlap = state.overlap.max(-gap);
            state.area += contact.area;
            if contact.mode == Mode::Stick {
                state.slip = state.slip.max(*slip);
            }
            state.contacts.push(found);
        }
        states
    }
}
