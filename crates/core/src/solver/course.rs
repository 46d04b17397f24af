//! The course of the iterations of a step, and what it says of how they will go on.

use crate::linear::Solved;

use super::forcing::Forcing;
use super::residual::RoundOff;
use crate::step::Nodal;

/// A tangent may be kept after an iteration that leaves at most this part of what was out of balance.
const FAST: f64 = 0.1;
/// Iterations stall that leave more than this part of what was out of balance.
const STALLS: f64 = 0.5;

/// What the iterations of a step leave behind beside the unknowns.
pub(super) struct Course<const N: usize> {
    pub(super) residuals: Vec<f64>,
    /// What round-off has to do with the last of them.
    pub(super) round_off: RoundOff,
    pub(super) solved: Vec<Solved>,
    /// Out-of-balance force of the last evaluation, [force].
    pub(super) out_of_balance: Nodal<N>,
    /// Internal force of the state that the step starts from.
    pub(super) f_int_start: Nodal<N>,
    /// Whether the last iterative displacement had to be shortened.
    pub(super) shortened: bool,
}

impl<const N: usize> Course<N> {
    pub(super) fn new() -> Self {
        Course {
            residuals: Vec::new(),
            round_off: RoundOff::NoMatter,
            solved: Vec::new(),
            out_of_balance: Vec::new(),
            f_int_start: Vec::new(),
            shortened: false,
        }
    }

    /// Iterations of the linear solver; 0 where it is direct.
    pub(super) fn linear_iterations(&self) -> usize {
        self.solved.iter().map(|solved| solved.iterations).sum()
    }

    /// Whether the last evaluation is one of equilibrium. Where round-off keeps it from the tolerance, the iterations first
    /// come as near as they can.
    pub(super) fn is_equilibrium(&self, tolerance: f64) -> bool {
        let [.., before, now] = self.residuals[..] else { return false };
        match self.round_off {
            RoundOff::NoMatter => now <= tolerance,
            RoundOff::OfNothing => true,
            RoundOff::Limits => now > STALLS * before,
            RoundOff::Forbids => false,
        }
    }

    /// Whether round-off keeps the step from equilibrium: two iterations have not made the residual smaller, and what is out
    /// of balance is round-off.
    pub(super) fn is_hopeless(&self) -> bool {
        let [.., first, second, third] = self.residuals[..] else { return false };
        self.round_off == RoundOff::Forbids && third > STALLS * second && second > STALLS * first
    }

    /// Whether the last iteration has left little of what was out of balance.
    pub(super) fn falls_fast(&self) -> bool {
        let [.., before, now] = self.residuals[..] else { return false };
        now <= FAST * before
    }

    /// What the next residual will be if the iterations converge quadratically and linear equations leave what they may.
    /// Infinite where nothing is known: before two iterations, and before as many as the step before took, as those that
    /// rotate a body begin in great strides which say nothing.
    pub(super) fn forecast(&self, forcing: &Forcing, of_last_step: usize) -> f64 {
        match self.residuals[..] {
            [_, .., before, now] if of_last_step > 0 && self.residuals.len() >= of_last_step => {
                let reduction = now / before;
                now * (reduction * reduction).max(forcing.last())
            }
            _ => f64::INFINITY,
        }
    }
}
