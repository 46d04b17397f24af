//! Text of a deck, formatted for messages.

pub use mpm_core::counted::counted;

/// Formats text of a deck for a message: in backquotes, short, without control characters.
pub fn quote(text: &str) -> String {
    let mut shown: String = text
        .chars()
        .take(60)
        .map(|c| if c.is_control() || ('\u{200b}'..='\u{202e}').contains(&c) { '\u{fffd}' } else { c })
        .collect();
    if text.chars().nth(60).is_some() {
        shown.push('…');
    }
    format!("`{shown}`")
}

/// A number without the round-off of the arithmetic that produced it.
pub fn rounded(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}

/// Formats alternatives for a message: `a, b or c`.
pub fn either(words: &[String]) -> String {
    joined(words, "or")
}

/// Formats words as a list with a conjunction before the last: `a, b and c`.
pub fn joined(words: &[String], conjunction: &str) -> String {
    match words {
        [] => String::new(),
        [only] => only.clone(),
        [others @ .., last] => format!("{} {conjunction} {last}", others.join(", ")),
    }
}

/// Formats names as a list for a message: `` `a`, `b` and `c` ``; long lists are truncated.
pub fn list<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let mut names: Vec<String> = names.into_iter().map(quote).collect();
    if names.len() > 20 {
        let more = names.len() - 20;
        names.truncate(20);
        return format!("{} and {more} more", names.join(", "));
    }
    if names.is_empty() { "none".into() } else { joined(&names, "and") }
}
