//! The contact points that may touch a tool in a step: the corners of the domains of nearby material points.
//!
//! | Method | Contact points | Motion in the step |
//! |---|---|---|
//! | GIMP | corners of the box x_p ± l_p | N_v of the cell that holds the corner; on outer sides, see below |
//! | CPDI1, CPDI2 | corners of the domain | N_v of the cell that holds the corner |
//! | MPM | corners of the box x_p ± l_p, or x_p if the point has no box | N_v of the cell of x_p, extrapolated |
//! | GIMP, CPDI | positions on outer sides that edges of tools meet, see [`super::on_sides`] | mean of N_v at the corners |
//! | all | x_p, to detect thin tools between the corners; not below a flat surface without edges | S_vp |
//!
//! Corners of several domains at the same place are one contact point: in CPDI2 always, in CPDI1 as long as the domains
//! have not drifted apart.
//!
//! Corners inside the body are contact points, too: surfaces of the body that have come together may open again.
//!
//! The area of a contact point is its part of the outer sides of domains that face the tool (see [`super::sides`]). The
//! area that its penalty assumes is its share of the side of the domain that lies along the tool; for boxes and for
//! centres, its share of the side of a cube with the volume of the domain. A contact point far from all outer sides,
//! as in a cut, has this area altogether.
//!
//! In GIMP, the forces of a uniform stress on an outer side are those of the mean N̄_v over the side. A corner c of a
//! side with the corners k, that crosses lines of the grid, therefore has N_v(x_c) + N̄_v − Σ_k N_v(x_k)/n.
//!
//! A corner on the boundary between cells belongs to the cell towards its material point. If a node of that cell is
//! inactive, the next cell towards the material point is taken, and its basis is extrapolated to the corner.

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::basis::{Connectivity, Method};
use crate::grid::{CellBasis, MAX_CORNERS};
use crate::material::Modulus;
use crate::model::{Model, ModuliAtRest, Tool};
use crate::points::Points;
use crate::region::vector::{along, dot, minus, norm};
use crate::surface::{OuterSides, active, corners_of, lies_in_one_cell, mean_over_side, sides_of_domain};
use crate::terms::failure::ContactPlace;
use crate::tool::{Closest, Shape};

use super::carriers::Carriers;
use super::counterpart::Counterpart;
use super::edges::Edges;
use super::facet::Facet;
use super::interface::Multiplier;
use super::key::{CENTRE, FACE, Kept, Key, is_on_side};
use super::motion::{Moving, farthest};
use super::outer::Outer;

/// Two positions count as being on different sides of the tool if the cosine of the angle between their normals is
/// below this value, [-]. In one step, a contact point may thus slide around a corner with an interior angle of more
/// than 60 degrees.
pub(super) const OTHER_SIDE: f64 = -0.5;

/// Overlap or gap at the start of a step up to which surfaces count as touching, relative to the size of a cell, [-].
pub(super) const TOUCHING: f64 = 1e-6;
/// Smallest area that the penalty of a contact point assumes if updates close its gap slowly, relative to the area of a
/// side of its cell, [-].
pub(super) const MIN_AREA: f64 = 0.1;
/// Fractions of the distance from a corner to its material point at which a cell for the corner is sought.
const INWARDS: [f64; 5] = [1e-6, 0.25, 0.5, 0.75, 1.0];

