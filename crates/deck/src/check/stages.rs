//! Checks of the stages of a deck.

use std::collections::BTreeMap;

use super::Check;
use crate::gates::Checks;
use crate::quoting::quote;
use crate::references::{Noun, unknown_reference};
use crate::span::escape;
use crate::{ControlDeck, LoadDeck, MaterialDeck, Parameter, StageDeck};

/// Shortest step relative to the time at which its stage begins, [-].
const SHORTEST: f64 = 1e-9;

/// The word for bodies.
const BODY: Noun = Noun::new("body", "bodies");

/// A list of what begins or ends in a stage.
struct Listed {
    /// Its key in the stage.
    key: &'static str,
    /// Selects the names in the list.
    names: fn(&StageDeck) -> Vec<&str>,
}

impl Check<'_> {
    /// Checks the names in the stages, and that each change is possible in its stage.
    pub(super) fn stages(&mut self) {
        let deck = self.deck;
        match (&deck.steps, deck.stages.is_empty()) {
            (None, true) if self.source.span_of("/stages").is_some() => {
                let help = "add a stage, such as `- {name: load, steps: {count: 10}}`, or replace `stages` by `steps: {count: 10}`";
                self.error("D053", "/stages", "the list of stages is empty", help);
            }
            (None, true) => {
                let help = "add `steps: {count: 10}`, or `stages` with steps of their own";
                self.error("D053", "", "the deck has neither `steps` nor `stages`", help);
            }
            (Some(_), false) => {
                let message = "the deck has both `stages` and `steps`";
                self.error("D053", "/steps", message, "remove `steps`: each stage has its own");
            }
            _ => {}
        }
        self.unique_names("/stages", deck.stages.iter().map(|stage| stage.name.as_str()));
        let bodies: Vec<&str> = deck.bodies.iter().map(|body| body.name.as_str()).collect();
        let conditions: Vec<&str> = deck.boundary_conditions.iter().map(|c| c.name.as_str()).collect();
        let added = Listed { key: "add", names: StageDeck::added };
        let removed = Listed { key: "remove", names: StageDeck::removed };
        self.turns(BODY, &bodies, added, removed);
        let set = Listed { key: "set", names: StageDeck::conditions_set };
        let released = Listed { key: "release", names: StageDeck::conditions_released };
        self.turns(Noun::new("boundary condition", "boundary conditions"), &conditions, set, released);
        self.durations();
        let mut is_there: BTreeMap<&str, bool> =
            bodies.iter().map(|&name| (name, deck.begins_present(name))).collect();
        for (number, stage) in deck.stages.iter().enumerate() {
            for (list, begins) in [(stage.removed(), false), (stage.added(), true)] {
                list.into_iter().for_each(|name| {
                    is_there.insert(name, begins);
                });
            }
            self.grounds(number, stage, &|name| is_there.get(name) == Some(&true));
            self.absent_bodies(number, stage, &|name| is_there.get(name) == Some(&false));
            self.factors(number, stage);
            for (body, material) in &stage.material {
                let at = format!("/stages/{number}/material/{}", escape(body));
                if !bodies.contains(&body.as_str()) {
                    self.unknown_key(&at, BODY, body, bodies.clone());
                }
                if !deck.materials.contains_key(material) {
                    let names = deck.materials.keys().map(String::as_str).collect();
                    self.unknown_reference(&at, Noun::new("material", "materials"), material, names);
                }
                self.density_without_effect(&at, body, material);
            }
            let changes = [
                ("add", !stage.add.is_empty()),
                ("remove", !stage.remove.is_empty()),
                ("set", !stage.set.is_empty()),
                ("release", !stage.release.is_empty()),
                ("material", !stage.material.is_empty()),
            ];
            for (key, _) in changes.iter().filter(|(_, given)| number == 0 && *given) {
                let message =
                    format!("`{key}` cannot be used in the first stage: there is no earlier stage to change");
                let help =
                    "describe the initial state in the rest of the deck, or put a stage before this one";
                self.error("D053", &format!("/stages/0/{key}"), message, help);
            }
        }
    }

    /// Checks the bodies onto which a stage places others.
    fn grounds(&mut self, number: usize, stage: &StageDeck, is_present: &dyn Fn(&str) -> bool) {
        let deck = self.deck;
        for (index, added) in stage.add.iter().enumerate() {
            let Some(ground) = added.onto() else { continue };
            let at = format!("/stages/{number}/add/{index}/onto");
            let names: Vec<&str> = deck.bodies.iter().map(|body| body.name.as_str()).collect();
            let later: Vec<&str> = stage.added().split_off(index);
            if !names.contains(&ground) {
                self.unknown_reference(&at, BODY, ground, names);
            } else if later.contains(&ground) || !is_present(ground) {
                let body = quote(added.name());
                let message = match ground == added.name() {
                    true => format!("the body {body} is placed onto itself"),
                    false => {
                        format!("the body {body} is placed onto {}, which is not yet present", quote(ground))
                    }
                };
                let help =
                    "give a body that is present before this stage, or that stands before this one in `add`";
                self.error("D053", &at, message, help);
            }
        }
    }

    /// Warns if the material that a stage gives to a body has another density than the body.
    fn density_without_effect(&mut self, at: &str, body: &str, material: &str) {
        let deck = self.deck;
        let Some(present) = deck.bodies.iter().find(|other| other.name == body) else { return };
        let density = |name: &str| deck.materials.get(name).and_then(MaterialDeck::density);
        if density(material).is_some_and(|new| density(&present.material).is_some_and(|old| old != new)) {
            let message = format!(
                "the density of the material {} has no effect: the points of the body {} keep their mass, which follows \
                 from the density of {}",
                quote(material),
                quote(body),
                quote(&present.material)
            );
            let help =
                "give both materials the same density, or let the stage remove the body and add another one";
            self.warn("D037", at, message, help);
        }
    }

    /// Checks that the steps of each stage can be told apart by their times.
    fn durations(&mut self) {
        let deck = self.deck;
        let mut start = 0.0;
        for (number, stage) in deck.stages.iter().enumerate() {
            let step = stage.steps.end_time / f64::from(stage.steps.count().max(1));
            if step < SHORTEST * start {
                let last = match stage.steps.count() {
                    1 => format!("the step of this stage lasts {step:e}, too short to be resolved"),
                    _ => format!(
                        "the steps of this stage last {step:e} each, too short for their times to differ"
                    ),
                };
                let start = Parameter::Number(start);
                let message = format!("{last} after time {start}");
                let help = "give the stages similar durations (`steps: {end_time}`): time serves only to order the loading";
                self.error("D053", &format!("/stages/{number}/steps"), message, help);
            }
            start += stage.steps.end_time;
        }
    }

    /// Checks what a stage says about absent bodies.
    fn absent_bodies(&mut self, number: usize, stage: &StageDeck, is_absent: &dyn Fn(&str) -> bool) {
        let deck = self.deck;
        if let ControlDeck::Displacement { probe: Some(probe), .. } = &stage.steps.control {
            let probe = deck.output.probes.iter().find(|other| other.name == *probe);
            if let Some(probe) = probe.filter(|probe| is_absent(&probe.body)) {
                let message = format!(
                    "the probe {} follows the body {}, which is absent in this stage",
                    quote(&probe.name),
                    quote(&probe.body)
                );
                let at = format!("/stages/{number}/steps/control/probe");
                self.error("D053", &at, message, "choose a probe of a body that is present");
            }
        }
        for name in stage.factors.keys() {
            let Some(load) = deck.loads.iter().find(|load| load.name() == name) else { continue };
            let surface = load.surface().and_then(|name| deck.surfaces.iter().find(|s| s.name == name));
            let surface_body = surface.map(|surface| std::slice::from_ref(&surface.body));
            let Some(bodies) = surface_body.or_else(|| load.bodies()) else { continue };
            if !bodies.is_empty() && bodies.iter().all(|body| is_absent(body)) {
                let (what, help) = match bodies {
                    [body] => (
                        format!("on the body {}, which is absent", quote(body)),
                        "remove its factor, or add the body",
                    ),
                    _ => (
                        "only on bodies that are absent".to_owned(),
                        "remove its factor, or add one of the bodies",
                    ),
                };
                let message = format!("the load {} acts {what} in this stage", quote(name));
                self.warn("D037", &format!("/stages/{number}/factors/{}", escape(name)), message, help);
            }
        }
    }

    /// Checks that bodies come and go, or boundary conditions are set and released, in turn.
    fn turns(&mut self, kind: Noun, names: &[&str], begin: Listed, end: Listed) {
        let deck = self.deck;
        let Listed { key: begin, names: begins } = begin;
        let Listed { key: end, names: ends } = end;
        let mut is_there: BTreeMap<&str, bool> =
            names.iter().map(|&name| (name, deck.is_there_at_start(name, begins, ends))).collect();
        for (number, stage) in deck.stages.iter().enumerate() {
            // Everything that ends in a stage does so before anything begins.
            for (key, list, begins) in [(end, ends(stage), false), (begin, begins(stage), true)] {
                for (index, name) in list.into_iter().enumerate() {
                    let at = format!("/stages/{number}/{key}/{index}");
                    match is_there.get_mut(name) {
                        None => self.unknown_reference(&at, kind, name, names.to_vec()),
                        Some(there) if *there == begins => {
                            let state = match (kind, begins) {
                                (BODY, true) => "already present",
                                (BODY, false) => "not present",
                                (_, true) => "already acting",
                                (_, false) => "not acting",
                            };
                            let message =
                                format!("the {} {} is {state} before this stage", kind.one, quote(name));
                            let help = format!("remove it from `{key}`, or correct an earlier stage");
                            self.error("D053", &at, message, help);
                        }
                        Some(there) => *there = begins,
                    }
                }
            }
            if kind == BODY && !is_there.is_empty() && is_there.values().all(|there| !there) {
                let later = deck.stages.iter().position(|stage| !begins(stage).is_empty());
                if let (0, Some(later), true) = (number, later, ends(stage).is_empty()) {
                    let message = "no body is present before this stage: a body that a stage adds is absent at the start";
                    let help = "remove a body from `add`, or leave another body present at the start";
                    self.error("D053", &format!("/stages/{later}/{begin}"), message, help);
                } else if !ends(stage).is_empty() {
                    let message = "no body is left in this stage";
                    let help = "keep at least one body";
                    self.error("D053", &format!("/stages/{number}/{end}"), message, help);
                }
            }
        }
    }

    /// Reports a key that refers to nothing.
    fn unknown_key(&mut self, pointer: &str, kind: Noun, name: &str, names: Vec<&str>) {
        let mut found = unknown_reference(self.source, pointer, kind, name, names);
        found.span = self.source.key_span_of(pointer).or(found.span);
        self.found.push(found);
    }

    /// Checks that the factors of a stage belong to loads, or to boundary conditions that move nodes, without curves.
    fn factors(&mut self, number: usize, stage: &StageDeck) {
        let deck = self.deck;
        for name in stage.factors.keys() {
            let at = format!("/stages/{number}/factors/{}", escape(name));
            let load = deck.loads.iter().find(|load| load.name() == name);
            let condition = deck.boundary_conditions.iter().find(|condition| condition.name == *name);
            let curve = match (load, condition) {
                (Some(_), Some(_)) => {
                    let message = format!("a load and a boundary condition are both called {}", quote(name));
                    self.error_at_key("D053", &at, message, "give one of the two another name");
                    continue;
                }
                (Some(load), None) => load.curve(),
                (None, Some(condition)) if condition.displacements().is_empty() => {
                    let message = format!("the boundary condition {} moves no nodes", quote(name));
                    self.error_at_key("D053", &at, message, "remove its factor");
                    continue;
                }
                (None, Some(condition)) => condition.curve.as_ref(),
                (None, None) => {
                    let conditions = deck.boundary_conditions.iter();
                    let moving = conditions.filter(|condition| !condition.displacements().is_empty());
                    let names = deck.loads.iter().map(LoadDeck::name).chain(moving.map(|c| c.name.as_str()));
                    let kind =
                        Noun::new("load or prescribed displacement", "loads and prescribed displacements");
                    self.unknown_key(&at, kind, name, names.collect());
                    continue;
                }
            };
            if curve.is_some() {
                let message = format!("{} has a curve, and also a factor in this stage", quote(name));
                self.error_at_key("D053", &at, message, "remove the curve, or the factor");
            }
        }
    }
}
