//! Files of a results directory: their names, and which of them a run may remove.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use super::replace::TEMPORARY;
use super::{checkpoint, failed, lock, series, status, vtu};

/// Names of the series.
pub(super) const SERIES: [&str; 6] = ["points", "domains", "grid", "surfaces", "tools", "contacts"];

/// Name of the file of a series that shows a step.
pub(super) fn file_name(series: &str, step: usize) -> String {
    format!("{series}_{step:04}.vtu")
}

/// Name of the file of a series that a rank writes for a step if several ranks write.
pub(super) fn piece_name(series: &str, step: usize, rank: usize) -> String {
    format!("{series}_{step:04}_r{rank}.vtu")
}

/// Name of the file that lists the pieces of a step.
pub(super) fn list_name(series: &str, step: usize) -> String {
    format!("{series}_{step:04}.pvtu")
}

/// The step in a name made by [`file_name`], [`piece_name`] or [`list_name`].
pub(super) fn step_of_file(name: &str) -> Option<usize> {
    number_in(name)?.rsplit_once('_')?.1.parse().ok()
}

/// The part of the name of a series file up to and including the step number.
fn number_in(name: &str) -> Option<&str> {
    if let Some(list) = name.strip_suffix(".pvtu") {
        return Some(list);
    }
    let stem = name.strip_suffix(".vtu")?;
    let piece = stem.rsplit_once("_r").filter(|(_, rank)| is_number(rank));
    Some(piece.map_or(stem, |(stem, _)| stem))
}

fn is_number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())
}

/// Removes all result files of an earlier run except its tables, so that they are not mistaken for files of this run.
pub(super) fn remove_earlier_results(directory: &Path) -> io::Result<()> {
    remove(directory, |name| !matches!(Kind::from_name(name), None | Some(Kind::Table(_))))
}

/// Removes what a run wrote after step `last`: the files of series that `is_kept` rejects, later checkpoints, the files
/// of a failed step, and the files about the run as a whole, which are written again.
pub(super) fn remove_later_results(
    directory: &Path,
    last: usize,
    is_kept: impl Fn(&str) -> bool,
) -> io::Result<()> {
    remove(directory, |name| {
        let is_later = series_of(name).is_some() && !name.ends_with(".pvd") && !is_kept(name);
        let concerns_end = matches!(Kind::from_name(name), Some(Kind::AboutRun(_))) || failed::is_name(name);
        is_later || concerns_end || checkpoint::step_of(name).is_some_and(|step| step > last)
    })
}

/// Removes temporary files of a run that was killed.
///
/// # Errors
/// A file-system error.
pub fn tidy(directory: &Path) -> io::Result<()> {
    remove(directory, |_| false)
}

/// Removes the result files selected by name, and all temporary files of results.
fn remove(directory: &Path, is_old: impl Fn(&str) -> bool) -> io::Result<()> {
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        let is_half = name.strip_suffix(TEMPORARY).is_some_and(|name| Kind::from_name(name).is_some());
        // A directory of this name, or a file that no run wrote, stays.
        if (is_old(name) || is_half) && is_ours(&path, name) {
            std::fs::remove_file(&path)?;
        }
    }
    Ok(())
}

/// The tables of a run, and their first bytes.
const TABLES: [(&str, &str); 3] = [
    ("history.csv", "step,time,iterations,residual,"),
    ("convergence.csv", "step,iteration,residual"),
    ("quality.csv", "step,partition_of_unity_loss,"),
];

/// Files about a run as a whole, with keys that identify them; the first key comes first in the file.
const ABOUT_RUN: [(&str, [&str; 3]); 3] = [
    ("summary.json", ["outcome", "deck_hash", "version"]),
    ("run.json", ["title", "deck_hash", "version"]),
    (status::NAME, ["state", "steps_requested", "process"]),
];

/// The page that a report is written to.
const REPORT: &str = "report.html";