/// A contact point on a body that may touch a tool in the current step.
#[derive(Debug, Clone)]
pub(super) struct Candidate<const D: usize> {
    pub(super) key: Key,
    pub(super) body: usize,
    /// Position at the start of the step, [length].
    pub(super) start: [f64; D],
    /// Active nodes, with the values of their basis functions at this position: their shares in the motion of the
    /// contact point, less those in the motion of the facet of another body that it touches.
    pub(super) basis: Carriers,
    /// True if the surface of the tool is flat over all domains that share the contact point.
    pub(super) is_flat: bool,
    /// True if the contact point is one of several, one for each face that meets in a re-entrant corner of the tool: in
    /// the step, it sees the plane of its face alone.
    pub(super) keeps_face: bool,
    /// Largest motion of the contact point if no node moves farther than 1, [-].
    pub(super) reach: f64,
    /// Area that the contact point stands for, [length²]: for unit thickness in the plane, over the full circle for
    /// bodies of revolution. 0 for a contact point whose sides other contact points bear.
    pub(super) area: f64,
    /// The outer sides of its domain that meet there.
    pub(super) outer: Outer<D>,
    /// Area that the penalty assumes, [length²].
    pub(super) bearing: f64,
    /// Size of its cell, [length].
    pub(super) size: f64,
    /// Stiffness of the cell below the contact point, ε/p_f, [force/length].
    pub(super) stiffness: f64,
    /// Penalty ε, [force/length].
    pub(super) penalty: f64,
    /// ε, [force/length], if updates close the gap slowly: contact points with hardly any area would otherwise have
    /// too small a penalty.
    pub(super) penalty_if_slow: f64,
    /// L, [force], if it is held for the rest of the step.
    pub(super) held: Option<f64>,
    /// The closest point on the tool at the start of the step, in global coordinates.
    pub(super) near: Closest<D>,
    /// Overlap that the contact point may keep in the step, negative for a gap, [length]; see [`allowance`].
    pub(super) allowance: f64,
    /// Permanent numbers of the other material points whose domains share this corner.
    pub(super) shared_by: Vec<u32>,
    /// The facet of another body; `None` if the contact point may touch a tool.
    pub(super) facet: Option<Box<Facet<D>>>,
    /// True if it lies on the second body of a pair of bodies.
    pub(super) is_on_second: bool,
    /// Its share of what its corner keeps from step to step, [-].
    pub(super) share: f64,
    /// The multiplier that the stresses of two bodies give, for a contact that begins between bodies under stress.
    pub(super) at_rest: Multiplier<D>,
}

impl<const D: usize> Candidate<D> {
    /// The contact points whose errors nodes average: those of one tool, or of one body of a pair.
    pub(super) fn group(&self) -> u32 {
        2 * self.key.tool + u32::from(self.is_on_second)
    }

    /// The displacement of the contact point in the step, [length].
    pub(super) fn displacement<const N: usize>(&self, delta_d: &[[f64; N]]) -> [f64; D] {
        let mut u = [0.0; D];
        for (node, value) in self.basis.iter() {
            (0..D).for_each(|d| u[d] += value * delta_d[node][d]);
        }
        u
    }

    /// True if the surface of the tool is flat over the domains, and farther away than this motion relative to the
    /// tool, [length].
    pub(super) fn is_beyond(&self, motion: f64) -> bool {
        self.is_flat && self.near.gap > motion.max(TOUCHING * self.size)
    }

    /// The area to which stresses at the contact point refer, [length²]: one without sides has that of its penalty.
    pub(super) fn area_for_stress(&self) -> f64 {
        if self.area > 0.0 { self.area } else { self.bearing }
    }

    /// True if the surface of the tool is a plane: flat over the domains, and without curvature, or one face of
    /// several.
    pub(super) fn is_at_plane(&self) -> bool {
        self.keeps_face || self.is_flat && self.near.normal_derivative == [[0.0; D]; D]
    }

    /// True if the contact point is on another side of the tool than at the start of the step.
    pub(super) fn has_turned(&self, shape: &dyn Shape<D>, moving: &Moving<D>, position: &[f64; D]) -> bool {
        let at_start = moving.end.vector_to_space(&moving.start.vector_to_tool(&self.near.normal));
        let found = moving.end.closest(shape, *position, f64::INFINITY);
        found.is_some_and(|found| dot(&found.normal, &at_start) < OTHER_SIDE)
    }

    /// The contact point, as named in an error.
    pub(super) fn place(&self, model: &Model<D>) -> ContactPlace {
        named(model, &Counterpart::new(model, self.key.tool), self.body, self.key.point, &self.start)
    }
}

