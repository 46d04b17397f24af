//! Progress of a run: a bar on a terminal, lines elsewhere, the log, and the status file.

use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crate::deck::quoting::counted;
use crate::model::Model;
use crate::output::checkpoint::Checkpoint;
use crate::output::results::Results;
use crate::output::status::{Progress, Status, StatusFile};
use crate::output::summary::{LawLibrary, Start, Wording};
use crate::points::{Points, coordinates};
use crate::program::screen::closing::Closing;
use crate::program::screen::log::LogFile;
use crate::program::screen::quantities::{bytes, duration, rate, significant};
use crate::solver::{
    Cause, Diagnosis, FailedAttempt, InitialState, Observer, Reached, SolveError, Step, StepReport, Summary,
};
use indicatif::{ProgressBar, ProgressStyle};

/// Amount of output during a run.
pub enum View {
    /// Full output, for the only run of the program.
    Run {
        /// The log, if there is one.
        log: Option<LogFile>,
    },
    /// A bar with this label on a terminal, nothing elsewhere: one run among several.
    Member(String),
}

/// Shortest time between two redraws of the bar.
const FRAME: Duration = Duration::from_millis(100);
/// Approximate number of progress lines of a run without a terminal.
const LINES: usize = 20;
/// Time after which the next converged step prints a progress line in any case.
const SILENCE: Duration = Duration::from_secs(30);

/// Writes the results of a run and shows its progress.
pub struct Watch {
    results: Results,
    view: View,
    progress: Progress,
    status_file: StatusFile,
    /// False once writing the status has failed (`log_works`: the log); a failure is reported once and does not stop
    /// the run.
    status_works: bool,
    log_works: bool,
    display: Display,
    /// Number of warnings printed so far.
    warned: usize,
    stop: Arc<AtomicBool>,
    wording: Arc<dyn Wording>,
    closing: Option<Closing>,
}

/// Length of the bar, in its own units.
const WHOLE: u64 = 10_000;

/// Position of the bar at a time.
fn part_of(time: f64, end_time: f64) -> u64 {
    (time / end_time * WHOLE as f64) as u64
}

/// Form in which the progress is shown.
enum Display {
    Bar { bar: ProgressBar, drawn: Option<Instant> },
    Lines { last: Instant },
    Nothing,
}

impl Watch {
    /// Watches a run; setting `stop` ends it.
    pub fn new<const D: usize>(
        results: Results,
        model: &Model<D>,
        points: usize,
        start: Start,
        view: View,
        wording: Arc<dyn Wording>,
        stop: Arc<AtomicBool>,
    ) -> Self {
        let label = match &view {
            View::Run { .. } => String::new(),
            View::Member(label) => format!("{label} "),
        };
        let display = if io::stderr().is_terminal() {
            let bar = ProgressBar::new(WHOLE).with_prefix(label);
            if let Ok(style) = ProgressStyle::with_template("{prefix}{bar:20} {msg}") {
                bar.set_style(style);
            }
            Display::Bar { bar, drawn: None }
        } else if let View::Run { .. } = view {
            Display::Lines { last: Instant::now() }
        } else {
            Display::Nothing
        };
        let mut watch = Watch {
            status_file: StatusFile::new(results.directory()),
            progress: Progress::new(model, points, start),
            results,
            view,
            status_works: true,
            log_works: true,
            display,
            warned: 0,
            stop,
            wording,
            closing: None,
        };
        if let View::Run { .. } = watch.view {
            if !model.title.is_empty() {
                watch.say(&model.title);
            }
            watch.say(&format!(
                "{}, {}, {}",
                counted(points, "point", "points"),
                counted(model.grid.n_cells(), "cell", "cells"),
                counted(model.steps_requested(), "load step", "load steps")
            ));
        }
        watch
    }

