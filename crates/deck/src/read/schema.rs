//! The JSON schema of decks, generated from the deck types.
//!
//! It has two forms: the strict one, which a deck must meet once its parameters are inserted, and the published one for
//! editors, in which a number or a word may also be an expression of parameters.

mod validator;

use std::sync::OnceLock;

use schemars::generate::SchemaSettings;
use serde_json::{Map, Value, json};

pub(crate) use validator::Fault;
pub use validator::Validator;

use crate::Deck;

/// Pattern of a string that contains an expression of parameters.
const EXPRESSION: &str = r"\$\{.+\}";

/// The schema for editors, draft 07: every number and word may also be an expression of parameters, `${h/2}`, and
/// descriptions state ranges and defaults, which editors do not show.
pub fn deck_schema() -> Value {
    let mut schema = strict_schema().clone();
    describe(&mut schema);
    for definition in
        schema.get_mut("definitions").and_then(Value::as_object_mut).into_iter().flat_map(Map::values_mut)
    {
        // A definition other than a mapping needs no description: the key that uses it has one.
        if let Some(definition) = definition.as_object_mut()
            && definition.get("type").is_none_or(|kind| kind != "object")
        {
            definition.shift_remove("description");
        }
        admit_expressions(definition);
    }
    if let Some(properties) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        properties.values_mut().for_each(admit_expressions);
    }
    schema
}

/// Adds the range and the default to the description of every key, and removes what editors would show instead: the
/// title of the whole deck and the descriptions of choices between types.
fn describe(schema: &mut Value) {
    match schema {
        Value::Array(items) => items.iter_mut().for_each(describe),
        Value::Object(object) => {
            // A key named `title` contains a schema.
            if object.get("title").is_some_and(Value::is_string) {
                object.shift_remove("title");
            }
            for choice in object.get_mut("anyOf").and_then(Value::as_array_mut).into_iter().flatten() {
                choice.as_object_mut().and_then(|choice| choice.shift_remove("description"));
            }
            for (key, property) in
                object.get_mut("properties").and_then(Value::as_object_mut).into_iter().flatten()
            {
                if key != "version" {
                    describe_key(property);
                }
            }
            object.values_mut().for_each(describe);
        }
        _ => {}
    }
}

fn describe_key(property: &mut Value) {
    let range = range_in_words(property).or_else(|| range_in_words(resolve(property).pointer("/anyOf/0")?));
    // The keys of a mapping state their own defaults.
    let default = property.get("default").filter(|default| default.is_number() || default.is_string());
    let default = default.map(|default| default.as_str().map_or_else(|| shortest(default), str::to_owned));
    let Some(Value::String(description)) = property.get_mut("description") else { return };
    if let Some(range) = range {
        description.push_str(&format!(" Must be {range}."));
    }
    if let Some(default) = default {
        description.push_str(&format!(" Default: {default}."));
    }
}

/// Resolves a reference in the strict schema.
pub(crate) fn resolve(property: &Value) -> &Value {
    let reference =
        property.get("$ref").or_else(|| property.pointer("/allOf/0/$ref")).and_then(Value::as_str);
    reference.and_then(|path| strict_schema().pointer(path.trim_start_matches('#'))).unwrap_or(property)
}

/// The schema that a deck must meet once its parameters are inserted, draft 07.
pub fn strict_schema() -> &'static Value {
    static SCHEMA: OnceLock<Value> = OnceLock::new();
    SCHEMA.get_or_init(|| {
        let generator = SchemaSettings::draft07().into_generator();
        let mut schema = generator.into_root_schema_for::<Deck>().to_value();
        simplify(&mut schema);
        schema
    })
}

/// Rewrites a generated schema for messages and editors, at every depth.
fn simplify(schema: &mut Value) {
    match schema {
        Value::Array(items) => items.iter_mut().for_each(simplify),
        Value::Object(object) => {
            object.values_mut().for_each(simplify);
            forbid_null(object);
            state_integer_range(object);
            if !join_words(object) {
                split_by_tag(object);
            }
        }
        _ => {}
    }
}

/// Forbids null: an optional key is left out rather than given without a value.
fn forbid_null(object: &mut Map<String, Value>) {
    if let Some(Value::Array(types)) = object.get_mut("type") {
        types.retain(|kind| kind != "null");
        if let [only] = types.as_slice() {
            let only = only.clone();
            object.insert("type".into(), only);
        }
    }
    if let Some(Value::Array(choices)) = object.get_mut("anyOf") {
        choices.retain(|choice| choice.get("type").is_none_or(|kind| kind != "null"));
        if choices.len() == 1
            && let Some(only) = object.shift_remove("anyOf")
        {
            object.insert("allOf".into(), only);
        }
    }
    if object.get("default").is_some_and(Value::is_null) {
        object.shift_remove("default");
    }
}

