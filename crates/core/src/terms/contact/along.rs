//! Updates of the multipliers along an increment of Newton's method.
//!
//! If no contact point opens, and none begins or stops sliding, the increment and the multipliers that close all gaps
//! at its end follow from one linear system: K δd = r + Σ N_v δf, where δf is the force added by an update λ ← p,
//! λ_t ← t at the linearised end of the increment. Each update costs one substitution with the factors of K and divides
//! the error by about p_f. As long as the error falls like this, Newton's method converges quadratically to the
//! displacements and the multipliers together; if contact points hinder each other, further updates would only shift
//! forces between them.

use super::candidates::Candidate;
use super::evaluation::Trial;
use super::interface::{Added, Multiplier};
use super::motion::Moving;
use super::multipliers::Change;
use crate::region::vector::{along, minus};

/// A contact point at the linearised end of an increment.
pub(super) struct Followed<const D: usize> {
    /// Its multipliers after an update.
    pub(super) multiplier: Multiplier<D>,
    /// The force on the body that the update adds, [force].
    pub(super) force: [f64; D],
    /// What the update changes.
    pub(super) change: Option<Change<D>>,
}

/// A contact point at the linearised end of an increment of the nodes and of the unknown motions of its tool; `None` if
/// the contact point changes its state on the way.
pub(super) fn followed<const D: usize, const N: usize>(
    candidate: &Candidate<D>,
    multiplier: &Multiplier<D>,
    trial: &Trial<D>,
    moving: &Moving<D>,
    (delta, motions): (&[[f64; N]], &[f64]),
) -> Option<Followed<D>> {
    let u = candidate.displacement(delta);
    let (mut relative, mut slipping) = (u, u);
    let carried = minus(&trial.position, &trial.slip);
    for (&k, motion) in moving.free.iter().zip(motions) {
        relative = along(&relative, -motion, &moving.velocity(k, &trial.position).0);
        slipping = along(&slipping, -motion, &moving.velocity(k, &carried).0);
    }
    let Some(touch) = &trial.touch else {
        // The contact point stays open: its multipliers vanish and add no force.
        return (*multiplier == Multiplier::default()).then_some(Followed {
            multiplier: *multiplier,
            force: [0.0; D],
            change: None,
        });
    };
    let now = Multiplier { shear: moving.end.vector_to_space(&multiplier.shear), ..*multiplier };
    let Added { multiplier: next, force, overlap, slip } = touch.update_along(&now, &relative, &slipping)?;
    let next = Multiplier { shear: moving.end.vector_to_tool(&next.shear), ..next };
    let change = Change::new(overlap, &slip, &touch.normal());
    Some(Followed { multiplier: next, force, change: Some(change) })
}
