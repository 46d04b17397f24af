//! Low-level reader: numbers, words and sections in any encoding.

use std::fmt::Display;
use std::str::FromStr;

use super::error::{FileLocation, GmshError};

/// Largest length of a section name, [byte]. The limit keeps the time to find the end of a section proportional to the
/// file size.
const MAX_SECTION_NAME: usize = 100;

/// Encoding of numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    /// Words separated by white space.
    Text,
    /// Binary, least significant byte first.
    Little,
    /// Binary, most significant byte first.
    Big,
}

/// A position in the bytes of a file.
#[derive(Debug)]
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Encoding of the numbers from here on.
    pub(super) encoding: Encoding,
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Reader { bytes, at: 0, encoding: Encoding::Text }
    }

    /// Current location, for error messages.
    pub(super) fn location(&self) -> FileLocation {
        self.location_of(self.at)
    }

    fn location_of(&self, at: usize) -> FileLocation {
        match self.encoding {
            Encoding::Text => {
                FileLocation::Line(1 + self.bytes[..at].iter().filter(|b| **b == b'\n').count())
            }
            _ => FileLocation::Byte(at),
        }
    }

    fn rest(&self) -> &'a [u8] {
        &self.bytes[self.at..]
    }

    fn skip_blanks(&mut self) {
        self.at += self.rest().iter().take_while(|b| b.is_ascii_whitespace()).count();
    }

    fn expected(&self, at: usize, expected: &'static str) -> GmshError {
        let rest = &self.bytes[at..];
        if rest.is_empty() {
            return GmshError::Truncated { location: self.location_of(at), expected };
        }
        let length = rest.iter().take(30).take_while(|b| !b.is_ascii_whitespace()).count();
        let found = format!("`{}`", rest[..length].escape_ascii());
        GmshError::Expected { location: self.location_of(at), expected, found }
    }

    /// Returns an error at the current location unless the condition holds; `found` says what is there instead.
    pub(super) fn require(
        &self,
        condition: bool,
        expected: &'static str,
        found: impl Display,
    ) -> Result<(), GmshError> {
        if condition {
            return Ok(());
        }
        Err(GmshError::Expected { location: self.location(), expected, found: found.to_string() })
    }

    /// Reads the next word of text.
    pub(super) fn token(&mut self, expected: &'static str) -> Result<&'a str, GmshError> {
        self.skip_blanks();
        let length = self.rest().iter().take_while(|b| !b.is_ascii_whitespace()).count();
        match std::str::from_utf8(&self.rest()[..length]) {
            Ok(token) if length > 0 => {
                self.at += length;
                Ok(token)
            }
            _ => Err(self.expected(self.at, expected)),
        }
    }

    /// Reads the next word of text as a number.
    pub(super) fn text<T: FromStr>(&mut self, expected: &'static str) -> Result<T, GmshError> {
        self.skip_blanks();
        let start = self.at;
        self.token(expected)?.parse().map_err(|_| self.expected(start, expected))
    }

    /// True if a quotation mark follows.
    pub(super) fn is_quoted(&mut self) -> bool {
        self.skip_blanks();
        self.rest().first() == Some(&b'"')
    }

    /// Reads the text between the next quotation mark and the last one on the line. Gmsh has no escape sequences.
    pub(super) fn quoted(&mut self, expected: &'static str) -> Result<String, GmshError> {
        self.skip_blanks();
        let line = self.rest().split(|b| *b == b'\n').next().unwrap_or_default();
        let close = line.iter().rposition(|b| *b == b'"').unwrap_or(0);
        if close == 0 || line[0] != b'"' {
            return Err(self.expected(self.at, expected));
        }
        self.at += close + 1;
        Ok(String::from_utf8_lossy(&line[1..close]).into_owned())
    }

    /// Reads the next `N` bytes of a binary file.
    pub(super) fn take<const N: usize>(&mut self, expected: &'static str) -> Result<[u8; N], GmshError> {
        match self.rest().first_chunk() {
            Some(bytes) => {
                self.at += N;
                Ok(*bytes)
            }
            None => Err(GmshError::Truncated { location: self.location_of(self.bytes.len()), expected }),
        }
    }

    /// Reads a signed integer: 4 bytes in a binary file.
    pub(super) fn int(&mut self, expected: &'static str) -> Result<i32, GmshError> {
        Ok(match self.encoding {
            Encoding::Text => self.text(expected)?,
            Encoding::Little => i32::from_le_bytes(self.take(expected)?),
            Encoding::Big => i32::from_be_bytes(self.take(expected)?),
        })
    }

    /// Reads a count or the number of a node or an element: 8 bytes in a binary file.
    pub(super) fn size(&mut self, expected: &'static str) -> Result<u64, GmshError> {
        Ok(match self.encoding {
            Encoding::Text => self.text(expected)?,
            Encoding::Little => u64::from_le_bytes(self.take(expected)?),
            Encoding::Big => u64::from_be_bytes(self.take(expected)?),
        })
    }

    /// Reads a signed integer that must not be negative.
    pub(super) fn natural(&mut self, expected: &'static str) -> Result<u64, GmshError> {
        if self.encoding == Encoding::Text {
            self.skip_blanks();
        }
        let at = self.at;
        u64::try_from(self.int(expected)?).map_err(|_| self.expected(at, expected))
    }

    /// Reads a real number.
    pub(super) fn real(&mut self, expected: &'static str) -> Result<f64, GmshError> {
        Ok(match self.encoding {
            Encoding::Text => self.text(expected)?,
            Encoding::Little => f64::from_le_bytes(self.take(expected)?),
            Encoding::Big => f64::from_be_bytes(self.take(expected)?),
        })
    }

    /// Checks that this count of items, each with at least `numbers` numbers, fits into the rest of the file.
    pub(super) fn count_of(
        &self,
        count: u64,
        what: &'static str,
        numbers: usize,
    ) -> Result<usize, GmshError> {
        // A number takes at least four bytes in a binary file, and at least a digit and a blank in a text file.
        self.bounded(count, what, numbers * if self.encoding == Encoding::Text { 2 } else { 4 })
    }

    /// Checks that this count of items, each with at least `bytes` bytes, fits into the rest of the file.
    pub(super) fn bounded(&self, count: u64, what: &'static str, bytes: usize) -> Result<usize, GmshError> {
        let left = self.rest().len();
        match usize::try_from(count) {
            Ok(n) if n <= left / bytes && u32::try_from(n).is_ok() => Ok(n),
            _ => Err(GmshError::Count { location: self.location(), what, count, left }),
        }
    }

    /// Reads the end of a line of text, after which binary data may begin.
    pub(super) fn end_of_line(&mut self) -> Result<(), GmshError> {
        self.at += self.rest().iter().take_while(|b| matches!(b, b' ' | b'\t' | b'\r')).count();
        match self.rest().first() {
            Some(b'\n') => {
                self.at += 1;
                Ok(())
            }
            _ => Err(self.expected(self.at, "the end of the line")),
        }
    }

    /// Reads the header of the next section and its line end; `None` at the end of the file.
    pub(super) fn section(&mut self) -> Result<Option<&'a str>, GmshError> {
        self.skip_blanks();
        if self.rest().is_empty() {
            return Ok(None);
        }
        let start = self.at;
        let name = self.token("a section")?.strip_prefix('$').filter(|n| n.len() <= MAX_SECTION_NAME);
        let name = name.ok_or_else(|| self.expected(start, "a section `$...`"))?;
        self.end_of_line()?;
        Ok(Some(name))
    }

    /// Reads the end of a section.
    pub(super) fn end(&mut self, section: &str) -> Result<(), GmshError> {
        self.skip_blanks();
        let start = self.at;
        match self.token("the end of the section")?.strip_prefix("$End") {
            Some(name) if name == section => Ok(()),
            _ => Err(self.expected(start, "the end of the section")),
        }
    }

    /// Skips to the end of a section.
    pub(super) fn skip(&mut self, section: &str) -> Result<(), GmshError> {
        let end = format!("$End{section}");
        let rest = self.rest();
        let ends_word = |at: usize| rest.get(at).is_none_or(u8::is_ascii_whitespace);
        let is_end = |(at, window): &(usize, &[u8])| *window == end.as_bytes() && ends_word(at + end.len());
        match rest.windows(end.len()).enumerate().find(is_end).map(|(at, _)| at) {
            Some(offset) => {
                self.at += offset;
                self.end(section)
            }
            None => Err(GmshError::Unclosed { location: self.location(), section: section.to_owned() }),
        }
    }
}
