//! Pressure on a surface.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ActionDeck, LoadCurve, LoadKeys};
use crate::formulas::at_places;
use crate::gates::{Builds, Checks};
use crate::quoting::quote;
use crate::{Expression, yes};
use mpm_core::model::{Action, Pressure};

/// A pressure on a surface. It follows the surface, acting against the current normal on the current area, unless
/// `follows: false` is given. Give either `pressure` or `hydrostatic`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureDeck {
    /// Name, unique among the loads.
    pub name: String,
    /// Name of the surface.
    pub surface: String,
    /// Pressure at load factor 1, [stress]: a number, or a formula as for a body force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [100e3]))]
    pub pressure: Option<Expression>,
    /// Pressure of a liquid at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hydrostatic: Option<HydrostaticDeck>,
    /// If false, `pressure` is a dead load: it acts against the original normal on the original area.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    pub follows: bool,
    /// Named intermediate values, in any order, for use in `pressure`.
    #[serde(rename = "where", default, skip_serializing_if = "BTreeMap::is_empty")]
    pub intermediate: BTreeMap<String, Expression>,
    /// Load factor over time; by default, a linear ramp from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<LoadCurve>,
}

/// The pressure of a liquid at rest: `unit_weight` times the depth below `level` at the current position, and zero
/// above `level`. The last axis is vertical.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HydrostaticDeck {
    /// Coordinate of the free surface of the liquid along the last axis, [length].
    #[schemars(extend("examples" = [10]))]
    pub level: f64,
    /// Weight of the liquid per volume at load factor 1, [force/volume].
    #[schemars(extend("examples" = [9.81e3]))]
    pub unit_weight: f64,
}

impl LoadKeys for PressureDeck {
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
        self.pressure.iter().map(|pressure| ("pressure".to_owned(), pressure)).collect()
    }

    fn intermediate(&self) -> Option<&BTreeMap<String, Expression>> {
        Some(&self.intermediate)
    }

    fn magnitude(&self) -> (&'static str, bool) {
        match &self.hydrostatic {
            Some(liquid) => ("hydrostatic", liquid.unit_weight == 0.0),
            None => ("pressure", self.pressure.as_ref().is_some_and(Expression::is_zero)),
        }
    }

    fn check(&self, check: &mut dyn Checks, pointer: &str) {
        check.surface(&format!("{pointer}/surface"), &self.surface);
        if self.hydrostatic.is_some() && !self.follows {
            let message =
                format!("the hydrostatic pressure {} always follows its surface", quote(&self.name));
            let help = "remove `follows: false`, or give the pressure as a formula under `pressure`";
            check.error_at_key("D020", &format!("{pointer}/follows"), message, help);
        }
        if self.pressure.is_some() == self.hydrostatic.is_some() {
            let message = format!("the load {} needs exactly one pressure", quote(&self.name));
            check.error_at_key("D020", pointer, message, "give either `pressure` or `hydrostatic`");
        }
        check.formulas_at_places(pointer, "pressure", self.pressure.as_slice(), true, &self.intermediate);
    }
}

impl<const D: usize> ActionDeck<D> for PressureDeck {
    fn action(&self, builder: &mut dyn Builds, pointer: &str) -> Option<Action<D>> {
        let surface = builder.surface_number(&self.surface);
        if let Some(HydrostaticDeck { level, unit_weight }) = self.hydrostatic {
            return Some(Action::Pressure {
                surface,
                pressure: Pressure::Hydrostatic { level, unit_weight },
            });
        }
        let parts = self.pressure.as_slice();
        let formula = at_places::<D, 1>("pressure", parts, &self.intermediate, builder.parameters());
        let formula = formula.map_err(|faults| builder.faulty_formulas(pointer, faults)).ok()?;
        let pressure = if self.follows { Pressure::Given(formula) } else { Pressure::Dead(formula) };
        Some(Action::Pressure { surface, pressure })
    }
}
