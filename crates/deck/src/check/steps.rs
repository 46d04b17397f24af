//! Checks of step controls other than load control.

use super::Check;
use crate::formulas::Displacement;
use crate::quoting::{quote, rounded};
use crate::references::{Noun, known_names};
use crate::{
    BoundaryConditionDeck, ControlDeck, Expression, GridDeck, LoadCurve, LoadDeck, StageDeck, StepsDeck,
    ToolDeck, Until,
};
use mpm_core::formula::names;
use mpm_files::shortest;

/// A displacement below this fraction of the grid size is round-off, [-].
const MIN_MOTION: f64 = 1e-12;
/// A usual tolerance of the strength reduction factor, [-].
const USUAL: f64 = 0.005;

/// A stage and its times.
#[derive(Clone, Copy)]
pub(super) struct TimedStage<'a> {
    pub(super) deck: &'a StageDeck,
    /// The times at which the stage begins and ends, [time].
    pub(super) times: [f64; 2],
}

/// True if the factor of a curve is constant between two times, [time].
pub(super) fn stands_still(LoadCurve(pairs): &LoadCurve, [start, end]: [f64; 2]) -> bool {
    let curve = mpm_core::model::LoadCurve::table(pairs.clone());
    let within = curve.times().filter(|time| (start..=end).contains(time));
    let mut factors = within.chain([end]).map(|time| curve.factor(time));
    factors.all(|factor| factor == curve.factor(start))
}

/// True if an expression is a formula that contains the variable `time`.
pub(super) fn depends_on_time(expression: &Expression) -> bool {
    let Expression::Formula(text) = expression else { return false };
    names(text).iter().any(|(_, name)| *name == "time")
}

