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
use super::outer::{OuterSides, box_corners};
use super::{Part, SideRule, Surface, sides_of_domain, unit};
use crate::basis::DomainKind;
use crate::grid::{MAX_CORNERS, distance_squared_of_triangle};
use crate::points::Points;
use crate::ranks::Ranks;
use crate::region::vector::{dot, minus};
use crate::region::{BoxTree, Facet, area_vector, around, boxes_overlap};
use crate::tensor::padded;

/// Distance from a facet within which the centre of a side lies on it, relative to the size of a cell, [-].
const ON_FACET: f64 = 1e-6;
/// Smallest cosine of the angle between the normals of a side and of a facet on which it lies, [-].
const PARALLEL: f64 = 1.0 - 1e-9;
/// Largest difference, relative to the area, between the areas of the sides and of the surface, and between their first
/// moments in cells, [-].
const SAME: f64 = 1e-6;
/// The same for domains that follow a curved boundary, [-].
const SAME_CURVED: f64 = 0.03;
/// The same for all of the boundary of a body, [-].
const SAME_WHOLE: f64 = 0.2;
/// Smallest cosine of the angle between the normals of an outer side that follows a curved boundary and of a facet to
/// which it may belong, [-].
const ALIKE: f64 = 0.5;

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
    /// corners follow a curved boundary, their outer sides take its place: each belongs to the nearest part of `whole`,
    /// all of the boundary of the body, so that the sides of a closed surface are closed. All ranks must call this
    /// together.
    pub fn at_sides(
        &self,
        whole: &Self,
        points: &Points<D>,
        domain: DomainKind,
        ranks: &Ranks,
    ) -> Option<Self> {
        let rule = match domain {
            DomainKind::Corners => SideRule::Corners,
            DomainKind::Box => SideRule::Integral,
            DomainKind::None => return None,
        };
        let exact = self.at(self.sides_of(points, domain), rule, ranks);
        if let Some(found) = exact.filter(|found| self.contains(found) && self.has_moments_of(found, SAME)) {
            return Some(found);
        }
        // Boxes cannot follow a curve.
        if domain == DomainKind::Box {
            return None;
        }
        // Whatever the sides of the whole boundary leave out of its shape, they alone are in equilibrium.
        let same = if self.len() == whole.len() { SAME_WHOLE } else { SAME_CURVED };
        let near = self.at(self.outer_sides(whole, points), rule, ranks);
        near.filter(|found| self.has_moments_of(found, same))
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

    /// The outer sides of this rank's domains, given by their corners, that belong to this part of a whole boundary.
    fn outer_sides(&self, whole: &Self, points: &Points<D>) -> Vec<Side> {
        let mut outer = OuterSides::default();
        outer.find(points, &points.reduction());
        if self.is_empty() || whole.is_empty() {
            return Vec::new();
        }
        let [part, all] = [self, whole].map(Facets::new);
        let mut sides = Vec::new();
        for p in (0..points.len()).filter(|&p| points.body[p] as usize == self.body) {
            let (mask, corners) = (outer.of_point(points.id[p]), points.corners(p));
            let of_triangle = D == 2 && corners.len() == 3;
            for (k, side) in sides_of_domain::<D>(corners.len()).enumerate() {
                let (centre, area) = (side.centre(corners), side.area(corners));
                if mask >> k & 1 == 0 {
                    continue;
                }
                // At a sharp edge, a side may face in a direction between those of the facets.
                let nearest = |least: f64| {
                    let normal = unit(&area);
                    all.nearest(&centre, &normal, least).zip(part.nearest(&centre, &normal, least))
                };
                let found = nearest(ALIKE).or_else(|| nearest(-1.0));
                if let Some(((least, _), (distance, number))) = found
                    && distance <= least + all.slack
                {
                    let side: Vec<[f64; D]> = side.corners().iter().map(|&k| corners[k]).collect();
                    let corners = side.as_flattened().to_vec();
                    sides.push(Side { number: Some(number), corners, of_triangle });
                }
            }
        }
        sides
    }

    /// The sides of this rank's domains whose centres lie on this surface.
    fn sides_of(&self, points: &Points<D>, domain: DomainKind) -> Vec<Side> {
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
            if !facets.are_near(corners) {
                continue;
            }
            let of_triangle = D == 2 && corners.len() == 3;
            for side in sides_of_domain::<D>(corners.len()) {
                let centre = side.centre(corners);
                let side: Vec<[f64; D]> = side.corners().iter().map(|&k| corners[k]).collect();
                let area = area_vector(&std::array::from_fn(|k| side[k]));
                let number = facets.side_at(&centre, &area);
                if number.is_some() {
                    sides.push(Side { number, corners: side.as_flattened().to_vec(), of_triangle });
                }
            }
        }
        sides
    }

    /// True if another surface contains the centres of the facets of this one.
    fn contains(&self, other: &Self) -> bool {
        let sides = Facets::new(other);
        (0..self.len())
            .all(|sample| sides.side_at(&self.samples[sample], &area_vector(&self.facet(sample))).is_some())
    }

    /// True if another surface has the same area, area vector and first moment of the area, up to a difference relative
    /// to the area.
    fn has_moments_of(&self, other: &Self, same: f64) -> bool {
        let origin = self.samples[0];
        let [a, b] = [self, other].map(|surface| surface.moments(&origin));
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

    /// False if no facet comes near a domain with these corners.
    fn are_near(&self, corners: &[[f64; D]]) -> bool {
        let [low, high] = around(corners);
        let wide = [low.map(|x| x - self.slack), high.map(|x| x + self.slack)];
        let mut is_near = false;
        self.tree.visit(|bounds| boxes_overlap(bounds, &wide), |_| is_near = true);
        is_near
    }

    /// The distance of the nearest of the facets whose normals have at least this cosine with a direction, [length], and
    /// the number of the side to which it belongs; of equally near facets, the one with the largest cosine.
    fn nearest(&self, x: &[f64; D], normal: &[f64; D], least_cosine: f64) -> Option<(f64, usize)> {
        let mut best: Option<(f64, f64, usize)> = None;
        let round_off = self.slack * self.slack;
        self.tree.approach(x, f64::INFINITY, |index| {
            let facet = &self.facets[index];
            let n = unit(&area_vector(&facet.corners));
            let (squared, cosine) = (squared_distance_of_facet(x, &facet.corners), dot(&n, normal));
            let is_better = best.is_none_or(|(least, most, _)| {
                squared < least - round_off || squared <= least + round_off && cosine > most
            });
            if cosine >= least_cosine && is_better {
                best = Some((squared, cosine, facet.side));
            }
            best.map_or(f64::INFINITY, |(squared, ..)| squared + round_off)
        });
        best.map(|(squared, _, side)| (squared.sqrt(), side))
    }

    /// The number of the side to which the facet at a position belongs, if it has the direction of an area vector.
    fn side_at(&self, x: &[f64; D], area: &[f64; D]) -> Option<usize> {
        let near = [x.map(|x| x - self.slack), x.map(|x| x + self.slack)];
        let normal = unit(area);
        let mut best: Option<usize> = None;
        self.tree.visit(
            |bounds| boxes_overlap(bounds, &near),
            |index| {
                let facet = &self.facets[index];
                let n = unit(&area_vector(&facet.corners));
                let along = |v: &[f64; D]| dot(v, &n);
                // The area of the facet with one of its corners at x is positive for all corners if x lies inside.
                let slack = self.slack * facet.size().max(self.slack).powi(D as i32 - 2);
                let is_inside = (0..D).all(|k| {
                    let mut corners = facet.corners;
                    corners[k] = *x;
                    along(&area_vector(&corners)) >= -slack
                });
                if along(&minus(x, &facet.corners[0])).abs() <= self.slack
                    && is_inside
                    && along(&normal) >= PARALLEL
                {
                    best = Some(best.map_or(facet.side, |side| side.min(facet.side)));
                }
            },
        );
        best
    }
}

/// The square of the distance of a position from a facet, [length²].
fn squared_distance_of_facet<const D: usize>(x: &[f64; D], corners: &[[f64; D]; D]) -> f64 {
    let corner = |k: usize| padded(&corners[k.min(D - 1)]);
    distance_squared_of_triangle(padded(x), [0, 1, 2].map(corner))
}
