//! Checks of soil materials and of the reduction of their strength: ranges of formulas, softening that is too fast,
//! notes only about materials in use, and one error per fault.

use mpm::deck::build::build;
use mpm::deck::diagnostic::Diagnostic;
use mpm::deck::load::load_text;

use crate::remedy;

/// A block of a material with the last steps of a deck, on cells of 1.
fn deck(materials: &str, steps: &str) -> String {
    format!(
        "
version: 1
grid: {{type: structured, origin: [0, 0], size: [6, 6], spacing: 1}}
materials:
{materials}
bodies:
  - {{name: block, material: clay, shape: {{type: box, min: [0, 0], max: [4, 4]}}, strain: mean-dilatation, points_per_cell: 2}}
boundary_conditions:
  - {{name: floor, nodes: {{y: 0}}, fix: [x, y]}}
loads:
  - {{name: weight, type: gravity, acceleration: [0, -9.81]}}
{steps}
"
    )
}

/// All messages about a deck, including those of the build.
fn found(text: &str) -> Vec<Diagnostic> {
    let found = match load_text("deck", text.as_bytes(), &[]) {
        Err(failure) => failure.diagnostics,
        Ok(loaded) => {
            let found_by_build = build::<2>(&loaded).err().unwrap_or_default();
            loaded.notes.into_iter().chain(found_by_build).collect()
        }
    };
    found.iter().for_each(remedy::has_remedy);
    found
}

fn codes(text: &str) -> Vec<&'static str> {
    found(text).iter().map(|diagnostic| diagnostic.code).collect()
}

const STEPS: &str = "steps: {count: 2}";

#[test]
fn a_formula_with_one_value_everywhere_has_the_range_of_a_number() {
    let with = |young: &str, poisson: &str| {
        deck(&format!("  clay: {{model: hencky, young: {young}, poisson: {poisson}, density: 2000}}"), STEPS)
    };
    assert!(codes(&with("\"1e6 + 2\"", "\"0.1 + 0.2\"")).is_empty());
    for (young, poisson, words) in [
        ("\"-5\"", "0.3", "`-5` is -5"),
        ("\"2 - 7\"", "0.3", "`2 - 7` is -5"),
        ("1e6", "\"0.3 + 0.2\"", "`0.3 + 0.2` is 0.5"),
    ] {
        let found = found(&with(young, poisson));
        let [one] = &found[..] else { panic!("{found:?}") };
        assert_eq!((one.code, one.message.as_str()), ("D009", words));
    }
    assert_eq!(codes(&with("\"1e6*(3 - Y)\"", "0.3")), ["D058"], "one that varies is checked at the points");
    let light = deck("  clay: {model: hencky, young: 1e6, poisson: 0.3, density: \"2 - 7\"}", STEPS);
    assert_eq!(codes(&light), ["D009"]);
}

#[test]
fn a_value_out_of_its_range_causes_one_error() {
    let sand = |friction_angle: &str| {
        deck(
            &format!(
                "  clay: {{model: mohr-coulomb, young: 1e6, poisson: 0.3, cohesion: 1e3, friction_angle: {friction_angle}, density: \
                 2000}}"
            ),
            STEPS,
        )
    };
    for wrong in ["-5", "95", "\"0 - 5\""] {
        assert_eq!(codes(&sand(wrong)), ["D009"], "{wrong}");
    }
    assert!(codes(&sand("5")).is_empty());
}

/// A softening strain that is too small for a single point is harmless if cells smaller than the band increase it; the
/// cell size is known only when the grid is known.
#[test]
fn softening_faster_than_the_elastic_stress_can_fall_is_refused() {
    let tresca = |strain: f64, band: &str| {
        deck(
            &format!(
                "  clay: {{model: tresca, young: 1e6, poisson: 0.25, cohesion: 20e3, density: 2000, softening: {{strain: {strain}, \
                 residual_cohesion: 5e3{band}}}}}"
            ),
            STEPS,
        )
    };
    let friction = |strain: f64, angles: [f64; 2]| {
        let [peak, residual] = angles;
        deck(
            &format!(
                "  clay: {{model: mohr-coulomb, young: 1e6, poisson: 0.25, cohesion: 20e3, friction_angle: {peak}, density: 2000, \
                 softening: {{strain: {strain}, residual_cohesion: 5e3, residual_friction_angle: {residual}}}}}"
            ),
            STEPS,
        )
    };
    // √3 · 15e3/400e3
    let least = 0.06495;
    let too_fast = |text: &str| codes(text).contains(&"D057");
    for (factor, fails) in [(0.99, true), (1.01, false)] {
        assert_eq!(too_fast(&tresca(factor * least, "")), fails);
        assert_eq!(too_fast(&tresca(0.5 * factor * least, ", band: 2")), fails, "cells of half the band");
        assert_eq!(too_fast(&friction(factor * least, [0.0, 0.0])), fails, "that of Tresca without friction");
    }
    assert!(too_fast(&friction(least, [30.0, 20.0])) && !too_fast(&friction(0.5, [30.0, 20.0])));
}

#[test]
fn notes_on_softening_are_about_materials_in_use() {
    let soft = "model: tresca, young: 1e6, poisson: 0.3, cohesion: 20e3, density: 2000, softening: {strain: 0.5, \
                residual_cohesion: 5e3}";
    let hard = "model: tresca, young: 1e6, poisson: 0.3, cohesion: 20e3, density: 2000";
    let notes = |clay: &str, other: &str| {
        let text = deck(&format!("  clay: {{{clay}}}\n  other: {{{other}}}"), STEPS);
        let loaded = load_text("deck", text.as_bytes(), &[]).unwrap();
        let ready = mpm::deck::ready::ready(&loaded, None).unwrap_or_else(|found| panic!("{found:?}"));
        ready.notes.iter().filter(|note| note.code == "D060").count()
    };
    assert_eq!((notes(soft, hard), notes(hard, soft), notes(soft, soft)), (1, 0, 1));
}

