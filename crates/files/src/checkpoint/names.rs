//! Names of the files of checkpoints.

use std::path::{Path, PathBuf};

/// The file of a checkpoint.
pub(super) fn file_name(step: usize) -> String {
    format!("checkpoint_{step:04}.mpm")
}

/// The piece of a checkpoint that a rank writes.
pub(super) fn piece_name(step: usize, rank: usize) -> String {
    format!("checkpoint_{step:04}_r{rank}.mpm")
}

/// The step of a checkpoint, from the name of its file or of a piece; `None` for other files.
pub fn step_of(name: &str) -> Option<usize> {
    step_and_rank(name).map(|(step, _)| step)
}

/// The step of a checkpoint, and the rank that wrote it if it is a piece.
pub(super) fn step_and_rank(name: &str) -> Option<(usize, Option<usize>)> {
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

/// The files of the pieces that belong to the file of a checkpoint, by their names.
pub(super) fn pieces_of(path: &Path) -> std::io::Result<Vec<PathBuf>> {
    let name = |path: &Path| path.file_name().and_then(|name| name.to_str()).and_then(step_and_rank);
    let (Some(directory), Some((step, _))) = (path.parent(), name(path)) else { return Ok(Vec::new()) };
    let mut found = Vec::new();
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        if name(&path).is_some_and(|(of, rank)| of == step && rank.is_some()) && path.is_file() {
            found.push(path);
        }
    }
    Ok(found)
}
