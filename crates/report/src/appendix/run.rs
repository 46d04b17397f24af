//! The results of a run, read from its directory.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::Value;

use mpm_core::input_file;
use mpm_deck::load::load_text;
use mpm_deck::{BoundaryConditionDeck, ControlDeck, Deck, Parameter, StepsDeck, initial_factor};
use mpm_files::series::{self, DataSet};
use mpm_files::status;
use mpm_files::table::Columns;
use mpm_files::vtu::read::{MeshFile, Section};

use super::error::{NoResults, ReportError};

/// State of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum State {
    /// All steps are in equilibrium.
    Completed,
    /// The run failed, with the code of the message and the reason.
    Failed(Option<String>, String),
    /// The user stopped the run.
    Interrupted,
    /// The run has not ended.
    Running,
    /// The process of the run ended unexpectedly.
    Died,
    /// Unknown: there is no summary, and the status does not say that the run is in progress or has died.
    Unknown,
}

/// A file of a series that belongs to a load step.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Snapshot {
    /// Load step number.
    pub step: usize,
    /// Time, [time].
    pub time: f64,
    /// Path of the file.
    pub path: PathBuf,
}

/// A run, read from its directory.
#[derive(Debug)]
pub(super) struct Run {
    /// The directory.
    pub directory: PathBuf,
    /// Name of the run, unique in a report.
    pub name: String,
    /// State of the run.
    pub state: State,
    /// `summary.json`; null if the run has not written it.
    pub summary: Value,
    /// `run.json`; null for a run of a version that did not write it.
    pub start: Value,
    /// `history.csv`, without failed attempts.
    pub history: Columns,
    /// `convergence.csv`.
    pub convergence: Columns,
    /// The steps whose points were written.
    pub points: Vec<Snapshot>,
    /// The deck with the values of its parameters, if this version of the program understands it.
    pub deck: Option<Deck>,
    /// The values of the parameters in the text of the deck.
    pub defaults: Vec<(String, Parameter)>,
}

impl Run {
    /// Reads a directory.
    pub fn read(directory: &Path) -> Result<Run, ReportError> {
        let metadata = fs::metadata(directory).map_err(|error| ReportError::unreadable(directory, error))?;
        if !metadata.is_dir() {
            return Err(ReportError::NoResults { path: directory.to_owned(), hint: NoResults::File });
        }
        let summary = read_json(&directory.join("summary.json"))?;
        let start = read_json(&directory.join("run.json"))?;
        let history = directory.join("history.csv");
        if !history.is_file() {
            let hint =
                if directory.join("sweep.csv").is_file() { NoResults::Study } else { NoResults::Other };
            return Err(ReportError::NoResults { path: directory.to_owned(), hint });
        }
        let table = |name: &str| {
            let path = directory.join(name);
            Columns::read(&path).map_err(|error| ReportError::unreadable(&path, error))
        };
        // Failed attempts are not steps.
        let history = table("history.csv")?.where_column("converged", |value| value == 1.0);
        let convergence = table("convergence.csv")?;
        for (file, table, names) in [
            ("history.csv", &history, &["step", "time", "iterations", "residual"][..]),
            ("convergence.csv", &convergence, &["step", "iteration", "residual"]),
        ] {
            if let Some(name) = names.iter().find(|name| table.column(name).is_none()) {
                let what = format!("there is no column `{name}`");
                return Err(ReportError::Damaged { path: directory.join(file), what });
            }
        }
        let rows = history.column("step").map_or(0, <[f64]>::len) as u64;
        if let Some(steps) = summary["steps"].as_u64()
            && steps != rows
        {
            let what = format!("its number of rows is {rows}, but the number of steps is {steps}");
            return Err(ReportError::Damaged { path: directory.join("history.csv"), what });
        }
        let state = state_of(&summary, directory)?;
        let mut run = Run {
            name: directory.display().to_string(),
            directory: directory.to_owned(),
            state,
            summary,
            start,
            history,
            convergence,
            points: snapshots(directory, "points")?,
            deck: None,
            defaults: Vec::new(),
        };
        run.read_deck();
        Ok(run)
    }

    /// Reads the deck, if this version can.
    fn read_deck(&mut self) {
        let Some(text) = self.deck_text() else { return };
        let text = text.to_owned();
        let values: Vec<(String, String)> = self
            .parameters()
            .into_iter()
            .map(|(name, value)| (name, value.as_str().map_or_else(|| value.to_string(), str::to_owned)))
            .collect();
        self.deck = load_text("deck", text.as_bytes(), &values).ok().map(|loaded| loaded.deck);
        if let Ok(loaded) = load_text("deck", text.as_bytes(), &[]) {
            self.defaults = loaded.parameters.into_iter().collect();
        }
    }

