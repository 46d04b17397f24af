//! Reduction of strength: the factors between which equilibrium ceases to be found.

use std::fmt;

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

impl StrengthBracket {
    /// The fewest decimals, at least three, that keep both factors apart.
    fn decimals(&self) -> usize {
        match (self.stands, self.fails) {
            (Some(stands), Some(fails)) if fails > stands => {
                // The slack keeps round-off in the difference from costing a decimal.
                (-(fails - stands).log10() - 1e-6).ceil().clamp(3.0, 12.0) as usize
            }
            _ => 3,
        }
    }
}

impl fmt::Display for StrengthBracket {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let decimals = self.decimals();
        match (self.stands, self.fails) {
            (Some(stands), Some(fails)) => write!(
                f,
                "between {stands:.decimals$} (in equilibrium) and {fails:.decimals$} (no equilibrium found)"
            ),
            (Some(stands), None) => write!(f, "at least {stands:.decimals$}, the largest that was tried"),
            (None, Some(fails)) => write!(f, "below {fails:.decimals$} (no equilibrium found)"),
            (None, None) => write!(f, "unknown: no step of the reduction has ended"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bracket_in_words_keeps_its_factors_apart() {
        let words = |stands, fails| StrengthBracket { stands, fails }.to_string();
        assert_eq!(
            words(Some(1.378125), Some(1.38125)),
            "between 1.378 (in equilibrium) and 1.381 (no equilibrium found)"
        );
        assert_eq!(
            words(Some(1.378125), Some(1.378126)),
            "between 1.378125 (in equilibrium) and 1.378126 (no equilibrium found)"
        );
        assert_eq!(words(Some(1.6), None), "at least 1.600, the largest that was tried");
        assert_eq!(words(None, Some(1.003)), "below 1.003 (no equilibrium found)");
    }
}
