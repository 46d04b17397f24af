//! Basis functions of the material point methods: which grid nodes a point touches, and how strongly (section 6.1).

mod connectivity;
mod cpdi;
mod factors;
mod gimp;
mod mpm;
mod parts;
mod slivers;

use serde::{Deserialize, Serialize};

use crate::grid::Grid;
use crate::points::coordinates;

use factors::Factors;

pub use connectivity::{Connectivity, Links, Room, SupportFailure};
pub use cpdi::{CORNER_MARGIN, Cpdi, check_domain, domain_volume, nearest_with_distance};
pub use gimp::Gimp;
pub use mpm::Mpm;

/// Material point method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// The standard material point method: points without extent.
    Mpm,
    /// The generalised interpolation material point method: points with a rectangular domain.
    Gimp,
    /// The convected particle domain interpolation with parallelograms (parallelepipeds): the domain follows F of the
    /// point.
    Cpdi1,
    /// The second-order convected particle domain interpolation: the corners of the domain move with the grid.
    #[default]
    Cpdi2,
}

/// What kind of domain the points of a method have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DomainKind {
    /// None: the point is a point.
    None,
    /// A box aligned with the axes, given by half lengths.
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

    /// Name in decks.
    pub fn name(self) -> &'static str {
        match self {
            Method::Mpm => "mpm",
            Method::Gimp => "gimp",
            Method::Cpdi1 => "cpdi1",
            Method::Cpdi2 => "cpdi2",
        }
    }

    /// What kind of domain its points have.
    pub fn domain(self) -> DomainKind {
        match self {
            Method::Mpm => DomainKind::None,
            Method::Gimp => DomainKind::Box,
            Method::Cpdi1 | Method::Cpdi2 => DomainKind::Corners,
        }
    }
}

/// Where a point is at the start of a load step, and its domain.
#[derive(Debug, Clone, Copy)]
pub struct PointGeometry<'a, const D: usize> {
    /// The cell that holds the point.
    pub cell: u32,
    /// Position, [length].
    pub position: &'a [f64; D],
    /// Half lengths of a box domain, [length].
    pub half_lengths: &'a [f64; D],
    /// Corners of a domain of the kind [`DomainKind::Corners`], [length]: 2^`D`, bit d of a corner's number being its
    /// side along parametric axis d, or `D` + 1 of a triangle or tetrahedron.
    pub corners: &'a [[f64; D]],
}

/// The part of the grid that one point sees.
#[derive(Debug, Clone, Default)]
pub struct Support<const D: usize> {
    /// Grid nodes, ascending.
    pub nodes: Vec<u32>,
    /// S_vp, [-].
    pub value: Vec<f64>,
    /// ∂S_vp/∂X̃ in the configuration at the start of the step, [1/length].
    pub gradient: Vec<[f64; D]>,
    /// Cells that the point or its domain meets, in no order, perhaps repeated.
    pub cells: Vec<u32>,
    /// What the values and gradients are products of, where they are.
    factors: Option<Factors<D>>,
}

impl<const D: usize> Support<D> {
    /// Forgets the previous point.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.value.clear();
        self.gradient.clear();
        self.cells.clear();
        self.factors = None;
    }

    /// Adds to the value and gradient of a node.
    pub fn add(&mut self, node: u32, value: f64, gradient: [f64; D]) {
        if self.nodes.last().is_none_or(|last| *last < node) {
            self.nodes.push(node);
            self.value.push(value);
            self.gradient.push(gradient);
            return;
        }
        let place = self.nodes.partition_point(|n| *n < node);
        if self.nodes.get(place) == Some(&node) {
            self.value[place] += value;
            for (sum, g) in self.gradient[place].iter_mut().zip(gradient) {
                *sum += g;
            }
        } else {
            self.nodes.insert(place, node);
            self.value.insert(place, value);
            self.gradient.insert(place, gradient);
        }
    }
}

/// The basis functions of a point cannot be formed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SupportError {
    /// The point is not in the grid.
    #[error("the point is outside the grid")]
    OffGrid,
    /// A corner of its domain is not in the grid.
    #[error("corner {corner} of its domain, at {}, is outside the grid", coordinates(&position[..*dimension]))]
    CornerOffGrid {
        /// Number of the corner.
        corner: usize,
        /// Where it is, [length]; zero beyond the dimension.
        position: [f64; 3],
        /// Number of coordinates.
        dimension: usize,
    },
    /// The domain is inverted, a bow-tie, or has no volume.
    #[error("its domain is inverted or crosses itself")]
    Distorted,
    /// The method needs a structured grid.
    #[error("the method needs a structured grid")]
    Unstructured,
}

/// A material point method: from the position and domain of a point to its basis functions.
pub trait Basis<const D: usize>: Sync {
    /// Writes the nodes, values and gradients seen by a point, and the cells it meets.
    ///
    /// # Errors
    /// [`SupportError`] when the point or a corner of its domain is outside the grid, or the domain is distorted.
    fn support(
        &self,
        grid: &dyn Grid<D>,
        point: &PointGeometry<D>,
        out: &mut Support<D>,
    ) -> Result<(), SupportError>;
}

#[cfg(test)]
mod conformance;
