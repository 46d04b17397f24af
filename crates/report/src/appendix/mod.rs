//! Reports: the results of runs as one page, for the appendix of an engineer's document.
//!
//! A page is one self-contained HTML file, which can be sent, printed and archived. A page about runs is made only
//! from the result files, so it can be written long after the run, or during it.
//!
//! `run` reads a directory. `chart` (with `scale`) draws curves, `picture` (with `scene`, `view`, `raster` and
//! `colour`) draws the points; `page` numbers sections, figures and tables. `single` (with `stages` and `tools`) and
//! `comparison` define the pages about runs, `element_test` the page about an element test, and `convergence` that about a
//! convergence study.

mod chart;
mod colour;
mod comparison;
mod contacts;
mod convergence;
mod curves;
mod element_test;
mod error;
mod field;
mod limit;
mod number;
mod options;
mod page;
mod picture;
mod raster;
mod run;
mod scale;
mod scene;
mod sections;
mod single;
mod stages;
mod strength;
mod tools;
mod units;
mod view;

use std::path::{Path, PathBuf};

use mpm_files::replace::replace_file;

pub use convergence::convergence_page;
pub use element_test::{ElementReport, element_page};
pub use error::{NoResults, ReportError};
pub use field::{FieldChoice, StepChoice};
pub use options::Options;
pub use units::Units;

use run::Run;

/// Makes the page about the run in a directory, or the comparison of the runs in several directories.
///
/// # Errors
/// If no directory is given, a directory contains no results, a result file is damaged or cannot be read, or a chosen
/// field or step does not exist.
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
/// If the file cannot be written.
pub fn write(path: &Path, page: &str) -> Result<(), ReportError> {
    replace_file(path, |out| out.write_all(page.as_bytes()))
        .map_err(|error| ReportError::Unwritable { path: path.to_owned(), error })
}
