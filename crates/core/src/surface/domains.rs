//! The sides of domains that form a surface.
//!
//! By the divergence theorem, the internal force of a uniform stress σ in domains is the sum of N_v σ n a over their
//! outer sides, where N_v is the mean of the basis over the side: in CPDI, over the corners of the side (of triangles
//! and parallelograms), in GIMP, over all of it. A load or condition that samples the surface at exactly these sides,
//! by the same rule, is therefore in equilibrium with a uniform stress, on any grid; one that samples it elsewhere is
//! not, as soon as sides cross the boundaries of cells.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::divided::facets_of_side;
use super::outer::box_corners;
use super::{Part, SideRule, Surface, sides_of_domain, unit};
use crate::basis::DomainKind;
use crate::grid::MAX_CORNERS;
use crate::points::Points;
use crate::ranks::Ranks;
use crate::region::{BoxTree, Facet, area_vector, around, boxes_overlap};

/// Distance from a facet within which the centre of a side lies on it, relative to the size of a cell, [-].
const ON_FACET: f64 = 1e-6;
/// Smallest cosine of the angle between the normals of a side and of a facet on which it lies, [-].
const PARALLEL: f64 = 1.0 - 1e-9;
/// Largest difference, relative to the area, between the areas of the sides and of the surface, and between their first
/// moments in cells, [-].
const SAME: f64 = 1e-6;
/// The same for domains that follow a curved boundary, [-].
const SAME_CURVED: f64 = 0.03;
/// Distance from a facet within which the centre of an outer side that follows a curved boundary lies at it, relative
/// to the size of the side, [-].
const AT_FACET: f64 = 0.25;
/// How far beside a facet a position may lie that is next to it, relative to its height above the facet, [-]: between
/// neighbouring facets of a curve there are gaps outside it.
const BESIDE: f64 = 0.5;
/// Smallest cosine of the angle between the normals of such a side and of a facet at which it lies, [-].
const ALIKE: f64 = 0.95;

/// A side of a domain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Side {
    /// Number of the side of the body's shape on which it lies; `None` for a side that lies on none.
    number: Option<usize>,
    /// Corners in cyclic order, `D` numbers each, [length].
    corners: Vec<f64>,
    /// True for a side of a triangle in the plane.
    of_triangle: bool,
}

impl<const D: usize> Surface<D> {
    /// The same surface, sampled at the sides of the domains of its body; `None` if the points have no domains, or if
    /// their sides do not form this surface: it is oblique to them, or ends within a side. Where domains given by their
    /// corners follow a curved boundary, the outer sides near the surface take its place. All ranks must call this
    /// together.
    pub fn at_sides(&self, points: &Points<D>, domain: DomainKind, ranks: &Ranks) -> Option<Self> {
        let rule = match domain {
            DomainKind::Corners => SideRule::Corners,
            DomainKind::Box => SideRule::Integral,
            DomainKind::None => return None,
        };
        let exact = self.at(self.sides_of(points, domain, Match::Exact), rule, ranks);
        if let Some(found) = exact.filter(|found| self.coincides_with(found, Match::Exact)) {
            return Some(found);
        }
        // Boxes cannot follow a curve.
        if domain == DomainKind::Box {
            return None;
        }
        let near = self.at(self.sides_of(points, domain, Match::Curved), rule, ranks);
        near.filter(|found| self.coincides_with(found, Match::Curved))
    }

