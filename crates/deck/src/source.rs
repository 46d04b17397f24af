//! The text of a deck with the place of every key and value in it.
//!
//! The YAML events become a [`serde_json::Value`] and a map from JSON pointers to places, so that every later check
//! can be a function of plain values and still point at the text.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::ops::Range;

use serde_json::Value;

use super::diagnostic::{Diagnostic, quote};
use super::yaml;

/// A range of bytes in the text of a deck.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// Byte after the last one.
    pub end: usize,
}

/// Where a value and, in a mapping, its key stand.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub key: Option<Span>,
    pub value: Span,
}

/// A value that was computed from parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Substitution {
    /// What the deck says, for example `${h/2}`.
    pub written: String,
    /// What it became.
    pub became: String,
    /// The overrides it depends on, for example `h=0.25`.
    pub overrides: Vec<String>,
}

impl Substitution {
    /// The fact in words.
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

/// The text of a deck and the places of its values.
#[derive(Debug, Clone, Default)]
pub struct Source {
    name: String,
    text: String,
    /// First byte of every line but the first.
    line_starts: Vec<usize>,
    places: HashMap<String, Place>,
    substitutions: BTreeMap<String, Substitution>,
    used_parameters: HashSet<String>,
    poisoned: HashSet<String>,
}

/// A piece of the text made of whole lines, with a mark in it.
pub(super) struct Excerpt<'a> {
    pub text: &'a str,
    pub line: usize,
    pub mark: Range<usize>,
}

impl Source {
    /// Largest deck, in bytes; bulky data does not belong in a deck.
    pub(super) const MAX_BYTES: usize = 64 << 20;

    /// A source without text, for a deck that was not read from a file; `name` stands for the file in messages.
    pub fn without_text(name: &str) -> Source {
        Source { name: name.to_owned(), ..Source::default() }
    }

    /// Reads the text of a deck. The value is missing where the text is no usable YAML at all; the messages may
    /// hold errors even where it is there.
    pub fn read(name: &str, bytes: &[u8]) -> (Source, Option<Value>, Vec<Diagnostic>) {
        let mut source = Source::without_text(name);
        if bytes.len() > Self::MAX_BYTES {
            let message = format!("the deck is larger than {} MiB", Self::MAX_BYTES >> 20);
            let fault = Diagnostic::error("D001", message).help("bulky data belongs into a mesh file");
            return (source, None, vec![fault]);
        }
        if is_utf16(bytes) {
            let fault = Diagnostic::error("D001", "the text has the encoding UTF-16");
            return (source, None, vec![fault.help("save the file with the encoding UTF-8")]);
        }
        // The mark that some editors put in front of a text is no part of it.
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if let Err(error) = std::str::from_utf8(bytes) {
            source.set_text(bytes);
            let fault = source.invalid_text(error.valid_up_to());
            return (source, None, vec![fault]);
        }
        source.set_text(bytes);
        if let Some(offset) = bytes.iter().position(|byte| *byte == 0) {
            let (line, _) = source.line_column(offset);
            let fault =
                Diagnostic::error("D001", format!("line {line} holds a zero byte: this is not a text file"));
            return (source, None, vec![fault.help("give the path of a YAML file")]);
        }
        let mut diagnostics = Vec::new();
        let value = yaml::read(&source.text, &mut diagnostics).map(|document| {
            source.places = document.places;
            source.poisoned = document.poisoned;
            document.value
        });
        (source, value, diagnostics)
    }

    fn set_text(&mut self, bytes: &[u8]) {
        self.text = String::from_utf8_lossy(bytes).into_owned();
        self.line_starts = self.text.match_indices('\n').map(|(newline, _)| newline + 1).collect();
    }

    fn invalid_text(&self, offset: usize) -> Diagnostic {
        let (line, _) = self.line_column(offset);
        let mut fault = Diagnostic::error("D001", format!("line {line} is not valid UTF-8"))
            .help("save the file with the encoding UTF-8");
        fault.span = Some(Span { start: offset, end: offset + '\u{fffd}'.len_utf8() });
        fault
    }