    /// Reports the libraries that provide laws.
    pub fn law_libraries(&mut self, libraries: &[LawLibrary]) {
        if let View::Run { .. } = self.view {
            libraries.iter().for_each(|library| self.say(&library.to_string()));
        }
    }

    /// Reports that the run resumes from a checkpoint.
    pub fn resumed(&mut self, checkpoint: &Checkpoint, reached: &Reached) {
        self.progress.resumed(reached);
        self.warned = reached.summary.warnings.len();
        if let Display::Bar { bar, .. } = &self.display {
            bar.set_position(part_of(reached.progress.step.end, self.progress.status().end_time));
        }
        self.say(&format!(
            "resuming after step {} from {}",
            reached.progress.step.index,
            checkpoint.path.display()
        ));
    }

    /// Prints a line, above the bar if there is one.
    fn print(&self, line: &str) {
        match &self.display {
            Display::Bar { bar, .. } => bar.suspend(|| message!("{line}")),
            Display::Lines { .. } | Display::Nothing => message!("{line}"),
        }
    }

    /// Prints a line and writes it into the log.
    fn say(&mut self, line: &str) {
        self.print(line);
        self.log(line);
    }

    /// Writes a line into the log.
    fn log(&mut self, line: &str) {
        let View::Run { log: Some(log) } = &self.view else { return };
        let written = log.line(line);
        if let (Err(error), true) = (written, self.log_works) {
            self.log_works = false;
            self.print(&format!("warning: the log cannot be written: {error}"));
        }
    }

    /// Prints the probable cause of a failure.
    fn diagnosis(&mut self, diagnosis: &Diagnosis) {
        self.say(&format!("diagnosis: {diagnosis}"));
        let factor = diagnosis.largest_load_factor.map_or(String::new(), |factor| {
            format!("; the largest load factor is {}", significant(factor, 6))
        });
        if let Some(evidence) = diagnosis.evidence() {
            self.say(&format!("  evidence: {evidence}"));
        }
        let time = significant(diagnosis.time, 6);
        self.say(&format!("  in equilibrium up to time {time}{factor}"));
        self.say(&format!("  help: {}", self.wording.on_failure(diagnosis)));
    }

    fn update_status(&mut self) {
        let written = self.status_file.update(&self.progress);
        if let (Err(error), true) = (written, self.status_works) {
            self.status_works = false;
            self.say(&format!("warning: `mpm status` will not see this run: {error}"));
        }
    }

    /// Redraws the bar if it is due.
    fn draw(&mut self) {
        let Display::Bar { bar, drawn } = &mut self.display else { return };
        if drawn.is_some_and(|drawn| drawn.elapsed() < FRAME) {
            return;
        }
        *drawn = Some(Instant::now());
        bar.set_message(on_the_bar(&self.progress.status()));
    }

    /// Prints a line about a converged step if there is no terminal and a line is due.
    fn show_line<const D: usize>(&mut self, report: &StepReport<D>) {
        let Display::Lines { last } = &mut self.display else { return };
        let status = self.progress.status();
        let (step, steps) = (report.step.index, status.steps_requested);
        let ends = status.time >= status.end_time;
        let due = step == 1 || ends || step.is_multiple_of(steps.div_ceil(LINES));
        if due || last.elapsed() >= SILENCE {
            *last = Instant::now();
            let left = status.seconds_left.filter(|_| !ends);
            let left = left.map(|left| format!(", {} left", duration(left))).unwrap_or_default();
            message!("{}{left}", in_equilibrium(report, &status));
        }
    }

    /// Removes the bar; returns the closing summary.
    pub fn end(self) -> Option<Closing> {
        if let Display::Bar { bar, .. } = &self.display {
            bar.finish_and_clear();
        }
        self.closing
    }
}

