//! Decides which existing files a command overwrites: only those that it wrote itself.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Number of bytes at the beginning of a file in which its mark is sought.
const FIRST: u64 = 1000;

/// The mark of a report: the beginning of the tag of its generator.
pub const REPORT: &str = r#"<meta name="generator" content="mpm "#;

/// True if a path does not exist, or is a file that is empty or has the mark in its first [`FIRST`] bytes.
pub fn may_be_replaced(path: &Path, mark: &str) -> bool {
    let Ok(about) = std::fs::metadata(path) else { return true };
    let mut first = Vec::new();
    // An unreadable file could be anything.
    let read =
        about.is_file() && File::open(path).and_then(|file| file.take(FIRST).read_to_end(&mut first)).is_ok();
    read && (first.is_empty() || String::from_utf8_lossy(&first).contains(mark))
}
