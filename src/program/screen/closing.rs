//! The table at the end of a run: model, convergence, results, and the files that contain them.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use crate::deck::quoting::{counted, list};
use crate::model::Model;
use crate::output::findings::{Extreme, Findings, ForceBalance};
use crate::output::results::{Picture, Results};
use crate::output::units::Units;
use crate::program::screen::quantities::{duration, significant};
use crate::quality::{BalanceSoFar, MAX_ENERGY_ERROR, MAX_REGRIDDING};
use crate::solver::{Reached, SolveError, StageStrength, StrengthBracket};

/// Width of a line, [characters]; names and paths may exceed it.
const WIDTH: usize = 80;
/// Width of the first column.
const LABEL: usize = 18;
/// Largest number of boundary conditions listed one by one; if there are more, the last ones are summed.
const MAX_CONDITIONS: usize = 8;

/// Summary printed at the end of a run.
#[derive(Debug)]
pub struct Closing {
    title: String,
    outcome: String,
    points: usize,
    cells: usize,
    bodies: usize,
    unknowns: usize,
    evaluations: usize,
    linear_solves: usize,
    iterative_solves: usize,
    linear_iterations: usize,
    tolerance: f64,
    steps: usize,
    rounding_limited: usize,
    newton_order: Option<f64>,
    quality: String,
    /// Largest share of a basis function that lies beyond the grid, [-].
    loss: Option<f64>,
    balance: BalanceSoFar,
    warnings: usize,
    findings: Findings,
    /// The factor of safety in words, for each stage that reduced the strength.
    safety: Vec<String>,
    /// The limit load in words, for each stage that runs until its limit.
    limits: Vec<String>,
    /// Materials with non-associated flow whose strength is reduced.
    nonassociated: Vec<String>,
    units: Option<Units>,
    /// True in plane strain, where forces are per unit thickness.
    per_thickness: bool,
    directory: PathBuf,
    picture: Option<Picture>,
    asks_for_pictures: bool,
}

impl Closing {
    /// Sums up a run that has ended; `None` if no step is in equilibrium.
    pub fn new<const D: usize>(
        model: &Model<D>,
        reached: &Reached,
        results: &Results,
        error: Option<&SolveError>,
    ) -> Option<Closing> {
        let summary = &reached.summary;
        let (steps, asked) = (summary.steps, model.steps_requested());
        let in_equilibrium = format!("{} in equilibrium", counted(steps, "step", "steps"));
        // With cut steps, a run may have as many steps as requested, or more, without having reached the end.
        let so_far = match steps < asked {
            true => format!("{steps} of {asked} steps in equilibrium"),
            false => in_equilibrium.clone(),
        };
        let outcome = match error {
            None if summary.failed_attempts > 0 => format!(
                "completed: {in_equilibrium} after {}",
                counted(summary.failed_attempts, "failed attempt", "failed attempts")
            ),
            None => format!("completed: {in_equilibrium}"),
            Some(SolveError::Interrupted { .. }) => format!("interrupted: {so_far}"),
            Some(_) => match &summary.diagnosis {
                Some(diagnosis) if summary.failed_attempts > 1 => format!(
                    "failed: {in_equilibrium}, up to time {} of {}",
                    significant(diagnosis.time, 4),
                    significant(model.end_time(), 4)
                ),
                _ => format!("failed: {so_far}"),
            },
        };
        (steps > 0).then(|| Closing {
            title: model.title.clone(),
            outcome,
            points: results.points(),
            cells: model.grid.n_cells(),
            bodies: model.bodies.len(),
            unknowns: summary.unknowns,
            evaluations: summary.evaluations,
            linear_solves: summary.linear_solves,
            iterative_solves: summary.iterative_solves,
            linear_iterations: summary.linear_iterations,
            tolerance: model.newton.tolerance,
            steps,
            rounding_limited: summary.rounding_limited,
            newton_order: summary.quality.median_newton_order(),
            quality: summary.quality.to_string(),
            loss: summary.quality.partition_of_unity_loss.map(|loss| loss.value),
            balance: summary.balance(),
            warnings: summary.warnings.len(),
            findings: results.findings().clone(),
            safety: safety(model, reached),
            limits: reached.progress.limits.iter().map(|found| found.limit.to_string()).collect(),
            nonassociated: Vec::new(),
            units: None,
            per_thickness: D == 2 && !model.revolved,
            directory: results.directory().to_owned(),
            picture: results.last_picture(),
            asks_for_pictures: results.asks_for_pictures(),
        })
    }

