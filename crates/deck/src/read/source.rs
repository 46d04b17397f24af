//! The text of a deck with the location of every key and value in it.
//!
//! The YAML events become a [`serde_json::Value`] and a map from JSON pointers to locations, so that every later check
//! can be a function of plain values and still point at the text.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;

use crate::quoting::quote;
use crate::span::EntrySpan;

pub use crate::span::Span;

/// A value that was computed from parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Substitution {
    /// The text in the deck, for example `${h/2}`.
    pub written: String,
    /// The value that replaced it.
    pub became: String,
    /// The overrides it depends on, for example `h=0.25`.
    pub overrides: Vec<String>,
}

impl Substitution {
    /// Describes the substitution in words.
    pub fn describe(&self) -> String {
        let mut text = format!("{} is {} here", quote(&self.written), quote(&self.became));
        if !self.overrides.is_empty() {
            let overrides: Vec<String> =
                self.overrides.iter().map(|o| quote(&format!("--set {o}"))).collect();
            text.push_str(&format!(", because of {}", overrides.join(" and ")));
        }
        text
    }
}

/// The text of a deck and the locations of its values.
#[derive(Debug, Clone, Default)]
pub struct Source {
    name: String,
    text: String,
    /// First byte of every line except the first.
    line_starts: Vec<usize>,
    pub(crate) entries: HashMap<String, EntrySpan>,
    substitutions: BTreeMap<String, Substitution>,
    used_parameters: HashSet<String>,
    pub(crate) poisoned: HashSet<String>,
}

/// A piece of the text consisting of whole lines, with a mark in it.
pub(crate) struct Excerpt<'a> {
    pub text: &'a str,
    pub line: usize,
    pub mark: Range<usize>,
}

impl Source {
    /// Largest deck, in bytes; bulky data does not belong in a deck.
    pub(crate) const MAX_BYTES: usize = 64 << 20;

    /// A source without text, for a deck that was not read from a file; `name` stands for the file in messages.
    pub fn without_text(name: &str) -> Source {
        Source { name: name.to_owned(), ..Source::default() }
    }

    pub(crate) fn set_text(&mut self, bytes: &[u8]) {
        self.text = String::from_utf8_lossy(bytes).into_owned();
        self.line_starts = line_starts(&self.text).collect();
    }

    /// Name of the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Location of the value at a JSON pointer.
    pub fn span_of(&self, pointer: &str) -> Option<Span> {
        self.entries.get(pointer).map(|place| place.value)
    }

    /// Location of the key whose value is at a JSON pointer.
    pub fn key_span_of(&self, pointer: &str) -> Option<Span> {
        self.entries.get(pointer).and_then(|place| place.key)
    }

    /// Location of the value at a JSON pointer, or of its nearest ancestor that is in the text. For an empty value or
    /// one that spans several lines, the location of its key.
    pub fn nearest_span(&self, pointer: &str) -> Option<Span> {
        let mut pointer = pointer;
        loop {
            if let Some(place) = self.entries.get(pointer) {
                let value = place.value;
                let broad = self.text.get(value.start..value.end).is_none_or(|text| text.trim().is_empty())
                    || self.text[value.start..value.end].trim_end().contains(['\n', '\r']);
                return Some(if broad { place.key.unwrap_or(value) } else { value });
            }
            pointer = &pointer[..pointer.rfind('/')?];
        }
    }

    /// Location of a part of a scalar, if the deck contains the scalar verbatim.
    pub fn span_inside(&self, pointer: &str, scalar: &str, offset: usize, length: usize) -> Option<Span> {
        let place = self.span_of(pointer)?;
        let start = place.start + self.text.get(place.start..place.end)?.find(scalar)? + offset;
        // The end of the scalar has no byte to mark; its last character is marked instead.
        let (start, length) = if length == 0 && offset == scalar.len() && offset > 0 {
            let last = scalar.chars().next_back().map_or(1, char::len_utf8);
            (start - last, last)
        } else {
            (start, length)
        };
        Some(Span { start, end: start + length })
    }

