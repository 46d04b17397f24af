//! Regions that bodies fill: the types of the deck, and their translation to regions of the plane or of space.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::placed::placed;
use super::tool_shapes::DeckTool;
use super::{Axis, Pair, Vector};
use mpm_core::grid::{Grid, Mesh, Structured};
use mpm_core::model::Fillable;
use mpm_core::region::{
    Ball, Brick, Frustum, Group, HollowBall, Meshed, Motion, Polygon, Prism, Region, ShapeError, Surface,
};

pub(super) mod files;
mod group_name;
mod groups;

pub(super) use files::FromFiles;
pub use group_name::{GroupDeck, GroupOfDimension};
pub(super) use groups::Groups;

/// A region. A box whose sides lie on grid lines of a structured grid is filled exactly; between lines of a grid or of
/// `point_spacing`, domains of `cpdi1` and `cpdi2` follow the boundary of any other region. Elsewhere, a region gets the
/// points that lie inside it, and the area (volume) gained or lost is reported.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// A box aligned with the axes.
    Box {
        /// Corner with the smallest coordinates, [length].
        #[schemars(with = "Vector", extend("examples" = [[0, 9]]))]
        min: Vec<f64>,
        /// Corner with the largest coordinates, [length].
        #[schemars(with = "Vector", extend("examples" = [[10, 10]]))]
        max: Vec<f64>,
    },
    /// A polygon in the plane that does not cross itself, with its corners in clockwise or counter-clockwise order.
    Polygon {
        /// Corners in order, [length].
        #[schemars(with = "Vec<Pair>", length(min = 3), extend("examples" = [[[0, 0], [2, 0], [0, 1]]]))]
        vertices: Vec<Vec<f64>>,
    },
    /// A circle in the plane.
    Circle {
        /// Centre, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2]]))]
        center: Vec<f64>,
        /// Radius, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1.5]))]
        radius: f64,
    },
    /// The region between two concentric circles in the plane.
    Annulus {
        /// Centre, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2]]))]
        center: Vec<f64>,
        /// Inner radius, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [0.75]))]
        inner: f64,
        /// Outer radius, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1.25]))]
        outer: f64,
    },
    /// A right circular cylinder in space.
    Cylinder {
        /// Centre of one end, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 0]]))]
        start: Vec<f64>,
        /// Centre of the other end, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 3]]))]
        end: Vec<f64>,
        /// Radius, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1.5]))]
        radius: f64,
    },
    /// A right circular cone in space, whole or truncated.
    Cone {
        /// Centre of one end, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 0]]))]
        start: Vec<f64>,
        /// Centre of the other end, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 3]]))]
        end: Vec<f64>,
        /// Radii at the start and at the end, [length]; one of them may be 0.
        #[schemars(with = "Pair", extend("examples" = [[1.5, 0]]))]
        radii: Vec<f64>,
    },
    /// A sphere in space.
    Sphere {
        /// Centre, [length].
        #[schemars(with = "Vector", extend("examples" = [[2, 2, 2]]))]
        center: Vec<f64>,
        /// Radius, [length].
        #[schemars(extend("exclusiveMinimum" = 0.0, "examples" = [1.5]))]
        radius: f64,
    },
    /// A polygon extruded along an axis, in space.
    Extrusion {
        /// Corners of the polygon in order, [length], given by the other two coordinates in alphabetical order; the
        /// polygon must not cross itself.
        #[schemars(with = "Vec<Pair>", length(min = 3), extend("examples" = [[[0, 0], [2, 0], [0, 1]]]))]
        polygon: Vec<Vec<f64>>,
        /// Axis of the extrusion.
        #[schemars(extend("examples" = ["z"]))]
        axis: Axis,
        /// Lower end along the axis, [length].
        #[schemars(extend("examples" = [0]))]
        from: f64,
        /// Upper end along the axis, [length].
        #[schemars(extend("examples" = [3]))]
        to: f64,
    },
    /// The interior of a closed triangulated surface, in space.
    Stl {
        /// Path of an STL file, text or binary, relative to the deck. Its surface must be closed and must not cross
        /// itself.
        #[schemars(length(min = 1), extend("examples" = ["rock.stl"]))]
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
    },
    /// Cells of a mesh of its own, which become the domains of the points of the body on any grid; the mesh cannot be
    /// part of a union, intersection or difference.
    Mesh {
        /// Path of a mesh file of gmsh, format 2.0 to 4.1, relative to the deck.
        #[schemars(length(min = 1), extend("examples" = ["part.msh"]))]
        file: String,
        /// Name of a physical group of the mesh; all cells by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<GroupDeck>,
    },
    /// Whole cells of the grid.
    Cells {
        /// Name of a physical group of a gmsh grid; all cells by default.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        group: Option<GroupDeck>,
    },
    /// Union of several regions.
    Union {
        /// The regions.
        #[schemars(length(min = 1))]
        of: Vec<Shape>,
    },
    /// Intersection of several regions.
    Intersection {
        /// The regions.
        #[schemars(length(min = 1))]
        of: Vec<Shape>,
    },
    /// One region minus several others.
    Difference {
        /// Region from which the others are subtracted.
        from: Box<Shape>,
        /// Regions to subtract.
        #[schemars(length(min = 1))]
        minus: Vec<Shape>,
    },
    /// A translated region.
    Translate {
        /// Translation, [length].
        #[schemars(with = "Vector", extend("examples" = [[1, 0]]))]
        by: Vec<f64>,
        /// Region to translate.
        shape: Box<Shape>,
    },
    /// A rotated region.
    Rotate {
        /// Angle, [degree]: counter-clockwise in the plane; in space, about the axis according to the right-hand rule.
        #[schemars(extend("examples" = [30]))]
        angle: f64,
        /// Fixed point of the rotation, [length].
        #[schemars(with = "Vector", extend("examples" = [[0, 0]]))]
        center: Vec<f64>,
        /// Direction of the axis, a vector of any length, [-], or the name of a coordinate axis; in space only.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("examples" = ["z", [1, 1, 0]]))]
        axis: Option<Direction>,
        /// Region to rotate.
        shape: Box<Shape>,
    },
}

