//! Surfaces of bodies, on which tractions and pressures act and motions are prescribed weakly.
//!
//! A surface is sampled at the start, by dividing the boundary of the body's region into flat facets (segments in
//! the plane, triangles in space). The corners of the facets are massless points, which the grid carries with the
//! linear basis N_v of its cells. Each facet is one sample: its position is the mean of its corners, and its N_v is the
//! mean of their N_v or, on GIMP domains, over a side ([`SideRule`]). The area vector n a follows from the carried
//! corners, so a closed surface stays closed: Σ n a = 0 at all times, except for the radial component in bodies of
//! revolution. In a uniform deformation, n a agrees with Nanson's formula, n a = cof(F) N A.
//!
//! Where the sides of the domains of the body form the surface, they are its facets (`domains`), and follow cuts of
//! these domains (`divided`); elsewhere, facets are a quarter of a cell long.
//!
//! Because a sample takes the mean over its corners, a pressure p does exactly the work −p dV on the volume V inside a
//! closed surface, and the forces of a uniform stress are those of CPDI2 domains whose sides are the facets.

mod carried;
mod divided;
mod domains;
mod integral;
mod outer;
mod places;
mod sheet;
mod side_basis;
mod support;

use crate::grid::Axis;
use crate::ranks::Reduction;
use crate::region::{Facet, NoBoundary, Region, area_vector};

pub use carried::Carried;
pub use divided::{Division, PlacedDivision};
pub(crate) use integral::crossings;
pub use integral::{lies_in_one_cell, mean_over_side};
pub use outer::{
    DomainSide, OuterSides, contains, corner_count, corners_of, deformed_corners, sides_of_domain,
};
pub(crate) use places::Places;
pub use sheet::Sheet;
pub use side_basis::side_basis;
pub use support::{Support, active, support};

/// Tolerance of the boxes and half-spaces that select samples, relative to the size of a cell, [-].
const SLACK: f64 = 1e-6;
/// Length of the pieces over which loads are averaged, relative to the size of a cell, [-], and largest number of
/// pieces along a side.
const PIECE: f64 = 0.25;
const MOST_PIECES: f64 = 16.0;

/// The part of the boundary of a body that forms a surface.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Part<const D: usize> {
    /// The whole boundary.
    #[default]
    Whole,
    /// What lies inside a closed box with these lowest and highest corners, [length].
    Box([f64; D], [f64; D]),
    /// What lies at positions x with (x − `point`) · `normal` ≥ 0.
    HalfSpace {
        /// A position on the plane, [length].
        point: [f64; D],
        /// Direction into the half-space, of any length.
        normal: [f64; D],
    },
    /// The samples on one side of the primitive that forms the region.
    Side(usize),
}

impl<const D: usize> Part<D> {
    /// The half-spaces x · a ≥ b that contain the part, as pairs (a, b) with unit vectors a.
    fn half_spaces(&self) -> Vec<([f64; D], f64)> {
        match self {
            Part::Whole | Part::Side(_) => Vec::new(),
            Part::Box(min, max) => {
                let along = |d: usize, sign: f64| std::array::from_fn(|k| if k == d { sign } else { 0.0 });
                (0..D).flat_map(|d| [(along(d, 1.0), min[d]), (along(d, -1.0), -max[d])]).collect()
            }
            Part::HalfSpace { point, normal } => {
                let a = unit(normal);
                vec![(a, (0..D).map(|d| a[d] * point[d]).sum())]
            }
        }
    }

    /// The facets, cut at the ends of the part. Facets that lie within `slack`, [length], of the part stay whole.
    fn cut(&self, mut facets: Vec<Facet<D>>, slack: f64) -> Vec<Facet<D>> {
        if let Part::Side(side) = self {
            facets.retain(|facet| facet.side == *side);
        }
        for (a, b) in self.half_spaces() {
            let above = |x: &[f64; D]| (0..D).map(|d| a[d] * x[d]).sum::<f64>() - b;
            facets = facets.iter().flat_map(|facet| facet.above(above, slack)).collect();
        }
        facets
    }
}

/// How a sample sees the basis of the grid on its facet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SideRule {
    /// N_v is the mean over the corners, as on the sides of CPDI domains.
    #[default]
    Corners,
    /// N_v is the mean over the side of a domain to which the sample belongs, as in GIMP.
    Integral,
}

