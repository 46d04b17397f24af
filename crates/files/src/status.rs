//! `status.json`: the progress of a run, for other programs.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use jiff::{Timestamp, Unit};
use serde::{Deserialize, Serialize};

use mpm_core::input_file;
use mpm_core::memory;
use mpm_core::model::{LoadCurve, Model, Stepping};
use mpm_core::solver::{Reached, SolveError, Step, StepReport};

use super::checkpoint;
use super::lock::Lock;
use super::replace::replace_file;
use super::summary::{Start, VERSION};

/// Name of the file.
pub(super) const NAME: &str = "status.json";

/// Shortest time between two updates of the file during a run.
const INTERVAL: Duration = Duration::from_secs(1);

/// Number of recent steps from which the remaining time is estimated.
const RECENT: usize = 10;

/// State of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum State {
    /// The run is in progress.
    Running,
    /// All steps are in equilibrium.
    Completed,
    /// The run ended with an error.
    Failed,
    /// The user stopped the run.
    Interrupted,
    /// The process of the run ended unexpectedly.
    Died,
}

impl State {
    /// Name of the state.
    pub fn word(self) -> &'static str {
        match self {
            State::Running => "running",
            State::Completed => "completed",
            State::Failed => "failed",
            State::Interrupted => "interrupted",
            State::Died => "died",
        }
    }
}

/// Progress of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// State of the run; `died` is never written, but inferred by [`read`].
    pub state: State,
    /// Reason for the failure.
    pub reason: Option<String>,
    /// Title of the deck.
    pub title: String,
    /// Version of the program.
    pub version: String,
    /// Process ID.
    pub process: u32,
    /// Start of the run.
    pub started: Timestamp,
    /// Time of this update.
    pub updated: Timestamp,
    /// Converged steps.
    pub steps: usize,
    /// Load steps of the deck.
    pub steps_requested: usize,
    /// The current step, or the last one.
    pub step: usize,
    /// Iteration of the last evaluation in this step; 0 before the first solve.
    pub iteration: usize,
    /// Relative out-of-balance force, eq. (40), of that evaluation, [-]; `None` before the first, or if not finite.
    pub residual: Option<f64>,
    /// Tolerance of the residual, in the current stage if there are stages, [-].
    pub tolerance: f64,
    /// Time at the end of the current step, [time].
    pub time: f64,
    /// Time at the end of the analysis, [time].
    pub end_time: f64,
    /// Load factor at the end of the current step, if all loads and prescribed motions share one, [-]; if it is an
    /// unknown, at the end of the last converged step.
    pub load_factor: Option<f64>,
    /// Factor by which the strength of the materials is divided at the end of the current step, [-]; `None` at full
    /// strength.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strength_factor: Option<f64>,
    /// Name of the current stage; `None` in an analysis without stages.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<String>,
    /// Number of material points.
    pub points: usize,
    /// Free degrees of freedom of the last converged step.
    pub unknowns: usize,
    /// Evaluations of the out-of-balance force since the run began or resumed.
    pub evaluations: usize,
    /// Number of points times evaluations per second over the steps so far, output included, [1/s].
    pub points_per_second: Option<f64>,
    /// Time since the [`Start`] of the run, [s].
    pub elapsed_seconds: f64,
    /// Estimated remaining time, from the pace of the last steps, [s].
    pub seconds_left: Option<f64>,
    /// Resident memory, [byte], if the system provides it.
    pub memory_bytes: Option<u64>,
    /// Largest resident memory so far, [byte], if the system provides it.
    pub peak_memory_bytes: Option<u64>,
    /// Number of warnings so far.
    pub warnings: usize,
    /// Size of the steps relative to a requested step if they have been far shorter for a long time, [-].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crawling: Option<f64>,
    /// Step of the last checkpoint in the directory, if there is one.
    pub checkpoint: Option<usize>,
}