impl Check<'_> {
    /// Checks step controls. With displacement and arc-length control, all loads must share one factor, and boundary
    /// conditions must not move nodes. With strength reduction, loads must stay constant, and the bodies must carry
    /// something.
    pub(super) fn control(&mut self) {
        let mut start = 0.0;
        for (number, (pointer, steps)) in self.deck.courses().into_iter().enumerate() {
            let times = [start, start + steps.end_time];
            if !matches!(steps.control, ControlDeck::Load {}) {
                self.quantity(&format!("{pointer}/control"), &steps.control);
                let stage = self.deck.stages.get(number).map(|deck| TimedStage { deck, times });
                if matches!(steps.control, ControlDeck::StrengthReduction { .. }) {
                    self.constant_loads(&format!("{pointer}/control"), stage);
                    self.something_to_carry(&format!("{pointer}/control"), number);
                } else {
                    self.common_factor(&format!("{pointer}/control"), stage);
                }
            }
            if steps.until == Until::Limit {
                self.limit(&pointer, steps, number + 1 == self.deck.courses().len());
            }
            start = times[1];
        }
    }

    /// Checks that steps can end at a limit load.
    fn limit(&mut self, pointer: &str, steps: &StepsDeck, is_last: bool) {
        let place = format!("{pointer}/until");
        if !is_last {
            let message = "only the last stage can end at its limit load: a later one begins with the motions that this one \
                           was to reach";
            return self.error("D049", &place, message, "remove `until`, or make this stage the last one");
        }
        let deck = self.deck;
        match steps.control {
            ControlDeck::StrengthReduction { .. } => {
                let message = "a strength reduction has a factor of safety, not a limit load";
                self.error("D049", &place, message, "remove `until`: the search ends by itself");
            }
            ControlDeck::Displacement { .. } | ControlDeck::ArcLength { .. } => {}
            ControlDeck::Load {} => {
                let conditions = deck.boundary_conditions.iter().any(BoundaryConditionDeck::moves);
                let is_moved = |tool: &ToolDeck| tool.motion().iter().any(|(_, _, value)| !value.is_zero());
                if !conditions && !deck.tools.iter().any(is_moved) {
                    let message = "a limit load is sought, but nothing is moved: under loads that grow, no step beyond the \
                                   limit is in equilibrium";
                    let help = "prescribe a motion, or let the load factor follow from equilibrium: \
                                `control: {type: arc-length}`";
                    self.error("D049", &place, message, help);
                }
            }
        }
    }

    /// Checks the quantity that a control prescribes.
    fn quantity(&mut self, pointer: &str, control: &ControlDeck) {
        let deck = self.deck;
        match control {
            ControlDeck::Load {} => {}
            ControlDeck::Displacement { probe, tool, axis, to } => {
                if *axis as usize >= deck.dimensions() {
                    self.wrong_dimension(&format!("{pointer}/axis"), "the axis `z`", 3);
                }
                match (probe, tool) {
                    (Some(probe), None) => self.controlled_probe(pointer, probe),
                    (None, Some(tool)) => self.controlled_tool(pointer, tool, *axis as usize),
                    (None, None) => {
                        let message = "displacement control needs something to move";
                        self.error("D049", pointer, message, "name a `probe` or a `tool`");
                    }
                    (Some(_), Some(_)) => {
                        let message = "displacement control moves either a probe or a tool";
                        self.error("D049", &format!("{pointer}/tool"), message, "remove `probe` or `tool`");
                    }
                }
                let extent = match &deck.grid {
                    GridDeck::Structured { size, .. } => size.iter().fold(0.0f64, |most, l| most.max(*l)),
                    _ => 0.0,
                };
                if to.abs() <= MIN_MOTION * extent {
                    let message = format!("a displacement of {to} does not determine the load factor");
                    let help = "give `to` a value other than 0";
                    self.error("D049", &format!("{pointer}/to"), message, help);
                }
            }
            ControlDeck::ArcLength { .. } => {}
            ControlDeck::StrengthReduction { from, to, tolerance, .. } => {
                if to > from && to - from < *tolerance {
                    let message = format!(
                        "a tolerance of {tolerance} exceeds the whole range of the factor, from {from} to {to}"
                    );
                    let range = rounded(to - from);
                    let such_as = if range > USUAL { format!(", such as {USUAL}") } else { String::new() };
                    let help = format!(
                        "give a `tolerance` below {}{such_as}, or a larger factor `to`",
                        shortest(range)
                    );
                    self.error("D049", &format!("{pointer}/tolerance"), message, &help);
                } else if to <= from {
                    let message = format!("the strength reduction factor cannot grow from {from} to {to}");
                    let help = format!("give a factor `to` of at least {}", shortest(from + tolerance));
                    self.error("D049", &format!("{pointer}/to"), message, help);
                }
            }
        }
    }

    fn controlled_probe(&mut self, pointer: &str, probe: &str) {
        let probes: Vec<&str> = self.deck.output.probes.iter().map(|probe| probe.name.as_str()).collect();
        if !probes.contains(&probe) {
            let message = format!("there is no probe {}", quote(probe));
            let help = if probes.is_empty() {
                "add one: `output: {probes: [{name, body, nearest}]}`".to_owned()
            } else {
                known_names(Noun::new("probe", "probes"), probe, &probes)
            };
            self.error("D049", &format!("{pointer}/probe"), message, help);
        }
    }

    fn controlled_tool(&mut self, pointer: &str, tool: &str, axis: usize) {
        let deck = self.deck;
        let Some(found) = deck.tools.iter().find(|other| other.name == tool) else {
            let message = format!("there is no tool {}", quote(tool));
            let tools: Vec<&str> = deck.tools.iter().map(|tool| tool.name.as_str()).collect();
            let help = if tools.is_empty() {
                "add one under `tools`, or control a `probe`".to_owned()
            } else {
                known_names(Noun::new("tool", "tools"), tool, &tools)
            };
            return self.error("D049", &format!("{pointer}/tool"), message, help);
        };
        if !found.may_move_along(axis) {
            let name = ["x", "y", "z"][axis.min(2)];
            let message = format!("the tool {} does not move along {name}", quote(tool));
            let help = format!("let it move: `free: [{name}]` with a load, or `u{name}`");
            self.error("D049", &format!("{pointer}/axis"), message, help);
        }
    }

    /// Checks that the motions of tools can share an unknown factor. If a tool moves or bears a load, only the last
    /// stage may have an unknown factor.
    fn tools_of_common_factor(&mut self, stage: Option<TimedStage>) {
        let deck = self.deck;
        let times = stage.map_or([0.0, deck.end_time()], |stage| stage.times);
        let stands = |curve: &LoadCurve| stands_still(curve, times);
        let is_last =
            stage.is_none_or(|stage| deck.stages.last().is_some_and(|last| std::ptr::eq(last, stage.deck)));
        for (number, tool) in deck.tools.iter().enumerate().filter(|(_, tool)| tool.acts()) {
            let pointer = format!("/tools/{number}");
            if !is_last {
                let message = format!(
                    "the tool {} is moved or loaded, but the load factor of a stage before the last one is unknown",
                    quote(&tool.name)
                );
                let help = "prescribe the load factor of this stage (`control: {type: load}`), or make it the last one";
                self.error("D049", &pointer, message, help);
            }
            for (key, _) in tool.curves().filter(|(_, curve)| !stands(curve)) {
                let message = format!(
                    "the tool {} has a curve, but `steps: {{control: ...}}` makes its factor an unknown",
                    quote(&tool.name)
                );
                let help = "remove the curve, or keep it constant";
                self.error("D049", &format!("{pointer}/{key}"), message, help);
            }
            let motion = tool.motion();
            for (key, ..) in motion.iter().filter(|(_, _, value)| depends_on_time(value)) {
                let message = format!(
                    "{} of the tool {} depends on `time`, but `steps: {{control: ...}}` makes the load factor an unknown",
                    quote(key),
                    quote(&tool.name)
                );
                let help = "write it as a number, or as a formula in `factor`";
                self.error("D049", &format!("{pointer}/{key}"), message, help);
            }
            let turns =
                motion.iter().filter(|(_, component, value)| component.is_rotation() && !value.is_zero());
            if turns.count() > 1 {
                let message = format!(
                    "the tool {} turns about several axes, which an unknown load factor cannot drive",
                    quote(&tool.name)
                );
                let help = "prescribe only one component of `rotation`, or else the load factor \
                            (`control: {type: load}`)";
                self.error("D049", &format!("{pointer}/rotation"), message, help);
            }
        }
    }

    /// Checks that the loads of an analysis, or of a stage, can share an unknown factor.
    fn common_factor(&mut self, control: &str, stage: Option<TimedStage>) {
        let deck = self.deck;
        let changes = |name: &str| stage.is_none_or(|stage| stage.deck.factors.contains_key(name));
        // A load that stays constant in a stage takes no part in the unknown factor of this stage.
        let stands = |curve: &LoadCurve| stage.is_some_and(|stage| stands_still(curve, stage.times));
        let is_idle = |load: &LoadDeck| load.magnitude().1;
        let mut loads = deck.loads.iter().filter(|load| changes(load.name()));
        if loads.all(is_idle) && !deck.tools.iter().any(ToolDeck::acts) {
            let message = "no load acts, so there is no load factor to determine";
            let help = match stage {
                None => "add a load under `loads`, or prescribe the load factor (`control: {type: load}`)",
                Some(_) => {
                    "name a load under `factors`, or prescribe the load factor (`control: {type: load}`)"
                }
            };
            self.error("D049", control, message, help);
        }
        for (number, load) in deck.loads.iter().enumerate() {
            let pointer = format!("/loads/{number}");
            if load.curve().is_some_and(|curve| !stands(curve)) {
                let message = format!(
                    "the load {} has a curve, but `steps: {{control: ...}}` makes its factor an unknown",
                    quote(load.name())
                );
                let help = match stage {
                    None => "remove the curve",
                    Some(_) => "remove the curve, or keep it constant during this stage",
                };
                self.error("D049", &format!("{pointer}/curve"), message, help);
            }
            let factor = |e: &Expression| matches!(e, Expression::Formula(text) if names(text).iter().any(|(_, name)| *name == "factor"));
            if load.expressions().iter().any(|(_, expression)| factor(expression)) {
                let message = format!(
                    "the load {} depends on `factor`, but with `steps: {{control: ...}}` every load must be \
                     proportional to the factor",
                    quote(load.name())
                );
                let key = format!("{pointer}/{}", load.magnitude().0);
                self.error("D049", &key, message, "give the value at load factor 1, without `factor`");
            }
        }
        self.tools_of_common_factor(stage);
        let moving = deck.boundary_conditions.iter().enumerate();
        for (number, condition) in moving.filter(|(_, c)| changes(&c.name) || c.curve.is_some()) {
            for Displacement { key, value, .. } in condition.displacements() {
                if !value.is_zero() {
                    let message = format!(
                        "the boundary condition {} moves its nodes, which `steps: {{control: ...}}` does not allow",
                        quote(&condition.name)
                    );
                    let help =
                        "fix the nodes (`fix`), or prescribe the load factor (`control: {type: load}`)";
                    let pointer = format!("/boundary_conditions/{number}/{key}");
                    self.error("D049", &pointer, message, help);
                }
            }
        }
    }
}
