//! Every single change to a key of the decks in `inputs`: removed, misspelt, with a value of another type, with the
//! other sign. Each is refused with a message at the right line, or accepted for a reason that is stated here.
//!
//! The counts and all that is accepted are stored in `tests/decks/generated/mutations.expected`, which
//! `UPDATE_EXPECTED=1` rewrites.

#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the counts belong to the test")]

use std::collections::BTreeMap;
use std::fs;

use crate::long::is_long;
use crate::remedy;
use mpm::deck::diagnostic::{Diagnostic, Gate, Severity};
use mpm::deck::load::load_text;
use mpm::deck::ready::ready;
use mpm::deck::source::Source;
use serde_json::Value;

use crate::deck_text::{DeckText, last, misspelt, parent, place, root};

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Change {
    Removed,
    Misspelt,
    OtherType,
    OtherSign,
}

/// Outcome of a change.
enum Verdict {
    Refused(Vec<Diagnostic>),
    Accepted(Vec<Diagnostic>),
}

fn judge(name: &str, text: &str) -> Verdict {
    let verdict = verdict(name, text);
    let (Verdict::Refused(found) | Verdict::Accepted(found)) = &verdict;
    found.iter().for_each(remedy::has_remedy);
    verdict
}

fn verdict(name: &str, text: &str) -> Verdict {
    let mut loaded = match load_text(name, text.as_bytes(), &[]) {
        Ok(loaded) => loaded,
        Err(failure) => return Verdict::Refused(failure.diagnostics),
    };
    match ready(&loaded, None) {
        Ok(ready) => {
            loaded.notes.extend(ready.notes);
            Verdict::Accepted(loaded.notes)
        }
        Err(found) => Verdict::Refused(found),
    }
}

/// The types of values, each with an example.
const TYPES: [(&str, &str); 6] = [
    ("number", "5.5"),
    ("text", "wrong"),
    ("truth", "true"),
    ("nothing", ""),
    ("list", "[7]"),
    ("mapping", "{a: 7}"),
];

fn type_of(value: &Value) -> &'static str {
    match value {
        Value::Number(_) => "number",
        Value::String(_) => "text",
        Value::Bool(_) => "truth",
        Value::Null => "nothing",
        Value::Array(_) => "list",
        Value::Object(_) => "mapping",
    }
}

/// The type of a value once its parameters are substituted.
fn final_type(deck: &DeckText, pointer: &str) -> &'static str {
    match deck.at(pointer) {
        Value::String(text) if text.starts_with("${") && text.ends_with('}') => {
            let name = &text[2..text.len() - 1];
            let parameter = deck.value.pointer(&format!("/parameters/{name}"));
            parameter.map_or("number", |_| final_type(deck, &format!("/parameters/{name}")))
        }
        value => type_of(value),
    }
}

/// A value with the other sign; `None` if it has no sign.
fn with_other_sign(deck: &DeckText, pointer: &str) -> Option<String> {
    if final_type(deck, pointer) != "number" && !is_formula(pointer) {
        return None;
    }
    let span = deck.source.span_of(pointer)?;
    let written = &deck.text[span.start..span.end];
    Some(match deck.at(pointer) {
        Value::Number(_) => written.strip_prefix('-').map_or_else(|| format!("-{written}"), str::to_owned),
        Value::String(text) => match text.strip_prefix("${") {
            Some(rest) => format!("\"${{-({})}}\"", &rest[..rest.len() - 1]),
            None => format!("\"-({text})\""),
        },
        _ => return None,
    })
}

fn is_formula(pointer: &str) -> bool {
    matches!(last(pointer), "ux" | "uy" | "uz") || matches!(last(parent(pointer)), "force" | "where")
}

