//! Entries that are legal but probably not intended.

use std::collections::BTreeSet;

use super::Check;
use crate::diagnostic::{Diagnostic, Severity};
use crate::initial_stress::initial_factor;
use crate::quoting::{quote, rounded};
use crate::span::escape;
use crate::{
    BoundaryConditionDeck, Deck, Expression, InitialStressDeck, LoadCurve, LoadDeck, MaterialDeck, ToolDeck,
};
use mpm_core::formula::names;

/// Tolerances above this accept steps that are not really in equilibrium.
const LOOSE: f64 = 1e-4;
/// Tolerances below this are out of reach because of round-off.
const OUT_OF_REACH: f64 = 1e-14;

impl Check<'_> {
    /// Collects warnings about a deck without errors.
    pub(super) fn suspicions(&mut self) {
        self.unused();
        self.loads_without_effect();
        self.keys_without_effect();
        self.locking();
        self.loaded_rings();
        self.one_point_per_cell();
        self.units();
        self.prescribed_motion();
        self.tolerances();
        self.repeated_reductions();
    }

    pub(super) fn warn(&mut self, code: &'static str, pointer: &str, message: String, help: &str) {
        let found = Diagnostic::at(self.source, code, pointer, message).severity(Severity::Warning);
        self.found.push(found.help(help));
    }

    pub(super) fn warn_at_key(&mut self, code: &'static str, pointer: &str, message: String, help: &str) {
        let found = Diagnostic::at_key(self.source, code, pointer, message).severity(Severity::Warning);
        self.found.push(found.help(help));
    }

    /// Warns of materials and parameters that nothing refers to.
    fn unused(&mut self) {
        let deck = self.deck;
        let used = deck.used_materials();
        for name in deck.materials.keys().filter(|name| !used.contains(name.as_str())) {
            let message = format!("no body uses the material {}", quote(name));
            self.warn_at_key("D037", &format!("/materials/{}", escape(name)), message, "remove it");
        }
        let formulas = [formulas_of_loading(deck), formulas_of_bodies(deck)].concat();
        let in_formulas = names_in(&formulas);
        for name in deck.parameters.keys() {
            if !in_formulas.contains(name.as_str()) && !self.source.uses_parameter(name) {
                let message = format!("the parameter {} is not used", quote(name));
                let help = "insert it as `${...}` where it belongs, or remove it";
                self.warn_at_key("D037", &format!("/parameters/{}", escape(name)), message, help);
            }
        }
    }

    /// Warns of loads and curves that are zero, and of decks in which nothing loads the bodies.
    fn loads_without_effect(&mut self) {
        let deck = self.deck;
        let mut any = false;
        for (index, load) in deck.loads.iter().enumerate() {
            let (key, zero) = load.magnitude();
            let name = quote(load.name());
            if zero {
                let at = format!("/loads/{index}/{key}");
                self.warn(
                    "D037",
                    &at,
                    format!("the load {name} is zero"),
                    "give it a nonzero value, or remove the load",
                );
            } else if self.stays_zero(load.curve()) {
                let message = format!("the factor of the load {name} is zero at all times");
                let help = "give a factor that is nonzero at some time of the analysis, or remove the load";
                self.warn("D037", &format!("/loads/{index}/curve"), message, help);
            } else {
                any = true;
                let is_at_work = initial_factor(deck, load) != 0.0 || depends_on_factor(load);
                if !load.follows_time() && !is_at_work {
                    self.never_named(&format!("/loads/{index}/name"), "load", load.name());
                }
            }
        }
        for (index, condition) in deck.boundary_conditions.iter().enumerate() {
            let moves = condition.moves();
            if moves && self.stays_zero(condition.curve.as_ref()) {
                let name = quote(&condition.name);
                let message = format!("the factor of the boundary condition {name} is zero at all times");
                let help =
                    "give a factor that is nonzero at some time of the analysis, or fix the nodes with `fix`";
                self.warn("D037", &format!("/boundary_conditions/{index}/curve"), message, help);
            } else if moves && condition.curve.is_none() && !moves_by_formula(condition) {
                let at = format!("/boundary_conditions/{index}/name");
                self.never_named(&at, "boundary condition", &condition.name);
            }
            any |= moves;
        }
        let mut stresses = deck.bodies.iter().filter_map(|body| body.initial_stress.as_ref());
        any |= stresses.any(|stress| !stress.is_zero());
        any |= deck.bodies.iter().any(|body| body.velocity.is_some());
        any |= deck.tools.iter().any(ToolDeck::acts);
        // Zero loads have already been reported.
        if !any && deck.loads.is_empty() {
            let message = "nothing loads the bodies: there are no loads, no prescribed displacement other than zero, and \
                           no initial stress";
            let help = "add `loads`, or give `ux` or another displacement in a boundary condition";
            self.warn_at_key("D037", "/boundary_conditions", message.to_owned(), help);
        }
    }

    /// Warns of a load or a prescribed motion without a curve whose factor remains 0 in all stages.
    fn never_named(&mut self, pointer: &str, kind: &str, name: &str) {
        let deck = self.deck;
        let mut factors = deck.stages.iter().filter_map(|stage| stage.factors.get(name)).peekable();
        let reason = match factors.peek() {
            None => format!("no stage names the {kind} under `factors`"),
            Some(_) => format!("no stage gives the {kind} another factor"),
        };
        if deck.stages.is_empty() || factors.any(|factor| *factor != 0.0) {
            return;
        }
        let message = format!("the factor of the {kind} {} is zero at all times: {reason}", quote(name));
        let help = format!(
            "give the {kind} a factor in a stage, such as `factors: {{{name}: 1}}`, or give it a `curve`"
        );
        self.warn("D037", pointer, message, &help);
    }

    /// True if a load curve is zero throughout the analysis.
    fn stays_zero(&self, curve: Option<&LoadCurve>) -> bool {
        curve.is_some_and(|LoadCurve(pairs)| {
            let end = self.deck.end_time();
            // The pair after the end matters unless a pair lies at the end itself.
            let after = pairs.iter().position(|pair| pair[0] >= end).map_or(pairs.len(), |last| last + 1);
            pairs[..after].iter().all(|pair| pair[1] == 0.0)
        })
    }

    /// Warns of one point per cell: at its centre, hourglass modes of the cell cause no strain.
    fn one_point_per_cell(&mut self) {
        for (index, body) in self.deck.bodies.iter().enumerate() {
            if let Some(key) = self.key_of_single_points(body) {
                let message = format!(
                    "the body {} has one point per cell: nothing resists the hourglass modes of the cells",
                    quote(&body.name)
                );
                let help = "use at least two points along each axis of a cell";
                self.warn("D038", &format!("/bodies/{index}/{key}"), message, help);
            }
        }
    }

    fn tolerances(&mut self) {
        let stages = &self.deck.stages;
        if stages.is_empty() || stages.iter().any(|stage| stage.solver.is_none()) {
            self.tolerance("/solver/tolerance", self.deck.solver.tolerance);
        }
        for (number, stage) in stages.iter().enumerate() {
            if let Some(solver) = &stage.solver {
                self.tolerance(&format!("/stages/{number}/solver/tolerance"), solver.tolerance);
            }
        }
    }

    fn tolerance(&mut self, pointer: &str, tolerance: f64) {
        if tolerance > LOOSE {
            let message = format!(
                "with the tolerance {tolerance} a step is accepted as in equilibrium although up to {} % of \
                 its load is out of balance",
                rounded(100.0 * tolerance)
            );
            let help = "use 1e-6 or less: convergence is quadratic, so this costs only a few more iterations";
            self.warn("D045", pointer, message, help);
        } else if tolerance < OUT_OF_REACH {
            let message =
                format!("the tolerance {tolerance:e} is below round-off: hardly any step can meet it");
            self.warn("D045", pointer, message, "use 1e-12 or more");
        }
    }
}

