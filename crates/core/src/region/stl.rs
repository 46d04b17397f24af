//! Reader of STL files, text and binary.
//!
//! A file is binary if its size matches its facet count, whatever its first word: many binary files start with `solid`.
//! Coordinates in text files are read in double precision; units are not converted. Normals and attributes are ignored:
//! the order of the corners defines the outside. All solids of a file form one surface.

use std::path::Path;

use super::surface::Triangle;
use crate::counted::counted;
use crate::input_file::{self, InputFileError};

/// Largest file that is read, [byte]; about 20 million facets.
const MAX_BYTES: u64 = 1 << 30;

/// Sizes in a binary file, [byte]: the header, the header with the facet count, and one facet.
const HEADER: usize = 80;
const BEFORE_FACETS: usize = HEADER + 4;
const FACET: usize = 50;

/// The facets of an STL file.
#[derive(Debug, Clone, PartialEq)]
pub struct StlFile {
    /// The facets in file order, with finite coordinates, [length].
    pub triangles: Vec<Triangle>,
    /// How the file departs from the format, without a loss.
    pub notes: Vec<StlNote>,
}

/// A departure of an STL file from its format that leaves no doubt about its facets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StlNote {
    /// Bytes after the facets that the header announces.
    #[error("{} after the last facet; they are ignored", counted(*.bytes, "byte follows", "bytes follow"))]
    Trailing {
        /// Number of such bytes.
        bytes: usize,
    },
    /// The last solid of a text file is not closed.
    #[error("the last line, `endsolid`, is missing")]
    Unclosed,
}

/// An error in an STL file.
#[derive(Debug, thiserror::Error)]
pub enum StlError {
    /// The file cannot be read, is not a regular file, or is too large.
    #[error(transparent)]
    File(#[from] InputFileError),
    /// The file is not an STL file.
    #[error("not an STL file: it does not begin with `solid` and is too short for a binary one")]
    NotStl,
    /// The size of a binary file does not match its facet count.
    #[error(
        "the header announces {} {needed} bytes, but the file has {bytes}",
        counted(*.announced as usize, "facet, which takes", "facets, which take")
    )]
    Size {
        /// Facet count in the header.
        announced: u32,
        /// Size of a file with that many facets, [byte].
        needed: u64,
        /// Size of the file, [byte].
        bytes: usize,
    },
    /// A text file violates the format.
    #[error("line {line}: expected {expected}, found {found}")]
    Expected {
        /// Number of the line, from 1.
        line: usize,
        /// The word required by the format.
        expected: &'static str,
        /// The word found, abbreviated.
        found: String,
    },
    /// A text file ends too early.
    #[error("the file ends at line {line}; {expected} is missing there")]
    Truncated {
        /// Number of the last line, from 1.
        line: usize,
        /// The missing word.
        expected: &'static str,
    },
    /// A coordinate is infinite or NaN.
    #[error("facet {facet}: a coordinate of corner {corner} is not finite")]
    NotFinite {
        /// Number of the facet, from 1.
        facet: usize,
        /// Number of the corner of the facet, 1 to 3.
        corner: usize,
    },
    /// The file has no facets.
    #[error("the file has no facets")]
    NoFacets,
}

/// Reads an STL file.
///
/// # Errors
/// [`StlError::File`] if the file cannot be read, otherwise as for [`read`].
pub fn read_file(path: &Path) -> Result<StlFile, StlError> {
    read(&input_file::read(path, MAX_BYTES)?)
}

/// Reads the facets of an STL file. Memory is proportional to the file size.
///
/// # Errors
/// Any [`StlError`] about the contents.
pub fn read(bytes: &[u8]) -> Result<StlFile, StlError> {
    let mut notes = Vec::new();
    let triangles = match (announced(bytes), is_text(bytes)) {
        (Some(n), _) if bytes.len() as u64 == size(n) => binary(bytes, n),
        (_, true) => text(bytes, &mut notes)?,
        (Some(n), false) => match (bytes.len() as u64).checked_sub(size(n)) {
            // Whole facets beyond the announced ones mean that the count is wrong.
            Some(rest) if n > 0 && rest % FACET as u64 != 0 => {
                notes.push(StlNote::Trailing { bytes: rest as usize });
                binary(bytes, n)
            }
            _ => return Err(StlError::Size { announced: n, needed: size(n), bytes: bytes.len() }),
        },
        (None, false) => return Err(StlError::NotStl),
    };
    if triangles.is_empty() {
        return Err(StlError::NoFacets);
    }
    for (k, facet) in triangles.iter().enumerate() {
        if let Some(corner) = facet.iter().position(|x| !x.iter().all(|x| x.is_finite())) {
            return Err(StlError::NotFinite { facet: k + 1, corner: corner + 1 });
        }
    }
    Ok(StlFile { triangles, notes })
}

