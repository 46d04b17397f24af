//! From YAML events to values with their locations.

#![expect(clippy::result_large_err, reason = "a fault ends the reading, so its size does not matter")]

mod scalar;

use std::collections::{HashMap, HashSet};
use std::rc::Rc;

use serde_json::{Map, Value};
use serde_yaml::granit_parser::{self, Event, Marker, Parser, ScalarStyle, Tag};

use self::scalar::{is_of_kind, plain};
pub(crate) use self::scalar::{number, number_value};
use crate::diagnostic::Diagnostic;
use crate::quoting::quote;
use crate::source::line_starts;
use crate::span::{EntrySpan, Span, escape};

/// Largest number of levels of nesting; a deck without nested regions needs about a tenth of this number.
const MAX_DEPTH: usize = 64;
/// Largest number of values in a deck.
const MAX_VALUES: usize = 2_000_000;
/// Largest number of values that aliases may add to the values written out.
const MAX_COPIED: usize = 100_000;
/// Largest number of bytes of all values of a deck, including copies by aliases, and of the pointers to these values.
/// Only a long string that is copied often, or a long key above many values, can exceed it.
const MAX_BYTES: usize = 256 << 20;

/// A deck read from text, before its keys are interpreted.
pub(crate) struct Document {
    pub value: Value,
    pub entries: HashMap<String, EntrySpan>,
    /// Values already reported as faulty.
    pub poisoned: HashSet<String>,
}

/// A value with its location. Children are shared: an alias takes no memory before the number of copies is checked.
struct Node {
    data: Data,
    span: Span,
    weight: usize,
    depth: usize,
    /// Number of bytes of the values in this node and of their JSON pointers, which start at the node.
    bytes: usize,
}

enum Data {
    Scalar(Value),
    /// A scalar already reported as faulty.
    Faulty,
    List(Vec<Rc<Node>>),
    Map(Vec<Entry>),
}

struct Entry {
    key: String,
    key_span: Span,
    value: Rc<Node>,
}

/// A list or mapping that is still open.
struct Frame {
    start: usize,
    anchor: usize,
    content: Content,
}

enum Content {
    List(Vec<Rc<Node>>),
    Map(OpenMap),
}

/// A mapping that is still open.
#[derive(Default)]
struct OpenMap {
    entries: Vec<Entry>,
    /// First location of each key.
    known: HashMap<String, Span>,
    /// The key whose value comes next.
    pending: Option<Pending>,
}

struct Pending {
    key: String,
    span: Span,
    repeated: bool,
}

/// Reads one document; `None` if the text has no usable structure.
pub(crate) fn read(text: &str, diagnostics: &mut Vec<Diagnostic>) -> Option<Document> {
    let builder =
        Builder { text, diagnostics, stack: Vec::new(), anchors: HashMap::new(), root: None, values: 0 };
    let root = match builder.run() {
        Ok(root) => root,
        Err(fault) => {
            diagnostics.push(fault);
            return None;
        }
    };
    let mut document = Document { value: Value::Null, entries: HashMap::new(), poisoned: HashSet::new() };
    document.value = document.unfold(&root, None, &mut String::new());
    Some(document)
}

impl Document {
    fn unfold(&mut self, node: &Node, key: Option<Span>, pointer: &mut String) -> Value {
        self.entries.insert(pointer.clone(), EntrySpan { key, value: node.span });
        let parent = pointer.len();
        match &node.data {
            Data::Scalar(value) => value.clone(),
            Data::Faulty => {
                self.poisoned.insert(pointer.clone());
                Value::Null
            }
            Data::List(items) => {
                let mut list = Vec::with_capacity(items.len());
                for (index, item) in items.iter().enumerate() {
                    pointer.push_str(&format!("/{index}"));
                    list.push(self.unfold(item, None, pointer));
                    pointer.truncate(parent);
                }
                Value::Array(list)
            }
            Data::Map(entries) => {
                let mut map = Map::new();
                for entry in entries {
                    pointer.push('/');
                    pointer.push_str(&escape(&entry.key));
                    let value = self.unfold(&entry.value, Some(entry.key_span), pointer);
                    map.insert(entry.key.clone(), value);
                    pointer.truncate(parent);
                }
                Value::Object(map)
            }
        }
    }
}

struct Builder<'a> {
    text: &'a str,
    diagnostics: &'a mut Vec<Diagnostic>,
    stack: Vec<Frame>,
    anchors: HashMap<usize, Rc<Node>>,
    root: Option<Rc<Node>>,
    values: usize,
}

