//! Reduction of strength: the factors between which equilibrium ceases to be found.

use serde::{Deserialize, Serialize};

/// Factors by which the strength of the materials was divided in a stage of
/// [`Control::StrengthReduction`](crate::model::Control::StrengthReduction). The factor of safety lies between both.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StrengthBracket {
    /// The largest factor with equilibrium, [-]; `None` if none was found.
    pub stands: Option<f64>,
    /// The factor without equilibrium that ended the stage, [-]; `None` if it has not ended so.
    pub fails: Option<f64>,
}
