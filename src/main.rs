//! `mpm run|check|schema`: arguments, messages and exit codes. Everything else is in the library.

#[macro_use]
mod tell;
mod progress;

use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::{Args, Parser, Subcommand};
use mpm::basis::Connectivity;
use mpm::deck::build::build;
use mpm::deck::diagnostic::render_all;
use mpm::deck::load::{LoadedDeck, load};
use mpm::deck::schema::deck_schema;
use mpm::model::Model;
use mpm::output::results::Results;
use mpm::output::summary::Account;
use mpm::points::Points;
use mpm::solver::{self, SolveError};
use mpm::stress::PlaneStrain;
use mpm::timing::{Phase, Timings};

use progress::Watch;

/// The analysis failed.
const FAILED: u8 = 1;
/// The deck or the command line is wrong.
const USAGE: u8 = 2;
/// Most threads that can be asked for.
const MOST_THREADS: usize = 1024;
/// The user stopped the run.
const INTERRUPTED: u8 = 130;

/// Implicit, quasi-static, finite-deformation material point method.
///
/// First run:  mpm run inputs/beam.yaml   then open results/beam/points.pvd in ParaView.
#[derive(Parser)]
#[command(version, about, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run the analysis of a deck.
    Run {
        #[command(flatten)]
        deck: DeckArgs,
        /// Directory for the results [default: results/<deck name>].
        #[arg(long, value_name = "DIR")]
        out: Option<PathBuf>,
        /// Number of threads [default: all cores]. The results are the same for any number.
        #[arg(long, value_name = "N")]
        threads: Option<usize>,
        /// Print where the time went.
        #[arg(long)]
        timings: bool,
    },
    /// Do everything up to the first load step and report.
    Check {
        #[command(flatten)]
        deck: DeckArgs,
    },
    /// Print the JSON schema of decks.
    Schema,
}

#[derive(Args)]
struct DeckArgs {
    /// The deck, a YAML file.
    deck: PathBuf,
    /// Set a parameter of the deck, as often as needed.
    #[arg(long, value_name = "NAME=VALUE", value_parser = assignment)]
    set: Vec<(String, String)>,
}

fn assignment(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.to_owned())),
        _ => Err("expected NAME=VALUE, for example h=0.25".to_owned()),
    }
}

fn main() -> ExitCode {
    let began = Instant::now();
    let result = match Cli::parse().command {
        Command::Run { deck, out, threads, timings } => run(&deck, out, threads, timings, began),
        Command::Check { deck } => check(&deck),
        Command::Schema => print_schema(),
    };
    result.unwrap_or_else(|error| {
        tell!("error: {error:#}");
        ExitCode::from(USAGE)
    })
}

/// Reads and builds a deck; messages about it are printed. `None` when it cannot be used.
fn prepare(args: &DeckArgs) -> Option<(LoadedDeck, Model<2>, Points<2>)> {
    let colour = std::io::stderr().is_terminal();
    let loaded = match load(&args.deck, &args.set) {
        Ok(loaded) => loaded,
        Err(failure) => {
            tell!("{}", failure.render(colour).trim_end());
            return None;
        }
    };
    match build(&loaded) {
        Ok((model, points)) => {
            if !loaded.notes.is_empty() {
                tell!("{}", render_all(&loaded.source, &loaded.notes, colour).trim_end());
            }
            Some((loaded, model, points))
        }
        Err(mut found) => {
            found.extend(loaded.notes);
            tell!("{}", render_all(&loaded.source, &found, colour).trim_end());
            None
        }
    }
}

