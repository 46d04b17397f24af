//! Advice in the words of the deck: what to do about the errors, failures and warnings that the core reports as data.

mod error;
mod failure;
mod means;
#[cfg(test)]
mod tests;
mod warning;

pub use error::{against, on_error};
pub use means::Means;

use mpm_core::quality::Warning;
use mpm_core::solver::Diagnosis;
use mpm_files::summary::Wording;

/// Advice on a warning of a run whose deck is unknown.
pub fn on_warning(warning: &Warning) -> String {
    warning::on_warning(warning, &Means::default())
}

impl Wording for Means {
    fn on_failure(&self, diagnosis: &Diagnosis) -> String {
        failure::on_failure(diagnosis, self)
    }

    fn on_warning(&self, warning: &Warning) -> String {
        warning::on_warning(warning, self)
    }
}
