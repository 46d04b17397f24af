//! Why a report cannot be written.

use std::io;
use std::path::{Path, PathBuf};

use mpm_deck::quoting::{list, quote};
use strsim::jaro_winkler;

/// Why a directory contains no results.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoResults {
    /// The path is a file.
    File,
    /// The directory belongs to a study and contains the directories of the members.
    Study,
    /// The directory has no history of a run.
    Other,
}

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// No directory is given.
    #[error("a report needs at least one results directory")]
    Nothing,
    /// A directory without results.
    #[error("{} {}", shown(path), no_results(path, *hint))]
    NoResults {
        /// The directory.
        path: PathBuf,
        /// The reason.
        hint: NoResults,
    },
    /// A file or directory that cannot be read.
    #[error("{} cannot be read: {error}", shown(path))]
    Unreadable {
        /// Path of the file or directory.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
    /// A damaged file; the error names it.
    #[error("a result file is damaged: {0}")]
    DamagedFile(io::Error),
    /// A damaged file.
    #[error("a result file is damaged: {}: {what}", path.display())]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// The fault.
        what: String,
    },
    /// A field that the points do not have.
    #[error("the points have no field {}; {}", quote(name), instead(name, known))]
    NoField {
        /// Name of the field.
        name: String,
        /// The fields of the points.
        known: Vec<String>,
    },
    /// A component that a field does not have, or a missing component.
    #[error("{}", no_component(field, component.as_deref(), known))]
    NoComponent {
        /// Name of the field.
        field: String,
        /// The component; `None` if none is given.
        component: Option<String>,
        /// The components of the field.
        known: Vec<String>,
    },
    /// A load step for which no points were written.
    #[error("load step {step} was not written; {}", written(known))]
    NoStep {
        /// The step.
        step: usize,
        /// The steps that were written.
        known: Vec<usize>,
    },
    /// A field or a load step is asked for, but no points were written.
    #[error("no field or load step can be shown: {} contains no VTU files of the points", shown(path))]
    NoPictures {
        /// Directory of the first run.
        path: PathBuf,
    },
    /// A field or a load step is missing in one of several runs.
    #[error("the run {}: {error}", quote(run))]
    InRun {
        /// Name of the run.
        run: String,
        /// What is missing.
        error: Box<ReportError>,
    },
    /// The report cannot be written.
    #[error("{} cannot be written: {error}", shown(path))]
    Unwritable {
        /// Path of the file.
        path: PathBuf,
        /// The reason.
        error: io::Error,
    },
}

impl ReportError {
    /// A file-system error, or an error of a reader, which names the file.
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

    /// The same error, in one of several runs; errors that already name a file or directory are unchanged.
    pub(super) fn in_run(self, run: &str) -> ReportError {
        match self {
            ReportError::NoField { .. } | ReportError::NoComponent { .. } | ReportError::NoStep { .. } => {
                ReportError::InRun { run: run.to_owned(), error: Box::new(self) }
            }
            other => other,
        }
    }

    /// An error of a reader, which names the file.
    pub(super) fn from_reader(error: io::Error) -> ReportError {
        ReportError::DamagedFile(error)
    }
}

/// A path in full, so that it can be copied.
fn shown(path: &Path) -> String {
    format!("`{}`", path.display())
}

fn no_results(path: &Path, hint: NoResults) -> String {
    match hint {
        NoResults::File => "is a file, not a results directory".to_owned(),
        NoResults::Study => {
            let members = path.join("*");
            format!("contains a study, not the results of one run; give its members: {}/", members.display())
        }
        NoResults::Other => {
            "contains no results: there is no `history.csv`; give a directory written by `mpm run`".to_owned()
        }
    }
}

fn instead(name: &str, known: &[String]) -> String {
    let near = known.iter().map(|other| (jaro_winkler(name, other), other));
    match near.filter(|(nearness, _)| *nearness > 0.8).max_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((_, best)) => format!("did you mean {}?", quote(best)),
        None => format!("the fields are {}", list(known.iter().map(String::as_str))),
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

fn written(known: &[usize]) -> String {
    const SHOWN: usize = 30;
    if let [only] = known {
        return format!("the only step written is {only}");
    }
    let mut text: Vec<String> = known.iter().take(SHOWN).map(usize::to_string).collect();
    if let Some(last) = known.last().filter(|_| known.len() > SHOWN) {
        text.extend(["…".to_owned(), last.to_string()]);
    }
    format!("the steps written are {}", text.join(", "))
}
