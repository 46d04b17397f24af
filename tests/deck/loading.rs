//! Loading decks: the result for valid decks, and no panic for damaged ones.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use crate::remedy;
use mpm::deck::diagnostic::Diagnostic;
use mpm::deck::formulas::at_nodes;
use mpm::deck::load::{LoadedDeck, load, load_text};
use mpm::deck::ready::{Analysis, ready};
use mpm::deck::source::Source;
use mpm::deck::validate::validate;
use mpm::deck::{AxisSpacing, DomainUpdate, Expression, GridDeck, Method, Parameter, PerAxis, SpacingDeck};
use proptest::prelude::*;
use serde_json::{Value, json};

const BEAM: &str = include_str!("../decks/beam.good.yaml");
const RICH: &str = include_str!("../decks/rich.good.yaml");

fn good(text: &str, overrides: &[(&str, &str)]) -> LoadedDeck {
    let overrides: Vec<_> =
        overrides.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect();
    load_text("deck.yaml", text.as_bytes(), &overrides).unwrap_or_else(|failure| panic!("{failure}"))
}

#[test]
fn parameters_are_inserted() {
    let loaded = good(BEAM, &[]);
    let body = &loaded.deck.bodies[0];
    assert_eq!(body.method, Method::Gimp);
    assert_eq!(body.domain_update, Some(DomainUpdate::Corners));
    assert_eq!(body.points_per_cell, Some(PerAxis::Same(6)));
    assert_eq!(loaded.deck.step_count(), 50);
    assert_eq!(loaded.parameters["h"], Parameter::Number(0.5));
    assert!(loaded.notes.is_empty());
    assert!(loaded.source.is_from_parameter("/grid/spacing"));
    assert!(!loaded.source.is_from_parameter("/grid/size"));
}

#[test]
fn parameters_may_depend_on_each_other_and_be_overridden() {
    for (overrides, side) in [(&[][..], 1.0), (&[("side", "2")][..], 2.0), (&[("side", "1e0")][..], 1.0)] {
        let text = RICH
            .replace("max: [1, 1]}", "max: [\"${side}\", 1]}")
            .replace("point_spacing: [\"${h/2}\"", "point_spacing: [0.1")
            .replace("points_per_cell: [2, 3]", "point_spacing: 0.1");
        let loaded = good(&text, overrides);
        assert_eq!(loaded.parameters["h"], Parameter::Number(side / 10.0));
        let GridDeck::Structured { size, spacing, .. } = &loaded.deck.grid else { panic!("another grid") };
        assert_eq!(size[0], 4.0 * side);
        let even = [side / 10.0, side / 5.0].map(AxisSpacing::Even);
        assert_eq!(*spacing, SpacingDeck::Each(even.to_vec()));
        assert_eq!(
            loaded.deck.title.as_deref(),
            Some(format!("every key once, h = {}", side / 10.0).as_str())
        );
    }
    let by_expression = good(BEAM, &[("h", "${1/n - 1/6 + 0.25}"), ("method", "mpm")]);
    assert_eq!(by_expression.parameters["h"], Parameter::Number(0.25));
    assert_eq!(by_expression.deck.bodies[0].method, Method::Mpm);
    assert_eq!(by_expression.notes.len(), 1, "the domain update is ignored with a note");
}

#[test]
fn formulas_may_contain_parameters() {
    let loaded = good(RICH, &[]);
    let side = &loaded.deck.boundary_conditions[1];
    assert_eq!(side.ux, Some(Expression::Formula("(-0.5)*y^2 + if(x < h, 1, 0)".into())));
    let [formula, ..] =
        at_nodes(side.displacements(), &side.intermediate, &loaded.parameters, 2).ok().unwrap();
    let formula = formula.unwrap();
    assert_eq!(formula.evaluate(&[0.0, 2.0, 0.0, 0.0, 1.0]), -1.0);
    assert_eq!(formula.evaluate(&[0.2, 2.0, 0.0, 0.0, 1.0]), -2.0);
}