/// Keeps track of the progress of a run.
#[derive(Debug)]
pub struct Progress {
    start: Start,
    status: Status,
    curve: Option<LoadCurve>,
    /// The stepping of each stage, or of the analysis, that reduces the strength of the materials.
    reductions: Vec<Stepping>,
    /// Names of the stages, and the tolerances of their residuals, [-].
    stages: Vec<(String, f64)>,
    /// Start of the first step.
    began: Instant,
    /// Analysis time and clock time at the ends of the last steps.
    recent: VecDeque<(f64, Instant)>,
}

impl Progress {
    /// Progress of a run that is about to begin; times are measured from `start`.
    pub fn new<const D: usize>(model: &Model<D>, points: usize, start: Start) -> Progress {
        let now = Timestamp::now();
        let before = jiff::SignedDuration::try_from(start.elapsed().wall).unwrap_or_default();
        let status = Status {
            state: State::Running,
            reason: None,
            title: model.title.clone(),
            version: VERSION.to_owned(),
            process: std::process::id(),
            started: to_milliseconds(now.checked_sub(before).unwrap_or(now)),
            updated: to_milliseconds(now),
            steps: 0,
            steps_requested: model.steps_requested(),
            step: 0,
            iteration: 0,
            residual: None,
            tolerance: model.newton.tolerance,
            time: 0.0,
            end_time: model.end_time(),
            load_factor: model.has_one_load_factor().then_some(0.0),
            strength_factor: None,
            stage: model.stages.first().map(|stage| stage.name.clone()),
            points,
            unknowns: 0,
            evaluations: 0,
            points_per_second: None,
            elapsed_seconds: 0.0,
            seconds_left: None,
            memory_bytes: None,
            peak_memory_bytes: None,
            warnings: 0,
            crawling: None,
            checkpoint: None,
        };
        let began = Instant::now();
        let stages = model.stages.iter().map(|stage| (stage.name.clone(), stage.newton.tolerance)).collect();
        let curve = model.common_curve().filter(|_| !model.stepping.control.has_unknown_factor()).cloned();
        let stage_stepping = model.stages.iter().map(|stage| &stage.stepping);
        let all: Vec<&Stepping> =
            if model.stages.is_empty() { vec![&model.stepping] } else { stage_stepping.collect() };
        let reduces = |stepping: &&Stepping| stepping.strength_factor(stepping.start_time).is_some();
        let reductions = all.into_iter().filter(reduces).cloned().collect();
        Progress { start, status, curve, reductions, stages, began, recent: VecDeque::from([(0.0, began)]) }
    }

    /// Strength reduction factor in a step that ends at a time; `None` at full strength.
    fn strength_factor(&self, end: f64) -> Option<f64> {
        let is_in = |stepping: &&Stepping| stepping.start_time < end && end <= stepping.end_time;
        self.reductions.iter().find(is_in)?.strength_factor(end)
    }

    fn set_stage(&mut self, reached: &Reached) {
        if let Some((name, tolerance)) = self.stages.get(reached.progress.stage_number()) {
            self.status.stage = Some(name.clone());
            self.status.tolerance = *tolerance;
        }
    }

    /// Records that a stage has begun.
    pub fn stage_began(&mut self, reached: &Reached) {
        self.set_stage(reached);
    }

    /// Records that the run resumes from a step that an earlier run reached.
    pub fn resumed(&mut self, reached: &Reached) {
        let end = reached.progress.step.end;
        self.status.steps = reached.summary.steps;
        self.status.step = reached.progress.step.index;
        self.status.time = end;
        self.status.load_factor = reached.summary.load_factor;
        self.status.strength_factor = self.strength_factor(end);
        self.set_stage(reached);
        self.status.warnings = reached.summary.warnings.len();
        self.status.crawling = reached.progress.pace.crawling();
        self.recent = VecDeque::from([(end, self.began)]);
    }

    /// Records an evaluation of the out-of-balance force.
    pub fn iteration(&mut self, step: Step, iteration: usize, residual: f64) {
        self.status.strength_factor = self.strength_factor(step.end);
        let status = &mut self.status;
        status.step = step.index;
        status.iteration = iteration;
        status.residual = residual.is_finite().then_some(residual);
        status.time = step.end;
        // If the load factor is an unknown, the status keeps its value at the last converged step.
        if let Some(curve) = &self.curve {
            status.load_factor = Some(curve.factor(step.end));
        }
        status.evaluations += 1;
    }

