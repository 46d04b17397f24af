//! Keys of a deck that have no effect in combination with others.

use super::Check;
use crate::ControlDeck;
use crate::diagnostic::{Diagnostic, Severity};
use crate::quoting::quote;
use mpm_core::basis::DomainKind;
use mpm_core::model::StabilisationMode;

/// Pointers to keys that decks of earlier versions may have, each with the reason why it has no effect.
const RETIRED: [(&str, &str); 1] = [(
    "/solver/pattern",
    "a pattern is analysed again whenever it changes, which takes at most 3 % of a run",
)];

impl Check<'_> {
    /// Notes keys of earlier versions. They are accepted, so that old decks can be run.
    fn retired_keys(&mut self) {
        for (at, reason) in RETIRED {
            if self.source.key_span_of(at).is_some() {
                let key = at.rsplit('/').next().unwrap_or(at);
                let message = format!("`{key}` no longer has an effect: {reason}");
                let found = Diagnostic::at_key(self.source, "D037", at, message).severity(Severity::Note);
                self.found.push(found.help("remove it"));
            }
        }
    }

    /// Warns of keys whose value changes nothing. Values from parameters, and keys whose effect depends on such values,
    /// are exempt: they may have an effect in another run of a study.
    pub(super) fn keys_without_effect(&mut self) {
        self.retired_keys();
        self.stabilisation_without_effect();
        self.curves_without_effect();
        self.volume_without_effect();
        self.predictor_without_effect();
        self.damping_without_effect();
        self.smallest_without_effect();
        self.imbalance_without_effect();
        self.interval_without_effect();
    }

    /// Warns of intervals of stages if no VTU files are written.
    fn interval_without_effect(&mut self) {
        if self.deck.output.every > 0 || self.source.is_from_parameter("/output/every") {
            return;
        }
        for number in 0..self.deck.stages.len() {
            let at = format!("/stages/{number}/every");
            if self.is_written(&at) {
                let message = "`every` has no effect: `output: {every: 0}` writes no VTU files";
                let help = "remove it, or give `every` under `output` a value of 1 or more";
                self.warn_at_key("D037", &at, message.to_owned(), help);
            }
        }
    }

    /// True if the deck itself states the value of a key.
    pub(super) fn is_written(&self, pointer: &str) -> bool {
        self.source.span_of(pointer).is_some() && !self.source.is_from_parameter(pointer)
    }

    fn stabilisation_without_effect(&mut self) {
        let mode = "/analysis/stabilisation/mode";
        if self.deck.analysis.stabilisation.mode != StabilisationMode::Off
            || self.source.is_from_parameter(mode)
        {
            return;
        }
        for key in ["parameter", "filling"] {
            let at = format!("/analysis/stabilisation/{key}");
            if self.is_written(&at) {
                let message = format!("`{key}` has no effect: the stabilisation is off");
                let help = format!("set `mode: auto` or `on`, or remove `{key}`");
                self.warn_at_key("D037", &at, message, &help);
            }
        }
    }

    /// Warns of load curves of boundary conditions that only fix their nodes.
    fn curves_without_effect(&mut self) {
        for (index, condition) in self.deck.boundary_conditions.iter().enumerate() {
            let at = format!("/boundary_conditions/{index}");
            let from_parameter = |key: &str| self.source.is_from_parameter(&format!("{at}/{key}"));
            let moves = condition.moves() || condition.displacements().iter().any(|u| from_parameter(u.key));
            let at = format!("{at}/curve");
            if condition.curve.is_some() && !moves && self.is_written(&at) {
                let name = quote(&condition.name);
                let message =
                    format!("the curve has no effect: the boundary condition {name} only fixes its nodes");
                let help = "remove `curve`, or prescribe a displacement other than 0 with `ux`, `uy` or `uz`";
                self.warn_at_key("D037", &at, message, help);
            }
        }
    }

    /// Warns of `point_volume` if no point has a domain.
    fn volume_without_effect(&mut self) {
        let at = "/analysis/point_volume";
        let bodies = self.deck.bodies.iter().enumerate();
        let has_no_domain = |(index, body): (usize, &crate::BodyDeck)| {
            body.method.domain() == DomainKind::None
                && !self.source.is_from_parameter(&format!("/bodies/{index}/method"))
        };
        if self.is_written(at) && bodies.clone().all(has_no_domain) {
            let message = "`point_volume` has no effect: points with `method: mpm` have no domain".to_owned();
            let help = "remove it, or use another method for at least one body";
            self.warn_at_key("D037", at, message, help);
        }
    }

    fn predictor_without_effect(&mut self) {
        let Some(steps) = &self.deck.steps else { return };
        let control = match &steps.control {
            ControlDeck::Load {} | ControlDeck::StrengthReduction { .. } => return,
            ControlDeck::Displacement { .. } => "displacement",
            ControlDeck::ArcLength { .. } => "arc-length",
        };
        let at = "/solver/predictor";
        if self.is_written(at) && !self.source.is_from_parameter("/steps/control/type") {
            let message = format!("`predictor` has no effect with `control: {{type: {control}}}`");
            let help = "remove it; it applies to prescribed loads, `control: {type: load}`";
            self.warn_at_key("D037", at, message, help);
        }
    }

    fn damping_without_effect(&mut self) {
        for (pointer, steps) in self.deck.courses() {
            let (because, other) = match steps.control {
                ControlDeck::Load {} if steps.smallest < 1.0 => continue,
                ControlDeck::Load {} => {
                    ("with `smallest: 1`, which ends a run at the first failure", "smallest")
                }
                ControlDeck::StrengthReduction { .. } => ("during a strength reduction", "control/type"),
                _ => ("when the load factor is unknown", "control/type"),
            };
            let at = format!("{pointer}/damping");
            if self.is_written(&at) && !self.source.is_from_parameter(&format!("{pointer}/{other}")) {
                let help = "remove it; damping acts only where the load factor is prescribed and steps may be cut \
                            (`smallest` below 1)";
                self.warn_at_key("D037", &at, format!("`damping` has no effect {because}"), help);
            }
        }
    }

    /// Warns of `smallest` if the tolerance of a strength reduction decides how far steps are cut.
    fn smallest_without_effect(&mut self) {
        for (pointer, steps) in self.deck.courses() {
            let at = format!("{pointer}/smallest");
            let is_reduction = matches!(steps.control, ControlDeck::StrengthReduction { .. });
            if is_reduction
                && self.is_written(&at)
                && !self.source.is_from_parameter(&format!("{pointer}/control/type"))
            {
                let message = "`smallest` has no effect during a strength reduction: steps are cut down to the `tolerance` \
                               of the control"
                    .to_owned();
                self.warn_at_key("D037", &at, message, "remove it, or set `tolerance`");
            }
        }
    }
}
