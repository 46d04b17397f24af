//! Names that refer to nothing, even in a deck that is still incomplete.

use serde_json::Value;

use crate::diagnostic::Diagnostic;
use crate::quoting::{list, quote};
use crate::source::Source;
use mpm_core::formula::closest;

/// The word for a kind of entry of the deck.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Noun<'a> {
    /// In the singular.
    pub one: &'a str,
    /// In the plural.
    pub several: &'a str,
}

impl<'a> Noun<'a> {
    /// The word in the singular and in the plural.
    pub const fn new(one: &'a str, several: &'a str) -> Self {
        Noun { one, several }
    }
}

/// Help for a name that refers to no entry of the deck: the most similar name, if any is similar, and the names of all
/// entries that exist.
pub fn known_names(kind: Noun, name: &str, names: &[&str]) -> String {
    match (closest(name, names.iter().copied()), names.len()) {
        (_, 0) => format!("the deck has no {}", kind.several.replace(" and ", " or ")),
        (Some(best), 1) => format!("did you mean {}?", quote(best)),
        (Some(best), _) => format!("did you mean {}? {}", quote(best), existing(kind, names)),
        (None, _) => existing(kind, names),
    }
}

/// States which names exist: `` the only key is `a` ``, `` the keys are `a` and `b` ``.
pub(crate) fn existing(Noun { one, several }: Noun, names: &[&str]) -> String {
    let known = list(names.iter().copied());
    if names.len() == 1 { format!("the only {one} is {known}") } else { format!("the {several} are {known}") }
}

/// Message about a name that refers to no entry of the deck.
pub(crate) fn unknown_reference(
    source: &Source,
    pointer: &str,
    kind: Noun,
    name: &str,
    names: Vec<&str>,
) -> Diagnostic {
    let help = known_names(kind, name, &names);
    let message = format!("there is no {} {}", kind.one, quote(name));
    let mut diagnostic = Diagnostic::at(source, "D018", pointer, message).help(help);
    if !names.is_empty() {
        diagnostic.expected = Some(format!("one of the {} {}", kind.several, list(names)));
    }
    diagnostic
}

/// Finds names of materials and bodies that refer to nothing, in a deck that cannot be read as a whole.
pub(crate) fn dangling(deck: &Value, source: &Source) -> Vec<Diagnostic> {
    let materials: Option<Vec<&str>> =
        deck["materials"].as_object().map(|materials| materials.keys().map(String::as_str).collect());
    // If a body has no name yet, any name may refer to it.
    let bodies: Option<Vec<&str>> = deck["bodies"]
        .as_array()
        .and_then(|bodies| bodies.iter().map(|body| body["name"].as_str()).collect());
    let mut found = Vec::new();
    let mut check = |pointer: String, kind: Noun, known: &Option<Vec<&str>>, name: &Value| {
        if let (Some(known), Some(name)) = (known, name.as_str())
            && !known.contains(&name)
            && !source.is_poisoned(&pointer)
        {
            found.push(unknown_reference(source, &pointer, kind, name, known.clone()));
        }
    };
    let each = |section: &Value| section.as_array().cloned().unwrap_or_default().into_iter().enumerate();
    let (material, body) = (Noun::new("material", "materials"), Noun::new("body", "bodies"));
    for (k, entry) in each(&deck["bodies"]) {
        check(format!("/bodies/{k}/material"), material, &materials, &entry["material"]);
    }
    for (k, entry) in each(&deck["boundary_conditions"]) {
        let at = format!("/boundary_conditions/{k}/nodes/outer_layer");
        check(at, body, &bodies, &entry["nodes"]["outer_layer"]);
    }
    for (k, entry) in each(&deck["loads"]) {
        check(format!("/loads/{k}/body"), body, &bodies, &entry["body"]);
        for (j, name) in each(&entry["bodies"]) {
            check(format!("/loads/{k}/bodies/{j}"), body, &bodies, &name);
        }
    }
    for (k, entry) in each(&deck["output"]["probes"]) {
        check(format!("/output/probes/{k}/body"), body, &bodies, &entry["body"]);
    }
    found
}
