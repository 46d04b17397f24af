//! Checks of step controls other than load control.

use super::Check;
use crate::diagnostic::{Diagnostic, Severity};
use crate::formulas::Displacement;
use crate::initial_stress::{InitialStressDeck, curve_of, initial_factor};
use crate::quoting::{quote, rounded};
use crate::references::known_names;
use crate::{BodyDeck, ControlDeck, Expression, GridDeck, LoadCurve, LoadDeck, MaterialDeck, StageDeck};
use mpm_core::formula::names;
use mpm_files::shortest;

/// A displacement below this share of the grid size is round-off, [-].
const LEAST: f64 = 1e-12;
/// A usual tolerance of the strength reduction factor, [-].
const USUAL: f64 = 0.005;

/// True if the factor of a curve is constant between two times, [time].
fn stands_still(LoadCurve(pairs): &LoadCurve, [start, end]: [f64; 2]) -> bool {
    let curve = mpm_core::model::LoadCurve::table(pairs.clone());
    let within = curve.times().filter(|time| (start..=end).contains(time));
    let mut factors = within.chain([end]).map(|time| curve.factor(time));
    factors.all(|factor| factor == curve.factor(start))
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
                let stage = self.deck.stages.get(number).map(|stage| (stage, times));
                if matches!(steps.control, ControlDeck::StrengthReduction { .. }) {
                    self.constant_loads(&format!("{pointer}/control"), stage);
                    self.something_to_carry(&format!("{pointer}/control"), number);
                } else {
                    self.common_factor(&format!("{pointer}/control"), stage);
                }
            }
            start = times[1];
        }
    }

    /// Checks the quantity that a control prescribes.
    fn quantity(&mut self, pointer: &str, control: &ControlDeck) {
        let deck = self.deck;
        match control {
            ControlDeck::Load {} => {}
            ControlDeck::Displacement { probe, tool, axis, to } => {
                if *axis as usize >= deck.dimensions() {
                    self.of_other_dimension(&format!("{pointer}/axis"), "the axis `z`", 3);
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
                if to.abs() <= LEAST * extent {
                    let message = format!("a displacement of {to} does not determine the load factor");
                    let help = "give a displacement other than 0 at the end";
                    self.error("D049", &format!("{pointer}/to"), message, help);
                }
            }
            ControlDeck::ArcLength { .. } => {}
            ControlDeck::StrengthReduction { from, to, tolerance } => {
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
                known_names(("probe", "probes"), probe, &probes)
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
                known_names(("tool", "tools"), tool, &tools)
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

    /// Checks that loads and boundary conditions stay constant in an analysis, or in a stage between two times, while
    /// the strength is reduced, and that a material in use has a strength.
    fn constant_loads(&mut self, control: &str, stage: Option<(&StageDeck, [f64; 2])>) {
        let deck = self.deck;
        let stays = |name: &str, curve: Option<&LoadCurve>| match (stage, curve) {
            (Some((stage, _)), _) if stage.factors.contains_key(name) => false,
            (Some((_, times)), Some(curve)) => stands_still(curve, times),
            (Some(_), None) => true,
            (None, Some(curve)) => stands_still(curve, [0.0, deck.end_time()]),
            (None, None) => false,
        };
        let changing_load = deck.loads.iter().find(|load| {
            let is_held = stage.is_none() && initial_factor(deck, load) == 1.0;
            !(load.magnitude().1 || stays(load.name(), load.curve()) || is_held && load.curve().is_none())
        });
        let moves = |condition: &&crate::BoundaryConditionDeck| {
            let is_zero = |moved: &Displacement| moved.value.is_zero();
            !condition.displacements().iter().all(is_zero)
                && !stays(&condition.name, condition.curve.as_ref())
        };
        let changing_condition = deck.boundary_conditions.iter().find(moves);
        let name = changing_load.map(|load| ("load", load.name()));
        let name =
            name.or(changing_condition.map(|condition| ("boundary condition", condition.name.as_str())));
        if let Some((kind, name)) = name {
            let message = format!("the {kind} {} changes while the strength is reduced", quote(name));
            let help = "apply it in a stage before this one, or keep its curve constant";
            self.error("D049", control, message, help);
        }
        let changed = stage.and_then(|(stage, _)| {
            let StageDeck { add, remove, release, set, material, .. } = stage;
            let lists = [("add", add), ("remove", remove), ("release", release), ("set", set)];
            let key = lists.into_iter().find(|(_, list)| !list.is_empty()).map(|(key, _)| key);
            key.or((!material.is_empty()).then_some("material"))
        });
        if let Some(key) = changed {
            let message = format!(
                "the stage reduces the strength, but its `{key}` takes effect gradually over the whole stage, so that \
                 the factor of safety would belong to an intermediate state"
            );
            let help = format!("move `{key}` to a stage before this one");
            self.error("D049", control, message, &help);
        }
        let has_strength = |material: &MaterialDeck| {
            let is_foreign = matches!(material, MaterialDeck::Library { .. });
            let law = material.law_alone().ok();
            !is_foreign && law.is_none_or(|law| law.with_strength_divided(1.0).is_some())
        };
        let used = deck.used_materials();
        if !used.iter().any(|name| deck.materials.get(*name).is_some_and(has_strength)) {
            let message = "no material has a strength that could be reduced";
            let help = "use `tresca`, `mohr-coulomb`, `drucker-prager` or `von-mises`";
            self.error("D049", control, message, help);
        }
    }

    /// Checks that the bodies carry something while the stage with this number reduces the strength: a load, a
    /// prescribed motion or an initial stress. An earlier stage may have removed the weight that a geostatic stress
    /// carries, and a motion that has been reversed may have left stresses.
    fn something_to_carry(&mut self, control: &str, number: usize) {
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
        let moves = |condition: &&crate::BoundaryConditionDeck| {
            condition.displacements().iter().any(|moved| !moved.value.is_zero())
        };
        let mut moving = deck.boundary_conditions.iter().filter(moves);
        let is_moved = moving.any(|condition| condition.curve.is_some() || has_begun(&condition.name));
        let is_stressed = |body: &BodyDeck| match &body.initial_stress {
            Some(stress @ InitialStressDeck::Components { .. }) => !stress.is_zero(),
            Some(InitialStressDeck::Geostatic { .. }) | None => false,
        };
        let is_pushed = deck.tools.iter().any(crate::ToolDeck::acts);
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
                "the stage {} reduces the strength of bodies that yielded while {} reduced it and that keep their \
                 displacements",
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

    /// Checks that the motions of tools can share an unknown factor. If there are tools, only the last stage may have
    /// an unknown factor.
    fn tools_of_common_factor(&mut self, stage: Option<(&StageDeck, [f64; 2])>) {
        let deck = self.deck;
        let times = stage.map_or([0.0, deck.end_time()], |(_, times)| times);
        let stands = |curve: &LoadCurve| stands_still(curve, times);
        let is_last =
            stage.is_none_or(|(stage, _)| deck.stages.last().is_some_and(|last| std::ptr::eq(last, stage)));
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
            let of_time = |e: &Expression| matches!(e, Expression::Formula(text) if names(text).iter().any(|(_, name)| *name == "time"));
            let motion = tool.motion();
            for (key, ..) in motion.iter().filter(|(_, _, value)| of_time(value)) {
                let message = format!(
                    "{} of the tool {} depends on `time`, but `steps: {{control: ...}}` makes the load factor an unknown",
                    quote(key),
                    quote(&tool.name)
                );
                let help = "write it as a number, or as a formula of `factor`";
                self.error("D049", &format!("{pointer}/{key}"), message, help);
            }
            let turns =
                motion.iter().filter(|(_, component, value)| component.is_rotation() && !value.is_zero());
            if turns.count() > 1 {
                let message = format!(
                    "the tool {} turns about several axes, which an unknown load factor cannot drive",
                    quote(&tool.name)
                );
                let help =
                    "prescribe one component of `rotation`, or the load factor (`control: {type: load}`)";
                self.error("D049", &format!("{pointer}/rotation"), message, help);
            }
        }
    }

    /// Checks that the loads of an analysis, or of a stage between two times, can share an unknown factor.
    fn common_factor(&mut self, control: &str, stage: Option<(&StageDeck, [f64; 2])>) {
        let deck = self.deck;
        let changes = |name: &str| stage.is_none_or(|(stage, _)| stage.factors.contains_key(name));
        // A load that stays constant in a stage takes no part in the unknown factor of this stage.
        let stands = |curve: &LoadCurve| stage.is_some_and(|(_, times)| stands_still(curve, times));
        let is_idle = |load: &LoadDeck| load.magnitude().1;
        let mut loads = deck.loads.iter().filter(|load| changes(load.name()));
        if loads.all(is_idle) && !deck.tools.iter().any(crate::ToolDeck::acts) {
            let message = "there is no non-zero load whose factor could be determined";
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
                self.error("D049", &key, message, "write it at load factor 1");
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
