//! One analysis: from a deck to a model that is ready, and from there to a directory of results.

use std::io::{self, IsTerminal};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Context, bail};
use mpm::deck::build::build_with_notes;
use mpm::deck::diagnostic::render_all;
use mpm::deck::load::{LoadFailure, LoadedDeck, load};
use mpm::model::Model;
use mpm::output::results::Results;
use mpm::output::summary::{Account, Start};
use mpm::points::Points;
use mpm::solver::{self, SolveError, Summary};
use mpm::stress::PlaneStrain;
use mpm::timing::Timings;

use crate::DeckArgs;
use crate::closing::Closing;
use crate::progress::{View, Watch};

/// A deck and the model built from it.
pub struct Ready {
    /// The deck.
    pub loaded: LoadedDeck,
    /// The model.
    pub model: Model<2>,
    /// Its points.
    pub points: Points<2>,
}

/// Builds the model of a deck that was read.
pub fn prepare(loaded: Result<LoadedDeck, Box<LoadFailure>>) -> Result<Ready, Box<LoadFailure>> {
    loaded.and_then(|mut loaded| match build_with_notes(&loaded) {
        Ok((model, points, notes)) => {
            loaded.notes.extend(notes);
            Ok(Ready { loaded, model, points })
        }
        Err(mut diagnostics) => {
            diagnostics.extend(loaded.notes);
            Err(Box::new(LoadFailure { source: loaded.source, diagnostics }))
        }
    })
}

/// Reads and builds a deck; messages about it are printed, and handed to `write_down` if there are any. `None` when
/// the deck cannot be used.
pub fn prepare_aloud(args: &DeckArgs, write_down: &dyn Fn(&str)) -> Option<Ready> {
    let prepared = prepare(load(&args.deck, &args.set));
    let text = messages(&prepared, io::stderr().is_terminal());
    if !text.is_empty() {
        tell!("{text}");
        write_down(&messages(&prepared, false));
    }
    if prepared.is_err() && io::stderr().is_terminal() {
        tell!("`mpm explain CODE` says more about a message");
    }
    prepared.ok()
}

/// All messages about a deck, without the last line break; empty where there is nothing to say.
pub fn messages(prepared: &Result<Ready, Box<LoadFailure>>, colour: bool) -> String {
    let text = match prepared {
        Ok(Ready { loaded, .. }) => render_all(&loaded.source, &loaded.notes, colour),
        Err(failure) => failure.render(colour),
    };
    text.trim_end().to_owned()
}

/// How an analysis ended.
pub struct Ended {
    /// The account of the run, or why it ended early.
    pub outcome: Result<Summary, SolveError>,
    /// What there is to say at the end; `None` where no step is in equilibrium.
    pub closing: Option<Closing>,
}

/// Runs an analysis into a directory; `set_up` is the time that went into making it ready.
///
/// # Errors
/// When the directory cannot be written, or another run writes there.
pub fn run_into(
    directory: &Path,
    ready: Ready,
    start: Start,
    set_up: Timings,
    view: View,
    stop: &Arc<AtomicBool>,
) -> anyhow::Result<Ended> {
    let Ready { loaded, model, mut points } = ready;
    let every = loaded.deck.output.every as usize;
    let account = Account {
        start,
        deck_hash: loaded.hash(),
        parameters: loaded.parameters,
        set_up,
        threads: rayon::current_num_threads(),
    };
    let results = Results::create(directory, every, &model, account)
        .with_context(|| format!("the results directory `{}` cannot be written", directory.display()))?;
    let mut watch = Watch::new(results, &model, &points, start, view, Arc::clone(stop));
    let outcome = solver::run::<2, PlaneStrain>(&model, &mut points, &mut watch);
    Ok(Ended { outcome, closing: watch.end() })
}

/// Why an analysis failed, in a few lines.
pub fn describe_failure(error: &SolveError) -> String {
    let code = error.code().map(|code| format!("[{code}]")).unwrap_or_default();
    let mut text = format!("error{code}: {error}");
    if !error.residuals().is_empty() {
        let history: Vec<String> = error.residuals().iter().map(|r| format!("{r:.3e}")).collect();
        text.push_str(&format!("\n  residuals: {}", history.join(", ")));
    }
    if let Some(help) = error.help() {
        text.push_str(&format!("\n  help: {help}"));
    }
    text
}

/// Most threads that can be asked for.
const MOST_THREADS: usize = 1024;

/// Starts the threads, as many as there are cores if no number is given.
pub fn start_threads(threads: Option<usize>) -> anyhow::Result<()> {
    if threads.is_some_and(|n| !(1..=MOST_THREADS).contains(&n)) {
        bail!("--threads takes a number from 1 to {MOST_THREADS}");
    }
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build_global()
        .context("the threads cannot be started")
}
