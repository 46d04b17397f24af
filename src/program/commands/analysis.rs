//! One analysis: from a deck to a model ready to run, and from there to a results directory.

use std::io::{self, IsTerminal, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::deck::advice;
use crate::deck::diagnostic::{self, Diagnostic, as_json, render_all};
use crate::deck::load::{LoadFailure, LoadedDeck};
use crate::deck::quoting::counted;
use crate::deck::ready::{self, Analysis, Prepared};
use crate::deck::source::Source;
use crate::memory::Memory;
use crate::output::checkpoint::last_step;
use crate::output::lock::Lock;
use crate::output::results::{Restart, Results};
use crate::output::summary::Start;
use crate::ranks::Ranks;
use crate::solver::{Reached, SolveError};
use crate::timing::Timings;
use anyhow::{anyhow, bail};
use serde_json::{Value, json};

use crate::program::commands::arguments::{DeckArgs, Format};
use crate::program::commands::resume::{self, Found};
use crate::program::exit::{DONE, FAILED, INTERRUPTED, USAGE};
use crate::program::interrupt::stop_on_interrupt;
use crate::program::machines::Machines;
use crate::program::screen::closing::Closing;
use crate::program::screen::failure::{Coded, in_words};
use crate::program::screen::message::clean;
use crate::program::screen::print::print_json;
use crate::program::screen::progress::{View, Watch};
use crate::program::system_limits::wait_for_abort;

/// Builds the model of a deck, or this rank's part of it, up to the first load step.
pub fn prepare(
    loaded: Result<LoadedDeck, Box<LoadFailure>>,
    deny_warnings: bool,
    ranks: &Ranks,
) -> Result<Prepared, Box<LoadFailure>> {
    // On a worker thread, like the analysis itself.
    rayon::scope(|_| ready::prepare_on(ranks, loaded?, Memory::this_machine(), deny_warnings))
}

/// The source of a deck and the messages about it.
fn findings(prepared: &Result<Prepared, Box<LoadFailure>>) -> (&Source, &[Diagnostic]) {
    match prepared {
        Ok(Prepared { loaded, .. }) => (&loaded.source, &loaded.notes),
        Err(failure) => (&failure.source, &failure.diagnostics),
    }
}

/// Reads and builds a deck; prints the messages about it and passes them to `log_text`. `None` if the deck cannot be
/// used.
///
/// # Errors
/// If this rank can read the deck but another cannot, if the ranks have read different decks, or if the messages cannot
/// be printed.
pub fn prepare_and_report(
    args: &DeckArgs,
    log_text: &dyn Fn(&str),
    machines: &Machines,
) -> anyhow::Result<Option<Prepared>> {
    let loaded = args.load();
    match (machines.meet(loaded.is_ok()), &loaded) {
        (Some(rank), Ok(_)) => bail!("rank {rank} cannot read the deck; see its own message"),
        (None, Ok(loaded)) if !machines.have_the_same(loaded) => bail!(
            "the deck, or a file that it names, is not the same on all ranks\n  help: let all ranks read it from a directory that \
             their machines share"
        ),
        _ => {}
    }
    let prepared = prepare(loaded, args.deny_warnings, machines.ranks());
    let plain = messages(&prepared, false);
    if !plain.is_empty() {
        log_text(&plain);
    }
    match args.format {
        Format::Json => {
            print_json(&as_document(&prepared))?;
        }
        Format::Text if !plain.is_empty() => {
            print_messages(&prepared);
            if prepared.is_err() && io::stderr().is_terminal() {
                message!("`mpm explain CODE` explains a message");
            }
        }
        Format::Text => {}
    }
    Ok(prepared.ok())
}

/// Writes messages about a deck to standard error, in colour on a terminal.
pub fn print_messages(prepared: &Result<Prepared, Box<LoadFailure>>) {
    let plain = messages(prepared, false);
    // Colours need escape sequences, which are allowed only if the text itself contains none.
    if io::stderr().is_terminal() && clean(&plain) == plain {
        let _ = writeln!(io::stderr(), "{}", messages(prepared, true));
    } else {
        message!("{plain}");
    }
}

/// All messages about a deck, without the last line break; empty if there are none.
pub fn messages(prepared: &Result<Prepared, Box<LoadFailure>>, colour: bool) -> String {
    let (source, diagnostics) = findings(prepared);
    let text = render_all(source, diagnostics, colour);
    match diagnostic::count(diagnostics) {
        count if count.is_empty() => text.trim_end().to_owned(),
        count => format!("{text}\n{}: {count}", source.name()),
    }
}

/// Reports the messages about a deck that cannot be used; returns the exit code.
///
/// # Errors
/// If the messages are to be printed as JSON and cannot be; a closed pipe is no error.
pub fn refuse(failure: Box<LoadFailure>, format: Format) -> anyhow::Result<u8> {
    let refused = Err(failure);
    match format {
        Format::Json => {
            print_json(&as_document(&refused))?;
        }
        Format::Text => print_messages(&refused),
    }
    Ok(USAGE)
}

/// All messages about a deck as JSON, with the size of the analysis if it can be run.
fn as_document(prepared: &Result<Prepared, Box<LoadFailure>>) -> Value {
    let (source, diagnostics) = findings(prepared);
    let mut report = as_json(source, diagnostics);
    report["size"] = prepared.as_ref().map_or(Value::Null, |Prepared { extent, .. }| {
        json!({
            "bodies": extent.bodies,
            "points": extent.points,
            "cells": extent.cells,
            "active_nodes": extent.first.active_nodes,
            "unknowns": extent.first.unknowns,
            "steps": extent.steps,
            "memory_bytes": extent.memory.round(),
        })
    });
    report
}

/// Outcome of an analysis.
pub struct Ended {
    /// What the run has reached, or the error that ended it.
    pub outcome: Result<Reached, SolveError>,
    /// The closing table; `None` if no step is in equilibrium.
    pub closing: Option<Closing>,
}

/// State in which a run starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Begin {
    /// The undeformed state; earlier results are replaced.
    Anew,
    /// The last checkpoint in the directory.
    AtCheckpoint,
    /// The last checkpoint if the run can be resumed from it, otherwise the undeformed state.
    AtCheckpointIfAny,
}