/// A surface of a body: in a model, as sampled at the start; during a run, with the sides of domains that have been cut
/// in place of those of the whole domains.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface<const D: usize> {
    /// Name of the surface.
    pub name: String,
    /// Index of the body.
    pub body: usize,
    /// Original positions of the samples, the centres of the facets, [length].
    pub samples: Vec<[f64; D]>,
    /// Original positions of the corners, [length].
    pub corners: Vec<[f64; D]>,
    /// Corners of the facet of each sample, as indices into `corners`.
    pub facets: Vec<[u32; D]>,
    /// The share of its facet for which each sample stands, [-]: 1, or 1/2 on quadrilaterals in space, where the
    /// triangles of both divisions are samples.
    pub shares: Vec<f64>,
    /// True for each sample on the side of a triangle in the plane: in a body of revolution, the basis of a triangle
    /// takes the mean over its side with the radius as a weight.
    pub of_triangles: Vec<bool>,
    /// The rule of the samples.
    pub rule: SideRule,
    /// Number of the side of the body's shape on which each sample lies.
    pub sides: Vec<usize>,
    /// Size of the smallest grid cell at the surface, [length].
    pub cell: f64,
    /// Original positions of the corners in units of the cell size, [-]: on a structured grid, the cell coordinates at
    /// the start; on a mesh, positions divided by the size of the largest cell at the surface.
    pub in_cells: Vec<[f64; D]>,
}

impl<const D: usize> Surface<D> {
    /// Samples a part of the boundary of a region with facets whose edges are no longer than `spacing`; `cell` is the
    /// size of a grid cell, both [length].
    ///
    /// # Errors
    /// [`NoBoundary`] if the boundary is not available, or if it has no side with the number of [`Part::Side`]. Any
    /// other part without samples is not an error here.
    pub fn new(
        name: impl Into<String>,
        body: usize,
        region: &Region<D>,
        part: &Part<D>,
        [spacing, cell]: [f64; 2],
    ) -> Result<Self, NoBoundary> {
        let facets = region.boundary(spacing)?;
        if let Part::Side(side) = part
            && !(region.has_numbered_sides() && facets.iter().any(|facet| facet.side == *side))
        {
            return Err(NoBoundary::NoSide(*side));
        }
        Ok(Surface::from_facets(name, body, facets, part, cell))
    }

    /// The surface formed by the facets that lie in a part of the boundary, cut at its ends; `cell` is the size of a
    /// grid cell, [length].
    pub fn from_facets(
        name: impl Into<String>,
        body: usize,
        facets: Vec<Facet<D>>,
        part: &Part<D>,
        cell: f64,
    ) -> Self {
        let facets = part.cut(facets, SLACK * cell);
        let mut surface = Surface {
            name: name.into(),
            body,
            samples: facets.iter().map(Facet::centre).collect(),
            corners: Vec::new(),
            facets: Vec::new(),
            shares: vec![1.0; facets.len()],
            of_triangles: vec![false; facets.len()],
            rule: SideRule::Corners,
            sides: facets.iter().map(|facet| facet.side).collect(),
            cell,
            in_cells: Vec::new(),
        };
        // Neighbouring facets share corners in spite of round-off in their positions.
        let mut places = Places::new(cell);
        for facet in &facets {
            surface.facets.push(facet.corners.map(|corner| places.number(&corner)));
        }
        surface.corners = places.into_positions();
        surface.in_cells = surface.corners.iter().map(|corner| corner.map(|x| x / cell)).collect();
        surface
    }

