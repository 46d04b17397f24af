//! Gate one, shape: every key is known, every value has its type and lies in its range.
//!
//! The schema finds all faults at once; the messages are written here, since those of the validator are about schemas,
//! not decks.

mod remedy;
mod words;

use std::collections::HashSet;
use std::sync::OnceLock;

use jsonschema::error::{TypeKind, ValidationError, ValidationErrorKind};
use jsonschema::{Draft, Validator};
use serde_json::Value;

use self::words::{KEYS, count_in_words, number_help, subschema};
use super::Deck;
use super::diagnostic::Diagnostic;
use super::quoting::{either, list, quote};
use super::references::{existing, known_names};
use super::schema::{resolve, shortest, strict_schema};
use super::source::Source;
use super::span::escape;
use mpm_core::formula::closest;

pub(crate) use words::written_number;

/// Number of passes over a deck with misspelt keys.
const PASSES: usize = 3;
/// Largest number of unknown keys that are corrected; in a deck with more, most have the same cause.
const MOST_CORRECTED: usize = 100;

/// Checks a deck against the schema once its parameters have been substituted; adds a message for every fault. Returns
/// the deck if it can be read, even if a number is out of range or a key is misspelt, so that later checks can run;
/// otherwise returns the value as far as it could be read.
pub(super) fn check(
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
        if unknown.is_empty() || unknown.len() > MOST_CORRECTED {
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
    let build = || jsonschema::options().with_draft(Draft::Draft7).build(strict_schema()).ok();
    VALIDATOR.get_or_init(build).as_ref()
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
        let mut errors: Vec<_> = validator.iter_errors(value).collect();
        // Unknown keys come first, since a misspelt key explains a missing one.
        errors.sort_by_key(|error| !matches!(error.kind(), ValidationErrorKind::AdditionalProperties { .. }));
        for error in &errors {
            self.report(error);
        }
    }

    fn report(&mut self, error: &ValidationError<'_>) {
        let pointer = error.instance_path().as_str();
        if self.is_poisoned(pointer) {
            return;
        }
        let value = error.instance().as_ref();
        let (code, message) = match error.kind() {
            ValidationErrorKind::AdditionalProperties { unexpected } => {
                return self.unknown_keys(pointer, unexpected, &allowed_keys(error));
            }
            ValidationErrorKind::Required { property } => return self.missing_key(pointer, error, property),
            ValidationErrorKind::AnyOf { context } => return self.no_choice(error, pointer, context),
            ValidationErrorKind::Enum { options } => return self.unknown_word(pointer, value, options),
            ValidationErrorKind::Type { kind } => ("D008", mismatch(&kind_in_words(kind), value)),
            ValidationErrorKind::Minimum { .. } | ValidationErrorKind::Maximum { .. }
                if pointer == "/version" =>
            {
                (
                    "D009",
                    format!("version {value} of the deck format is unknown; this program reads version 1"),
                )
            }
            ValidationErrorKind::ExclusiveMaximum { limit } => {
                ("D009", format!("{} is not below {}", shortest(value), shortest(limit)))
            }
            ValidationErrorKind::ExclusiveMinimum { limit } => {
                ("D009", format!("{} is not above {}", shortest(value), shortest(limit)))
            }
            ValidationErrorKind::Maximum { limit } => {
                ("D009", format!("{} is more than {}", shortest(value), shortest(limit)))
            }
            ValidationErrorKind::Minimum { limit } => {
                ("D009", format!("{} is less than {}", shortest(value), shortest(limit)))
            }
            ValidationErrorKind::MinItems { .. } | ValidationErrorKind::MaxItems { .. } => {
                ("D015", mismatch_of_count(&count_in_words(error), value))
            }
            ValidationErrorKind::MinProperties { .. } => ("D015", "at least one entry is needed here".into()),
            _ => ("D008", error.to_string()),
        };
        if self.judged.insert(pointer.to_owned()) {
            let mut diagnostic = Diagnostic::at(self.source, code, pointer, message);
            let kind = expected(error).unwrap_or_else(|| "a value described in the deck reference".into());
            diagnostic.help = Some(remedy::remedy(error, &kind));
            diagnostic.expected = expected(error);
            self.found.push(diagnostic);
        }
    }

    fn is_poisoned(&self, pointer: &str) -> bool {
        let parents = pointer.match_indices('/').map(|(at, _)| &pointer[..at]);
        self.source.is_poisoned(pointer) || parents.into_iter().any(|parent| self.source.is_poisoned(parent))
    }

    fn unknown_keys(&mut self, pointer: &str, unexpected: &[String], allowed: &[String]) {
        for key in unexpected {
            let at = format!("{pointer}/{}", escape(key));
            let mut diagnostic =
                Diagnostic::at_key(self.source, "D006", &at, format!("unknown key {}", quote(key)));
            let keys: Vec<&str> = allowed.iter().map(String::as_str).collect();
            diagnostic.expected = Some(format!("one of the keys {}", alternatives(allowed)));
            let best = closest(key, keys.iter().copied());
            let meant = best.map(str::to_owned);
            self.unknown.push(UnknownKey { parent: pointer.to_owned(), key: key.clone(), meant });
            self.meant.extend(best.map(|best| format!("{pointer}/{best}")));
            diagnostic.help = Some(if best.is_none() && key.bytes().all(|b| b.is_ascii_digit()) {
                let known = existing(KEYS, &keys);
                format!("a comma separates entries and does not group digits; {known}")
            } else {
                known_names(KEYS, key, &keys)
            });
            self.found.push(diagnostic);
        }
    }

    fn missing_key(&mut self, pointer: &str, error: &ValidationError<'_>, property: &Value) {
        let key = property.as_str().unwrap_or_default();
        if self.meant.contains(&format!("{pointer}/{key}")) {
            return;
        }
        // Without its tag no variant applies, so no unknown key can be reported except one that resembles the tag.
        if let Some(written) = misspelt_tag(error, key) {
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
        let help = remedy::of_missing_key(key, subschema(error));
        self.found.push(diagnostic.expected(format!("the key {}", quote(key))).help(help));
    }

    fn unknown_word(&mut self, pointer: &str, value: &Value, options: &Value) {
        let words: Vec<&str> = options.as_array().into_iter().flatten().filter_map(Value::as_str).collect();
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
            _ if pointer.ends_with("/fix") && matches!(found, "x" | "y" | "z") => {
                format!("write axes as a list, `fix: [{found}]`")
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
    fn no_choice(
        &mut self,
        error: &ValidationError<'_>,
        pointer: &str,
        context: &[Vec<ValidationError<'static>>],
    ) {
        let of_other_type = |fault: &ValidationError<'_>| {
            fault.instance_path().as_str() == pointer
                && matches!(fault.kind(), ValidationErrorKind::Type { .. })
        };
        if let Some(branch) = context.iter().find(|branch| !branch.iter().any(of_other_type)) {
            for fault in branch {
                self.report(fault);
            }
        } else if self.judged.insert(pointer.to_owned()) {
            let value = error.instance().as_ref();
            let choices = choices_in_words(error);
            let message = mismatch(&choices, value);
            let schema = subschema(error);
            let help = number_help(value, "D008")
                .unwrap_or_else(|| remedy::of_type(pointer, value, &choices, schema));
            let diagnostic = Diagnostic::at(self.source, "D008", pointer, message);
            self.found.push(diagnostic.expected(choices).help(help));
        }
    }
}

/// The key that is probably the misspelt tag of a choice between variants: no variant has it.
fn misspelt_tag<'e>(error: &'e ValidationError<'_>, tag: &str) -> Option<&'e str> {
    let variants = subschema(error)?.get("allOf")?.as_array()?;
    let known = |key: &str| {
        variants.iter().any(|variant| variant.pointer(&format!("/then/properties/{}", escape(key))).is_some())
    };
    let keys = error.instance().as_object()?.keys().map(String::as_str);
    closest(tag, keys.filter(|key| !known(key)))
}

fn allowed_keys(error: &ValidationError<'_>) -> Vec<String> {
    let properties = subschema(error).and_then(|schema| schema.get("properties")).and_then(Value::as_object);
    properties.map(|properties| properties.keys().cloned().collect()).unwrap_or_default()
}

fn choices_in_words(error: &ValidationError<'_>) -> String {
    let text = match error.schema_path().as_str() {
        "/definitions/Expression/anyOf" | "/definitions/RotationDeck/anyOf" => "a formula",
        "/definitions/Parameter/anyOf" => "a word",
        _ => "text",
    };
    let list = match error.schema_path().as_str() {
        "/definitions/AxisSpacing/anyOf" => "a list of intervals",
        "/definitions/FixDeck/anyOf" => "a list of axes",
        _ => "a list with one per axis",
    };
    let choices = subschema(error).and_then(|schema| schema.get("anyOf")).and_then(Value::as_array);
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

fn kind_in_words(kind: &TypeKind) -> String {
    match kind {
        TypeKind::Single(kind) => match kind.as_str() {
            "number" => "a number".into(),
            "integer" => "a whole number".into(),
            "string" => "text".into(),
            "array" => "a list `[ ... ]`".into(),
            "object" => "a mapping of keys to values".into(),
            "boolean" => "`true` or `false`".into(),
            other => other.into(),
        },
        TypeKind::Multiple(_) => "a value of another type".into(),
    }
}

fn mismatch(what: &str, value: &Value) -> String {
    format!("expected {what}, found {}", found(value))
}

/// The requirement of a keyword of the schema, in words.
fn expected(error: &ValidationError<'_>) -> Option<String> {
    match error.kind() {
        ValidationErrorKind::Type { kind } => Some(kind_in_words(kind)),
        ValidationErrorKind::MinItems { .. } | ValidationErrorKind::MaxItems { .. } => {
            Some(count_in_words(error))
        }
        ValidationErrorKind::MinProperties { .. } => Some("at least 1 entry".into()),
        _ => subschema(error).and_then(super::schema::range_in_words),
    }
}

/// Formats words of which one is expected: `` `a`, `b` or `c` ``.
fn alternatives<S: AsRef<str>>(words: impl IntoIterator<Item = S>) -> String {
    let words: Vec<String> = words.into_iter().map(|word| quote(word.as_ref())).collect();
    either(&words)
}

fn found(value: &Value) -> String {
    match value {
        Value::Null => "nothing".into(),
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