    /// This surface, sampled at the sides of all ranks that lie on it and are shared by no other domain; `None` if
    /// there are none.
    fn at(&self, own: Vec<Side>, rule: SideRule, ranks: &Ranks) -> Option<Self> {
        let mut sides: Vec<Side> = ranks.gather_all(own).into_iter().flatten().collect();
        let mut count: HashMap<Vec<u64>, usize> = HashMap::new();
        for side in &sides {
            *count.entry(side.key::<D>()).or_default() += 1;
        }
        sides.retain(|side| side.number.is_some() && count[&side.key::<D>()] == 1);
        // The order does not depend on the number of ranks.
        sides.sort_by(|a, b| {
            let pairs = a.corners.iter().zip(&b.corners);
            pairs.fold(a.number.cmp(&b.number), |order, (a, b)| order.then(a.total_cmp(b)))
        });
        let (mut facets, mut shares, mut of_triangles) = (Vec::new(), Vec::new(), Vec::new());
        for side in &sides {
            let (corners, _) = side.corners.as_chunks::<D>();
            for triangle in facets_of_side(corners.len()) {
                facets.push(Facet {
                    corners: std::array::from_fn(|k| corners[triangle[k]]),
                    side: side.number.unwrap_or(0),
                });
                shares.push(if corners.len() == 4 { 0.5 } else { 1.0 });
                of_triangles.push(side.of_triangle);
            }
        }
        let found = Surface {
            shares,
            of_triangles,
            rule,
            ..Surface::from_facets(self.name.clone(), self.body, facets, &Part::Whole, self.cell)
        };
        (!found.is_empty()).then_some(found)
    }

    /// The sides of this rank's domains whose centres lie on this surface; where it is curved, also sides that face
    /// elsewhere, so that shared sides are recognised.
    fn sides_of(&self, points: &Points<D>, domain: DomainKind, how: Match) -> Vec<Side> {
        if self.is_empty() {
            return Vec::new();
        }
        let facets = Facets::new(self);
        let (mut sides, mut buffer) = (Vec::new(), [[0.0; D]; MAX_CORNERS]);
        for p in (0..points.len()).filter(|&p| points.body[p] as usize == self.body) {
            let corners = if domain == DomainKind::Box {
                let (x, half) = (&points.converged.position[p], &points.converged.half_lengths[p]);
                box_corners(&mut buffer, |side| std::array::from_fn(|d| x[d] + side[d] * half[d]))
            } else {
                points.corners(p)
            };
            let [low, high] = around(corners);
            let size = (0..D).map(|d| high[d] - low[d]).fold(0.0, f64::max);
            if !facets.are_near(corners, how.slack(size, facets.slack)) {
                continue;
            }
            let of_triangle = D == 2 && corners.len() == 3;
            for side in sides_of_domain::<D>(corners.len()) {
                let centre = side.centre(corners);
                let side: Vec<[f64; D]> = side.corners().iter().map(|&k| corners[k]).collect();
                let area = area_vector(&std::array::from_fn(|k| side[k]));
                let number = facets.side_at(&centre, &area, how);
                if number.is_some() || how == Match::Curved {
                    sides.push(Side { number, corners: side.as_flattened().to_vec(), of_triangle });
                }
            }
        }
        sides
    }

    /// True if another surface has the same area, area vector and first moment of the area, up to a difference relative
    /// to the area, and, if it is to be exact, contains the centres of the facets of this one.
    fn coincides_with(&self, other: &Self, how: Match) -> bool {
        let origin = self.samples[0];
        let [a, b] = [self, other].map(|surface| surface.moments(&origin));
        let same = how.difference();
        let sides = Facets::new(other);
        let is_on_side = |sample: usize| {
            sides.side_at(&self.samples[sample], &area_vector(&self.facet(sample)), how).is_some()
        };
        if how == Match::Exact && !(0..self.len()).all(is_on_side) {
            return false;
        }
        let area = a.0;
        let close = |a: f64, b: f64, unit: f64| (a - b).abs() <= same * area * unit;
        close(a.0, b.0, 1.0) && (0..D).all(|d| close(a.1[d], b.1[d], 1.0) && close(a.2[d], b.2[d], self.cell))
    }

    /// The area, the area vector, and the first moment of the area about a position, near which round-off is small.
    fn moments(&self, origin: &[f64; D]) -> (f64, [f64; D], [f64; D]) {
        let (mut area, mut vector, mut moment) = (0.0, [0.0; D], [0.0; D]);
        for sample in 0..self.len() {
            let a = self.original_area(sample);
            let size = a.iter().map(|a| a * a).sum::<f64>().sqrt();
            area += size;
            for d in 0..D {
                vector[d] += a[d];
                moment[d] += size * (self.samples[sample][d] - origin[d]);
            }
        }
        (area, vector, moment)
    }
}

