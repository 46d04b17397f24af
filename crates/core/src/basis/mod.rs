//! Basis functions of the material point methods: the grid nodes that a point touches, with values and gradients
//! (section 6.1).

mod bodies;
mod connectivity;
mod cpdi;
mod factors;
mod gimp;
mod mpm;
mod node_copies;
mod parts;
mod slivers;

use serde::{Deserialize, Serialize};

use crate::grid::{Grid, for_each_corner};
use crate::points::{Points, coordinates};

use factors::Factors;

pub use crate::points::BodyGroup;
pub(crate) use bodies::MIN_SHARE;
pub use bodies::TouchedBy;
pub use connectivity::{Connectivity, LinkBuffer, Links, SupportFailure};
pub use cpdi::{CORNER_MARGIN, Cpdi, check_domain, domain_volume, nearest_with_distance};
pub use gimp::Gimp;
pub use mpm::Mpm;
pub use node_copies::NodeCopies;
pub use parts::JoinedParts;

/// Material point method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The standard material point method: points without extent.
    Mpm,
    /// The generalised interpolation material point method: points with a rectangular domain.
    Gimp,
    /// Convected particle domain interpolation with parallelograms (parallelepipeds), which follow the deformation
    /// gradient of the point.
    Cpdi1,
    /// Second-order convected particle domain interpolation: the corners of the domain move with the grid.
    #[default]
    Cpdi2,
}

/// Kind of domain of the points of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DomainKind {
    /// No domain.
    None,
    /// A box aligned with the axes, given by its half lengths.
    Box,
    /// A quadrilateral or triangle (hexahedron or tetrahedron), given by its corners.
    Corners,
}

impl Method {
    /// The basis of the method in `D` dimensions.
    pub fn basis<const D: usize>(self) -> &'static dyn Basis<D> {
        match self {
            Method::Mpm => &Mpm,
            Method::Gimp => &Gimp,
            Method::Cpdi1 | Method::Cpdi2 => &Cpdi,
        }
    }

    /// Name of the method in decks.
    pub fn name(self) -> &'static str {
        match self {
            Method::Mpm => "mpm",
            Method::Gimp => "gimp",
            Method::Cpdi1 => "cpdi1",
            Method::Cpdi2 => "cpdi2",
        }
    }

    /// True if the points of the method have basis functions at the centres of cells, which F-bar needs.
    pub fn has_centres(self) -> bool {
        matches!(self, Method::Mpm | Method::Gimp)
    }

    /// Kind of domain of the points of the method.
    pub fn domain(self) -> DomainKind {
        match self {
            Method::Mpm => DomainKind::None,
            Method::Gimp => DomainKind::Box,
            Method::Cpdi1 | Method::Cpdi2 => DomainKind::Corners,
        }
    }
}

/// Position and domain of a point at the start of a load step.
#[derive(Debug, Clone, Copy)]
pub struct PointGeometry<'a, const D: usize> {
    /// The cell that contains the point.
    pub cell: u32,
    /// Position, [length].
    pub position: &'a [f64; D],
    /// Half lengths of a box domain, [length].
    pub half_lengths: &'a [f64; D],
    /// Corners of a domain of kind [`DomainKind::Corners`], [length]: 2^`D` corners, where bit d of a corner's number
    /// gives its side along parametric axis d, or the `D` + 1 corners of a triangle or tetrahedron.
    pub corners: &'a [[f64; D]],
}

impl<'a, const D: usize> PointGeometry<'a, D> {
    /// The geometry of a point in its converged state.
    #[inline(always)]
    pub fn converged(points: &'a Points<D>, p: usize) -> Self {
        PointGeometry {
            cell: points.cell[p],
            position: &points.converged.position[p],
            half_lengths: points.converged.half_lengths.get(p).unwrap_or(&[0.0; D]),
            corners: points.corners(p),
        }
    }
}