    /// How the value at a JSON pointer was computed, if it comes from a parameter.
    pub fn substitution(&self, pointer: &str) -> Option<&Substitution> {
        self.substitutions.get(pointer)
    }

    /// True if the value at a JSON pointer comes from a parameter.
    pub fn is_from_parameter(&self, pointer: &str) -> bool {
        self.substitutions.contains_key(pointer)
    }

    /// Line and column of a byte, both counted from 1; columns count characters.
    pub fn line_column(&self, offset: usize) -> (usize, usize) {
        let offset = floor_boundary(&self.text, offset);
        let line = self.line_starts.partition_point(|start| *start <= offset);
        let line_start = if line == 0 { 0 } else { self.line_starts[line - 1] };
        (line + 1, self.text[line_start..offset].chars().count() + 1)
    }

    pub(crate) fn set_substitution(&mut self, pointer: &str, substitution: Substitution) {
        self.substitutions.insert(pointer.to_owned(), substitution);
    }

    /// Records that an expression of the deck uses a parameter.
    pub(crate) fn use_parameter(&mut self, name: &str) {
        if !self.used_parameters.contains(name) {
            self.used_parameters.insert(name.to_owned());
        }
    }

    pub(crate) fn uses_parameter(&self, name: &str) -> bool {
        self.used_parameters.contains(name)
    }

    /// Copies what is known about a value and everything below it to another JSON pointer; locations in the text stay
    /// the same.
    pub(crate) fn rename(&mut self, from: &str, to: &str) {
        let moved = |pointer: &str| match pointer.strip_prefix(from) {
            Some(rest) if rest.is_empty() || rest.starts_with('/') => Some(format!("{to}{rest}")),
            _ => None,
        };
        let entries: Vec<_> =
            self.entries.iter().filter_map(|(at, place)| Some((moved(at)?, *place))).collect();
        self.entries.extend(entries);
        let values = &self.substitutions;
        let values: Vec<_> =
            values.iter().filter_map(|(at, value)| Some((moved(at)?, value.clone()))).collect();
        self.substitutions.extend(values);
        let poisoned: Vec<_> = self.poisoned.iter().filter_map(|at| moved(at)).collect();
        self.poisoned.extend(poisoned);
    }

    /// Marks a value that is already known to be wrong, so that no further fault is found in it.
    pub(crate) fn poison(&mut self, pointer: &str) {
        self.poisoned.insert(pointer.to_owned());
    }

    pub(crate) fn is_poisoned(&self, pointer: &str) -> bool {
        self.poisoned.contains(pointer)
    }

    pub(crate) fn has_poison(&self) -> bool {
        !self.poisoned.is_empty()
    }

    /// The line on which a span starts, with a mark under the span, cut off at the end of the line.
    pub(crate) fn excerpt(&self, span: Span) -> Excerpt<'_> {
        let start = floor_boundary(&self.text, span.start);
        let line_start = self.text[..start].rfind(['\n', '\r']).map_or(0, |newline| newline + 1);
        let line_end =
            self.text[start..].find(['\n', '\r']).map_or(self.text.len(), |newline| start + newline);
        let text = &self.text[line_start..line_end];
        let end = floor_boundary(&self.text, span.end).clamp(start, line_end);
        let end = start + self.text[start..end].trim_end().len();
        Excerpt { text, line: self.line_column(start).0, mark: start - line_start..end - line_start }
    }
}

/// First byte of every line except the first. As in YAML, a line ends with LF, CR LF or CR.
pub(crate) fn line_starts(text: &str) -> impl Iterator<Item = usize> {
    let breaks = text.match_indices(['\n', '\r']).map(|(at, end)| (at + 1, end));
    breaks.filter(|(next, end)| *end == "\n" || !text[*next..].starts_with('\n')).map(|(next, _)| next)
}

fn floor_boundary(text: &str, offset: usize) -> usize {
    let mut offset = offset.min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}
