//! Whole-file replacement: a new file appears under its name only when it is complete.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Suffix of the name of an incomplete file.
pub(crate) const TEMPORARY: &str = ".tmp";

/// Writes a file through `fill` under the temporary name `<name>.tmp` beside it, then renames it to `path`.
///
/// The old file, if any, stays untouched until then. On failure the temporary file is removed. Errors, which name the
/// file: errors of `fill`; file-system errors; `InvalidInput` if `path` does not name a file.
pub fn replace_file(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let name =
        path.file_name().ok_or_else(|| super::invalid(format!("{} does not name a file", path.display())))?;
    let mut temporary_name = OsString::from(name);
    temporary_name.push(TEMPORARY);
    let temporary = path.with_file_name(temporary_name);
    let written = File::create(&temporary).and_then(|file| {
        let mut writer = BufWriter::new(file);
        fill(&mut writer)?;
        // Taking the file out of the buffer reports errors that a drop would ignore, such as a full disk.
        writer.into_inner().map_err(io::IntoInnerError::into_error)?;
        fs::rename(&temporary, path)
    });
    if written.is_err() {
        // The first error matters most.
        let _ = fs::remove_file(&temporary);
    }
    written.map_err(|error| io::Error::new(error.kind(), format!("`{}`: {error}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failure_keeps_the_old_file_and_leaves_no_other() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.txt");
        replace_file(&path, |w| w.write_all(b"old")).unwrap();
        let error = replace_file(&path, |w| {
            w.write_all(b"half of the new")?;
            Err(io::Error::other("stopped"))
        });
        assert_eq!(error.unwrap_err().to_string(), format!("`{}`: stopped", path.display()));
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1);
    }
}
