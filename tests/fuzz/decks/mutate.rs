//! Random changes to decks, as values and as text.

use serde_json::{Value, json};

use super::generate::{Generator, odd};
use crate::random::Random;

/// Pointers to all values except the deck itself.
fn pointers(value: &Value, at: &str, found: &mut Vec<String>) {
    let mut visit = |part: &str, inner: &Value| {
        let pointer = format!("{at}/{}", part.replace('~', "~0").replace('/', "~1"));
        pointers(inner, &pointer, found);
        found.push(pointer);
    };
    match value {
        Value::Object(entries) => entries.iter().for_each(|(key, inner)| visit(key, inner)),
        Value::Array(items) => items.iter().enumerate().for_each(|(k, inner)| visit(&k.to_string(), inner)),
        _ => {}
    }
}

/// Changes one thing.
pub fn change(deck: &mut Value, generator: &Generator, random: &mut Random) {
    let mut places = Vec::new();
    pointers(deck, "", &mut places);
    if places.is_empty() {
        return;
    }
    let pointer = random.pick(&places).clone();
    let other = random.pick(&places).clone();
    let (parent, last) = pointer.rsplit_once('/').unwrap_or(("", &pointer));
    let key = last.replace("~1", "/").replace("~0", "~");
    match random.below(20) {
        // Another value that the schema allows at this pointer.
        0..=7 => {
            if let Some(home) = generator.home_of(deck, &pointer) {
                let value = generator.value(&home, &key, 4, random);
                put(deck, &pointer, value);
            }
        }
        8 => {
            let value = odd(random);
            put(deck, &pointer, value);
        }
        9 => match deck.pointer_mut(parent) {
            Some(Value::Object(entries)) => drop(entries.shift_remove(&key)),
            Some(Value::Array(items)) => drop(key.parse::<usize>().map(|k| items.remove(k))),
            _ => {}
        },
        // Repeats an entry of a list once, or many times.
        10 | 11 => {
            let times = if random.chance(0.05) { 300 } else { 1 };
            let copy = deck.pointer(&pointer).cloned();
            if let (Some(Value::Array(items)), Some(copy)) = (deck.pointer_mut(parent), copy) {
                items.extend(std::iter::repeat_n(copy, times));
            }
        }
        12 => {
            if let Some(value) = deck.pointer(&other).cloned() {
                put(deck, &pointer, value);
            }
        }
        13..=16 => number(deck, &pointer, random),
        17 => {
            let name = random.pick(&["unheard_of", "young", "type", "x", "fix", "name", ""]).to_string();
            if let Some(Value::Object(entries)) = deck.pointer_mut(parent) {
                entries.insert(name, odd(random));
            }
        }
        _ => region(deck, &pointer, random),
    }
}

fn put(deck: &mut Value, pointer: &str, value: Value) {
    if let Some(place) = deck.pointer_mut(pointer) {
        *place = value;
    }
}

fn number(deck: &mut Value, pointer: &str, random: &mut Random) {
    let Some(place) = deck.pointer_mut(pointer) else { return };
    let Some(old) = place.as_f64() else { return };
    let new = match random.below(9) {
        0 => -old,
        1 => 0.0,
        2 => old * 10f64.powi(random.below(12) as i32 - 6),
        3 => old + 1.0,
        4 => old - 1.0,
        5 => old.next_up(),
        6 => old.next_down(),
        7 => old * 0.5,
        _ => old * 2.0,
    };
    *place = if new.fract() == 0.0 && new.abs() < 1e15 { json!(new as i64) } else { json!(new) };
}

/// Wraps a region in other regions.
fn region(deck: &mut Value, pointer: &str, random: &mut Random) {
    let Some(place) = deck.pointer_mut(pointer) else { return };
    let is_region = place.get("type").is_some_and(|kind| kind != "structured") && place.get("name").is_none();
    if !is_region {
        return;
    }
    let times = if random.chance(0.1) { 40 } else { 1 };
    for _ in 0..times {
        let hole = json!({"type": "circle", "center": [random.below(4), random.below(4)], "radius": 0.5});
        *place = if random.chance(0.5) {
            json!({"type": "union", "of": [place.take(), hole]})
        } else {
            json!({"type": "difference", "from": place.take(), "minus": [hole]})
        };
    }
}

/// Pieces of YAML that mean something.
const PIECES: [&str; 15] = [
    "&a ",
    "*a ",
    "<<: *a\n",
    "!!str ",
    "---\n",
    "...\n",
    "? ",
    "|\n",
    "\u{feff}",
    "${h}",
    "\"",
    "\n\n  ",
    "%YAML 1.1\n",
    "{{{{{{{{",
    "- - - - -",
];

/// Damages text in the ways that typing, copying and transfer do.
pub fn damage(text: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..1 + random.below(3) {
        if text.is_empty() {
            return;
        }
        let at = random.below(text.len());
        match random.below(9) {
            0 => text[at] = random.next() as u8,
            1 => drop(text.remove(at)),
            2..=4 => text.insert(at, *random.pick(b" :,[]{}\"'#&*!|>-\n\t$%@`?~\r\0")),
            5 => text.truncate(at),
            6 => {
                let end = (at + random.below(60)).min(text.len());
                let piece = text[at..end].to_vec();
                let to = random.below(text.len());
                text.splice(to..to, piece);
            }
            7 => {
                let piece = *random.pick(&PIECES);
                text.splice(at..at, piece.bytes());
            }
            _ => {
                let end = (at + random.below(30)).min(text.len());
                text.drain(at..end);
            }
        }
    }
}
