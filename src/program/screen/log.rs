//! The log of a run: every event, written as it occurs.

use std::fs::{File, OpenOptions};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use crate::output::directory;
use crate::program::paths::real;
use crate::program::screen::message::clean;
use anyhow::{Context, bail};

/// Number of bytes at the beginning of a log that contain the program name.
const FIRST: u64 = 24;

/// Refuses a log whose path clashes with the results: with one of their files, or with their directory.
///
/// # Errors
/// If the path clashes.
pub fn keep_out_of_results(log: &Path, results: &Path) -> anyhow::Result<()> {
    let (place, results) = (real(log), real(results));
    let is_way = results.starts_with(&place);
    let name = place.file_name().unwrap_or_default().to_string_lossy();
    if is_way || place.parent() == Some(&results) && directory::is_of_results(&name) {
        let what = if is_way { "the results directory" } else { "a result file" };
        bail!("the log `{}` would be {what}; choose another name with `--log`", log.display());
    }
    Ok(())
}

/// A log file; each line begins with the seconds since the program started and is written without buffering. An earlier
/// log in the file is left alone until the run begins.
#[derive(Debug, Clone)]
pub struct LogFile {
    file: Arc<File>,
    began: Instant,
    /// What waits for the run to begin; `None` once lines are written.
    waiting: Arc<Mutex<Option<Waiting>>>,
}

/// An earlier log, and the lines of this one.
#[derive(Debug)]
struct Waiting {
    /// The earlier log, which this one replaces; `None` if this one continues it.
    replaced: Option<PathBuf>,
    lines: String,
}

impl LogFile {
    /// Creates a log that replaces or, if `append` is true, continues an earlier one once the run begins. The lines of a
    /// run that is refused are written only if there is no earlier log.
    ///
    /// # Errors
    /// If the file cannot be written, or exists but is not a log.
    pub fn create(path: &Path, began: Instant, append: bool) -> anyhow::Result<LogFile> {
        let mut first = Vec::new();
        // An unreadable file is reported when it is opened for writing.
        let _ = File::open(path).and_then(|file| file.take(FIRST).read_to_end(&mut first));
        let is_log = String::from_utf8_lossy(&first).contains("  mpm ");
        if !first.is_empty() && !is_log {
            bail!("`{}` exists, but is not an mpm log; choose another name with `--log`", path.display());
        }
        let file = OpenOptions::new()
            .create(true)
            .append(true)
            .open(path)
            .with_context(|| format!("the log `{}` cannot be written", path.display()))?;
        let replaced = (!append).then(|| path.to_owned());
        let waiting = (!first.is_empty()).then(|| Waiting { replaced, lines: String::new() });
        Ok(LogFile { file: Arc::new(file), began, waiting: Arc::new(Mutex::new(waiting)) })
    }

    /// Writes the lines so far, because the run begins: nobody else writes to its results directory.
    ///
    /// # Errors
    /// A file-system error.
    pub fn begin(&self) -> io::Result<()> {
        let Some(Waiting { replaced, lines }) = self.waiting().take() else { return Ok(()) };
        if let Some(path) = replaced {
            File::create(path)?;
        }
        (&*self.file).write_all(lines.as_bytes())
    }

    fn waiting(&self) -> MutexGuard<'_, Option<Waiting>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes one or more lines of text.
    ///
    /// # Errors
    /// A file-system error.
    pub fn line(&self, text: &str) -> io::Result<()> {
        let time = self.began.elapsed().as_secs_f64();
        let lines: String = clean(text).lines().map(|line| format!("{time:10.3}  {line}\n")).collect();
        if let Some(waiting) = self.waiting().as_mut() {
            waiting.lines.push_str(&lines);
            return Ok(());
        }
        // One unbuffered write, so that the file contains only whole lines at all times, even if the run is killed.
        (&*self.file).write_all(lines.as_bytes())
    }
}
