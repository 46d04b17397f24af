//! Whether a message says what to do. The checks of decks call this for every message that any test deck brings about.

use mpm::deck::diagnostic::Diagnostic;

/// Messages without a remedy: the code, a part of the message, and why there is nothing to do about it.
const WITHOUT: &[(&str, &str, &str)] = &[];

/// Fails for a message without help, unless it is listed above, and for a help that says nothing of its own.
pub fn has_remedy(found: &Diagnostic) {
    let excused = WITHOUT.iter().any(|(code, part, _)| found.code == *code && found.message.contains(part));
    let help = found.help.as_deref().unwrap_or("");
    assert!(excused || help.len() > 8, "no help for {}: {}", found.code, found.message);
    assert!(help != found.message, "the help repeats the message: {help}");
}
