//! Settings of the Newton iterations.

use serde::{Deserialize, Serialize};

use crate::linear::Choice;

/// Settings of the Newton iterations of a load step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newton {
    /// Tolerance: the largest relative out-of-balance force, eq. (40), of a converged step, [-].
    pub tolerance: f64,
    /// Largest number of linear solves in an attempt at a step, counted anew after each update of contact multipliers;
    /// a quarter more while the residual falls fast, and more for damped iterations and strength reductions.
    pub max_iterations: usize,
    /// Solver of the linear equations.
    pub linear: Choice,
    /// Initial guess of the iterations.
    pub predictor: Predictor,
    /// When the stiffness is factorised.
    pub tangent: StiffnessUpdate,
}

impl Default for Newton {
    fn default() -> Self {
        Newton {
            tolerance: 1e-9,
            max_iterations: 20,
            linear: Choice::Auto,
            predictor: Predictor::None,
            tangent: StiffnessUpdate::Fresh,
        }
    }
}

/// Initial guess of the iterations of a load step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Predictor {
    /// Starts with the solution of the equations linearised at the start of the step.
    #[default]
    None,
    /// Starts with the displacement increment of the previous step, scaled to the size of the step. Discarded unless it
    /// reduces the out-of-balance force.
    LastStep,
}

/// When the stiffness is factorised within a step. A preconditioner does not change the equations and is always reused
/// as with `kept`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum StiffnessUpdate {
    /// In every iteration.
    #[default]
    Fresh,
    /// In the first iteration, and after any iteration that reduces the out-of-balance force by less than a factor of
    /// ten.
    Kept,
}