#[test]
fn a_negative_parameter_is_squared_as_a_whole() {
    let text = r#"
version: 1
parameters: {a: -2}
grid: {type: structured, origin: [0, 0], size: [4, 6], spacing: 1}
materials: {soil: {model: hencky, young: "1e6*${a}^2 + X", poisson: 0.3}}
bodies:
  - {name: b, material: soil, shape: {type: box, min: [0, 0], max: [4, 4]}, points_per_cell: 2,
     initial_stress: {type: components, stress: {xx: "${a}^2*(Y - 4)", yy: 0, zz: 0}}}
surfaces: [{name: top, body: b}]
boundary_conditions: [{name: wall, nodes: {x: 0}, move: {along: [1, 1], by: "${a}^2*y"}}]
loads:
  - {name: wind, type: traction, surface: top, traction: [0, "${a}^2*x"]}
  - {name: water, type: pressure, surface: top, pressure: "${a}^2*x"}
tools: [{name: disc, shape: {type: circle, center: [2, 5], radius: 1}, rotation: "${a}^2*factor"}]
steps: {count: 1}
"#;
    let deck = serde_json::to_value(good(text, &[]).deck).unwrap();
    for (pointer, formula) in [
        ("/materials/soil/young", "1e6*(-2.0)^2 + X"),
        ("/bodies/0/initial_stress/stress/xx", "(-2.0)^2*(Y - 4)"),
        ("/boundary_conditions/0/move/by", "(-2.0)^2*y"),
        ("/loads/0/traction/1", "(-2.0)^2*x"),
        ("/loads/1/pressure", "(-2.0)^2*x"),
        ("/tools/0/rotation", "(-2.0)^2*factor"),
    ] {
        assert_eq!(deck.pointer(pointer).and_then(Value::as_str), Some(formula), "{pointer}");
    }
}

#[test]
fn later_checks_can_point_at_the_deck() {
    let loaded = good(BEAM, &[("h", "0.25")]);
    let diagnostic =
        Diagnostic::at(&loaded.source, "D028", "/bodies/0/shape/min", "too far left").label("here");
    let text = diagnostic.render(&loaded.source, false);
    assert!(text.contains("deck.yaml:9:59") && text.contains("^^^^^^ here"), "{text}");
    let diagnostic = Diagnostic::at(&loaded.source, "D027", "/grid/spacing/1", "too fine");
    assert!(diagnostic.render(&loaded.source, false).contains("deck.yaml:5:"), "falls back to a parent");
    let diagnostic = Diagnostic::at(&loaded.source, "D027", "/grid/spacing", "too fine");
    assert!(diagnostic.render(&loaded.source, false).contains("because of `--set h=0.25`"));
    assert!(diagnostic.render(&loaded.source, true).contains('\u{1b}'));
}

#[test]
fn a_deck_made_by_a_program_can_be_checked() {
    let mut deck = good(BEAM, &[]).deck;
    let source = Source::without_text("study");
    assert_eq!(validate(&deck, &source), []);
    deck.bodies[0].material = "air".into();
    let found = validate(&deck, &source);
    assert_eq!(found.len(), 1);
    let text = found[0].render(&source, false);
    assert!(text.contains("/bodies/0/material") && text.contains("study"), "{text}");
}

#[test]
fn a_file_that_is_not_there_is_an_error() {
    let failure = load(Path::new("no/such/deck.yaml"), &[]).unwrap_err();
    assert_eq!(failure.diagnostics[0].code, "D001");
    assert!(failure.render(false).contains("no/such/deck.yaml"));
}

#[test]
fn line_ends_and_byte_order_marks_do_not_matter() {
    let windows = format!("\u{feff}{}", BEAM.replace('\n', "\r\n"));
    assert_eq!(good(&windows, &[]).deck, good(BEAM, &[]).deck);
    let broken = windows.replace("young", "yuong");
    let failure = load_text("deck.yaml", broken.as_bytes(), &[]).unwrap_err();
    assert!(failure.render(false).contains("deck.yaml:7:26"), "{failure}");
}

#[test]
fn a_deck_survives_being_written_and_read() {
    for text in [BEAM, RICH] {
        let deck = good(text, &[]).deck;
        let written = serde_json::to_string(&deck).unwrap();
        assert_eq!(good(&written, &[]).deck, deck);
    }
}

