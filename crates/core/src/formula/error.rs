//! What is wrong with a formula.

use thiserror::Error;

/// What is wrong with the text of a formula, and where.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{message}")]
pub struct FormulaError {
    /// The fault, as a fragment in lower case.
    pub message: String,
    /// Byte at which the faulty part of the text starts.
    pub offset: usize,
    /// Length of the faulty part in bytes; 0 at the end of the text.
    pub length: usize,
    /// What to do about it.
    pub help: Option<String>,
}