#[test]
fn an_initial_stress_loads_the_bodies() {
    let clay = "  clay: {model: tresca, young: 1e7, poisson: 0.3, cohesion: 200e3, density: 2000}";
    let text = deck(clay, STEPS);
    let start = text.find("loads:").unwrap();
    let end = start + text[start..].find("\n").unwrap();
    let end = text[end + 1..].find("\n").map_or(text.len(), |line| end + 1 + line);
    let without = format!("{}{}", &text[..start], &text[end..]);
    assert!(codes(&without).contains(&"D037"), "{without}");
    let body = "{name: block, material: clay,";
    let with = |stress: &str| {
        codes(
            &without
                .replace(body, &format!("{body} initial_stress: {{type: components, stress: {stress}}},")),
        )
    };
    assert!(with("{yy: -1e3}").iter().all(|code| *code != "D037"));
    assert!(with("{yy: 0}").contains(&"D037"));
}

#[test]
fn a_reduction_of_strength_needs_something_to_carry() {
    let clay = "  clay: {model: tresca, young: 1e7, poisson: 0.3, cohesion: 200e3, density: 2000}";
    let reduction = "  - {name: safety, steps: {count: 2, control: {type: strength-reduction, to: 1.2}}}\n";
    let weight =
        |factor: f64| format!("  - {{name: weight, steps: {{count: 2}}, factors: {{weight: {factor}}}}}\n");
    let with = |stages: &str| deck(clay, &format!("stages:\n{stages}"));
    assert_eq!(codes(&with(reduction)), ["D065"]);
    assert_eq!(codes(&with(&(weight(0.0) + reduction))), ["D065"]);
    assert!(codes(&with(&(weight(1.0) + reduction))).is_empty());
    let later = weight(1.0).replace("name: weight", "name: later");
    assert_eq!(codes(&with(&(reduction.to_owned() + &later))), ["D065"], "a later stage does not help");
    let again = reduction.replace("safety", "again");
    assert_eq!(codes(&with(&(weight(1.0) + reduction + &again))), ["D066"]);
    let unloaded = weight(0.0).replace("name: weight", "name: unload");
    assert_eq!(
        codes(&with(&(weight(1.0) + &unloaded + reduction))),
        ["D065"],
        "the load has been taken away"
    );
    let stressed = |stress: &str, stages: &str| {
        let body = "{name: block, material: clay,";
        let text = with(stages);
        assert!(text.contains(body), "{text}");
        codes(&text.replace(body, &format!("{body} initial_stress: {{type: components, stress: {stress}}},")))
    };
    assert!(stressed("{yy: -1e3}", reduction).iter().all(|code| *code != "D065"));
    for nothing in ["{}", "{xx: 0}", "{xx: 0, yy: \"0\"}"] {
        assert!(stressed(nothing, &(weight(0.0) + reduction)).contains(&"D065"), "{nothing}");
    }
}

#[test]
fn a_reduction_with_settings_that_cannot_serve_it_says_why() {
    let clay = "  clay: {model: tresca, young: 1e7, poisson: 0.3, cohesion: 200e3, density: 2000}";
    let with = |steps: &str| {
        let weight = "  - {name: weight, steps: {count: 2}, factors: {weight: 1}}\n";
        found(&deck(clay, &format!("stages:\n{weight}  - {{name: safety, steps: {{count: 2, {steps}}}}}\n")))
    };
    let [wide] = &with("control: {type: strength-reduction, to: 1.5, tolerance: 0.8}")[..] else { panic!() };
    assert_eq!(wide.code, "D049");
    assert!(wide.message.contains("a tolerance of 0.8 exceeds the whole range"), "{}", wide.message);
    let [down] = &with("control: {type: strength-reduction, from: 1.5, to: 1.2}")[..] else { panic!() };
    assert!(down.message.contains("cannot grow from 1.5 to 1.2"), "{}", down.message);
    for (key, other) in [("smallest: 0.1", "`smallest`"), ("damping: true", "`damping`")] {
        let [idle] = &with(&format!("{key}, control: {{type: strength-reduction, to: 1.5}}"))[..] else {
            panic!("{key}")
        };
        assert_eq!(idle.code, "D037");
        assert!(idle.message.starts_with(&format!("{other} has no effect")), "{}", idle.message);
    }
}

#[test]
fn what_is_wrong_with_a_word_or_a_value_is_said() {
    let clay = "  clay: {model: tresca, young: 1e7, poisson: 0.3, cohesion: \"1e3/(Y - Y)\", density: 2000}";
    let [infinite] = &found(&deck(clay, STEPS))[..] else { panic!() };
    let help = infinite.help.as_deref().unwrap_or_default();
    assert!(infinite.code == "D058" && help.contains("is finite and"), "{help}");
    let clay = clay.replace("\"1e3/(Y - Y)\"", "1e3");
    let words = deck(&clay, STEPS).replace("fix: [x, y]", "fix: [normal]");
    let [normal] = &found(&words)[..] else { panic!() };
    let help = normal.help.as_deref().unwrap_or_default();
    assert!(normal.code == "D010" && help.contains("`fix: normal` without brackets"), "{help}");
}
