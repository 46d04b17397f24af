//! `mpm converge`: a quantity of a deck on several grids, with an error bar.

use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use crate::appendix;
use crate::deck::load::{self, LoadFailure, LoadedDeck, load_text};
use crate::deck::refinement::DeckText;
use crate::output::shortest;
use crate::program::commands::analysis::{self, Begin, not_writable, prepare};
use crate::program::commands::arguments::{LibraryArgs, assignment};
use crate::program::commands::member::Members;
use crate::program::commands::overwriting::{REPORT, may_be_replaced};
use crate::program::exit::{DONE, FAILED, INTERRUPTED, USAGE};
use crate::program::interrupt::stop_on_interrupt;
use crate::program::screen::quantities::{duration, significant};
use crate::ranks::Ranks;
use crate::study::convergence::{Convergence, Findings, GridRun, MOVED_NOT_ENDED, Prediction, Quantity};
use crate::study::family::{Family, Grid};
use crate::study::{Axis, Outcome};
use anyhow::{Context, bail};
use clap::Args;

/// Arguments of `mpm converge`.
#[derive(Args)]
pub struct ConvergeArgs {
    /// The deck, a YAML file.
    deck: PathBuf,
    /// The quantity: a column of history.csv, whose last value counts, such as footing_ry; largest:COLUMN for its value
    /// of largest magnitude; factor_of_safety; limit_load; or an extent of a body, as in the table of `mpm sweep`.
    #[arg(long, value_name = "NAME")]
    quantity: Quantity,
    /// Error that is wanted, such as 2%: the cells are halved until the error bar is at most this part of the value.
    #[arg(long, value_name = "PERCENT", value_parser = percentage)]
    to: Option<f64>,
    /// Set a parameter of the deck; may be given several times.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
    /// The parameter that refines the grid, with at least three values from coarse to fine [default: the parameter that
    /// sets the cell size, or the spacing of the grid, at four times, twice and once its value].
    #[arg(long, value_name = "NAME=COARSE,MIDDLE,FINE")]
    over: Option<Axis>,
    /// Treat warnings about the deck as errors.
    #[arg(long, visible_alias = "warnings-as-errors")]
    deny_warnings: bool,
    #[command(flatten)]
    libraries: LibraryArgs,
    /// Directory for the results [default: results/<deck name>-converge].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of threads [default: all cores]. The results are the same for any number.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
}

/// Largest number of halvings with `--to`.
const MAX_HALVINGS: usize = 4;
/// Errors whose cost is stated without `--to`, relative to the value, [-].
const USUAL_ERRORS: [f64; 2] = [0.02, 0.01];
/// Name of the page about the study.
const PAGE: &str = "convergence.html";

/// Reads `2%`, or `0.02`.
fn percentage(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let read = match text.strip_suffix('%') {
        Some(percent) => percent.trim().parse().map(|percent: f64| percent / 100.0),
        None => text.parse(),
    };
    read.ok()
        .filter(|error| (1e-9..1.0).contains(error))
        .ok_or("expected an error, for example 2%".to_owned())
}

/// Runs the study.
pub fn converge(args: ConvergeArgs) -> anyhow::Result<u8> {
    let name = args.deck.display().to_string();
    let base = match load::read(&args.deck) {
        Ok(text) => DeckText { name: name.clone(), text, overrides: args.set },
        Err(failure) => return Ok(refuse(&failure)),
    };
    let loaded = match load_text(&base.name, &base.text, &base.overrides) {
        Ok(loaded) => loaded,
        Err(failure) => return Ok(refuse(&failure)),
    };
    analysis::start_threads(args.threads)?;
    let stop = stop_on_interrupt(true)?;
    let directory = args.out.unwrap_or_else(|| {
        let mut name = args.deck.file_stem().unwrap_or_default().to_owned();
        name.push("-converge");
        Path::new("results").join(name)
    });
    std::fs::create_dir_all(&directory).map_err(|error| not_writable(&directory, error))?;
    let page = directory.join(PAGE);
    if !may_be_replaced(&page, REPORT) {
        bail!("`{}` exists, but is not a page of mpm; choose another directory", page.display());
    }
    let has_table = directory.join("convergence_study.csv").exists();
    if directory.join("summary.json").exists() || has_table && !page.exists() {
        bail!("`{}` has other results than those of a study; choose another directory", directory.display());
    }
    let members = Members {
        deny_warnings: args.deny_warnings,
        libraries: args.libraries,
        stop,
        begin: Begin::AtCheckpointIfAny,
        printed: BTreeSet::new(),
        speaks: true,
    };
    let family = Family::new(base, args.over, &first_step(&members)).map_err(anyhow::Error::msg)?;
    if let Some(note) = &family.note {
        message!("{note}");
    }
    let findings = Findings {
        deck: name,
        title: loaded.deck.title.clone(),
        quantity: args.quantity.to_string(),
        dimensions: loaded.deck.dimensions(),
        grids: Vec::new(),
        moved: None,
        not_moved: None,
        refused: None,
    };
    let without_order = loaded.without_order();
    let mut study = Study { quantity: args.quantity, family, directory, members, findings, without_order };
    study.run(args.to)
}

