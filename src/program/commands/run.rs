//! `mpm run` and `mpm check`: one deck.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::deck::quoting::counted;
use crate::memory::in_words;
use crate::output::summary::Start;
use crate::program::commands::analysis::{
    self, Begin, Ended, Run, describe_failure, prepare_and_report, run_into,
};
use crate::program::commands::arguments::{DeckArgs, Format};
use crate::program::commands::picture::picture_of;
use crate::program::exit::{DONE, FAILED, INTERRUPTED, USAGE};
use crate::program::interrupt::stop_on_interrupt;
use crate::program::machines::Machines;
use crate::program::screen::log::{self, LogFile};
use crate::program::screen::print::print;
use crate::program::screen::progress::View;
use crate::solver::SolveError;
use crate::timing::{Phase, Timings};
use clap::Args;

/// Arguments of `mpm run`.
#[derive(Args)]
pub struct RunArgs {
    #[command(flatten)]
    deck: DeckArgs,
    /// Results directory [default: results/<deck name>].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Resume from the last checkpoint in the results directory.
    #[arg(long)]
    resume: bool,
    /// Number of threads [default: all cores, or 1 on several ranks]. The results are the same for any number.
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Write a log of iterations, warnings and timings to a file.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// PETSc options, such as "-ksp_view"; PETSc then also solves the equations of a single rank.
    #[arg(long, value_name = "OPTIONS", allow_hyphen_values = true)]
    petsc: Option<String>,
    /// Print the time spent in each phase of the run.
    #[arg(long)]
    timings: bool,
    /// At the end, draw the results into DIR/picture.png, as `mpm picture` does.
    #[arg(long)]
    picture: bool,
}

/// Runs a deck; `command_line` is the command line of the program, and `began` the time at which it started.
pub fn run(args: RunArgs, command_line: &[OsString], began: Instant) -> anyhow::Result<u8> {
    let machines = Machines::start(args.petsc.as_deref())?;
    let alone = machines.ranks().is_alone();
    // Ranks share the cores of a machine, so by default each has one thread.
    let started = analysis::start_threads(args.threads.or((!alone).then_some(1)));
    let directory = args.out.clone().unwrap_or_else(|| default_directory(&args.deck.deck));
    let outcome = started.and_then(|()| {
        if machines.ranks().is_root() {
            run_as_root(args, &machines, &directory, command_line, began)
        } else {
            analysis::run_along(&args.deck, &machines, &directory, args.resume)
        }
    });
    machines.withdraw();
    outcome
}

/// Runs a deck and writes its results, on rank 0.
fn run_as_root(
    args: RunArgs,
    machines: &Machines,
    directory: &Path,
    command_line: &[OsString],
    began: Instant,
) -> anyhow::Result<u8> {
    if let Some(log) = &args.log {
        log::keep_out_of_results(log, directory)?;
    }
    let log = args.log.as_deref().map(|path| LogFile::create(path, began, args.resume)).transpose()?;
    // A write error of the log is reported by the progress display.
    let log_text = |text: &str| {
        let _ = log.as_ref().map(|log| log.line(text));
    };
    log_text(&heading(&args.deck, command_line, machines.ranks().count()));
    let mut timings = Timings::default();
    let prepared = timings.measure(Phase::SetUp, || prepare_and_report(&args.deck, &log_text, machines));
    let Some(ready) = prepared? else {
        return Ok(USAGE);
    };
    let stop = stop_on_interrupt(true)?;
    let view = View::Run { log: log.clone() };
    let start = Start::at(began);
    let begin = if args.resume { Begin::AtCheckpoint } else { Begin::Anew };
    let run = Run { directory, start, view, stop: &stop, begin, machines };
    let ended = run_into(run, ready, timings.clone())?;
    let Some(Ended { outcome, closing }) = ended else {
        return Ok(DONE);
    };
    let mut is_shown = true;
    if let Some(closing) = closing {
        let table = closing.table(began.elapsed().as_secs_f64());
        log_text(&table);
        match args.deck.format {
            Format::Text => {
                if let Err(error) = print(&table) {
                    is_shown = false;
                    message!(
                        "error: the table of results cannot be written to standard output: {error:#}\n  the results are \
                         in {}",
                        directory.display()
                    );
                }
            }
            // Standard output is reserved for the JSON document.
            Format::Json => message!("{}", table.trim_end()),
        }
    }
    let (text, code) = match &outcome {
        Ok(reached) => {
            timings.add(&reached.summary.timings);
            let table = timings_table(&timings);
            log_text(&table);
            (if args.timings { table } else { String::new() }, 0)
        }
        Err(error) => conclude(error, directory),
    };
    if !text.is_empty() {
        message!("{text}");
    }
    if outcome.is_err() {
        log_text(&text);
    }
    if args.picture {
        picture_of(directory);
    }
    Ok(if is_shown { code } else { code.max(FAILED) })
}

