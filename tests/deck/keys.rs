//! Every key of the schema, misspelt, with values of every other type, and with values outside its range: the messages
//! are those stored in `tests/decks/generated`, one line for each; the first message of each code is also stored as it
//! is rendered. `UPDATE_EXPECTED=1` rewrites them.

#![allow(clippy::unwrap_used)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use crate::remedy;
use mpm::deck::diagnostic::{Diagnostic, Gate};
use mpm::deck::load::load_text;
use mpm::deck::schema::strict_schema;
use mpm::deck::source::Source;
use serde_json::Value;

use crate::deck_text::{DeckText, last, misspelt, place, root};

/// Decks that together have every key.
fn decks() -> [DeckText; 12] {
    [
        "every_key",
        "every_key_of_a_mesh",
        "every_key_in_space",
        "every_key_of_a_path",
        "every_key_of_stages",
        "every_key_of_materials",
        "every_key_of_tools",
        "every_key_of_tools_in_space",
        "every_key_of_contact",
        "every_key_of_motion",
        "every_key_of_motion_in_stages",
        "every_key_of_water",
    ]
    .map(|name| DeckText::read(&format!("tests/decks/{name}.good.yaml")))
}

/// A key of the schema in a deck.
struct Key<'a> {
    deck: &'a DeckText,
    pointer: String,
    /// Schema of the key, with references followed.
    schema: &'static Value,
}

/// Follows references; returns the pointer in the schema.
fn resolve(home: &str) -> String {
    let node = strict_schema().pointer(home).unwrap();
    let reference = node.get("$ref").or_else(|| node.pointer("/allOf/0/$ref")).and_then(Value::as_str);
    reference.map_or_else(|| home.to_owned(), |path| resolve(path.trim_start_matches('#')))
}

fn has_type(schema: &Value, value: &Value) -> bool {
    match schema.get("type").and_then(Value::as_str) {
        Some("number") => value.is_number(),
        Some("integer") => value.is_i64() || value.is_u64(),
        Some("string") => value.is_string(),
        Some("array") => value.is_array(),
        Some("object") => value.is_object(),
        _ => false,
    }
}

/// Records, for every key of the schema that a value contains, its pointer in the deck.
fn walk(home: &str, value: &Value, at: &str, found: &mut BTreeMap<String, String>) {
    let home = resolve(home);
    let node = strict_schema().pointer(&home).unwrap();
    if let Some(choices) = node.get("anyOf").and_then(Value::as_array) {
        let schema_of =
            |choice: usize| strict_schema().pointer(&resolve(&format!("{home}/anyOf/{choice}"))).unwrap();
        let chosen = (0..choices.len()).find(|choice| has_type(schema_of(*choice), value)).unwrap();
        return walk(&format!("{home}/anyOf/{chosen}"), value, at, found);
    }
    if let Some(items) = value.as_array() {
        for (index, item) in items.iter().enumerate().filter(|_| node.get("items").is_some()) {
            walk(&format!("{home}/items"), item, &format!("{at}/{index}"), found);
        }
    }
    let Some(entries) = value.as_object() else { return };
    let mut homes = vec![home.clone()];
    for (index, branch) in node.get("allOf").and_then(Value::as_array).into_iter().flatten().enumerate() {
        let condition = branch.pointer("/if/properties").and_then(Value::as_object).unwrap();
        if condition.iter().all(|(tag, word)| entries.get(tag) == word.get("const")) {
            homes.push(format!("{home}/allOf/{index}/then"));
        }
    }
    for (key, inner) in entries {
        let pointer = format!("{at}/{key}");
        let declared = homes.iter().map(|home| format!("{home}/properties/{key}"));
        let declared = declared.filter(|home| strict_schema().pointer(home).is_some_and(is_declaration));
        let mut known = false;
        for home in declared {
            found.entry(home.clone()).or_insert_with(|| pointer.clone());
            walk(&home, inner, &pointer, found);
            known = true;
        }
        if !known {
            walk(&format!("{home}/additionalProperties"), inner, &pointer, found);
        }
    }
}

/// False for the tag of a variant, which is declared elsewhere, and for a retired key, which no deck needs.
fn is_declaration(schema: &Value) -> bool {
    schema.as_object().is_some_and(|schema| !schema.is_empty() && !schema.contains_key("deprecated"))
}

