//! `mpm run --resume`: from which checkpoint a run goes on, and whether it may.

use std::io::ErrorKind;
use std::path::Path;

use anyhow::{Context, bail};
use mpm::deck::changes::{changes, step_at};
use mpm::deck::load::LoadedDeck;
use mpm::deck::ready::Analysis;
use mpm::output::checkpoint::{Checkpoint, latest};
use mpm::solver::{Reached, Step};

/// The last checkpoint in a directory that can be used, in whose state the points are then, and the step it belongs to
/// with its number in this deck.
///
/// # Errors
/// When there is none, or the deck has changed in what the steps so far depend on.
pub fn find(
    directory: &Path,
    loaded: &LoadedDeck,
    analysis: &mut Analysis,
) -> anyhow::Result<(Checkpoint, Reached)> {
    let again = "run the deck without `--resume` to begin anew, which replaces the results";
    let (found, refused) = match latest(directory) {
        Err(error) if error.kind() == ErrorKind::NotFound => {
            bail!("there is no checkpoint in `{}` to go on from\n  help: {again}", directory.display())
        }
        found => found.with_context(|| format!("the directory `{}` cannot be read", directory.display()))?,
    };
    for refused in &refused {
        tell!("warning: {refused}");
    }
    let Some(checkpoint) = found else {
        bail!("no checkpoint in `{}` can be used\n  help: {again}", directory.display());
    };
    let name = checkpoint.path.display();
    let Step { index, end, .. } = checkpoint.step();
    let mut changed = changes(&checkpoint.head.deck, &loaded.deck, end);
    if checkpoint.head.files != loaded.hash_of_files() {
        changed.push("a mesh or surface that it names has changed".to_owned());
    }
    if !changed.is_empty() {
        bail!(
            "the deck is not the one that `{name}` belongs to:\n  {}\n  help: undo that, or {again}; steps, tolerances, \
             output and later loads may change",
            changed.join("\n  ")
        );
    }
    let Some(step) = step_at(&loaded.deck, end, index) else {
        bail!(
            "`{name}` was written at time {end}, after step {index}: with {} load steps up to time {}, no step ends there \
             that is not an earlier one\n  help: use a number of steps, a multiple of the old one for example, with which \
             one does",
            loaded.deck.steps.count,
            loaded.deck.steps.end_time
        );
    };
    let restored = match analysis {
        Analysis::Plane(parts) => checkpoint.restore(&mut parts.1),
        Analysis::Solid(parts) => checkpoint.restore(&mut parts.1),
    };
    if let Err(reason) = restored {
        bail!("the checkpoint `{name}` cannot be used: {reason}\n  help: {again}");
    }
    let mut reached = checkpoint.head.reached.clone();
    reached.step.index = step;
    Ok((checkpoint, reached))
}
