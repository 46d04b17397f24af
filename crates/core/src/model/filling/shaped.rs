//! Points whose domains have the shape of their body: cells of a mesh, and domains that follow an outline.

use std::any::Any;
use std::collections::HashSet;

use rayon::prelude::*;

use super::{FillError, Filling, Fit, MAX_POINTS, Placement};
use crate::basis::{DomainKind, domain_volume};
use crate::grid::element::ElementShape;
use crate::grid::sides::sides_of;
use crate::grid::subdivide::{ElementPart, subdivide_box, subdivide_simplex};
use crate::grid::{Lines, Structured};
use crate::model::fitting::{
    FittedDomain, NotFitted, SolidDomain, SolidDomains, centroid, fitted, fitted_in_space, is_on_lattice,
};
use crate::points::Seed;
use crate::region::{Outline, Region};

/// Length of the chords of a circle whose domains follow it, in cells of the lattice, [-]; below 1, so that no lattice
/// line needs a corner between their ends.
const CHORD: f64 = 0.95;
/// Distance within which corners of outlines coincide, in cells of the lattice, [-].
const SAME_PLACE: f64 = 1e-9;

/// The points of domains that follow the boundary of a region, or why there are none.
pub(super) struct Followed<const D: usize> {
    pub seeds: Vec<Seed<D>>,
    pub fit: Fit,
    /// As in [`super::FilledRegion`].
    pub apart: Option<[f64; D]>,
}

impl<const D: usize> Followed<D> {
    fn none(fit: Fit) -> Self {
        Followed { seeds: Vec::new(), fit, apart: None }
    }
}