/// Kind of a file, from its name.
enum Kind {
    Mesh,
    Pieces,
    Series(&'static str),
    Table(&'static str),
    AboutRun([&'static str; 3]),
    Checkpoint,
}

impl Kind {
    fn from_name(name: &str) -> Option<Kind> {
        if let Some(series) = series_of(name) {
            return Some(if name.ends_with(".pvd") { Kind::Series(series) } else { Kind::mesh(name) });
        }
        if failed::is_name(name) {
            return Some(Kind::mesh(name));
        }
        if checkpoint::step_of(name).is_some() {
            return Some(Kind::Checkpoint);
        }
        let table = TABLES.iter().find(|(table, _)| *table == name).map(|(_, begin)| Kind::Table(begin));
        table.or_else(|| {
            ABOUT_RUN.iter().find(|(file, _)| *file == name).map(|(_, keys)| Kind::AboutRun(*keys))
        })
    }

    fn mesh(name: &str) -> Kind {
        if name.ends_with(".pvtu") { Kind::Pieces } else { Kind::Mesh }
    }

    /// True if a file that begins with this text is one that a run wrote; `whole` is false for a temporary file, which
    /// may be incomplete.
    fn fits(&self, begin: &str, whole: bool) -> bool {
        match self {
            Kind::Mesh => begin.starts_with(vtu::HEAD),
            Kind::Pieces => begin.starts_with(vtu::HEAD_OF_PIECES),
            Kind::Series(series) => {
                let rest = begin.strip_prefix(series::HEAD);
                let first = format!("file=\"{series}_");
                rest.is_some_and(|rest| !rest.contains("<DataSet") || rest.contains(&first) || !whole)
            }
            Kind::Table(columns) => begin.starts_with(columns),
            Kind::AboutRun(keys) => {
                let has = |key: &str| begin.contains(&format!("\"{key}\": "));
                begin.starts_with(&format!("{{\n  \"{}\": ", keys[0]))
                    && (!whole || keys.iter().all(|key| has(key)))
            }
            Kind::Checkpoint => {
                begin.starts_with(checkpoint::NAME) || whole && checkpoint::NAME.starts_with(begin)
            }
        }
    }
}

/// Number of bytes read to identify a file, [byte]; files about a run as a whole are read completely.
const FIRST: u64 = 2048;

/// True if a file with the name of a result file is one, judged by its content. Also true if the file is empty or all
/// bytes read are zero, as after a power loss.
fn is_ours(path: &Path, name: &str) -> bool {
    let half = name.strip_suffix(TEMPORARY);
    let Some(kind) = Kind::from_name(half.unwrap_or(name)) else { return false };
    // Reading anything but a regular file may never end.
    let Ok(about) = std::fs::metadata(path) else { return false };
    let most = if let Kind::AboutRun(_) = kind { about.len() } else { FIRST };
    let mut begin = Vec::new();
    let read =
        about.is_file() && File::open(path).and_then(|file| file.take(most).read_to_end(&mut begin)).is_ok();
    read && (begin.iter().all(|byte| *byte == 0)
        || kind.fits(&String::from_utf8_lossy(&begin), half.is_none()))
}

/// The series to which a file with this name belongs.
fn series_of(name: &str) -> Option<&'static str> {
    SERIES.into_iter().find(|series| {
        let Some(rest) = name.strip_prefix(series) else { return false };
        let number = rest.strip_prefix('_').and_then(number_in);
        rest == ".pvd" || number.is_some_and(|n| n.len() >= 4 && is_number(n))
    })
}

/// True if a run or a report may write a file with this name into its directory.
pub fn is_of_results(name: &str) -> bool {
    let name = name.strip_suffix(TEMPORARY).unwrap_or(name);
    Kind::from_name(name).is_some() || name == lock::NAME || name == REPORT
}

/// The name of a file that a run would replace although no run has written it, or of a directory in its place.
///
/// # Errors
/// A file-system error.
pub(super) fn foreign_file(directory: &Path) -> io::Result<Option<String>> {
    for entry in std::fs::read_dir(directory)? {
        let path = entry?.path();
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { continue };
        let is_in_the_way = match Kind::from_name(name.strip_suffix(TEMPORARY).unwrap_or(name)) {
            // Not every run writes these files, so a directory with such a name may stay.
            Some(Kind::Mesh | Kind::Pieces | Kind::Checkpoint) => !path.is_dir(),
            other => other.is_some(),
        };
        if is_in_the_way && !is_ours(&path, name) {
            return Ok(Some(name.to_owned()));
        }
    }
    Ok(None)
}

/// A series that has data files but no `.pvd` file.
///
/// # Errors
/// A file-system error.
pub(super) fn series_without_list(directory: &Path) -> io::Result<Option<&'static str>> {
    for entry in std::fs::read_dir(directory)? {
        let name = entry?.file_name();
        let is_mesh = |name: &&str| name.ends_with(".vtu") || name.ends_with(".pvtu");
        let Some(name) = name.to_str().filter(is_mesh) else { continue };
        if let Some(series) = series_of(name)
            && !directory.join(format!("{series}.pvd")).exists()
        {
            return Ok(Some(series));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The result of [`foreign_file`] for a directory with a single file; checks that a foreign file is not removed.
    fn foreign(name: &str, content: &str) -> Option<String> {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join(name), content).unwrap();
        let found = foreign_file(directory.path()).unwrap();
        remove_earlier_results(directory.path()).unwrap();
        let is_kept = directory.path().join(name).exists();
        assert!(found.is_none() || is_kept, "{name} is removed");
        found
    }

    #[test]
    fn files_are_known_by_their_content() {
        let mesh = format!("{}<UnstructuredGrid>", vtu::HEAD);
        for (name, content) in [
            ("points_0001.vtu", mesh.as_str()),
            ("failed_grid.vtu", &mesh),
            ("points_0001_r12.vtu", &mesh),
            ("points_0001.pvtu", vtu::HEAD_OF_PIECES),
            ("failed_points_r0.vtu", &mesh),
            ("failed_points.pvtu", vtu::HEAD_OF_PIECES),
            ("points_0001_rx.vtu", "whatever"),
            ("grid.pvd", series::HEAD),
            ("history.csv", "step,time,iterations,residual,a\n"),
            ("history.csv", ""),
            (
                "summary.json",
                "{\n  \"outcome\": \"failed\",\n  \"version\": \"0\",\n  \"deck_hash\": \"\"\n}\n",
            ),
            ("summary.json.tmp", "{\n  \"outcome\": \"fai"),
            ("checkpoint_0010.mpm", "mpm checkpoint 2\n"),
            ("checkpoint_0010.mpm", "mpm check"),
            ("checkpoint_0010.mpm", "\0\0\0\0"),
            ("points.txt", "whatever"),
            ("points_1.vtu", "whatever"),
        ] {
            assert_eq!(foreign(name, content), None, "{name}: {content}");
        }
        for (name, content) in [
            ("points_0001.vtu", "<?xml version=\"1.0\"?><VTKFile>"),
            ("points_0001.vtu.tmp", "precious"),
            ("points_0001_r1.vtu", "precious"),
            ("points_0001.pvtu", mesh.as_str()),
            ("domains.pvd", "<?xml version=\"1.0\"?><VTKFile type=\"Collection\">"),
            ("history.csv", "step,force\n1,2\n"),
            ("quality.csv", "precious"),
            ("summary.json", "{}"),
            ("run.json", "{\n  \"title\": \"mine\"\n}\n"),
            ("status.json", "{\n  \"state\": \"asleep\"\n}\n"),
            ("checkpoint_0010.mpm", "precious"),
            ("failed_points.vtu", "precious"),
        ] {
            assert_eq!(foreign(name, content).as_deref(), Some(name), "{content}");
        }
    }

    #[test]
    fn all_files_of_a_run_are_known_as_results() {
        for name in [
            "points.pvd",
            "grid_0001.vtu",
            "history.csv",
            "quality.csv.tmp",
            "status.json",
            ".lock",
            "report.html",
        ] {
            assert!(is_of_results(name), "{name}");
        }
        assert!(!is_of_results("run.log") && !is_of_results("points.log"));
    }
}
