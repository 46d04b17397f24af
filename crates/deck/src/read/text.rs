//! From the bytes of a file to the text of a deck and its value.

use serde_json::Value;

use crate::diagnostic::Diagnostic;
use crate::source::Source;
use crate::span::Span;
use crate::yaml;

impl Source {
    /// The message about a deck that is too large.
    pub(crate) fn too_large() -> Diagnostic {
        let message = format!("the deck is larger than {} MiB", Self::MAX_BYTES >> 20);
        Diagnostic::error("D001", message).help("put bulky data into a mesh file")
    }

    /// Reads the text of a deck. The value is `None` if the text is not usable YAML; the messages may contain errors
    /// even if there is a value.
    pub fn read(name: &str, bytes: &[u8]) -> (Source, Option<Value>, Vec<Diagnostic>) {
        let mut source = Source::without_text(name);
        if bytes.len() > Self::MAX_BYTES {
            return (source, None, vec![Source::too_large()]);
        }
        if is_utf16(bytes) {
            let fault = Diagnostic::error("D001", "the file is encoded in UTF-16");
            return (source, None, vec![fault.help("save the file as UTF-8")]);
        }
        // The byte order mark that some editors write is not part of the text.
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        if let Err(error) = std::str::from_utf8(bytes) {
            source.set_text(bytes);
            let fault = source.invalid_text(error.valid_up_to());
            return (source, None, vec![fault]);
        }
        source.set_text(bytes);
        if let Some(offset) = bytes.iter().position(|byte| *byte == 0) {
            let (line, _) = source.line_column(offset);
            let fault = Diagnostic::error(
                "D001",
                format!("line {line} contains a null byte: this is not a text file"),
            );
            return (source, None, vec![fault.help("give the path of a YAML file")]);
        }
        let mut diagnostics = Vec::new();
        let value = yaml::read(source.text(), &mut diagnostics).map(|document| {
            source.entries = document.entries;
            source.poisoned = document.poisoned;
            document.value
        });
        (source, value, diagnostics)
    }

    fn invalid_text(&self, offset: usize) -> Diagnostic {
        let (line, _) = self.line_column(offset);
        let mut fault = Diagnostic::error("D001", format!("line {line} is not valid UTF-8"))
            .help("save the file as UTF-8");
        fault.span = Some(Span { start: offset, end: offset + '\u{fffd}'.len_utf8() });
        fault
    }
}

/// True if the bytes begin like UTF-16 text: with its byte order mark, or with two Latin characters of two bytes each.
fn is_utf16(bytes: &[u8]) -> bool {
    matches!(bytes, [0xff, 0xfe, ..] | [0xfe, 0xff, ..])
        || matches!(bytes, [a, 0, b, 0, ..] | [0, a, 0, b, ..] if *a > 0 && *b > 0)
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
    fn every_value_and_key_has_a_location() {
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
