//! Messages about a deck as JSON, for programs such as editors and continuous integration.

use serde_json::{Value, json};

use super::{CODES, Diagnostic, Severity};
use crate::source::Source;

/// Version of the JSON format; it changes when a key is removed or gets another meaning, not when one is added.
pub const FORMAT_VERSION: u32 = 1;

/// All messages as one JSON value, described in `docs/diagnostics.md`.
pub fn as_json(source: &Source, diagnostics: &[Diagnostic]) -> Value {
    let usable = !diagnostics.iter().any(Diagnostic::is_error);
    let count = |severity: Severity| diagnostics.iter().filter(|d| d.severity == severity).count();
    json!({
        "version": FORMAT_VERSION,
        "deck": source.name(),
        "usable": usable,
        "errors": count(Severity::Error),
        "warnings": count(Severity::Warning),
        "diagnostics": diagnostics.iter().map(|d| one_as_json(source, d)).collect::<Vec<_>>(),
    })
}

fn one_as_json(source: &Source, diagnostic: &Diagnostic) -> Value {
    let place = |offset: usize| {
        let (line, column) = source.line_column(offset);
        json!({ "line": line, "column": column })
    };
    let start = diagnostic.span.map(|span| source.line_column(span.start));
    let title = CODES.iter().find(|(code, _)| *code == diagnostic.code).map(|(_, title)| *title);
    json!({
        "code": diagnostic.code,
        "title": title,
        "severity": diagnostic.severity.name(),
        "gate": diagnostic.gate.name(),
        "file": source.name(),
        "line": start.map(|(line, _)| line),
        "column": start.map(|(_, column)| column),
        "end": diagnostic.span.map(|span| place(span.end)),
        "path": diagnostic.pointer,
        "message": diagnostic.message,
        "label": diagnostic.label,
        "expected": diagnostic.expected,
        "notes": diagnostic.notes,
        "help": diagnostic.help,
    })
}