    /// Name of the file.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The whole text.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Place of the value at a JSON pointer.
    pub fn span_of(&self, pointer: &str) -> Option<Span> {
        self.places.get(pointer).map(|place| place.value)
    }

    /// Place of the key whose value is at a JSON pointer.
    pub fn key_span_of(&self, pointer: &str) -> Option<Span> {
        self.places.get(pointer).and_then(|place| place.key)
    }

    /// Place of the value at a JSON pointer, or of the nearest parent that is in the text. An empty value and a
    /// value over several lines are shown by their key.
    pub fn nearest_span(&self, pointer: &str) -> Option<Span> {
        let mut pointer = pointer;
        loop {
            if let Some(place) = self.places.get(pointer) {
                let value = place.value;
                let broad = self.text.get(value.start..value.end).is_none_or(|text| text.trim().is_empty())
                    || self.text[value.start..value.end].trim_end().contains('\n');
                return Some(if broad { place.key.unwrap_or(value) } else { value });
            }
            pointer = &pointer[..pointer.rfind('/')?];
        }
    }

    /// Place of a part of a scalar, if the scalar stands in the deck letter by letter.
    pub fn span_inside(&self, pointer: &str, scalar: &str, offset: usize, length: usize) -> Option<Span> {
        let place = self.span_of(pointer)?;
        let start = place.start + self.text.get(place.start..place.end)?.find(scalar)? + offset;
        // The end of a text has no byte to mark; the last one is marked instead.
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

    /// Whether the value at a JSON pointer comes from a parameter.
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

    pub(super) fn set_substitution(&mut self, pointer: &str, substitution: Substitution) {
        self.substitutions.insert(pointer.to_owned(), substitution);
    }

    /// Notes that an expression of the deck uses a parameter.
    pub(super) fn use_parameter(&mut self, name: &str) {
        if !self.used_parameters.contains(name) {
            self.used_parameters.insert(name.to_owned());
        }
    }

    pub(super) fn uses_parameter(&self, name: &str) -> bool {
        self.used_parameters.contains(name)
    }

    /// Gives a value and all below it another place in the deck, where it keeps its place in the text.
    pub(super) fn rename(&mut self, from: &str, to: &str) {
        let moved = |pointer: &str| match pointer.strip_prefix(from) {
            Some(rest) if rest.is_empty() || rest.starts_with('/') => Some(format!("{to}{rest}")),
            _ => None,
        };
        let places: Vec<_> =
            self.places.iter().filter_map(|(at, place)| Some((moved(at)?, *place))).collect();
        self.places.extend(places);
        let values = &self.substitutions;
        let values: Vec<_> =
            values.iter().filter_map(|(at, value)| Some((moved(at)?, value.clone()))).collect();
        self.substitutions.extend(values);
        let poisoned: Vec<_> = self.poisoned.iter().filter_map(|at| moved(at)).collect();
        self.poisoned.extend(poisoned);
    }

    /// Marks a value that is already known to be wrong, so that no further fault is found in it.
    pub(super) fn poison(&mut self, pointer: &str) {
        self.poisoned.insert(pointer.to_owned());
    }

    pub(super) fn is_poisoned(&self, pointer: &str) -> bool {
        self.poisoned.contains(pointer)
    }

    pub(super) fn has_poison(&self) -> bool {
        !self.poisoned.is_empty()
    }

    /// The line in which a place starts; the mark is cut at its end.
    pub(super) fn excerpt(&self, span: Span) -> Excerpt<'_> {
        let start = floor_boundary(&self.text, span.start);
        let line_start = self.text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        let line_end =
            self.text[start..].find(['\n', '\r']).map_or(self.text.len(), |newline| start + newline);
        let text = &self.text[line_start..line_end];
        let end = floor_boundary(&self.text, span.end).clamp(start, line_end);
        let end = start + self.text[start..end].trim_end().len();
        Excerpt { text, line: self.line_column(start).0, mark: start - line_start..end - line_start }
    }
}

