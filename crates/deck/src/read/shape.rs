//! The gate `shape`: every key is known, every value has its type and lies in its range.
//!
//! The schema finds all faults at once; the messages are written here, since those of the validator are about schemas,
//! not decks.

mod elsewhere;
mod remedy;
mod words;

use std::borrow::Cow;
use std::collections::HashSet;
use std::sync::OnceLock;

use boon::{ErrorKind, Type, Types};
use serde_json::{Number, Value};

use self::words::{KEYS, count_in_words, number_help, subschema};
use crate::diagnostic::Diagnostic;
use crate::quoting::{either, list, quote};
use crate::references::{existing, known_names};
use crate::schema::{Fault, Validator, resolve, shortest, strict_schema};
use crate::source::Source;
use crate::span::escape;
use crate::{AXES, Deck};
use mpm_core::formula::closest;

pub(crate) use words::written_number;

/// Largest number of passes over a deck with misspelt keys.
const PASSES: usize = 3;
/// Largest number of unknown keys that are corrected; in a deck with more, most have the same cause.
const MAX_CORRECTED: usize = 100;

/// Checks a deck against the schema once its parameters have been substituted; adds a message for every fault. Returns
/// the deck if it can be read, even if a number is out of range or a key is misspelt, so that later checks can run;
/// otherwise returns its value, with misspelt keys corrected.
pub(crate) fn check(
    mut value: Value,
    source: &mut Source,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Deck, Value> {
    let before = diagnostics.len();
    let (mut judged, mut meant) = (HashSet::new(), HashSet::new());
    // Values below a misspelt key are checked once the key is corrected.
    for _ in 0..PASSES {
        let mut gate = Gate { source, found: Vec::new(), judged, meant, unknown: Vec::new() };
        gate.validate(&value);
        let Gate { found, unknown, .. } = gate;
        (judged, meant) = (gate.judged, gate.meant);
        diagnostics.extend(found);
        if unknown.is_empty() || unknown.len() > MAX_CORRECTED {
            break;
        }
        for unknown in unknown {
            unknown.correct(&mut value, source);
        }
    }
    let is_well_formed = diagnostics.len() == before && !source.has_poison();
    match Deck::from_value(&value) {
        Ok(deck) if !source.has_poison() => Ok(deck),
        Err(error) if is_well_formed => {
            let fault = Diagnostic::error("D008", format!("the deck cannot be read: {error}"));
            diagnostics.push(fault.help("compare it with the deck reference"));
            Err(value)
        }
        _ => Err(value),
    }
}

fn validator() -> Option<&'static Validator> {
    static VALIDATOR: OnceLock<Option<Validator>> = OnceLock::new();
    VALIDATOR.get_or_init(|| Validator::new(strict_schema())).as_ref()
}

struct Gate<'a> {
    source: &'a Source,
    found: Vec<Diagnostic>,
    /// Values already reported, so that a value of the wrong type is not reported again as out of range.
    judged: HashSet<String>,
    /// Keys that a misspelt key was probably meant to be.
    meant: HashSet<String>,
    /// Keys that are unknown.
    unknown: Vec<UnknownKey>,
}

/// An unknown key and the key that was probably intended.
struct UnknownKey {
    /// Pointer to the mapping that has it.
    parent: String,
    key: String,
    meant: Option<String>,
}

impl UnknownKey {
    /// Renames the key to the intended one, or removes it.
    fn correct(self, deck: &mut Value, source: &mut Source) {
        let UnknownKey { parent, key, meant } = self;
        let Some(Value::Object(entries)) = deck.pointer_mut(&parent) else { return };
        let value = entries.shift_remove(&key);
        if let (Some(value), Some(meant)) = (value, meant)
            && !entries.contains_key(&meant)
        {
            source.rename(&format!("{parent}/{}", escape(&key)), &format!("{parent}/{}", escape(&meant)));
            entries.insert(meant, value);
        }
    }
}