    /// States that the factor of safety of these materials depends on the grid.
    pub fn with_nonassociated(self, materials: &[&str]) -> Closing {
        Closing { nonassociated: materials.iter().map(|name| (*name).to_owned()).collect(), ..self }
    }

    /// States the units of the deck.
    pub fn with_units(self, units: Option<Units>) -> Closing {
        Closing { units, ..self }
    }

    /// The unit after a number, with a space before it; empty if the deck states none.
    fn unit(&self, name: impl Fn(&Units) -> String) -> String {
        self.units.as_ref().map(|units| format!(" {}", name(units))).unwrap_or_default()
    }

    /// Formats the table, with a line break at the end; `seconds` is the duration of the run.
    pub fn table(&self, seconds: f64) -> String {
        let mut table = Table::default();
        table.row("", &self.title);
        table.row("outcome", &format!("{}, {}", self.outcome, duration(seconds)));
        self.safety(&mut table);
        for limit in &self.limits {
            table.row("limit load", limit);
        }
        table.row(
            "model",
            &format!(
                "{}, {}, {}, {}",
                counted(self.points, "point", "points"),
                counted(self.cells, "cell", "cells"),
                counted(self.bodies, "body", "bodies"),
                counted(self.unknowns, "unknown", "unknowns")
            ),
        );
        self.convergence(&mut table);
        self.extremes(&mut table);
        if let Some(balance) = &self.findings.balance {
            let force = self.unit(|units| units.force().to_owned()).trim().to_owned();
            let per_thickness = if self.per_thickness {
                self.unit(|units| format!("/{}", units.length()))
            } else {
                String::new()
            };
            let unit = format!("{force}{}", per_thickness.trim());
            table.forces(balance, &unit);
            self.difference(&mut table, balance);
        }
        let errors = &self.findings.errors;
        let shown = [("energy", errors.energy), ("forces", errors.force), ("moments", errors.moment)];
        let shown: Vec<String> = (shown.iter())
            .filter_map(|(name, error)| {
                error.map(|(value, step)| format!("{name} within {value:.1e} (step {step})"))
            })
            .collect();
        if !shown.is_empty() {
            let most = 100.0 * MAX_ENERGY_ERROR;
            table.row(
                "balances",
                &format!("{} (limit of the energy {most} % from step 5 on)", shown.join(", ")),
            );
        }
        let [value, most] = [self.balance.regridding(), MAX_REGRIDDING].map(|share| 100.0 * share);
        let text = format!("{value:.1} % of the external work (limit {most} %)");
        table.row("regridding work", &text);
        table.row("quality", &self.quality);
        if self.warnings > 0 {
            table.row("warnings", &format!("{}, see above and in summary.json", self.warnings));
        }
        self.files(&mut table);
        table.text
    }

    fn safety(&self, table: &mut Table) {
        let mut label = "factor of safety";
        for line in &self.safety {
            table.row(label, line);
            label = " ";
        }
        if self.safety.is_empty() {
            return;
        }
        if !self.nonassociated.is_empty() {
            let names = list(self.nonassociated.iter().map(String::as_str));
            let text = "the factor depends on the cell size: compare another grid";
            table.row(" ", &format!("flow of {names} is non-associated, so {text}"));
        }
    }

