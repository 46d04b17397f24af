//! What the user sees while a run goes on: a bar on a terminal, plain lines elsewhere.

use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressStyle};
use mpm::model::Model;
use mpm::output::results::Results;
use mpm::points::Points;
use mpm::solver::{Observer, SolveError, Step, StepReport, Summary};
use mpm::timing::{Phase, Timings};

/// What is shown of a run.
pub enum View {
    /// Everything: it is all that the program does.
    Run,
    /// Only a bar under this label, and nothing where there is no terminal: it is one run among others.
    Member(String),
}

/// Writes the results and shows the progress of a run.
pub struct Watch {
    results: Results,
    view: View,
    bar: Option<ProgressBar>,
    n_steps: usize,
    /// Warnings that were printed.
    warned: usize,
    stop: Arc<AtomicBool>,
}

impl Watch {
    /// Watches a run that `stop` may end.
    pub fn new(
        results: Results,
        model: &Model<2>,
        points: &Points<2>,
        view: View,
        stop: Arc<AtomicBool>,
    ) -> Self {
        let label = match &view {
            View::Run => {
                if !model.title.is_empty() {
                    tell!("{}", model.title);
                }
                tell!(
                    "{} points, {} cells, {} load steps",
                    points.len(),
                    model.grid.n_cells(),
                    model.n_steps
                );
                String::new()
            }
            View::Member(label) => format!("{label} "),
        };
        let bar = io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(model.n_steps as u64).with_prefix(label);
            let layout = "{prefix}{bar:30} {msg} [{elapsed} < {eta}]";
            if let Ok(style) = ProgressStyle::with_template(layout) {
                bar.set_style(style);
            }
            bar
        });
        Watch { results, view, bar, n_steps: model.n_steps, warned: 0, stop }
    }

    /// Prints above the bar, if there is one.
    fn print(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.suspend(|| tell!("{line}")),
            None => tell!("{line}"),
        }
    }

    /// Leaves the terminal tidy.
    pub fn end(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Observer<2> for Watch {
    fn started(&mut self, model: &Model<2>, points: &Points<2>) -> io::Result<()> {
        self.results.started(model, points)
    }

    fn iteration(&mut self, step: Step, iteration: usize, residual: f64) {
        Observer::<2>::iteration(&mut self.results, step, iteration, residual);
        if let Some(bar) = &self.bar {
            let (index, n) = (step.index, self.n_steps);
            bar.set_message(format!("step {index}/{n} iteration {iteration} residual {residual:.1e}"));
        }
    }

    fn converged(
        &mut self,
        model: &Model<2>,
        points: &Points<2>,
        report: &StepReport<2>,
        summary: &Summary,
    ) -> io::Result<()> {
        match (&self.bar, &self.view) {
            (Some(bar), _) => bar.inc(1),
            (None, View::Member(_)) => {}
            (None, View::Run) => tell!(
                "step {}/{}: {} iterations, residual {:.2e}",
                report.step.index,
                self.n_steps,
                report.residuals.len() - 1,
                report.residuals.last().copied().unwrap_or(0.0)
            ),
        }
        let indent = if let View::Member(_) = self.view { "  " } else { "" };
        for warning in &summary.warnings[self.warned..] {
            self.print(&format!("{indent}warning: {warning}"));
        }
        self.warned = summary.warnings.len();
        self.results.converged(model, points, report, summary)
    }

    fn interrupted(&self) -> bool {
        self.stop.load(Ordering::SeqCst)
    }

    fn finished(
        &mut self,
        model: &Model<2>,
        points: &Points<2>,
        summary: &Summary,
        error: Option<&SolveError>,
    ) -> io::Result<()> {
        if let View::Run = self.view
            && summary.steps > 0
        {
            self.print(&format!("quality: {}", summary.quality));
        }
        self.results.finished(model, points, summary, error)
    }
}

/// Prints the phases of a run in the manner of the paper's Table 5.
pub fn print_timings(timings: &Timings) {
    let total: f64 = Phase::ALL.iter().map(|&phase| timings.of(phase).wall.as_secs_f64()).sum();
    tell!("{:<10} {:>10} {:>10} {:>7}", "phase", "wall [s]", "CPU [s]", "share");
    for phase in Phase::ALL {
        let spent = timings.of(phase);
        let wall = spent.wall.as_secs_f64();
        tell!(
            "{:<10} {:>10.3} {:>10.3} {:>6.1}%",
            phase.name(),
            wall,
            spent.cpu.as_secs_f64(),
            100.0 * wall / total.max(f64::MIN_POSITIVE)
        );
    }
}
