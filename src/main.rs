//! `mpm run|sweep|report|check|schema`: arguments, messages and exit codes. Everything else is in the library.

#[macro_use]
mod tell;
mod analysis;
mod progress;
mod report;
mod sweep;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::{Args, Parser, Subcommand, ValueEnum};
use mpm::deck::load::load;
use mpm::deck::schema::deck_schema;
use mpm::memory::in_words;
use mpm::output::summary::Start;
use mpm::solver::SolveError;
use mpm::timing::{Phase, Timings};

use analysis::{Ready, explain, messages, prepare, report, run_into};
use progress::View;
use report::ReportArgs;
use sweep::SweepArgs;

/// The analysis failed.
const FAILED: u8 = 1;
/// The deck or the command line is wrong.
const USAGE: u8 = 2;
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
    /// Run a deck for every combination of lists of values of its parameters.
    Sweep(SweepArgs),
    /// Write a report on results as one page of HTML; several results are compared.
    Report(ReportArgs),
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
    /// How messages about the deck are written.
    #[arg(long, value_name = "FORMAT", default_value = "text")]
    format: Format,
    /// Take warnings about the deck for errors.
    #[arg(long, visible_alias = "warnings-as-errors")]
    deny_warnings: bool,
}

/// How messages about a deck are written.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// Text for people, to standard error.
    Text,
    /// One JSON document for programs, to standard output.
    Json,
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
        Command::Sweep(args) => sweep::sweep(args),
        Command::Report(args) => report::report(args),
        Command::Check { deck } => check(&deck),
        Command::Schema => print_schema(),
    };
    result.unwrap_or_else(|error| {
        tell!("error: {error:#}");
        ExitCode::from(USAGE)
    })
}

/// Reads and builds a deck; messages about it are printed. `None` when it cannot be used.
fn prepare_aloud(args: &DeckArgs) -> anyhow::Result<Option<Ready>> {
    let prepared = prepare(load(&args.deck, &args.set), args.deny_warnings);
    match args.format {
        Format::Json => {
            print_json(&report(&prepared))?;
        }
        Format::Text => {
            let messages = messages(&prepared);
            if !messages.is_empty() {
                tell!("{messages}");
            }
        }
    }
    Ok(prepared.ok())
}

fn run(
    args: &DeckArgs,
    out: Option<PathBuf>,
    threads: Option<usize>,
    print_timings: bool,
    began: Instant,
) -> anyhow::Result<ExitCode> {
    analysis::start_threads(threads)?;
    let mut timings = Timings::default();
    let Some(ready) = timings.measure(Phase::SetUp, || prepare_aloud(args))? else {
        return Ok(ExitCode::from(USAGE));
    };
    let directory = out.unwrap_or_else(|| default_directory(&args.deck));
    let stop = analysis::stop_on_interrupt()?;
    let outcome = run_into(&directory, ready, Start::of_program(began), timings.clone(), View::Run, &stop)?;
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
    explain(error);
    tell!("  results up to the last equilibrated step are in {}", directory.display());
    ExitCode::from(FAILED)
}

fn default_directory(deck: &Path) -> PathBuf {
    Path::new("results").join(deck.file_stem().unwrap_or_default())
}

fn check(args: &DeckArgs) -> anyhow::Result<ExitCode> {
    let Some(ready) = prepare_aloud(args)? else {
        return Ok(ExitCode::from(USAGE));
    };
    if args.format == Format::Json {
        return Ok(ExitCode::SUCCESS);
    }
    print(&format!(
        "{}: ready\n  {} points in {} bodies, {} cells, {} active nodes, {} unknowns in the first of {} steps, \
         about {} of memory\n",
        ready.loaded.source.name(),
        ready.points.len(),
        ready.model.bodies.len(),
        ready.model.grid.n_cells(),
        ready.first.active_nodes,
        ready.first.unknowns,
        ready.model.n_steps,
        in_words(ready.memory()),
    ))
}

fn print_schema() -> anyhow::Result<ExitCode> {
    print_json(&deck_schema())
}

/// Writes a JSON document to standard output.
fn print_json(document: &serde_json::Value) -> anyhow::Result<ExitCode> {
    let mut text = serde_json::to_string_pretty(document)?;
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
