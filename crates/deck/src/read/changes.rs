//! Finds the changes to a deck that prevent a run from resuming: changes to anything on which the steps so far depend.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

use crate::check::{formulas_of_bodies, formulas_of_loading, names_in};
use crate::initial_stress::{curve_of, initial_factor};
use crate::loads::load_curve;
use crate::quoting::quote;
use crate::{BoundaryConditionDeck, ControlDeck, Deck, LoadDeck, MaterialDeck};
use mpm_core::model::LoadCurve;

/// Relative difference up to which two times, or two load factors, count as equal.
const SAME: f64 = 1e-12;
/// Longest value that is shown in full, [characters].
const LONGEST: usize = 60;

/// Changes to a deck that prevent a run from resuming at `time`, each as a sentence. The number and size of steps, the
/// tolerance of a strength reduction and what follows a slide, the `solver`, the curves of loads and boundary
/// conditions after that time, titles, names of stages, checkpoints, and the output except its probes may change.
pub fn changes(old: &Deck, new: &Deck, time: f64) -> Vec<String> {
    let mut found = Vec::new();
    compare("", &essential(old), &essential(new), &mut found);
    if count_of_jump(old, time) != count_of_jump(new, time) {
        found.push(format!(
            "`count` has changed, but time {time} lies within the first step of a strength reduction, whose factors \
             depend on it"
        ));
    }
    if found.is_empty() {
        // Conditions and loads of both decks now correspond to each other.
        let curves = curves(old).into_iter().zip(curves(new));
        for ((name, before), (_, after)) in curves {
            if differ(&before, &after, time) {
                found.push(format!(
                    "the load curve of {} has changed before time {time}, which the run has reached",
                    quote(name)
                ));
            }
        }
    }
    found
}

/// Changes to a deck that prevent a run from continuing, each as a sentence. What `changes` allows may change, and so
/// may the properties of a material, except its density, if none of them varies in space, and everything about loads
/// and boundary conditions except their names, types and surfaces.
pub fn changes_during_run(old: &Deck, new: &Deck) -> Vec<String> {
    let of = |deck: &Deck| {
        let mut value = essential(deck);
        let Some(map) = value.as_object_mut() else { return value };
        // Values outside formulas are already inserted in the deck.
        let formulas = formulas_of_bodies(deck);
        let used = names_in(&formulas);
        if let Some(parameters) = map.get_mut("parameters").and_then(Value::as_object_mut) {
            parameters.retain(|name, _| used.contains(name.as_str()));
        }
        let keep = |entry: &mut Value, keys: &[&str]| {
            entry.as_object_mut().map(|entry| entry.retain(|key, _| keys.contains(&key.as_str())))
        };
        for (name, material) in map.get_mut("materials").and_then(Value::as_object_mut).into_iter().flatten()
        {
            // The points keep the values of properties that vary.
            let varies = |deck: &Deck| {
                let material = deck.materials.get(name);
                let mut properties = material.map(MaterialDeck::properties).into_iter().flatten();
                properties.any(|(_, property)| property.as_formula().is_some())
            };
            if !varies(old) && !varies(new) {
                keep(material, &["model", "density", "file"]);
            }
        }
        for section in ["boundary_conditions", "loads"] {
            for entry in map.get_mut(section).and_then(Value::as_array_mut).into_iter().flatten() {
                keep(entry, &["name", "type", "surface"]);
            }
        }
        value
    };
    let mut found = Vec::new();
    compare("", &of(old), &of(new), &mut found);
    found
}

/// The number, in the deck `new`, of the step that ends at `time`: its number `own` in the run of the deck `old` or, if
/// the number of requested steps up to that time has changed, the larger of `own` and the new number, so that no file
/// of an earlier step is overwritten. `None` after the end of the analysis.
pub fn step_at([old, new]: [&Deck; 2], time: f64, own: usize) -> Option<usize> {
    if time > new.end_time() * (1.0 + SAME) {
        return None;
    }
    let requested = requested_at(new, time);
    // If steps grow, there are fewer of them than requested.
    let changed = requested.filter(|_| requested != requested_at(old, time));
    Some(changed.map_or(own, |requested| own.max(requested)))
}

/// The number of the requested step of a deck that ends at a time; `None` if none does.
fn requested_at(deck: &Deck, time: f64) -> Option<usize> {
    let end = deck.end_time();
    let (mut start, mut before) = (0.0, 0);
    for (_, steps) in deck.courses() {
        let (count, duration) = (f64::from(steps.count()), steps.end_time);
        if time <= (start + duration) * (1.0 + SAME) {
            let requested = ((time - start) / duration * count).round();
            let matches = (start + duration * (requested / count) - time).abs() <= SAME * end;
            return matches.then_some(before + requested as usize);
        }
        start += duration;
        before += steps.count() as usize;
    }
    None
}