#[test]
fn large_decks_are_read() {
    let mut text = BEAM.replace("size: [11, 10]", "size: [11, 40000]").replace("\"${h}\"", "[1, 1]");
    let bodies: String = (11..20_000)
        .map(|y| format!("  - {{name: b{y}, material: steel, shape: {{type: box, min: [0, {y}], max: [11, {}]}}, points_per_cell: 1}}\n", y + 1))
        .collect();
    text = text.replace("boundary_conditions:", &format!("{bodies}boundary_conditions:"));
    assert_eq!(good(&text, &[]).deck.bodies.len(), 19_990);
}

/// Loads a damaged deck, which must not cause a panic.
fn load_damaged(text: &[u8]) -> bool {
    match load_text("damaged.yaml", text, &[]) {
        Ok(loaded) => {
            assert!(!loaded.notes.iter().any(Diagnostic::is_error));
            loaded.notes.iter().for_each(remedy::has_remedy);
            true
        }
        Err(failure) => {
            assert!(failure.diagnostics.iter().any(Diagnostic::is_error));
            failure.diagnostics.iter().for_each(remedy::has_remedy);
            assert!(!failure.render(false).is_empty());
            false
        }
    }
}

/// All pointers of a value except the root.
fn pointers(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(entries) => {
            for (key, entry) in entries {
                let pointer = format!("{at}/{key}");
                found.push(pointer.clone());
                pointers(entry, &pointer, found);
            }
        }
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                let pointer = format!("{at}/{index}");
                found.push(pointer.clone());
                pointers(item, &pointer, found);
            }
        }
        _ => {}
    }
}

fn split(pointer: &str) -> (&str, &str) {
    pointer.rsplit_once('/').unwrap()
}

#[test]
fn every_single_damage_is_survived() {
    for text in [BEAM, RICH] {
        let (_, value, _) = Source::read("deck.yaml", text.as_bytes());
        let value = value.unwrap();
        let mut places = Vec::new();
        pointers(&value, "", &mut places);
        assert!(places.len() > 60);
        for pointer in &places {
            let (parent, last) = split(pointer);
            let mut removed = value.clone();
            match removed.pointer_mut(parent).unwrap() {
                Value::Object(entries) => drop(entries.shift_remove(last)),
                Value::Array(items) => drop(items.remove(last.parse().unwrap())),
                _ => unreachable!(),
            }
            load_damaged(removed.to_string().as_bytes());
            let is_free = parent == "/parameters" || parent == "/materials";
            if value.pointer(parent).unwrap().is_object() && !is_free {
                let mut misspelt = value.clone();
                let entries = misspelt.pointer_mut(parent).unwrap().as_object_mut().unwrap();
                let entry = entries.shift_remove(last).unwrap();
                entries.insert(format!("{last}q"), entry);
                assert!(!load_damaged(misspelt.to_string().as_bytes()), "{pointer} misspelt is accepted");
            }
            for other in [
                json!(null),
                json!(true),
                json!("word"),
                json!("${h}"),
                json!("${"),
                json!(-1),
                json!(0),
                json!(1e308),
                json!(-1e308),
                json!(1e-308),
                json!(0.5),
                json!([]),
                json!({}),
                json!([[1]]),
                json!(["a", "b"]),
                json!({"a": {"b": 1}}),
                json!("1e999"),
                json!(""),
                json!("\u{1b}[31m\u{0}é"),
            ] {
                let mut changed = value.clone();
                *changed.pointer_mut(pointer).unwrap() = other;
                load_damaged(changed.to_string().as_bytes());
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damaged_text_is_survived(
        rich in any::<bool>(), edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4), 1..6)
    ) {
        let mut text = if rich { RICH } else { BEAM }.as_bytes().to_vec();
        for (place, byte, kind) in edits {
            if text.is_empty() {
                break;
            }
            let at = place.index(text.len());
            match kind {
                0 => text[at] = byte,
                1 => drop(text.remove(at)),
                2 => text.insert(at, b" :,[]{}\"'#&*!|>-\n\t$"[usize::from(byte) % 19]),
                _ => text.truncate(at.max(1)),
            }
        }
        load_damaged(&text);
    }

    #[test]
    fn any_text_is_survived(text in "\\PC{0,200}") {
        load_damaged(text.as_bytes());
    }

    #[test]
    fn any_override_is_survived(name in "[a-z]{1,6}", value in "\\PC{0,20}") {
        let _ = load_text("deck.yaml", BEAM.as_bytes(), &[(name, value.clone()), ("h".into(), value)]);
    }
}

/// A study must not reuse the results of another mesh.
#[test]
fn the_mesh_is_part_of_the_hash() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("mesh hash");
    std::fs::create_dir_all(&folder).unwrap();
    let deck =
        std::fs::read_to_string("tests/decks/build/counts_of_the_cells_that_are_filled.note.yaml").unwrap();
    let deck = deck.replace("../../data/mesh/mixed_4.1_text.msh", "a.msh");
    let name = folder.join("deck.yaml").display().to_string();
    let hash = |mesh: &str| {
        std::fs::copy(format!("tests/data/mesh/{mesh}.msh"), folder.join("a.msh")).unwrap();
        load_text(&name, deck.as_bytes(), &[]).unwrap().hash()
    };
    let first = hash("mixed_4.1_text");
    assert_ne!(first, hash("mixed_2.2_text"));
    assert_eq!(first, hash("mixed_4.1_text"));
}

