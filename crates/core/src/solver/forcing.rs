//! The tolerance of linear solves within Newton iterations: choice 2 of Eisenstat and Walker (1996).

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