    /// The text of the deck.
    pub fn deck_text(&self) -> Option<&str> {
        self.start.pointer("/deck/text")?.as_str()
    }

    /// The parameters with their final values.
    pub fn parameters(&self) -> Vec<(String, Value)> {
        let found = [&self.summary, &self.start].into_iter().find_map(|file| file["parameters"].as_object());
        found.map_or_else(Vec::new, |map| map.iter().map(|(k, v)| (k.clone(), v.clone())).collect())
    }

    /// An entry of `summary.json` or `run.json`; the summary takes precedence if both files have it.
    pub fn fact(&self, pointer: &str) -> Option<&Value> {
        let known = |file: &'_ Value| file.pointer(pointer).is_some_and(|value| !value.is_null());
        [&self.summary, &self.start].into_iter().find(|file| known(file))?.pointer(pointer)
    }

    /// A number about the run.
    pub fn number(&self, pointer: &str) -> Option<f64> {
        self.fact(pointer)?.as_f64()
    }

    /// A string about the run.
    pub fn text(&self, pointer: &str) -> Option<&str> {
        self.fact(pointer)?.as_str()
    }

    /// The title of the deck, or the name of the run.
    pub fn title(&self) -> &str {
        self.text("/title").filter(|title| !title.is_empty()).unwrap_or(&self.name)
    }

    /// Number of converged steps.
    pub fn steps(&self) -> usize {
        self.history.rows()
    }

    /// The values of a column of `history.csv` at the end of each step.
    pub fn column(&self, name: &str) -> &[f64] {
        self.history.column(name).unwrap_or_default()
    }

    /// The names that precede an ending in the columns of `history.csv`, such as boundary conditions before `_rx`,
    /// without the names of tools.
    pub fn names_before(&self, ending: &str) -> Vec<&str> {
        let names = self.history.names().iter().filter_map(|name| name.strip_suffix(ending));
        names.filter(|name| !self.is_of_tool(name)).collect()
    }

    /// True if `history.csv` has a column whose name ends in `ending`.
    pub fn has_column_of(&self, ending: &str) -> bool {
        self.history.names().iter().any(|name| name.ends_with(ending))
    }

    /// True if the name of a column, without its ending, is that of a tool or of a part of a tool.
    fn is_of_tool(&self, name: &str) -> bool {
        self.deck.iter().flat_map(|deck| &deck.tools).any(|tool| {
            let rest = name.strip_prefix(&tool.name);
            let part = rest.and_then(|rest| rest.strip_prefix('_'));
            rest == Some("") || part.is_some_and(|part| tool.parts.contains_key(part))
        })
    }

    /// True if all loads and prescribed motions grow in proportion to time, so that time divided by end time is the
    /// load factor.
    pub fn is_ramp(&self) -> bool {
        let Some(deck) = &self.deck else { return false };
        let is_load_control = |steps: &StepsDeck| {
            matches!(steps.control, ControlDeck::Load {} | ControlDeck::StrengthReduction { .. })
        };
        if !deck.steps.as_ref().is_some_and(is_load_control) {
            return false;
        }
        // Gravity that an initial stress balances acts in full from the start.
        deck.loads.iter().all(|load| load.curve().is_none() && initial_factor(deck, load) == 0.0)
            && deck.boundary_conditions.iter().all(|c| c.curve.is_none())
            && deck.tools.iter().all(|tool| tool.curves().next().is_none())
    }

    /// True if a body is stressed at time 0.
    pub fn begins_stressed(&self) -> bool {
        self.deck.iter().flat_map(|deck| &deck.bodies).any(|body| body.initial_stress.is_some())
    }

    /// True if the boundary condition of this name moves its nodes.
    pub fn moves(&self, name: &str) -> bool {
        let conditions = self.deck.iter().flat_map(|deck| &deck.boundary_conditions);
        let named = conditions.filter(|condition| condition.name == name);
        named.into_iter().any(BoundaryConditionDeck::moves)
    }

    /// Time at the end of the analysis, [time].
    pub fn end_time(&self) -> Option<f64> {
        self.deck.as_ref().map(Deck::end_time)
    }

    /// The residuals of the last attempt at every step that was begun, starting with the residual before the first
    /// solve.
    pub fn residuals(&self) -> Vec<(usize, Vec<f64>)> {
        let column = |name| self.convergence.column(name).unwrap_or_default();
        let mut steps: Vec<(usize, Vec<f64>)> = Vec::new();
        for ((step, iteration), residual) in
            column("step").iter().zip(column("iteration")).zip(column("residual"))
        {
            let step = *step as usize;
            match steps.last_mut() {
                Some((last, residuals)) if *last == step => {
                    if *iteration == 0.0 {
                        residuals.clear(); // a further attempt
                    }
                    residuals.push(*residual);
                }
                _ => steps.push((step, vec![*residual])),
            }
        }
        steps
    }

