//! Regions of the plane and of space that define bodies: pure geometry, independent of decks and, except for
//! `fill.rs`, of grids.
//!
//! A [`Region`] is a primitive, a group of mesh cells, or a union, difference or intersection of regions. Every region
//! can be moved by a [`Motion`]. A [`Primitive`] has five required methods: containment of a position, extent along a
//! direction, volume, intersection with a line, and the facets of its boundary. Everything else is derived from them:
//! bounds of moved regions, boolean operations on lines, the boundary of a region (`boundary.rs`), and volumes of
//! unions, intersections and differences by quadrature over lines (`volume.rs`).

mod ball;
mod boundary;
mod box_tree;
mod brick;
mod cells;
mod curve;
mod face;
mod fill;
mod frustum;
mod level;
mod line;
mod meshed;
mod motion;
mod outline;
mod parts;
mod polygon;
mod prism;
pub mod quadrature;
pub mod stl;
pub mod surface;
pub(crate) mod vector;
mod volume;

use std::fmt::Debug;
use std::sync::Arc;

use crate::grid::Grid;

pub use ball::{Ball, HollowBall};
pub use boundary::{Facet, MAX_FACETS, NoBoundary, area_derivative, area_vector, divided};
pub(crate) use boundary::{chords, indexed, parts, quadrilaterals};
pub(crate) use box_tree::{BoxTree, around, overlap as boxes_overlap, squared_distance};
pub use brick::Brick;
pub use cells::boundary_of_cells;
pub use curve::Curve;
pub use face::{Face, Levels};
pub use fill::{CellPart, Filled, FilledCell, brick_parts, contains_in_cell, fill};
pub use frustum::Frustum;
pub(crate) use frustum::around_axis;
pub use level::Level;
pub(crate) use level::distance as facet_distance;
pub(crate) use line::between;
pub use line::{Intervals, Line};
pub use meshed::Meshed;
pub use motion::Motion;
pub use outline::Outline;
pub(crate) use parts::Parts;
pub use polygon::{Polygon, crossing_sides};
pub(crate) use polygon::{segments_meet, signed_area};
pub use prism::Prism;
pub use surface::Surface;
pub use volume::{Accuracy, Volume};

/// Axis-aligned box given by its lowest and highest corner, [length]. Empty if low > high on an axis.
pub type Bounds<const D: usize> = [[f64; D]; 2];

/// Predicate: true if the group of cells with this key contains a position. The position is given in the frame of the
/// group, before its motion.
pub type InGroup<'a, const D: usize> = &'a dyn Fn(usize, &[f64; D]) -> bool;

/// Invalid parameters of a region.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// A coordinate, radius or angle is infinite or NaN.
    #[error("{what} is not finite")]
    NotFinite {
        /// The quantity.
        what: &'static str,
    },
    /// A length, area or factor is not positive.
    #[error("{what} must be positive, not {value}")]
    NotPositive {
        /// The quantity.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A polygon has fewer than three corners.
    #[error("a polygon needs at least 3 corners, not {corners}")]
    Corners {
        /// Number of corners of the polygon.
        corners: usize,
    },
    /// A polygon crosses or touches itself.
    #[error("the side from corner {} meets the side from corner {}", .sides[0] + 1, .sides[1] + 1)]
    SelfCrossing {
        /// Indices of the first corners of the two sides that meet, from 0.
        sides: [usize; 2],
    },
    /// The axis index is out of range.
    #[error("there is no axis {axis}")]
    NoAxis {
        /// Index of the axis, from 0.
        axis: usize,
    },
    /// A union or intersection has no parts.
    #[error("it has no parts")]
    NoParts,
}

/// A primitive shape. Whether its boundary counts as inside depends on the shape.
pub trait Primitive<const D: usize>: Debug + Send + Sync {
    /// True if a position lies inside.
    fn contains(&self, x: &[f64; D]) -> bool;

    /// Minimum and maximum of x · `direction` over the shape.
    fn extent(&self, direction: &[f64; D]) -> [f64; 2];

    /// Volume (area), [volume].
    fn volume(&self) -> f64;

    /// The intervals of a line that lie inside.
    fn intervals(&self, line: &Line<D>) -> Intervals;

    /// The boundary as facets of either orientation, with edges no longer than about `spacing`, [length].
    fn facets(&self, spacing: f64) -> Vec<Facet<D>>;