impl Gate<'_> {
    fn validate(&mut self, value: &Value) {
        let Some(validator) = validator() else { return };
        self.report_all(&validator.faults(value));
    }

    /// Reports faults, unknown keys first, since a misspelt key explains a missing one.
    fn report_all(&mut self, faults: &[Fault]) {
        let is_unknown_key = |fault: &&Fault| matches!(fault.kind, ErrorKind::AdditionalProperties { .. });
        let (unknown_keys, others): (Vec<_>, Vec<_>) = faults.iter().partition(is_unknown_key);
        unknown_keys.into_iter().chain(others).for_each(|fault| self.report(fault));
    }

    fn report(&mut self, fault: &Fault) {
        let pointer = fault.pointer.as_str();
        if self.is_poisoned(pointer) {
            return;
        }
        let value = fault.value;
        let (code, message) = match &fault.kind {
            ErrorKind::AdditionalProperties { got } => {
                return self.unknown_keys(pointer, got, &allowed_keys(fault));
            }
            ErrorKind::Required { want } => {
                return want.iter().for_each(|key| self.missing_key(fault, key));
            }
            ErrorKind::AnyOf => return self.no_choice(fault),
            ErrorKind::Enum { want } => return self.unknown_word(pointer, value, want),
            ErrorKind::Type { want, .. } => ("D008", mismatch(&kind_in_words(want), value)),
            ErrorKind::MinLength { .. } => ("D008", "the text is empty".into()),
            ErrorKind::Minimum { .. } | ErrorKind::Maximum { .. } if pointer == "/version" => {
                let message = "of the deck format is unknown; this program reads version 1";
                ("D009", format!("version {value} {message}"))
            }
            ErrorKind::ExclusiveMaximum { want, .. } => ("D009", beyond(value, "not below", want)),
            ErrorKind::ExclusiveMinimum { want, .. } => ("D009", beyond(value, "not above", want)),
            ErrorKind::Maximum { want, .. } => ("D009", beyond(value, "more than", want)),
            ErrorKind::Minimum { want, .. } => ("D009", beyond(value, "less than", want)),
            ErrorKind::MinItems { .. } | ErrorKind::MaxItems { .. } => {
                ("D015", mismatch_of_count(&count_in_words(fault), value))
            }
            ErrorKind::MinProperties { .. } => ("D015", "at least one entry is needed here".into()),
            kind => ("D008", kind.to_string()),
        };
        if self.judged.insert(pointer.to_owned()) {
            let mut diagnostic = Diagnostic::at(self.source, code, pointer, message);
            let kind = expected(fault).unwrap_or_else(|| "a value described in the deck reference".into());
            diagnostic.help = Some(remedy::remedy(fault, &kind));
            diagnostic.expected = expected(fault);
            self.found.push(diagnostic);
        }
    }

    fn is_poisoned(&self, pointer: &str) -> bool {
        let parents = pointer.match_indices('/').map(|(at, _)| &pointer[..at]);
        self.source.is_poisoned(pointer) || parents.into_iter().any(|parent| self.source.is_poisoned(parent))
    }

    fn unknown_keys(&mut self, pointer: &str, unexpected: &[Cow<str>], allowed: &[String]) {
        for key in unexpected {
            let at = format!("{pointer}/{}", escape(key));
            let keys: Vec<&str> = allowed.iter().map(String::as_str).collect();
            let best = closest(key, keys.iter().copied());
            let instead = elsewhere::instead_of(key).filter(|_| best.is_none());
            let message = match instead {
                Some(_) => format!("{} is not available yet", quote(key)),
                None => format!("unknown key {}", quote(key)),
            };
            let mut diagnostic = Diagnostic::at_key(self.source, "D006", &at, message);
            diagnostic.expected = Some(format!("one of the keys {}", alternatives(allowed)));
            let meant = best.map(str::to_owned);
            self.unknown.push(UnknownKey { parent: pointer.to_owned(), key: key.to_string(), meant });
            self.meant.extend(best.map(|best| format!("{pointer}/{best}")));
            diagnostic.help = Some(if let Some(instead) = instead {
                instead.to_owned()
            } else if best.is_none()
                && key.bytes().next().is_some_and(|b| b.is_ascii_digit())
                && is_number(key)
            {
                let known = existing(KEYS, &keys);
                format!(
                    "a comma separates entries and neither groups digits nor begins decimals: write 0.5, not 0,5; {known}"
                )
            } else {
                known_names(KEYS, key, &keys)
            });
            self.found.push(diagnostic);
        }
    }

    fn missing_key(&mut self, fault: &Fault, key: &str) {
        let pointer = fault.pointer.as_str();
        if self.meant.contains(&format!("{pointer}/{key}")) {
            return;
        }
        // Without its tag no variant applies, so no unknown key can be reported except one that resembles the tag.
        if let Some(written) = misspelt_tag(fault, key) {
            let at = format!("{pointer}/{}", escape(written));
            let message = format!("unknown key {}", quote(written));
            let diagnostic = Diagnostic::at_key(self.source, "D006", &at, message);
            let help = format!("did you mean {}?", quote(key));
            self.unknown.push(UnknownKey {
                parent: pointer.to_owned(),
                key: written.to_owned(),
                meant: Some(key.to_owned()),
            });
            self.found.push(diagnostic.expected(format!("the key {}", quote(key))).help(help));
            return;
        }
        let place = if pointer.is_empty() { " at the top of the deck" } else { "" };
        let message = format!("missing key {}{place}", quote(key));
        let diagnostic = Diagnostic::at_key(self.source, "D007", pointer, message);
        let help = remedy::missing_key_help(key, subschema(fault));
        self.found.push(diagnostic.expected(format!("the key {}", quote(key))).help(help));
    }

    fn unknown_word(&mut self, pointer: &str, value: &Value, options: &[Value]) {
        let words: Vec<&str> = options.iter().filter_map(Value::as_str).collect();
        if !self.judged.insert(pointer.to_owned()) {
            return;
        }
        let known = list(words.iter().copied());
        let Some(found) = value.as_str() else {
            let message = format!("expected a word, found {}", found(value));
            let fault = Diagnostic::at(self.source, "D008", pointer, message);
            self.found.push(fault.expected(alternatives(&words)).help(format!("use one of {known}")));
            return;
        };
        let help = match (closest(found, words.iter().copied()), words.len()) {
            _ if found == "normal" && pointer.contains("/fix/") => {
                "on a `surface`, write `fix: normal` without brackets; for nodes, give the normal of a wall, such as `fix: \
                 {normal: [1, 0]}`"
                    .to_owned()
            }
            _ if pointer.ends_with("/fix") && axes_in(found).is_some() => {
                format!("write axes as a list, `fix: [{}]`", axes_in(found).unwrap_or_default())
            }
            (_, 1) => format!("the only possible word here is {known}"),
            (Some(best), _) => format!("did you mean {}? the words here are {known}", quote(best)),
            (None, _) => format!("the words here are {known}"),
        };
        let message = format!("unknown word {}", quote(found));
        let fault = Diagnostic::at(self.source, "D010", pointer, message);
        self.found.push(fault.expected(alternatives(&words)).help(help));
    }

    /// Reports a value that fits none of several choices; if its type fits one choice, the faults of this choice are
    /// reported.
    fn no_choice(&mut self, fault: &Fault) {
        let pointer = fault.pointer.as_str();
        let has_other_type =
            |fault: &Fault| fault.pointer == pointer && matches!(fault.kind, ErrorKind::Type { .. });
        if let Some(choice) = fault.choices.iter().find(|choice| !choice.iter().any(has_other_type)) {
            self.report_all(choice);
        } else if self.judged.insert(pointer.to_owned()) {
            let choices = choices_in_words(fault);
            let message = mismatch(&choices, fault.value);
            let help = number_help(fault.value, "D008")
                .unwrap_or_else(|| remedy::type_help(pointer, fault.value, &choices, subschema(fault)));
            let diagnostic = Diagnostic::at(self.source, "D008", pointer, message);
            self.found.push(diagnostic.expected(choices).help(help));
        }
    }
}

