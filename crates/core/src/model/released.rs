//! The forces that a stage releases, and the material that carries them.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::grid::element::corner_side;
use crate::points::Points;
use crate::surface::sides_of_domain;

/// Forces that keep the state at the start of a stage in equilibrium. They keep their direction, move with the material
/// that carries them, and decrease to zero, linearly over the stage.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Released<const D: usize> {
    /// Forces on the sides of domains that the stage has exposed, [force].
    pub sides: Vec<SideForce<D>>,
    /// Permanent numbers of points and the forces on them, [force].
    pub points: Vec<(u32, [f64; D])>,
    /// Lasting numbers of nodes and the forces on them that no material can carry, [force].
    pub nodes: Vec<(u32, [f64; D])>,
    /// Number of cuts of points before the stage; those after it share out the forces of the cut points.
    pub cuts_before: usize,
}

/// A force on the side of a domain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SideForce<const D: usize> {
    /// Permanent number of the point.
    pub point: u32,
    /// Number of corners of its domain, and of its halves if it is split.
    pub corners: u8,
    /// Number of the side, see [`sides_of_domain`].
    pub side: u8,
    /// The force, [force].
    pub force: [f64; D],
}

/// Released forces as checkpoints store them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SavedRelease {
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    sides: Vec<(u32, [u8; 2], Vec<f64>)>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    points: Vec<(u32, Vec<f64>)>,
}

impl<const D: usize> Released<D> {
    /// True if there are no forces.
    pub fn is_empty(&self) -> bool {
        self.sides.is_empty() && self.points.is_empty() && self.nodes.is_empty()
    }

    /// The forces on the material, for a checkpoint.
    pub fn save(&self) -> SavedRelease {
        let side = |side: &SideForce<D>| (side.point, [side.corners, side.side], side.force.to_vec());
        SavedRelease {
            sides: self.sides.iter().map(side).collect(),
            points: self.points.iter().map(|(id, force)| (*id, force.to_vec())).collect(),
        }
    }

    /// Restores the forces on the material that [`Released::save`] returned; `None` if they are not forces in `D`
    /// dimensions.
    pub fn restore(&mut self, saved: &SavedRelease) -> Option<()> {
        let vector = |force: &[f64]| -> Option<[f64; D]> {
            force.try_into().ok().filter(|force: &[f64; D]| force.iter().all(|f| f.is_finite()))
        };
        let side = |(point, [corners, side], force): &(u32, [u8; 2], Vec<f64>)| {
            Some(SideForce { point: *point, corners: *corners, side: *side, force: vector(force)? })
        };
        self.sides = saved.sides.iter().map(side).collect::<Option<_>>()?;
        let point = |(id, force): &(u32, Vec<f64>)| Some((*id, vector(force)?));
        self.points = saved.points.iter().map(point).collect::<Option<_>>()?;
        Some(())
    }

    /// The forces as the present points carry them: halves of cut points share the forces of the whole equally.
    pub fn shared_out(&self, points: &Points<D>) -> Released<D> {
        let cuts = points.cuts.get(self.cuts_before..).unwrap_or_default();
        if cuts.is_empty() {
            return self.clone();
        }
        let mut on_points: BTreeMap<u32, [f64; D]> = self.points.iter().copied().collect();
        let mut on_sides: BTreeMap<(u32, u8), SideForce<D>> =
            self.sides.iter().map(|side| ((side.point, side.side), *side)).collect();
        for cut in cuts {
            if let Some(force) = on_points.get_mut(&cut.point) {
                *force = force.map(|f| 0.5 * f);
                let half = *force;
                on_points.insert(cut.half, half);
            }
            let whole: Vec<SideForce<D>> =
                on_sides.range((cut.point, 0)..=(cut.point, u8::MAX)).map(|(_, side)| *side).collect();
            for side in whole {
                let shares = shares_of_halves(&side, cut.edge);
                for (point, share) in [cut.point, cut.half].into_iter().zip(shares) {
                    let force = side.force.map(|f| share * f);
                    on_sides.insert((point, side.side), SideForce { point, force, ..side });
                }
            }
        }
        let (points, sides) = (on_points.into_iter().collect(), on_sides.into_values().collect());
        Released { points, sides, nodes: self.nodes.clone(), cuts_before: self.cuts_before }
    }
}

/// The shares of the first and the second half of a domain in the force on one of its sides, when the domain is cut
/// across this edge, [-].
fn shares_of_halves<const D: usize>(carrier: &SideForce<D>, edge: [u8; 2]) -> [f64; 2] {
    let n = usize::from(carrier.corners);
    let Some(side) = sides_of_domain::<D>(n).nth(usize::from(carrier.side)) else { return [0.5; 2] };
    let [a, b] = edge.map(usize::from);
    // The corners that remain with the first half, and those that remain with the second.
    let is_beside = |end: usize, corner: usize| {
        if n == 1 << D {
            let axis = (a ^ b).trailing_zeros() as usize;
            corner_side::<D>(corner)[axis] == corner_side::<D>(end)[axis]
        } else {
            corner == end
        }
    };
    let has = |end: usize| side.corners().iter().any(|&corner| is_beside(end, corner));
    match [has(a), has(b)] {
        [true, false] => [1.0, 0.0],
        [false, true] => [0.0, 1.0],
        _ => [0.5; 2],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::DomainSide;

    #[test]
    fn halves_share_the_sides_that_a_cut_divides() {
        // The corners of a box are numbered with the first axis fastest, so the edge 01 is cut across the first axis.
        let shares = |corners: usize, ends: [usize; 2]| {
            let has = |side: &DomainSide| ends.iter().all(|k| side.corners().contains(k));
            let side = sides_of_domain::<2>(corners).position(|side| has(&side)).unwrap();
            let (corners, side) = (corners as u8, side as u8);
            shares_of_halves(&SideForce { point: 0, corners, side, force: [0.0; 2] }, [0, 1])
        };
        assert_eq!([[0, 1], [0, 2], [1, 3]].map(|ends| shares(4, ends)), [[0.5; 2], [1.0, 0.0], [0.0, 1.0]]);
        assert_eq!([[0, 1], [0, 2], [1, 2]].map(|ends| shares(3, ends)), [[0.5; 2], [1.0, 0.0], [0.0, 1.0]]);
    }

    #[test]
    fn checkpoints_keep_forces_on_the_material() {
        let released = Released::<2> {
            sides: vec![SideForce { point: 3, corners: 4, side: 1, force: [0.25, -1.0] }],
            points: vec![(7, [1e-3, 2.0])],
            ..Released::default()
        };
        let mut restored = Released::default();
        assert_eq!(restored.restore(&released.save()), Some(()));
        assert_eq!(restored, released);
        assert_eq!(Released::<3>::default().restore(&released.save()), None);
    }
}
