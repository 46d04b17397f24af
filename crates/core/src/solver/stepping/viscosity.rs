//! The use of viscosity from step to step: it is taken up when a small step fails, grows when a small step with it fails,
//! shrinks where it takes up much of the work, and is given up again after some steps of full size.

use serde::{Deserialize, Serialize};

/// Number of steps of full size with viscosity before a step without it is tried; it doubles each time that this step
/// fails, at most this number of times.
const STEPS: u32 = 4;
const MOST_DOUBLINGS: u32 = 4;
/// Factor by which the relaxation time grows, and how often it may grow.
const GROWTH: f64 = 4.0;
const MOST_GROWTHS: i32 = 2;
/// Share of the work of the prescribed motions that viscosity may dissipate, [-]; beyond it, the relaxation time shrinks
/// by the same factor, this number of times at most.
const MOST_WORK: f64 = 0.01;
const MOST_REDUCTIONS: i32 = 5;

/// Whether viscosity is in use.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Viscosity {
    is_used: bool,
    /// True until the first step after viscosity has been given up.
    is_tested: bool,
    /// Number of steps of full size with viscosity that have succeeded.
    steps: u32,
    /// Number of times that the step without viscosity has failed.
    failures: u32,
    /// Number of times that the relaxation time has grown, less that of its reductions.
    growths: i32,
    /// True once a small step with viscosity has failed: the relaxation time shrinks no further.
    #[serde(default)]
    is_least: bool,
}

impl Viscosity {
    /// The relaxation time relative to the first one, [-]; `None` if viscosity is not in use.
    pub(super) fn growth(self) -> Option<f64> {
        self.is_used.then(|| GROWTH.powi(self.growths))
    }

    /// Viscosity where a small step has failed: taken up or, if it was in use, with a longer relaxation time; `None` if
    /// that has grown often enough.
    pub(super) fn stuck(self) -> Option<Self> {
        let growths = self.growths + i32::from(self.is_used);
        (growths <= MOST_GROWTHS).then(|| Viscosity { growths, is_least: self.is_used, ..self.used() })
    }

    /// After a step that has converged, in which viscosity has dissipated this share of the work of the prescribed
    /// motions, [-].
    pub(super) fn limited(self, share: f64) -> Self {
        let shrinks = self.is_used && !self.is_least && share > MOST_WORK && self.growths > -MOST_REDUCTIONS;
        Viscosity { growths: self.growths - i32::from(shrinks), ..self }
    }

    fn used(self) -> Self {
        Viscosity { is_used: true, is_tested: false, steps: 0, ..self }
    }

    /// After a step that has converged, which had the full size or a smaller one.
    pub(super) fn succeeded(self, is_full: bool) -> Self {
        if !self.is_used {
            return Viscosity { is_tested: false, ..self };
        }
        let steps = self.steps + u32::from(is_full);
        let is_given_up = steps >= STEPS << self.failures.min(MOST_DOUBLINGS);
        Viscosity { is_used: !is_given_up, is_tested: is_given_up, steps, ..self }
    }

    /// After a step that has failed: takes up viscosity again if that was the first step without it, otherwise `None`.
    pub(super) fn failed(self) -> Option<Self> {
        self.is_tested.then(|| Viscosity { failures: self.failures.saturating_add(1), ..self.used() })
    }
}