    /// The closed curves of the boundary in the plane; empty in space. A position is inside if a ray from it crosses
    /// them an odd number of times.
    fn curves(&self) -> Vec<Curve> {
        Vec::new()
    }

    /// The surfaces on which the sides of a shape in space lie.
    fn levels(&self) -> Levels {
        Levels::Unknown
    }

    /// The mesh and those of its cells of which the shape consists; `None` for other shapes.
    fn cells(&self) -> Option<(&dyn Grid<D>, &[u32])> {
        None
    }

    /// True if the shape is convex.
    fn is_convex(&self) -> bool {
        false
    }

    /// Corners of the boundary, where integrals over slices have kinks; empty if there are too many to be useful.
    fn corners(&self) -> Vec<[f64; D]> {
        Vec::new()
    }
}

/// A group of mesh cells. The caller decides which positions it contains, see [`InGroup`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Group<const D: usize> {
    /// Key passed to [`InGroup`].
    pub key: usize,
    /// Bounds of the cells, [length].
    pub bounds: Bounds<D>,
    /// Volume of the cells, [volume].
    pub volume: f64,
}

/// A region in `D` dimensions.
#[derive(Debug, Clone)]
pub struct Region<const D: usize> {
    node: Node<D>,
    bounds: Bounds<D>,
}

#[derive(Debug, Clone)]
enum Node<const D: usize> {
    Primitive(Arc<dyn Primitive<D>>, Motion<D>),
    Group(Group<D>, Motion<D>),
    Union(Parts<D>),
    Intersection(Parts<D>),
    Difference(Box<Region<D>>, Parts<D>),
}

impl<const D: usize> Region<D> {
    /// The region that a primitive fills.
    pub fn new(primitive: impl Primitive<D> + 'static) -> Self {
        Self::placed(Arc::new(primitive), Motion::identity())
    }

    /// The region that a group of mesh cells fills.
    pub fn group(group: Group<D>) -> Self {
        Self::placed_group(group, Motion::identity())
    }

    /// The group of mesh cells of which the region consists, and its motion; `None` for other regions.
    pub fn as_group(&self) -> Option<(&Group<D>, &Motion<D>)> {
        match &self.node {
            Node::Group(group, motion) => Some((group, motion)),
            _ => None,
        }
    }

    /// The mesh of which the region consists, its cells in the region, and their motion; `None` for other regions.
    pub fn as_mesh(&self) -> Option<(&dyn Grid<D>, &[u32], &Motion<D>)> {
        match &self.node {
            Node::Primitive(primitive, motion) => {
                primitive.cells().map(|(mesh, cells)| (mesh, cells, motion))
            }
            _ => None,
        }
    }

    /// Union of the parts.
    ///
    /// # Errors
    /// [`ShapeError::NoParts`].
    pub fn union(parts: Vec<Region<D>>) -> Result<Self, ShapeError> {
        let bounds = parts.iter().map(|part| part.bounds).reduce(hull).ok_or(ShapeError::NoParts)?;
        Ok(Region { node: Node::Union(Parts::new(parts)), bounds })
    }

    /// Intersection of the parts.
    ///
    /// # Errors
    /// [`ShapeError::NoParts`].
    pub fn intersection(parts: Vec<Region<D>>) -> Result<Self, ShapeError> {
        let bounds = parts.iter().map(|part| part.bounds).reduce(overlap).ok_or(ShapeError::NoParts)?;
        Ok(Region { node: Node::Intersection(Parts::new(parts)), bounds })
    }

    /// Difference: the part of the region `from` that lies in none of the regions `minus`.
    pub fn difference(from: Region<D>, minus: Vec<Region<D>>) -> Self {
        let bounds = from.bounds;
        Region { node: Node::Difference(Box::new(from), Parts::new(minus)), bounds }
    }