/// The number of requested steps of a strength reduction that begins above 1, if a time lies within the first of them:
/// the factors in this step depend on it.
fn count_of_jump(deck: &Deck, time: f64) -> Option<u32> {
    let mut start = 0.0;
    for (_, steps) in deck.courses() {
        let first = steps.end_time / f64::from(steps.count());
        let jumps = matches!(steps.control, ControlDeck::StrengthReduction { from, .. } if from > 1.0);
        if jumps && time > start + SAME * deck.end_time() && time < start + first - SAME * deck.end_time() {
            return Some(steps.count());
        }
        start += steps.end_time;
    }
    None
}

/// True if a time is the end of the analysis.
pub fn is_end(deck: &Deck, time: f64) -> bool {
    (time - deck.end_time()).abs() <= SAME * deck.end_time()
}

/// A deck without the parts that may change.
fn essential(deck: &Deck) -> Value {
    let mut value = serde_json::to_value(deck).unwrap_or_default();
    let formulas = [formulas_of_loading(deck), formulas_of_bodies(deck)].concat();
    let used = names_in(&formulas);
    if let Some(map) = value.as_object_mut() {
        for key in ["title", "solver", "checkpoint"] {
            map.remove(key);
        }
        // Step sizes may change, and so may the limit to which a strength reduction cuts them; the control may not.
        if let Some(steps) = map.get_mut("steps").and_then(Value::as_object_mut) {
            steps.retain(|key, _| key == "control");
            without_ends_of_search(steps);
        }
        for stage in map.get_mut("stages").and_then(Value::as_array_mut).into_iter().flatten() {
            let Some(stage) = stage.as_object_mut() else { continue };
            stage.retain(|key, _| !["name", "solver", "every"].contains(&key.as_str()));
            // The duration of a stage sets the times of the curves.
            if let Some(steps) = stage.get_mut("steps").and_then(Value::as_object_mut) {
                steps.retain(|key, _| ["control", "end_time"].contains(&key.as_str()));
                without_ends_of_search(steps);
            }
        }
        if let Some(output) = map.get_mut("output").and_then(Value::as_object_mut) {
            output.retain(|key, _| key == "probes");
        }
        if let Some(parameters) = map.get_mut("parameters").and_then(Value::as_object_mut) {
            // The values of the other parameters are already inserted in the deck.
            parameters.retain(|name, _| used.contains(name.as_str()));
        }
        for section in ["boundary_conditions", "loads"] {
            for entry in map.get_mut(section).and_then(Value::as_array_mut).into_iter().flatten() {
                entry.as_object_mut().map(|entry: &mut Map<String, Value>| entry.remove("curve"));
            }
        }
    }
    value
}

/// Removes from a control what decides only where the search for a factor of safety ends.
fn without_ends_of_search(steps: &mut Map<String, Value>) {
    if let Some(control) = steps.get_mut("control").and_then(Value::as_object_mut) {
        control.retain(|key, _| !["tolerance", "after_slide"].contains(&key.as_str()));
    }
}

/// Names and curves of all loads, and of the boundary conditions that move nodes or surfaces.
fn curves(deck: &Deck) -> Vec<(&str, LoadCurve)> {
    let has_course = |curve: Option<&crate::LoadCurve>| curve.is_none() && !deck.stages.is_empty();
    let moving = deck.boundary_conditions.iter().filter(|condition| !condition.displacements().is_empty());
    let condition_change = |condition: &BoundaryConditionDeck| match condition.curve.as_ref() {
        curve if has_course(curve) => course(deck, &condition.name, 0.0),
        curve => load_curve(curve, deck.end_time()),
    };
    let load_change = |load: &LoadDeck| match load.curve() {
        curve if has_course(curve) => course(deck, load.name(), initial_factor(deck, load)),
        _ => curve_of(deck, load),
    };
    let conditions = moving.map(|condition| (condition.name.as_str(), condition_change(condition)));
    let loads = deck.loads.iter().map(|load| (load.name(), load_change(load)));
    conditions.chain(loads).collect()
}

/// The factor of a load or boundary condition without a curve, over all stages; `initial` is its factor before them.
fn course(deck: &Deck, name: &str, initial: f64) -> LoadCurve {
    let (mut time, mut factor) = (0.0, initial);
    let mut pairs = vec![[time, factor]];
    for stage in &deck.stages {
        time += stage.steps.end_time;
        factor = stage.factors.get(name).copied().unwrap_or(factor);
        pairs.push([time, factor]);
    }
    LoadCurve::table(pairs)
}