/// Grid nodes and cells that a point touches, with basis function values and gradients.
#[derive(Debug, Clone, Default)]
pub struct Support<const D: usize> {
    /// Grid nodes, ascending.
    pub nodes: Vec<u32>,
    /// S_vp, [-].
    pub value: Vec<f64>,
    /// ∂S_vp/∂X̃ in the configuration at the start of the step, [1/length].
    pub gradient: Vec<[f64; D]>,
    /// Cells that the point or its domain touches, unsorted, possibly with duplicates.
    pub cells: Vec<u32>,
    /// Factors of the values and gradients, if they are products.
    factors: Option<Factors<D>>,
}

impl<const D: usize> Support<D> {
    /// Removes the data of the previous point.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.value.clear();
        self.gradient.clear();
        self.cells.clear();
        self.factors = None;
    }

    /// Replaces the nodes by the corners of a box cell, whose node numbers `node` gives in ascending order;
    /// `per_length` is 1/h along each axis. Arrays of the right length are overwritten without being cleared.
    #[inline(always)]
    fn set_corners(&mut self, local: [f64; D], per_length: &[f64; D], node: impl Fn(usize) -> u32) {
        let n = 1 << D;
        self.nodes.resize(n, 0);
        self.value.resize(n, 0.0);
        self.gradient.resize(n, [0.0; D]);
        // Because the number of corners is known, indices need no bounds checks.
        let (nodes, values, gradients) =
            (&mut self.nodes[..n], &mut self.value[..n], &mut self.gradient[..n]);
        for_each_corner(local, per_length, |corner, value, gradient| {
            (nodes[corner], values[corner], gradients[corner]) = (node(corner), value, gradient);
        });
    }

    /// Adds to the value and gradient at a node.
    pub fn add(&mut self, node: u32, value: f64, gradient: [f64; D]) {
        if self.nodes.last().is_none_or(|last| *last < node) {
            self.nodes.push(node);
            self.value.push(value);
            self.gradient.push(gradient);
            return;
        }
        let index = self.nodes.partition_point(|n| *n < node);
        if self.nodes.get(index) == Some(&node) {
            self.value[index] += value;
            for (sum, g) in self.gradient[index].iter_mut().zip(gradient) {
                *sum += g;
            }
        } else {
            self.nodes.insert(index, node);
            self.value.insert(index, value);
            self.gradient.insert(index, gradient);
        }
    }
}

/// The basis functions of a point cannot be formed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SupportError {
    /// The point lies outside the grid.
    #[error("the point is outside the grid")]
    OffGrid,
    /// A corner of the domain lies outside the grid by more than [`CORNER_MARGIN`].
    #[error("corner {corner} of its domain, at {}, is outside the grid", coordinates(&position[..*dimension]))]
    CornerOffGrid {
        /// Index of the corner.
        corner: usize,
        /// Position of the corner, [length]; entries beyond the dimension are zero.
        position: [f64; 3],
        /// Number of coordinates.
        dimension: usize,
    },
    /// The domain is inverted, crosses itself or has no volume.
    #[error("its domain is inverted or crosses itself")]
    Distorted,
    /// GIMP requires a structured grid.
    #[error("the method needs a structured grid")]
    Unstructured,
    /// F-bar requires a method with basis functions at the centres of cells.
    #[error("the method has no basis at the centres of cells, which F-bar needs")]
    NoCentre,
    /// The basis functions of a point of another rank cannot be formed.
    #[error("a point of another rank cannot be supported")]
    OnRank,
}

/// A material point method: evaluates the basis functions of a point from its position and domain.
pub trait Basis<const D: usize>: Sync {
    /// Writes to `out` the nodes that a point touches, their values and gradients, and the cells it touches.
    ///
    /// # Errors
    /// [`SupportError`] if a corner of the domain lies too far outside the grid, if the domain is distorted, or if the
    /// method needs another kind of grid.
    fn support(
        &self,
        grid: &dyn Grid<D>,
        point: &PointGeometry<D>,
        out: &mut Support<D>,
    ) -> Result<(), SupportError>;

    /// The cells at whose centres F-bar evaluates the volume ratio for a point, each with its share of the point's
    /// domain; the shares sum to 1. Empty if the method has no such centres.
    fn shares(&self, _grid: &dyn Grid<D>, _point: &PointGeometry<D>) -> Vec<(u32, f64)> {
        Vec::new()
    }
}

#[cfg(test)]
mod conformance;