/// Facet count in the header of a binary file.
fn announced(bytes: &[u8]) -> Option<u32> {
    bytes.get(HEADER..)?.first_chunk().map(|count| u32::from_le_bytes(*count))
}

/// Size of a binary file, [byte].
fn size(facets: u32) -> u64 {
    BEFORE_FACETS as u64 + FACET as u64 * u64::from(facets)
}

/// True if a file that is not a valid binary file looks like text: it starts with `solid`, and its first part contains
/// no zero byte.
fn is_text(bytes: &[u8]) -> bool {
    let start = without_mark(bytes).trim_ascii_start();
    let begins = start.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid"));
    begins && !bytes.iter().take(10 * BEFORE_FACETS).any(|byte| *byte == 0)
}

/// Skips the byte order mark that some editors write.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

fn binary(bytes: &[u8], n: u32) -> Vec<Triangle> {
    let number = |bytes: &[u8; 4]| f64::from(f32::from_le_bytes(*bytes));
    let (facets, _) = bytes[BEFORE_FACETS..].as_chunks::<FACET>();
    let corners = |facet: &[u8; FACET]| -> Triangle {
        // Each facet starts with the normal and ends with the attribute.
        let (numbers, _) = facet[12..48].as_chunks::<4>();
        std::array::from_fn(|corner| std::array::from_fn(|d| number(&numbers[3 * corner + d])))
    };
    facets.iter().take(n as usize).map(corners).collect()
}

/// The words of a text file.
struct Words<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

impl<'a> Words<'a> {
    /// The next word; `None` at the end.
    fn next(&mut self) -> Option<&'a [u8]> {
        while let Some(byte) = self.bytes.get(self.at).filter(|byte| byte.is_ascii_whitespace()) {
            // A line ends with a line feed, a carriage return, or both.
            let follows = self.bytes.get(self.at + 1) == Some(&b'\n');
            self.line += usize::from(*byte == b'\n' || (*byte == b'\r' && !follows));
            self.at += 1;
        }
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        self.at += length;
        (length > 0).then(|| &rest[..length])
    }

    /// Skips the rest of the line.
    fn skip_line(&mut self) {
        let rest = &self.bytes[self.at..];
        self.at += rest.iter().position(|byte| matches!(byte, b'\n' | b'\r')).unwrap_or(rest.len());
    }

    fn required(&mut self, expected: &'static str) -> Result<&'a [u8], StlError> {
        self.next().ok_or(StlError::Truncated { line: self.line, expected })
    }

    fn not(&self, expected: &'static str, found: &[u8]) -> StlError {
        let found = format!("`{}`", found[..found.len().min(30)].escape_ascii());
        StlError::Expected { line: self.line, expected, found }
    }

    /// Reads a keyword; `quoted` is the keyword between backticks, as messages show it.
    fn keyword(&mut self, quoted: &'static str) -> Result<(), StlError> {
        let word = self.required(quoted)?;
        let is_it = word.eq_ignore_ascii_case(quoted.trim_matches('`').as_bytes());
        if is_it { Ok(()) } else { Err(self.not(quoted, word)) }
    }

    fn number(&mut self) -> Result<f64, StlError> {
        let word = self.required("a number")?;
        let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        number.ok_or_else(|| self.not("a number", word))
    }
}

fn text(bytes: &[u8], notes: &mut Vec<StlNote>) -> Result<Vec<Triangle>, StlError> {
    let mut words = Words { bytes: without_mark(bytes), at: 0, line: 1 };
    let mut facets = Vec::new();
    words.keyword("`solid`")?;
    loop {
        // The rest of the line is the name of the solid.
        words.skip_line();
        loop {
            let Some(word) = words.next() else {
                notes.push(StlNote::Unclosed);
                return Ok(facets);
            };
            if word.eq_ignore_ascii_case(b"facet") {
                facets.push(facet(&mut words)?);
            } else if word.eq_ignore_ascii_case(b"endsolid") {
                break;
            } else {
                return Err(words.not("`facet` or `endsolid`", word));
            }
        }
        words.skip_line();
        match words.next() {
            None => return Ok(facets),
            Some(word) if word.eq_ignore_ascii_case(b"solid") => {}
            Some(word) => return Err(words.not("`solid` or the end of the file", word)),
        }
    }
}