    /// The mesh of a series at a load step, if it was written.
    pub fn mesh(&self, series: &str, step: usize) -> Result<Option<MeshFile>, ReportError> {
        let found = snapshots(&self.directory, series)?.into_iter().find(|snapshot| snapshot.step == step);
        found.map(|snapshot| read_mesh(&snapshot.path)).transpose()
    }

    /// True if the problem is two-dimensional.
    pub fn is_plane(&self) -> bool {
        self.text("/idealisation") != Some("solid")
    }

    /// True for bodies of revolution.
    pub fn is_revolved(&self) -> bool {
        self.text("/idealisation") == Some("axisymmetric")
    }
}

fn state_of(summary: &Value, directory: &Path) -> Result<State, ReportError> {
    Ok(match summary["outcome"].as_str() {
        Some("completed") => State::Completed,
        Some("interrupted") => State::Interrupted,
        None if summary.is_null() => match status::read(directory).map(|status| status.state) {
            Ok(status::State::Running) => State::Running,
            Ok(status::State::Died) => State::Died,
            _ => State::Unknown,
        },
        Some("failed") => {
            let text = |key: &str| summary[key].as_str().map(str::to_owned);
            State::Failed(text("code"), text("reason").unwrap_or_else(|| "no reason is recorded".to_owned()))
        }
        _ => {
            let (path, what) = (directory.join("summary.json"), "`outcome` is missing or unknown".to_owned());
            return Err(ReportError::Damaged { path, what });
        }
    })
}

/// Reads a JSON file; null if it does not exist.
fn read_json(path: &Path) -> Result<Value, ReportError> {
    match input_file::read(path, u64::MAX).map_err(io::Error::from) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Value::Null),
        Err(error) => Err(ReportError::unreadable(path, error)),
        Ok(text) => match serde_json::from_slice::<Value>(&text) {
            Ok(value) if value.is_object() => Ok(value),
            Ok(_) => {
                Err(ReportError::Damaged { path: path.to_owned(), what: "not a JSON object".to_owned() })
            }
            Err(error) => Err(ReportError::Damaged { path: path.to_owned(), what: error.to_string() }),
        },
    }
}

/// The entries of a series with their load steps; empty if it was not written.
fn snapshots(directory: &Path, series: &str) -> Result<Vec<Snapshot>, ReportError> {
    let path = directory.join(format!("{series}.pvd"));
    let entries = match series::read(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        other => other.map_err(|error| ReportError::unreadable(&path, error))?,
    };
    let with_step = |DataSet { time, path: file }: DataSet| {
        let name = file.file_stem().and_then(|name| name.to_str());
        let number = name.and_then(|name| name.rsplit('_').next()).and_then(|digits| digits.parse().ok());
        number.map(|step| Snapshot { step, time, path: file }).ok_or_else(|| {
            let what = "an entry is not named after its load step".to_owned();
            ReportError::Damaged { path: path.clone(), what }
        })
    };
    entries.into_iter().map(with_step).collect()
}

/// Reads a mesh of a series.
pub(super) fn read_mesh(path: &Path) -> Result<MeshFile, ReportError> {
    MeshFile::read(path).map_err(|error| ReportError::unreadable(path, error))
}

/// The numbers of an array.
pub(super) fn values(mesh: &MeshFile, section: Section, name: &str) -> Result<Vec<f64>, ReportError> {
    mesh.values(section, name).map_err(ReportError::from_reader)
}

/// Names every run by the shortest final part of its path that no other run shares.
pub(super) fn name_apart(runs: &mut [Run]) {
    let parts: Vec<Vec<String>> = runs
        .iter()
        .map(|run| {
            let whole = run.directory.canonicalize().unwrap_or_else(|_| run.directory.clone());
            whole.iter().map(|part| part.to_string_lossy().into_owned()).collect()
        })
        .collect();
    let tail = |parts: &[String], length: usize| parts[parts.len().saturating_sub(length)..].join("/");
    for (index, run) in runs.iter_mut().enumerate() {
        let longest = parts[index].len();
        let is_unique = |length: &usize| {
            let name = tail(&parts[index], *length);
            parts.iter().enumerate().all(|(other, parts)| other == index || tail(parts, *length) != name)
        };
        let length = (1..=longest).find(is_unique).unwrap_or(1);
        run.name = tail(&parts[index], length);
    }
}
