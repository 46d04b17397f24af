//! Errors in formulas.

use thiserror::Error;

/// An error in the text of a formula, with its location.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct FormulaError {
    /// The message, a fragment in lower case.
    pub message: String,
    /// Offset of the faulty part of the text, [byte].
    pub offset: usize,
    /// Length of the faulty part, [byte]; 0 at the end of the text, and where the nesting becomes too deep.
    pub length: usize,
    /// The remedy.
    pub help: Option<String>,
}