    fn convergence(&self, table: &mut Table) {
        if let Some([low, high]) = self.findings.iterations {
            let range = if low == high { low.to_string() } else { format!("{low} to {high}") };
            let order = self.newton_order.map(|order| format!(", of order {order:.2}")).unwrap_or_default();
            table.row(
                "iterations",
                &format!(
                    "{range} in a step{order}; {} in all",
                    counted(self.evaluations, "evaluation", "evaluations")
                ),
            );
        }
        if self.iterative_solves > 0 {
            let factorised = match self.linear_solves - self.iterative_solves {
                0 => String::new(),
                more => format!("; {more} factorised"),
            };
            let each = self.linear_iterations as f64 / self.iterative_solves as f64;
            table.row(
                "linear equations",
                &format!(
                    "{} solved iteratively, in {each:.1} iterations each{factorised}",
                    self.iterative_solves
                ),
            );
        }
        if let Some((residual, step)) = self.findings.worst_residual {
            let tolerance = self.tolerance;
            let limited = match self.rounding_limited {
                0 => String::new(),
                n => format!("; round-off limits {} of {}", n, counted(self.steps, "step", "steps")),
            };
            table.row(
                "residual",
                &format!("at most {residual:.1e} (step {step}), tolerance {tolerance:e}{limited}"),
            );
        }
    }

    fn extremes(&self, table: &mut Table) {
        let Some(extremes) = &self.findings.extremes else { return };
        let several = self.bodies > 1;
        let (length, stress) = (self.unit(|units| units.length().to_owned()), self.unit(Units::stress));
        let place = |extreme: &Extreme, unit: &str| {
            let position: Vec<String> = extreme.position.iter().map(|x| significant(*x, 4)).collect();
            let body = if several { format!(" of `{}`", extreme.body) } else { String::new() };
            format!("{}{unit}{body} at ({}){length}", significant(extreme.value, 5), position.join(", "))
        };
        table.row("displacement", &format!("at most {}", place(&extremes.displacement, &length)));
        table.row("von Mises stress", &format!("at most {}", place(&extremes.von_mises_stress, &stress)));
        let (low, high) = (&extremes.lowest_pressure, &extremes.highest_pressure);
        table.row("pressure", &format!("from {}\nto {}", place(low, &stress), place(high, &stress)));
    }

    /// Says where a difference of forces comes from that the iterations did not leave.
    fn difference(&self, table: &mut Table, balance: &ForceBalance) {
        let explained = self.loss.is_some_and(|loss| loss > 0.0);
        if explained && balance.relative_difference().is_some_and(|share| share > 10.0 * self.tolerance) {
            table.row(
                " ",
                "(not left by the iterations: domains reach beyond the grid, where their share of stress acts on no \
                 node; a row of cells behind the supports avoids it)",
            );
        }
    }

    fn files(&self, table: &mut Table) {
        let directory = self.directory.display().to_string();
        let word = shell_word(&self.directory);
        table.entry("results", &directory);
        table.entry("report", &format!("mpm report {word}"));
        match &self.picture {
            Some(Picture { series, .. }) => {
                table.entry("picture", &format!("mpm picture {word}"));
                table.entry("in ParaView", &format!("paraview {}", shell_word(series)));
                table.entry("in Python", &format!("import mpm; mpm.read({directory:?}).plot()"));
            }
            None if self.asks_for_pictures => table.row("", "no VTU files could be written"),
            None => table.row("", "no VTU files: the deck sets `output: {every: 0}`"),
        }
    }
}