    /// The region moved by a motion.
    pub fn moved(self, motion: &Motion<D>) -> Self {
        let all =
            |parts: Vec<Region<D>>| parts.into_iter().map(|part| part.moved(motion)).collect::<Vec<_>>();
        match self.node {
            Node::Primitive(primitive, before) => Self::placed(primitive, before.then(motion)),
            Node::Group(group, before) => Self::placed_group(group, before.then(motion)),
            // Apply the motion to the primitives: bounds of primitives are tight, but bounds of differences and
            // intersections are not.
            Node::Union(parts) => {
                let parts = all(parts.into_regions());
                let bounds = parts.iter().map(|part| part.bounds).fold(nothing(), hull);
                Region { node: Node::Union(Parts::new(parts)), bounds }
            }
            Node::Intersection(parts) => {
                let parts = all(parts.into_regions());
                let bounds = parts.iter().map(|part| part.bounds).fold(everything(), overlap);
                Region { node: Node::Intersection(Parts::new(parts)), bounds }
            }
            Node::Difference(from, minus) => Self::difference(from.moved(motion), all(minus.into_regions())),
        }
    }

    fn placed(primitive: Arc<dyn Primitive<D>>, motion: Motion<D>) -> Self {
        let bounds = bounds_of(&*primitive, &motion);
        Region { node: Node::Primitive(primitive, motion), bounds }
    }

    fn placed_group(group: Group<D>, motion: Motion<D>) -> Self {
        let bounds = match Brick::new(group.bounds[0], group.bounds[1]) {
            Ok(brick) => bounds_of(&brick, &motion),
            Err(_) => nothing(),
        };
        Region { node: Node::Group(group, motion), bounds }
    }

    /// True if a position lies inside; groups of cells count as empty.
    pub fn contains(&self, x: &[f64; D]) -> bool {
        self.contains_with(x, &|_, _| false)
    }

    /// True if a position lies inside; `in_group` decides for groups of cells.
    pub fn contains_with(&self, x: &[f64; D], in_group: InGroup<'_, D>) -> bool {
        match &self.node {
            Node::Primitive(primitive, motion) => primitive.contains(&motion.undo(x)),
            Node::Group(group, motion) => in_group(group.key, &motion.undo(x)),
            Node::Union(parts) => parts.any_near(&[*x; 2], |part| part.contains_with(x, in_group)),
            Node::Intersection(parts) => parts.iter().all(|part| part.contains_with(x, in_group)),
            Node::Difference(from, minus) => {
                from.contains_with(x, in_group)
                    && !minus.any_near(&[*x; 2], |part| part.contains_with(x, in_group))
            }
        }
    }

    /// Bounding box of the region, [length]; tight for primitives and their unions.
    pub fn bounds(&self) -> Bounds<D> {
        self.bounds
    }

    /// False if the region certainly does not overlap a box.
    pub fn may_meet(&self, cell: &Bounds<D>) -> bool {
        self.may_meet_cell(cell, &|_| true)
    }

    /// As [`Region::may_meet`] for a grid cell with these bounds; `in_group` is true for the groups of the cell.
    pub fn may_meet_cell(&self, cell: &Bounds<D>, in_group: &dyn Fn(usize) -> bool) -> bool {
        let near = (0..D).all(|d| cell[0][d] <= self.bounds[1][d] && self.bounds[0][d] <= cell[1][d]);
        near && match &self.node {
            Node::Primitive(..) => true,
            // A moved group no longer coincides with the cells of the grid.
            Node::Group(group, motion) => *motion != Motion::identity() || in_group(group.key),
            Node::Union(parts) => parts.any_near(cell, |part| part.may_meet_cell(cell, in_group)),
            Node::Intersection(parts) => parts.iter().all(|part| part.may_meet_cell(cell, in_group)),
            Node::Difference(from, _) => from.may_meet_cell(cell, in_group),
        }
    }

    /// True if a box certainly lies inside.
    pub fn covers(&self, cell: &Bounds<D>) -> bool {
        match &self.node {
            Node::Primitive(primitive, motion) => {
                primitive.is_convex() && corners(cell).all(|x| primitive.contains(&motion.undo(&x)))
            }
            Node::Group(..) => false,
            Node::Union(parts) => parts.any_near(cell, |part| part.covers(cell)),
            Node::Intersection(parts) => parts.iter().all(|part| part.covers(cell)),
            Node::Difference(from, minus) => {
                from.covers(cell) && !minus.any_near(cell, |part| part.may_meet(cell))
            }
        }
    }

