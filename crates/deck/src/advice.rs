//! Advice in the words of the deck: what to do about the errors, failures and warnings that the core reports as data.

mod error;
mod failure;
#[cfg(test)]
mod tests;
mod warning;

pub use error::{against, on_error};
pub use failure::on_failure;
pub use warning::on_warning;

use mpm_files::summary::Wording;

/// The words of this module for the files of a run.
pub const WORDING: Wording = Wording { on_failure, on_warning };

/// The remedy for large steps.
const SMALLER_STEPS: &str = "use smaller steps (`steps: {count, smallest}`)";
