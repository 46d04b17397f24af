//! One run at a time in a directory of results, and a way for others to tell whether it still goes on.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::Path;
use std::time::Duration;

/// Name of the file that is locked. It is empty and stays behind: only the lock on it means anything.
pub(super) const NAME: &str = ".lock";

/// How often, and how long apart, a lock is tried for: `mpm status` holds it for a moment.
const TRIES: usize = 20;
const PAUSE: Duration = Duration::from_millis(10);

/// A lock on a directory of results. The system releases it when the process ends, in whichever way.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Locks a directory.
    ///
    /// # Errors
    /// `ResourceBusy` where another run has the lock; otherwise those of the file system. One that knows no locks lets
    /// every run in.
    pub fn take(directory: &Path) -> io::Result<Lock> {
        if !is_possible(directory) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, format!("`{NAME}` there is no file")));
        }
        let file = OpenOptions::new().write(true).create(true).truncate(false).open(directory.join(NAME))?;
        for _ in 0..TRIES {
            match file.try_lock() {
                Ok(()) => return Ok(Lock { _file: file }),
                Err(TryLockError::WouldBlock) => std::thread::sleep(PAUSE),
                Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => {
                    return Ok(Lock { _file: file });
                }
                Err(TryLockError::Error(error)) => return Err(error),
            }
        }
        Err(io::Error::new(io::ErrorKind::ResourceBusy, "another run writes its results there"))
    }

    /// Whether a run has the lock of a directory; true where the file system cannot tell.
    pub fn is_held(directory: &Path) -> bool {
        if !is_possible(directory) {
            return false;
        }
        let Ok(file) = File::open(directory.join(NAME)) else { return false };
        // Dropping the file gives the lock back.
        file.try_lock_shared().is_err()
    }
}

/// Whether the lock is a file or not there; to open a pipe would take forever.
fn is_possible(directory: &Path) -> bool {
    std::fs::metadata(directory.join(NAME)).map_or(true, |about| about.is_file())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_run_at_a_time() {
        let directory = tempfile::tempdir().unwrap();
        assert!(!Lock::is_held(directory.path()));
        let lock = Lock::take(directory.path()).unwrap();
        assert!(Lock::is_held(directory.path()));
        assert_eq!(Lock::take(directory.path()).unwrap_err().kind(), io::ErrorKind::ResourceBusy);
        drop(lock);
        assert!(!Lock::is_held(directory.path()));
        Lock::take(directory.path()).unwrap();
    }
}