/// Whether a text begins as UTF-16 does: with its mark, or with a letter of ASCII in two bytes.
fn is_utf16(bytes: &[u8]) -> bool {
    matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..])
        || matches!(bytes, [a, 0, b, 0, ..] | [0, a, 0, b, ..] if *a > 0 && *b > 0)
}

fn floor_boundary(text: &str, offset: usize) -> usize {
    let mut offset = offset.min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}

/// A key as a part of a JSON pointer.
pub(super) fn escape(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn read(text: &str) -> (Source, Value) {
        let (source, value, diagnostics) = Source::read("deck.yaml", text.as_bytes());
        assert_eq!(diagnostics, []);
        (source, value.unwrap())
    }

    #[test]
    fn every_value_and_key_has_a_place() {
        let (source, value) = read("a: 1\nb:\n  - {c/d: 'x y', é: 2}\n  - 3\n");
        assert_eq!(value, serde_json::json!({"a": 1, "b": [{"c/d": "x y", "é": 2}, 3]}));
        let show = |span: Option<Span>| span.map(|span| &source.text()[span.start..span.end]);
        assert_eq!(show(source.span_of("/a")), Some("1"));
        assert_eq!(show(source.key_span_of("/b")), Some("b"));
        assert_eq!(show(source.span_of("/b/0/c~1d")), Some("'x y'"));
        assert_eq!(show(source.key_span_of("/b/0/é")), Some("é"));
        assert_eq!(show(source.span_of("/b/1")), Some("3"));
        assert_eq!(show(source.span_inside("/b/0/c~1d", "x y", 2, 1)), Some("y"));
        assert_eq!(show(source.nearest_span("/b/1/z/9")), Some("3"));
        assert_eq!(source.line_column(source.span_of("/b/0/é").unwrap().start), (3, 21));
    }

    #[test]
    fn scalars_follow_the_core_schema() {
        let (_, value) = read(
            "v: [1e6, 12e6, -100e3, 1., .5, -3, 0x1F, 1_0, no, yes, true, False, ~, '1', \"2\", +4, 1e-3, !!str 5, 0.0]",
        );
        assert_eq!(
            value["v"],
            serde_json::json!([
                1_000_000, 12_000_000, -100_000, 1, 0.5, -3, 31, "1_0", "no", "yes", true, false, null, "1",
                "2", 4, 0.001, "5", 0
            ])
        );
    }

    #[test]
    fn anchors_and_merge_keys_are_applied() {
        let (_, value) =
            read("a: &a {x: 1, y: 2}\nb:\n  <<: *a\n  y: 3\nc: *a\nd: {<<: [*a, {z: 4, x: 9}]}\n");
        assert_eq!(value["b"], serde_json::json!({"x": 1, "y": 3}));
        assert_eq!(value["c"], serde_json::json!({"x": 1, "y": 2}));
        assert_eq!(value["d"], serde_json::json!({"x": 1, "y": 2, "z": 4}));
    }

    #[test]
    fn hostile_texts_are_refused_quickly() {
        let laughs = (1..40).fold("a0: &a0 [x, x]\n".to_owned(), |text, i| {
            let previous = format!("*a{}", i - 1);
            text + &format!("a{i}: &a{i} [{previous}, {previous}, {previous}]\n")
        });
        let chain = (1..5000)
            .fold("a0: &a0 [x]\n".to_owned(), |text, i| text + &format!("a{i}: &a{i} [*a{}]\n", i - 1));
        for text in
            [laughs, chain, "[".repeat(100_000), "a: &a [*a]".into(), "- ".repeat(100_000), "{".repeat(3000)]
        {
            let (source, value, diagnostics) = Source::read("deck.yaml", text.as_bytes());
            assert!(
                value.is_none() && diagnostics.iter().all(Diagnostic::is_error) && !diagnostics.is_empty()
            );
            assert!(!diagnostics[0].render(&source, false).is_empty());
        }
    }
}
