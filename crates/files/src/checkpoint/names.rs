//! Names of checkpoint files.

use std::io;
use std::path::{Path, PathBuf};

/// File name of a checkpoint.
pub(super) fn file_name(step: usize) -> String {
    format!("checkpoint_{step:04}.mpm")
}

/// File name of the piece of a checkpoint that a rank writes.
pub(super) fn piece_name(step: usize, rank: usize) -> String {
    format!("checkpoint_{step:04}_r{rank}.mpm")
}

/// The step of a checkpoint, from the name of its file or of one of its pieces; `None` for other files.
pub fn step_of(name: &str) -> Option<usize> {
    step_and_rank(name).map(|(step, _)| step)
}

/// The step of a checkpoint, and the rank that wrote it if it is a piece.
fn step_and_rank(name: &str) -> Option<(usize, Option<usize>)> {
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let rest = name.strip_prefix("checkpoint_")?.strip_suffix(".mpm")?;
    let (number, rank) = match rest.split_once("_r") {
        Some((number, rank)) => (number, Some(rank)),
        None => (rest, None),
    };
    if number.len() < 4 || !is_number(number) || !rank.is_none_or(is_number) {
        return None;
    }
    Some((number.parse().ok()?, rank.map(str::parse).transpose().ok()?))
}

/// The files of checkpoints and of their pieces in a directory, found by name: step, rank of a piece, and path.
pub(super) fn all(directory: &Path) -> io::Result<Vec<(usize, Option<usize>, PathBuf)>> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let named = path.file_name().and_then(|name| name.to_str()).and_then(step_and_rank);
        // Anything else with such a name, for example a directory, was not written by a run.
        found.extend(named.filter(|_| path.is_file()).map(|(step, rank)| (step, rank, path)));
    }
    Ok(found)
}

/// The pieces of checkpoints before a step.
pub(super) fn pieces_before(directory: &Path, step: usize) -> io::Result<Vec<PathBuf>> {
    let is_before = |(number, rank, path): (usize, Option<usize>, PathBuf)| {
        (number < step && rank.is_some()).then_some(path)
    };
    Ok(all(directory)?.into_iter().filter_map(is_before).collect())
}