/// True for a number, such as the digits that a comma has cut off another one.
fn is_number(key: &str) -> bool {
    key.trim().replace(['d', 'D'], "e").parse::<f64>().is_ok()
}

/// The axes in a word such as `xy`, separated by commas; `None` if the word contains anything else.
fn axes_in(word: &str) -> Option<String> {
    let letters = word.chars().filter(|c| !matches!(c, ' ' | ',')).map(|c| c.to_ascii_lowercase());
    let axes: Vec<String> = letters.map(String::from).collect();
    let are_axes = !axes.is_empty() && axes.iter().all(|axis| AXES.contains(&axis.as_str()));
    are_axes.then(|| axes.join(", "))
}

/// The key that is probably the misspelt tag of a choice between variants: no variant has it.
fn misspelt_tag<'a>(fault: &'a Fault, tag: &str) -> Option<&'a str> {
    let variants = subschema(fault)?.get("allOf")?.as_array()?;
    let known = |key: &str| {
        variants.iter().any(|variant| variant.pointer(&format!("/then/properties/{}", escape(key))).is_some())
    };
    let keys = fault.value.as_object()?.keys().map(String::as_str);
    closest(tag, keys.filter(|key| !known(key)))
}

fn allowed_keys(fault: &Fault) -> Vec<String> {
    let properties = subschema(fault).and_then(|schema| schema.get("properties")).and_then(Value::as_object);
    properties.map(|properties| properties.keys().cloned().collect()).unwrap_or_default()
}

