//! An unknown load factor, and what goes with it.

use super::Check;
use super::suspicions::{is_zero, load_is_zero};
use crate::quoting::{list, quote};
use crate::{ControlDeck, Expression, GridDeck, LoadDeck};
use mpm_core::formula::names;

/// A displacement of less than this part of the grid is round-off, [-].
const LEAST: f64 = 1e-12;

impl Check<'_> {
    /// Where the load factor follows from a displacement or from the length of the path, all loads have that one factor and
    /// nothing else moves.
    pub(super) fn control(&mut self) {
        let deck = self.deck;
        match &deck.steps.control {
            ControlDeck::Load {} => return,
            ControlDeck::Displacement { probe, axis, to } => {
                if *axis as usize >= deck.dimensions() {
                    self.of_other_dimension("/steps/control/axis", "the axis `z`", 3);
                }
                let probes: Vec<&str> = deck.output.probes.iter().map(|probe| probe.name.as_str()).collect();
                if !probes.contains(&probe.as_str()) {
                    let message = format!("there is no probe {}", quote(probe));
                    let help = if probes.is_empty() {
                        "add one: `output: {probes: [{name, body, nearest}]}`".to_owned()
                    } else {
                        format!("there are {}", list(probes))
                    };
                    self.error("D049", "/steps/control/probe", message, help);
                }
                let extent = match &deck.grid {
                    GridDeck::Structured { size, .. } => size.iter().fold(0.0f64, |most, l| most.max(*l)),
                    _ => 0.0,
                };
                if to.abs() <= LEAST * extent {
                    let message = format!("a displacement of {to} leaves the load factor open");
                    let help = "give the displacement at the end, other than 0";
                    self.error("D049", "/steps/control/to", message, help);
                }
            }
            ControlDeck::ArcLength { .. } => {}
        }
        if deck.loads.iter().all(load_is_zero) {
            let message = "there is no load but zero whose factor could follow";
            let help =
                "add a load under `loads`, or leave the control to the loads (`control: {type: load}`)";
            self.error("D049", "/steps/control", message, help);
        }
        for (number, load) in deck.loads.iter().enumerate() {
            let pointer = format!("/loads/{number}");
            let (LoadDeck::Gravity { curve, .. }
            | LoadDeck::BodyForce { curve, .. }
            | LoadDeck::PointForce { curve, .. }) = load;
            if curve.is_some() {
                let message = format!(
                    "the load {} follows a curve, but its factor follows from `steps: {{control: ...}}`",
                    quote(load.name())
                );
                self.error("D049", &format!("{pointer}/curve"), message, "remove the curve");
            }
            if let LoadDeck::BodyForce { force, intermediate, .. } = load {
                let factor = |e: &Expression| matches!(e, Expression::Formula(text) if names(text).iter().any(|(_, name)| *name == "factor"));
                if force.iter().chain(intermediate.values()).any(factor) {
                    let message = format!(
                        "the load {} depends on `factor`, but with `steps: {{control: ...}}` it has to be in proportion to it",
                        quote(load.name())
                    );
                    self.error("D049", &format!("{pointer}/force"), message, "write it at load factor 1");
                }
            }
        }
        for (number, condition) in deck.boundary_conditions.iter().enumerate() {
            for (key, displacement) in condition.displacements() {
                if displacement.as_ref().is_some_and(|e| !is_zero(e)) {
                    let message = format!(
                        "the condition {} moves its nodes, which does not go with `steps: {{control: ...}}`",
                        quote(&condition.name)
                    );
                    let help =
                        "hold the nodes (`fix`), or leave the control to the loads (`control: {type: load}`)";
                    let pointer = format!("/boundary_conditions/{number}/{key}");
                    self.error("D049", &pointer, message, help);
                }
            }
        }
    }
}