    /// Records a converged step.
    pub fn converged<const D: usize>(&mut self, report: &StepReport<D>, reached: &Reached) {
        self.status.steps = reached.summary.steps;
        self.status.unknowns = report.unknowns;
        self.status.load_factor = report.load_factor;
        self.status.strength_factor = report.strength_factor;
        self.set_stage(reached);
        self.status.warnings = reached.summary.warnings.len();
        self.status.crawling = reached.progress.pace.crawling();
        self.recent.push_back((report.step.end, Instant::now()));
        if self.recent.len() > RECENT + 1 {
            self.recent.pop_front();
        }
    }

    /// Records the end of the run.
    pub fn finished(&mut self, error: Option<&SolveError>) {
        let (state, reason) = match error {
            None => (State::Completed, None),
            Some(SolveError::Interrupted { .. }) => (State::Interrupted, None),
            Some(error) => (State::Failed, Some(error.to_string())),
        };
        self.status.state = state;
        self.status.reason = reason;
    }

    /// The current status.
    pub fn status(&self) -> Status {
        let now = Instant::now();
        let stepping = now.duration_since(self.began).as_secs_f64();
        let visits = (self.status.points * self.status.evaluations) as f64;
        Status {
            updated: to_milliseconds(Timestamp::now()),
            elapsed_seconds: self.start.elapsed().wall.as_secs_f64(),
            points_per_second: (visits > 0.0 && stepping > 0.0).then(|| visits / stepping),
            seconds_left: self.seconds_left(now),
            memory_bytes: memory::resident(),
            peak_memory_bytes: memory::peak(),
            ..self.status.clone()
        }
    }

    fn seconds_left(&self, now: Instant) -> Option<f64> {
        if self.status.state != State::Running {
            return None;
        }
        let ((from, began), (to, ended)) = (self.recent.front()?, self.recent.back()?);
        let covered = to - from;
        let took = ended.duration_since(*began).as_secs_f64();
        let elapsed = now.duration_since(*ended).as_secs_f64();
        (covered > 0.0).then(|| ((self.status.end_time - to) * took / covered - elapsed).max(0.0))
    }
}

/// Rounds to milliseconds, for readability.
fn to_milliseconds(time: Timestamp) -> Timestamp {
    time.round(Unit::Millisecond).unwrap_or(time)
}

/// Writes the status of a run into its directory.
#[derive(Debug)]
pub struct StatusFile {
    directory: PathBuf,
    written: Option<Instant>,
}

impl StatusFile {
    /// The status file of a results directory.
    pub fn new(directory: &Path) -> StatusFile {
        StatusFile { directory: directory.to_owned(), written: None }
    }

    /// Replaces the file if an update is due, or if the run has ended.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn update(&mut self, progress: &Progress) -> io::Result<()> {
        let fresh = self.written.is_some_and(|written| written.elapsed() < INTERVAL);
        if fresh && progress.status.state == State::Running {
            return Ok(());
        }
        self.written = Some(Instant::now());
        let status = Status { checkpoint: checkpoint::last_step(&self.directory), ..progress.status() };
        let mut text = serde_json::to_string_pretty(&status).map_err(io::Error::other)?;
        text.push('\n');
        replace_file(&self.directory.join(NAME), |out| out.write_all(text.as_bytes()))
    }
}

/// Reads the status of the run in a directory. A run that has stopped without recording its end has died, unless its
/// summary reports that it completed.
///
/// # Errors
/// If there is no run in the directory, or its status cannot be read.
pub fn read(directory: &Path) -> io::Result<Status> {
    let status = read_as_written(directory)?;
    if status.state != State::Running || Lock::is_held(directory) {
        return Ok(status);
    }
    // Since the file was read, the run may have ended or another may have begun.
    let again = read_as_written(directory)?;
    let same = again.state == State::Running && again.started == status.started;
    // The summary is written before the status records the end.
    let state = if is_complete(directory) { State::Completed } else { State::Died };
    Ok(if same { Status { state, seconds_left: None, ..again } } else { again })
}

