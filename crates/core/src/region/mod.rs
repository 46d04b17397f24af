//! Regions of the plane and of space that bodies fill: pure geometry, without decks and grids.
//!
//! A [`Region`] is a primitive, a group of mesh cells, or a union, difference or intersection of regions; any of them
//! can be moved by a [`Motion`]. A [`Primitive`] answers four questions: what lies inside, how far it extends along a
//! direction, how large it is, and which parts of a line it cuts out. All else follows: bounds of moved regions,
//! booleans of the parts of lines, and volumes of booleans by quadrature over lines (`volume.rs`).

mod ball;
mod brick;
mod fill;
mod frustum;
mod line;
mod motion;
mod polygon;
mod prism;
pub mod quadrature;
pub mod stl;
pub mod surface;
mod vector;
mod volume;

use std::fmt::Debug;
use std::sync::Arc;

pub use ball::{Ball, HollowBall};
pub use brick::Brick;
pub use fill::{Filled, FilledCell, Part, brick_parts, contains_in_cell, fill};
pub use frustum::Frustum;
pub use line::{Intervals, Line};
pub use motion::Motion;
pub use polygon::{Polygon, crossing_sides};
pub use prism::Prism;
pub use surface::Surface;
pub use volume::{Accuracy, Volume};

/// A box with sides along the axes, as lowest and highest corner, [length]. Empty when a lowest coordinate is above
/// the highest.
pub type Bounds<const D: usize> = [[f64; D]; 2];

/// Whether the group of cells with this number holds a position, which is given in the frame of the group: under a
/// motion it is not the position that was asked for.
pub type InGroup<'a, const D: usize> = &'a dyn Fn(usize, &[f64; D]) -> bool;

/// Why numbers do not describe a region.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ShapeError {
    /// A coordinate, a radius or an angle is infinite or not a number.
    #[error("{what} is not finite")]
    NotFinite {
        /// The quantity.
        what: &'static str,
    },
    /// A length must be positive.
    #[error("{what} must be positive, not {value}")]
    NotPositive {
        /// The quantity.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A polygon with less than three corners.
    #[error("a polygon needs at least 3 corners, not {corners}")]
    Corners {
        /// Number of its corners.
        corners: usize,
    },
    /// A polygon crosses or touches itself.
    #[error("the side from corner {} meets the one from corner {}", .sides[0] + 1, .sides[1] + 1)]
    SelfCrossing {
        /// The first corners of two sides, from 0.
        sides: [usize; 2],
    },
    /// An axis other than the three.
    #[error("there is no axis {axis}")]
    NoAxis {
        /// Number of the axis, from 0.
        axis: usize,
    },
    /// A union or intersection of nothing.
    #[error("it has no parts")]
    NoParts,
}

/// A region of simple shape. Its border counts as inside, up to round-off.
pub trait Primitive<const D: usize>: Debug + Send + Sync {
    /// Whether a position lies inside.
    fn contains(&self, x: &[f64; D]) -> bool;

    /// Least and greatest x · `direction` of its positions.
    fn extent(&self, direction: &[f64; D]) -> [f64; 2];

    /// Volume (area), [volume].
    fn volume(&self) -> f64;

    /// The parts of a line that lie inside.
    fn intervals(&self, line: &Line<D>) -> Intervals;

    /// Whether the straight line between two of its positions is always inside.
    fn is_convex(&self) -> bool {
        false
    }

    /// Corners of the border, where integrals over slices have kinks; none where there are too many to be of use.
    fn corners(&self) -> Vec<[f64; D]> {
        Vec::new()
    }
}

/// A group of mesh cells; who uses the region decides which positions it holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Group<const D: usize> {
    /// Number by which [`InGroup`] is asked.
    pub key: usize,
    /// Lowest and highest coordinates of the cells, [length].
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
    Union(Vec<Region<D>>),
    Intersection(Vec<Region<D>>),
    Difference(Box<Region<D>>, Vec<Region<D>>),
}

impl<const D: usize> Region<D> {
    /// A primitive.
    pub fn new(primitive: impl Primitive<D> + 'static) -> Self {
        Self::placed(Arc::new(primitive), Motion::identity())
    }

    /// A group of mesh cells.
    pub fn group(group: Group<D>) -> Self {
        Self::placed_group(group, Motion::identity())
    }

    /// What lies in any of the parts.
    ///
    /// # Errors
    /// [`ShapeError::NoParts`].
    pub fn union(parts: Vec<Region<D>>) -> Result<Self, ShapeError> {
        let bounds = parts.iter().map(|part| part.bounds).reduce(hull).ok_or(ShapeError::NoParts)?;
        Ok(Region { node: Node::Union(parts), bounds })
    }

    /// What lies in all of the parts.
    ///
    /// # Errors
    /// [`ShapeError::NoParts`].
    pub fn intersection(parts: Vec<Region<D>>) -> Result<Self, ShapeError> {
        let bounds = parts.iter().map(|part| part.bounds).reduce(overlap).ok_or(ShapeError::NoParts)?;
        Ok(Region { node: Node::Intersection(parts), bounds })
    }

    /// What lies in a region and in none of others.
    pub fn difference(from: Region<D>, minus: Vec<Region<D>>) -> Self {
        let bounds = from.bounds;
        Region { node: Node::Difference(Box::new(from), minus), bounds }
    }

