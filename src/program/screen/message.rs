//! Messages on standard error, without characters that would control the terminal.

use std::borrow::Cow;

/// Writes a line to standard error without control characters. Write errors are ignored: they must not stop an
/// analysis.
macro_rules! message {
    ($($part:tt)*) => {{
        use std::io::Write as _;
        let text = format!($($part)*);
        let _ = writeln!(std::io::stderr(), "{}", $crate::program::screen::message::clean(&text));
    }};
}

/// True if a character may move the cursor, change colours or titles, or reverse the direction of the text.
fn controls_terminal(c: char) -> bool {
    let reverses = matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() && c != '\n' && c != '\t' || reverses
}

/// Replaces control characters in text: titles, names and paths may contain escape sequences.
pub fn clean(text: &str) -> Cow<'_, str> {
    if text.contains(controls_terminal) {
        Cow::Owned(text.chars().map(|c| if controls_terminal(c) { '\u{fffd}' } else { c }).collect())
    } else {
        Cow::Borrowed(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_replaced() {
        assert_eq!(clean("a title\n\twith tabs, é and ∂"), "a title\n\twith tabs, é and ∂");
        let cleaned = clean("\u{1b}]0;owned\u{7}\r\u{9b}2J\u{7f}");
        assert_eq!(cleaned, "\u{fffd}]0;owned\u{fffd}\u{fffd}\u{fffd}2J\u{fffd}");
        assert_eq!(clean("a\u{202e}b"), "a\u{fffd}b");
    }
}
