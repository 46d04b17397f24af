//! The initial stress of bodies.

use super::Check;
use crate::initial_stress::{InitialStressDeck, gravity_on, is_stressed, unit_weight};
use crate::quoting::quote;
use crate::{AXES, BodyDeck, ControlDeck, Expression};

impl Check<'_> {
    /// Checks the initial stress of a body.
    pub(super) fn initial_stress(&mut self, pointer: &str, body: &BodyDeck) {
        let at = format!("{pointer}/initial_stress");
        match &body.initial_stress {
            None => return,
            Some(InitialStressDeck::Geostatic { .. }) => self.weight_of_ground(&at, body),
            Some(InitialStressDeck::Components { stress }) => {
                for (key, (row, column), _) in stress.components() {
                    if row != column && column == 2 && self.dimensions() < 3 {
                        self.wrong_dimension(
                            &format!("{at}/stress/{key}"),
                            &format!("the stress `{key}`"),
                            3,
                        );
                    }
                }
                let faults = stress.formulas(&self.deck.parameters, self.dimensions()).err();
                self.formulas(&at, faults.unwrap_or_default());
            }
        }
        let first = self.deck.courses().into_iter().next();
        if first.is_some_and(|(_, steps)| {
            matches!(steps.control, ControlDeck::Displacement { .. } | ControlDeck::ArcLength { .. })
        }) {
            let message = format!(
                "the body {} has an initial stress, but `steps: {{control: ...}}` makes the factor of its loads an unknown",
                quote(&body.name)
            );
            self.error(
                "D049",
                &at,
                message,
                "remove `initial_stress`, or prescribe the load factor (`control: {type: load}`)",
            );
        }
    }

    /// Checks that weight acts on a body with geostatic stress, and downwards.
    fn weight_of_ground(&mut self, pointer: &str, body: &BodyDeck) {
        let (deck, name) = (self.deck, quote(&body.name));
        let last = AXES[self.dimensions() - 1];
        let mut has_gravity = false;
        for (number, load, acceleration) in gravity_on(deck, body) {
            has_gravity = true;
            let across = acceleration.iter().take(self.dimensions() - 1).position(|a| *a != 0.0);
            if let Some(axis) = across {
                let message = format!(
                    "the load {} pulls the body {name} along {}, but a geostatic stress balances weight along {last} \
                     only",
                    quote(load.name()),
                    AXES[axis]
                );
                let help =
                    format!("let gravity act along {last} only, or give the stress by its `components`");
                self.error("D051", &format!("/loads/{number}/acceleration/{axis}"), message, help);
            }
        }
        let density = deck.materials.get(&body.material).and_then(|m| m.density());
        if matches!(density, Some(Expression::Formula(_))) {
            let message = format!(
                "the body {name} has a geostatic stress, but the density of its material varies from point to point"
            );
            let help = "use one body and one number for each layer, or give the stress by its `components`";
            self.error("D051", pointer, message, help);
            return;
        }
        let has_density = density.is_some();
        if !has_gravity {
            let message = format!("the body {name} has a geostatic stress, but no gravity acts on it");
            let help = "add a load of type `gravity`, or give the stress by its `components`";
            self.error("D051", pointer, message, help);
        } else if has_density && unit_weight(deck, body) <= 0.0 {
            let message =
                format!("the body {name} has a geostatic stress, but no weight pulls it down at time 0");
            let help = format!(
                "give its gravity a component below 0 along {last}, and a curve that begins above 0, or no curve"
            );
            self.error("D051", pointer, message, help);
        }
    }

    /// Warns of `initial_imbalance` if no body has an initial stress.
    pub(super) fn imbalance_without_effect(&mut self) {
        let at = "/analysis/initial_imbalance";
        if !is_stressed(self.deck) && self.is_written(at) {
            let message = "`initial_imbalance` has no effect: no body has an `initial_stress`".to_owned();
            self.warn_at_key("D037", at, message, "remove it, or give a body an `initial_stress`");
        }
    }
}