/// All changes of a kind to one key: what the key becomes, and the text of the deck.
fn changes(deck: &DeckText, pointer: &str, change: Change) -> Vec<(String, String)> {
    match change {
        Change::Removed => vec![("removed".to_owned(), deck.without(pointer))],
        Change::Misspelt => {
            let Some(key) = deck.key(pointer) else { return Vec::new() };
            let wrong = misspelt(key);
            vec![(format!("called {wrong}"), deck.with_key(pointer, &wrong))]
        }
        Change::OtherSign => {
            let changed = with_other_sign(deck, pointer);
            changed.into_iter().map(|value| (value.clone(), deck.with_value(pointer, &value))).collect()
        }
        Change::OtherType => {
            let own = final_type(deck, pointer);
            let others = TYPES.iter().filter(|(name, _)| *name != own);
            others.map(|(name, value)| ((*name).to_owned(), deck.with_value(pointer, value))).collect()
        }
    }
}

/// Reasons for which a change is accepted: the change, the deck (`*` for any), the pointer with `*` for one part of it,
/// what the key becomes (`*` for anything), and why it is fine. The first that fits counts; each must be needed.
const REASONS: &[(Change, &str, &str, &str, &str)] = &[
    (Change::Removed, "*", "/title", "*", "optional"),
    (Change::Removed, "*", "/analysis", "*", "optional"),
    (Change::Removed, "*", "/analysis/*", "*", "optional"),
    (Change::Removed, "*", "/solver", "*", "optional"),
    (Change::Removed, "*", "/solver/*", "*", "optional"),
    (Change::Removed, "*", "/output", "*", "optional"),
    (Change::Removed, "*", "/output/*", "*", "optional"),
    (Change::Removed, "*", "/output/probes/*", "*", "optional"),
    (Change::Removed, "*", "/bodies/*/method", "*", "optional: CPDI2"),
    (Change::Removed, "*", "/bodies/*/domain_update", "*", "optional: corners"),
    (Change::Removed, "*", "/bodies/*/strain", "*", "optional: standard"),
    (Change::Removed, "beam", "/materials/*/density", "*", "optional: nothing weighs"),
    (Change::Removed, "*", "/loads", "*", "optional; a warning says that nothing loads the bodies"),
    (
        Change::Removed,
        "beam",
        "/boundary_conditions/1/nodes/*",
        "*",
        "selects a line of nodes instead of one",
    ),
    (Change::Removed, "compaction", "/boundary_conditions/0", "*", "the other side still holds the body"),
    (Change::Removed, "compaction", "/boundary_conditions/1", "*", "the other side still holds the body"),
    (Change::Removed, "annulus", "/boundary_conditions/*", "*", "the other rim still holds the body"),
    (Change::Removed, "annulus", "/boundary_conditions/*/fix/*", "*", "the other rim still holds the body"),
    (Change::Removed, "*", "/bodies/*/shape/group", "*", "optional: all cells"),
    (Change::Removed, "cantilever", "/bodies/*/points_per_cell", "*", "the mesh has triangles only"),
    (Change::Removed, "*", "/materials/*/hardening_modulus", "*", "optional: no hardening"),
    (Change::Removed, "block/block", "/boundary_conditions/0", "*", "the floor still holds the block"),
    (Change::Removed, "block/block", "/boundary_conditions/1", "*", "the floor still holds the block"),
    (
        Change::Removed,
        "block/block",
        "/boundary_conditions/2/fix/*",
        "*",
        "the planes of symmetry still hold the block",
    ),
    (Change::Removed, "*", "/output/probes/*/count", "*", "optional: 1, or all that are equally near"),
    (Change::Removed, "cylinder", "/boundary_conditions/0", "*", "a ring needs no support along the radius"),
    (Change::OtherType, "*", "/boundary_conditions/*/ux", "number", "a formula may be a number"),
    (Change::OtherType, "*", "/boundary_conditions/*/uy", "number", "a formula may be a number"),
    (Change::OtherType, "*", "/loads/*/force/*", "number", "a formula may be a number"),
    (Change::OtherType, "*", "/loads/*/where/*", "number", "a formula may be a number"),
    (Change::OtherType, "*", "/boundary_conditions/*/fix/*", "nothing", "YAML: a comma may end a list"),
    (Change::OtherType, "beam", "/output/probes/0", "nothing", "YAML: an empty list"),
    (Change::OtherSign, "*", "*", "-0", "zero has no sign"),
    (Change::OtherSign, "*", "/materials/*/poisson", "*", "may be negative, down to -1"),
    (Change::OtherSign, "*", "/loads/*/total/*", "*", "a force may point either way"),
    (Change::OtherSign, "*", "/loads/*/acceleration/*", "*", "a force may point either way"),
    (Change::OtherSign, "*", "/loads/*/force/*", "*", "a force may point either way"),
    (Change::OtherSign, "*", "/loads/*/where/*", "*", "a value in a formula may have either sign"),
    (Change::OtherSign, "*", "/boundary_conditions/*/ux", "*", "a displacement may point either way"),
    (Change::OtherSign, "*", "/boundary_conditions/*/uy", "*", "a displacement may point either way"),
    (Change::OtherSign, "domains", "/parameters/*", "*", "a value in a formula may have either sign"),
    (Change::OtherSign, "shear", "/parameters/gamma", "*", "a value in a formula may have either sign"),
    (Change::OtherSign, "cylinder", "/parameters/to", "*", "a value in a formula may have either sign"),
    (
        Change::OtherSign,
        "*",
        "/boundary_conditions/*/nodes/box/min/*",
        "*",
        "a box may reach beyond the grid",
    ),
    (Change::Removed, "*", "/bodies/*/shape/vertices/*", "*", "three corners are left"),
    (
        Change::Removed,
        "cone/revolved",
        "/boundary_conditions/1/fix/0",
        "*",
        "a ring needs no support along the radius",
    ),
    (Change::Removed, "cone/solid", "/bodies/*/shape/of/*", "*", "one region is left"),
    (
        Change::Removed,
        "cone/solid",
        "/boundary_conditions/0",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "cone/solid",
        "/boundary_conditions/1",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "cone/solid",
        "/boundary_conditions/2/fix/0",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "cone/solid",
        "/boundary_conditions/2/fix/1",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/annulus",
        "/boundary_conditions/*",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/annulus",
        "/boundary_conditions/0/fix/*",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/annulus",
        "/boundary_conditions/1/ux",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/annulus",
        "/boundary_conditions/1/uy",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/collapse",
        "/boundary_conditions/0",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/collapse",
        "/boundary_conditions/1/fix/0",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/column",
        "/boundary_conditions/0",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/column",
        "/boundary_conditions/1",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/footing",
        "/boundary_conditions/*",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/footing",
        "/boundary_conditions/2/fix/*",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/footing",
        "/boundary_conditions/3/ux",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/footing",
        "/boundary_conditions/3/uy",
        "*",
        "the other conditions still hold the body",
    ),
    (
        Change::Removed,
        "new/beam",
        "/boundary_conditions/1/nodes/*",
        "*",
        "selects a line of nodes instead of one",
    ),
    (Change::Removed, "new/footing", "/bodies/0", "*", "a warning says that its material is not used"),
    (Change::OtherType, "*", "/bodies/*/shape/vertices/*", "nothing", "YAML: a comma may end a list"),
    (Change::OtherType, "cone/solid", "/bodies/*/shape/of/*", "nothing", "YAML: a comma may end a list"),
    (Change::OtherSign, "new/annulus", "/parameters/turn", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "new/beam", "/parameters/force", "*", "a motion or a force may point either way"),
    (
        Change::OtherSign,
        "new/footing",
        "/parameters/settlement",
        "*",
        "a motion or a force may point either way",
    ),
    (Change::OtherSign, "new/shear", "/parameters/gamma", "*", "a motion or a force may point either way"),
    (Change::Removed, "twist", "/boundary_conditions/*", "*", "the other sides still hold the bar"),
    (Change::Removed, "twist", "/boundary_conditions/*/fix/*", "*", "the other sides still hold the bar"),
    (
        Change::OtherSign,
        "twist",
        "/boundary_conditions/*/nodes/*",
        "*",
        "the opposite side may be held twice",
    ),
    (Change::OtherSign, "twist", "/parameters/alpha", "*", "a value in a formula may have either sign"),
    (Change::OtherSign, "annulus", "/parameters/alpha", "*", "a value in a formula may have either sign"),
    (Change::OtherSign, "annulus", "/parameters/inner", "*", "a value in a formula may have either sign"),
    (Change::OtherSign, "annulus", "/parameters/outer", "*", "a value in a formula may have either sign"),
    (Change::OtherSign, "arch", "/parameters/*", "*", "the truss may hang instead of stand"),
    (Change::OtherSign, "arch", "/bodies/0/shape/vertices/*/*", "*", "the truss may hang instead of stand"),
    (
        Change::Removed,
        "arch",
        "/boundary_conditions/0/fix/*",
        "*",
        "the other conditions still hold the body",
    ),
    (Change::Removed, "arch", "/boundary_conditions/1", "*", "the other conditions still hold the body"),
    (Change::OtherType, "arch", "/output/probes/*", "nothing", "YAML: a comma may end a list"),
    (Change::Removed, "*", "/analysis/stabilisation/mode", "*", "has a default"),
    (Change::Removed, "*", "/steps/control", "*", "has a default"),
    (Change::Removed, "*", "/steps/smallest", "*", "has a default"),
    (Change::Removed, "slope", "/stages/*/steps/control/after_slide", "*", "optional: stop"),
    (Change::OtherSign, "footing", "/parameters/depth", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "footing", "/parameters/poisson", "*", "may be negative, down to -1"),
    (Change::Removed, "footing", "/bodies/0", "*", "a warning says that its material is not used"),
    (Change::Removed, "footing", "/boundary_conditions/*", "*", "the other conditions still hold the body"),
    (
        Change::Removed,
        "footing",
        "/boundary_conditions/2/fix/*",
        "*",
        "the other conditions still hold the body",
    ),
    (Change::OtherType, "footing", "/output/probes/*", "nothing", "YAML: a comma may end a list"),
    (Change::Removed, "*", "/bodies/*/initial_stress", "*", "optional: free of stress"),
    (Change::Removed, "*", "/bodies/*/initial_stress/surcharge", "*", "optional: none"),
    (Change::Removed, "*", "/surfaces/*/part", "*", "optional: the whole boundary"),
    (Change::Removed, "footing_stages", "/loads/*/curve", "*", "optional"),
    (Change::Removed, "footing_stages", "/loads/*", "*", "other loads are left"),
    (
        Change::Removed,
        "bearing",
        "/materials/soil/dilation_angle",
        "*",
        "optional: without it there is no dilation",
    ),
    (Change::Removed, "bearing", "/boundary_conditions/0", "*", "the base still holds the ground"),
    (Change::Removed, "bearing", "/boundary_conditions/1", "*", "the base still holds the ground"),
    (Change::Removed, "bearing", "/boundary_conditions/2", "*", "the other conditions still hold the ground"),
    (
        Change::Removed,
        "bearing",
        "/boundary_conditions/2/fix/*",
        "*",
        "the other conditions still hold the ground",
    ),
    (Change::Removed, "bearing", "/boundary_conditions/3", "*", "the base still holds the ground"),
    (Change::Removed, "bearing", "/boundary_conditions/3/*", "*", "the base still holds the ground"),
    (
        Change::Removed,
        "slope",
        "/materials/soil/dilation_angle",
        "*",
        "optional: without it there is no dilation",
    ),
    (Change::Removed, "slope", "/boundary_conditions/0", "*", "the base still holds the ground"),
    (Change::Removed, "slope", "/boundary_conditions/1/fix/0", "*", "the left side still holds the ground"),
    (Change::Removed, "slope", "/stages/1/steps/control/from", "*", "optional"),
    (Change::Removed, "slope", "/stages/1/steps/control/tolerance", "*", "optional"),
    (Change::Removed, "pipe", "/boundary_conditions/0", "*", "the base still holds the ground"),
    (Change::Removed, "pipe", "/boundary_conditions/1", "*", "the base still holds the ground"),
    (Change::Removed, "pipe", "/tools/0/adhesion", "*", "optional"),
    (Change::Removed, "pipe", "/tools/0/penalty", "*", "optional"),
    (Change::Removed, "cone", "/boundary_conditions/1", "*", "the base still holds the ground"),
    (Change::Removed, "cone", "/tools/0/penalty", "*", "optional"),
    (Change::Removed, "plough", "/boundary_conditions/0", "*", "the base still holds the ground"),
    (Change::Removed, "plough", "/boundary_conditions/1", "*", "the base still holds the ground"),
    (Change::Removed, "plough", "/tools/0/adhesion", "*", "optional"),
    (Change::Removed, "plough", "/tools/0/penalty", "*", "optional"),
    (Change::Removed, "plough", "/boundary_conditions/2", "*", "the base still holds the ground"),
    (Change::Removed, "pipe", "/tools/0/uy", "*", "a tool may stay where it is"),
    (Change::Removed, "cone", "/tools/0/uy", "*", "a tool may stay where it is"),
    (Change::Removed, "plough", "/tools/0/ux", "*", "a tool may stay where it is"),
    (Change::Removed, "cone", "/tools/0/parts", "*", "optional"),
    (Change::Removed, "cone", "/tools/0/parts/*", "*", "optional"),
    (Change::Removed, "pipe", "/boundary_conditions", "*", "tools may hold bodies"),
    (Change::Removed, "plough", "/boundary_conditions", "*", "tools may hold bodies"),
    (Change::Removed, "pipe", "/boundary_conditions/2", "*", "tools may hold bodies"),
    (Change::Removed, "cone", "/boundary_conditions/2", "*", "tools may hold bodies"),
    (Change::Removed, "plough", "/boundary_conditions/3", "*", "tools may hold bodies"),
    (Change::Removed, "pipe", "/boundary_conditions/2/fix/*", "*", "tools may hold bodies"),
    (Change::Removed, "cone", "/boundary_conditions/2/fix/*", "*", "tools may hold bodies"),
    (Change::Removed, "plough", "/boundary_conditions/3/fix/*", "*", "tools may hold bodies"),
    (Change::Removed, "pipe", "/tools", "*", "optional: the bodies rest"),
    (Change::Removed, "cone", "/tools", "*", "optional: the bodies rest"),
    (Change::Removed, "plough", "/tools", "*", "optional: the bodies rest"),
    (Change::Removed, "cone", "/grid/spacing/0/0", "*", "optional: fewer intervals"),
    (Change::Removed, "cone", "/grid/spacing/*/*/ratio", "*", "optional"),
    (Change::Removed, "cone", "/tools/0/shape/vertices/*", "*", "the tool has fewer corners"),
    (Change::OtherType, "cone", "/tools/0/shape/vertices/3", "nothing", "YAML: a comma may end a list"),
    (Change::Removed, "plough", "/tools/0/shape/polygon/*", "*", "the tool has fewer corners"),
    (Change::OtherType, "plough", "/tools/0/shape/polygon/15", "nothing", "YAML: a comma may end a list"),
    (Change::Misspelt, "cone", "/tools/0/parts/*", "*", "a part may have any name"),
    (Change::Removed, "bearing", "/grid/refine", "*", "optional; a warning says that `edge` is not used"),
    (Change::Removed, "bearing", "/grid/refine/0", "*", "an empty list"),
    (Change::OtherType, "bearing", "/grid/refine/0", "nothing", "YAML: an empty list"),
    (Change::Removed, "triaxial", "/grid/follow", "*", "the grid may stay"),
    (Change::Removed, "triaxial", "/grid/follow/0", "*", "the grid may stay"),
    (Change::OtherType, "triaxial", "/grid/follow/0", "nothing", "YAML: an empty list"),
    (Change::Removed, "triaxial", "/grid/follow/0/to", "*", "optional"),
    (Change::Removed, "triaxial", "/materials/clay/overconsolidation_ratio", "*", "optional"),
    (Change::Removed, "triaxial", "/bodies/0/initial_stress/stress/*", "*", "the run judges the balance"),
    (Change::Removed, "triaxial", "/boundary_conditions/1", "*", "the plate still holds the sample"),
    (Change::Removed, "triaxial", "/loads/0/curve", "*", "optional"),
    (Change::Removed, "excavation", "/boundary_conditions/0", "*", "the floor still holds the ground"),
    (Change::Removed, "excavation", "/boundary_conditions/1", "*", "the floor still holds the ground"),
    (Change::Removed, "excavation", "/boundary_conditions/2/fix/0", "*", "the sides still hold the ground"),
    (
        Change::Removed,
        "footing_stages",
        "/boundary_conditions/0",
        "*",
        "the other side still holds the ground",
    ),
    (
        Change::Removed,
        "footing_stages",
        "/boundary_conditions/1",
        "*",
        "the other side still holds the ground",
    ),
    (Change::Removed, "*", "/stages/*", "*", "other stages are left"),
    (Change::Removed, "*", "/stages/*/then/reset/*", "*", "nothing is set to zero"),
    (Change::Removed, "*", "/stages/*/steps/control", "*", "has a default"),
    (Change::Removed, "*", "/stages/*/*", "*", "optional: the stage changes less"),
    (Change::Removed, "*", "/units", "*", "optional: results are then without units"),
    (Change::Removed, "*", "/stages/*/*/*", "*", "optional: the stage changes less"),
    (Change::OtherType, "*", "/stages/*/then/reset/*", "nothing", "YAML: a comma may end a list"),
    (Change::OtherType, "*", "/stages/*/*/*", "nothing", "YAML: a comma may end a list"),
    (
        Change::OtherSign,
        "footing_stages",
        "/parameters/settlement",
        "*",
        "a motion or a force may point either way",
    ),
    (Change::OtherSign, "bearing", "/parameters/settlement", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "pipe", "/tools/0/shape/center/1", "*", "a note says that the tool is far away"),
    (Change::OtherSign, "pipe", "/tools/0/adhesion", "*", "zero has no sign"),
    (Change::OtherSign, "plough", "/tools/0/adhesion", "*", "zero has no sign"),
    (Change::OtherSign, "plough", "/tools/0/shape/from", "*", "the blade may reach below the grid"),
    (Change::OtherSign, "pipe", "/parameters/depth", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "cone", "/parameters/depth", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "plough", "/parameters/way", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "*", "/tools/*/uy", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "*", "/tools/*/ux", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "slope", "/materials/soil/dilation_angle", "*", "zero has no sign"),
    (Change::OtherSign, "triaxial", "/parameters/strain", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "triaxial", "/bodies/0/initial_stress/stress/*", "*", "the run judges the balance"),
    (Change::OtherSign, "triaxial", "/loads/0/pressure", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "triaxial", "/loads/0/curve/*/1", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "*", "/loads/*/traction/*", "*", "a force may point either way"),
    (Change::OtherSign, "*", "/stages/*/steps/control/to", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "*", "/stages/*/factors/*", "*", "a motion or a force may point either way"),
    (Change::OtherSign, "*", "/output/probes/*/nearest/*", "*", "a warning says how far away the points are"),
    (Change::OtherSign, "*", "/loads/*/points/nearest/*", "*", "a warning says how far away the points are"),
];

