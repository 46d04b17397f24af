//! The messages between the thread of the interpreter and the thread of an analysis.

use std::sync::mpsc::{Receiver, Sender};

use mpm::deck::load::LoadedDeck;
use mpm::deck::ready::Analysis;
use mpm::model::Model;
use mpm::output::record::{Record, Rows};
use mpm::points::Points;
use serde_json::Value;

/// A request of the interpreter to an analysis that waits between two steps.
pub enum Request {
    /// Solve the next step.
    Go,
    /// End the run before the next step.
    Stop,
    /// An array of the points; `None` if there is no array of this name.
    Array(String, Sender<Option<Array>>),
    /// A table.
    Table(Name, Sender<Rows>),
    /// Go on with the loads, conditions, materials and steps of another deck, whose model is already built.
    Change(Box<Changed>, Sender<Result<(), String>>),
}

/// Another deck for a run, and the model built from it.
pub struct Changed {
    pub loaded: LoadedDeck,
    pub analysis: Analysis,
}

/// Names of the tables of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Name {
    History,
    Quality,
    Convergence,
}

impl Name {
    /// The table of this name.
    pub fn rows(self, record: &Record) -> &Rows {
        match self {
            Name::History => &record.history,
            Name::Quality => &record.quality,
            Name::Convergence => &record.convergence,
        }
    }
}

/// An array of the points in the order of their permanent numbers.
pub struct Array {
    /// Numbers per point.
    pub components: usize,
    pub values: Vec<f64>,
}

impl Array {
    /// An array of a model; `None` if there is no array of this name.
    pub fn read<const D: usize>(model: &Model<D>, points: &Points<D>, name: &str) -> Option<Array> {
        let found = model.array(points, name)?;
        Some(Array { components: found.components, values: found.values })
    }
}

impl Ended {
    /// An array of the points in their last state.
    pub fn array(&self, name: &str) -> Option<Array> {
        match &self.analysis {
            Analysis::Plane(parts) => Array::read(&parts.0, &parts.1, name),
            Analysis::Solid(parts) => Array::read(&parts.0, &parts.1, name),
        }
    }
}

/// An event of a run.
pub enum Event {
    /// An evaluation of the out-of-balance force.
    Iteration { step: usize, iteration: usize, residual: f64 },
    /// The run has begun, or a step is in equilibrium; the analysis waits for a request.
    Paused(Option<Box<Value>>),
    /// The run has ended, and its thread ends.
    Ended(Box<Ended>),
}

/// The end of a run.
pub struct Ended {
    /// The model and its points in their last state.
    pub analysis: Analysis,
    /// The tables, and the document of `summary.json`.
    pub record: Record,
    /// The error, if the run has not completed.
    pub failure: Option<Failure>,
}

/// An error that has ended a run.
pub struct Failure {
    pub code: Option<&'static str>,
    pub message: String,
    pub help: Option<String>,
    /// Residual of every evaluation of the step that failed.
    pub residuals: Vec<f64>,
    pub is_interruption: bool,
}

/// The analysis side of the link.
pub struct Link {
    pub events: Sender<Event>,
    pub requests: Receiver<Request>,
}