/// All keys of the schema, given by the pointers at which they are declared.
fn declared() -> BTreeSet<String> {
    fn collect(schema: &Value, home: &str, found: &mut BTreeSet<String>) {
        for (keyword, inner) in schema.as_object().into_iter().flatten() {
            let at = format!("{home}/{keyword}");
            match keyword.as_str() {
                "if" | "examples" | "default" => {}
                "properties" => {
                    for (key, property) in inner.as_object().unwrap() {
                        if is_declaration(property) {
                            found.insert(format!("{at}/{key}"));
                        }
                        collect(property, &format!("{at}/{key}"), found);
                    }
                }
                _ => collect(inner, &at, found),
            }
        }
        for (index, inner) in schema.as_array().into_iter().flatten().enumerate() {
            collect(inner, &format!("{home}/{index}"), found);
        }
    }
    let mut found = BTreeSet::new();
    collect(strict_schema(), "", &mut found);
    found
}

/// Every key of the schema at its first occurrence in the decks, in the order of the decks.
fn keys(decks: &[DeckText; 12]) -> Vec<Key<'_>> {
    let mut seen = BTreeSet::new();
    let mut keys = Vec::new();
    for deck in decks {
        let mut found = BTreeMap::new();
        walk("", &deck.value, "", &mut found);
        let mut found_in_deck: Vec<(String, String)> = found.into_iter().collect();
        found_in_deck.sort_by_key(|(_, pointer)| deck.source.key_span_of(pointer).unwrap().start);
        for (home, pointer) in found_in_deck {
            if seen.insert(home.clone()) {
                keys.push(Key { deck, pointer, schema: strict_schema().pointer(&resolve(&home)).unwrap() });
            }
        }
    }
    let missing: Vec<_> = declared().difference(&seen).cloned().collect();
    assert_eq!(missing, Vec::<String>::new(), "no deck has these keys");
    keys
}

fn compare(name: &str, found: &str) {
    let path = root().join(format!("tests/decks/generated/{name}.expected"));
    if std::env::var_os("UPDATE_EXPECTED").is_some() {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, found).unwrap();
    }
    let stored = fs::read_to_string(&path).unwrap_or_default();
    let differs = stored.lines().zip(found.lines()).find(|(a, b)| a != b);
    assert!(stored == found, "{name} differs from what is stored, first in {differs:?}");
}

/// The messages about a changed deck, with the text to which they refer.
fn messages(deck: &DeckText, text: &str) -> (Source, Vec<Diagnostic>) {
    let (source, found) = match load_text(&deck.name, text.as_bytes(), &[]) {
        Ok(loaded) => (loaded.source, loaded.notes),
        Err(failure) => (failure.source, failure.diagnostics),
    };
    found.iter().for_each(remedy::has_remedy);
    (source, found)
}

/// Messages in the form in which they are stored.
#[derive(Default)]
struct Stored {
    /// The first message of each code, as it is rendered.
    rendered: BTreeMap<&'static str, String>,
    /// A line for each message: its place, its code, what is wrong, notes, and the remedy.
    lines: String,
}

impl Stored {
    fn add(&mut self, source: &Source, found: &[Diagnostic]) {
        for found in found {
            self.rendered.entry(found.code).or_insert_with(|| found.render(source, false));
            let (line, column) = place(source, found);
            let Diagnostic { code, severity, message, notes, help, .. } = found;
            let name = last(source.name());
            let mut text = format!("{name}:{line}:{column} {severity:?} {code} {message}");
            notes.iter().for_each(|note| text.push_str(&format!("; note: {note}")));
            help.iter().for_each(|help| text.push_str(&format!("; help: {help}")));
            self.lines.push_str(&(text.replace('\n', " ") + "\n"));
        }
    }

    fn text(&self) -> String {
        let rendered: Vec<String> = self.rendered.values().map(|message| format!("{message}\n\n")).collect();
        rendered.concat() + &self.lines
    }
}

#[test]
fn every_misspelt_key_is_named() {
    let decks = decks();
    let mut all = Stored::default();
    for key in keys(&decks) {
        let (name, wrong) = (last(&key.pointer), misspelt(last(&key.pointer)));
        let text = key.deck.with_key(&key.pointer, &wrong);
        let (source, found) = messages(key.deck, &text);
        let expected = key.deck.source.line_column(key.deck.source.key_span_of(&key.pointer).unwrap().start);
        let named = found.iter().find(|d| d.code == "D006" && place(&source, d) == expected);
        let named = named.unwrap_or_else(|| panic!("{}: {found:?}", key.pointer));
        assert!(named.is_error() && named.gate == Gate::Shape);
        let help = named.help.as_ref().unwrap();
        assert!(help.contains(&format!("`{name}`")), "{}: {help}", key.pointer);
        all.add(&source, &found);
    }
    compare("misspelt_keys", &all.text());
}

