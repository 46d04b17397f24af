//! Checks that a message has a remedy. The tests of decks call this for every message of every test deck.

use mpm::deck::diagnostic::Diagnostic;

/// Messages without a remedy: the code, a part of the message, and the reason why there is none.
const WITHOUT: &[(&str, &str, &str)] = &[];

/// Fails for a message without help, unless it is listed above, and for a help that repeats the message.
pub fn has_remedy(found: &Diagnostic) {
    let excused = WITHOUT.iter().any(|(code, part, _)| found.code == *code && found.message.contains(part));
    let help = found.help.as_deref().unwrap_or("");
    assert!(excused || help.len() > 8, "no help for {}: {}", found.code, found.message);
    assert!(help != found.message, "the help repeats the message: {help}");
}
