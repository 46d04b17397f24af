//! Messages for the user, on standard error, and what keeps foreign text from steering the terminal.

use std::borrow::Cow;

/// Writes a line to standard error without control characters; that nobody reads it, or can, is no reason to stop an
/// analysis.
macro_rules! tell {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($part)*);
        let _ = writeln!(std::io::stderr(), "{}", $crate::screen::tell::clean(&text));
    }};
}

/// Whether a character may move the cursor, change colours or titles, or turn the direction of what follows.
fn steers(c: char) -> bool {
    let turns = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() && c != '\n' && c != '\t' || turns
}

/// A text that a terminal shows as it is: titles, names and paths may hold escape sequences.
pub fn clean(text: &str) -> Cow<'_, str> {
    if text.contains(steers) {
        Cow::Owned(text.chars().map(|c| if steers(c) { '\u{fffd}' } else { c }).collect())
    } else {
        Cow::Borrowed(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_steers_a_terminal_is_left() {
        assert_eq!(clean("a title\n\twith tabs, é and ∂"), "a title\n\twith tabs, é and ∂");
        let cleaned = clean("\u{1b}]0;owned\u{7}\r\u{9b}2J\u{7f}");
        assert_eq!(cleaned, "\u{fffd}]0;owned\u{fffd}\u{fffd}\u{fffd}2J\u{fffd}");
        assert_eq!(clean("a\u{202e}b"), "a\u{fffd}b");
    }
}