/// A direction in space.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Direction {
    /// Direction of a coordinate axis.
    Along(Axis),
    /// Direction of a vector.
    Vector(#[schemars(length(min = 2, max = 3))] Vec<f64>),
}

impl Shape {
    /// Name of its type in decks.
    pub(super) fn word(&self) -> &'static str {
        match self {
            Shape::Box { .. } => "box",
            Shape::Polygon { .. } => "polygon",
            Shape::Circle { .. } => "circle",
            Shape::Annulus { .. } => "annulus",
            Shape::Cylinder { .. } => "cylinder",
            Shape::Cone { .. } => "cone",
            Shape::Sphere { .. } => "sphere",
            Shape::Extrusion { .. } => "extrusion",
            Shape::Stl { .. } => "stl",
            Shape::Mesh { .. } => "mesh",
            Shape::Cells { .. } => "cells",
            Shape::Union { .. } => "union",
            Shape::Intersection { .. } => "intersection",
            Shape::Difference { .. } => "difference",
            Shape::Translate { .. } => "translate",
            Shape::Rotate { .. } => "rotate",
        }
    }

    /// The number of dimensions that the shape needs; `None` if it exists in the plane and in space.
    pub(super) fn dimensions(&self) -> Option<usize> {
        match self {
            Shape::Polygon { .. } | Shape::Circle { .. } | Shape::Annulus { .. } => Some(2),
            Shape::Cylinder { .. }
            | Shape::Cone { .. }
            | Shape::Sphere { .. }
            | Shape::Extrusion { .. }
            | Shape::Stl { .. } => Some(3),
            _ => None,
        }
    }

    /// The regions of which the shape consists, each with its key.
    pub(super) fn parts(&self) -> Vec<(String, &Shape)> {
        let all = |key: &str, parts: &'_ [Shape]| -> Vec<String> {
            (0..parts.len()).map(|k| format!("{key}/{k}")).collect()
        };
        match self {
            Shape::Union { of } | Shape::Intersection { of } => all("of", of).into_iter().zip(of).collect(),
            Shape::Difference { from, minus } => {
                let first = ("from".to_owned(), from.as_ref());
                std::iter::once(first).chain(all("minus", minus).into_iter().zip(minus)).collect()
            }
            Shape::Translate { shape, .. } | Shape::Rotate { shape, .. } => {
                vec![("shape".to_owned(), shape.as_ref())]
            }
            _ => Vec::new(),
        }
    }

    /// True if the predicate holds for the shape or for any region of which it consists.
    pub(super) fn any(&self, is_such: &dyn Fn(&Shape) -> bool) -> bool {
        is_such(self) || self.parts().into_iter().any(|(_, part)| part.any(is_such))
    }

    /// True for cells of a mesh of its own, moved or not.
    pub(super) fn is_mesh(&self) -> bool {
        match self {
            Shape::Mesh { .. } => true,
            Shape::Translate { shape, .. } | Shape::Rotate { shape, .. } => shape.is_mesh(),
            _ => false,
        }
    }

    /// Paths of all files that the shape uses.
    pub(super) fn files(&self) -> Vec<&str> {
        match self {
            Shape::Stl { file, .. } | Shape::Mesh { file, .. } => vec![file],
            _ => self.parts().into_iter().flat_map(|(_, part)| part.files()).collect(),
        }
    }
}

