//! Remedies for values that do not meet the schema, from the description of their keys in the schema.

use boon::ErrorKind;
use serde_json::Value;

use super::words::{KEYS, count_in_words, number_help, range_help, subschema};
use crate::quoting::{list, quote};
use crate::references::existing;
use crate::schema::{Fault, resolve, shortest};

/// The remedy for a value that does not meet a keyword of the schema.
pub(super) fn remedy(fault: &Fault, kind: &str) -> String {
    let value = fault.value;
    let pointer = fault.pointer.as_str();
    match &fault.kind {
        _ if pointer == "/version" => "write `version: 1`".to_owned(),
        ErrorKind::MinItems { .. } | ErrorKind::MaxItems { .. } => count_help(fault),
        ErrorKind::MinProperties { .. } => {
            "add an entry by name, such as `clay: {model: hencky, young: 1e6, poisson: 0.3}`".to_owned()
        }
        _ => range_help(fault)
            .or_else(|| number_help(value, "D008"))
            .unwrap_or_else(|| type_help(pointer, value, kind, subschema(fault))),
    }
}

/// Help for a value of the wrong type; `schema` is the schema of the value, if it is known.
pub(super) fn type_help(pointer: &str, value: &Value, kind: &str, schema: Option<&Value>) -> String {
    let sample = schema.and_then(|schema| sample(pointer, schema));
    let such_as = sample.map(|sample| format!(", such as {sample}")).unwrap_or_default();
    match value {
        Value::Null => format!("write {kind} here{such_as}"),
        Value::Number(number) if kind.contains("whole number") => {
            let below = number.as_f64().unwrap_or_default().floor();
            format!("write {kind}, such as {below} or {}", below + 1.0)
        }
        Value::Number(_) | Value::Bool(_) if kind == "text" => {
            format!("put it in quotes: `\"{value}\"`")
        }
        Value::String(_) | Value::Number(_) if kind.starts_with("a list `") && may_be_single(schema) => {
            let entry = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            format!("write it as a list of one entry: `[{}]`", quote(&entry).trim_matches('`'))
        }
        _ if kind.starts_with("a mapping") => {
            let keys = schema.and_then(|schema| schema.get("properties")).and_then(Value::as_object);
            let known: Option<Vec<&str>> = keys.map(|keys| keys.keys().map(String::as_str).collect());
            let known = known.map(|known| format!("; {}", existing(KEYS, &known))).unwrap_or_default();
            format!("write `key: value` on lines below it, or `{{key: value}}` beside it{known}")
        }
        _ => format!("write {kind} instead{such_as}"),
    }
}

/// True if a list may have a single entry.
fn may_be_single(schema: Option<&Value>) -> bool {
    schema.and_then(|schema| schema.get("minItems")?.as_u64()).is_none_or(|least| least <= 1)
}

/// Help for a list with the wrong number of entries.
fn count_help(fault: &Fault) -> String {
    let pointer = fault.pointer.as_str();
    let key = last_key(pointer);
    let what = match key {
        "curve" if !pointer.ends_with("curve") => {
            return "write each entry as a pair of a time and a factor: `curve: [[0, 0], [1, 1]]`".to_owned();
        }
        "curve" => {
            return "give at least two pairs of a time and a factor: `curve: [[0, 0], [1, 1]]`".to_owned();
        }
        "bodies" if pointer == "/bodies" => {
            return "add a body: `- {name: ..., material: ..., shape: {...}, points_per_cell: 2}`".to_owned();
        }
        "of" => "list the regions to combine, `of: [{type: ...}, {type: ...}]`".to_owned(),
        _ => format!("write {}", count_in_words(fault)),
    };
    match subschema(fault).and_then(|schema| sample(pointer, schema)) {
        Some(sample) => format!("{what}, such as {sample}"),
        None => what,
    }
}

/// Help for a missing key; `schema` is the schema of the mapping.
pub(super) fn missing_key_help(key: &str, schema: Option<&Value>) -> String {
    let Some(property) = schema.and_then(|schema| schema.get("properties")?.get(key)) else {
        return format!("add the key {}", quote(key));
    };
    let words = resolve(property).get("enum").and_then(Value::as_array);
    if let Some(words) = words {
        return format!("add {}, one of {}", quote(key), list(words.iter().filter_map(Value::as_str)));
    }
    let meaning = property.get("description").and_then(Value::as_str);
    let meaning = meaning.map(|text| text.split([';', ':']).next().unwrap_or(text).trim_end_matches('.'));
    let meaning = meaning.map(|meaning| format!(" ({})", meaning.replace('\n', " "))).unwrap_or_default();
    match sample(&format!("/{key}"), property) {
        Some(sample) => format!("add it, for example {sample}{meaning}"),
        None if key == "version" => format!("add `version: 1`{meaning}"),
        None => format!("add `{key}: ...`{meaning}"),
    }
}

/// A key with an example of its value, in backquotes.
fn sample(pointer: &str, schema: &Value) -> Option<String> {
    let example = schema.get("examples")?.get(0)?;
    let example = match example {
        Value::Number(_) => shortest(example),
        Value::String(text) => text.clone(),
        Value::Array(items) if items.iter().all(|item| item.is_number() || item.is_string()) => {
            let items: Vec<String> = items
                .iter()
                .map(|item| item.as_str().map_or_else(|| shortest(item), str::to_owned))
                .collect();
            format!("[{}]", items.join(", "))
        }
        other => other.to_string(),
    };
    Some(format!("`{}: {example}`", last_key(pointer)))
}

/// The last part of a pointer that is a key rather than an index.
fn last_key(pointer: &str) -> &str {
    let is_number = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    pointer.rsplit('/').find(|part| !is_number(part)).unwrap_or_default()
}
