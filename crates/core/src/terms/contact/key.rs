//! What identifies a contact point from step to step, and what it keeps.

use super::interface::Multiplier;
use crate::grid::MAX_CORNERS;

/// Corner number of the contact point at the position of a material point whose domain also has corners.
pub(super) const CENTRE: u32 = MAX_CORNERS as u32;
/// Corner number of a contact point on the first side of a domain; those on other sides follow.
pub(super) const FIRST_SIDE: u32 = CENTRE + 1;
/// What the corner number of a contact point grows by from one face of a re-entrant corner of a tool to the next.
pub(super) const FACE: u32 = 2 * MAX_CORNERS as u32;

/// Identifies a contact point that keeps its multipliers from step to step: a tool, and a corner of the domain of a
/// material point or [`CENTRE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Key {
    pub(super) tool: u32,
    /// Permanent number of the material point.
    pub(super) point: u32,
    pub(super) corner: u32,
}

impl Key {
    /// The key of a contact point of which several share the state that is kept: one for each facet of a body.
    pub(super) fn of_corner(self) -> Key {
        Key { corner: self.corner % FACE, ..self }
    }
}

/// True if a corner number is that of a contact point on a side.
pub(super) fn is_on_side(corner: u32) -> bool {
    corner % FACE >= FIRST_SIDE
}

/// What a contact point that touches a tool keeps for the next step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Kept<const D: usize> {
    pub(super) multiplier: Multiplier<D>,
    /// How far the contact point has moved in the step, in space or along the tool, whichever is larger, [length].
    pub(super) motion: f64,
    /// How far the overlap exceeded the allowed overlap at the end of the step, [length].
    pub(super) excess: f64,
}

impl<const D: usize> Kept<D> {
    /// The state with a share of the forces.
    pub(super) fn with_share(self, share: f64) -> Self {
        Kept { multiplier: self.multiplier.times(share), ..self }
    }

    /// The state of two contact points together.
    pub(super) fn joined(self, other: Self) -> Self {
        let [a, b] = [self.multiplier, other.multiplier];
        let shear = std::array::from_fn(|d| a.shear[d] + b.shear[d]);
        Kept {
            multiplier: Multiplier { normal: a.normal + b.normal, shear },
            motion: self.motion.max(other.motion),
            excess: self.excess.max(other.excess),
        }
    }
}