/// A value of every type, and how messages call it; a key accepts at most a few of them.
const VALUES: [(&str, &str); 6] = [
    ("wrong", "the text `wrong`"),
    ("5.5", "the number 5.5"),
    ("true", "`true`"),
    ("", "an empty value"),
    ("[7]", "a list"),
    ("{a: 7}", "a mapping"),
];

/// The errors about a value: what they say, without how they call the value, and where.
fn errors(source: &Source, found: &[Diagnostic], called: &str) -> (String, String) {
    let errors = || found.iter().filter(|found| found.is_error());
    let ending = format!(", found {called}");
    let said = |found: &Diagnostic| {
        format!("{} {}", found.code, found.message.strip_suffix(&ending).unwrap_or(&found.message))
    };
    let at = |found: &Diagnostic| {
        let (line, column) = place(source, found);
        format!("{line}:{column}")
    };
    let said: Vec<String> = errors().map(said).collect();
    let said = if said.is_empty() { "accepted".to_owned() } else { said.join(" + ") };
    (said, errors().map(at).collect::<Vec<_>>().join(" + "))
}

/// The values of a key by what the errors about them say, and by where.
type ByErrors = Vec<(String, Vec<(String, Vec<&'static str>)>)>;

/// The entry of a list with this key, which is added if it does not exist.
fn entry<V: Default>(list: &mut Vec<(String, V)>, key: String) -> &mut V {
    let place = list.iter().position(|(known, _)| *known == key).unwrap_or_else(|| {
        list.push((key, V::default()));
        list.len() - 1
    });
    &mut list[place].1
}

#[test]
fn every_wrong_type_is_named() {
    let decks = decks();
    let mut all = String::new();
    for key in keys(&decks) {
        let mut by_errors = ByErrors::new();
        for (value, called) in VALUES {
            let text = key.deck.with_value(&key.pointer, value);
            let (source, found) = messages(key.deck, &text);
            let (said, at) = errors(&source, &found, called);
            entry(entry(&mut by_errors, said), at).push(value);
            let first = found.iter().find(|d| d.is_error() && d.gate == Gate::Shape);
            if let Some(first) = first {
                let line = place(&source, first).0;
                let places =
                    [key.deck.source.key_span_of(&key.pointer), key.deck.source.span_of(&key.pointer)];
                let right = places.map(|span| key.deck.source.line_column(span.unwrap().start).0);
                assert!(right.contains(&line), "{}: {value}: {first:?}", key.pointer);
            }
        }
        for (said, places) in by_errors {
            let places = places.iter().map(|(at, values)| format!("{at} [{}]", values.join(" | ")));
            let places: Vec<String> = places.collect();
            all.push_str(&format!("{} {said}: {}\n", key.pointer, places.join(", ").trim_start()));
        }
    }
    compare("wrong_types", &all);
}

/// Values outside a range: 1 beyond each of its ends, and the ends themselves if they are excluded.
fn beyond(schema: &Value) -> Vec<f64> {
    let limit = |key: &str| schema.get(key).and_then(Value::as_f64);
    let mut values = Vec::new();
    for (key, below) in
        [("minimum", true), ("exclusiveMinimum", true), ("maximum", false), ("exclusiveMaximum", false)]
    {
        let Some(limit) = limit(key).filter(|limit| *limit < 4e9) else { continue };
        if key.starts_with("exclusive") {
            values.push(limit);
        }
        values.push(if below { limit - 1.0 } else { limit + 1.0 });
    }
    values
}

#[test]
fn every_value_out_of_range_is_named() {
    let decks = decks();
    let mut all = Stored::default();
    let mut count = 0;
    for key in keys(&decks) {
        let choices = key.schema.get("anyOf").and_then(Value::as_array);
        let ranges: Vec<&Value> =
            choices.map_or_else(|| vec![key.schema], |choices| choices.iter().collect());
        for value in ranges.into_iter().flat_map(beyond) {
            let text = key.deck.with_value(&key.pointer, &value.to_string());
            let (source, found) = messages(key.deck, &text);
            let place_of_value = source.line_column(source.span_of(&key.pointer).unwrap().start);
            let named = found.iter().any(|d| d.code == "D009" && place(&source, d) == place_of_value);
            assert!(named, "{} = {value}: {found:?}", key.pointer);
            all.add(&source, &found);
            count += 1;
        }
    }
    assert!(count > 20, "{count}");
    compare("ranges", &all.text());
}