/// Where and how an analysis runs.
pub struct Run<'a> {
    /// The results directory.
    pub directory: &'a Path,
    /// Origin of the times of the run.
    pub start: Start,
    /// Amount of output.
    pub view: View,
    /// Flag that ends the run when set.
    pub stop: &'a Arc<AtomicBool>,
    /// The state in which the run starts.
    pub begin: Begin,
    /// The ranks that share the run.
    pub machines: &'a Machines,
}

/// Runs an analysis and writes its results to a directory; `set_up` is the time already spent on setting it up. `None`
/// under [`Begin::AtCheckpoint`] if the run in the directory is already complete.
///
/// # Errors
/// If the directory cannot be written, another run writes there, the run cannot be resumed, or another rank has an
/// error.
pub fn run_into(run: Run, ready: Prepared, set_up: Timings) -> anyhow::Result<Option<Ended>> {
    let Run { directory, start, view, stop, begin, machines } = run;
    let Prepared { loaded, mut analysis, extent } = ready;
    let from = match begin {
        Begin::Anew => None,
        Begin::AtCheckpoint | Begin::AtCheckpointIfAny => {
            match checkpoint_in(directory, &loaded, &mut analysis, machines, begin)? {
                Some((_, Found::End(steps))) => {
                    message!(
                        "the run in `{}` is complete: {} in equilibrium; nothing is left to do",
                        directory.display(),
                        counted(steps, "step", "steps")
                    );
                    return Ok(None);
                }
                Some((lock, Found::Step(checkpoint, reached))) => Some((lock, checkpoint, reached)),
                None => None,
            }
        }
    };
    let asked = loaded.deck.request();
    let account = loaded.account(start, set_up, rayon::current_num_threads())?;
    let law_libraries = account.law_libraries.clone();
    let wording = Arc::clone(&account.wording);
    let (results, from) = match from {
        None => {
            let created = match &analysis {
                Analysis::Plane(parts) => Results::create(directory, &asked, &parts.0, account),
                Analysis::Solid(parts) => Results::create(directory, &asked, &parts.0, account),
            };
            (created.map_err(|error| not_writable(directory, error))?, None)
        }
        Some((lock, checkpoint, reached)) => {
            let step = reached.progress.step;
            let reopened = match &analysis {
                Analysis::Plane(parts) => {
                    Results::resume(directory, lock, &asked, &parts.0, account, &checkpoint, step)
                }
                Analysis::Solid(parts) => {
                    Results::resume(directory, lock, &asked, &parts.0, account, &checkpoint, step)
                }
            };
            let results = reopened
                .map_err(|error| Coded::new("R002", resume::unusable(error.kind(), &error.to_string())))?;
            (results, Some((checkpoint, reached)))
        }
    };
    if let View::Run { log: Some(log) } = &view {
        // A write error of the log is reported by the progress display.
        let _ = log.begin();
    }
    let stop = Arc::clone(stop);
    // The points of a resumed run may differ from those of the first stage.
    let n = if machines.ranks().is_alone() { analysis.n_points() } else { extent.points };
    let mut watch = match &analysis {
        Analysis::Plane(parts) => Watch::new(results, &parts.0, n, start, view, wording, stop),
        Analysis::Solid(parts) => Watch::new(results, &parts.0, n, start, view, wording, stop),
    };
    watch.law_libraries(&law_libraries);
    machines.equip(&mut analysis);
    machines.begin()?;
    let reached = match from {
        Some((checkpoint, reached)) => {
            watch.resumed(&checkpoint, &reached);
            *reached
        }
        None => analysis.beginning(),
    };
    // On a worker thread, so that work need not be handed over to the pool.
    let outcome = rayon::scope(|_| analysis.run(reached, &mut watch));
    let nonassociated = loaded.deck.nonassociated_with_reduced_strength();
    let closing =
        watch.end().map(|closing| closing.with_nonassociated(&nonassociated).with_units(loaded.deck.units()));
    Ok(Some(Ended { outcome, closing }))
}

