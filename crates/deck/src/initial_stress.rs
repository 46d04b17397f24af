//! The stress of bodies at time 0, and the loads that balance it.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::formulas::{Fault, at_start};
use super::loads::load_curve;
use super::{BodyDeck, Deck, Expression, LoadDeck, Parameter};
use mpm_core::formula::Formula;
use mpm_core::model::LoadCurve;

/// Stress of a body at time 0, in its original configuration, whose deformation gradient is the identity. A stress
/// outside the yield surface is returned to it, with a warning. Gravity without a `curve` on a body with initial stress
/// has the load factor 1 from time 0 on; other loads then have the factors of their curves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum InitialStressDeck {
    /// The vertical stress, along the last axis, carries the weight above: the weight of all bodies with geostatic
    /// stress on the vertical line from a point up to the surface. For a body that is present at time 0, these are
    /// bodies present at time 0; for another body, bodies present in the first stage that adds it. The normal stresses
    /// in all other directions, including the out-of-plane or circumferential one, are `k0` times the vertical stress.
    /// The weight is that of the loads of type `gravity`, with their factors at time 0.
    Geostatic {
        /// Level of the ground surface, its coordinate along the last axis, [length].
        #[schemars(extend("examples" = [10]))]
        surface: f64,
        /// Coefficient of earth pressure at rest K₀: horizontal over vertical stress, [-].
        #[schemars(range(min = 0.0), extend("examples" = [0.5]))]
        k0: f64,
        /// Pressure on the surface, [stress].
        #[serde(default)]
        #[schemars(range(min = 0.0), extend("examples" = [20e3]))]
        surcharge: f64,
    },
    /// Components of the Cauchy stress, tension positive.
    Components {
        /// Components; missing ones are 0.
        stress: StressDeck,
    },
}

/// Components of a stress, [stress]: numbers, or formulas in X, Y (the original position), in space also Z, and the
/// parameters.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StressDeck {
    /// Normal stress along x.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = ["-9e3*(10 - Y)"]))]
    pub xx: Option<Expression>,
    /// Normal stress along y.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = ["-18e3*(10 - Y)"]))]
    pub yy: Option<Expression>,
    /// Normal stress along z: out of plane in plane strain, in the circumferential direction of a body of revolution.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [-50e3]))]
    pub zz: Option<Expression>,
    /// Shear stress in the plane of x and y.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [5e3]))]
    pub xy: Option<Expression>,
    /// Shear stress in the plane of y and z; in space only.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [5e3]))]
    pub yz: Option<Expression>,
    /// Shear stress in the plane of x and z; in space only.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [5e3]))]
    pub xz: Option<Expression>,
}

/// A formula of a component of a stress, with its row and column.
type ComponentFormula = ((usize, usize), Formula);

impl InitialStressDeck {
    /// True if the stress is zero everywhere. A geostatic stress never is, because it carries weight.
    pub(crate) fn is_zero(&self) -> bool {
        match self {
            InitialStressDeck::Geostatic { .. } => false,
            InitialStressDeck::Components { stress } => {
                stress.components().all(|(_, _, component)| component.is_zero())
            }
        }
    }
}

impl StressDeck {
    /// The given components, each with its key, and its row and column.
    pub fn components(&self) -> impl Iterator<Item = (&'static str, (usize, usize), &Expression)> {
        let StressDeck { xx, yy, zz, xy, yz, xz } = self;
        let all = [
            ("xx", (0, 0), xx),
            ("yy", (1, 1), yy),
            ("zz", (2, 2), zz),
            ("xy", (0, 1), xy),
            ("yz", (1, 2), yz),
            ("xz", (0, 2), xz),
        ];
        all.into_iter().filter_map(|(key, place, given)| given.as_ref().map(|given| (key, place, given)))
    }

    /// The given components as formulas of the original position, each with its row and column.
    ///
    /// # Errors
    /// The first fault in each formula.
    pub fn formulas(
        &self,
        parameters: &BTreeMap<String, Parameter>,
        dimensions: usize,
    ) -> Result<Vec<ComponentFormula>, Vec<Fault>> {
        let given = self.components().map(|(key, _, given)| (format!("stress/{key}"), given)).collect();
        let formulas = at_start(given, parameters, dimensions)?;
        Ok(self.components().map(|(_, place, _)| place).zip(formulas).collect())
    }
}

/// True if a body of the deck is stressed at time 0.
pub(crate) fn is_stressed(deck: &Deck) -> bool {
    deck.bodies.iter().any(|body| body.initial_stress.is_some())
}

/// True if a load acts on the points of a body.
fn acts_on(load: &LoadDeck, body: &BodyDeck) -> bool {
    load.bodies().is_none_or(|names| names.contains(&body.name))
}

/// True if a load balances the initial stress of a body from time 0 on: gravity without a curve on such a body.
fn holds_stress(deck: &Deck, load: &LoadDeck) -> bool {
    let is_stressed = |body: &BodyDeck| body.initial_stress.is_some() && acts_on(load, body);
    load.acceleration().is_some() && load.curve().is_none() && deck.bodies.iter().any(is_stressed)
}

/// Load factor of a load at time 0, [-]: 0 if no body has an initial stress, 1 for gravity without a curve on a body
/// with initial stress, otherwise that of its curve.
pub fn initial_factor(deck: &Deck, load: &LoadDeck) -> f64 {
    if is_stressed(deck) { curve_of(deck, load).factor(0.0) } else { 0.0 }
}

/// The load factor of a load over time, [-]: its curve if it has one; otherwise constant for gravity on a body with
/// initial stress, and a ramp from 0 to 1 for any other load.
pub fn curve_of(deck: &Deck, load: &LoadDeck) -> LoadCurve {
    let end = deck.end_time();
    if holds_stress(deck, load) {
        LoadCurve::table(vec![[0.0, 1.0], [end, 1.0]])
    } else {
        load_curve(load.curve(), end)
    }
}

/// The loads of type `gravity` on a body, with their numbers, and their accelerations at time 0, [length/time²].
pub(crate) fn gravity_on<'a>(
    deck: &'a Deck,
    body: &'a BodyDeck,
) -> impl Iterator<Item = (usize, &'a LoadDeck, Vec<f64>)> {
    deck.loads.iter().enumerate().filter(|(_, load)| acts_on(load, body)).filter_map(|(number, load)| {
        let factor = initial_factor(deck, load);
        Some((number, load, load.acceleration()?.iter().map(|a| factor * a).collect()))
    })
}

/// Weight per volume of a body at time 0, downwards along the last axis, [force/volume].
pub(crate) fn unit_weight(deck: &Deck, body: &BodyDeck) -> f64 {
    let density = deck.materials.get(&body.material).and_then(|material| material.density()?.as_number());
    let last = deck.dimensions() - 1;
    let down = |acceleration: &Vec<f64>| -acceleration.get(last).copied().unwrap_or(0.0);
    density.unwrap_or(0.0) * gravity_on(deck, body).map(|(_, _, a)| down(&a)).sum::<f64>()
}