/// A path as a word of a shell command, in quotes if it has characters with a meaning there.
fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    if text.chars().all(|c| c.is_alphanumeric() || "/._-+,=:@%".contains(c)) {
        return text;
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// The factors of safety in words, and what the search for them has cost: a single one, or one for each of several
/// stages, with its name.
fn safety<const D: usize>(model: &Model<D>, reached: &Reached) -> Vec<String> {
    let progress = &reached.progress;
    let in_words = |stage_strength: &StageStrength| {
        let stage = model.stages.get(stage_strength.stage).filter(|_| progress.strength.len() > 1);
        let stage = stage.map(|stage| format!("stage `{}`: ", stage.name)).unwrap_or_default();
        let StrengthBracket { attempts, evaluations, .. } = stage_strength.bracket;
        let cpu = reached.summary.searches.get(&stage_strength.stage).copied().unwrap_or_default();
        format!(
            "{stage}{}; the search took {}, {} and {} s of CPU",
            stage_strength.bracket,
            counted(attempts, "attempt", "attempts"),
            counted(evaluations, "evaluation", "evaluations"),
            significant(cpu.as_secs_f64(), 2)
        )
    };
    progress.strength.iter().map(in_words).collect()
}

/// Rows, each with a label and some text.
#[derive(Default)]
struct Table {
    text: String,
}

impl Table {
    fn line(&mut self, line: &str) {
        // Writing into a string cannot fail.
        let _ = writeln!(self.text, "  {}", line.trim_end());
    }

    /// A row that is not wrapped: a path or a command.
    fn entry(&mut self, label: &str, text: &str) {
        self.line(&format!("{label:<LABEL$}{text}"));
    }

    /// A row; the text is wrapped and may take several lines. A row without a label starts at the margin.
    fn row(&mut self, label: &str, text: &str) {
        let indent = if label.is_empty() { 0 } else { LABEL };
        let mut label = label;
        for line in text.lines().flat_map(|line| wrapped(line, WIDTH - 2 - indent)) {
            self.line(&format!("{label:<indent$}{line}"));
            label = "";
        }
    }

    /// Loads, reactions and their difference, by axis.
    fn forces(&mut self, balance: &ForceBalance, unit: &str) {
        let axes = ["x", "y", "z"].iter().take(balance.applied.len());
        let label = if unit.is_empty() { "forces".to_owned() } else { format!("forces [{unit}]") };
        self.line(&format!("{label:<LABEL$}{}", columns(axes.map(|axis| (*axis).to_owned()))));
        let mut row = |label: &str, force: &[Option<f64>], after: &str| {
            let label: String = if label.chars().count() < LABEL {
                format!("{label:<LABEL$}")
            } else {
                format!("{}… ", label.chars().take(LABEL - 2).collect::<String>())
            };
            self.line(&format!("{label}{}{after}", columns(force.iter().map(number))));
        };
        row("  loads", &all(&balance.applied), "");
        for (name, force) in &balance.further {
            row(&format!("  {name}"), &all(force), "");
        }
        // All conditions, or all but those that share the last line.
        let shown =
            if balance.reactions.len() > MAX_CONDITIONS { MAX_CONDITIONS - 1 } else { MAX_CONDITIONS };
        for (name, reaction) in balance.reactions.iter().take(shown) {
            row(&format!("  {name}"), &all(reaction), "");
        }
        let rest = balance.reactions.get(shown..).unwrap_or_default();
        if !rest.is_empty() {
            let sum = |axis: usize| Some(rest.iter().map(|(_, r)| r[axis]).sum());
            let sums: Vec<_> = (0..balance.applied.len()).map(sum).collect();
            row(&format!("  {} more", rest.len()), &sums, "");
        }
        let relative = balance.relative_difference();
        let after = relative.map(|share| format!("   {share:.1e} of all forces")).unwrap_or_default();
        let difference = balance.difference();
        row("  difference", &difference, &after);
    }
}

fn all(force: &[f64]) -> Vec<Option<f64>> {
    force.iter().copied().map(Some).collect()
}

fn number(force: &Option<f64>) -> String {
    force.map_or_else(|| "–".to_owned(), |force| significant(force, 5))
}

fn columns(entries: impl Iterator<Item = String>) -> String {
    entries.map(|entry| format!("{entry:>13}")).collect()
}

/// Breaks a line at spaces into lines of at most `width` characters; a longer word gets a line of its own.
fn wrapped(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let Some(last) = lines.last_mut() else { break };
        if !last.is_empty() && last.chars().count() + 1 + word.chars().count() > width {
            lines.push(word.to_owned());
        } else {
            if !last.is_empty() {
                last.push(' ');
            }
            last.push_str(word);
        }
    }
    lines
}
