//! A force on selected points.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{ActionDeck, LoadCurve, LoadKeys};
use crate::gates::{Builds, Checks, NearestPoints, Ties};
use crate::per_axis::array;
use crate::{Vector, one};
use mpm_core::model::Action;

/// A force distributed equally over selected points of a body, eq. (25); it moves with these points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointForceDeck {
    /// Name, unique among the loads.
    pub name: String,
    /// Name of the body.
    pub body: String,
    /// Points on which it acts.
    pub points: PointSelector,
    /// Total force at load factor 1, [force] (per unit thickness in plane strain, on the full circle in
    /// axisymmetry), one number per axis.
    #[schemars(with = "Vector", extend("examples" = [[0, -100e3]]))]
    pub total: Vec<f64>,
    /// Load factor over time; by default, a linear ramp from 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub curve: Option<LoadCurve>,
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

impl LoadKeys for PointForceDeck {
    fn name(&self) -> &str {
        &self.name
    }

    fn curve(&self) -> Option<&LoadCurve> {
        self.curve.as_ref()
    }

    fn bodies(&self) -> Option<&[String]> {
        Some(std::slice::from_ref(&self.body))
    }

    fn magnitude(&self) -> (&'static str, bool) {
        ("total", self.total.iter().all(|f| *f == 0.0))
    }

    fn check(&self, check: &mut dyn Checks, pointer: &str) {
        check.body(&format!("{pointer}/body"), &self.body);
        check.vector(&format!("{pointer}/points/nearest"), &self.points.nearest);
        check.vector(&format!("{pointer}/total"), &self.total);
    }
}

impl<const D: usize> ActionDeck<D> for PointForceDeck {
    fn action(&self, builder: &mut dyn Builds, pointer: &str) -> Option<Action<D>> {
        let wanted =
            NearestPoints { place: &self.points.nearest, count: self.points.count, ties: Ties::Refused };
        let points = builder.nearest(&self.body, wanted, &format!("{pointer}/points"));
        let share = 1.0 / points.len().max(1) as f64;
        Some(Action::PointForce { points, force: array::<D>(&self.total).map(|f| f * share) })
    }
}