    /// The intervals of a line that lie inside; `None` if the region contains groups of cells.
    pub fn intervals(&self, line: &Line<D>) -> Option<Intervals> {
        let fold = |parts: &[Region<D>], join: fn(&Intervals, &Intervals) -> Intervals| {
            let mut all: Option<Intervals> = None;
            for part in parts {
                let next = part.intervals(line)?;
                all = Some(match all {
                    None => next,
                    Some(before) => join(&before, &next),
                });
            }
            Some(all.unwrap_or_default())
        };
        match &self.node {
            Node::Primitive(primitive, motion) => Some(primitive.intervals(&motion.undo_line(line))),
            Node::Group(..) => None,
            Node::Union(parts) => fold(parts, Intervals::union),
            Node::Intersection(parts) => fold(parts, Intervals::intersection),
            Node::Difference(from, minus) => {
                let from = from.intervals(line)?;
                Some(from.minus(&fold(minus, Intervals::union)?))
            }
        }
    }

    /// Visits every primitive with its motion.
    fn each_primitive(&self, visit: &mut dyn FnMut(&dyn Primitive<D>, &Motion<D>)) {
        match &self.node {
            Node::Primitive(primitive, motion) => visit(&**primitive, motion),
            Node::Group(..) => {}
            Node::Union(parts) | Node::Intersection(parts) => {
                parts.iter().for_each(|part| part.each_primitive(visit));
            }
            Node::Difference(from, minus) => {
                from.each_primitive(visit);
                minus.iter().for_each(|part| part.each_primitive(visit));
            }
        }
    }
}

impl<const D: usize, P: Primitive<D> + 'static> From<P> for Region<D> {
    fn from(primitive: P) -> Self {
        Region::new(primitive)
    }
}

/// Bounds of a moved primitive.
fn bounds_of<const D: usize>(primitive: &dyn Primitive<D>, motion: &Motion<D>) -> Bounds<D> {
    let mut bounds = nothing();
    for d in 0..D {
        [bounds[0][d], bounds[1][d]] = extent_of(primitive, motion, d);
    }
    bounds
}

/// Lowest and highest coordinate of a moved primitive along an axis.
fn extent_of<const D: usize>(primitive: &dyn Primitive<D>, motion: &Motion<D>, axis: usize) -> [f64; 2] {
    let (direction, shift) = motion.undo_coordinate(axis);
    primitive.extent(&direction).map(|x| x + shift)
}

fn nothing<const D: usize>() -> Bounds<D> {
    [[f64::INFINITY; D], [f64::NEG_INFINITY; D]]
}

fn everything<const D: usize>() -> Bounds<D> {
    [[f64::NEG_INFINITY; D], [f64::INFINITY; D]]
}

fn is_empty<const D: usize>(bounds: &Bounds<D>) -> bool {
    !(0..D).all(|d| bounds[0][d] < bounds[1][d])
}

pub(crate) fn hull<const D: usize>(a: Bounds<D>, b: Bounds<D>) -> Bounds<D> {
    std::array::from_fn(|side| {
        let outer = if side == 0 { f64::min } else { f64::max };
        std::array::from_fn(|d| outer(a[side][d], b[side][d]))
    })
}

fn overlap<const D: usize>(a: Bounds<D>, b: Bounds<D>) -> Bounds<D> {
    let both: Bounds<D> = std::array::from_fn(|side| {
        let inner = if side == 0 { f64::max } else { f64::min };
        std::array::from_fn(|d| inner(a[side][d], b[side][d]))
    });
    if is_empty(&both) { nothing() } else { both }
}

/// The 2^D corners of a box; the first axis varies fastest.
pub(crate) fn corners<const D: usize>(bounds: &Bounds<D>) -> impl Iterator<Item = [f64; D]> {
    let bounds = *bounds;
    (0..1usize << D).map(move |corner| std::array::from_fn(|d| bounds[corner >> d & 1][d]))
}

/// The numbers, if all are finite.
pub(crate) fn finite<const N: usize>(what: &'static str, numbers: [f64; N]) -> Result<[f64; N], ShapeError> {
    if numbers.iter().all(|x| x.is_finite()) { Ok(numbers) } else { Err(ShapeError::NotFinite { what }) }
}

/// The value, if it is finite and positive.
pub(crate) fn positive(what: &'static str, value: f64) -> Result<f64, ShapeError> {
    match finite(what, [value])? {
        [x] if x > 0.0 => Ok(x),
        [value] => Err(ShapeError::NotPositive { what, value }),
    }
}

#[cfg(test)]
pub(crate) mod tests;