/// A contact point, as named in an error.
pub(super) fn named<const D: usize>(
    model: &Model<D>,
    counterpart: &Counterpart<D>,
    body: usize,
    point: u32,
    position: &[f64; D],
) -> ContactPlace {
    let other = counterpart.name(model, body);
    let body = model.bodies[body].name.clone();
    ContactPlace { other, body, point, position: position.to_vec() }
}

/// The search for candidates at the start of a step.
pub(super) struct Search<'a, const D: usize> {
    pub(super) model: &'a Model<D>,
    pub(super) points: &'a Points<D>,
    pub(super) links: &'a Connectivity<D>,
    pub(super) tools: &'a [Moving<D>],
    /// For each body, true if it took part in the last converged step. Such a body may overlap tools, because domain
    /// updates may have left overlaps.
    pub(super) has_begun: &'a [bool],
    /// The outer sides of domains.
    pub(super) outer: &'a OuterSides,
    /// Positions on the edges of each tool.
    pub(super) edges: &'a [Edges<D>],
    /// The state of the contact points that touched at the end of the last converged step.
    pub(super) kept: &'a FxHashMap<Key, Kept<D>>,
    /// For each tool, the distance from its surface beyond which contact points under a flat part sleep in the step,
    /// [length].
    pub(super) awake: &'a [f64],
    /// Size of the smallest cell that holds a point, [length].
    pub(super) smallest: f64,
    /// Distance within which sides of bodies are sought at least, [length].
    pub(super) within: f64,
}

/// A contact point near a tool.
#[derive(Debug, Clone)]
pub(super) struct Near<const D: usize> {
    /// The material point to whose domain it belongs; `None` if another rank has this material point.
    pub(super) p: Option<usize>,
    pub(super) body: usize,
    pub(super) key: Key,
    pub(super) start: [f64; D],
    /// Size of its cell, [length].
    pub(super) size: f64,
    pub(super) closest: Closest<D>,
    /// True if the surface of the tool is flat over all domains to which the contact point belongs.
    pub(super) is_flat: bool,
    pub(super) keeps_face: bool,
    /// Area that the penalty assumes, [length²], counting only sides that lie along the tool; and all sides.
    pub(super) area: f64,
    pub(super) area_of_corner: f64,
    pub(super) outer: Outer<D>,
    pub(super) shared_by: Vec<u32>,
}

impl<const D: usize> Near<D> {
    /// Takes the contact point, leaving one without area in its place.
    pub(super) fn take(&mut self) -> Near<D> {
        let place = self.clone();
        (self.area, self.area_of_corner, self.outer) = (0.0, 0.0, Outer::default());
        place
    }

    /// Joins this corner with the same corner of another domain.
    pub(super) fn join(&mut self, other: Self) {
        self.shared_by.push(self.key.point.max(other.key.point));
        self.key = self.key.min(other.key);
        self.is_flat &= other.is_flat;
        self.area += other.area;
        self.area_of_corner += other.area_of_corner;
        self.outer.join(&other.outer);
    }
}

