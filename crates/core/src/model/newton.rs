//! How the Newton iterations of a load step are controlled.

use serde::{Deserialize, Serialize};

use crate::linear::Choice;

/// Control of the Newton iterations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Newton {
    /// Largest relative out-of-balance force, eq. (40), of an equilibrated step, [-].
    pub tolerance: f64,
    /// Largest number of linear solves in a step.
    pub max_iterations: usize,
    /// How their linear equations are solved.
    pub linear: Choice,
    /// Where the iterations begin.
    pub predictor: Predictor,
    /// When the stiffness is factorised.
    pub tangent: Tangent,
    /// For which equations an analysis of their pattern serves.
    pub pattern: Patterns,
}

impl Default for Newton {
    fn default() -> Self {
        Newton {
            tolerance: 1e-9,
            max_iterations: 20,
            linear: Choice::Auto,
            predictor: Predictor::None,
            tangent: Tangent::Fresh,
            pattern: Patterns::Same,
        }
    }
}

/// Where the iterations of a step begin.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Predictor {
    /// With the solution of the equations at the start of the step.
    #[default]
    None,
    /// With the displacement increment of the step before, scaled to the length of the step, in place of the first
    /// solution of the equations. Where that leaves more out of balance than there was at the start, it is dropped.
    LastStep,
}

/// When the stiffness is factorised within a step. A preconditioner is always set up as with `kept`, which does not change
/// what the equations are.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Tangent {
    /// In each iteration.
    #[default]
    Fresh,
    /// In the first iteration, and after one that has not made the out-of-balance force ten times smaller.
    Kept,
}

/// For which equations an order of elimination and the layout of the factor serve.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Patterns {
    /// For equations of the same pattern.
    #[default]
    Same,
    /// Also for equations whose pattern is part of it.
    Contained,
}