impl<const D: usize> Filling<'_, D> {
    /// The points of the cells of a mesh of which a region consists, each divided into parts.
    ///
    /// # Errors
    /// [`FillError::Uneven`], [`FillError::TooManyParts`].
    pub(super) fn meshed(
        &self,
        region: &Region<D>,
        boxes: [usize; D],
        simplices: usize,
    ) -> Result<Vec<Seed<D>>, FillError> {
        let Some((mesh, cells, motion)) = region.as_mesh() else { return Ok(Vec::new()) };
        let most = boxes.iter().product::<usize>().max(simplices);
        if (cells.len() * most) as f64 > MAX_POINTS * self.ranks.count() as f64 {
            return Err(FillError::TooManyParts);
        }
        let sides = sides_of(mesh, cells);
        let alone = sides.chunk_by(|a, b| a.key == b.key).filter(|same| same.len() == 1);
        let border: HashSet<u32> = alone.flat_map(|side| side[0].nodes.clone()).collect();
        let mut seeds = Vec::new();
        for &cell in &cells[self.ranks.share(cells.len())] {
            let corners = mesh.corners(cell as usize);
            let nodes = corners.nodes();
            let x: Vec<[f64; D]> = nodes.iter().map(|&n| mesh.node_position(n as usize)).collect();
            let parts = match ElementShape::from_nodes::<D>(x.len()) {
                Some(ElementShape::Simplex) => {
                    subdivide_simplex(&x, simplices).ok_or(FillError::Uneven(simplices))?
                }
                _ => subdivide_box(&x, boxes).unwrap_or_default(),
            };
            let is_outer = nodes.iter().any(|node| border.contains(node));
            seeds.extend(parts.into_iter().map(|part| {
                let moved = ElementPart {
                    position: motion.apply(&part.position),
                    volume: part.volume * motion.volume_ratio(),
                    corners: part.corners.iter().map(|x| motion.apply(x)).collect(),
                };
                Seed { outer_layer: is_outer, ..self.point(moved) }
            }));
        }
        Ok(seeds)
    }

    /// The points of domains that follow the boundary of a region; why there are none, otherwise.
    ///
    /// # Errors
    /// As [`Filling::lattice_around`].
    pub(super) fn fitted(
        &self,
        region: &Region<D>,
        placement: &Placement<D>,
    ) -> Result<Followed<D>, FillError> {
        if self.domain != DomainKind::Corners || D < 2 || region.as_group().is_some() {
            return Ok(Followed::none(Fit::Parts));
        }
        let lattice = match (placement, self.grid.lines()) {
            (Placement::Lattice(spacing), _) => self.lattice_around(region, spacing)?,
            (Placement::PerCell { boxes: Some(counts), .. }, Some(lines)) => {
                let along = |d: usize| lines.axes()[d].subdivided(counts[d]);
                Some(Structured::with_axes(std::array::from_fn(along)))
            }
            _ => return Ok(Followed::none(Fit::OnMesh)),
        };
        let Some(lattice) = lattice else { return Ok(Followed::none(Fit::Parts)) };
        if let Some(region) = (region as &dyn Any).downcast_ref::<Region<3>>() {
            return Ok(self.fitted_in_space(region, &lattice));
        }
        let lattice = Lines::new([0, 1].map(|d| lattice.axes()[d % D].clone()));
        let is_by_cells = matches!(placement, Placement::PerCell { .. });
        let Some(outline) = self.outline(region, &lattice, is_by_cells) else {
            return Ok(Followed::none(Fit::Unfitted));
        };
        if is_on_lattice(&outline, &lattice) {
            return Ok(Followed::none(Fit::Parts));
        }
        let Some(domains) = fitted(&outline, &lattice) else { return Ok(Followed::none(Fit::Unfitted)) };
        let place = |x: &[f64; 2]| -> [f64; D] { std::array::from_fn(|d| x[d % 2]) };
        let point = |domain: &FittedDomain| {
            let mut corners: Vec<[f64; D]> = domain.corners.iter().map(place).collect();
            if corners.len() == 4 {
                corners.swap(2, 3);
            }
            let mut seed = self.seed(place(&centroid(&domain.corners)), domain_volume(&corners));
            (seed.corners, seed.outer_layer) = (corners, domain.is_outer);
            seed
        };
        let seeds = domains[self.ranks.share(domains.len())].par_iter().map(point).collect();
        Ok(Followed { seeds, fit: Fit::Fitted, apart: None })
    }

    /// The points of domains that follow the boundary of a region in space.
    fn fitted_in_space(&self, region: &Region<3>, lattice: &Structured<D>) -> Followed<D> {
        let lattice = Lines::new([0, 1, 2].map(|d| lattice.axes()[d % D].clone()));
        let cells = |d: usize| {
            let [low, high] = region.bounds().map(|x| lattice.axes()[d].coordinate(x[d]));
            (high.min(lattice.axes()[d].n_cells() as f64) - low.max(0.0)).max(0.0)
        };
        if cells(0) * cells(1) * cells(2) > MAX_POINTS {
            return Followed::none(Fit::Unfitted);
        }
        let place = |x: &[f64; 3]| -> [f64; D] { std::array::from_fn(|d| x[d % 3]) };
        let SolidDomains { domains, apart } = match fitted_in_space(region, &lattice) {
            Ok(found) => found,
            Err(NotFitted::OnLattice) => return Followed::none(Fit::Parts),
            Err(NotFitted::Unknown) => return Followed::none(Fit::Unfitted),
            Err(NotFitted::At(x)) => {
                return Followed { apart: Some(place(&x)), ..Followed::none(Fit::Unfitted) };
            }
        };
        let point = |domain: &SolidDomain| {
            let mut seed = self.seed(place(&domain.centroid()), domain_volume(&domain.corners));
            seed.corners = domain.corners.iter().map(place).collect();
            seed.outer_layer = domain.is_outer;
            seed
        };
        let seeds = domains[self.ranks.share(domains.len())].par_iter().map(point).collect();
        Followed { seeds, fit: Fit::Fitted, apart: apart.map(|x| place(&x)) }
    }

    /// The outline of a region of the plane. If the region is filled cell by cell, only its part in the grid counts; if
    /// only the polygon of a circle leaves the grid, it is cut off there, too. `None` if there is no outline, or if it
    /// is larger than what can be filled.
    fn outline(&self, region: &Region<D>, lattice: &Lines<2>, is_by_cells: bool) -> Option<Outline> {
        let [low, high] = region.bounds().map(|x| [x[0], x[1 % D]]);
        if !(0..2).all(|d| low[d] < high[d]) {
            return None;
        }
        let axes = lattice.axes();
        let ends = |d: usize| [low[d], high[d]].map(|x| axes[d].coordinate(x));
        let cells = |d: usize| ends(d)[1].min(axes[d].n_cells() as f64) - ends(d)[0].max(0.0);
        if cells(0) * cells(1) > MAX_POINTS {
            return None;
        }
        let size = |x: &[f64; 2]| [0, 1].map(|d| axes[d].size_at(x[d]));
        let least = (0..2).map(|d| axes[d].smallest_within(low[d], high[d])).fold(f64::INFINITY, f64::min);
        let farthest = low.iter().chain(&high).fold(0.0f64, |most, x| most.max(x.abs()));
        let same = (SAME_PLACE * least).max(16.0 * f64::EPSILON * farthest);
        let chord = |x: &[f64; 2]| CHORD * (size(x)[0] * size(x)[1]).sqrt();
        let outline = |within| region.outline(within, &chord, same);
        let whole = outline(None)?;
        let Some(lines) = self.grid.lines() else { return Some(whole) };
        let [from, to] = [lines.origin(), lines.upper()].map(|x| [x[0], x[1 % D]]);
        let leaves = |x: &[f64; 2]| (0..2).any(|d| x[d] < from[d] - same || x[d] > to[d] + same);
        let is_cut = is_by_cells || !(leaves(&low) || leaves(&high));
        if is_cut && whole.loops.iter().flatten().any(leaves) {
            return outline(Some([from, to]));
        }
        Some(whole)
    }
}