impl Watch {
    /// Prints which bodies the stage that has just begun has placed onto others.
    fn say_placed(&mut self, summary: &Summary) {
        let Some(last) = summary.placed.last() else { return };
        let stage = last.stage.clone();
        if self.progress.status().stage.as_ref().is_none_or(|now| *now != stage) {
            return;
        }
        let indent = if let View::Member(_) = self.view { "  " } else { "" };
        for placed in summary.placed.iter().filter(|placed| placed.stage == stage) {
            let [low, mean, high] = placed.moved.map(|by| significant(by, 4));
            self.say(&format!(
                "{indent}stage `{stage}`: body `{}`, of volume {}, is placed onto `{}`: moved upwards by {low} to {high}, \
                 {mean} on average",
                placed.body,
                significant(placed.volume, 6),
                placed.onto
            ));
        }
    }

    /// Prints the warnings that have not been printed yet.
    fn say_warnings(&mut self, summary: &Summary) {
        let indent = if let View::Member(_) = self.view { "  " } else { "" };
        for warning in &summary.warnings[self.warned..] {
            let text =
                format!("warning[{}]: {warning}\n  help: {}", warning.code, self.wording.on_warning(warning));
            for line in text.lines() {
                self.say(&format!("{indent}{line}"));
            }
        }
        self.warned = summary.warnings.len();
    }
}

impl<const D: usize> Observer<D> for Watch
where
    Results: Observer<D>,
{
    fn started(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        self.update_status();
        self.draw();
        self.results.started(model, points)
    }

    fn initial_state(&mut self, state: &InitialState) {
        if let View::Run { .. } = self.view {
            self.say(&initial_balance(state));
        }
    }

    fn iteration(&mut self, step: Step, iteration: usize, residual: f64, by_field: &[f64]) {
        Observer::<D>::iteration(&mut self.results, step, iteration, residual, by_field);
        self.progress.iteration(step, iteration, residual);
        self.log(&format!("step {}: iteration {iteration}: residual {residual:.3e}", step.index));
        self.update_status();
        self.draw();
    }

    fn converged(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        reached: &Reached,
    ) -> io::Result<()> {
        let written = self.results.converged(model, points, report, reached);
        self.progress.converged(report, reached);
        let summary = &reached.summary;
        if let Display::Bar { bar, .. } = &self.display {
            bar.set_position(part_of(report.step.end, model.end_time()));
        }
        self.show_line(report);
        if let View::Run { log: Some(_) } = self.view {
            let status = self.progress.status();
            let loss = summary.quality.latest.partition_of_unity_loss;
            self.log(&format!(
                "{}{}, loss of partition of unity {loss:.1e}",
                in_equilibrium(report, &status),
                in_the_log(&status)
            ));
        }
        self.say_warnings(summary);
        self.update_status();
        self.draw();
        written
    }

    fn failed(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        attempt: &FailedAttempt<D>,
        ended: Option<Cause<D>>,
    ) -> io::Result<()> {
        let Step { start, end, .. } = attempt.step;
        let part = (end - start) / model.stepping.size();
        let code = attempt.error.code().unwrap_or_default();
        self.log(&format!("attempt failed [{code}]: {}", attempt.error));
        match ended {
            None if attempt.is_repeated => self
                .log("the step is repeated: the stiffness is renewed in every iteration, and more iterations are allowed"),
            None => {
                self.log(&format!("a step of {} times the requested size is too large", significant(part, 3)))
            }
            Some(cause) => self.diagnosis(cause.diagnosis),
        }
        self.update_status();
        self.draw();
        self.results.failed(model, points, attempt, ended)
    }

    fn bisected(&mut self, model: &Model<D>, points: &Points<D>, step: Step) -> io::Result<()> {
        let part = (step.end - step.start) / model.stepping.size();
        let why = match model.stepping.dynamics {
            None => "the bodies begin to slide in a step",
            Some(_) => "the motion changes too much, or goes too far, in a step",
        };
        self.log(&format!(
            "{why} of {} times the requested size; the next attempt is half as large",
            significant(part, 3)
        ));
        self.update_status();
        self.draw();
        self.results.bisected(model, points, step)
    }

    fn stage_ended(&mut self, model: &Model<D>, points: &Points<D>) -> io::Result<()> {
        self.results.stage_ended(model, points)
    }

    fn stage_began(&mut self, reached: Option<&Reached>) {
        if let Some(reached) = reached {
            self.progress.stage_began(reached);
            self.say_placed(&reached.summary);
            self.update_status();
        }
        Observer::<D>::stage_began(&mut self.results, reached);
    }

    fn interrupted(&self) -> bool {
        self.stop.load(Ordering::SeqCst)
    }

    fn finished(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        reached: &Reached,
        error: Option<&SolveError>,
    ) -> io::Result<()> {
        self.say_warnings(&reached.summary);
        let written = self.results.finished(model, points, reached, error);
        // The summary is complete before the status reports the end of the run.
        let lost = written.as_ref().err().map(SolveError::output);
        self.progress.finished(error.or(lost.as_ref()));
        self.update_status();
        self.closing = Closing::new(model, reached, &self.results, error);
        written
    }
}

