//! The results that were written last.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use anyhow::bail;

/// The file that every directory of results has.
const MARK: &str = "run.json";

/// The directory of results that a user names; without one, the newest in `results` and the working directory, which is
/// then stated on standard error.
///
/// # Errors
/// If there are none.
pub fn named_or_newest(named: Option<PathBuf>) -> anyhow::Result<PathBuf> {
    if let Some(directory) = named {
        return Ok(directory);
    }
    let mut found: Vec<(SystemTime, PathBuf)> = Vec::new();
    let mut look_at = |directory: PathBuf| {
        if let Ok(time) = directory.join(MARK).metadata().and_then(|about| about.modified()) {
            found.push((time, directory));
        }
    };
    for folder in ["results", "."] {
        let entries = Path::new(folder).read_dir().into_iter().flatten().flatten();
        entries.for_each(|entry| {
            let path = entry.path();
            look_at(path.strip_prefix(".").map(Path::to_owned).unwrap_or(path));
        });
    }
    found.sort();
    match found.pop() {
        Some((_, newest)) => {
            message!("the newest results: {}", newest.display());
            Ok(newest)
        }
        None => bail!("there are no results in `results` or here; name their directory"),
    }
}