fn fits(pattern: &str, pointer: &str) -> bool {
    let (mut wanted, mut parts) = (pattern.split('/'), pointer.split('/'));
    pattern == "*"
        || loop {
            match (wanted.next(), parts.next()) {
                (None, None) => break true,
                (Some(a), Some(b)) if a == "*" || a == b => {}
                _ => break false,
            }
        }
}

/// The number of the first reason that fits.
fn reason(change: Change, deck: &str, pointer: &str, became: &str) -> Option<usize> {
    REASONS.iter().position(|(of, name, pattern, value, _)| {
        *of == change
            && (*name == "*" || *name == deck)
            && fits(pattern, pointer)
            && (*value == "*" || *value == became)
    })
}

/// Codes of faults that depend on two keys of the deck; either key may be the one to change.
const RELATIONS: [&str; 13] =
    ["D015", "D018", "D021", "D024", "D025", "D027", "D028", "D029", "D035", "D049", "D051", "D054", "D065"];

/// True if a message is located at the change, or where the deck uses the changed value.
fn is_at_the_right_line(deck: &DeckText, changed: &Source, pointer: &str, found: &Diagnostic) -> bool {
    let line = place(changed, found).0;
    let of =
        |pointer: &str| changed.nearest_span(pointer).map_or(0, |span| changed.line_column(span.start).0);
    // A removed value was inside its parent; a list continues after it.
    let key_of_parent =
        changed.key_span_of(parent(pointer)).map_or(0, |span| changed.line_column(span.start).0);
    let own = [of(pointer), of(parent(pointer)), key_of_parent];
    let before = [deck.source.key_span_of(pointer), deck.source.span_of(pointer)];
    let mut before = before.into_iter().flatten().map(|span| deck.source.line_column(span.start).0);
    if own.contains(&line) || before.any(|before| before == line) {
        return true;
    }
    let Some(text) = changed.text().lines().nth(line.wrapping_sub(1)) else { return false };
    let uses = |word: &str| text.split(|c: char| !c.is_alphanumeric() && c != '_').any(|part| part == word);
    let parts: Vec<&str> = pointer.split('/').collect();
    match (found.gate, parts.as_slice()) {
        // A parameter, a material or an intermediate value is used elsewhere.
        (_, [_, "parameters" | "materials", name, ..]) if uses(name) => true,
        (_, [_, "parameters" | "materials"]) => true,
        (_, [_, "loads", _, "where", name]) if uses(name) => true,
        (_, [_, "bodies", _, "name"]) => uses(deck.at(pointer).as_str().unwrap()),
        (Gate::Meaning | Gate::Feasibility, _) => RELATIONS.contains(&found.code),
        _ => false,
    }
}

