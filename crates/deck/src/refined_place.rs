//! Places towards which the cells of a structured grid shrink.

#![allow(rustdoc::broken_intra_doc_links, reason = "units stand in brackets")]

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A place towards which cells shrink: along each axis, a grid line lies at its coordinate, the cells beside the line
/// are `to` long, and each further cell is about 1.2 times as long, until the cells are as long as `spacing`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RefineDeck {
    /// Coordinates of the place, [length], for example the edge of a footing: one per axis, or `{x: 1}` if the cells
    /// along other axes stay as they are.
    #[schemars(extend("examples" = [[1, 4], {"x": 1}]))]
    pub at: RefinedAt,
    /// Size of the cells at the place, [length]; at most `spacing`, with which the place has no effect.
    #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.05]))]
    pub to: f64,
}

/// Coordinates of a place: one per axis, or those along some axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum RefinedAt {
    /// One coordinate per axis.
    Point(#[schemars(length(min = 2, max = 3))] Vec<f64>),
    /// Coordinates along some axes.
    Along(AlongAxes),
}

/// Coordinates along some axes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AlongAxes {
    /// Coordinate along x, [length].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [1]))]
    pub x: Option<f64>,
    /// Coordinate along y, [length].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [4]))]
    pub y: Option<f64>,
    /// Coordinate along z, [length]; in space only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [2]))]
    pub z: Option<f64>,
}

impl RefinedAt {
    /// The coordinates along x, y and z that are given.
    pub(crate) fn coordinates(&self) -> [Option<f64>; 3] {
        match self {
            RefinedAt::Point(x) => std::array::from_fn(|axis| x.get(axis).copied()),
            RefinedAt::Along(AlongAxes { x, y, z }) => [*x, *y, *z],
        }
    }

    /// Pointer of the coordinate along an axis, below the place.
    pub(crate) fn pointer(&self, axis: usize) -> String {
        match self {
            RefinedAt::Point(_) => format!("at/{axis}"),
            RefinedAt::Along(_) => format!("at/{}", crate::AXES[axis]),
        }
    }
}
