//! Overlap that contact points may keep in a step.
//!
//! The boxes of GIMP and of standard points keep their sides along the axes, whatever their corners do, and CPDI1
//! domains stay parallelograms: the corner of the new domain may lie inside a tool although the corner of the old
//! domain only touched it. A step that removed all of this overlap would begin far from equilibrium, and forces would
//! depend on the step size. A contact point therefore starts with the overlap it has, and loses this overlap along its
//! path; at rest, the overlap stays.

/// Path length over which the overlap of a contact point vanishes in one step, and falls to 1/e or less in many steps,
/// relative to the size of a cell, [-]. With half this length, the force on a pipe in clay differs by 1.1 % instead of
/// 0.7 % from the mean of the forces in the steps before and after, and is 1 % smaller.
const WAY: f64 = 2.0;

/// Overlap that a contact point may keep, [length]. Its gap at the start of the step is `gap`, the size of its cell is
/// `size`, and in the previous step it moved by `motion` and ended with an `excess` over its allowance, all [length].
/// Updates of the multipliers have left the excess and may remove it now.
pub(super) fn allowance(gap: f64, size: f64, motion: f64, excess: f64) -> f64 {
    (-gap - excess).max(0.0) * (1.0 - motion / (WAY * size)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_ends_along_the_way() {
        assert_eq!(allowance(0.2, 1.0, 0.0, 0.0), 0.0);
        assert_eq!(allowance(-1e-3, 1.0, 0.0, 1e-3), 0.0);
        assert_eq!(allowance(-0.2, 2.0, 2.0, 0.1), 0.05);
        assert_eq!(allowance(-0.2, 1.0, 2.0, 0.0), 0.0);
        // Many small steps remove as much overlap as a few larger steps, except for second-order terms.
        let after = |steps: usize| {
            (0..steps).fold(0.1, |overlap, _| allowance(-overlap, 1.0, 1.0 / steps as f64, 0.0))
        };
        assert!((after(1000) - 0.1 * (-0.5f64).exp()).abs() < 1e-4 && after(10) < after(1000));
    }

    #[test]
    fn contact_points_at_rest_keep_their_overlap() {
        assert_eq!((0..100).fold(0.1, |overlap, _| allowance(-overlap, 1.0, 0.0, 0.0)), 0.1);
    }
}
