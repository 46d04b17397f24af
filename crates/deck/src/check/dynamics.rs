//! Checks of motion with inertia.

use std::collections::BTreeMap;

use super::Check;
use crate::quoting::quote;
use crate::{AtLimit, BodyDeck, ControlDeck, SchemeDeck, StageDeck, Until};

impl Check<'_> {
    /// Checks the motion of each stage: bodies have a density, steps have a size, and controls suit inertia.
    pub(super) fn dynamics(&mut self) {
        let deck = self.deck;
        if deck.dynamic.is_some() && !deck.stages.is_empty() {
            let message = "each of several stages says itself whether it moves bodies with inertia";
            self.error("D080", "/dynamic", message, "move `dynamic` into the stages that need it");
        }
        for (number, stage) in
            deck.stages.iter().enumerate().filter(|(_, stage)| stage.at_limit == AtLimit::Next)
        {
            let at = format!("/stages/{number}/at_limit");
            if stage.dynamic.is_some() {
                let help = "remove `at_limit`: a motion has no limit";
                self.error("D080", &at, "a stage with inertia always finds a next step", help);
            } else if deck.dynamic(number + 1).is_none() || number + 1 == deck.stages.len() {
                let message = "no stage with inertia follows that could go on from the limit";
                self.error("D080", &at, message, "add `dynamic: {}` to the next stage");
            }
        }
        for (number, stage) in deck.stages.iter().enumerate() {
            self.absorbing(number, stage);
        }
        self.free_tools();
        for (number, (pointer, steps)) in deck.courses().into_iter().enumerate() {
            let dynamic = deck.dynamic(number);
            match (steps.count, steps.size) {
                (None, None) => {
                    let help = "add `count: 10`, or the duration of a step: `size: 0.01`";
                    self.error("D080", &pointer, "the number of steps is missing", help);
                }
                (Some(_), Some(_)) => {
                    let message = "`count` and `size` both state the number of steps";
                    self.error("D080", &format!("{pointer}/size"), message, "remove `count` or `size`");
                }
                _ => {}
            }
            let Some(dynamic) = dynamic else {
                if steps.until == Until::Rest {
                    let message = "only bodies that move with inertia come to rest";
                    let help = "remove `until`, or add `dynamic: {}`";
                    self.error("D080", &format!("{pointer}/until"), message, help);
                }
                continue;
            };
            let at = match deck.stages.is_empty() {
                true => "/dynamic".to_owned(),
                false => format!("/stages/{number}/dynamic"),
            };
            if dynamic.spectral_radius.is_some() && dynamic.scheme != SchemeDeck::GeneralisedAlpha {
                let message = "only the generalised-α method has a spectral radius";
                let help = "add `scheme: generalised-alpha`, or remove `spectral_radius`";
                self.error("D080", &format!("{at}/spectral_radius"), message, help);
            }
            let rayleigh = dynamic.damping.map_or([0.0; 2], |damping| damping.rayleigh);
            if rayleigh.iter().any(|factor| *factor < 0.0 || !factor.is_finite()) {
                let help = "state two numbers of at least 0";
                self.error("D080", &format!("{at}/damping/rayleigh"), "damping must not be negative", help);
            }
            if !matches!(steps.control, ControlDeck::Load {}) {
                let message = "with inertia, loads follow from time: they cannot follow from equilibrium, nor can strength be reduced";
                let help = "remove `control`, or `dynamic`";
                self.error("D080", &format!("{pointer}/control"), message, help);
            }
            if steps.until == Until::Limit {
                let message = "with inertia, bodies move on beyond any limit load";
                self.error(
                    "D080",
                    &format!("{pointer}/until"),
                    message,
                    "use `until: rest`, or remove `until`",
                );
            }
            self.masses(&at);
        }
    }

    /// Checks that tools do not move freely where inertia counts: they have no mass of their own.
    fn free_tools(&mut self) {
        let deck = self.deck;
        if !deck.has_inertia() {
            return;
        }
        for (number, tool) in deck.tools.iter().enumerate().filter(|(_, tool)| !tool.free.is_empty()) {
            let message = format!("the tool {} moves freely, but a tool has no mass", quote(&tool.name));
            let help =
                "prescribe its motion, or model it as a stiff body that has a density, with `contacts`";
            self.error("D080", &format!("/tools/{number}/free"), message, help);
        }
    }

    /// Checks the boundaries that a stage lets absorb waves.
    fn absorbing(&mut self, number: usize, stage: &StageDeck) {
        let deck = self.deck;
        let Some(_) = stage.absorb.first() else { return };
        let place = format!("/stages/{number}/absorb");
        if stage.dynamic.is_none() {
            let help = "add `dynamic: {}` to the stage";
            return self.error("D080", &place, "only bodies that move with inertia send out waves", help);
        }
        if number == 0 {
            let message =
                "the first stage cannot absorb waves: no stage before it says what the boundaries carry";
            return self.error(
                "D080",
                &place,
                message,
                "put a stage with loads but without inertia before it",
            );
        }
        if !stage.release.is_empty() || !stage.remove.is_empty() {
            let message = "what a stage releases goes at once, but what absorbing boundaries carry stays";
            return self.error("D080", &place, message, "release it in a stage of its own, after this one");
        }
        for (index, absorb) in stage.absorb.iter().enumerate() {
            let at = format!("{place}/{index}/condition");
            let found = deck.boundary_conditions.iter().find(|condition| condition.name == absorb.condition);
            if found.is_some_and(|condition| condition.surface.is_some()) {
                let message = "waves are absorbed at nodes of the grid, but this condition acts on a surface";
                self.error("D080", &at, message, "name a boundary condition with `nodes`");
            }
            if let Some(motion) = &absorb.motion
                && motion.axis as usize >= self.dimensions()
            {
                self.wrong_dimension(&format!("{place}/{index}/motion/axis"), "the axis `z`", 3);
            }
        }
    }

    /// Checks that the bodies have mass.
    fn masses(&mut self, at: &str) {
        let deck = self.deck;
        for body in &deck.bodies {
            let Some(material) = deck.materials.get(&body.material) else { continue };
            let is_zero = |density: &crate::Expression| density.as_number() == Some(0.0);
            if material.density().is_none_or(is_zero) {
                let message = format!(
                    "the body {} moves with inertia, but its material {} has no density",
                    quote(&body.name),
                    quote(&body.material)
                );
                self.error(
                    "D080",
                    at,
                    message,
                    format!("add `density` to the material {}", quote(&body.material)),
                );
            }
        }
    }

    /// Checks the velocity with which a body begins.
    pub(super) fn velocity(&mut self, pointer: &str, body: &BodyDeck) {
        let Some(velocity) = &body.velocity else { return };
        let at = format!("{pointer}/velocity");
        if velocity.len() != self.dimensions() {
            return self.wrong_count(&at, velocity.len());
        }
        let deck = self.deck;
        let parameters = &deck.parameters;
        let faults = match self.dimensions() {
            3 => crate::formulas::at_places::<3, 3>("velocity", velocity, &BTreeMap::new(), parameters).err(),
            _ => crate::formulas::at_places::<2, 2>("velocity", velocity, &BTreeMap::new(), parameters).err(),
        };
        self.formulas(pointer, faults.unwrap_or_default());
        let first = match deck.begins_present(&body.name) {
            true => Some(0),
            false => deck.stages.iter().position(|stage| stage.added().contains(&body.name.as_str())),
        };
        if first.is_some_and(|stage| deck.dynamic(stage).is_none()) {
            let message = format!(
                "the body {} has a velocity, but the stage in which it begins has no inertia",
                quote(&body.name)
            );
            let help = "add `dynamic: {}` to this stage, or remove `velocity`";
            self.error("D081", &at, message, help);
        }
    }
}