/// Takes part in a run as a rank other than 0; returns the exit code.
///
/// # Errors
/// If the run cannot be resumed, or signals cannot be handled.
pub fn run_along(
    deck: &DeckArgs,
    machines: &Machines,
    directory: &Path,
    resumes: bool,
) -> anyhow::Result<u8> {
    let loaded = deck.load();
    if let Some(rank) = machines.meet(loaded.is_ok()) {
        if rank == machines.ranks().own() {
            print_messages(&loaded.and_then(|loaded| prepare(Ok(loaded), false, &Ranks::default())));
        }
        return Ok(USAGE);
    }
    if loaded.as_ref().is_ok_and(|loaded| !machines.have_the_same(loaded)) {
        return Ok(USAGE);
    }
    let Ok(Prepared { loaded, mut analysis, .. }) = prepare(loaded, deck.deny_warnings, machines.ranks())
    else {
        return Ok(USAGE);
    };
    let reached =
        match resumes.then(|| resume::find(directory, &loaded, &mut analysis, machines)).transpose()? {
            Some(Found::End(_)) => return Ok(DONE),
            Some(Found::Step(checkpoint, reached)) => Some((checkpoint, reached)),
            None => None,
        };
    let account = loaded.account(Start::now(), Timings::default(), rayon::current_num_threads())?;
    let asked = loaded.deck.request();
    let from =
        reached.as_ref().map(|(checkpoint, reached)| Restart { checkpoint, step: reached.progress.step });
    let results = match &analysis {
        Analysis::Plane(parts) => Results::without_files(directory, &asked, &parts.0, account, from),
        Analysis::Solid(parts) => Results::without_files(directory, &asked, &parts.0, account, from),
    };
    let mut results = results.stopped_by(stop_on_interrupt(false)?);
    machines.equip(&mut analysis);
    // Rank 0 reports the reason.
    if machines.begin().is_err() {
        return Ok(USAGE);
    }
    let reached = reached.map_or_else(|| analysis.beginning(), |(_, reached)| *reached);
    Ok(match rayon::scope(|_| analysis.run(reached, &mut results)) {
        Ok(_) => DONE,
        Err(SolveError::Interrupted { .. }) => INTERRUPTED,
        Err(_) => FAILED,
    })
}

