//! Output to standard output.

use std::io::Write;

use super::message;
use crate::program::exit::DONE;

/// A JSON document as text.
pub fn json_text(document: &impl serde::Serialize) -> anyhow::Result<String> {
    Ok(serde_json::to_string_pretty(document)? + "\n")
}

/// Writes a JSON document to standard output.
pub fn print_json(document: &impl serde::Serialize) -> anyhow::Result<u8> {
    // Programs read the document and need every character.
    write_out(&json_text(document)?)
}

/// Writes text to standard output without control characters; a closed pipe is not an error.
pub fn print(text: &str) -> anyhow::Result<u8> {
    write_out(&message::clean(text))
}

fn write_out(text: &str) -> anyhow::Result<u8> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => Err(error.into()),
        _ => Ok(DONE),
    }
}