/// Removes the formats `uint32` and `double`, which editors do not know; the range of a `uint32` takes its place.
fn state_integer_range(object: &mut Map<String, Value>) {
    let format = object.get("format").and_then(Value::as_str).map(str::to_owned);
    if matches!(format.as_deref(), Some("uint32" | "double")) {
        object.shift_remove("format");
    }
    if format.as_deref() == Some("uint32") {
        object.entry("minimum").or_insert(json!(0));
        object.entry("maximum").or_insert(json!(u32::MAX));
    }
}

/// Turns a choice between documented words into one list of words.
fn join_words(object: &mut Map<String, Value>) -> bool {
    let Some(Value::Array(choices)) = object.get("oneOf") else { return false };
    let mut words = Vec::new();
    let mut descriptions = Vec::new();
    for choice in choices {
        let description = choice.get("description").cloned().unwrap_or_default();
        if let Some(word) = choice.get("const") {
            words.push(word.clone());
            descriptions.push(description);
        } else if let Some(Value::Array(several)) = choice.get("enum") {
            words.extend(several.iter().cloned());
            descriptions.extend(several.iter().map(|_| description.clone()));
        } else {
            return false;
        }
    }
    object.shift_remove("oneOf");
    object.insert("type".into(), json!("string"));
    object.insert("enum".into(), words.into());
    object.insert("enumDescriptions".into(), descriptions.into());
    true
}

/// Turns a choice between tagged mappings into conditions on the tag: the faults of the chosen variant are then
/// reported instead of "none of the variants fits".
fn split_by_tag(object: &mut Map<String, Value>) -> Option<()> {
    let Value::Array(variants) = object.get("oneOf")? else { return None };
    let constant = |(key, value): (&String, &Value)| value.get("const").map(|_| key.clone());
    let tag = variants.first()?.get("properties")?.as_object()?.iter().find_map(constant)?;
    let mut words = Vec::new();
    let mut descriptions = Vec::new();
    let mut branches = Vec::new();
    for variant in variants {
        let word = variant.pointer(&format!("/properties/{tag}/const"))?.clone();
        let mut then = variant.as_object()?.clone();
        then.get_mut("properties")?.as_object_mut()?.insert(tag.clone(), json!({}));
        descriptions.push(then.shift_remove("description").unwrap_or_default());
        then.shift_remove("type");
        let condition = json!({ "properties": { tag.as_str(): { "const": word } }, "required": [tag] });
        branches.push(json!({ "if": condition, "then": then }));
        words.push(word);
    }
    object.shift_remove("oneOf");
    object.insert("type".into(), json!("object"));
    object.insert("required".into(), json!([tag]));
    let choice = json!({ "type": "string", "enum": words, "enumDescriptions": descriptions });
    object.insert("properties".into(), json!({ tag.as_str(): choice }));
    object.insert("allOf".into(), branches.into());
    Some(())
}

/// Lets every number and every listed word also be an expression, at every depth.
fn admit_expressions(schema: &mut Value) {
    let Some(object) = schema.as_object_mut() else { return };
    let is_number = matches!(object.get("type").and_then(Value::as_str), Some("number" | "integer"));
    if is_number || object.contains_key("enum") {
        let keeps = |key: &str| matches!(key, "description" | "default" | "title" | "examples");
        let (outer, inner): (Map<_, _>, Map<_, _>) =
            std::mem::take(object).into_iter().partition(|(k, _)| keeps(k));
        *object = outer;
        object.insert("anyOf".into(), json!([inner, { "type": "string", "pattern": EXPRESSION }]));
        return;
    }
    for (keyword, inner) in object.iter_mut() {
        match keyword.as_str() {
            "items" | "additionalProperties" | "then" => {
                admit_expressions(inner);
                inner.as_array_mut().into_iter().flatten().for_each(admit_expressions);
            }
            "properties" => {
                inner.as_object_mut().into_iter().flat_map(Map::values_mut).for_each(admit_expressions)
            }
            "anyOf" | "allOf" => inner.as_array_mut().into_iter().flatten().for_each(admit_expressions),
            _ => {}
        }
    }
}

/// The range that a schema allows, in words such as "above 0 and below 1".
pub(crate) fn range_in_words(schema: &Value) -> Option<String> {
    // The largest number of the type is not a meaningful bound.
    let stated = |key: &str| schema.get(key).filter(|limit| **limit != json!(u32::MAX));
    let bound = |key: &str, words: &str| stated(key).map(|limit| format!("{words} {}", shortest(limit)));
    if let (Some(low), Some(high)) = (stated("minimum"), stated("maximum"))
        && low == high
    {
        return Some(format!("always {}", shortest(low)));
    }
    let low = bound("exclusiveMinimum", "above").or_else(|| bound("minimum", "at least"));
    let high = bound("exclusiveMaximum", "below").or_else(|| bound("maximum", "at most"));
    let range: Vec<String> = low.into_iter().chain(high).collect();
    (!range.is_empty()).then(|| range.join(" and "))
}

/// A number in its shortest form: schemas have 0.0 for 0.
pub(crate) fn shortest(number: &Value) -> String {
    number.as_f64().map_or_else(|| number.to_string(), |value| crate::Parameter::Number(value).to_string())
}
