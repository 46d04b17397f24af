//! Damped iterations, the last resort for a step that Newton's method does not solve.
//!
//! An iteration solves (K + μ D) δd = f_ext − f_int, where D is the diagonal of the first stiffness of the step. With a
//! large μ, the iterations descend the potential in small steps, and so pass through regions where K is nearly singular
//! or not positive definite; μ = 0 is Newton's method (Levenberg 1944; as pseudo-transient continuation: Kelley and
//! Keyes 1998, doi 10.1137/S0036142996304796). Damping changes only the way to equilibrium, not its definition; an
//! equilibrium whose stiffness is not positive definite is not accepted.

use crate::assembly::System;
use crate::model::{BoundaryCondition, Model};
use crate::points::Points;
use crate::ranks::Reduction;

use crate::step::Nodal;
use crate::terms::Terms;

use super::diagnosis::evidence::points_that_flow;

/// Largest number of evaluations in the line search of a damped iteration, and of halvings of an increment that a point
/// cannot follow.
pub(super) const MAX_TRIALS: usize = 10;
/// Largest number of factorisations in the search for a positive definite stiffness.
pub(super) const MAX_FACTORISATIONS: usize = 30;

/// Largest undamped displacement of bodies at rest, relative to the cell size; a larger one means that nothing resists
/// the motion, [-].
pub(super) const AT_REST: f64 = 1e-3;

/// The points are given a fresh grid once a node has moved by more than this fraction of the smallest cell, [-].
pub(super) const STRIDE: f64 = 0.5;
/// Largest number of fresh grids in a step.
pub(super) const MAX_GRIDS: usize = 300;

/// Bodies count as collapsing if more than this share of their points has yielded, [-].
const COLLAPSES: f64 = 0.2;

/// Largest number of successive fresh grids that may fail to leave an unstable equilibrium before the step is given up.
pub(super) const MAX_RESTS: usize = 3;

/// μ of the first iteration, [-].
const FIRST: f64 = 1e-4;
/// Smallest μ after an increase, [-].
const MIN_FACTOR: f64 = 1e-6;
/// Factor by which μ changes from iteration to iteration.
const CHANGE: f64 = 4.0;

/// True if collapsing bodies may slump until they come to rest: they must yield, all terms must allow it, and there
/// must be no prescribed motions. A prescribed motion would be applied again on every grid, and bodies that do not
/// yield do not collapse: they buckle or have an hourglass mode.
pub(super) fn may_slump<const D: usize, const N: usize>(
    model: &Model<D>,
    points: &Points<D>,
    terms: &Terms<D, N>,
) -> bool {
    terms.iter().all(|term| term.character(model).may_slump)
        && !model.boundary_conditions.iter().any(BoundaryCondition::moves)
        && {
            let count = |n: usize| points.reduction().count_all(n) as f64;
            count(points_that_flow(model, points)) / count(points.len()).max(1.0) > COLLAPSES
        }
}

/// Largest component of a nodal displacement, [length].
pub(super) fn farthest<const N: usize>(displacement: &[[f64; N]]) -> f64 {
    displacement.iter().flatten().fold(0.0, |far, u| f64::max(far, u.abs()))
}

/// Work absorbed by damping over a displacement, [energy]: the contribution of the out-of-balance force at its end to
/// the trapezoidal rule.
pub(super) fn work<const N: usize>(
    reduction: &Reduction,
    out_of_balance: &[[f64; N]],
    delta_d: &[[f64; N]],
) -> f64 {
    0.5 * reduction.dot(out_of_balance, delta_d)
}

/// The damping of an iteration.
pub(super) struct Damping<const N: usize> {
    /// μ, [-].
    factor: f64,
    /// D, per node, [force/length].
    stiffness: Nodal<N>,
}

impl<const N: usize> Damping<N> {
    /// The damping of the first iteration of a step, from its stiffness.
    pub(super) fn new(system: &System<N>) -> Self {
        Damping { factor: FIRST, stiffness: system.diagonal() }
    }

    /// Adapts μ for the next iteration: smaller if the last increment was applied in full, larger if it had to be
    /// shortened.
    pub(super) fn adapt(&mut self, shortened: bool) {
        self.factor = if shortened { (CHANGE * self.factor).max(MIN_FACTOR) } else { self.factor / CHANGE };
    }

    /// Adds μ D to K.
    pub(super) fn add_to(&self, system: &mut System<N>) {
        system.add_to_diagonal(self.factor, &self.stiffness);
    }

    /// Increases μ by the factor [`CHANGE`], but at least by [`MIN_FACTOR`], in K + μ D, which is not positive definite.
    pub(super) fn increase(&mut self, system: &mut System<N>) {
        let more = ((CHANGE - 1.0) * self.factor).max(MIN_FACTOR);
        system.add_to_diagonal(more, &self.stiffness);
        self.factor += more;
    }
}