/// True if a formula of a load contains `factor`; the load may then act even at a factor of 0.
fn depends_on_factor(load: &LoadDeck) -> bool {
    load.expressions().into_iter().any(|(_, given)| contains_factor(given))
}

/// True if a prescribed displacement contains `factor`; the nodes may then move even at a factor of 0.
fn moves_by_formula(condition: &BoundaryConditionDeck) -> bool {
    let displacements = condition.displacements().into_iter().map(|displacement| displacement.value);
    displacements.chain(condition.intermediate.values()).any(contains_factor)
}

fn contains_factor(given: &Expression) -> bool {
    given.as_formula().is_some_and(|formula| names(formula).into_iter().any(|(_, name)| name == "factor"))
}

/// The names in formulas.
pub(crate) fn names_in(formulas: &[String]) -> BTreeSet<&str> {
    formulas.iter().flat_map(|text| names(text)).map(|(_, name)| name).collect()
}

/// The formulas of boundary conditions and loads.
pub(crate) fn formulas_of_loading(deck: &Deck) -> Vec<String> {
    let displacements = deck.boundary_conditions.iter().flat_map(BoundaryConditionDeck::displacements);
    let displacements = displacements.map(|displacement| displacement.value);
    let given = deck.boundary_conditions.iter().flat_map(|condition| condition.intermediate.values());
    let forces = deck.loads.iter().flat_map(LoadDeck::expressions).map(|(_, expression)| expression);
    displacements.chain(given).chain(forces).filter_map(|e| e.as_formula().map(str::to_owned)).collect()
}

/// The formulas of tools, initial stresses and materials.
pub(crate) fn formulas_of_bodies(deck: &Deck) -> Vec<String> {
    let motions = deck.tools.iter().flat_map(ToolDeck::motion).map(|(.., value)| value);
    let stresses = deck.bodies.iter().filter_map(|body| match &body.initial_stress {
        Some(InitialStressDeck::Components { stress }) => {
            Some(stress.components().map(|(_, _, given)| given.clone()))
        }
        _ => None,
    });
    let properties = deck.materials.values().flat_map(MaterialDeck::properties).map(|(_, given)| given);
    let velocities = deck.bodies.iter().filter_map(|body| body.velocity.clone()).flatten();
    let all = motions.chain(stresses.flatten()).chain(properties).chain(velocities);
    all.filter_map(|e| e.as_formula().map(str::to_owned)).collect()
}