fn run(
    args: &DeckArgs,
    out: Option<PathBuf>,
    threads: Option<usize>,
    print_timings: bool,
    began: Instant,
) -> anyhow::Result<ExitCode> {
    if threads.is_some_and(|n| !(1..=MOST_THREADS).contains(&n)) {
        bail!("--threads takes a number from 1 to {MOST_THREADS}");
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build_global()
        .context("the threads cannot be started")?;
    let mut timings = Timings::default();
    let Some((loaded, model, mut points)) = timings.measure(Phase::SetUp, || prepare(args)) else {
        return Ok(ExitCode::from(USAGE));
    };
    let directory = out.unwrap_or_else(|| default_directory(&args.deck));
    let account = Account {
        began,
        parameters: loaded.parameters.clone(),
        set_up: timings.clone(),
        threads: rayon::current_num_threads(),
    };
    let every = loaded.deck.output.every as usize;
    let results = Results::create(&directory, every, &model, account)
        .with_context(|| format!("the results directory `{}` cannot be written", directory.display()))?;
    let mut watch = Watch::new(results, &model, &points, stop_on_interrupt()?);
    let outcome = solver::run::<2, PlaneStrain>(&model, &mut points, &mut watch);
    watch.end();
    Ok(match outcome {
        Ok(summary) => {
            tell!(
                "completed: {} steps in equilibrium, {} evaluations, {:.1} s; results in {}",
                summary.steps,
                summary.evaluations,
                began.elapsed().as_secs_f64(),
                directory.display()
            );
            if print_timings {
                timings.add(&summary.timings);
                progress::print_timings(&timings);
            }
            ExitCode::SUCCESS
        }
        Err(error) => report_failure(&error, &directory),
    })
}

/// Prints why a run ended early; returns the exit code.
fn report_failure(error: &SolveError, directory: &Path) -> ExitCode {
    if let SolveError::Interrupted { step } = error {
        tell!(
            "interrupted: all steps before step {step} are in equilibrium and written to {}",
            directory.display()
        );
        return ExitCode::from(INTERRUPTED);
    }
    tell!("error: {error}");
    if !error.residuals().is_empty() {
        let history: Vec<String> = error.residuals().iter().map(|r| format!("{r:.3e}")).collect();
        tell!("  residuals: {}", history.join(", "));
    }
    if let Some(help) = error.help() {
        tell!("  help: {help}");
    }
    tell!("  results up to the last equilibrated step are in {}", directory.display());
    ExitCode::from(FAILED)
}

fn default_directory(deck: &Path) -> PathBuf {
    Path::new("results").join(deck.file_stem().unwrap_or_default())
}

/// A flag that Ctrl-C raises; a second Ctrl-C ends the program at once.
fn stop_on_interrupt() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if raised.swap(true, Ordering::SeqCst) {
            tell!("interrupted at once: the step in hand is not written");
            std::process::exit(i32::from(INTERRUPTED));
        }
        tell!("stopping after the step in hand; press Ctrl-C again to stop at once");
    })
    .context("Ctrl-C cannot be handled")?;
    Ok(stop)
}

fn check(args: &DeckArgs) -> anyhow::Result<ExitCode> {
    let Some((loaded, model, mut points)) = prepare(args) else {
        return Ok(ExitCode::from(USAGE));
    };
    let methods: Vec<_> = model.bodies.iter().map(|body| body.method).collect();
    let links = Connectivity::new(&model.grid, &mut points, &methods)
        .map_err(|p| anyhow::anyhow!("point {} lies outside the grid", points.id[p]))?;
    let first = model.end_time / model.n_steps as f64;
    let dofs = match mpm::constraints::DofMap::new(&model, &points, &links, 0.0, first) {
        Ok(dofs) => dofs,
        Err(error) => {
            tell!("error: {error}");
            return Ok(ExitCode::from(USAGE));
        }
    };
    if let Err(error) = mpm::loads::external_force(&model, &points, &links, first) {
        tell!("error: {error}");
        return Ok(ExitCode::from(USAGE));
    }
    let [nx, ny] = model.grid.cells();
    print(&format!(
        "{}: ready\n  {} points in {} bodies, {nx} x {ny} cells, {} active nodes, {} unknowns in the first of {} steps\n",
        loaded.source.name(),
        points.len(),
        model.bodies.len(),
        links.n_active(),
        dofs.n_free(),
        model.n_steps,
    ))
}

fn print_schema() -> anyhow::Result<ExitCode> {
    let mut text = serde_json::to_string_pretty(&deck_schema())?;
    text.push('\n');
    print(&text)
}

/// Writes to standard output; a reader that has gone away is no error.
fn print(text: &str) -> anyhow::Result<ExitCode> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(ExitCode::SUCCESS),
    }
}