impl<'a> Builder<'a> {
    fn run(mut self) -> Result<Rc<Node>, Diagnostic> {
        let mut documents = 0;
        let mut parser = Parser::new_from_str(self.text);
        while let Some(next) = parser.next_event() {
            let (event, place) = next.map_err(|error| self.syntax_fault(&error))?;
            let span = self.span(&place);
            match event {
                Event::DocumentStart(..) => {
                    documents += 1;
                    if documents > 1 {
                        let message = "a second document starts here; a deck is a single document";
                        return Err(fault("D004", span, message).help("remove the `---`, or split the file"));
                    }
                }
                Event::Scalar(text, style, anchor, tag) => {
                    self.scalar(&text, style, anchor, tag.as_deref(), span)?
                }
                Event::SequenceStart(_, anchor, tag) => {
                    self.open(span, anchor, tag.as_deref(), Content::List(Vec::new()))?;
                }
                Event::MappingStart(_, anchor, tag) => {
                    self.open(span, anchor, tag.as_deref(), Content::Map(OpenMap::default()))?;
                }
                Event::SequenceEnd | Event::MappingEnd => self.close(span)?,
                Event::Alias(id) => self.alias(id, span)?,
                _ => {}
            }
        }
        match self.root.take() {
            Some(root) if matches!(root.data, Data::Map(_)) => {
                if root.weight > self.values + MAX_COPIED {
                    return Err(copies_fault(root.span));
                }
                Ok(root)
            }
            Some(root) if !matches!(root.data, Data::Scalar(Value::Null)) => {
                Err(fault("D008", root.span, "a deck is a mapping of keys to values, `key: value`").help(
                    "begin with `version: 1`, and add the keys `grid`, `materials`, `bodies` and `steps`",
                ))
            }
            _ => Err(Diagnostic::error("D001", "the deck is empty")
                .help("write a deck, or start from one of those that `mpm new` lists")),
        }
    }

    fn byte(&self, marker: Marker) -> usize {
        let counted =
            || self.text.char_indices().nth(marker.index()).map_or(self.text.len(), |(byte, _)| byte);
        marker.byte_offset().unwrap_or_else(counted).min(self.text.len())
    }

    fn span(&self, place: &granit_parser::Span) -> Span {
        let start = self.byte(place.start);
        Span { start, end: self.byte(place.end).max(start) }
    }

    fn syntax_fault(&self, error: &granit_parser::ScanError) -> Diagnostic {
        let found = self.byte(*error.marker());
        let indented = self.first_tab_from(found, error.kind().to_string().contains("tab"));
        let start = indented.unwrap_or(found);
        let length = self.text[start..].chars().next().filter(|c| !c.is_control()).map_or(0, char::len_utf8);
        let line_start = self.text[..start].rfind(['\n', '\r']).map_or(0, |newline| newline + 1);
        let line = self.text[line_start..].split(['\n', '\r']).next().unwrap_or("");
        let fault =
            fault("D002", Span { start, end: start + length }, format!("this is not YAML: {}", error.kind()));
        if indented.is_some() {
            return fault.help("indent with spaces instead of tabs");
        }
        if line.contains("${") {
            return fault.help("inside `{ }` and `[ ]` an expression needs quotes: \"${h/2}\"");
        }
        let is_about_alias = fault.message.contains("anchor");
        fault.help(if is_about_alias {
            "an alias `*name` repeats a value marked earlier with `&name`: mark that value, or write it out"
        } else {
            "check this line and the one before: close all brackets, braces and quotes, and indent the keys of \
             a mapping alike"
        })
    }

    /// End of the indentation of the line that contains the byte `at`, if there is a tab in the indentation. If
    /// `further` is true, later lines are searched as well, because the parser reports some tabs at the value before
    /// them.
    fn first_tab_from(&self, at: usize, further: bool) -> Option<usize> {
        let mut start = self.text[..at].rfind(['\n', '\r']).map_or(0, |newline| newline + 1);
        for line in self.text[start..].split_inclusive(['\n', '\r']) {
            let indentation = &line[..line.len() - line.trim_start().len()];
            if indentation.contains('\t') && !line.trim().is_empty() {
                return Some(start + indentation.len());
            }
            start += line.len();
            if !further && start > at {
                break;
            }
        }
        None
    }

