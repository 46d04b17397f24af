//! `mpm run --resume`: finds the checkpoint to resume from and checks that the deck still allows it.

use std::io::ErrorKind;
use std::path::Path;

use crate::deck::Deck;
use crate::deck::changes::{changes, is_end, step_at};
use crate::deck::load::LoadedDeck;
use crate::deck::ready::Analysis;
use crate::output::checkpoint::{Checkpoint, latest};
use crate::output::results::{Request, Results};
use crate::output::{directory, status};
use crate::program::machines::Machines;
use crate::ranks::Ranks;
use crate::solver::{Pace, Reached, Step, resume_stage};
use crate::study::Record;
use anyhow::{Context, bail};

/// Remedy if a run cannot be resumed.
pub const AGAIN: &str = "run the deck without `--resume` to start over, which replaces the results";

/// State of the run to resume.
pub enum Found {
    /// A checkpoint from which the points were restored, and the step that it reached, numbered as in this deck.
    Step(Box<Checkpoint>, Box<Reached>),
    /// A completed run with all its results, after this number of steps.
    End(usize),
}

/// Finds the last usable checkpoint in a directory and restores the points from it. All ranks must call it together.
///
/// # Errors
/// If there is none, if a part of the deck on which the steps so far depend has changed, if the checkpoint was written
/// after the end of the analysis, or if another rank has ended.
pub fn find(
    directory: &Path,
    loaded: &LoadedDeck,
    analysis: &mut Analysis,
    machines: &Machines,
) -> anyhow::Result<Found> {
    if let Some(rank) = machines.meet(true) {
        bail!("rank {rank} has ended; see its own message");
    }
    let (found, refused) = match latest(directory, machines.ranks()) {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return complete_without_checkpoint(directory, loaded, analysis, machines.ranks());
        }
        found => found.with_context(|| format!("the directory `{}` cannot be read", directory.display()))?,
    };
    for refused in refused.iter().filter(|_| machines.ranks().is_root()) {
        message!("warning: {refused}");
    }
    let Some(checkpoint) = found else {
        bail!("no checkpoint in `{}` can be used\n  help: {AGAIN}", directory.display());
    };
    let name = checkpoint.path.display();
    let Step { index, end, .. } = checkpoint.step();
    let checkpoint_deck = match Deck::from_value(&checkpoint.head.deck) {
        Ok(deck) => deck,
        Err(error) => bail!("the checkpoint `{name}` cannot be used: {error}\n  help: {AGAIN}"),
    };
    let mut changed = changes(&checkpoint_deck, &loaded.deck, end);
    if checkpoint.head.files != loaded.hash_of_files() {
        changed.push("a mesh, surface or library that it names has changed".to_owned());
    }
    // The files may have changed on the machine of only one rank.
    let changed = machines.ranks().first((!changed.is_empty()).then_some(changed)).unwrap_or_default();
    if !changed.is_empty() {
        bail!(
            "the deck differs from that of the checkpoint `{name}`:\n  {}\n  help: undo the changes, or {AGAIN}; \
             steps, tolerances, output and later loads are allowed to change",
            changed.join("\n  ")
        );
    }
    let Some(step) = step_at([&checkpoint_deck, &loaded.deck], end, index) else {
        bail!(
            "`{name}` was written at time {end}, after the end of the analysis at {}\n  help: increase `steps: \
             {{end_time}}`",
            loaded.deck.end_time()
        );
    };
    let is_complete = machines.ranks().first(Some(status::is_complete(directory)));
    if is_end(&loaded.deck, end) && is_complete == Some(true) {
        let reached = &checkpoint.head.reached;
        close(directory, analysis, &loaded.deck.request(), Some(reached), machines.ranks())?;
        return Ok(Found::End(reached.summary.steps));
    }
    let staged = match analysis {
        Analysis::Plane(parts) => resume_stage(&mut parts.0, &mut parts.1, &checkpoint.head.reached),
        Analysis::Solid(parts) => resume_stage(&mut parts.0, &mut parts.1, &checkpoint.head.reached),
    };
    if let Some(reason) = machines.ranks().first(staged.err()) {
        bail!("the checkpoint `{name}` cannot be used: {reason}\n  help: {AGAIN}");
    }
    let restored = match analysis {
        Analysis::Plane(parts) => checkpoint.restore(&parts.0, &mut parts.1),
        Analysis::Solid(parts) => checkpoint.restore(&parts.0, &mut parts.1),
    };
    if let Err(reason) = restored {
        bail!("the checkpoint `{name}` cannot be used: {reason}\n  help: {AGAIN}");
    }
    let mut reached = checkpoint.head.reached.clone();
    reached.progress.step.index = step;
    reached.summary.diagnosis = None;
    if checkpoint_deck.courses() != loaded.deck.courses() {
        reached.progress.pace = Pace::default();
    }
    Ok(Found::Step(Box::new(checkpoint), Box::new(reached)))
}

/// A complete run of this deck that has left no checkpoint. All ranks must call it together.
///
/// # Errors
/// If there is none.
fn complete_without_checkpoint(
    directory: &Path,
    loaded: &LoadedDeck,
    analysis: &Analysis,
    ranks: &Ranks,
) -> anyhow::Result<Found> {
    let record = if ranks.is_root() { Record::read(directory).ok() } else { None };
    let steps = record.filter(|record| record.completes(loaded)).map(|record| record.steps());
    let Some(steps) = ranks.first(steps) else {
        bail!("there is no checkpoint in `{}` to resume from\n  help: {AGAIN}", directory.display())
    };
    close(directory, analysis, &loaded.deck.request(), None, ranks)?;
    Ok(Found::End(steps))
}

/// Checks the tables of a complete run with the columns of what was `asked`, up to `reached` if it is given, and removes the remains of a run killed after
/// it had written its summary. All ranks must call it together.
fn close(
    directory: &Path,
    analysis: &Analysis,
    asked: &Request,
    reached: Option<&Reached>,
    ranks: &Ranks,
) -> anyhow::Result<()> {
    let checked = match analysis {
        _ if !ranks.is_root() => Ok(()),
        Analysis::Plane(parts) => Results::check_tables(directory, &parts.0, asked, reached),
        Analysis::Solid(parts) => Results::check_tables(directory, &parts.0, asked, reached),
    };
    if let Some(reason) = ranks.first(checked.err().map(|error| error.to_string())) {
        bail!("{}", unusable(ErrorKind::InvalidData, &reason));
    }
    if ranks.is_root() {
        directory::tidy(directory).with_context(|| format!("`{}` cannot be written", directory.display()))?;
    }
    Ok(())
}

/// Text about results that cannot be used, with the remedy.
pub fn unusable(kind: ErrorKind, reason: &str) -> String {
    let what = format!("the results of the steps up to the checkpoint cannot be used: {reason}");
    match kind {
        // A run that starts over would not replace the file either.
        ErrorKind::AlreadyExists => format!("{what}\n  help: restore the file, or move it away"),
        _ => format!("{what}\n  help: restore the file, or {AGAIN}"),
    }
}