    /// The surface with its facets cut where they cross lines of an axis with cells of several sizes: only within a cell
    /// is the mean of the basis over the corners of a facet that over the facet. Where all cells are alike, facets of a
    /// whole fraction of a cell cross no lines.
    pub fn cut_at_graded_lines(self, axes: &[Axis; D]) -> Self {
        let slack = SLACK * self.cell;
        let mut facets: Vec<Facet<D>> = (0..self.len())
            .map(|sample| Facet { corners: self.facet(sample), side: self.sides[sample] })
            .collect();
        for (d, axis) in axes.iter().enumerate().filter(|(_, axis)| !axis.is_even()) {
            facets = facets.into_iter().flat_map(|facet| facet.cut_along(d, axis, slack)).collect();
        }
        if facets.len() == self.len() {
            return self;
        }
        Surface::from_facets(self.name, self.body, facets, &Part::Whole, self.cell)
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// True if there are no samples.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// The original positions of the corners of a facet, [length].
    pub fn facet(&self, sample: usize) -> [[f64; D]; D] {
        self.facets[sample].map(|corner| self.corners[corner as usize])
    }

    /// The centres of pieces of the facet of a sample that are at most about a quarter of a cell long: a load that is
    /// not linear over a long side is averaged over them.
    pub fn pieces(&self, sample: usize) -> Vec<Piece<D>> {
        let facet = Facet { corners: self.facet(sample), side: 0 };
        let n = (facet.size() / (PIECE * self.cell) - SLACK).ceil().clamp(1.0, MOST_PIECES) as usize;
        let share = |weight: f64| weight / (D * n) as f64;
        let mut pieces = Vec::new();
        for i in 0..n {
            if D == 2 {
                pieces.push(Piece(std::array::from_fn(|k| {
                    share([(2 * (n - i) - 1) as f64, (2 * i + 1) as f64][k])
                })));
                continue;
            }
            // The triangles of row i that stand on their bases, and those between them on their tips.
            for (j, tip) in (0..n - i).map(|j| (j, 1)).chain((1..n - i).map(|j| (j - 1, 2))) {
                let [a, b] = [i, j].map(|k| (3 * k + tip) as f64);
                pieces.push(Piece(std::array::from_fn(|k| share([3.0 * n as f64 - a - b, a, b][k]))));
            }
        }
        pieces
    }

    /// Original normal of a sample times its original area, [length^(D−1)]; per unit thickness in the plane.
    pub fn original_area(&self, sample: usize) -> [f64; D] {
        area_vector(&self.facet(sample)).map(|a| self.shares[sample] * a)
    }

    /// Original unit normal of a sample, pointing out of the body.
    pub fn normal(&self, sample: usize) -> [f64; D] {
        unit(&self.original_area(sample))
    }
}

/// The centre of a piece of a facet, as shares of the corners of the facet, [-].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece<const D: usize>([f64; D]);

impl<const D: usize> Piece<D> {
    /// The centre of the piece on a facet with these corners, [length].
    pub fn on(&self, corners: &[[f64; D]; D]) -> [f64; D] {
        if self.0 == [1.0 / D as f64; D] {
            return centre(corners);
        }
        std::array::from_fn(|d| self.0.iter().zip(corners).map(|(share, corner)| share * corner[d]).sum())
    }
}

/// The state of a surface at the end of a step, one entry per sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SurfaceFields<const D: usize> {
    /// Positions of the samples, [length].
    pub position: Vec<[f64; D]>,
    /// Unit normals, pointing out of the body.
    pub normal: Vec<[f64; D]>,
    /// Areas, [length²]: per unit thickness in plane strain, over the full circle for bodies of revolution.
    pub area: Vec<f64>,
    /// Sum of the pressures, [stress].
    pub pressure: Vec<f64>,
    /// Sum of the forces of all loads, [force].
    pub load: Vec<[f64; D]>,
    /// Sum of the reactions on the body from all conditions, [force].
    pub reaction: Vec<[f64; D]>,
}

impl<const D: usize> SurfaceFields<D> {
    /// The fields with the values of all samples: each rank supplies those of its own samples and the reactions that it
    /// adds.
    pub fn completed(&self, reduction: &Reduction, is_own: impl Fn(usize) -> bool) -> Self {
        let mut all = self.clone();
        for sample in (0..all.position.len()).filter(|sample| !is_own(*sample)) {
            (all.position[sample], all.normal[sample], all.area[sample]) = ([0.0; D], [0.0; D], 0.0);
        }
        let SurfaceFields { position, normal, area, pressure, load, reaction } = &mut all;
        for vectors in [position, normal, load, reaction] {
            reduction.sum(vectors.as_flattened_mut());
        }
        reduction.sum(area);
        reduction.sum(pressure);
        all
    }
}

/// The mean of the corners of a facet, [length].
pub fn centre<const D: usize>(corners: &[[f64; D]; D]) -> [f64; D] {
    Facet { corners: *corners, side: 0 }.centre()
}

/// A vector divided by its length; the zero vector if its length is zero.
pub fn unit<const D: usize>(vector: &[f64; D]) -> [f64; D] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 { vector.map(|x| x / length) } else { [0.0; D] }
}
