//! Why a report cannot be written.

use std::io;
use std::path::{Path, PathBuf};

use mpm_deck::quoting::{list, quote};
use strsim::jaro_winkler;

/// Why a directory holds no results.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoResults {
    /// It is a file.
    File,
    /// It is the directory of a study, which has those of its members in it.
    Study,
    /// There is no history of a run.
    Other,
}

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// There is nothing to report on.
    #[error("a report needs at least one directory of results")]
    Nothing,
    /// A directory without results.
    #[error("{} {}", shown(path), no_results(path, *hint))]
    NoResults {
        /// The directory.
        path: PathBuf,
        /// Why.
        hint: NoResults,
    },
    /// A file or directory that cannot be read.
    #[error("{} cannot be read: {error}", shown(path))]
    Unreadable {
        /// Its path.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// A file that is not as a run writes it; the error names it.
    #[error("a file of the results is damaged: {0}")]
    DamagedFile(io::Error),
    /// A file that is not as a run writes it.
    #[error("a file of the results is damaged: {}: {what}", path.display())]
    Damaged {
        /// Its path.
        path: PathBuf,
        /// What is wrong with it.
        what: String,
    },
    /// A field that the points do not have.
    #[error("the points have no field {}; {}", quote(name), instead(name, known))]
    NoField {
        /// Its name.
        name: String,
        /// The fields that they have.
        known: Vec<String>,
    },
    /// A component that a field does not have, or none where one is needed.
    #[error("{}", no_component(field, component.as_deref(), known))]
    NoComponent {
        /// Name of the field.
        field: String,
        /// The component.
        component: Option<String>,
        /// The components that it has.
        known: Vec<String>,
    },
    /// A load step whose points were not written.
    #[error("load step {step} was not written; there are {}", numbers(known))]
    NoStep {
        /// The step.
        step: usize,
        /// The steps that were written.
        known: Vec<usize>,
    },
    /// The report cannot be written.
    #[error("{} cannot be written: {error}", shown(path))]
    Unwritable {
        /// Its path.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
}

impl ReportError {
    /// An error of the file system, or of a reader that names the file.
    pub(super) fn unreadable(path: &Path, error: io::Error) -> ReportError {
        match error.kind() {
            io::ErrorKind::InvalidData if error.get_ref().is_some() => {
                let what = error.to_string();
                let what = what.strip_prefix(&format!("{}: ", path.display())).unwrap_or(&what);
                ReportError::Damaged { path: path.to_owned(), what: what.to_owned() }
            }
            _ => ReportError::Unreadable { path: path.to_owned(), error },
        }
    }

    /// An error of a reader that names the file.
    pub(super) fn from_reader(error: io::Error) -> ReportError {
        ReportError::DamagedFile(error)
    }
}

/// A path in full: it may have to be copied.
fn shown(path: &Path) -> String {
    format!("`{}`", path.display())
}

fn no_results(path: &Path, hint: NoResults) -> String {
    match hint {
        NoResults::File => "is a file, not a directory of results".to_owned(),
        NoResults::Study => {
            let members = path.join("*");
            format!("holds a study, not the results of one run; give its members: {}/", members.display())
        }
        NoResults::Other => {
            "holds no results: there is no `history.csv`; give the directory that `mpm run` has written"
                .to_owned()
        }
    }
}

fn instead(name: &str, known: &[String]) -> String {
    let near = known.iter().map(|other| (jaro_winkler(name, other), other));
    match near.filter(|(nearness, _)| *nearness > 0.8).max_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((_, best)) => format!("did you mean {}?", quote(best)),
        None => format!("there are {}", list(known.iter().map(String::as_str))),
    }
}

fn no_component(field: &str, component: Option<&str>, known: &[String]) -> String {
    let examples = list(
        known.iter().map(|name| format!("{field}:{name}")).collect::<Vec<_>>().iter().map(String::as_str),
    );
    match component {
        Some(_) if known.is_empty() => format!("{} has no components", quote(field)),
        Some(component) => {
            format!("{} has no component {}; choose one of {examples}", quote(field), quote(component))
        }
        None => format!("{} has several components; choose one of {examples}", quote(field)),
    }
}

fn numbers(known: &[usize]) -> String {
    const SHOWN: usize = 30;
    let mut text: Vec<String> = known.iter().take(SHOWN).map(usize::to_string).collect();
    if let Some(last) = known.last().filter(|_| known.len() > SHOWN) {
        text.extend(["…".to_owned(), last.to_string()]);
    }
    text.join(", ")
}