impl<const D: usize> Search<'_, D> {
    /// The shear moduli of the material points at rest, [stress].
    pub(super) fn moduli(&self) -> ModuliAtRest<'_, D> {
        ModuliAtRest::new(self.model, Modulus::Shear)
    }

    /// The candidate for a contact point; `None` if the contact point has no area or belongs to another rank. The
    /// penalty of the candidate follows from the stiffness of a cell of material beneath that area.
    pub(super) fn candidate(&self, place: Near<D>, moduli: &ModuliAtRest<D>) -> Option<Candidate<D>> {
        let Search { model, points, .. } = *self;
        // Corners of domains without extent along the tool transfer no force.
        let bears = place.area.max(place.area_of_corner) > 0.0;
        let Near {
            p,
            body: number,
            key,
            start,
            size,
            closest: near,
            is_flat,
            keeps_face,
            area,
            area_of_corner,
            outer,
            shared_by,
        } = place;
        let p = p.filter(|_| bears)?;
        let area = if area == 0.0 { area_of_corner } else { area };
        let basis = if key.corner % FACE == CENTRE {
            self.basis_of_point(p)
        } else if is_on_side(key.corner) {
            self.basis_on_side(p, key.corner, &start)
        } else {
            self.basis_of_corner(p, (key.corner % FACE) as usize, &start, &outer)
        };
        // Near the axis of a body of revolution, a contact point stands for hardly any area, but moves a whole cell.
        let mut in_cell = start;
        in_cell[0] = in_cell[0].max(0.5 * size);
        let side_area = size.powi(D as i32 - 1) * model.depth(&in_cell);
        // The stiffness of a half-space under a strip is between four times the shear modulus and half of that, even
        // for nearly incompressible bodies.
        let stiffness_below = 4.0 * moduli.at(points, p) / size;
        let penalty_per_area = model.tools[key.tool as usize].control.penalty * stiffness_below;
        Some(Candidate {
            key,
            body: number,
            start,
            is_flat,
            keeps_face,
            reach: basis.reach(),
            basis,
            area,
            outer,
            bearing: area,
            size,
            stiffness: stiffness_below * area,
            penalty: penalty_per_area * area,
            penalty_if_slow: penalty_per_area * area.max(MIN_AREA * side_area),
            held: None,
            near,
            allowance: 0.0,
            shared_by,
            facet: None,
            is_on_second: false,
            share: 1.0,
            at_rest: Multiplier::default(),
        })
    }

    /// The active nodes that move a material point, and S_vp.
    fn basis_of_point(&self, p: usize) -> Carriers {
        let links = self.links;
        let (nodes, mut carriers) = (links.nodes_of(links.group_of(p)), Carriers::default());
        links.for_each_value(p, |local, value| carriers.push(nodes[local], value));
        carriers
    }

    /// The active nodes that move a corner of a material point, and N_v there. On a GIMP domain, what the mean over
    /// each outer side that faces the tool differs from the mean over its corners is added, so that the forces of all
    /// corners together are those of the sides; a corner of a body that deforms uniformly moves as before.
    fn basis_of_corner(&self, p: usize, number: usize, corner: &[f64; D], outer: &Outer<D>) -> Carriers {
        let Search { model, points, .. } = *self;
        let method = model.bodies[points.body[p] as usize].method;
        let mut carriers = self.basis(p, corner, method).1;
        if method != Method::Gimp || !outer.has_any() {
            return carriers;
        }
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let corners = corners_of(points, p, &mut buffer);
        for side in sides_of_domain::<D>(corners.len()).enumerate().filter(|(k, _)| outer.faces(*k)) {
            let side = side.1;
            if side.corners().contains(&number) {
                let places: Vec<[f64; D]> = side.corners().iter().map(|&k| corners[k]).collect();
                self.add_difference(p, &places, &mut carriers);
            }
        }
        carriers
    }

    /// The active nodes that move a position on a side of a domain, and the mean of N_v over the corners of the side,
    /// weighted by their shares in the position.
    fn basis_on_side(&self, p: usize, corner: u32, x: &[f64; D]) -> Carriers {
        let (model, points) = (self.model, self.points);
        let method = model.bodies[points.body[p] as usize].method;
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let corners = corners_of(points, p, &mut buffer);
        let mut carriers = Carriers::default();
        for (k, share) in self.shares_on_side(p, corner, x) {
            for (node, value) in self.basis(p, &corners[k], method).1.iter() {
                carriers.add(node as u32, share * value);
            }
        }
        carriers
    }

    /// Adds the mean of N_v over a side of a box less its mean over the corners of this side.
    fn add_difference(&self, p: usize, side: &[[f64; D]], carriers: &mut Carriers) {
        let (grid, body) = (self.model.grid.as_ref(), self.points.body[p]);
        if lies_in_one_cell(grid, side) {
            return;
        }
        let at_corners: Vec<(Option<u32>, Carriers)> =
            side.iter().map(|corner| self.basis(p, corner, Method::Gimp)).collect();
        let Some(cells) = at_corners.iter().map(|(cell, _)| *cell).collect::<Option<Vec<u32>>>() else {
            return;
        };
        let Some(mean) = mean_over_side(grid, side, &cells, |basis| active(basis, self.links, body)) else {
            return;
        };
        mean.into_iter().for_each(|(node, value)| carriers.add(node, value));
        for (node, value) in at_corners.iter().flat_map(|(_, carriers)| carriers.iter()) {
            carriers.add(node as u32, -value / side.len() as f64);
        }
    }

    /// The active nodes that move a corner of a material point, and N_v there, with the cell whose nodes these are if
    /// all of them are active. The domain touches all cells that are tried, so each rank has the nodes for its own
    /// material points.
    pub(super) fn basis(&self, p: usize, corner: &[f64; D], method: Method) -> (Option<u32>, Carriers) {
        let (grid, points) = (self.model.grid.as_ref(), self.points);
        let (body, cell) = (points.body[p], points.cell[p]);
        let towards = minus(&points.converged.position[p], corner);
        let inwards = if method == Method::Mpm { &INWARDS[4..] } else { &INWARDS[..] };
        let carriers = |part: &f64| {
            let at =
                if *part == 1.0 { cell } else { grid.locate(&along(corner, *part, &towards), Some(cell))? };
            Some((Some(at), self.active(body, &grid.basis_at(at, corner), false)?))
        };
        // The nodes of the cell of a material point are active, or move with active nodes.
        let last = || (None, self.active(body, &grid.basis_at(cell, corner), true).unwrap_or_default());
        inwards.iter().find_map(carriers).unwrap_or_else(last)
    }

    /// A basis in terms of the active nodes that a body sees; sliver nodes move with their carriers. `None` if another
    /// node with a value is inactive, unless `is_last`.
    fn active(&self, body: u16, basis: &CellBasis<D>, is_last: bool) -> Option<Carriers> {
        let mut active = Carriers::default();
        for (&node, &value) in basis.nodes().iter().zip(basis.value()) {
            let node = node as usize;
            match self.links.seen_by(body, node) {
                Some(number) => active.add(number as u32, value),
                None => match self.links.carriers(body, node) {
                    Some(carriers) => {
                        for (number, weight) in carriers {
                            active.add(number as u32, weight * value);
                        }
                    }
                    // The contact point is on the boundary of the body: nodes beyond it have no influence.
                    None if value == 0.0 || is_last => {}
                    None => return None,
                },
            }
        }
        Some(active)
    }
}

