//! The surfaces of a deck.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{BoxDeck, GroupDeck, Length, Vector};

/// A surface of a body, on which loads and boundary conditions act. It is sampled at the start and then carried by the
/// grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurfaceDeck {
    /// Name, unique among the surfaces.
    pub name: String,
    /// Name of the body.
    pub body: String,
    /// Part of the boundary of the body; the whole boundary by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<PartDeck>,
    /// Largest length of a sample where the sides of domains do not form the surface, [length]; by default a quarter of
    /// the smallest cell at the surface. Without effect where the samples are the sides of the domains of the points. A
    /// full circle has at least 24 samples.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Length>", extend("examples" = [0.05]))]
    pub spacing: Option<f64>,
}

/// Selection of a part of the boundary of a body in exactly one way.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PartDeck {
    /// Samples whose centres lie inside this box, its boundary included.
    #[serde(rename = "box", skip_serializing_if = "Option::is_none")]
    pub within: Option<BoxDeck>,
    /// Samples whose centres lie in this half-space, its plane included.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub half_space: Option<HalfSpaceDeck>,
    /// Number of a side of the shape, from 0. Polygon: side i runs from corner i to the next. Box in the plane: bottom,
    /// right, top, left. Box in space: lowest x, highest x, lowest y, and so on. Annulus: outer (0) and inner (1)
    /// boundary. Cylinder or cone: lateral surface (0), start (1), end (2). Extruded polygon: its sides, then its lower
    /// and upper ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [2]))]
    pub edge: Option<u32>,
    /// Name of a physical group of a gmsh grid: selects, on the boundary of a body of shape `cells`, the cell sides
    /// whose nodes all belong to the group.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = ["crest"]))]
    pub group: Option<GroupDeck>,
}

/// A half-space: the positions x with (x − point) · normal ≥ 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HalfSpaceDeck {
    /// A point on its plane, [length].
    #[schemars(with = "Vector", extend("examples" = [[4, 0]]))]
    pub point: Vec<f64>,
    /// Direction into the half-space, a vector of any length, [-].
    #[schemars(with = "Vector", extend("examples" = [[1, 0]]))]
    pub normal: Vec<f64>,
}