/// Whole cells minus a circle: the area is measured, since no formula gives it.
#[test]
fn the_area_of_cut_cells_is_measured() {
    let text = "version: 1
grid: {type: gmsh, file: ../tests/data/mesh/rectangle_quad_h0.5.msh}
materials: {m: {model: hencky, young: 1, poisson: 0}}
bodies:
  - {name: plate, material: m, method: mpm, points_per_cell: 2, shape: {type: difference, from: {type: cells},
     minus: [{type: circle, center: [5, 5], radius: 2.1}]}}
boundary_conditions: [{name: left, nodes: {x: 0}, fix: [x, y]}]
loads: [{name: push, type: body-force, force: [1, 0]}]
steps: {count: 1}
";
    let loaded = load_text("inputs/deck.yaml", text.as_bytes(), &[]).unwrap_or_else(|e| panic!("{e}"));
    let ready = ready(&loaded, None).unwrap_or_else(|found| panic!("{found:?}"));
    let Analysis::Plane(parts) = &ready.analysis else { panic!() };
    let area: f64 = parts.1.original_volume.iter().sum();
    let exact = 110.0 - std::f64::consts::PI * 2.1 * 2.1;
    let note = ready.notes.iter().find(|note| note.code == "D033").unwrap();
    let words: Vec<&str> = note.message.split(' ').collect();
    let at = |word: &str| words.iter().position(|w| *w == word).unwrap();
    let share: f64 = words[at("%") - 1].parse().unwrap();
    let sign = if note.message.contains("more") { 1.0 } else { -1.0 };
    // Cut cells are measured in parts whose sides are 1/32 of the sides of the cell.
    assert!((sign * share / 100.0 - (area / exact - 1.0)).abs() < 3e-4, "{} {}", note.message, area / exact);
}

/// A ring touches no node on the axis until it closes, so no condition needs to hold these nodes.
#[test]
fn a_hollow_body_of_revolution_needs_nothing_on_the_axis() {
    let text = "version: 1
analysis: {idealisation: axisymmetric}
grid: {type: structured, origin: [0, 0], size: [4, 2], spacing: 0.5}
materials: {m: {model: hencky, young: 1, poisson: 0}}
bodies:
  - {name: ring, material: m, method: mpm, points_per_cell: 2, shape: {type: box, min: [INNER, 0], max: [3, 1]}}
boundary_conditions: [{name: floor, nodes: {y: 0}, fix: [y]}]
loads: [{name: push, type: body-force, force: [0, -1]}]
steps: {count: 1}
";
    let codes = |inner: &str| -> Vec<&str> {
        let text = text.replace("INNER", inner);
        let loaded = load_text("deck.yaml", text.as_bytes(), &[]).unwrap_or_else(|e| panic!("{e}"));
        match ready(&loaded, None) {
            Ok(_) => Vec::new(),
            Err(found) => found.iter().filter(|found| found.is_error()).map(|found| found.code).collect(),
        }
    };
    assert_eq!(codes("0.5"), [""; 0]);
    assert_eq!(codes("0"), ["D046"]);
}