    /// The region after a motion.
    pub fn moved(self, motion: &Motion<D>) -> Self {
        let all =
            |parts: Vec<Region<D>>| parts.into_iter().map(|part| part.moved(motion)).collect::<Vec<_>>();
        match self.node {
            Node::Primitive(primitive, before) => Self::placed(primitive, before.then(motion)),
            Node::Group(group, before) => Self::placed_group(group, before.then(motion)),
            // The motion goes down to the primitives because their bounds are tight and those of booleans are not.
            Node::Union(parts) => {
                let parts = all(parts);
                let bounds = parts.iter().map(|part| part.bounds).fold(nothing(), hull);
                Region { node: Node::Union(parts), bounds }
            }
            Node::Intersection(parts) => {
                let parts = all(parts);
                let bounds = parts.iter().map(|part| part.bounds).fold(everything(), overlap);
                Region { node: Node::Intersection(parts), bounds }
            }
            Node::Difference(from, minus) => Self::difference(from.moved(motion), all(minus)),
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

    /// Whether a position lies inside; groups of cells hold none.
    pub fn contains(&self, x: &[f64; D]) -> bool {
        self.contains_with(x, &|_, _| false)
    }

    /// Whether a position lies inside; `in_group` decides about groups of cells.
    pub fn contains_with(&self, x: &[f64; D], in_group: InGroup<'_, D>) -> bool {
        match &self.node {
            Node::Primitive(primitive, motion) => primitive.contains(&motion.undo(x)),
            Node::Group(group, motion) => in_group(group.key, &motion.undo(x)),
            Node::Union(parts) => parts.iter().any(|part| part.contains_with(x, in_group)),
            Node::Intersection(parts) => parts.iter().all(|part| part.contains_with(x, in_group)),
            Node::Difference(from, minus) => {
                from.contains_with(x, in_group) && !minus.iter().any(|part| part.contains_with(x, in_group))
            }
        }
    }

    /// A box that holds the region, [length]; the least one for primitives and their unions.
    pub fn bounds(&self) -> Bounds<D> {
        self.bounds
    }

    /// Whether the region may have a position in common with a box; `false` is certain.
    pub fn may_meet(&self, cell: &Bounds<D>) -> bool {
        self.may_meet_cell(cell, &|_| true)
    }

    /// As [`Region::may_meet`] for a cell of a grid in this box, of which `in_group` tells to which groups it belongs.
    pub fn may_meet_cell(&self, cell: &Bounds<D>, in_group: &dyn Fn(usize) -> bool) -> bool {
        let near = (0..D).all(|d| cell[0][d] <= self.bounds[1][d] && self.bounds[0][d] <= cell[1][d]);
        near && match &self.node {
            Node::Primitive(..) => true,
            // Where a group is moved to, its cells are not those of the grid.
            Node::Group(group, motion) => *motion != Motion::identity() || in_group(group.key),
            Node::Union(parts) => parts.iter().any(|part| part.may_meet_cell(cell, in_group)),
            Node::Intersection(parts) => parts.iter().all(|part| part.may_meet_cell(cell, in_group)),
            Node::Difference(from, _) => from.may_meet_cell(cell, in_group),
        }
    }

    /// Whether a box lies inside; `true` is certain.
    pub fn covers(&self, cell: &Bounds<D>) -> bool {
        match &self.node {
            Node::Primitive(primitive, motion) => {
                primitive.is_convex() && corners(cell).all(|x| primitive.contains(&motion.undo(&x)))
            }
            Node::Group(..) => false,
            Node::Union(parts) => parts.iter().any(|part| part.covers(cell)),
            Node::Intersection(parts) => parts.iter().all(|part| part.covers(cell)),
            Node::Difference(from, minus) => {
                from.covers(cell) && !minus.iter().any(|part| part.may_meet(cell))
            }
        }
    }

    /// The parts of a line that lie inside; `None` where groups of cells take part.
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

    /// Calls `visit` with every primitive and its motion.
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

/// Bounds of a primitive after a motion.
fn bounds_of<const D: usize>(primitive: &dyn Primitive<D>, motion: &Motion<D>) -> Bounds<D> {
    let mut bounds = nothing();
    for d in 0..D {
        [bounds[0][d], bounds[1][d]] = extent_of(primitive, motion, d);
    }
    bounds
}

/// Least and greatest coordinate of a primitive after a motion.
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

fn hull<const D: usize>(a: Bounds<D>, b: Bounds<D>) -> Bounds<D> {
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

/// The 2^D corners of a box, first axis fastest.
fn corners<const D: usize>(bounds: &Bounds<D>) -> impl Iterator<Item = [f64; D]> {
    let bounds = *bounds;
    (0..1usize << D).map(move |corner| std::array::from_fn(|d| bounds[corner >> d & 1][d]))
}

/// The numbers, if all of them are finite.
fn finite<const N: usize>(what: &'static str, numbers: [f64; N]) -> Result<[f64; N], ShapeError> {
    if numbers.iter().all(|x| x.is_finite()) { Ok(numbers) } else { Err(ShapeError::NotFinite { what }) }
}

/// The length, if it is finite and above zero.
fn positive(what: &'static str, value: f64) -> Result<f64, ShapeError> {
    match finite(what, [value])? {
        [x] if x > 0.0 => Ok(x),
        [value] => Err(ShapeError::NotPositive { what, value }),
    }
}

#[cfg(test)]
mod tests;