/// The first lines of a log.
fn heading(deck: &DeckArgs, command_line: &[OsString], ranks: usize) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let now = jiff::Timestamp::now();
    let ranks = if ranks > 1 { format!("ranks: {ranks}, ") } else { String::new() };
    // File names need not be UTF-8.
    let command: Vec<String> = command_line.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    format!(
        "mpm {version}, {now:.0}\n{}\ndeck: {}, {ranks}threads: {}",
        command.join(" "),
        deck.deck.display(),
        rayon::current_num_threads()
    )
}

/// Message about a run that ended early, and the exit code.
fn conclude(error: &SolveError, directory: &Path) -> (String, u8) {
    let directory = directory.display();
    if let SolveError::Interrupted { step } = error {
        let text = match step {
            0 | 1 => {
                "interrupted before the first step was in equilibrium: there is nothing to resume".to_owned()
            }
            _ => format!(
                "interrupted: all steps before step {step} are in equilibrium and written to {directory}; the same \
                 command with `--resume` continues from there"
            ),
        };
        return (text, INTERRUPTED);
    }
    let text =
        format!("{}\n  results up to the last equilibrated step are in {directory}", describe_failure(error));
    (text, FAILED)
}

fn default_directory(deck: &Path) -> PathBuf {
    Path::new("results").join(deck.file_stem().unwrap_or_default())
}

/// Table of the time spent in each phase, like Table 5 of the paper, without a trailing line break.
fn timings_table(timings: &Timings) -> String {
    let total: f64 = Phase::ALL.iter().map(|&phase| timings.spent(phase).wall.as_secs_f64()).sum();
    let mut text = format!("{:<10} {:>10} {:>10} {:>7}", "phase", "wall [s]", "CPU [s]", "share");
    for phase in Phase::ALL {
        let spent = timings.spent(phase);
        let wall = spent.wall.as_secs_f64();
        text.push_str(&format!(
            "\n{:<10} {:>10.3} {:>10.3} {:>6.1}%",
            phase.name(),
            wall,
            spent.cpu.as_secs_f64(),
            100.0 * wall / total.max(f64::MIN_POSITIVE)
        ));
    }
    text
}

/// Does everything up to the first load step and prints the size of the analysis.
pub fn check(args: &DeckArgs) -> anyhow::Result<u8> {
    analysis::start_threads(None)?;
    let Some(ready) = prepare_and_report(args, &|_| (), &Machines::alone())? else {
        return Ok(USAGE);
    };
    if args.format == Format::Json {
        return Ok(DONE);
    }
    let extent = ready.extent;
    let libraries = ready.loaded.law_libraries();
    let libraries: String = libraries.iter().map(|library| format!("  {library}\n")).collect();
    print(&format!(
        "{}: ready\n  {} in {}, {}, {}, {} in {}, about {} of memory\n{libraries}",
        ready.loaded.source.name(),
        counted(extent.points, "point", "points"),
        counted(extent.bodies, "body", "bodies"),
        counted(extent.cells, "cell", "cells"),
        counted(extent.first.active_nodes, "active node", "active nodes"),
        counted(extent.first.unknowns, "unknown", "unknowns"),
        match extent.steps {
            1 => "the only step".to_owned(),
            steps => format!("the first of {steps} steps"),
        },
        in_words(extent.memory),
    ))
}