/// Distance of the farthest corner of the domain of a material point from its position, in the converged state,
/// [length].
pub(super) fn radius_of<const D: usize>(points: &Points<D>, p: usize) -> f64 {
    let from_centre = |corner| norm(&minus(corner, &points.converged.position[p]));
    match points.corners(p) {
        [] => norm(&points.half_lengths(p)),
        corners => corners.iter().map(from_centre).fold(0.0, f64::max),
    }
}

/// The number of a tool and the index of a material point that was far from the tool at the start of the step: the
/// point has come so close that corners of its domain without a candidate may be inside the tool, or the point has
/// passed through a part of the tool.
pub(super) fn missed<const D: usize, const N: usize>(
    search: &Search<D>,
    delta_d: &[[f64; N]],
) -> Option<(usize, usize)> {
    let Search { model, points, links, tools, smallest, .. } = *search;
    let farthest = farthest::<D, N>(delta_d);
    let is_slow = |(tool, moving): (&Tool<D>, &Moving<D>)| {
        let most = tool.control.largest_slide * smallest;
        moving.translation().is_some_and(|moved| farthest + moved <= most)
    };
    // No point moves farther than the nodes.
    if model.tools.iter().zip(tools).all(is_slow) {
        return None;
    }
    let enters = |(nodes, p): (&[u32], usize)| {
        let body = points.body[p] as usize;
        let start = points.converged.position[p];
        let mut end = start;
        links.for_each_value(p, |local, value| {
            let du = &delta_d[nodes[local] as usize];
            (0..D).for_each(|d| end[d] += value * du[d]);
        });
        let size = model.grid.size(points.cell[p] as usize);
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        model.tools.iter().zip(tools).position(|(tool, moving)| {
            let reach = tool.control.largest_slide * size;
            let path = [moving.start.to_tool(&start), moving.end.to_tool(&end)];
            if tool.interface_with(body).is_none() || norm(&minus(&path[0], &path[1])) <= reach {
                return false;
            }
            let (corners, radius) = (corners_of(points, p, &mut buffer), radius_of(points, p));
            let seen = reach + moving.prescribed_reach(&start, radius);
            let is_seen = |corner: &[f64; D]| {
                let found = moving.start.closest(tool.shape.as_ref(), *corner, f64::INFINITY);
                found.is_some_and(|found| found.gap <= seen)
            };
            tool.shape.first_contact(path[0], path[1]).is_some() && !is_seen(&start)
                || tool.shape.closest_within(path[1], radius).is_some() && !corners.iter().all(is_seen)
        })
    };
    let groups = (0..links.n_groups()).into_par_iter();
    let first = |group: usize| {
        links.points_of(group).find_map(|p| enters((links.nodes_of(group), p)).map(|tool| (tool, p)))
    };
    groups.filter_map(first).min_by_key(|(_, p)| *p)
}