/// True if two piecewise linear curves differ at or before a time.
fn differ(before: &LoadCurve, after: &LoadCurve, time: f64) -> bool {
    let times = before.times().chain(after.times()).filter(|t| (0.0..time).contains(t));
    times.chain([0.0, time]).any(|t| {
        let (a, b) = (before.factor(t), after.factor(t));
        (a - b).abs() > SAME * a.abs().max(b.abs())
    })
}

/// Collects the differences between two values, each with its path.
fn compare(path: &str, old: &Value, new: &Value, found: &mut Vec<String>) {
    match (old, new) {
        (Value::Object(a), Value::Object(b)) => {
            let keys: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            for key in keys {
                let at = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                compare(&at, a.get(key).unwrap_or(&Value::Null), b.get(key).unwrap_or(&Value::Null), found);
            }
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            for (index, (a, b)) in a.iter().zip(b).enumerate() {
                compare(&format!("{path}[{index}]"), a, b, found);
            }
        }
        _ if old != new => found.push(format!("`{path}` was {} and is {}", shown(old), shown(new))),
        _ => {}
    }
}

fn shown(value: &Value) -> String {
    match value {
        Value::Null => "absent".to_owned(),
        value => {
            let text = value.to_string();
            let short: String = text.chars().take(LONGEST).collect();
            if short.len() < text.len() { format!("{short}…") } else { text }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::load_text;

    fn deck(change: &[(&str, &str)]) -> Deck {
        let mut text = std::fs::read_to_string("../../inputs/beam.yaml").unwrap();
        for (a, b) in change {
            assert!(text.contains(a), "{a}");
            text = text.replace(a, b);
        }
        load_text("deck.yaml", text.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}")).deck
    }

    #[test]
    fn parts_that_past_steps_depend_on_must_not_change() {
        let old = deck(&[]);
        for (change, says) in [
            (("12e6", "13e6"), "`materials"),
            (("h: 0.5", "h: 0.25"), "`grid.spacing` was 0.5 and is 0.25"),
            (("method: gimp", "method: mpm"), "method` was \"gimp\" and is \"mpm\""),
            (
                ("steps: {count: \"${steps}\"", "steps: {control: {type: arc-length}, count: \"${steps}\""),
                "`steps.control",
            ),
            (("total: [0, -100e3]", "total: [0, -90e3]"), "total[1]` was -100000.0 and is -90000.0"),
        ] {
            let found = changes(&old, &deck(&[change]), 0.5);
            assert!(
                !found.is_empty() && found.iter().any(|text| text.contains(says)),
                "{change:?}: {found:?}"
            );
        }
    }

    #[test]
    fn parameters_in_formulas_of_tools_count() {
        let tool = "\ntools: [{name: disc, shape: {type: circle, center: [5, 12], radius: 1}, uy: \"-sink*factor\"}]";
        let with = |sink: &str| {
            let text = std::fs::read_to_string("../../inputs/beam.yaml").unwrap();
            let text = text.replace("parameters: {", &format!("parameters: {{sink: {sink}, "));
            let text = text.replace("\nsteps: {", &format!("{tool}\nsteps: {{"));
            load_text("deck.yaml", text.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"))
        };
        let (old, new) = (with("0.1"), with("0.2"));
        assert!(!old.notes.iter().any(|note| note.message.contains("`sink`")), "{:?}", old.notes);
        for found in [changes(&old.deck, &new.deck, 0.5), changes_during_run(&old.deck, &new.deck)] {
            assert_eq!(found.len(), 1, "{found:?}");
            assert!(found[0].contains("sink"), "{found:?}");
        }
    }

    #[test]
    fn steps_output_and_later_loads_may_change() {
        let curve =
            |pairs: &str| deck(&[("total: [0, -100e3]", &format!("total: [0, -100e3], curve: {pairs}"))]);
        let old = curve("[[0, 0], [1, 1]]");
        assert!(changes(&old, &deck(&[]), 0.5).is_empty(), "the same load without a curve");
        for later in ["[[0, 0], [0.5, 0.5], [1, 3]]", "[[0, 0], [0.25, 0.25], [0.75, 0.75], [1, 0]]"] {
            assert!(changes(&old, &curve(later), 0.5).is_empty(), "{later}");
            assert_eq!(changes(&old, &curve(later), 0.9).len(), 1, "{later}");
        }
        assert_eq!(changes(&old, &curve("[[0, 0], [0.25, 0.3], [0.5, 0.5], [1, 1]]"), 0.5).len(), 1);
        let mut other = old.clone();
        other.title = None;
        other.steps.as_mut().unwrap().count = Some(200);
        other.solver.max_iterations = Some(7);
        other.output.every = 3;
        assert!(changes(&old, &other, 0.5).is_empty());
        other.steps.as_mut().unwrap().end_time = 2.0;
        assert!(changes(&old, &other, 0.5).is_empty(), "the curve is given and stays");
        let mut ramp = deck(&[]);
        ramp.steps.as_mut().unwrap().end_time = 2.0;
        assert_eq!(changes(&deck(&[]), &ramp, 0.5).len(), 1, "the ramp is less steep");
    }

    #[test]
    fn a_load_in_stages_may_get_or_lose_a_curve_that_agrees_so_far() {
        let stages = "stages: [{name: a, steps: {count: 4}}, {name: b, steps: {count: 4}}]";
        let steps = "steps: {count: \"${steps}\", smallest: \"${smallest}\"}";
        let with = |curve: &str| {
            deck(&[(steps, stages), ("total: [0, -100e3]", &format!("total: [0, -100e3]{curve}"))])
        };
        let without = with("");
        let (later, ramp) = (with(", curve: [[0, 0], [1, 0], [2, 1]]"), with(", curve: [[0, 0], [2, 1]]"));
        for time in [0.5, 1.0] {
            // Without a curve, the factor is 0 because no stage names it.
            for pair in [[&without, &later], [&later, &without]] {
                assert!(changes(pair[0], pair[1], time).is_empty(), "{:?}", changes(pair[0], pair[1], time));
            }
            for pair in [[&without, &ramp], [&ramp, &without]] {
                assert_eq!(changes(pair[0], pair[1], time).len(), 1);
            }
        }
        assert_eq!(changes(&without, &later, 1.5).len(), 1);
    }

    #[test]
    fn a_search_for_the_factor_of_safety_may_become_finer() {
        let text = std::fs::read_to_string("../../inputs/slope.yaml").unwrap();
        let of = |change: [&str; 2]| {
            assert!(text.contains(change[0]));
            load_text("slope.yaml", text.replace(change[0], change[1]).as_bytes(), &[]).unwrap().deck
        };
        let old = of(["tolerance: 0.005", "tolerance: 0.01"]);
        assert!(changes(&old, &of(["tolerance: 0.005", "tolerance: 0.001"]), 1.5).is_empty());
        let found = changes(&old, &of(["from: 1,", "from: 1.1,"]), 1.5);
        assert!(found.iter().any(|text| text.contains("control.from` was 1.0 and is 1.1")), "{found:?}");
        let on = of(["after_slide: stop", "after_slide: continue"]);
        assert!(changes(&old, &on, 1.5).is_empty(), "and may go on after a slide");
    }

    #[test]
    fn the_first_step_of_a_search_that_begins_above_1_keeps_its_factors() {
        let text =
            std::fs::read_to_string("../../inputs/slope.yaml").unwrap().replace("from: 1,", "from: 1.1,");
        let of = |count: &str| {
            let counts: Vec<&str> = text.split("count: 6").collect();
            assert!(counts.len() > 1, "the deck has other counts");
            let text = counts.join(&format!("count: {count}"));
            load_text("slope.yaml", text.as_bytes(), &[]).unwrap().deck
        };
        let (old, new) = (of("6"), of("12"));
        let in_first = old.stages[0].steps.end_time + 0.03;
        assert!(changes(&old, &new, in_first).iter().any(|text| text.contains("`count` has changed")));
        assert!(changes(&old, &new, in_first + 0.5).is_empty());
        assert!(changes(&old, &old, in_first).is_empty());
    }

    #[test]
    fn steps_keep_their_numbers_or_get_larger_ones() {
        let mut deck = deck(&[]);
        let old = deck.clone();
        assert_eq!(old.step_count(), 50);
        for (count, own, step) in [
            (50, 25, 25),
            (50, 5, 5), // steps have grown
            (100, 25, 50),
            (10, 25, 25),
            (25, 25, 25), // in the middle of a requested step
            (75, 25, 25),
            (50, 31, 31), // some of the steps were cut
        ] {
            deck.steps.as_mut().unwrap().count = Some(count);
            assert_eq!(step_at([&old, &deck], 0.5, own), Some(step), "{count}");
        }
        deck.steps.as_mut().unwrap().count = Some(3);
        assert_eq!(step_at([&old, &deck], 2.0 / 3.0, 0), Some(2));
        assert_eq!(step_at([&old, &deck], 1.0, 50), Some(50));
        assert!(is_end(&deck, 1.0) && !is_end(&deck, 0.999));
        deck.steps.as_mut().unwrap().end_time = 0.4;
        assert_eq!(step_at([&old, &deck], 0.5, 25), None);
    }
}