/// Prints the faults of a deck.
fn refuse(failure: &LoadFailure) -> u8 {
    message!("{}", failure.render(std::io::stderr().is_terminal()).trim_end());
    USAGE
}

/// A check that the first load step of a deck can begin.
fn first_step(members: &Members) -> impl Fn(LoadedDeck) -> Result<(), String> {
    let (libraries, deny_warnings) = (members.libraries, members.deny_warnings);
    move |mut loaded| {
        libraries.allow(&mut loaded);
        let prepared = prepare(Ok(loaded), deny_warnings, &Ranks::default());
        prepared.map(drop).map_err(|failure| failure.in_one_line())
    }
}

/// A study in progress.
struct Study {
    quantity: Quantity,
    family: Family,
    directory: PathBuf,
    members: Members,
    /// What the runs so far have found.
    findings: Findings,
    /// Why values of this deck have no order once points yield, in words.
    without_order: Option<String>,
}

/// The exit code of a study that gives no value.
struct Stopped(u8);

impl Study {
    /// Runs all grids, then finer ones until the error is as wanted; returns the exit code.
    fn run(&mut self, wanted: Option<f64>) -> anyhow::Result<u8> {
        for index in 0..self.family.grids.len() {
            if let Err(Stopped(code)) = self.run_grid(index)? {
                return Ok(code);
            }
        }
        if let Err(Stopped(code)) = self.run_moved()? {
            return Ok(code);
        }
        let mut study = self.conclude(wanted)?;
        for _ in 0..MAX_HALVINGS {
            let is_enough = |wanted: f64| study.estimate.relative_bar().is_none_or(|bar| bar <= wanted);
            if wanted.is_none_or(is_enough) {
                break;
            }
            if let Err(why) = self.family.halve(&first_step(&self.members)) {
                message!("no finer grid: {why}");
                break;
            }
            if let Some([_, middle, fine]) = self.findings.last_three() {
                let growth = (fine.cpu_seconds / middle.cpu_seconds).max(1.0);
                message!("the next grid takes about {} of CPU time", duration(fine.cpu_seconds * growth));
            }
            if let Err(Stopped(code)) = self.run_grid(self.family.grids.len() - 1)? {
                return Ok(code);
            }
            let finer = self.conclude(wanted)?;
            let has_grown = finer.estimate.bar >= study.estimate.bar;
            study = finer;
            if has_grown {
                message!("the error bar does not shrink with the cells");
                break;
            }
        }
        let is_missed = |wanted: f64| study.estimate.relative_bar().is_none_or(|bar| bar > wanted);
        let is_missed = wanted.is_some_and(is_missed);
        if is_missed {
            message!("the wanted error is not reached");
        }
        message!("the study is {}", self.directory.join(PAGE).display());
        Ok(if is_missed { FAILED } else { DONE })
    }

    /// Runs the deck on a grid of the family.
    fn run_grid(&mut self, index: usize) -> anyhow::Result<Result<(), Stopped>> {
        let grid = self.family.grids[index].clone();
        self.members.speaks = true;
        Ok(match self.run_deck(&grid)? {
            Ok(run) => {
                self.findings.add(run).map_err(anyhow::Error::msg)?;
                Ok(())
            }
            Err(stopped) => Err(stopped),
        })
    }

