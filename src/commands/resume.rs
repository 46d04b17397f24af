//! `mpm run --resume`: from which checkpoint a run goes on, and whether it may.

use std::io::ErrorKind;
use std::path::Path;

use anyhow::{Context, bail};
use mpm::deck::Deck;
use mpm::deck::changes::{changes, is_end, step_at};
use mpm::deck::load::LoadedDeck;
use mpm::deck::ready::Analysis;
use mpm::output::checkpoint::{Checkpoint, latest};
use mpm::output::{directory, status};
use mpm::solver::{Pace, Reached, Step};
use serde::Deserialize;

/// What to do where a run cannot go on.
pub const AGAIN: &str = "run the deck without `--resume` to begin anew, which replaces the results";

/// Where a run stands that is to go on.
pub enum Found {
    /// At the step of a checkpoint, in whose state the points are now; with its number in this deck.
    Step(Box<Checkpoint>, Box<Reached>),
    /// At its end, with all its results: so many steps.
    End(usize),
}

/// The last checkpoint in a directory that can be used.
///
/// # Errors
/// When there is none, or the deck has changed in what the steps so far depend on.
pub fn find(directory: &Path, loaded: &LoadedDeck, analysis: &mut Analysis) -> anyhow::Result<Found> {
    let (found, refused) = match latest(directory) {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            bail!("there is no checkpoint in `{}` to go on from\n  help: {AGAIN}", directory.display())
        }
        found => found.with_context(|| format!("the directory `{}` cannot be read", directory.display()))?,
    };
    for refused in &refused {
        tell!("warning: {refused}");
    }
    let Some(checkpoint) = found else {
        bail!("no checkpoint in `{}` can be used\n  help: {AGAIN}", directory.display());
    };
    let name = checkpoint.path.display();
    let Step { index, end, .. } = checkpoint.step();
    let of_checkpoint: Deck = match Deck::deserialize(&checkpoint.head.deck) {
        Ok(deck) => deck,
        Err(error) => bail!("the checkpoint `{name}` cannot be used: {error}\n  help: {AGAIN}"),
    };
    let mut changed = changes(&of_checkpoint, &loaded.deck, end);
    if checkpoint.head.files != loaded.hash_of_files() {
        changed.push("a mesh or surface that it names has changed".to_owned());
    }
    if !changed.is_empty() {
        bail!(
            "the deck is not the one that `{name}` belongs to:\n  {}\n  help: undo that, or {AGAIN}; steps, tolerances, \
             output and later loads may change",
            changed.join("\n  ")
        );
    }
    let Some(step) = step_at(&loaded.deck, end, index) else {
        bail!(
            "`{name}` was written at time {end}, after the end of the analysis at {}\n  help: let `steps: {{end_time}}` be \
             later",
            loaded.deck.steps.end_time
        );
    };
    if is_end(&loaded.deck, end) && status::is_complete(directory) {
        // What is left by a run that was killed after it had written its summary.
        directory::tidy(directory).with_context(|| format!("`{}` cannot be written", directory.display()))?;
        return Ok(Found::End(checkpoint.head.reached.summary.steps));
    }
    let restored = match analysis {
        Analysis::Plane(parts) => checkpoint.restore(&parts.0, &mut parts.1),
        Analysis::Solid(parts) => checkpoint.restore(&parts.0, &mut parts.1),
    };
    if let Err(reason) = restored {
        bail!("the checkpoint `{name}` cannot be used: {reason}\n  help: {AGAIN}");
    }
    let mut reached = checkpoint.head.reached.clone();
    reached.step.index = step;
    reached.summary.diagnosis = None;
    if of_checkpoint.steps != loaded.deck.steps {
        reached.summary.pace = Pace::default();
    }
    Ok(Found::Step(Box::new(checkpoint), Box::new(reached)))
}
