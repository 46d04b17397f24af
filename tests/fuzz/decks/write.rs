//! Decks as YAML in varying styles.

use serde_json::Value;

use crate::random::Random;

/// The deck as YAML: block or flow style, with comments, quotes, anchors and empty lines here and there.
pub fn yaml(deck: &Value, random: &mut Random) -> String {
    if random.chance(0.05) {
        return deck.to_string(); // JSON is YAML
    }
    let mut text = String::new();
    if random.chance(0.3) {
        text.push_str("# yaml-language-server: $schema=deck.schema.json\n");
    }
    block(deck, 0, &mut text, random);
    if random.chance(0.1) { text.replace('\n', "\r\n") } else { text }
}

fn block(value: &Value, indent: usize, text: &mut String, random: &mut Random) {
    let margin = " ".repeat(indent);
    match value {
        Value::Object(entries) if !entries.is_empty() => {
            for (key, inner) in entries {
                comment(indent, text, random);
                text.push_str(&format!("{margin}{}:", scalar_text(key, random)));
                nested(inner, indent, text, random);
            }
        }
        Value::Array(items) if !items.is_empty() => {
            for inner in items {
                comment(indent, text, random);
                text.push_str(&format!("{margin}-"));
                nested(inner, indent, text, random);
            }
        }
        other => {
            text.push_str(&margin);
            flow(other, text, random);
            text.push('\n');
        }
    }
}

fn nested(value: &Value, indent: usize, text: &mut String, random: &mut Random) {
    let is_empty =
        value.as_object().is_some_and(|m| m.is_empty()) || value.as_array().is_some_and(Vec::is_empty);
    let is_leaf = !(value.is_object() || value.is_array()) || is_empty;
    if is_leaf || random.chance(0.4) || indent > 40 {
        text.push(' ');
        flow(value, text, random);
        if random.chance(0.03) {
            text.push_str("   # why not");
        }
        text.push('\n');
    } else {
        text.push('\n');
        block(value, indent + 2, text, random);
    }
}

fn comment(indent: usize, text: &mut String, random: &mut Random) {
    if random.chance(0.03) {
        text.push_str(&format!("{}# a comment: {{ not }} a deck\n", " ".repeat(indent)));
    }
    if random.chance(0.02) {
        text.push('\n');
    }
}

fn flow(value: &Value, text: &mut String, random: &mut Random) {
    match value {
        Value::Object(entries) => {
            text.push('{');
            for (number, (key, inner)) in entries.iter().enumerate() {
                text.push_str(if number > 0 { ", " } else { "" });
                text.push_str(&format!("{}: ", scalar_text(key, random)));
                flow(inner, text, random);
            }
            text.push('}');
        }
        Value::Array(items) => {
            text.push('[');
            for (number, inner) in items.iter().enumerate() {
                text.push_str(if number > 0 { ", " } else { "" });
                flow(inner, text, random);
            }
            text.push(']');
        }
        Value::String(word) => text.push_str(&scalar_text(word, random)),
        Value::Null if random.chance(0.5) => text.push('~'),
        Value::Number(number) if random.chance(0.1) => {
            text.push_str(&number.as_f64().map_or_else(|| number.to_string(), |x| format!("{x:e}")));
        }
        other => text.push_str(&other.to_string()),
    }
}

/// A string, quoted where it must be and sometimes where it need not be.
fn scalar_text(word: &str, random: &mut Random) -> String {
    let is_plain = !word.is_empty()
        && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-')
        && word.starts_with(|c: char| c.is_ascii_alphabetic())
        && !["true", "false", "null", "True", "Null"].contains(&word);
    if is_plain && random.chance(0.95) {
        word.to_owned()
    } else if word.chars().all(|c| !c.is_control() && c != '\'') && random.chance(0.5) {
        format!("'{word}'")
    } else {
        Value::from(word).to_string()
    }
}