impl Side {
    /// What two domains that share the side agree on: its corners, in ascending order.
    fn key<const D: usize>(&self) -> Vec<u64> {
        let (corners, _) = self.corners.as_chunks::<D>();
        let mut bits: Vec<[u64; D]> = corners.iter().map(|x| x.map(|x| (x + 0.0).to_bits())).collect();
        bits.sort_unstable();
        bits.as_flattened().to_vec()
    }
}

/// How closely a side must agree with a facet to lie on it.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Match {
    /// Up to round-off.
    Exact,
    /// Up to the curvature of the boundary over the side.
    Curved,
}

impl Match {
    /// Distance from a facet within which the centre of a side of this size lies on it; `slack` is that for round-off,
    /// [length].
    fn slack(self, size: f64, slack: f64) -> f64 {
        match self {
            Match::Exact => slack,
            Match::Curved => AT_FACET * size + slack,
        }
    }

    /// Largest difference between two surfaces that are the same, relative to their area, [-].
    fn difference(self) -> f64 {
        match self {
            Match::Exact => SAME,
            Match::Curved => SAME_CURVED,
        }
    }

    /// Smallest cosine of the angle between normals, [-].
    fn cosine(self) -> f64 {
        match self {
            Match::Exact => PARALLEL,
            Match::Curved => ALIKE,
        }
    }
}

/// The facets of a surface, for finding those at a position.
struct Facets<const D: usize> {
    facets: Vec<Facet<D>>,
    tree: BoxTree<D>,
    /// Distance within which a position lies on a facet, [length].
    slack: f64,
}

impl<const D: usize> Facets<D> {
    /// The facets of a surface that is not empty.
    fn new(surface: &Surface<D>) -> Self {
        let facet = |s: usize| Facet { corners: surface.facet(s), side: surface.sides[s] };
        let facets: Vec<Facet<D>> = (0..surface.len()).map(facet).collect();
        let boxes: Vec<_> = facets.iter().map(|facet| around(&facet.corners)).collect();
        let tree = BoxTree::new(&boxes);
        Facets { facets: tree.ordered(&facets), tree, slack: ON_FACET * surface.cell }
    }

    /// False if no facet comes within a distance of a domain with these corners.
    fn are_near(&self, corners: &[[f64; D]], slack: f64) -> bool {
        let [low, high] = around(corners);
        let wide = [low.map(|x| x - slack), high.map(|x| x + slack)];
        let mut is_near = false;
        self.tree.visit(|bounds| boxes_overlap(bounds, &wide), |_| is_near = true);
        is_near
    }

    /// The number of the side to which the facet at a position belongs, if it has the direction of an area vector; of
    /// several facets, the nearest.
    fn side_at(&self, x: &[f64; D], area: &[f64; D], how: Match) -> Option<usize> {
        let size = area.iter().map(|a| a * a).sum::<f64>().sqrt().powf(1.0 / (D as f64 - 1.0));
        let slack = how.slack(size, self.slack);
        let near = [x.map(|x| x - slack), x.map(|x| x + slack)];
        let normal = unit(area);
        let mut best: Option<(f64, usize)> = None;
        self.tree.visit(
            |bounds| boxes_overlap(bounds, &near),
            |index| {
                let facet = &self.facets[index];
                let n = unit(&area_vector(&facet.corners));
                let along = |v: &[f64; D]| (0..D).map(|d| v[d] * n[d]).sum::<f64>();
                let height = along(&std::array::from_fn(|d| x[d] - facet.corners[0][d])).abs();
                // The area of the facet with one of its corners at x is positive for all corners if x lies inside.
                let edge = facet.size().max(self.slack).powi(D as i32 - 2);
                let is_inside = (0..D).all(|k| {
                    let mut corners = facet.corners;
                    corners[k] = *x;
                    along(&area_vector(&corners)) >= -self.slack.max(BESIDE * height) * edge
                });
                let rank = (if how == Match::Exact { 0.0 } else { height }, facet.side);
                if height <= slack
                    && is_inside
                    && along(&normal) >= how.cosine()
                    && best.is_none_or(|best| rank.partial_cmp(&best).is_some_and(std::cmp::Ordering::is_lt))
                {
                    best = Some(rank);
                }
            },
        );
        best.map(|(_, side)| side)
    }
}
