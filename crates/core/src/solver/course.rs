//! The course of the iterations of a step, the forecast that follows from it, and the tolerance of linear solves within
//! the iterations: choice 2 of Eisenstat and Walker (1996).

use crate::linear::{LinearError, Solved};
use crate::step::Nodal;

use super::residual::RoundOff;

/// A tangent may be kept after an iteration that leaves at most this fraction of the out-of-balance force, [-].
const FAST: f64 = 0.1;
/// Iterations stall if they leave more than this fraction of the out-of-balance force, [-].
const STALLS: f64 = 0.5;

/// The data of the iterations of a step, apart from the unknowns.
pub(super) struct Course<const N: usize> {
    pub(super) residuals: Vec<f64>,
    /// The last residual of each field, the displacement first, [-]; empty if there are no further fields.
    pub(super) by_field: Vec<f64>,
    /// How round-off affects the last residual.
    pub(super) round_off: RoundOff,
    pub(super) solved: Vec<Solved>,
    /// The tolerances of the linear solves.
    pub(super) forcing: Forcing,
    /// Number of increments solved with sliding contact points supported, and the last failure of a solve without this
    /// support.
    pub(super) supported: usize,
    pub(super) singular: Option<LinearError>,
    /// Out-of-balance force of the last evaluation, [force].
    pub(super) out_of_balance: Nodal<N>,
    /// Internal force at the start of the step.
    pub(super) f_int_start: Nodal<N>,
    /// True if the last iterative displacement had to be shortened.
    pub(super) shortened: bool,
    /// Number of multiplier updates, and number of linear solves before the last update.
    pub(super) augmentations: usize,
    pub(super) solves_before: usize,
    /// Largest number of linear solves from one multiplier update to the next.
    pub(super) most_solves: usize,
    /// True if no increment has followed the last multiplier update.
    pub(super) is_augmented: bool,
    /// True if multipliers were updated along the last increment, and along any increment of the step.
    pub(super) is_augmented_along: bool,
    pub(super) was_augmented_along: bool,
}

impl<const N: usize> Course<N> {
    pub(super) fn new() -> Self {
        Course {
            residuals: Vec::new(),
            by_field: Vec::new(),
            round_off: RoundOff::NoMatter,
            solved: Vec::new(),
            forcing: Forcing::default(),
            supported: 0,
            singular: None,
            out_of_balance: Vec::new(),
            f_int_start: Vec::new(),
            shortened: false,
            augmentations: 0,
            solves_before: 0,
            most_solves: 0,
            is_augmented: false,
            is_augmented_along: false,
            was_augmented_along: false,
        }
    }

    /// Records a multiplier update after this number of linear solves.
    pub(super) fn augmented(&mut self, solves: usize) {
        self.augmentations += 1;
        self.most_solves = self.most_solves.max(solves - self.solves_before);
        self.solves_before = solves;
        self.is_augmented = true;
    }

    /// Number of iterations of the linear solver; 0 for a direct solver.
    pub(super) fn linear_iterations(&self) -> usize {
        self.solved.iter().map(|solved| solved.iterations).sum()
    }

    /// True if the last iterate evaluated is in equilibrium. If round-off prevents the tolerance from being met, the
    /// iterations first come as close as they can.
    pub(super) fn is_equilibrium(&self, tolerance: f64) -> bool {
        let [.., before, now] = self.residuals[..] else { return false };
        match self.round_off {
            RoundOff::NoMatter => now <= tolerance,
            RoundOff::Nothing => true,
            RoundOff::Limits => now > STALLS * before,
            RoundOff::Forbids => false,
        }
    }

    /// True if round-off prevents equilibrium: neither of the last two iterations has halved the residual, and the
    /// out-of-balance force is round-off.
    pub(super) fn is_hopeless(&self) -> bool {
        let [.., first, second, third] = self.residuals[..] else { return false };
        self.round_off == RoundOff::Forbids && third > STALLS * second && second > STALLS * first
    }

    /// True if the last iteration left little of the out-of-balance force.
    pub(super) fn falls_fast(&self) -> bool {
        let [.., before, now] = self.residuals[..] else { return false };
        now <= FAST * before
    }

    /// The next residual, provided that the iterations converge quadratically and each linear solve leaves as large a
    /// residual as its tolerance allows. Infinite if no forecast is possible: in the first step, before two iterations,
    /// and for iterations with a lower number than the last one of the previous step, because in a step that rotates a
    /// body, the first increments are large and predict nothing.
    pub(super) fn forecast(&self, last_count: usize) -> f64 {
        match self.residuals[..] {
            [_, .., before, now] if last_count > 0 && self.residuals.len() >= last_count => {
                let reduction = now / before;
                now * (reduction * reduction).max(self.forcing.last())
            }
            _ => f64::INFINITY,
        }
    }
}

/// Tolerance of the first solve in a step, [-].
const FIRST: f64 = 1e-3;
/// Largest tolerance, [-]. It is so small that the safeguard of choice 2, which keeps large tolerances from falling too
/// quickly, could never act.
const LARGEST: f64 = 1e-2;
/// γ and α of choice 2.
const GAMMA: f64 = 0.9;
const ALPHA: i32 = 2;
/// A solve need not reduce the residual below this fraction of the tolerance of the Newton iterations, [-].
const ENOUGH: f64 = 0.01;

/// The tolerances of the linear solves of a step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Forcing {
    /// Norm of the right-hand side and tolerance of the previous solve.
    last: Option<[f64; 2]>,
}

impl Forcing {
    /// Relative tolerance of the last linear solve, [-].
    pub(super) fn last(&self) -> f64 {
        self.last.map_or(0.0, |[_, eta]| eta)
    }

    /// Relative tolerance of the next linear solve, given the norm of its right-hand side, [force], the residual of eq.
    /// (40) before the solve, and the largest residual that counts as equilibrium, [-].
    pub(super) fn next(&mut self, norm: f64, residual: f64, tolerance: f64) -> f64 {
        let mut eta = match self.last {
            None => FIRST,
            Some([before, _]) => {
                let wanted = GAMMA * (norm / before).powi(ALPHA);
                // Not for the first solve: the residual before it does not contain the reactions yet.
                wanted.max(ENOUGH * tolerance / residual)
            }
        };
        if eta.is_nan() {
            eta = FIRST;
        }
        eta = eta.min(LARGEST);
        self.last = Some([norm, eta]);
        eta
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// If each iteration leaves the residual of the linear solve plus half the square of the previous residual, a few
    /// iterations suffice to meet the tolerance, and the last residual does not fall far below it.
    #[test]
    fn newton_iterations_stay_nearly_quadratic() {
        let (mut forcing, mut residual, mut history) = (Forcing::default(), 0.3f64, Vec::new());
        while residual > 1e-9 {
            history.push(residual);
            let eta = forcing.next(residual, residual, 1e-9);
            residual = 0.5 * residual * residual + eta * residual;
            assert!(history.len() < 10, "{history:?}");
        }
        assert_eq!(history.len(), 4, "{history:?}");
        assert!(residual > 1e-12, "{residual:e}");
    }
}
