//! Every deck in `tests/decks` is refused when it is read, and every deck in `tests/decks/build` when its first load
//! step is set up, with exactly the messages stored beside it. There are two exceptions: a deck with `good` in its name
//! has no messages, and a deck with `note` in its name has messages that are not errors.
//!
//! A line `# set: name=value` in a deck is an override. `UPDATE_EXPECTED=1` rewrites the stored messages.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use crate::remedy;
use mpm::deck::diagnostic::{Diagnostic, render_all, sort};
use mpm::deck::load::load_text;
use mpm::deck::ready::{ready, ready_on};
use mpm::memory::{Bound, Memory};
use mpm::ranks::{Ranks, threads};

/// Folders of decks. Like the paths in messages, they are relative to the root of the sources, where tests run.
const READ: &str = "tests/decks";
const BUILT: &str = "tests/decks/build";

fn decks(folder: &str) -> Vec<PathBuf> {
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

/// The messages of a deck, and true if it was refused.
fn messages(path: &Path) -> (String, bool) {
    let text = fs::read(path).unwrap();
    let name = path.file_name().unwrap().to_string_lossy();
    match load_text(&name, &text, &overrides(&text)) {
        Ok(loaded) => {
            loaded.notes.iter().for_each(remedy::has_remedy);
            (render_all(&loaded.source, &loaded.notes, false), false)
        }
        Err(failure) => {
            assert!(
                failure.diagnostics.iter().any(Diagnostic::is_error),
                "{name} is refused without an error"
            );
            failure.diagnostics.iter().for_each(remedy::has_remedy);
            (failure.render(false), true)
        }
    }
}

/// The machine assumed in messages about memory.
const MEMORY: Memory = Memory { limit: 16 << 30, available: 16 << 30, bound: Bound::Machine };

/// The messages of a readable deck, up to its first load step, and true if it was refused.
fn messages_of_model(path: &Path) -> (String, bool) {
    let text = fs::read(path).unwrap();
    let name = path.file_name().unwrap().to_string_lossy();
    let mut loaded = load_text(&name, &text, &overrides(&text)).unwrap_or_else(|failure| panic!("{failure}"));
    loaded.directory = path.parent().unwrap().to_owned();
    let built = ready(&loaded, Some(MEMORY)).map(|ready| ready.notes);
    let refused = built.is_err();
    let mut found = built.unwrap_or_else(|found| found);
    assert_eq!(found.iter().any(Diagnostic::is_error), refused, "{name}");
    found.extend(loaded.notes);
    found.iter().for_each(remedy::has_remedy);
    sort(&mut found);
    (render_all(&loaded.source, &found, false), refused)
}

/// The messages of a readable deck on a rank, up to its first load step.
fn messages_of_rank(path: &Path, ranks: &Ranks) -> String {
    let text = fs::read(path).unwrap();
    let name = path.file_name().unwrap().to_string_lossy();
    let mut loaded = load_text(&name, &text, &overrides(&text)).unwrap_or_else(|failure| panic!("{failure}"));
    loaded.directory = path.parent().unwrap().to_owned();
    let built = ready_on(ranks, &loaded, Some(MEMORY)).map(|ready| ready.notes);
    let mut found = built.unwrap_or_else(|found| found);
    found.extend(loaded.notes);
    sort(&mut found);
    // The memory and the possible number of points depend on the ranks; each rank counts its own nodes on the axis.
    let depends = |found: &Diagnostic| {
        found.code == "D036"
            || ["are possible", "can move off the axis"].iter().any(|end| found.message.contains(end))
    };
    found.retain(|found| !depends(found));
    render_all(&loaded.source, &found, false)
}

/// A deck has the same messages on each of several ranks as on one, whichever rank forms the points that are at fault.
#[test]
fn messages_do_not_depend_on_ranks() {
    for path in decks(BUILT) {
        let alone = messages_of_rank(&path, &Ranks::default());
        for messages in threads::run(3, |ranks| messages_of_rank(&path, &ranks)) {
            assert_eq!(messages, alone, "{}", path.display());
        }
    }
}

/// Compares all messages with the stored ones; returns the number of decks that are refused.
fn compare(folder: &str, messages: fn(&Path) -> (String, bool)) -> usize {
    let update = std::env::var_os("UPDATE_EXPECTED").is_some();
    let mut faults = Vec::new();
    let mut bad = 0;
    for path in decks(folder) {
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
    bad
}

#[test]
fn bad_decks_are_refused_with_the_stored_messages() {
    assert!(compare(READ, messages) >= 100);
}

#[test]
fn decks_that_do_not_fit_their_mesh_are_refused_with_the_stored_messages() {
    assert!(compare(BUILT, messages_of_model) >= 30);
}

#[test]
fn stored_messages_belong_to_a_deck() {
    for entry in [READ, BUILT].iter().flat_map(|folder| fs::read_dir(folder).unwrap()) {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "expected") {
            assert!(path.with_extension("yaml").exists(), "{} belongs to no deck", path.display());
        }
    }
}
