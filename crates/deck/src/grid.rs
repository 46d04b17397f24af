//! The background grid of a deck, and the lines of a structured one.

#![allow(rustdoc::broken_intra_doc_links, reason = "units stand in brackets")]

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Axis as DeckAxis, Lengths, RefineDeck, Vector};
use mpm_core::grid::{Axis, CoincidentLines, Interval};

/// The background grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum GridDeck {
    /// A grid of rectangles (of bricks in space) aligned with the axes.
    Structured {
        /// Corner with the smallest coordinates, [length].
        #[schemars(with = "Vector", extend("examples" = [[0, 0]]))]
        origin: Vec<f64>,
        /// Extent along each axis, [length]; a whole multiple of `spacing` along an axis for which that is a number.
        #[schemars(with = "Lengths", extend("examples" = [[11, 10]]))]
        size: Vec<f64>,
        /// Sides of the cells, [length]; one number, or one entry per axis, each a number or a list of intervals for a
        /// graded grid.
        #[schemars(extend("examples" = [0.5, [0.5, 0.25], [[{"to": 2, "cells": 10}, {"to": 11, "cells": 12, "ratio": 1.2}], 0.5]]))]
        spacing: SpacingDeck,
        /// Grid lines that follow boundary conditions from step to step, so that a moving footing or tool stays on grid
        /// lines. Not with displacement or arc-length control.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        #[schemars(length(max = 1000), extend("examples" = [[{"axis": "y", "from": 4, "condition": "push"}]]))]
        follow: Vec<FollowDeck>,
        /// Places towards which cells shrink, such as the edges of a footing; only along axes whose `spacing` is a number.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        #[schemars(length(max = 1000), extend("examples" = [[{"at": [1, 4], "to": 0.05}]]))]
        refine: Vec<RefineDeck>,
        /// `spacing` and `refine` as the deck states them, where both have been replaced by the intervals that they mean.
        #[serde(skip)]
        unrefined: Option<Unrefined>,
    },
    /// Triangles and quadrilaterals (tetrahedra and hexahedra in space) from a mesh file of gmsh, format 2.0 to 4.1,
    /// text or binary.
    Gmsh {
        /// Path of the mesh file, relative to the deck.
        #[schemars(length(min = 1), extend("examples" = ["ring.msh"]))]
        file: String,
    },
}

/// `spacing` and `refine` as a deck states them.
#[derive(Debug, Clone, PartialEq)]
pub struct Unrefined {
    /// Sides of the cells far from the places.
    pub spacing: SpacingDeck,
    /// Places towards which cells shrink.
    pub places: Vec<RefineDeck>,
}

/// Grid lines that follow a boundary condition. At the start of each load step, they stand where the condition has
/// moved them. The cells between two groups of such lines, and between a group and an end of the grid, stretch evenly.
/// The ends of the grid stay in place unless they also follow a condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FollowDeck {
    /// Axis along which the lines move.
    pub axis: DeckAxis,
    /// Original coordinate of the first line, [length].
    #[schemars(extend("examples" = [4]))]
    pub from: f64,
    /// Original coordinate of the last line, [length]; by default `from`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [5]))]
    pub to: Option<f64>,
    /// Name of the boundary condition whose displacement along the axis the lines follow; the displacement must be a
    /// number, or a formula without coordinates. The lines follow it even while the condition does not act.
    #[schemars(extend("examples" = ["push"]))]
    pub condition: String,
}

/// Distance to a grid line within which a coordinate counts as lying on it, relative to the size of the cells around
/// the line, [-].
const ON_LINE: f64 = 1e-6;

/// The index of the grid line at a coordinate.
///
/// # Errors
/// The coordinate of the nearest line, if none lies there.
pub(crate) fn line_at(lines: &Axis, coordinate: f64) -> Result<usize, f64> {
    let number = lines.nearest_line(coordinate);
    let nearest = lines.line(number);
    let is_on = (coordinate - nearest).abs() <= ON_LINE * lines.size_around(number);
    if is_on { Ok(number) } else { Err(nearest) }
}

/// Sides of the cells: one number for all axes, or a list with one entry per axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum SpacingDeck {
    /// The same side along every axis.
    Same(#[schemars(extend("exclusiveMinimum" = 0.0))] f64),
    /// One entry per axis.
    Each(#[schemars(length(min = 2, max = 3))] Vec<AxisSpacing>),
}

/// Sides of the cells along one axis: a number, or a list of intervals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum AxisSpacing {
    /// The same side everywhere.
    Even(#[schemars(extend("exclusiveMinimum" = 0.0))] f64),
    /// Intervals from the origin of the grid to its end.
    Intervals(#[schemars(length(min = 1, max = 1000))] Vec<IntervalDeck>),
}

/// Consecutive cells along an axis of a graded grid, from the end of the interval before, or from the origin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IntervalDeck {
    /// Coordinate at which the interval ends, [length]; above the end of the interval before. The last interval ends
    /// where the grid does, at `origin` + `size`.
    #[schemars(extend("examples" = [2]))]
    pub to: f64,
    /// Number of cells.
    #[schemars(range(min = 1, max = 1_000_000), extend("examples" = [10]))]
    pub cells: u32,
    /// Size of each cell relative to the one before it, in the direction of increasing coordinate, [-].
    #[serde(default = "equal_sizes")]
    #[schemars(extend("exclusiveMinimum" = 0.0))]
    pub ratio: f64,
}

/// The ratio of cells of equal size.
fn equal_sizes() -> f64 {
    1.0
}

impl SpacingDeck {
    /// The entries for the axes: the same entry for each of `dimensions` axes, or the entries of the list.
    pub(crate) fn entries(&self, dimensions: usize) -> Vec<AxisSpacing> {
        match self {
            SpacingDeck::Same(spacing) => vec![AxisSpacing::Even(*spacing); dimensions],
            SpacingDeck::Each(entries) => entries.clone(),
        }
    }
}

impl AxisSpacing {
    /// Number of cells of an axis that is `size` long, [length]; not a whole number if `size` is not a multiple of the
    /// spacing.
    pub(crate) fn cells(&self, size: f64) -> f64 {
        match self {
            AxisSpacing::Even(spacing) => size / spacing,
            AxisSpacing::Intervals(intervals) => intervals.iter().map(|i| f64::from(i.cells)).sum(),
        }
    }

    /// The lines of an axis that begins at `origin` and is `size` long, [length]. The last interval ends exactly at the
    /// end of the axis.
    ///
    /// # Errors
    /// [`CoincidentLines`] for intervals whose lines do not ascend.
    pub(crate) fn axis(&self, origin: f64, size: f64) -> Result<Axis, CoincidentLines> {
        match self {
            AxisSpacing::Even(_) => {
                let cells = (self.cells(size).round() as usize).max(1);
                Ok(Axis::even(origin, size / cells as f64, cells))
            }
            AxisSpacing::Intervals(intervals) => {
                let mut intervals: Vec<Interval> = intervals
                    .iter()
                    .map(|i| Interval { to: i.to, cells: i.cells as usize, ratio: i.ratio })
                    .collect();
                if let Some(last) = intervals.last_mut() {
                    last.to = origin + size;
                }
                Axis::from_intervals(origin, &intervals)
            }
        }
    }
}