/// Reason why a region of a deck cannot be built.
pub(super) enum Refusal {
    /// The numbers at this JSON pointer do not enclose a region.
    Numbers(String, ShapeError),
    /// A part of the region is unknown, or its fault has already been reported.
    Unknown,
}

/// The sources of regions that a deck states only by name; `place` is a JSON pointer into the deck.
pub(super) trait Given<const D: usize> {
    /// A group of cells, or all cells.
    fn cells(&mut self, place: &str, group: Option<&GroupDeck>) -> Option<Group<D>>;
    /// The surface in a file, scaled, turned and moved.
    fn surface(&mut self, place: &str, file: &str, placed: &Motion<3>) -> Option<Surface>;
    /// A group of cells, or all cells, of the mesh in a file.
    fn mesh(&mut self, place: &str, file: &str, group: Option<&GroupDeck>) -> Option<Meshed<D>>;
}

/// The regions of all bodies, and the groups of cells of which they consist.
pub(super) struct Regions<const D: usize> {
    pub(super) bodies: Vec<Region<D>>,
    pub(super) groups: Groups,
}

/// The parts of building regions and grids that depend on the number of dimensions.
pub(super) trait DeckRegion<const D: usize>: Sized + DeckTool<D> + Fillable<D> {
    /// Builds a region of a shape that exists only in this number of dimensions; `None` for other shapes.
    fn own(shape: &Shape, place: &str, given: &mut dyn Given<D>) -> Result<Option<Self>, Refusal>;

    /// A rotation about a centre.
    fn turn(angle: f64, center: [f64; D], axis: Option<&Direction>) -> Result<Motion<D>, ShapeError>;

    /// Puts a structured grid into a `Box`.
    fn boxed_lines(grid: Structured<D>) -> Box<dyn Grid<D>>;

    /// Puts a mesh into a `Box`.
    fn boxed_mesh(mesh: Mesh<D>) -> Box<dyn Grid<D>>;
}

/// Builds the region of a shape; `place` is its JSON pointer in the deck.
///
/// # Errors
/// The first fault.
pub(super) fn region<const D: usize>(
    shape: &Shape,
    place: &str,
    given: &mut dyn Given<D>,
) -> Result<Region<D>, Refusal>
where
    Region<D>: DeckRegion<D>,
{
    let refuse = |error| Refusal::Numbers(place.to_owned(), error);
    let mut parts = Vec::new();
    for (key, part) in shape.parts() {
        parts.push(region(part, &format!("{place}/{key}"), given)?);
    }
    match shape {
        Shape::Box { min, max } => Ok(Brick::new(vector(min)?, vector(max)?).map_err(refuse)?.into()),
        Shape::Cells { group } => {
            let cells = given.cells(place, group.as_ref());
            cells.map(Region::group).ok_or(Refusal::Unknown)
        }
        Shape::Mesh { file, group } => {
            given.mesh(place, file, group.as_ref()).map(Region::new).ok_or(Refusal::Unknown)
        }
        Shape::Union { .. } => Region::union(parts).map_err(refuse),
        Shape::Intersection { .. } => Region::intersection(parts).map_err(refuse),
        Shape::Difference { .. } => {
            let mut parts = parts.into_iter();
            let from = parts.next().ok_or(Refusal::Unknown)?;
            Ok(Region::difference(from, parts.collect()))
        }
        Shape::Translate { by, .. } => moved(parts, &Motion::translation(vector(by)?).map_err(refuse)?),
        Shape::Rotate { angle, center, axis, .. } => {
            let turn = Region::turn(angle.to_radians(), vector(center)?, axis.as_ref());
            moved(parts, &turn.map_err(refuse)?)
        }
        _ => Region::own(shape, place, given)?.ok_or(Refusal::Unknown),
    }
}

fn moved<const D: usize>(mut parts: Vec<Region<D>>, motion: &Motion<D>) -> Result<Region<D>, Refusal> {
    parts.pop().map(|part| part.moved(motion)).ok_or(Refusal::Unknown)
}

