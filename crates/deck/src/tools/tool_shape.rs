//! The shapes of tools.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{Axis, Pair, Vector};

/// The shape of a tool.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ToolShape {
    /// Everything behind a plane (in two dimensions, behind a line): a platen or a wall.
    HalfSpace {
        /// A point on the plane, [length].
        #[schemars(with = "Vector", extend("examples" = [[0, 4]]))]
        point: Vec<f64>,
        /// Direction out of the tool, of any length, [-].
        #[schemars(with = "Vector", extend("examples" = [[0, -1]]))]
        normal: Vec<f64>,
    },
    /// A box aligned with the axes.
    Box {
        /// Corner with the smallest coordinates, [length].
        #[schemars(with = "Vector", extend("examples" = [[-1, 4]]))]
        min: Vec<f64>,
        /// Corner with the largest coordinates, [length].
        #[schemars(with = "Vector", extend("examples" = [[1, 5]]))]
        max: Vec<f64>,
    },
    /// A circle in the plane.
    Circle {
        /// Centre, [length].
        #[schemars(with = "Vector", extend("examples" = [[0, 4.5]]))]
        center: Vec<f64>,
        /// Radius, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.5]))]
        radius: f64,
    },
    /// A polygon in the plane that does not cross itself, with its corners in clockwise or counter-clockwise order. In
    /// axisymmetry, give the half of the section at x ≥ 0, or a section that is symmetric about the axis.
    Polygon {
        /// Corners in order, [length].
        #[schemars(with = "Vec<Pair>", length(min = 3), extend("examples" = [[[0, 4], [0.2, 4.4], [0.2, 9], [0, 9]]]))]
        vertices: Vec<Vec<f64>>,
    },
    /// A wall of constant thickness in the plane, with rounded ends and bends, along an open polyline.
    Polyline {
        /// Corners in order, [length].
        #[schemars(with = "Vec<Pair>", length(min = 2), extend("examples" = [[[0, 2], [0, 4]]]))]
        vertices: Vec<Vec<f64>>,
        /// Thickness, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.1]))]
        thickness: f64,
    },
    /// A sphere in space.
    Sphere {
        /// Centre, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 5]]))]
        center: Vec<f64>,
        /// Radius, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1]))]
        radius: f64,
    },
    /// A right circular cylinder in space.
    Cylinder {
        /// Centre of one end, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 4]]))]
        start: Vec<f64>,
        /// Centre of the other end, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 6]]))]
        end: Vec<f64>,
        /// Radius, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.5]))]
        radius: f64,
    },
    /// A right circular cone in space, whole or truncated.
    Cone {
        /// Centre of one end, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 4]]))]
        start: Vec<f64>,
        /// Centre of the other end, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 5]]))]
        end: Vec<f64>,
        /// Radii at the start and at the end, [length]; one of them may be 0.
        #[schemars(with = "Pair", extend("examples" = [[0, 0.5]]))]
        radii: Vec<f64>,
    },
    /// A body of revolution in space: a penetrometer, a spudcan, an open pile.
    Revolution {
        /// A point on the axis, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 4]]))]
        start: Vec<f64>,
        /// Direction of the axis, of any length, [-].
        #[schemars(with = "Vector", extend("examples" = [[0, 0, 1]]))]
        direction: Vec<f64>,
        /// Corners of the section in order, [length]: distance from the axis, and height above `start` along the axis.
        #[schemars(with = "Vec<Pair>", length(min = 3), extend("examples" = [[[0, 0], [0.2, 0.35], [0.2, 3], [0, 3]]]))]
        section: Vec<Vec<f64>>,
    },
    /// A polygon extruded along an axis, in space.
    Extrusion {
        /// Corners of the polygon in order, [length], given by the other two coordinates in alphabetical order.
        #[schemars(with = "Vec<Pair>", length(min = 3), extend("examples" = [[[0, 4], [1, 4], [0, 6]]]))]
        polygon: Vec<Vec<f64>>,
        /// Axis of the extrusion.
        #[schemars(extend("examples" = ["y"]))]
        axis: Axis,
        /// Lower end along the axis, [length].
        #[schemars(extend("examples" = [0]))]
        from: f64,
        /// Upper end along the axis, [length].
        #[schemars(extend("examples" = [3]))]
        to: f64,
    },
    /// A triangulated surface, in space: closed, or open with all its facets looking to one side.
    Stl {
        /// Path of an STL file, text or binary, relative to the deck. Its surface must not cross itself.
        #[schemars(length(min = 1), extend("examples" = ["anchor.stl"]))]
        file: String,
        /// Factor by which the coordinates in the file are multiplied, [-]; 1 by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.001]))]
        scale: Option<f64>,
        /// Rotation about the origin of the file, [degree]: a vector along the axis, whose length is the angle; none by
        /// default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(with = "Option<Vector>", extend("examples" = [[0, 0, 90]]))]
        rotate: Option<Vec<f64>>,
        /// Position of the origin of the file, [length]; the origin of coordinates by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(with = "Option<Vector>", extend("examples" = [[2, 2, 5]]))]
        at: Option<Vec<f64>>,
        /// Thickness of the tool behind an open surface, [length]: terrain or a wall, whose facets look to the side of
        /// the bodies; by default a tenth of the diagonal of its bounds. A closed surface has none.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.5]))]
        thickness: Option<f64>,
    },
}

