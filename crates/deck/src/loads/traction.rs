//! Force per area of a surface.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ActionDeck, LoadCurve, LoadKeys, component_keys};
use crate::formulas::at_places;
use crate::gates::{Builds, Checks};
use crate::{Expression, Expressions};
use mpm_core::model::Action;

/// A force per original area of a surface; its direction stays fixed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TractionDeck {
    /// Name, unique among the loads.
    pub name: String,
    /// Name of the surface.
    pub surface: String,
    /// Force per original area at load factor 1, [stress], one number or formula per axis. Formulas are written as
    /// for a body force.
    #[schemars(with = "Expressions", extend("examples" = [[0, -10e3]]))]
    pub traction: Vec<Expression>,
    /// Named intermediate values, in any order, for use in `traction`.
    #[serde(rename = "where", default, skip_serializing_if = "BTreeMap::is_empty")]
    pub intermediate: BTreeMap<String, Expression>,
    /// Load factor over time; by default, a linear ramp from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<LoadCurve>,
}

impl LoadKeys for TractionDeck {
    fn name(&self) -> &str {
        &self.name
    }

    fn curve(&self) -> Option<&LoadCurve> {
        self.curve.as_ref()
    }

    fn bodies(&self) -> Option<&[String]> {
        Some(&[])
    }

    fn surface(&self) -> Option<&str> {
        Some(&self.surface)
    }

    fn components(&self) -> Vec<(String, &Expression)> {
        component_keys("traction", &self.traction)
    }

    fn intermediate(&self) -> Option<&BTreeMap<String, Expression>> {
        Some(&self.intermediate)
    }

    fn magnitude(&self) -> (&'static str, bool) {
        ("traction", self.traction.iter().all(Expression::is_zero))
    }

    fn check(&self, check: &mut dyn Checks, pointer: &str) {
        check.surface(&format!("{pointer}/surface"), &self.surface);
        if self.traction.len() != check.dimensions() {
            check.wrong_count(&format!("{pointer}/traction"), self.traction.len());
        }
        check.formulas_at_places(pointer, "traction", &self.traction, false, &self.intermediate);
    }
}

impl<const D: usize> ActionDeck<D> for TractionDeck {
    fn action(&self, builder: &mut dyn Builds, pointer: &str) -> Option<Action<D>> {
        let formula = at_places::<D, D>("traction", &self.traction, &self.intermediate, builder.parameters());
        let traction = formula.map_err(|faults| builder.faulty_formulas(pointer, faults)).ok()?;
        Some(Action::Traction { surface: builder.surface_number(&self.surface), traction })
    }
}