/// A list of the right length; any other length is reported elsewhere.
fn vector<const D: usize>(values: &[f64]) -> Result<[f64; D], Refusal> {
    values.try_into().map_err(|_| Refusal::Unknown)
}

fn polygon(corners: &[Vec<f64>], place: &str) -> Result<Polygon, Refusal> {
    let corners = corners.iter().map(|x| vector(x)).collect::<Result<_, _>>()?;
    Polygon::new(corners).map_err(|error| Refusal::Numbers(place.to_owned(), error))
}

impl DeckRegion<2> for Region<2> {
    fn own(shape: &Shape, place: &str, _: &mut dyn Given<2>) -> Result<Option<Self>, Refusal> {
        let refuse = |error| Refusal::Numbers(place.to_owned(), error);
        Ok(Some(match shape {
            Shape::Polygon { vertices } => polygon(vertices, place)?.into(),
            Shape::Circle { center, radius } => Ball::new(vector(center)?, *radius).map_err(refuse)?.into(),
            Shape::Annulus { center, inner, outer } => {
                HollowBall::new(vector(center)?, *inner, *outer).map_err(refuse)?.into()
            }
            _ => return Ok(None),
        }))
    }

    fn turn(angle: f64, center: [f64; 2], _: Option<&Direction>) -> Result<Motion<2>, ShapeError> {
        Motion::<2>::rotation(angle, center)
    }

    fn boxed_lines(grid: Structured<2>) -> Box<dyn Grid<2>> {
        grid.into()
    }

    fn boxed_mesh(mesh: Mesh<2>) -> Box<dyn Grid<2>> {
        mesh.into()
    }
}

impl DeckRegion<3> for Region<3> {
    fn own(shape: &Shape, place: &str, given: &mut dyn Given<3>) -> Result<Option<Self>, Refusal> {
        let refuse = |error| Refusal::Numbers(place.to_owned(), error);
        Ok(Some(match shape {
            Shape::Cylinder { start, end, radius } => {
                Frustum::cylinder(vector(start)?, vector(end)?, *radius).map_err(refuse)?.into()
            }
            Shape::Cone { start, end, radii } => {
                Frustum::new(vector(start)?, vector(end)?, vector(radii)?).map_err(refuse)?.into()
            }
            Shape::Sphere { center, radius } => Ball::new(vector(center)?, *radius).map_err(refuse)?.into(),
            Shape::Extrusion { polygon: corners, axis, from, to } => {
                let base = polygon(corners, place)?;
                Prism::new(base, *axis as usize, [*from, *to]).map_err(refuse)?.into()
            }
            Shape::Stl { file, scale, rotate, at } => {
                let placed = placed(*scale, rotate.as_deref(), at.as_deref()).map_err(refuse)?;
                given.surface(place, file, &placed).ok_or(Refusal::Unknown)?.into()
            }
            _ => return Ok(None),
        }))
    }

    fn turn(angle: f64, center: [f64; 3], axis: Option<&Direction>) -> Result<Motion<3>, ShapeError> {
        let direction = match axis {
            Some(Direction::Along(axis)) => std::array::from_fn(|d| f64::from(u8::from(d == *axis as usize))),
            Some(Direction::Vector(vector)) => std::array::from_fn(|d| vector.get(d).copied().unwrap_or(0.0)),
            None => [0.0; 3],
        };
        Motion::<3>::rotation(direction, angle, center)
    }

    fn boxed_lines(grid: Structured<3>) -> Box<dyn Grid<3>> {
        grid.into()
    }

    fn boxed_mesh(mesh: Mesh<3>) -> Box<dyn Grid<3>> {
        mesh.into()
    }
}

/// Sources known without any file: a structured grid, which is a box.
pub(super) struct WithoutFiles<const D: usize> {
    /// Lowest and highest corner of a structured grid, [length].
    pub(super) grid: Option<[[f64; D]; 2]>,
}

impl<const D: usize> Given<D> for WithoutFiles<D> {
    fn cells(&mut self, _: &str, group: Option<&GroupDeck>) -> Option<Group<D>> {
        let bounds = self.grid.filter(|_| group.is_none())?;
        let volume = (0..D).map(|d| bounds[1][d] - bounds[0][d]).product();
        Some(Group { key: 0, bounds, volume })
    }

    fn surface(&mut self, _: &str, _: &str, _: &Motion<3>) -> Option<Surface> {
        None
    }

    fn mesh(&mut self, _: &str, _: &str, _: Option<&GroupDeck>) -> Option<Meshed<D>> {
        None
    }
}
