//! Jumps: increments whose ends no continuous path of states connects.

use super::path::{Control, Target};
use super::solution::solve;
use super::state::ElementState;
use crate::material::Material;

/// Change of the elastic strain, relative to the prescribed change, beyond which a jump is possible, [-].
const SUDDEN: f64 = 2.0;
/// Largest change of the elastic strain that counts as round-off, [-].
const LEAST: f64 = 1e-10;
/// Number of halvings of the increment.
const HALVINGS: usize = 10;
/// A change is a jump if the last part of the repeatedly halved increment contains more than this share of the change,
/// [-].
const REMAINS: f64 = 0.5;

/// True if most of the change from `start` to `end`, the state at `target`, is sudden: it stays within one part of the
/// increment, however often the increment is halved. A softening point whose elastic strain releases more than its
/// plastic flow takes up would have to go back along the path (snap-back); it jumps to another state instead.
pub(super) fn is_between(
    law: &dyn Material,
    start: &ElementState,
    target: &Target,
    end: &ElementState,
) -> bool {
    let whole = change(start, end);
    if whole <= LEAST || whole <= SUDDEN * prescribed(start, target, end) {
        return false;
    }
    let (mut start, mut target, mut end) = (start.clone(), *target, end.clone());
    for _ in 0..HALVINGS {
        let half = target.between(&start, 0.5);
        let Ok(middle) = solve(law, &start, &half) else { return false };
        let Ok(last) = solve(law, &middle, &target) else { return false };
        if change(&start, &middle) > change(&middle, &last) {
            (target, end) = (half, middle);
        } else {
            (start, end) = (middle, last);
        }
    }
    change(&start, &end) > REMAINS * whole
}

/// Norm of the change of the elastic strain, [-].
fn change(start: &ElementState, end: &ElementState) -> f64 {
    (end.elastic_strain - start.elastic_strain).norm()
}

/// The prescribed change of an increment, expressed as a strain, [-]. For prescribed stresses, it is the elastic strain
/// that corresponds to their change.
fn prescribed(start: &ElementState, target: &Target, end: &ElementState) -> f64 {
    let (before, after) = (start.cauchy_stress(), end.cauchy_stress());
    let compliance = change(start, end) / (after - before).norm().max(f64::MIN_POSITIVE);
    let on_axis = |axis: usize| match target.axes[axis] {
        Control::Strain(to) => to - start.strain.0[axis],
        Control::Stress(to) => (to - before.0[axis]) * compliance,
    };
    let turned = (end.strain - start.strain).0;
    let parts =
        [on_axis(0), on_axis(1), on_axis(2), turned[3], turned[4], turned[5], target.shear - start.shear];
    parts.iter().map(|part| part * part).sum::<f64>().sqrt()
}