/// Locks a directory and restores the points from its last checkpoint. `None` if the run is to start over instead.
fn checkpoint_in(
    directory: &Path,
    loaded: &LoadedDeck,
    analysis: &mut Analysis,
    machines: &Machines,
    begin: Begin,
) -> anyhow::Result<Option<(Lock, Found)>> {
    let lock = match Lock::take(directory) {
        Ok(lock) => Some(lock),
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        Err(error) => return Err(not_writable(directory, error).into()),
    };
    match (resume::find(directory, loaded, analysis, machines), lock) {
        (Ok(found), Some(lock)) if begin == Begin::AtCheckpoint || matches!(found, Found::Step(..)) => {
            Ok(Some((lock, found)))
        }
        (Err(error), _) if begin == Begin::AtCheckpoint => Err(Coded::new("R002", in_words(&error)).into()),
        (Err(error), Some(_)) if last_step(directory).is_some() => {
            message!("  starting over: {}", in_words(&error));
            Ok(None)
        }
        _ => Ok(None),
    }
}

/// Error of a results directory that cannot be written.
pub fn not_writable(directory: &Path, error: io::Error) -> Coded {
    Coded::new("R001", Results::refusal(directory, &error, "`--out`"))
}

/// Number of residuals shown from the beginning of a failed step.
const FIRST_RESIDUALS: usize = 20;
/// Number of residuals shown from the end of a failed step.
const LAST_RESIDUALS: usize = 10;

/// Describes the failure of an analysis in a few lines.
pub fn describe_failure(error: &SolveError) -> String {
    let code = error.code().map(|code| format!("[{code}]")).unwrap_or_default();
    let mut text = format!("error{code}: {error}");
    if !error.residuals().is_empty() {
        let mut history: Vec<String> = error.residuals().iter().map(|r| format!("{r:.3e}")).collect();
        if history.len() > FIRST_RESIDUALS + LAST_RESIDUALS + 1 {
            history.splice(FIRST_RESIDUALS..history.len() - LAST_RESIDUALS, ["…".to_owned()]);
        }
        text.push_str(&format!("\n  residuals: {}", history.join(", ")));
    }
    // If smaller steps might have avoided the failure, its diagnosis has given advice for this particular run as well.
    let help = advice::on_error(error).map(str::to_owned);
    let diagnosed = error
        .is_retryable()
        .then(|| "the diagnosis of this run, above and in `summary.json`, says more".to_owned());
    let help: Vec<String> = [help, diagnosed].into_iter().flatten().collect();
    if !help.is_empty() {
        text.push_str(&format!("\n  help: {}", help.join("; ")));
    }
    text
}

/// Largest number of threads.
const MAX_THREADS: usize = 1024;

/// Starts the threads; by default, one per core.
pub fn start_threads(threads: Option<usize>) -> anyhow::Result<()> {
    if threads.is_some_and(|n| !(1..=MAX_THREADS).contains(&n)) {
        bail!("--threads takes a number from 1 to {MAX_THREADS}");
    }
    wait_for_abort()?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build_global()
        .map_err(|error| anyhow!("the threads cannot be started: {error}; use fewer with `--threads`"))
}
