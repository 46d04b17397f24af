//! Files that a run leaves behind: VTK XML meshes, their time series, and comma-separated tables.
//!
//! The building blocks (`vtu`, `series`, `table`) know nothing of material points: they take arrays and names;
//! `results` puts a run into them, `findings` sums it up, `status` says how far it is. A reader of the files never
//! meets a half-written one, because a file is written under a temporary name and then renamed, and a table is
//! extended by whole rows; a killed run therefore stays readable up to its last step.

pub mod checkpoint;
pub mod directory;
mod failed;
pub mod fields;
pub mod findings;
mod frames;
pub mod lock;
pub mod replace;
pub mod results;
mod rows;
pub mod series;
mod start;
pub mod status;
pub mod summary;
pub mod table;
pub mod vtu;
mod writer;

use std::io;

/// Codes of what keeps a run from using its directory of results, with a title each.
pub const CODES: &[(&str, &str)] =
    &[("R001", "a directory that cannot take results"), ("R002", "a run that cannot go on")];

/// An error of kind `InvalidInput`, for data that the caller should not have passed.
fn invalid(message: impl Into<String>) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidInput, message.into())
}

/// Text made safe between the double quotes of an XML attribute.
pub fn escape_xml(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&apos;"),
            // XML 1.0 cannot carry other control characters, not even escaped.
            c if c.is_control() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// The shortest decimal text that reads back as exactly this number; an exponent only where it shortens.
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
