//! Every deck in `tests/decks` is refused with exactly the messages stored beside it, unless its name says `good`.
//!
//! A line `# set: name=value` in a deck is an override. `UPDATE_EXPECTED=1` rewrites the stored messages.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use mpm::deck::diagnostic::{Diagnostic, render_all};
use mpm::deck::load::load_text;

fn decks() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/decks");
    let mut decks: Vec<PathBuf> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "yaml"))
        .collect();
    decks.sort();
    decks
}

fn overrides(text: &[u8]) -> Vec<(String, String)> {
    String::from_utf8_lossy(text)
        .lines()
        .filter_map(|line| line.strip_prefix("# set: ")?.split_once('='))
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
        .collect()
}

/// The messages of a deck, and whether it was refused.
fn messages(path: &Path) -> (String, bool) {
    let text = fs::read(path).unwrap();
    let name = path.file_name().unwrap().to_string_lossy();
    match load_text(&name, &text, &overrides(&text)) {
        Ok(loaded) => (render_all(&loaded.source, &loaded.notes, false), false),
        Err(failure) => {
            assert!(
                failure.diagnostics.iter().any(Diagnostic::is_error),
                "{name} is refused without an error"
            );
            (failure.render(false), true)
        }
    }
}

#[test]
fn bad_decks_are_refused_with_the_stored_messages() {
    let update = std::env::var_os("UPDATE_EXPECTED").is_some();
    let mut faults = Vec::new();
    let mut bad = 0;
    for path in decks() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let (found, refused) = messages(&path);
        if name.ends_with(".good.yaml") || name.ends_with(".note.yaml") {
            if refused {
                faults.push(format!("{name} is refused:\n{found}"));
            }
        } else {
            bad += 1;
            if !refused {
                faults.push(format!("{name} is accepted"));
            }
        }
        let stored = path.with_extension("expected");
        if name.ends_with(".good.yaml") {
            if !found.is_empty() {
                faults.push(format!("{name} has messages:\n{found}"));
            }
            continue;
        }
        if update {
            fs::write(&stored, &found).unwrap();
        }
        match fs::read_to_string(&stored) {
            Err(_) => {
                faults.push(format!("{name} has no stored messages; write them with UPDATE_EXPECTED=1"))
            }
            Ok(expected) if expected != found => {
                faults.push(format!("{name}: expected\n{expected}\nfound\n{found}"));
            }
            Ok(_) => {}
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(bad >= 40, "the gallery has only {bad} bad decks");
}

#[test]
fn stored_messages_belong_to_a_deck() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/decks");
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "expected") {
            assert!(path.with_extension("yaml").exists(), "{} belongs to no deck", path.display());
        }
    }
}