/// Reads a facet after its first word.
fn facet(words: &mut Words<'_>) -> Result<Triangle, StlError> {
    words.keyword("`normal`")?;
    for _ in 0..3 {
        // Any word is accepted: some programs write `nan` if they cannot form a normal.
        words.required("the normal of a facet")?;
    }
    words.keyword("`outer`")?;
    words.keyword("`loop`")?;
    let mut triangle = [[0.0; 3]; 3];
    for corner in &mut triangle {
        words.keyword("`vertex`")?;
        for x in corner {
            *x = words.number()?;
        }
    }
    words.keyword("`endloop`")?;
    words.keyword("`endfacet`")?;
    Ok(triangle)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "solid two words\n  facet normal nan 0 0\n    outer loop\n      vertex 0 0 0.1\n      \
        vertex 1e0 0 0\n      vertex 0 1.5E-3 0\n    endloop\n  endfacet\nendsolid two words\n";

    fn binary_file(header: &[u8], count: u32, facets: &[[f32; 9]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(HEADER, b' ');
        bytes.extend(count.to_le_bytes());
        for facet in facets {
            bytes.extend([0; 12]);
            bytes.extend(facet.iter().flat_map(|x| x.to_le_bytes()));
            bytes.extend([7, 0]);
        }
        bytes
    }

    /// The facets of a file that needs no note.
    fn facets(bytes: &[u8]) -> Vec<Triangle> {
        let file = read(bytes).unwrap();
        assert!(file.notes.is_empty(), "{:?}", file.notes);
        file.triangles
    }

    fn message(bytes: &[u8]) -> String {
        read(bytes).unwrap_err().to_string()
    }

    #[test]
    fn texts_are_read_in_double_precision_and_any_layout() {
        let facet = [[0.0, 0.0, 0.1], [1.0, 0.0, 0.0], [0.0, 1.5e-3, 0.0]];
        assert_eq!(facets(TEXT.as_bytes()), [facet]);
        let layouts = [
            format!("\u{feff}{TEXT}"),
            TEXT.replace('\n', "\r\n"),
            TEXT.replace('\n', "\r"),
            TEXT.to_uppercase().replace("NAN", "-nan(ind)"),
            TEXT.replace(" two words", ""),
        ];
        for layout in layouts {
            assert_eq!(facets(layout.as_bytes()), [facet], "{layout}");
        }
        assert_eq!(facets(TEXT.repeat(2).as_bytes()), [facet; 2]);
    }

    #[test]
    fn a_binary_file_may_begin_like_a_text() {
        let corners = [0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0];
        for header in ["solid facet", "", "COLOR="] {
            let read = facets(&binary_file(header.as_bytes(), 1, &[corners]));
            assert_eq!(read, [[[0.0, 0.0, 0.5], [1.0, 0.0, 0.0], [0.0, 1.5, 0.0]]]);
        }
    }

    #[test]
    fn harmless_departures_are_noted() {
        let corners = [0.0, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 1.5, 0.0];
        let mut longer = binary_file(b"", 1, &[corners]);
        longer.push(0);
        let file = read(&longer).unwrap();
        assert_eq!((file.triangles.len(), file.notes), (1, vec![StlNote::Trailing { bytes: 1 }]));
        let unclosed = read(TEXT.split("endsolid").next().unwrap().as_bytes()).unwrap();
        assert_eq!((unclosed.triangles.len(), unclosed.notes), (1, vec![StlNote::Unclosed]));
    }

    #[test]
    fn what_is_wrong_with_a_file_has_a_place() {
        let corners = [0.0; 9];
        let lying = binary_file(b"", u32::MAX, &[corners]);
        assert_eq!(
            message(&lying),
            "the header announces 4294967295 facets, which take 214748364834 bytes, but the file has 134"
        );
        assert!(message(&binary_file(b"solid", 2, &[corners])).contains("announces 2 facets"));
        // Whole facets beyond the announced ones: the count is wrong.
        let longer = binary_file(b"", 1, &[corners; 2]);
        assert!(message(&longer).contains("announces 1 facet, which takes 134 bytes"));
        assert_eq!(message(&binary_file(b"", 0, &[])), "the file has no facets");
        let mut strange = corners;
        strange[5] = f32::NAN;
        assert_eq!(
            message(&binary_file(b"", 2, &[corners, strange])),
            "facet 2: a coordinate of corner 2 is not finite"
        );
        assert!(message(b"").contains("not an STL file") && message(b"ply\n").contains("not an STL file"));
        assert_eq!(message(b"solid\nendsolid"), "the file has no facets");
        assert_eq!(
            message(TEXT.replace("0 0 0.1", "0 0 0,1").as_bytes()),
            "line 4: expected a number, found `0,1`"
        );
        assert_eq!(
            message(TEXT.replace("endloop", "vertex").as_bytes()),
            "line 7: expected `endloop`, found `vertex`"
        );
        assert_eq!(
            message(TEXT.replace("1e0", "inf").as_bytes()),
            "facet 1: a coordinate of corner 2 is not finite"
        );
        assert_eq!(
            message(TEXT.split("endfacet").next().unwrap().as_bytes()),
            "the file ends at line 8; `endfacet` is missing there"
        );
        assert!(
            message(format!("{TEXT}rubbish").as_bytes()).contains("line 10: expected `solid` or the end")
        );
        let error = |path: &str| read_file(Path::new(path)).unwrap_err();
        assert!(matches!(error("/"), StlError::File(InputFileError::NotAFile(_))));
        assert!(matches!(error("/no such file"), StlError::File(InputFileError::Io(_))));
    }
}
