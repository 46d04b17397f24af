//! The committed schema and reference are those of the deck types, and the schema accepts what the program accepts.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use jsonschema::Draft;
use mpm::deck::reference::reference_markdown;
use mpm::deck::schema::deck_schema;
use mpm::deck::source::Source;
use serde_json::Value;

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
    assert!(stored == text, "{path} is stale: write it anew with `UPDATE_SCHEMA=1 cargo test --test schema`");
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

fn accepts(path: &Path) -> bool {
    let validator = jsonschema::options().with_draft(Draft::Draft7).build(&deck_schema()).unwrap();
    let (_, value, _) = Source::read("deck", &fs::read(path).unwrap());
    validator.is_valid(&value.unwrap())
}

#[test]
fn published_schema_accepts_decks_with_parameters_and_refuses_misspelt_keys() {
    let decks = root().join("tests/decks");
    for good in ["beam.good", "rich.good", "domain_update_of_mpm.note"] {
        assert!(accepts(&decks.join(format!("{good}.yaml"))), "{good} is refused");
    }
    for bad in ["unknown_key", "unknown_top_key", "wrong_types", "ranges", "unknown_model", "missing_tag"] {
        assert!(!accepts(&decks.join(format!("{bad}.yaml"))), "{bad} is accepted");
    }
}