/// The balance of the initial state, in words.
fn initial_balance(state: &InitialState) -> String {
    let InitialState { residual, is_balanced, worst, .. } = state;
    match worst {
        Some(worst) if !is_balanced => {
            format!(
                "initial state: out of balance, residual {residual:.3e}, largest at node {}",
                coordinates(&worst.position)
            )
        }
        _ => format!("initial state: in equilibrium, residual {residual:.3e}"),
    }
}

/// The current step, with the number of steps requested or, once steps have been cut or have grown, with the share of
/// the end time reached.
fn step_of(status: &Status) -> String {
    let Status { step, steps_requested, time, end_time, .. } = status;
    let reached = time / end_time;
    if (reached * *steps_requested as f64 - *step as f64).abs() < 1e-6 {
        format!("step {step}/{steps_requested}")
    } else {
        format!("step {step}, {:.4} % of the end time", 100.0 * reached)
    }
}

/// One line about a converged step.
fn in_equilibrium<const D: usize>(report: &StepReport<D>, status: &Status) -> String {
    let solves = counted(report.solves(), "iteration", "iterations");
    let residual = report.residuals.last().copied().unwrap_or(0.0);
    let factor = status.strength_factor.map(|factor| format!(", strength factor {}", significant(factor, 5)));
    format!("{}{}: {solves}, residual {residual:.2e}", step_of(status), factor.unwrap_or_default())
}

/// Text beside the bar: two lines, usually shorter than 80 columns including the bar.
fn on_the_bar(status: &Status) -> String {
    let mut first = step_of(status);
    if let Some(residual) = status.residual {
        first.push_str(&format!("  iteration {}  residual {residual:.1e}", status.iteration));
    }
    let mut second = vec![format!("{} elapsed", duration(status.elapsed_seconds))];
    second.extend(status.seconds_left.map(|left| format!("{} left", duration(left))));
    second.extend(status.load_factor.map(|factor| format!("load factor {}", significant(factor, 3))));
    second.extend(status.strength_factor.map(|factor| format!("strength factor {}", significant(factor, 5))));
    second.extend(status.points_per_second.map(rate));
    second.extend(status.memory_bytes.map(bytes));
    format!("{first}\n{}", second.join("  "))
}

/// Further entries of the log about a converged step.
fn in_the_log(status: &Status) -> String {
    let mut parts = Vec::new();
    parts.extend(status.load_factor.map(|factor| format!("load factor {}", significant(factor, 4))));
    parts.push(counted(status.unknowns, "unknown", "unknowns"));
    parts.extend(status.points_per_second.map(rate));
    parts.extend(status.memory_bytes.map(bytes));
    parts.extend(status.seconds_left.map(|left| format!("{} left", duration(left))));
    parts.iter().map(|part| format!(", {part}")).collect()
}
