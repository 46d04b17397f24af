//! Changes to the text of a deck at one of its keys or values.

#![allow(clippy::unwrap_used)]
#![allow(dead_code, reason = "not every test needs all of it")]

use std::path::PathBuf;

use mpm::deck::diagnostic::Diagnostic;
use mpm::deck::source::{Source, Span};
use serde_json::Value;

/// A deck with the locations of its keys and values.
pub struct DeckText {
    pub name: String,
    pub text: String,
    pub source: Source,
    pub value: Value,
}

impl DeckText {
    /// Reads a deck from a file, whose path is relative to the root of the sources.
    pub fn read(path: &str) -> DeckText {
        let text = std::fs::read_to_string(root().join(path)).unwrap();
        DeckText::new(path, text)
    }

    pub fn new(name: &str, text: String) -> DeckText {
        let (source, value, found) = Source::read(name, text.as_bytes());
        assert_eq!(found, [], "{name}");
        DeckText { name: name.to_owned(), value: value.unwrap(), text, source }
    }

    /// Pointers to all values except the deck itself, in the order of the deck.
    pub fn pointers(&self) -> Vec<String> {
        let mut found = Vec::new();
        collect(&self.value, "", &mut found);
        found
    }

    pub fn at(&self, pointer: &str) -> &Value {
        self.value.pointer(pointer).unwrap()
    }

    /// The last part of a pointer, if it is the key of a mapping.
    pub fn key<'p>(&self, pointer: &'p str) -> Option<&'p str> {
        self.source.key_span_of(pointer).map(|_| last(pointer))
    }

    /// The line of a value, from 1.
    pub fn line(&self, pointer: &str) -> usize {
        self.source.line_column(self.source.nearest_span(pointer).unwrap().start).0
    }

    /// The text with another value.
    pub fn with_value(&self, pointer: &str, value: &str) -> String {
        self.with(self.source.span_of(pointer).unwrap(), value)
    }

    /// The text with another key.
    pub fn with_key(&self, pointer: &str, key: &str) -> String {
        self.with(self.source.key_span_of(pointer).unwrap(), key)
    }

    fn with(&self, span: Span, replacement: &str) -> String {
        format!("{}{replacement}{}", &self.text[..span.start], &self.text[span.end..])
    }

    /// The text without a key and its value, or without an entry of a list.
    pub fn without(&self, pointer: &str) -> String {
        let value = self.source.span_of(pointer).unwrap();
        let start = self.source.key_span_of(pointer).map_or(value.start, |key| key.start);
        let is_entry = self.source.key_span_of(pointer).is_none();
        let (before, after) = (&self.text[..start], &self.text[value.end..]);
        let rest = after.trim_start();
        let open = before.trim_end();
        if let Some(rest) = rest.strip_prefix(',') {
            // The comment or line break before the comma is also removed.
            format!("{before}{rest}")
        } else if rest.starts_with(['}', ']']) && open.ends_with(',') || is_entry && open.ends_with('-') {
            format!("{}{after}", &open[..open.len() - 1])
        } else {
            format!("{before}{after}")
        }
    }
}

pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The last part of a pointer.
pub fn last(pointer: &str) -> &str {
    pointer.rsplit_once('/').map_or("", |(_, last)| last)
}

/// A pointer without its last part.
pub fn parent(pointer: &str) -> &str {
    pointer.rsplit_once('/').map_or("", |(parent, _)| parent)
}

/// The line and column of a message, both 0 if it has no location.
pub fn place(source: &Source, found: &Diagnostic) -> (usize, usize) {
    found.span.map_or((0, 0), |span| source.line_column(span.start))
}

/// A key as a hurried person would type it: two letters swapped, or one too many.
pub fn misspelt(key: &str) -> String {
    let letters: Vec<char> = key.chars().collect();
    let swapped = (1..letters.len().saturating_sub(1)).find(|&k| letters[k] != letters[k + 1]);
    match swapped.filter(|_| letters.len() >= 4) {
        Some(k) => {
            let mut letters = letters;
            letters.swap(k, k + 1);
            letters.into_iter().collect()
        }
        None => format!("{key}{}", letters[letters.len() - 1]),
    }
}

fn collect(value: &Value, at: &str, found: &mut Vec<String>) {
    let mut visit = |part: &str, inner: &Value| {
        let pointer = format!("{at}/{}", part.replace('~', "~0").replace('/', "~1"));
        found.push(pointer.clone());
        collect(inner, &pointer, found);
    };
    match value {
        Value::Object(entries) => entries.iter().for_each(|(key, inner)| visit(key, inner)),
        Value::Array(items) => {
            items.iter().enumerate().for_each(|(index, inner)| visit(&index.to_string(), inner));
        }
        _ => {}
    }
}