fn choices_in_words(fault: &Fault) -> String {
    let text = match fault.path {
        "/definitions/Expression" | "/definitions/RotationDeck" => "a formula",
        "/definitions/Parameter" => "a word",
        _ => "text",
    };
    let list = match fault.path {
        "/definitions/AxisSpacing" => "a list of intervals",
        "/definitions/FixDeck" => "a list of axes",
        _ => "a list with one per axis",
    };
    let choices = subschema(fault).and_then(|schema| schema.get("anyOf")).and_then(Value::as_array);
    let word = |choice| {
        let choice = resolve(choice);
        if choice.get("enum").is_some() {
            return Some("a word");
        }
        Some(match choice.get("type")?.as_str()? {
            "number" => "a number",
            "integer" => "a whole number",
            "array" => list,
            "string" => text,
            _ => "a mapping",
        })
    };
    let words: Vec<String> = choices.into_iter().flatten().filter_map(word).map(str::to_owned).collect();
    either(&words)
}

fn kind_in_words(types: &Types) -> String {
    let mut types = types.iter();
    let (Some(only), None) = (types.next(), types.next()) else { return "a value of another type".into() };
    let words = match only {
        Type::Number => "a number",
        Type::Integer => "a whole number",
        Type::String => "text",
        Type::Array => "a list `[ ... ]`",
        Type::Object => "a mapping of keys to values",
        Type::Boolean => "`true` or `false`",
        Type::Null => "nothing",
    };
    words.into()
}

fn mismatch(what: &str, value: &Value) -> String {
    format!("expected {what}, found {}", found(value))
}

fn beyond(value: &Value, relation: &str, limit: &Number) -> String {
    format!("{} is {relation} {}", shortest(value), shortest(&limit.clone().into()))
}

/// The requirement of a keyword of the schema, in words.
fn expected(fault: &Fault) -> Option<String> {
    match &fault.kind {
        ErrorKind::Type { want, .. } => Some(kind_in_words(want)),
        ErrorKind::MinItems { .. } | ErrorKind::MaxItems { .. } => Some(count_in_words(fault)),
        ErrorKind::MinProperties { .. } => Some("at least 1 entry".into()),
        _ => subschema(fault).and_then(crate::schema::range_in_words),
    }
}

/// Formats words of which one is expected: `` `a`, `b` or `c` ``.
fn alternatives<S: AsRef<str>>(words: impl IntoIterator<Item = S>) -> String {
    let words: Vec<String> = words.into_iter().map(|word| quote(word.as_ref())).collect();
    either(&words)
}

fn found(value: &Value) -> String {
    match value {
        Value::Null => "an empty value".into(),
        Value::Bool(value) => format!("`{value}`"),
        Value::Number(number) => format!("the number {number}"),
        Value::String(text) => format!("the text {}", quote(text)),
        Value::Array(_) => "a list".into(),
        Value::Object(_) => "a mapping".into(),
    }
}

fn mismatch_of_count(what: &str, value: &Value) -> String {
    format!("expected {what}, found {}", value.as_array().map_or(0, Vec::len))
}
