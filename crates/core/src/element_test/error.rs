//! Why an element test ends early.

use crate::material::MaterialError;

/// Why an element test cannot begin, or ends early.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ElementTestError {
    /// The law cannot begin with the initial stress.
    #[error("the law cannot begin with the initial stress: {0}")]
    Initial(MaterialError),
    /// A step has no solution.
    #[error(
        "step {step} has no solution beyond {reached} of its length, even in increments of 1/1024 of the step: {cause}"
    )]
    Step {
        /// Step number, from 1.
        step: usize,
        /// Fraction of the step up to which there are solutions, [-].
        reached: f64,
        /// Why there is no solution beyond this fraction.
        cause: Cause,
    },
}

/// Why a part of a step has no solution.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Cause {
    /// The law fails at the prescribed strain.
    #[error(transparent)]
    Law(#[from] MaterialError),
    /// The iterations find no strain that gives the prescribed stress.
    #[error(
        "no strain gives the prescribed stress; the nearest stress found differs by {difference:.3e} along {axis}"
    )]
    NoStrain {
        /// Largest difference between the prescribed stress and the nearest stress found, [stress].
        difference: f64,
        /// The axis along which this difference occurs.
        axis: char,
    },
}
