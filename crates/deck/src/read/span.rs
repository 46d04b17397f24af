//! Locations in the text of a deck.

/// A range of bytes in the text of a deck.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Span {
    /// First byte.
    pub start: usize,
    /// Byte after the last one.
    pub end: usize,
}

/// Location of a value and, in a mapping, of its key.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EntrySpan {
    pub key: Option<Span>,
    pub value: Span,
}

/// A key as a part of a JSON pointer.
pub(crate) fn escape(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
}
