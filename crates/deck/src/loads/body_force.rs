//! Force per volume or per mass.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ActionDeck, LoadCurve, LoadKeys, component_keys};
use crate::formulas::at_points;
use crate::gates::{Builds, Checks};
use crate::{Expression, Expressions};
use mpm_core::model::Action;

/// Force per volume at the start of the load step, eq. (24), or per mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyForceDeck {
    /// Name, unique among the loads.
    pub name: String,
    /// Force per volume, [force/volume], or per mass, [length/time²], at load factor 1, one number or formula per
    /// axis. A formula may contain x, y (the position at the start of the step), X, Y (the original position), in
    /// space also z and Z, `factor` (the load factor), the parameters and the names under `where`. A formula that
    /// contains `factor`, directly or through a name under `where`, states the whole force; any other formula is
    /// multiplied by the load factor.
    #[schemars(with = "Expressions", extend("examples" = [["gamma*y", 0]]))]
    pub force: Vec<Expression>,
    /// Quantity to which `force` refers.
    #[serde(default)]
    pub per: Per,
    /// Named intermediate values, in any order, for use in `force`.
    #[serde(rename = "where", default, skip_serializing_if = "BTreeMap::is_empty")]
    pub intermediate: BTreeMap<String, Expression>,
    /// Names of the bodies it acts on; all bodies by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bodies: Option<Vec<String>>,
    /// Load factor over time; by default, a linear ramp from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<LoadCurve>,
}

/// Quantity to which a body force refers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Per {
    /// The volume of each point at the start of the load step.
    #[default]
    Volume,
    /// The constant mass of each point, as for gravity; the material needs a density.
    Mass,
}

impl LoadKeys for BodyForceDeck {
    fn name(&self) -> &str {
        &self.name
    }

    fn curve(&self) -> Option<&LoadCurve> {
        self.curve.as_ref()
    }

    fn bodies(&self) -> Option<&[String]> {
        self.bodies.as_deref()
    }

    fn components(&self) -> Vec<(String, &Expression)> {
        component_keys("force", &self.force)
    }

    fn intermediate(&self) -> Option<&BTreeMap<String, Expression>> {
        Some(&self.intermediate)
    }

    fn magnitude(&self) -> (&'static str, bool) {
        ("force", self.force.iter().all(Expression::is_zero))
    }

    fn check(&self, check: &mut dyn Checks, pointer: &str) {
        if self.force.len() != check.dimensions() {
            check.wrong_count(&format!("{pointer}/force"), self.force.len());
        }
        check.formulas_at_points(pointer, &self.force, &self.intermediate);
        if self.per == Per::Mass {
            check.weight(pointer, &self.name, self.bodies.as_deref());
        }
        check.targets(&format!("{pointer}/bodies"), self.bodies.as_deref());
    }
}

impl<const D: usize> ActionDeck<D> for BodyForceDeck {
    fn action(&self, builder: &mut dyn Builds, pointer: &str) -> Option<Action<D>> {
        let formula = at_points::<D>(&self.force, &self.intermediate, builder.parameters());
        let formula = formula.map_err(|faults| builder.faulty_formulas(pointer, faults)).ok()?;
        Some(match self.per {
            Per::Volume => Action::BodyForce(formula),
            Per::Mass => Action::MassForce(formula),
        })
    }
}