    fn add(&mut self, node: Rc<Node>, anchor: usize) -> Result<(), Diagnostic> {
        if anchor > 0 {
            self.anchors.insert(anchor, Rc::clone(&node));
        }
        if node.depth + self.stack.len() > MAX_DEPTH {
            return Err(nesting_fault(node.span));
        }
        let Some(frame) = self.stack.last_mut() else {
            self.root = Some(node);
            return Ok(());
        };
        match &mut frame.content {
            Content::List(items) => items.push(node),
            Content::Map(map) => match map.pending.take() {
                // A key given twice: its second value is read but not used.
                Some(Pending { repeated: true, .. }) => {}
                Some(Pending { key, span, .. }) => {
                    map.entries.push(Entry { key, key_span: span, value: node })
                }
                None => return Err(key_fault(node.span)),
            },
        }
        Ok(())
    }

    fn expects_key(&self) -> bool {
        matches!(self.stack.last(), Some(Frame { content: Content::Map(OpenMap { pending: None, .. }), .. }))
    }

    fn count(&mut self, span: Span) -> Result<(), Diagnostic> {
        self.values += 1;
        if self.values > MAX_VALUES {
            return Err(fault("D004", span, format!("the deck has more than {MAX_VALUES} values"))
                .help("put bulky data into a mesh or surface file, and name the file in the deck"));
        }
        Ok(())
    }

    fn scalar(
        &mut self,
        text: &str,
        style: ScalarStyle,
        anchor: usize,
        tag: Option<&Tag>,
        span: Span,
    ) -> Result<(), Diagnostic> {
        self.count(span)?;
        let is_plain = style == ScalarStyle::Plain;
        if self.expects_key() {
            return self.key(text, is_plain, span);
        }
        let data = match tag.map(|tag| tag.core_suffix().unwrap_or("?")) {
            None if is_plain => plain(text),
            None | Some("str") => Ok(Value::String(text.to_owned())),
            Some(kind @ ("int" | "float" | "bool" | "null")) => {
                let value = plain(text);
                if value.as_ref().is_ok_and(|value| !is_of_kind(value, kind)) {
                    let message = format!("{} does not fit its tag `!!{kind}`", quote(text));
                    return Err(fault("D004", span, message).help("remove the tag, or correct the value"));
                }
                value
            }
            Some(_) => {
                return Err(fault("D004", span, "tags are not used in decks").help("remove the `!...`"));
            }
        };
        let data = match data {
            Ok(value) => Data::Scalar(value),
            Err(message) => {
                let help = "write a finite number, between -1.8e308 and 1.8e308";
                self.diagnostics.push(fault("D005", span, message).help(help));
                Data::Faulty
            }
        };
        self.add(Rc::new(Node { data, span, weight: 1, depth: 0, bytes: text.len() }), anchor)
    }

    fn key(&mut self, text: &str, is_plain: bool, span: Span) -> Result<(), Diagnostic> {
        let is_null = is_plain && matches!(text, "" | "~");
        if is_null {
            return Err(key_fault(span));
        }
        let Some(Frame { content: Content::Map(map), .. }) = self.stack.last_mut() else { return Ok(()) };
        // Several merge keys are equivalent to a list in one of them.
        let earlier = map.known.get(text).copied().filter(|_| !(is_plain && text == "<<"));
        if earlier.is_none() {
            map.known.insert(text.to_owned(), span);
        }
        map.pending = Some(Pending { key: text.to_owned(), span, repeated: earlier.is_some() });
        // A text with this many faults is not a deck.
        if let Some(earlier) = earlier.filter(|_| self.diagnostics.len() < 1000) {
            let line = line_starts(self.text).take_while(|start| *start <= earlier.start).count() + 1;
            let diagnostic = fault("D003", span, format!("the key {} is given again", quote(text)));
            let help = format!("keep one of them: remove this one, or the one on line {line}");
            let diagnostic = diagnostic.note(format!("it is first given on line {line}"));
            self.diagnostics.push(diagnostic.help(help));
        }
        Ok(())
    }

    fn open(
        &mut self,
        span: Span,
        anchor: usize,
        tag: Option<&Tag>,
        content: Content,
    ) -> Result<(), Diagnostic> {
        self.count(span)?;
        let own = if matches!(content, Content::List(_)) { "seq" } else { "map" };
        if tag.is_some_and(|tag| tag.core_suffix() != Some(own)) {
            return Err(fault("D004", span, "tags are not used in decks").help("remove the `!...`"));
        }
        if self.expects_key() {
            return Err(fault("D004", span, "a key must be a plain word").help(
                "write the key as a word, `key: value`; if an expression is meant, quote it: \"${h/2}\"",
            ));
        }
        if self.stack.len() >= MAX_DEPTH {
            return Err(nesting_fault(span));
        }
        self.stack.push(Frame { start: span.start, anchor, content });
        Ok(())
    }