    /// Runs a deck, unless it was completed earlier, and reads the quantity.
    fn run_deck(&mut self, grid: &Grid) -> anyhow::Result<Result<GridRun, Stopped>> {
        let Grid { label, deck, .. } = grid;
        let name = grid.directory_name();
        let directory = self.directory.join(&name);
        let record = match Members::completed(deck, &directory) {
            Some(record) => {
                message!("{label}: completed earlier");
                record
            }
            None if self.members.stop.load(Ordering::SeqCst) => return Ok(Err(Stopped(INTERRUPTED))),
            None => {
                message!("{label}");
                match self.members.run(deck, &directory, label.clone()) {
                    (Outcome::Completed, Some(record)) => record,
                    (Outcome::Interrupted, _) => return Ok(Err(Stopped(INTERRUPTED))),
                    (Outcome::Invalid(_), _) => return Ok(Err(Stopped(USAGE))),
                    _ => {
                        message!("no conclusion: the run with {label} has not reached its end");
                        return Ok(Err(Stopped(FAILED)));
                    }
                }
            }
        };
        if record.has_yielded() {
            self.findings.refused.clone_from(&self.without_order);
        }
        let dimensions = self.findings.dimensions;
        let run =
            GridRun::read(&record, &self.quantity, grid, dimensions, name).map_err(anyhow::Error::msg)?;
        Ok(Ok(run))
    }

    /// Runs the middle of the first three grids once more, with its inner lines moved along as many axes as the deck
    /// allows.
    fn run_moved(&mut self) -> anyhow::Result<Result<(), Stopped>> {
        let middle = &self.family.grids[self.family.grids.len() - 2];
        let (moved, why) = self.family.moved(middle, &first_step(&self.members));
        self.findings.not_moved = why;
        let Some(grid) = moved else { return Ok(Ok(())) };
        // Its warnings are about places of grid lines that nobody has chosen.
        self.members.speaks = false;
        match self.run_deck(&grid) {
            Ok(Ok(run)) => self.findings.moved = Some(run),
            Ok(Err(Stopped(INTERRUPTED))) => return Ok(Err(Stopped(INTERRUPTED))),
            // The three grids have a conclusion without this run.
            Ok(Err(_)) => self.findings.not_moved = Some(MOVED_NOT_ENDED.to_owned()),
            Err(why) => self.findings.not_moved = Some(format!("on the moved grid, {why}")),
        }
        Ok(Ok(()))
    }

    /// Writes and prints what the runs so far show.
    fn conclude(&self, wanted: Option<f64>) -> anyhow::Result<Convergence> {
        let errors = wanted.map_or(USUAL_ERRORS.to_vec(), |wanted| vec![wanted]);
        let study = self.findings.clone().conclude(&errors).context("there are fewer than three grids")?;
        study.write(&self.directory).map_err(|error| not_writable(&self.directory, error))?;
        appendix::write(&self.directory.join(PAGE), &appendix::convergence_page(&study))?;
        print(&study);
        Ok(study)
    }
}

/// Prints the values and the conclusion.
fn print(study: &Convergence) {
    let rows = study.findings.grids.iter().chain(&study.findings.moved);
    let width = rows.clone().map(|run| run.label.chars().count()).max().unwrap_or(0);
    message!("\n  {:width$}  {:>14}  {:>9}  {:>9}", "grid", study.findings.quantity, "points", "CPU");
    for run in rows {
        let points = run.points.map_or_else(String::new, |points| points.to_string());
        let (value, cpu) = (format!("{:.6e}", run.known.value), duration(run.cpu_seconds));
        message!("  {:width$}  {value:>14}  {points:>9}  {cpu:>9}", run.label);
    }
    if let Some(why) = &study.findings.not_moved {
        message!("  {why}");
    }
    message!("{}", study.conclusion());
    for Prediction { error, size, cpu_seconds } in &study.predictions {
        if *size < 1.0 {
            message!(
                "  for an error of {} %: cells {} times as long as the finest so far, about {} of CPU time",
                shortest(100.0 * error),
                significant(*size, 2),
                duration(*cpu_seconds)
            );
        }
    }
}
