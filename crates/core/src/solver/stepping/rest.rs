//! The end of a motion: bodies that move with inertia have come to rest.

use serde::{Deserialize, Serialize};

/// Kinetic energy below which bodies count as at rest, relative to the largest that they have had in the stage, [-].
const AT_REST: f64 = 1e-6;
/// Number of steps in succession that must end at rest: bodies that swing stand still for a moment.
const STEPS: u32 = 3;

/// The motion in a stage that runs until its bodies are at rest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StageRest {
    /// Number of the stage, from 0.
    pub stage: usize,
    /// Largest kinetic energy so far in the stage, [energy].
    pub largest: f64,
    /// Number of steps in succession that have ended at rest.
    pub still: u32,
}

impl StageRest {
    /// Records the kinetic energy at the end of a step, [energy].
    pub(crate) fn follow(&mut self, kinetic: f64) {
        self.largest = self.largest.max(kinetic);
        self.still = if kinetic < AT_REST * self.largest { self.still + 1 } else { 0 };
    }

    /// True once the bodies are at rest.
    pub fn is_reached(&self) -> bool {
        self.still >= STEPS
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_of_standstill_is_no_rest() {
        let mut rest = StageRest::default();
        for kinetic in [0.0, 1.0, 4.0, 1e-9, 2.0, 1e-6, 1e-7] {
            rest.follow(kinetic);
            assert!(!rest.is_reached(), "{kinetic}");
        }
        rest.follow(1e-8);
        assert!(rest.is_reached());
    }
}
