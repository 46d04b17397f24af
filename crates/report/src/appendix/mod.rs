//! Reports: what runs have left in their directories, as one page for the appendix of an engineer's document.
//!
//! A page is one file of HTML without anything from elsewhere: it can be sent, printed and kept. It is made from the
//! files of the results alone, so a report can be written long after the run, or while it goes on.
//!
//! `run` reads a directory. `chart` (with `scale`) draws curves, `picture` (with `scene`, `view`, `raster` and
//! `colour`) the points;
//! `page` numbers sections, figures and tables. `single` and `comparison` say what stands where.

mod chart;
mod colour;
mod comparison;
mod curves;
mod field;
mod number;
mod page;
mod picture;
mod raster;
mod run;
mod scale;
mod scene;
mod sections;
mod single;
mod units;
mod view;

use std::io;
use std::path::{Path, PathBuf};

use strsim::jaro_winkler;

use mpm_deck::diagnostic::{list, quote};
use mpm_files::replace::replace_file;

pub use field::{FieldChoice, StepChoice};
pub use run::NoResults;
pub use units::Units;

use run::{Run, Snapshot};

/// What a report shows.
#[derive(Debug, Clone)]
pub struct Options {
    /// The fields that the points are coloured by, each in a figure of its own; where there are none, the von Mises stress,
    /// or another field if that was not written.
    pub fields: Vec<FieldChoice>,
    /// The steps that the points are shown at; a comparison shows the last of them.
    pub steps: Vec<StepChoice>,
    /// The unit system of the decks.
    pub units: Option<Units>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            fields: Vec::new(),
            steps: vec![StepChoice::First, StepChoice::Middle, StepChoice::Last],
            units: None,
        }
    }
}

impl Options {
    /// The fields that are shown of some states.
    fn fields(&self, snapshots: &[Snapshot]) -> Result<Vec<FieldChoice>, ReportError> {
        if self.fields.is_empty() {
            Ok(vec![FieldChoice::usual(snapshots)?])
        } else {
            Ok(self.fields.clone())
        }
    }
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
    fn unreadable(path: &Path, error: io::Error) -> ReportError {
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
    fn from_reader(error: io::Error) -> ReportError {
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

/// The page about the run in a directory, or the comparison of the runs in several.
///
/// # Errors
/// When a directory holds no results, one of their files is damaged, or a chosen field or step does not exist.
pub fn report(directories: &[PathBuf], options: &Options) -> Result<String, ReportError> {
    let mut runs: Vec<Run> =
        directories.iter().map(|directory| Run::read(directory)).collect::<Result<_, _>>()?;
    run::name_apart(&mut runs);
    match &runs[..] {
        [] => Err(ReportError::Nothing),
        [run] => single::page(run, options),
        runs => comparison::page(runs, options),
    }
}

/// Writes a page to a file, which appears under its name only when it is complete.
///
/// # Errors
/// When the file cannot be written.
pub fn write(path: &Path, page: &str) -> Result<(), ReportError> {
    replace_file(path, |out| out.write_all(page.as_bytes()))
        .map_err(|error| ReportError::Unwritable { path: path.to_owned(), error })
}
