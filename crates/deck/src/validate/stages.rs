//! Checks of the stages of a deck.

use std::collections::BTreeMap;

use super::Check;
use crate::quoting::quote;
use crate::{LoadDeck, StageDeck};

/// A list of names in a stage.
type Names = fn(&StageDeck) -> &Vec<String>;

impl Check<'_> {
    /// Checks the names in the stages, and that each change is possible where it stands.
    pub(super) fn stages(&mut self) {
        let deck = self.deck;
        match (&deck.steps, deck.stages.is_empty()) {
            (None, true) => {
                let help = "add `steps: {count: 10}`, or `stages` with steps of their own";
                self.error("D053", "", "the deck has neither `steps` nor `stages`", help);
            }
            (Some(_), false) => {
                let message = "the deck has `stages` and also `steps`";
                self.error("D053", "/steps", message, "remove `steps`: each stage has its own");
            }
            _ => {}
        }
        self.unique_names("/stages", deck.stages.iter().map(|stage| stage.name.as_str()));
        let bodies: Vec<&str> = deck.bodies.iter().map(|body| body.name.as_str()).collect();
        let conditions: Vec<&str> = deck.boundary_conditions.iter().map(|c| c.name.as_str()).collect();
        self.turns(("body", "bodies"), &bodies, [("add", |s| &s.add), ("remove", |s| &s.remove)]);
        let kind = ("boundary condition", "boundary conditions");
        self.turns(kind, &conditions, [("set", |s| &s.set), ("release", |s| &s.release)]);
        for (number, stage) in deck.stages.iter().enumerate() {
            self.factors(number, stage);
            for (body, material) in &stage.material {
                let at = format!("/stages/{number}/material/{body}");
                self.body(&at, body);
                if !deck.materials.contains_key(material) {
                    let names = deck.materials.keys().map(String::as_str).collect();
                    self.unknown_reference(&at, "material", "materials", material, names);
                }
            }
            let changes = [
                ("add", !stage.add.is_empty()),
                ("remove", !stage.remove.is_empty()),
                ("set", !stage.set.is_empty()),
                ("release", !stage.release.is_empty()),
                ("material", !stage.material.is_empty()),
            ];
            for (key, _) in changes.iter().filter(|(_, given)| number == 0 && *given) {
                let message = format!("`{key}` changes the first stage, before which there is nothing");
                let help = "describe the start in the rest of the deck, or put a stage before this one";
                self.error("D053", &format!("/stages/0/{key}"), message, help);
            }
        }
    }

    /// Checks lists of names that begin and end to be there, in turn.
    fn turns(
        &mut self,
        (one, several): (&str, &str),
        names: &[&str],
        [(begin, begins), (end, ends)]: [(&str, Names); 2],
    ) {
        let deck = self.deck;
        let mut is_there: BTreeMap<&str, bool> =
            names.iter().map(|&name| (name, deck.is_there_at_start(name, begins, ends))).collect();
        for (number, stage) in deck.stages.iter().enumerate() {
            // What ends makes room before something begins.
            for (key, list, begins) in [(end, ends(stage), false), (begin, begins(stage), true)] {
                for (index, name) in list.iter().enumerate() {
                    let at = format!("/stages/{number}/{key}/{index}");
                    match is_there.get_mut(name.as_str()) {
                        None => self.unknown_reference(&at, one, several, name, names.to_vec()),
                        Some(there) if *there == begins => {
                            let state = match (one, begins) {
                                ("body", true) => "already there",
                                ("body", false) => "not there",
                                (_, true) => "already acting",
                                (_, false) => "not acting",
                            };
                            let message = format!("the {one} {} is {state} before this stage", quote(name));
                            let help = format!("remove it from `{key}`, or correct an earlier stage");
                            self.error("D053", &at, message, help);
                        }
                        Some(there) => *there = begins,
                    }
                }
            }
            if one == "body" && !is_there.is_empty() && is_there.values().all(|there| !there) {
                let message = "no body is left in this stage";
                self.error("D053", &format!("/stages/{number}/remove"), message, "keep at least one body");
            }
        }
    }

    /// The factors of a stage belong to loads, or to boundary conditions that move nodes, without curves.
    fn factors(&mut self, number: usize, stage: &StageDeck) {
        let deck = self.deck;
        for name in stage.factors.keys() {
            let at = format!("/stages/{number}/factors/{name}");
            let load = deck.loads.iter().find(|load| load.name() == name);
            let condition = deck.boundary_conditions.iter().find(|condition| condition.name == *name);
            let curve = match (load, condition) {
                (Some(_), Some(_)) => {
                    let message = format!("a load and a boundary condition are both called {}", quote(name));
                    self.error("D053", &at, message, "give one of the two another name");
                    continue;
                }
                (Some(load), None) => load.curve(),
                (None, Some(condition)) if condition.displacements().is_empty() => {
                    let message = format!("the boundary condition {} moves no nodes", quote(name));
                    self.error("D053", &at, message, "remove its factor");
                    continue;
                }
                (None, Some(condition)) => condition.curve.as_ref(),
                (None, None) => {
                    let conditions = deck.boundary_conditions.iter();
                    let moving = conditions.filter(|condition| !condition.displacements().is_empty());
                    let names = deck.loads.iter().map(LoadDeck::name).chain(moving.map(|c| c.name.as_str()));
                    let (one, several) =
                        ("load or prescribed displacement", "loads and prescribed displacements");
                    self.unknown_reference(&at, one, several, name, names.collect());
                    continue;
                }
            };
            if curve.is_some() {
                let message = format!("{} has a curve, and also a factor in this stage", quote(name));
                self.error("D053", &at, message, "remove the curve, or the factor");
            }
        }
    }
}
