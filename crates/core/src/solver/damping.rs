//! Damped iterations, the last resort of a step that Newton's method does not solve.
//!
//! An iteration solves (K + μ D) δd = f_ext − f_int with the diagonal D of the first stiffness of the step. A large μ goes
//! down the slope of the potential in small strides, which leads through regions where K is nearly singular or not positive
//! definite; μ = 0 is Newton's method (Levenberg 1944; as a pseudo time: Kelley and Keyes 1998, doi
//! 10.1137/S0036142996304796). Only the way to equilibrium changes, not what equilibrium is;
//! one whose stiffness is not positive definite is not accepted.

use crate::assembly::System;
use crate::model::{Action, BoundaryCondition, Load, Model};
use crate::points::Points;

use crate::step::Nodal;

use super::evidence::share_that_flows;

/// Damped iterations may be so many times as many as others.
pub(super) const MORE_ITERATIONS: usize = 10;
/// Most evaluations of the line search of a damped iteration, and most halvings of one that turns a point inside out.
pub(super) const MOST_TRIALS: usize = 10;
/// Most factorisations until the stiffness is positive definite.
pub(super) const MOST_FACTORISATIONS: usize = 30;

/// What is left to move without damping, relative to a cell, is more where nothing resists it.
pub(super) const AT_REST: f64 = 1e-3;

/// Points that have moved by more than this part of a cell are given a fresh grid, [-] …
pub(super) const STRIDE: f64 = 0.5;
/// … up to so many times in a step.
pub(super) const MOST_GRIDS: usize = 300;

/// Bodies collapse where more than this share of their points has yielded, [-].
const COLLAPSES: f64 = 0.2;

/// An equilibrium that is not stable is left on a fresh grid, or else given up after so many of them.
pub(super) const MOST_RESTS: usize = 3;

/// μ of the first iteration, [-].
const FIRST: f64 = 1e-4;
/// A damping that has to grow is this at least, [-].
const LEAST: f64 = 1e-6;
/// By which μ changes from iteration to iteration.
const CHANGE: f64 = 4.0;

/// Whether bodies that collapse may slump to where they can stand: where they flow, under nothing but weight. A prescribed
/// motion would be applied afresh on every grid; where other loads are more than the bodies carry, that is what a run is to
/// find out; and what does not flow does not collapse, but buckles or is an hourglass.
pub(super) fn may_slump<const D: usize>(model: &Model<D>, points: &Points<D>) -> bool {
    let is_weight = |load: &Load<D>| matches!(load.action, Action::Gravity(_));
    model.loads.iter().all(is_weight)
        && !model.boundary_conditions.iter().any(BoundaryCondition::moves)
        && share_that_flows(model, points) > COLLAPSES
}

/// Largest component of a nodal displacement, [length].
pub(super) fn farthest<const N: usize>(displacement: &[[f64; N]]) -> f64 {
    displacement.iter().flatten().fold(0.0, |far, u| f64::max(far, u.abs()))
}

/// Work that damping takes over a displacement, [energy]: the share that the trapezoidal rule gives to what is out of balance
/// at its end.
pub(super) fn work<const N: usize>(out_of_balance: &[[f64; N]], delta_d: &[[f64; N]]) -> f64 {
    0.5 * out_of_balance.iter().flatten().zip(delta_d.iter().flatten()).map(|(f, u)| f * u).sum::<f64>()
}

/// The damping of an iteration.
pub(super) struct Damping<const N: usize> {
    /// μ, [-].
    factor: f64,
    /// D, per node, [force/length].
    stiffness: Nodal<N>,
}

impl<const N: usize> Damping<N> {
    /// For the first iteration of a step, from its stiffness.
    pub(super) fn new(system: &System<N>) -> Self {
        Damping { factor: FIRST, stiffness: system.diagonal() }
    }

    /// For the next iteration: less if the whole of the last one served, more if it had to be shortened.
    pub(super) fn adapt(&mut self, shortened: bool) {
        self.factor = if shortened { (CHANGE * self.factor).max(LEAST) } else { self.factor / CHANGE };
    }

    /// K + μ D.
    pub(super) fn add_to(&self, system: &mut System<N>) {
        system.add_to_diagonal(self.factor, &self.stiffness);
    }

    /// From K + μ D to K + CHANGE μ D, where the former is not positive definite.
    pub(super) fn increase(&mut self, system: &mut System<N>) {
        let more = ((CHANGE - 1.0) * self.factor).max(LEAST);
        system.add_to_diagonal(more, &self.stiffness);
        self.factor += more;
    }
}
