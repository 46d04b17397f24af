//! The pages that explain messages: the examples produce the code, and the corrected examples do not.
//!
//! Blocks of a page contain some keys of a deck; the others come from the deck in `docs/errors/README.md`. A block of
//! shell commands gives overrides of parameters.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::path::PathBuf;

use mpm::codes::{PAGES, Page};
use mpm::deck::diagnostic::Diagnostic;
use mpm::deck::load::load_text;
use mpm::deck::ready::ready;
use mpm::memory::Memory;
use mpm::solver::Silent;

/// Codes that no deck can produce on every machine: no memory, no space on the disk, no compiler for a law.
const WITHOUT_EXAMPLE: [&str; 16] = [
    "D036", "D062", "D063", "S008", "S011", "S012", "S013", "S015", "S016", "S018", "S019", "S020", "R001",
    "R002", "W004", "W020",
];

/// The code blocks in a language from a heading to the next heading, or to the end.
fn blocks<'a>(text: &'a str, language: &str, heading: &str) -> Vec<&'a str> {
    let Some((_, section)) = text.split_once(heading) else { return Vec::new() };
    let section = section.split("\n## ").next().unwrap();
    let opening = format!("```{language}\n");
    section.split(&opening).skip(1).map(|rest| rest.split("```").next().unwrap()).collect()
}

/// The top-level keys of a deck, each with its text.
fn sections(deck: &str) -> Vec<(&str, String)> {
    let mut sections: Vec<(&str, String)> = Vec::new();
    for line in deck.lines() {
        if line.starts_with(|c: char| c.is_ascii_alphabetic()) {
            sections.push((line.split(':').next().unwrap(), String::new()));
        }
        if let Some((_, text)) = sections.last_mut() {
            text.push_str(&format!("{line}\n"));
        }
    }
    sections
}

/// The common deck with the keys of a page in place of its own; a page without top-level keys is a complete deck.
fn complete(common: &str, page: &str) -> String {
    let given = sections(page);
    if given.is_empty() {
        return page.to_owned();
    }
    let is_given = |key: &str| given.iter().any(|(name, _)| *name == key);
    let taken = |key: &str| is_given(key) || (key == "steps" && is_given("stages"));
    let rest: String =
        sections(common).into_iter().filter(|(key, _)| !taken(key)).map(|(_, text)| text).collect();
    rest + page
}

/// The overrides in shell commands.
fn overrides(commands: &str) -> Vec<(String, String)> {
    let words: Vec<&str> = commands.split_whitespace().collect();
    let values = words.windows(2).filter(|pair| pair[0] == "--set").map(|pair| pair[1]);
    values.map(|value| value.split_once('=').unwrap()).map(|(n, v)| (n.to_owned(), v.to_owned())).collect()
}

/// Codes of all messages about a deck: first of errors, then of warnings and notes.
type Codes = [BTreeSet<&'static str>; 2];

/// The codes of all messages of an analysis, run to its end.
fn codes(deck: &str, set: &[(String, String)]) -> Codes {
    let mut codes = Codes::default();
    let mut take = |found: &[Diagnostic]| {
        for diagnostic in found {
            codes[usize::from(!diagnostic.is_error())].insert(diagnostic.code);
        }
    };
    let mut loaded = match load_text("block.yaml", deck.as_bytes(), set) {
        Ok(loaded) => loaded,
        Err(failure) => {
            take(&failure.diagnostics);
            return codes;
        }
    };
    take(&loaded.notes);
    loaded.directory = PathBuf::from("inputs/new");
    match ready(&loaded, Memory::this_machine()) {
        Err(found) => take(&found),
        Ok(mut ready) => {
            take(&ready.notes);
            let nothing = ready.analysis.beginning();
            match ready.analysis.run(nothing, &mut Silent) {
                Ok(reached) => {
                    codes[1].extend(reached.summary.warnings.iter().map(|warning| warning.code.text()))
                }
                Err(error) => {
                    codes[0].insert(error.code().unwrap());
                }
            }
        }
    }
    codes
}

#[test]
fn examples_produce_their_code_and_corrected_ones_do_not() {
    let readme = include_str!("../../docs/errors/README.md");
    let common = blocks(readme, "yaml", "# Messages")[0];
    assert_eq!(codes(common, &[]), Codes::default(), "the deck of all examples is good");
    let mut faults = Vec::new();
    for Page { code, text } in PAGES {
        let under = |heading: &str| {
            let decks = blocks(text, "yaml", heading);
            let set = blocks(text, "sh", heading).iter().flat_map(|block| overrides(block)).collect();
            (complete(common, decks.first().unwrap_or(&common)), set, decks.len())
        };
        let (wrong, set, shown): (String, Vec<(String, String)>, usize) = under("\n## Example\n");
        if WITHOUT_EXAMPLE.contains(code) {
            assert!(text.contains("\n## What to do\n") && !text.contains("\n## Example\n"), "{code}");
            continue;
        }
        assert!(shown == 1 || !set.is_empty(), "{code} has no example");
        let [errors, remarks] = codes(&wrong, &set);
        let only = errors.iter().all(|found| found == code);
        if !only || !(errors.contains(code) || remarks.contains(code)) {
            faults.push(format!("{code}: the example gives {errors:?} and {remarks:?}"));
        }
        let (corrected, set, _) = under("\n## Fixed\n");
        let [errors, remarks] = codes(&corrected, &set);
        if !errors.is_empty() || remarks.contains(code) || corrected == wrong && !text.contains("--set") {
            faults.push(format!("{code}: the corrected example gives {errors:?} and {remarks:?}"));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn the_list_of_messages_is_complete() {
    let readme = include_str!("../../docs/errors/README.md");
    let listed: Vec<&str> = readme.lines().filter(|line| line.starts_with("- [")).collect();
    let expected: Vec<String> =
        PAGES.iter().map(|page| format!("- [{0}]({0}.md): {1}", page.code, page.title())).collect();
    assert_eq!(listed, expected);
}
