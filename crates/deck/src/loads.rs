//! The loads of a deck.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mpm_core::model::{self, Action, Pressure};

use super::formulas::{at_places, at_points};
use super::gates::{Builds, Checks, Ties};
use super::per_axis::array;
use super::quoting::quote;
use super::span::escape;
use super::{Expression, Expressions, Vector, one, yes};

/// Load factor over time as a table of [time, factor] pairs, linear in between. Times must increase and cover the
/// analysis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(extend("examples" = [[[0, 0], [1, 1]]]))]
pub struct LoadCurve(#[schemars(length(min = 2))] pub Vec<[f64; 2]>);

/// The load curve of a deck; by default, a ramp from 0 to 1 over the analysis.
pub(crate) fn load_curve(curve: Option<&LoadCurve>, end_time: f64) -> model::LoadCurve {
    match curve {
        Some(LoadCurve(pairs)) => model::LoadCurve::table(pairs.clone()),
        None => model::LoadCurve::ramp(end_time),
    }
}

/// An external force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum LoadDeck {
    /// Weight: the constant mass of each point times the acceleration.
    Gravity {
        /// Name, unique among the loads.
        name: String,
        /// Acceleration at load factor 1, [length/time²], one number per axis.
        #[schemars(with = "Vector", extend("examples" = [[0, -9.81]]))]
        acceleration: Vec<f64>,
        /// Names of the bodies it acts on; all bodies by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        bodies: Option<Vec<String>>,
        /// Load factor over time; by default, a linear ramp from 0 to 1, or 1 from time 0 on if the load acts on a body
        /// with `initial_stress`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        curve: Option<LoadCurve>,
    },
    /// Force per volume at the start of the load step, eq. (24), or per mass.
    BodyForce {
        /// Name, unique among the loads.
        name: String,
        /// Force per volume, [force/volume], or per mass, [length/time²], at load factor 1, one number or formula per
        /// axis. A formula may contain x, y (the position at the start of the step), X, Y (the original position), in
        /// space also z and Z, `factor` (the load factor), the parameters and the names under `where`. A formula that
        /// contains `factor`, directly or through a name under `where`, states the whole force; any other formula is
        /// multiplied by the load factor.
        #[schemars(with = "Expressions", extend("examples" = [["gamma*y", 0]]))]
        force: Vec<Expression>,
        /// Quantity to which `force` refers.
        #[serde(default)]
        per: Per,
        /// Named intermediate values, in any order, for use in `force`.
        #[serde(rename = "where", default, skip_serializing_if = "BTreeMap::is_empty")]
        intermediate: BTreeMap<String, Expression>,
        /// Names of the bodies it acts on; all bodies by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        bodies: Option<Vec<String>>,
        /// Load factor over time; by default, a linear ramp from 0 to 1.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        curve: Option<LoadCurve>,
    },
    /// A force distributed equally over selected points of a body, eq. (25); it moves with these points.
    PointForce {
        /// Name, unique among the loads.
        name: String,
        /// Name of the body.
        body: String,
        /// Points on which it acts.
        points: PointSelector,
        /// Total force at load factor 1, [force] (per unit thickness in plane strain, on the full circle in
        /// axisymmetry), one number per axis.
        #[schemars(with = "Vector", extend("examples" = [[0, -100e3]]))]
        total: Vec<f64>,
        /// Load factor over time; by default, a linear ramp from 0 to 1.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        curve: Option<LoadCurve>,
    },
    /// A force per original area of a surface; its direction stays fixed.
    Traction {
        /// Name, unique among the loads.
        name: String,
        /// Name of the surface.
        surface: String,
        /// Force per original area at load factor 1, [stress], one number or formula per axis. Formulas are written as
        /// for a body force.
        #[schemars(with = "Expressions", extend("examples" = [[0, -10e3]]))]
        traction: Vec<Expression>,
        /// Named intermediate values, in any order, for use in `traction`.
        #[serde(rename = "where", default, skip_serializing_if = "BTreeMap::is_empty")]
        intermediate: BTreeMap<String, Expression>,
        /// Load factor over time; by default, a linear ramp from 0 to 1.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        curve: Option<LoadCurve>,
    },
    /// A pressure on a surface. It follows the surface, acting against the current normal on the current area, unless
    /// `follows: false` is given. Give either `pressure` or `hydrostatic`.
    Pressure {
        /// Name, unique among the loads.
        name: String,
        /// Name of the surface.
        surface: String,
        /// Pressure at load factor 1, [stress]: a number, or a formula as for a body force.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("examples" = [100e3]))]
        pressure: Option<Expression>,
        /// Pressure of a liquid at rest.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        hydrostatic: Option<HydrostaticDeck>,
        /// If false, `pressure` is a dead load: it acts against the original normal on the original area.
        #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
        follows: bool,
        /// Named intermediate values, in any order, for use in `pressure`.
        #[serde(rename = "where", default, skip_serializing_if = "BTreeMap::is_empty")]
        intermediate: BTreeMap<String, Expression>,
        /// Load factor over time; by default, a linear ramp from 0 to 1.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        curve: Option<LoadCurve>,
    },
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

impl LoadDeck {
    /// Name of the load.
    pub fn name(&self) -> &str {
        match self {
            LoadDeck::Gravity { name, .. }
            | LoadDeck::BodyForce { name, .. }
            | LoadDeck::PointForce { name, .. }
            | LoadDeck::Traction { name, .. }
            | LoadDeck::Pressure { name, .. } => name,
        }
    }

    /// Load factor over time, if it is stated.
    pub fn curve(&self) -> Option<&LoadCurve> {
        match self {
            LoadDeck::Gravity { curve, .. }
            | LoadDeck::BodyForce { curve, .. }
            | LoadDeck::PointForce { curve, .. }
            | LoadDeck::Traction { curve, .. }
            | LoadDeck::Pressure { curve, .. } => curve.as_ref(),
        }
    }

    /// Names of the bodies on whose points the load acts; `None` for all bodies, and empty for a load on a surface.
    pub(crate) fn bodies(&self) -> Option<&[String]> {
        match self {
            LoadDeck::Gravity { bodies, .. } | LoadDeck::BodyForce { bodies, .. } => bodies.as_deref(),
            LoadDeck::PointForce { body, .. } => Some(std::slice::from_ref(body)),
            LoadDeck::Traction { .. } | LoadDeck::Pressure { .. } => Some(&[]),
        }
    }

    /// Name of the surface on which the load acts; `None` if it acts on points.
    pub(crate) fn surface(&self) -> Option<&str> {
        match self {
            LoadDeck::Traction { surface, .. } | LoadDeck::Pressure { surface, .. } => Some(surface),
            LoadDeck::Gravity { .. } | LoadDeck::BodyForce { .. } | LoadDeck::PointForce { .. } => None,
        }
    }

    /// The expressions that may be formulas, with their keys relative to the load.
    pub(crate) fn expressions(&self) -> Vec<(String, &Expression)> {
        let each = |key: &str, vector: &'_ [Expression]| -> Vec<String> {
            (0..vector.len()).map(|axis| format!("{key}/{axis}")).collect()
        };
        let (keys, components, intermediate) = match self {
            LoadDeck::BodyForce { force, intermediate, .. } => {
                (each("force", force), &force[..], intermediate)
            }
            LoadDeck::Traction { traction, intermediate, .. } => {
                (each("traction", traction), &traction[..], intermediate)
            }
            LoadDeck::Pressure { pressure, intermediate, .. } => {
                (vec!["pressure".to_owned()], pressure.as_slice(), intermediate)
            }
            LoadDeck::Gravity { .. } | LoadDeck::PointForce { .. } => return Vec::new(),
        };
        let given = intermediate.iter().map(|(name, text)| (format!("where/{}", escape(name)), text));
        keys.into_iter().zip(components).chain(given).collect()
    }

    /// Checks the keys of this kind of load.
    pub(crate) fn check(&self, check: &mut dyn Checks, pointer: &str) {
        let at = |key: &str| format!("{pointer}/{key}");
        match self {
            LoadDeck::Gravity { name, acceleration, bodies, .. } => {
                check.vector(&at("acceleration"), acceleration);
                check.targets(&at("bodies"), bodies.as_deref());
                check.weight(pointer, name, bodies.as_deref());
            }
            LoadDeck::BodyForce { name, force, per, intermediate, bodies, .. } => {
                if force.len() != check.dimensions() {
                    check.wrong_count(&at("force"), force.len());
                }
                check.formulas_at_points(pointer, force, intermediate);
                if *per == Per::Mass {
                    check.weight(pointer, name, bodies.as_deref());
                }
                check.targets(&at("bodies"), bodies.as_deref());
            }
            LoadDeck::PointForce { body, points: PointSelector { nearest, .. }, total, .. } => {
                check.body(&at("body"), body);
                check.vector(&at("points/nearest"), nearest);
                check.vector(&at("total"), total);
            }
            LoadDeck::Traction { surface, traction, intermediate, .. } => {
                check.surface(&at("surface"), surface);
                if traction.len() != check.dimensions() {
                    check.wrong_count(&at("traction"), traction.len());
                }
                check.formulas_at_places(pointer, ("traction", traction), false, intermediate);
            }
            LoadDeck::Pressure { surface, pressure, hydrostatic, follows, intermediate, .. } => {
                check.surface(&at("surface"), surface);
                if hydrostatic.is_some() && !follows {
                    let message =
                        format!("the hydrostatic pressure {} always follows its surface", quote(self.name()));
                    let help = "remove `follows: false`, or give the pressure as a formula under `pressure`";
                    check.error_at_key("D020", &at("follows"), message, help);
                }
                if pressure.is_some() == hydrostatic.is_some() {
                    let message = format!("the load {} needs exactly one pressure", quote(self.name()));
                    check.error_at_key("D020", pointer, message, "give either `pressure` or `hydrostatic`");
                }
                check.formulas_at_places(pointer, ("pressure", pressure.as_slice()), true, intermediate);
            }
        }
    }

    /// The action of the load in a model; `None` if the load has faults, which have then been reported to the builder.
    pub(crate) fn action<const D: usize>(
        &self,
        builder: &mut dyn Builds,
        pointer: &str,
    ) -> Option<Action<D>> {
        match self {
            LoadDeck::Gravity { acceleration, .. } => Some(Action::Gravity(array(acceleration))),
            LoadDeck::BodyForce { force, per, intermediate, .. } => {
                let formula = at_points::<D>(force, intermediate, builder.parameters());
                let formula = formula.map_err(|faults| builder.faulty_formulas(pointer, faults)).ok()?;
                Some(match per {
                    Per::Volume => Action::BodyForce(formula),
                    Per::Mass => Action::MassForce(formula),
                })
            }
            LoadDeck::PointForce { body, points: PointSelector { nearest, count }, total, .. } => {
                let wanted = (nearest.as_slice(), *count, Ties::Refused);
                let chosen = builder.nearest(body, wanted, &format!("{pointer}/points"));
                let share = 1.0 / chosen.len().max(1) as f64;
                Some(Action::PointForce { points: chosen, force: array::<D>(total).map(|f| f * share) })
            }
            LoadDeck::Traction { surface, traction, intermediate, .. } => {
                let parts = ("traction", traction.as_slice());
                let formula = at_places::<D, D>(parts, intermediate, builder.parameters());
                let traction = formula.map_err(|faults| builder.faulty_formulas(pointer, faults)).ok()?;
                Some(Action::Traction { surface: builder.surface_number(surface), traction })
            }
            LoadDeck::Pressure { surface, pressure, hydrostatic, follows, intermediate, .. } => {
                let surface = builder.surface_number(surface);
                if let Some(HydrostaticDeck { level, unit_weight }) = *hydrostatic {
                    let pressure = Pressure::Hydrostatic { level, unit_weight };
                    return Some(Action::Pressure { surface, pressure });
                }
                let parts = ("pressure", pressure.as_slice());
                let formula = at_places::<D, 1>(parts, intermediate, builder.parameters());
                let formula = formula.map_err(|faults| builder.faulty_formulas(pointer, faults)).ok()?;
                let pressure = if *follows { Pressure::Given(formula) } else { Pressure::Dead(formula) };
                Some(Action::Pressure { surface, pressure })
            }
        }
    }

    /// Key of the magnitude, and true if the magnitude is zero at every load factor.
    pub(crate) fn magnitude(&self) -> (&'static str, bool) {
        match self {
            LoadDeck::Gravity { acceleration, .. } => {
                ("acceleration", acceleration.iter().all(|a| *a == 0.0))
            }
            LoadDeck::BodyForce { force, .. } => ("force", force.iter().all(Expression::is_zero)),
            LoadDeck::PointForce { total, .. } => ("total", total.iter().all(|f| *f == 0.0)),
            LoadDeck::Traction { traction, .. } => ("traction", traction.iter().all(Expression::is_zero)),
            LoadDeck::Pressure { hydrostatic: Some(liquid), .. } => {
                ("hydrostatic", liquid.unit_weight == 0.0)
            }
            LoadDeck::Pressure { pressure, .. } => {
                ("pressure", pressure.as_ref().is_some_and(Expression::is_zero))
            }
        }
    }
}

/// Selection of the points of a body that are nearest to a location at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointSelector {
    /// The location, [length].
    #[schemars(with = "Vector", extend("examples" = [[10, 9.5]]))]
    pub nearest: Vec<f64>,
    /// Number of points; it must not separate points that are equally near.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub count: u32,
}
