//! What is whose in a directory of results: the names of its files, and which of them a run may remove.

use std::io;
use std::path::Path;

use super::replace::TEMPORARY;
use super::{checkpoint, failed, status};

/// Names of the series.
pub(super) const SERIES: [&str; 3] = ["points", "domains", "grid"];

/// The file of a series that shows a step.
pub(super) fn file_name(series: &str, step: usize) -> String {
    format!("{series}_{step:04}.vtu")
}

/// The number in the name of a file that [`file_name`] has made.
pub(super) fn step_of_file(name: &str) -> Option<usize> {
    name.strip_suffix(".vtu")?.rsplit_once('_')?.1.parse().ok()
}

/// Removes the series, summary, status and checkpoints that an earlier run left in the directory, so that none of its
/// files are mistaken for ours.
pub(super) fn remove_earlier_results(directory: &Path) -> io::Result<()> {
    remove(directory, |name| {
        is_of_series(name)
            || OF_RUN.contains(&name)
            || failed::FILES.contains(&name)
            || checkpoint::step_of(name).is_some()
    })
}

/// Removes what a run has written after a step, and what it wrote because it ended there.
pub(super) fn remove_later_results(
    directory: &Path,
    last: usize,
    is_kept: impl Fn(&str) -> bool,
) -> io::Result<()> {
    remove(directory, |name| {
        let is_later = is_of_series(name) && name.ends_with(".vtu") && !is_kept(name);
        let of_end = OF_RUN.contains(&name) || failed::FILES.contains(&name);
        is_later || of_end || checkpoint::step_of(name).is_some_and(|step| step > last)
    })
}

/// Removes what a run that was killed has not renamed.
///
/// # Errors
/// Those of the file system.
pub fn tidy(directory: &Path) -> io::Result<()> {
    remove(directory, |_| false)
}

/// Removes files by their names, and with them what a run that was killed has not renamed to such a name.
fn remove(directory: &Path, is_old: impl Fn(&str) -> bool) -> io::Result<()> {
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        let half = name.strip_suffix(TEMPORARY);
        let is_half = half.is_some_and(|name| {
            is_of_series(name)
                || OF_RUN.contains(&name)
                || failed::FILES.contains(&name)
                || TABLES.contains(&name)
                || checkpoint::step_of(name).is_some()
        });
        // A directory of such a name is not ours.
        if (is_old(name) || is_half) && path.is_file() {
            std::fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// The tables of a run.
const TABLES: [&str; 3] = ["history.csv", "convergence.csv", "quality.csv"];

/// Files that tell of a run as a whole.
const OF_RUN: [&str; 3] = ["summary.json", "run.json", status::NAME];

/// Whether a file with this name belongs to a series.
fn is_of_series(name: &str) -> bool {
    SERIES.iter().any(|series| {
        let Some(rest) = name.strip_prefix(series) else { return false };
        let number = rest.strip_prefix('_').and_then(|r| r.strip_suffix(".vtu"));
        rest == ".pvd" || number.is_some_and(|n| n.len() >= 4 && n.bytes().all(|b| b.is_ascii_digit()))
    })
}

/// A file that a run would replace although no run has written it.
pub(super) fn foreign_file(directory: &Path) -> io::Result<Option<String>> {
    if OF_RUN.iter().any(|name| directory.join(name).exists()) {
        return Ok(None);
    }
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        // A run that was killed at its very beginning leaves a table behind.
        let is_table = || std::fs::read(&path).is_ok_and(|bytes| bytes.starts_with(b"step,"));
        let ours = TABLES.contains(&name);
        if is_of_series(name) || ours && !is_table() {
            return Ok(Some(name.to_owned()));
        }
    }
    Ok(None)
}