/// True if the run in a directory is complete: its summary is written after all other results.
pub fn is_complete(directory: &Path) -> bool {
    let summary = input_file::read(&directory.join("summary.json"), u64::MAX).ok();
    let summary: Option<serde_json::Value> = summary.and_then(|text| serde_json::from_slice(&text).ok());
    summary.is_some_and(|summary| summary["outcome"] == "completed")
}

fn read_as_written(directory: &Path) -> io::Result<Status> {
    let status: Status =
        serde_json::from_slice(&input_file::read(&directory.join(NAME), u64::MAX).map_err(io::Error::from)?)?;
    // A checkpoint may have been written since.
    Ok(Status { checkpoint: checkpoint::last_step(directory), ..status })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mpm_deck::{build::build, load::load_text};

    fn progress() -> Progress {
        let deck = "version: 1
grid: {type: structured, origin: [0, 0], size: [2, 2], spacing: 1}
materials: {m: {model: hencky, young: 1e3, poisson: 0}}
bodies: [{name: b, material: m, shape: {type: box, min: [0, 0], max: [1, 1]}, points_per_cell: 2}]
boundary_conditions: [{name: base, nodes: {y: 0}, fix: [x, y]}]
loads: [{name: push, type: body-force, force: [0, -1], curve: [[0, 0], [0.5, 3], [1, 1]]}]
steps: {count: 4}";
        let (model, points) = build::<2>(&load_text("deck", deck.as_bytes(), &[]).unwrap()).unwrap();
        Progress::new(&model, points.len(), Start::now())
    }

    #[test]
    fn remaining_time_follows_from_the_last_steps() {
        let mut progress = progress();
        let began = progress.began;
        let at = |seconds: f64| began + Duration::from_secs_f64(seconds);
        assert_eq!(progress.seconds_left(at(3.0)), None, "nothing is known before the first step is solved");
        // Half of the analysis has taken 8 s; 1 s of the next step has passed.
        progress.recent.push_back((0.25, at(2.0)));
        progress.recent.push_back((0.5, at(8.0)));
        assert!((progress.seconds_left(at(9.0)).unwrap() - 7.0).abs() < 1e-6);
        assert_eq!(progress.seconds_left(at(1e3)), Some(0.0));
        progress.finished(None);
        assert_eq!(progress.seconds_left(at(9.0)), None);
    }

    #[test]
    fn a_run_without_lock_has_died_unless_it_has_ended() {
        let directory = tempfile::tempdir().unwrap();
        assert_eq!(read(directory.path()).unwrap_err().kind(), io::ErrorKind::NotFound);
        let mut progress = progress();
        let mut file = StatusFile::new(directory.path());
        let lock = Lock::take(directory.path()).unwrap();
        file.update(&progress).unwrap();
        let first = read(directory.path()).unwrap();
        assert_eq!((first.state, first.step, first.points), (State::Running, 0, 4));
        progress.iteration(Step { index: 1, start: 0.0, end: 0.25 }, 2, f64::NAN);
        file.update(&progress).unwrap();
        assert_eq!(read(directory.path()).unwrap(), first, "not more than once a second");
        drop(lock);
        assert_eq!(read(directory.path()).unwrap().state, State::Died);
        let summary = directory.path().join("summary.json");
        std::fs::write(&summary, r#"{"outcome": "failed"}"#).unwrap();
        assert_eq!(read(directory.path()).unwrap().state, State::Died);
        std::fs::write(&summary, r#"{"outcome": "completed"}"#).unwrap();
        assert_eq!(read(directory.path()).unwrap().state, State::Completed, "killed between the two files");
        std::fs::remove_file(&summary).unwrap();
        progress.finished(Some(&SolveError::OutOfMemory { step: 1, needed: None }));
        file.update(&progress).unwrap();
        let last = read(directory.path()).unwrap();
        assert_eq!((last.state, last.iteration, last.residual), (State::Failed, 2, None));
        assert_eq!(last.load_factor, Some(1.5));
        assert!(last.reason.unwrap().contains("memory"));
        assert_eq!(last.points_per_second.map(|rate| rate > 0.0), Some(true));
    }
}