    fn close(&mut self, span: Span) -> Result<(), Diagnostic> {
        let Some(frame) = self.stack.pop() else { return Ok(()) };
        let end = frame.start + self.text[frame.start..span.end.max(frame.start)].trim_end().len();
        let span = Span { start: frame.start, end };
        let data = match frame.content {
            Content::List(items) => Data::List(items),
            Content::Map(map) => Data::Map(merge(map.entries)?),
        };
        let (weight, depth) = {
            let children: Vec<&Node> = match &data {
                Data::List(items) => items.iter().map(Rc::as_ref).collect(),
                Data::Map(entries) => entries.iter().map(|entry| entry.value.as_ref()).collect(),
                _ => Vec::new(),
            };
            let weight = children.iter().fold(1_usize, |sum, child| sum.saturating_add(child.weight));
            (weight, 1 + children.iter().map(|child| child.depth).max().unwrap_or(0))
        };
        if weight > self.values.saturating_add(MAX_COPIED) {
            return Err(copies_fault(span));
        }
        let bytes = bytes(&data);
        if bytes > MAX_BYTES {
            let message = format!("this part of the deck takes more than {} MiB", MAX_BYTES >> 20);
            return Err(fault("D004", span, message)
                .help("shorten long keys that contain many values, and long texts that aliases repeat"));
        }
        self.add(Rc::new(Node { data, span, weight, depth, bytes }), frame.anchor)
    }

    fn alias(&mut self, id: usize, span: Span) -> Result<(), Diagnostic> {
        self.count(span)?;
        if self.expects_key() {
            return Err(key_fault(span));
        }
        let Some(node) = self.anchors.get(&id).map(Rc::clone) else {
            return Err(fault("D004", span, "this alias is part of the value it refers to")
                .help("write the value out: an alias can only repeat a value that ends before it"));
        };
        self.add(node, 0)
    }
}

fn fault(code: &'static str, span: Span, message: impl Into<String>) -> Diagnostic {
    let mut diagnostic = Diagnostic::error(code, message);
    diagnostic.span = Some(span);
    diagnostic
}

/// Bytes of the values of a list or mapping, and of the pointers to these values relative to the list or mapping.
fn bytes(data: &Data) -> usize {
    let below = |part: usize, child: &Node| {
        child.bytes.saturating_add(child.weight.saturating_mul(part.saturating_add(1)))
    };
    match data {
        Data::Scalar(_) | Data::Faulty => 0,
        Data::List(items) => items.iter().fold(0, |sum: usize, item| sum.saturating_add(below(6, item))),
        Data::Map(entries) => {
            entries.iter().fold(0, |sum: usize, e| sum.saturating_add(below(e.key.len(), &e.value)))
        }
    }
}

fn copies_fault(span: Span) -> Diagnostic {
    fault("D004", span, format!("aliases copy more than {MAX_COPIED} values"))
        .help("use fewer aliases of aliases, or write out the values that differ")
}

fn nesting_fault(span: Span) -> Diagnostic {
    fault("D004", span, format!("the deck is nested more than {MAX_DEPTH} levels deep"))
        .help("close the brackets before this point, or put regions side by side in one `union`")
}

fn key_fault(span: Span) -> Diagnostic {
    fault("D004", span, "a key must be a plain word").help("write the key as a word: `key: value`")
}

/// Applies `<<` keys: keys written out win over merged ones, and the first merged mapping over later ones.
fn merge(entries: Vec<Entry>) -> Result<Vec<Entry>, Diagnostic> {
    if entries.iter().all(|entry| entry.key != "<<") {
        return Ok(entries);
    }
    let (merges, mut merged): (Vec<Entry>, Vec<Entry>) =
        entries.into_iter().partition(|entry| entry.key == "<<");
    let mut known: HashSet<String> = merged.iter().map(|entry| entry.key.clone()).collect();
    for merge in &merges {
        let parts: Vec<&Node> = match &merge.value.data {
            Data::List(parts) => parts.iter().map(Rc::as_ref).collect(),
            _ => vec![merge.value.as_ref()],
        };
        for part in parts {
            let Data::Map(additions) = &part.data else {
                return Err(fault("D004", merge.key_span, "`<<` merges mappings only")
                    .help("refer to a mapping, `<<: *name`, or to a list of mappings"));
            };
            for addition in additions {
                if known.insert(addition.key.clone()) {
                    let value = Rc::clone(&addition.value);
                    merged.push(Entry { key: addition.key.clone(), key_span: addition.key_span, value });
                }
            }
        }
    }
    Ok(merged)
}