impl ToolShape {
    /// Name of the type of the shape in decks.
    pub(crate) fn word(&self) -> &'static str {
        match self {
            ToolShape::HalfSpace { .. } => "half-space",
            ToolShape::Box { .. } => "box",
            ToolShape::Circle { .. } => "circle",
            ToolShape::Polygon { .. } => "polygon",
            ToolShape::Polyline { .. } => "polyline",
            ToolShape::Sphere { .. } => "sphere",
            ToolShape::Cylinder { .. } => "cylinder",
            ToolShape::Cone { .. } => "cone",
            ToolShape::Revolution { .. } => "revolution",
            ToolShape::Extrusion { .. } => "extrusion",
            ToolShape::Stl { .. } => "stl",
        }
    }

    /// The number of dimensions that the shape needs; `None` if it exists in the plane and in space.
    pub(crate) fn dimensions(&self) -> Option<usize> {
        match self {
            ToolShape::HalfSpace { .. } | ToolShape::Box { .. } => None,
            ToolShape::Circle { .. } | ToolShape::Polygon { .. } | ToolShape::Polyline { .. } => Some(2),
            ToolShape::Sphere { .. }
            | ToolShape::Cylinder { .. }
            | ToolShape::Cone { .. }
            | ToolShape::Revolution { .. }
            | ToolShape::Extrusion { .. }
            | ToolShape::Stl { .. } => Some(3),
        }
    }

    /// The number of sides that decks can refer to by number; `None` if there are none.
    pub(crate) fn edges(&self) -> Option<usize> {
        match self {
            ToolShape::Box { min, .. } => Some(2 * min.len()),
            ToolShape::Polygon { vertices } => Some(vertices.len()),
            ToolShape::Polyline { vertices, .. } => Some(vertices.len().saturating_sub(1)),
            ToolShape::Cylinder { .. } | ToolShape::Cone { .. } => Some(3),
            ToolShape::Revolution { section, .. } => Some(section.len()),
            ToolShape::Extrusion { polygon, .. } => Some(polygon.len() + 2),
            ToolShape::HalfSpace { .. }
            | ToolShape::Circle { .. }
            | ToolShape::Sphere { .. }
            | ToolShape::Stl { .. } => None,
        }
    }

    /// True if the shape cannot be the section of a body of revolution about x = 0: it neither lies at x ≥ 0 nor is
    /// symmetric about the axis.
    pub(crate) fn is_lopsided(&self) -> bool {
        match self {
            ToolShape::Box { min, max } => {
                min.first() < Some(&0.0) && min.first() != max.first().map(|x| -x).as_ref()
            }
            ToolShape::Circle { center, radius } => {
                center.first().is_some_and(|x| *x != 0.0 && x - radius < 0.0)
            }
            ToolShape::Polygon { vertices } | ToolShape::Polyline { vertices, .. } => {
                let has = |x: f64, y: f64| vertices.iter().any(|corner| corner[..] == [x, y]);
                vertices.iter().any(|corner| matches!(corner[..], [x, y] if x < 0.0 && !has(-x, y)))
            }
            _ => false,
        }
    }

    /// Path of the file of the shape, if it has one.
    pub(crate) fn file(&self) -> Option<&str> {
        match self {
            ToolShape::Stl { file, .. } => Some(file),
            _ => None,
        }
    }

    /// The vectors among the keys of the shape.
    pub(crate) fn vectors(&self) -> Vec<(&'static str, &[f64])> {
        match self {
            ToolShape::HalfSpace { point, normal } => vec![("point", point), ("normal", normal)],
            ToolShape::Box { min, max } => vec![("min", min), ("max", max)],
            ToolShape::Circle { center, .. } | ToolShape::Sphere { center, .. } => vec![("center", center)],
            ToolShape::Cylinder { start, end, .. } | ToolShape::Cone { start, end, .. } => {
                vec![("start", start), ("end", end)]
            }
            ToolShape::Revolution { start, direction, .. } => {
                vec![("start", start), ("direction", direction)]
            }
            _ => Vec::new(),
        }
    }
}
