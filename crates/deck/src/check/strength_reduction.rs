//! Checks of analyses and stages that reduce the strength.

use super::Check;
use super::steps::{TimedStage, depends_on_time, stands_still};
use crate::diagnostic::{Diagnostic, Severity};
use crate::initial_stress::{InitialStressDeck, curve_of, initial_factor};
use crate::quoting::quote;
use crate::{BodyDeck, BoundaryConditionDeck, ControlDeck, LoadCurve, LoadDeck, StageDeck, ToolDeck};

impl Check<'_> {
    /// Checks that loads, boundary conditions and tools stay constant in an analysis, or in a stage, while the strength
    /// is reduced.
    pub(super) fn constant_loads(&mut self, control: &str, stage: Option<TimedStage>) {
        let deck = self.deck;
        let stays = |name: &str, curve: Option<&LoadCurve>| match (stage, curve) {
            (Some(stage), _) if stage.deck.factors.contains_key(name) => false,
            (Some(stage), Some(curve)) => stands_still(curve, stage.times),
            (Some(_), None) => true,
            (None, Some(curve)) => stands_still(curve, [0.0, deck.end_time()]),
            (None, None) => false,
        };
        let changing_load = deck.loads.iter().find(|load| {
            let is_held = stage.is_none() && initial_factor(deck, load) == 1.0;
            !(load.magnitude().1 || stays(load.name(), load.curve()) || is_held && load.curve().is_none())
        });
        let moves = |condition: &&BoundaryConditionDeck| {
            condition.moves() && !stays(&condition.name, condition.curve.as_ref())
        };
        let times = stage.map_or([0.0, deck.end_time()], |stage| stage.times);
        let changes = |tool: &&ToolDeck| {
            let stays =
                |curve: &Option<LoadCurve>| curve.as_ref().is_some_and(|curve| stands_still(curve, times));
            let motion = tool.motion();
            let moves = motion.iter().any(|(_, _, value)| !value.is_zero());
            let varies = motion.iter().any(|(_, _, value)| depends_on_time(value));
            varies
                || moves && !stays(&tool.curve)
                || tool.weight.is_some() && !stays(&tool.weight_curve)
                || tool.loads.iter().any(|load| !stays(&load.curve))
        };
        let condition = deck.boundary_conditions.iter().find(moves);
        let name = changing_load.map(|load| ("load", load.name()));
        let name = name.or(condition.map(|condition| ("boundary condition", condition.name.as_str())));
        let name = name.or(deck.tools.iter().find(changes).map(|tool| ("tool", tool.name.as_str())));
        if let Some((kind, name)) = name {
            let message = match kind {
                "tool" => format!(
                    "the tool {} moves, or its loads change, while the strength is reduced",
                    quote(name)
                ),
                _ => format!("the {kind} {} changes while the strength is reduced", quote(name)),
            };
            let help = match kind {
                "tool" => {
                    "move the tool and change its loads in an earlier stage, or keep their curves constant"
                }
                _ => "change it in an earlier stage, or keep its curve constant",
            };
            self.error("D049", control, message, help);
        }
        let changed = stage.and_then(|stage| {
            let StageDeck { add, remove, release, set, material, .. } = stage.deck;
            let lists = [
                ("add", add.is_empty()),
                ("remove", remove.is_empty()),
                ("release", release.is_empty()),
                ("set", set.is_empty()),
                ("material", material.is_empty()),
            ];
            lists.into_iter().find(|(_, is_empty)| !is_empty).map(|(key, _)| key)
        });
        if let Some(key) = changed {
            let message = format!(
                "the stage reduces the strength, but its `{key}` takes effect gradually over the whole stage, so that \
                 the factor of safety would belong to an intermediate state"
            );
            let help = format!("move `{key}` to a stage before this one");
            self.error("D049", control, message, &help);
        }
    }

    /// Checks that the bodies carry something while the stage with this number reduces the strength: a load, a
    /// prescribed motion, a tool or an initial stress. A geostatic stress does not count, because an earlier stage may
    /// have removed the weight that it carries. A motion counts even if it has been reversed, because it may have left
    /// stresses.
    pub(super) fn something_to_carry(&mut self, control: &str, number: usize) {
        let deck = self.deck;
        let so_far = deck.stages.get(..=number).unwrap_or_default();
        let factors = |name: &str| -> Vec<f64> {
            so_far.iter().filter_map(|stage| stage.factors.get(name).copied()).collect()
        };
        let has_begun = |name: &str| so_far.is_empty() || factors(name).iter().any(|factor| *factor != 0.0);
        let end = if so_far.is_empty() {
            deck.end_time()
        } else {
            so_far.iter().map(|stage| stage.steps.end_time).sum()
        };
        let factor_at_end = |load: &LoadDeck| match (load.curve(), so_far.is_empty()) {
            (None, false) => {
                factors(load.name()).last().copied().unwrap_or_else(|| initial_factor(deck, load))
            }
            _ => curve_of(deck, load).factor(end),
        };
        let mut loads = deck.loads.iter().filter(|load| !load.magnitude().1);
        let is_loaded = loads.any(|load| factor_at_end(load) != 0.0);
        let mut moving = deck.boundary_conditions.iter().filter(|condition| condition.moves());
        let is_moved = moving.any(|condition| condition.curve.is_some() || has_begun(&condition.name));
        let is_stressed = |body: &BodyDeck| match &body.initial_stress {
            Some(stress @ InitialStressDeck::Components { .. }) => !stress.is_zero(),
            Some(InitialStressDeck::Geostatic { .. }) | None => false,
        };
        let is_pushed = deck.tools.iter().any(ToolDeck::acts);
        if is_loaded || is_moved || is_pushed || deck.bodies.iter().any(is_stressed) {
            return;
        }
        let message = "nothing loads the bodies while their strength is reduced, so they never fail";
        let help = "apply the loads in an earlier stage, for example with `factors: {weight: 1}`, or give the bodies \
                    an `initial_stress`";
        self.error("D065", control, message, help);
    }

    /// Notes that one strength reduction follows another.
    pub(super) fn repeated_reductions(&mut self) {
        let reduces =
            |stage: &&StageDeck| matches!(stage.steps.control, ControlDeck::StrengthReduction { .. });
        let deck = self.deck;
        let Some(first) = deck.stages.iter().find(reduces) else { return };
        for (number, stage) in deck.stages.iter().enumerate().filter(|(_, stage)| reduces(stage)).skip(1) {
            let message = format!(
                "the stage {} reduces the strength again: the bodies have already yielded in the stage {}, and they keep \
                 the displacements from it",
                quote(&stage.name),
                quote(&first.name)
            );
            let help = "end the earlier reduction well below failure (`to`), or find this factor in a separate deck \
                        without the earlier reduction";
            let at = format!("/stages/{number}/steps/control");
            let found = Diagnostic::at(self.source, "D066", &at, message).severity(Severity::Note);
            self.found.push(found.help(help));
        }
    }
}
