//! Result files of a run: VTK XML meshes, their time series, and comma-separated tables.
//!
//! The building blocks (`vtu`, `series`, `table`) know nothing of material points: they take arrays and names;
//! `results` writes a run with them, `findings` summarises it, `status` records its progress. Readers never find a
//! half-written file: a file is written under a temporary name and then renamed, and a table is extended by whole rows.
//! The results of a killed run therefore stay readable up to its last step.

pub mod checkpoint;
pub mod directory;
pub mod element_test;
mod failed;
pub mod fields;
pub mod findings;
mod frames;
pub mod history;
pub mod lock;
mod motion;
pub mod record;
pub mod replace;
pub mod results;
mod rows;
pub mod series;
mod smoothed_pressure;
mod start;
pub mod status;
pub mod summary;
pub mod table;
mod tool_frames;
pub mod units;
pub mod vtu;
mod writer;

use std::io;

/// Codes and titles of the errors that the use of a results directory can cause.
pub const CODES: &[(&str, &str)] =
    &[("R001", "a directory that cannot take results"), ("R002", "a run that cannot be resumed")];

/// An error of kind `InvalidInput`, for invalid data from the caller.
fn invalid(message: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message.into())
}

/// Escapes text for the value of an XML attribute in double quotes.
pub fn escape_xml(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&apos;"),
            // XML 1.0 does not allow most control characters, not even escaped.
            c if c.is_control() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// The fewest decimal digits that read back as exactly this number; the text has an exponent if the magnitude is at
/// least 1e16, or below 1e-4 and not 0.
pub fn shortest(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || (1e-4..1e16).contains(&size) { format!("{value}") } else { format!("{value:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_exactly() {
        for value in [0.0, -0.0, 1.0, 1.0 / 3.0, -12e6, 5e-324, 1e-5, 123456789.125, f64::MAX, 1e16, 1e-4] {
            let read: f64 = shortest(value).parse().unwrap();
            assert_eq!(read.to_bits(), value.to_bits(), "{}", shortest(value));
        }
        assert_eq!(shortest(0.25), "0.25");
        assert_eq!(shortest(1e-9), "1e-9");
    }

    #[test]
    fn names_are_escaped() {
        assert_eq!(escape_xml("a<b & \"c\"\n'd'>"), "a&lt;b &amp; &quot;c&quot;\u{fffd}&apos;d&apos;&gt;");
    }
}
