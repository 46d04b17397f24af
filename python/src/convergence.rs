//! Convergence studies: the grids, values and conclusions that the package shares with `mpm converge`.

use std::path::PathBuf;

use mpm::deck::load::LoadedDeck;
use mpm::deck::may_run_libraries;
use mpm::deck::ready;
use mpm::deck::refinement::DeckText;
use mpm::memory::Memory;
use mpm::study::convergence::{Convergence, Findings, GridRun, MOVED_NOT_ENDED, Quantity};
use mpm::study::family::{Family, Grid};
use mpm::study::{Axis, Record};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::Raised;
use crate::preparation::loaded;

/// The decks of a convergence study, and what their results have shown.
#[pyclass]
pub struct Grids {
    family: Family,
    moved: Option<Grid>,
    quantity: Quantity,
    /// Why values of this deck have no order once points yield, in words.
    without_order: Option<String>,
    allow_libraries: bool,
    findings: Findings,
}

/// Name of the results directory, text and overrides of a deck.
type Parts = (String, Py<PyBytes>, Vec<(String, String)>);

/// A check that the first load step of a deck can begin.
fn first_step(allow_libraries: bool) -> impl Fn(LoadedDeck) -> Result<(), String> {
    move |mut loaded| {
        loaded.allows_libraries = may_run_libraries(allow_libraries);
        let prepared = ready::prepare(loaded, Memory::this_machine(), false);
        prepared.map(drop).map_err(|failure| failure.in_one_line())
    }
}

#[pymethods]
impl Grids {
    /// The grids of a deck: three with cells of halved size, or those that a parameter with listed values sets.
    #[new]
    fn new(
        py: Python<'_>,
        name: String,
        text: &[u8],
        overrides: Vec<(String, String)>,
        quantity: &str,
        over: Option<(String, Vec<String>)>,
        allow_libraries: bool,
    ) -> PyResult<Grids> {
        let quantity: Quantity = quantity.parse().map_err(Raised::misuse)?;
        let axis = over.map(|(name, values)| Axis::new(name, values)).transpose();
        let axis = axis.map_err(|error| Raised::misuse(error.to_string()))?;
        let deck = crate::preparation::DeckText { name: &name, text, overrides: &overrides, allow_libraries };
        let read = loaded(deck)?;
        let base = DeckText { name: name.clone(), text: text.to_vec(), overrides };
        let family = py.detach(|| Family::new(base, axis, &first_step(allow_libraries)));
        let findings = Findings {
            deck: name,
            title: read.deck.title.clone(),
            quantity: quantity.to_string(),
            dimensions: read.deck.dimensions(),
            grids: Vec::new(),
            moved: None,
            not_moved: None,
            refused: None,
        };
        let family = family.map_err(Raised::misuse)?;
        let without_order = read.without_order();
        Ok(Grids { family, moved: None, quantity, without_order, allow_libraries, findings })
    }

    /// Why the grids are finer than that of the deck.
    #[getter]
    fn note(&self) -> Option<&str> {
        self.family.note.as_deref()
    }

    /// The decks from coarse to fine.
    fn decks(&self, py: Python<'_>) -> Vec<Parts> {
        self.family.grids.iter().map(|grid| parts(py, grid)).collect()
    }

    /// Adds a grid with cells half as long as those of the finest one, and returns its deck.
    fn halve(&mut self, py: Python<'_>) -> PyResult<Parts> {
        let check = first_step(self.allow_libraries);
        py.detach(|| self.family.halve(&check)).map_err(Raised::misuse)?;
        let finest = self.family.grids.last();
        Ok(parts(py, finest.ok_or_else(|| Raised::misuse("there are no grids"))?))
    }

    /// The deck of the middle grid with its inner lines moved, if it can be used so.
    fn move_lines(&mut self, py: Python<'_>) -> Option<Parts> {
        let check = first_step(self.allow_libraries);
        let middle = self.family.grids.len().checked_sub(2)?;
        let (moved, why) = py.detach(|| self.family.moved(&self.family.grids[middle], &check));
        self.moved = moved;
        self.findings.not_moved = why;
        self.moved.as_ref().map(|grid| parts(py, grid))
    }

    /// Reads the quantity from the results of the next grid, or of the moved one.
    fn read(&mut self, directory: PathBuf, is_moved: bool) -> PyResult<()> {
        let record = Record::read(&directory).map_err(|error| Raised::unreadable(&error))?;
        if record.has_yielded() {
            self.findings.refused.clone_from(&self.without_order);
        }
        let grid = match &self.moved {
            Some(moved) if is_moved => moved,
            _ => self
                .family
                .grids
                .get(self.findings.grids.len())
                .ok_or_else(|| Raised::misuse("no grid is left"))?,
        };
        let name = directory.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let run = GridRun::read(&record, &self.quantity, grid, self.findings.dimensions, name);
        let run = run.map_err(Raised::misuse)?;
        if is_moved {
            self.findings.moved = Some(run);
        } else {
            self.findings.add(run).map_err(Raised::misuse)?;
        }
        Ok(())
    }

    /// Goes on without the run on the moved grid, which has not reached its end or has no such quantity.
    fn leave_moved(&mut self, why: Option<String>) {
        self.findings.not_moved = Some(why.unwrap_or_else(|| MOVED_NOT_ENDED.to_owned()));
    }

    /// The conclusions so far as JSON and as a sentence, with the grids that errors of these sizes need; they are also
    /// written to a directory, with a page.
    fn conclude(&self, errors: Vec<f64>, out: Option<PathBuf>) -> PyResult<(String, String)> {
        let study = self.findings.clone().conclude(&errors);
        let study = study.ok_or_else(|| Raised::misuse("there are fewer than three grids"))?;
        if let Some(directory) = out {
            let write = |study: &Convergence| -> std::io::Result<()> {
                study.write(&directory)?;
                let page = mpm::appendix::convergence_page(study);
                mpm::appendix::write(&directory.join("convergence.html"), &page)
                    .map_err(std::io::Error::other)
            };
            write(&study).map_err(|error| Raised::Results { code: None, message: error.to_string() })?;
        }
        let document = serde_json::to_string(&study);
        Ok((document.map_err(|error| Raised::misuse(error.to_string()))?, study.conclusion()))
    }
}

/// Name of the results directory, text and overrides of a grid.
fn parts(py: Python<'_>, grid: &Grid) -> Parts {
    let DeckText { text, overrides, .. } = &grid.deck;
    (grid.directory_name(), PyBytes::new(py, text).unbind(), overrides.clone())
}