/// The decks whose keys are changed without `tests/run --long`: the problem of the paper with plasticity, ground in
/// stages, a tool, and the block in space. What is stored about all decks is then not compared.
const USUAL: [&str; 4] = ["block/block", "collapse", "excavation", "pipe"];

#[test]
fn every_change_of_a_key_is_refused_at_its_line_or_accepted_for_a_reason() {
    let mut decks = Vec::new();
    let mut folders = vec![root().join("inputs")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "yaml") {
                let name = path.strip_prefix(root().join("inputs")).unwrap().with_extension("");
                decks.push(name.to_str().unwrap().to_owned());
            }
        }
    }
    decks.sort();
    assert!(decks.len() >= 15);
    let is_whole = is_long() || std::env::var_os("UPDATE_EXPECTED").is_some();
    decks.retain(|name| is_whole || USUAL.contains(&name.as_str()));
    assert!(decks.len() >= USUAL.len(), "{decks:?}");
    let mut faults = Vec::new();
    let mut needed = vec![0; REASONS.len()];
    // By deck and kind of change: how many were tried, refused by each gate, and accepted.
    let mut counts: BTreeMap<(String, Change), [usize; 6]> = BTreeMap::new();
    let mut accepted = String::new();
    for name in &decks {
        let path = format!("inputs/{name}.yaml");
        // With fewer points, the block gives the same result faster.
        let text = fs::read_to_string(root().join(&path)).unwrap().replace("h: 0.25, n: 3", "h: 1, n: 2");
        let deck = DeckText::new(&path, text);
        for pointer in deck.pointers() {
            for change in [Change::Removed, Change::Misspelt, Change::OtherType, Change::OtherSign] {
                for (became, text) in changes(&deck, &pointer, change) {
                    let count = counts.entry((name.clone(), change)).or_default();
                    count[0] += 1;
                    let tried = format!("{name}: {pointer} {became}");
                    match judge(&path, &text) {
                        Verdict::Refused(found) => {
                            let errors: Vec<_> = found.iter().filter(|d| d.is_error()).collect();
                            count[1 + errors.iter().map(|d| d.gate as usize).min().unwrap()] += 1;
                            let changed = Source::read(&path, text.as_bytes()).0;
                            let right = |d: &&Diagnostic| is_at_the_right_line(&deck, &changed, &pointer, d);
                            if !errors.iter().copied().any(|d| right(&d)) {
                                let reported: Vec<_> = errors
                                    .iter()
                                    .map(|d| format!("{}:{} {}", d.code, place(&changed, d).0, d.message))
                                    .collect();
                                faults.push(format!("{tried}: refused elsewhere: {reported:?}"));
                            }
                        }
                        Verdict::Accepted(notes) => {
                            count[5] += 1;
                            match reason(change, name, &pointer, &became) {
                                None => faults.push(format!("{tried}: accepted without a reason")),
                                Some(number) => {
                                    needed[number] += 1;
                                    let warned = notes.iter().filter(|n| n.severity == Severity::Warning);
                                    let mut codes: Vec<&str> = warned.map(|n| n.code).collect();
                                    codes.dedup();
                                    let with = if codes.is_empty() {
                                        String::new()
                                    } else {
                                        format!(" ({})", codes.join(", "))
                                    };
                                    accepted.push_str(&format!("{tried}{with}: {}\n", REASONS[number].4));
                                }
                            }
                        }
                    }
                }
            }
        }
    }
    for (entry, _) in REASONS.iter().zip(&needed).filter(|(_, n)| is_whole && **n == 0) {
        faults.push(format!("this reason is not needed: {entry:?}"));
    }
    assert!(faults.is_empty(), "{} faults:\n{}", faults.len(), faults.join("\n"));

    let mut table =
        "deck         change      tried  text  shape  meaning  feasibility  accepted\n".to_owned();
    let mut sum = [0; 6];
    let mut row = |name: &str, change: &str, c: &[usize; 6]| {
        table.push_str(&format!(
            "{name:<12} {change:<10} {:>6} {:>5} {:>6} {:>8} {:>12} {:>9}\n",
            c[0], c[1], c[2], c[3], c[4], c[5]
        ));
    };
    for ((name, change), count) in &counts {
        row(name, &format!("{change:?}"), count);
        (0..6).for_each(|k| sum[k] += count[k]);
    }
    row("all", "", &sum);
    println!("{table}");
    let found = format!("{table}\nAccepted, with the codes of warnings:\n\n{accepted}");
    let stored = root().join("tests/decks/generated/mutations.expected");
    if std::env::var_os("UPDATE_EXPECTED").is_some() {
        fs::write(&stored, &found).unwrap();
    }
    if is_whole {
        assert_eq!(fs::read_to_string(&stored).unwrap_or_default(), found, "UPDATE_EXPECTED=1 stores it");
    }
}
