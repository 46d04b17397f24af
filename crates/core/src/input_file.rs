//! Files that users name: only regular files of a known size are read, so that reading ends.

use std::fs::{File, Metadata};
use std::io::{self, ErrorKind, Read};
use std::path::Path;

/// A file that cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum InputFileError {
    /// The file cannot be opened or read.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// The path is a directory, a device, a pipe or a socket.
    #[error("it is {0}, not a file")]
    NotAFile(&'static str),
    /// The file has contents but no size, like those that the system writes while they are read, for example in
    /// `/proc`.
    #[error("it has contents but no size, so it is not an ordinary file")]
    WithoutSize,
    /// The file exceeds the size limit, [byte].
    #[error("the file has {bytes} bytes; the limit is {limit}")]
    TooLarge {
        /// Size of the file.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
}

impl From<InputFileError> for io::Error {
    fn from(error: InputFileError) -> io::Error {
        match error {
            InputFileError::Io(error) => error,
            error => io::Error::new(ErrorKind::InvalidInput, error.to_string()),
        }
    }
}

/// Reads the contents of a file of at most `limit` bytes.
///
/// # Errors
/// [`InputFileError`].
pub fn read(path: &Path, limit: u64) -> Result<Vec<u8>, InputFileError> {
    let (mut file, size) = open(path)?;
    if size > limit {
        return Err(InputFileError::TooLarge { bytes: size, limit });
    }
    let mut bytes = Vec::new();
    if size == 0 {
        // Some files of the system give nothing to requests for a few bytes.
        let mut first = [0; 4096];
        return match file.read(&mut first)? {
            0 => Ok(bytes),
            _ => Err(InputFileError::WithoutSize),
        };
    }
    // A file full of holes may claim any size.
    let room = usize::try_from(size).map(|size| bytes.try_reserve_exact(size));
    if !matches!(room, Ok(Ok(()))) {
        return Err(io::Error::from(ErrorKind::OutOfMemory).into());
    }
    // Whatever is appended in the meantime is not part of the file, so that reading ends.
    file.take(size).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads the text in a file of any size.
///
/// # Errors
/// As for [`read`]; `InvalidData` if the file is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    let bytes = read(path, u64::MAX)?;
    String::from_utf8(bytes).map_err(|_| io::Error::new(ErrorKind::InvalidData, "the file is not UTF-8 text"))
}

/// Opens a regular file; returns it with its size, [byte].
///
/// # Errors
/// [`InputFileError::Io`] or [`InputFileError::NotAFile`].
pub fn open(path: &Path) -> Result<(File, u64), InputFileError> {
    // Opening a pipe that nobody writes to would never end.
    expect_regular(&std::fs::metadata(path)?)?;
    let file = File::open(path)?;
    // The name may have passed to something else in the meantime.
    let about = file.metadata()?;
    expect_regular(&about)?;
    Ok((file, about.len()))
}

fn expect_regular(about: &Metadata) -> Result<(), InputFileError> {
    if about.is_file() { Ok(()) } else { Err(InputFileError::NotAFile(kind(about))) }
}

/// What a path that is not a regular file stands for.
fn kind(about: &Metadata) -> &'static str {
    if about.is_dir() {
        return "a directory";
    }
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;

        let kind = about.file_type();
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
    }
    "a device"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_regular_files_are_read() {
        let manifest = Path::new("Cargo.toml");
        let expected = std::fs::read(manifest).unwrap();
        let size = expected.len() as u64;
        assert_eq!(read(manifest, size).unwrap(), expected);
        let large = read(manifest, size - 1).unwrap_err();
        assert_eq!(large.to_string(), format!("the file has {size} bytes; the limit is {}", size - 1));
        let message = |path: &str| read(Path::new(path), 1 << 30).unwrap_err().to_string();
        assert_eq!(message("src"), "it is a directory, not a file");
        assert!(matches!(read(Path::new("none"), 1), Err(InputFileError::Io(_))));
        #[cfg(target_os = "linux")]
        {
            assert_eq!(message("/dev/zero"), "it is a device, not a file");
            assert_eq!(message("/dev/null"), "it is a device, not a file");
            for file in ["/proc/self/pagemap", "/proc/self/maps", "/proc/self/status"] {
                assert_eq!(
                    message(file),
                    "it has contents but no size, so it is not an ordinary file",
                    "{file}"
                );
            }
        }
    }
}
