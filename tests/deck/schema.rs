//! The committed schema and reference match the deck types, and the schema accepts what the program accepts.

#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "what was compared belongs to the test")]

use std::fs;
use std::path::{Path, PathBuf};

use mpm::deck::diagnostic::{Diagnostic, Gate};
use mpm::deck::load::load_text;
use mpm::deck::reference::reference_markdown;
use mpm::deck::schema::{Validator, deck_schema, strict_schema};
use mpm::deck::source::Source;
use serde_json::{Value, json};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn check_fresh(path: &str, text: &str) {
    let file = root().join(path);
    if std::env::var_os("UPDATE_SCHEMA").is_some() {
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(&file, text).unwrap();
    }
    let stored = fs::read_to_string(&file).unwrap_or_default();
    assert!(
        stored == text,
        "{path} is stale: write it anew with `UPDATE_SCHEMA=1 cargo test --release --test deck schema`"
    );
}

#[test]
fn committed_schema_is_fresh() {
    check_fresh("schema/deck.schema.json", &(serde_json::to_string_pretty(&deck_schema()).unwrap() + "\n"));
}

#[test]
fn committed_reference_is_fresh() {
    check_fresh("docs/deck.md", &reference_markdown());
}

#[test]
fn reference_mentions_every_key() {
    fn keys(schema: &Value, found: &mut Vec<String>) {
        if let Some(object) = schema.as_object() {
            if let Some(properties) = object.get("properties").and_then(Value::as_object) {
                found.extend(properties.keys().cloned());
            }
            object.values().for_each(|inner| keys(inner, found));
        }
        schema.as_array().into_iter().flatten().for_each(|inner| keys(inner, found));
    }
    let mut found = Vec::new();
    keys(&deck_schema(), &mut found);
    assert!(found.len() > 50);
    let reference = reference_markdown();
    for key in found {
        assert!(
            reference.contains(&format!("| `{key}` |")) || reference.contains(&format!("### `{key}: ")),
            "`{key}` is missing"
        );
    }
}

/// Visits every key that the schema declares.
fn each_key(schema: &Value, visit: &mut dyn FnMut(&str, &Value)) {
    for (keyword, inner) in schema.as_object().into_iter().flatten() {
        if keyword == "properties" {
            for (key, property) in inner.as_object().unwrap() {
                // The tag of a variant is declared elsewhere.
                if property.as_object().is_some_and(|property| !property.is_empty()) {
                    visit(key, property);
                }
            }
        }
        if keyword != "if" && keyword != "examples" && keyword != "default" {
            each_key(inner, visit);
        }
    }
    schema.as_array().into_iter().flatten().for_each(|inner| each_key(inner, visit));
}

#[test]
fn every_key_has_a_description_a_unit_and_examples_that_are_valid() {
    let schema = strict_schema();
    let (mut keys, mut examples) = (0, 0);
    each_key(schema, &mut |key, property| {
        keys += 1;
        let is_tag = property.get("enumDescriptions").is_some();
        let description = property.get("description").and_then(Value::as_str).unwrap_or_default();
        assert!(is_tag || description.len() > 10, "{key}: {property}");
        if property["type"] == "number" {
            assert!(description.contains('['), "{key} has no unit: {description}");
        }
        let mut own = property.clone();
        own["definitions"] = schema["definitions"].clone();
        let validator = Validator::new(&own).unwrap();
        for example in property.get("examples").and_then(Value::as_array).into_iter().flatten() {
            assert!(validator.accepts(example), "{key}: {example}");
            examples += 1;
        }
    });
    assert!(keys > 60 && examples > 30, "{keys} {examples}");
}

fn validator() -> Validator {
    Validator::new(&deck_schema()).unwrap()
}

/// True if the program accepts the shape of a deck; `None` if the deck is not YAML and so has no shape, or if the fault
/// is in a parameter, whose value a schema cannot know.
fn accepted_by_program(path: &Path, text: &[u8]) -> Option<bool> {
    let failure = match load_text(&path.display().to_string(), text, &[]) {
        Ok(_) => return Some(true),
        Err(failure) => failure,
    };
    let errors: Vec<&Diagnostic> = failure.diagnostics.iter().filter(|d| d.is_error()).collect();
    let is_from_parameter = |d: &Diagnostic| {
        let pointer = d.pointer.as_deref().unwrap_or_default();
        let starts = pointer.match_indices('/').map(|(at, _)| &pointer[..at]).chain([pointer]);
        starts.into_iter().any(|pointer| failure.source.is_from_parameter(pointer))
    };
    if errors.iter().any(|d| d.gate == Gate::Text) {
        return None;
    }
    let shape: Vec<_> = errors.into_iter().filter(|d| d.gate == Gate::Shape).collect();
    if shape.iter().any(|d| is_from_parameter(d)) { None } else { Some(shape.is_empty()) }
}

#[test]
fn schema_and_program_agree_about_the_shape_of_every_deck() {
    let validator = validator();
    let (mut accepted, mut refused, mut neither) = (0, 0, 0);
    for folder in ["inputs", "inputs/block", "tests/decks", "tests/decks/build"] {
        for entry in fs::read_dir(root().join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|extension| extension != "yaml") {
                continue;
            }
            let text = fs::read(&path).unwrap();
            let Some(by_program) = accepted_by_program(&path, &text) else {
                neither += 1;
                continue;
            };
            let (_, value, _) = Source::read("deck", &text);
            let by_schema = validator.accepts(&value.unwrap());
            assert_eq!(by_schema, by_program, "{}: schema, program", path.display());
            *(if by_program { &mut accepted } else { &mut refused }) += 1;
        }
    }
    println!("{accepted} accepted and {refused} refused by both; {neither} without a shape to compare");
    assert!(accepted > 80 && refused > 25, "{accepted} {refused}");
}

#[test]
fn published_schema_accepts_expressions_of_parameters() {
    let accepts = |law: &str, young: Value| {
        let deck = json!({
            "version": 1,
            "grid": {"type": "structured", "origin": [0, "${h}"], "size": [1, 1], "spacing": "${h/2}"},
            "materials": {"m": {"model": law, "young": young, "poisson": 0}},
            "bodies": [{"name": "b", "material": "m", "shape": {"type": "cells"}, "method": "${method}"}],
            "steps": {"count": "${n}"},
        });
        validator().accepts(&deck)
    };
    for young in [json!("${E}"), json!("${2*E}"), json!(1)] {
        assert!(accepts("hencky", young.clone()), "{young}");
    }
    // Other texts are formulas of the position.
    assert!(accepts("hencky", json!("2*E + X")));
    for young in [json!(-1), json!(null), json!([1])] {
        assert!(!accepts("hencky", young.clone()), "{young}");
    }
    // The keys of a material are unknown if a parameter selects its law.
    assert!(accepts("${law}", json!(null)));
}
