//! Lock of a results directory: it admits one run at a time, and shows others that a run is in progress.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::Path;
use std::time::Duration;

/// Name of the file that is locked. It is empty and is not removed: only the lock on it matters.
pub(super) const NAME: &str = ".lock";

/// Number of attempts to take the lock, and the pause between them; `mpm status` may hold the lock briefly.
const TRIES: usize = 20;
const PAUSE: Duration = Duration::from_millis(10);

/// A lock on a results directory. The system releases it when the process ends, for whatever reason.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

impl Lock {
    /// Locks a directory.
    ///
    /// # Errors
    /// `ResourceBusy` if another run holds the lock; `InvalidInput` if the lock is not a regular file; otherwise a
    /// file-system error. A file system without locks admits every run.
    pub fn take(directory: &Path) -> io::Result<Lock> {
        if !is_possible(directory) {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, format!("`{NAME}` in it is not a file")));
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
        Err(io::Error::new(
            io::ErrorKind::ResourceBusy,
            "another run is writing its results to this directory",
        ))
    }

    /// True if a run holds the lock of a directory, or if the file system does not support locks.
    pub fn is_held(directory: &Path) -> bool {
        if !is_possible(directory) {
            return false;
        }
        let Ok(file) = File::open(directory.join(NAME)) else { return false };
        // Dropping the file releases the lock.
        file.try_lock_shared().is_err()
    }
}

/// True if the lock is a regular file or does not exist; opening a pipe would block forever.
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
