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

/// The advice of this module, for the result files of a run.
pub const WORDING: Wording = Wording { on_failure, on_warning };

/// The remedy if steps are too large.
const SMALLER_STEPS: &str = "use smaller steps (`steps: {count, smallest}`)";