/// Path length over which the overlap of a contact point vanishes in one step, and falls to 1/e or less in many steps,
/// relative to the size of a cell, [-]. With half this length, the force on a pipe in clay differs by 1.1 % instead of
/// 0.7 % from the mean of the forces in the steps before and after, and is 1 % smaller.
const WAY: f64 = 2.0;

/// Largest gap that a contact point may keep, relative to the size of a cell, [-].
const MAX_GAP: f64 = 0.1;

/// Overlap that a contact point may keep, [length]; negative for a gap, which only a contact point that `bears` may
/// keep. Its gap at the start of the step is `gap`, the size of its cell is `size`, and in the previous step it moved by
/// `motion` and ended with an `excess` over its allowance, all [length]. Updates of the multipliers have left the excess
/// and may remove it now.
pub(super) fn allowance(gap: f64, size: f64, motion: f64, excess: f64, bears: bool) -> f64 {
    let least = if bears { -MAX_GAP * size } else { 0.0 };
    (-gap - excess).max(least) * (1.0 - motion / (WAY * size)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlap_ends_along_the_way() {
        assert_eq!(allowance(0.2, 1.0, 0.0, 0.0, false), 0.0);
        assert_eq!(allowance(-1e-3, 1.0, 0.0, 1e-3, false), 0.0);
        assert_eq!(allowance(-0.2, 2.0, 2.0, 0.1, false), 0.05);
        assert_eq!(allowance(-0.2, 1.0, 2.0, 0.0, false), 0.0);
        assert_eq!(allowance(0.02, 1.0, 1.0, 0.0, true), -0.01);
        assert_eq!(allowance(0.3, 1.0, 0.0, 0.0, true), -0.1);
        // Many small steps remove as much overlap as a few larger steps, except for second-order terms.
        let after = |steps: usize| {
            (0..steps).fold(0.1, |overlap, _| allowance(-overlap, 1.0, 1.0 / steps as f64, 0.0, false))
        };
        assert!((after(1000) - 0.1 * (-0.5f64).exp()).abs() < 1e-4 && after(10) < after(1000));
    }

    #[test]
    fn contact_points_at_rest_keep_their_overlap() {
        assert_eq!((0..100).fold(0.1, |overlap, _| allowance(-overlap, 1.0, 0.0, 0.0, false)), 0.1);
    }
}
