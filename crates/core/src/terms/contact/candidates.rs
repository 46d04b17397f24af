//! The places on the bodies that may touch a tool in a step: the corners of the domains of the points near it.
//!
//! | Method | Places | Motion in the step |
//! |---|---|---|
//! | GIMP | corners of the box x_p ± l_p | N_v of the cell that holds the corner |
//! | CPDI1 | corners of the domain | the same |
//! | CPDI2 | the same, once where domains share them | the same |
//! | MPM | corners of the box x_p ± l_p, or x_p where the point has no box | N_v of the cell of the point, continued |
//! | all | x_p, so that thin tools meet a place between the corners | S_vp |
//!
//! Corners inside the body are places, too: surfaces of the body that have come together may open again. The area of a place is
//! its share of the side of the domain that lies along the tool, and of boxes its share of the side of a cube of their volume.
//!
//! A corner on the border of cells belongs to the cell towards its point. Where a node of its cell is inactive, the next
//! cell towards the point is taken, and its basis is continued to the corner.

use std::collections::HashMap;

use rayon::prelude::*;

use super::error::{ContactError, ContactPlace};
use super::motion::{Moving, in_space};
use crate::basis::{Connectivity, Method};
use crate::grid::{CellBasis, MAX_CORNERS};
use crate::material::shear_modulus_at_rest;
use crate::model::{Model, Tool};
use crate::points::{PIECE, Points};
use crate::region::vector::{along, cross, dot, minus, norm};
use crate::tool::{Closest, Shape};

/// Cosine of the angle between the normals of a place at the start of a step and now, inside the tool, beyond which it has
/// come to another side, [-]. A place may slide around a corner of more than 60 degrees in one step.
pub(super) const OTHER_SIDE: f64 = -0.5;

/// Overlap or gap at the start of a step within which surfaces count as touching, relative to the size of a cell, [-].
pub(super) const TOUCHING: f64 = 1e-6;
/// Distance within which corners of domains are shared, relative to the size of a cell, [-].
const SHARED: f64 = 1e-8;
/// Largest sine of the angle between the surface of a tool and the edges of a side of a domain that lies along it, [-]: of the
/// domains around a corner, those that touch the tool with the corner only bear no part of its area.
const ALONG: f64 = 0.5;
/// Least area of a place for its penalty if updates close it slowly, relative to a side of its cell, [-].
const LEAST_AREA: f64 = 0.1;
/// Parts of the way from a corner to its point at which a cell for it is sought.
const INWARDS: [f64; 5] = [1e-6, 0.25, 0.5, 0.75, 1.0];

/// Number of the place at the position of a point that has corners, too.
pub(super) const CENTRE: u32 = MAX_CORNERS as u32;

/// A place that keeps its multipliers from step to step: a tool and a corner of the domain of a point, or [`CENTRE`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Key {
    pub(super) tool: u32,
    /// Permanent number of the point.
    pub(super) point: u32,
    pub(super) corner: u32,
}

/// A place on a body that may touch a tool in the present step.
#[derive(Debug, Clone)]
pub(super) struct Candidate<const D: usize> {
    pub(super) key: Key,
    pub(super) body: usize,
    /// Position at the start of the step, [length].
    pub(super) start: [f64; D],
    /// Active nodes and their basis functions there.
    pub(super) basis: Carriers,
    /// Area that the place stands for, [length²]: per unit thickness in the plane, on the full circle for bodies of
    /// revolution.
    pub(super) area: f64,
    /// The area if no side of a domain lies along the tool: its share of the most parallel side, [length²].
    pub(super) area_of_corner: f64,
    /// Size of its cell, [length].
    pub(super) size: f64,
    /// ε, [force/length].
    pub(super) penalty: f64,
    /// ε once updates have closed the place slowly: places that stand for next to nothing have too little otherwise,
    /// [force/length].
    pub(super) penalty_if_slow: f64,
    /// The closest point at the start of the step, in space.
    pub(super) near: Closest<D>,
    /// Overlap that it may keep in the step, [length]; see [`super::allowance`].
    pub(super) allowance: f64,
    /// Permanent numbers of the further points whose domains share this corner.
    pub(super) shared_by: Vec<u32>,
}

/// The active nodes that carry a place, with their basis functions there: N_v, and S_vp at the position of a point.
#[derive(Debug, Clone, Default)]
pub(super) struct Carriers {
    nodes: Vec<u32>,
    value: Vec<f64>,
}

impl Carriers {
    pub(super) fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    pub(super) fn value(&self) -> &[f64] {
        &self.value
    }

    fn push(&mut self, node: u32, value: f64) {
        self.nodes.push(node);
        self.value.push(value);
    }
}

impl<const D: usize> Candidate<D> {
    /// Its displacement in the step, [length].
    pub(super) fn displacement<const N: usize>(&self, delta_d: &[[f64; N]]) -> [f64; D] {
        let mut u = [0.0; D];
        for (&node, value) in self.basis.nodes().iter().zip(self.basis.value()) {
            (0..D).for_each(|d| u[d] += value * delta_d[node as usize][d]);
        }
        u
    }

    /// True if it is on another side of the tool than at the start of the step.
    pub(super) fn has_turned(&self, shape: &dyn Shape<D>, moving: &Moving<D>, position: &[f64; D]) -> bool {
        let at_start = moving.end.vector_to_space(&moving.start.vector_to_tool(&self.near.normal));
        let found = moving.end.closest(shape, *position, f64::INFINITY);
        found.is_some_and(|found| dot(&found.normal, &at_start) < OTHER_SIDE)
    }

    /// The place as an error names it.
    pub(super) fn place(&self, model: &Model<D>) -> ContactPlace {
        named(model, &model.tools[self.key.tool as usize], self.body, self.key.point, &self.start)
    }
}

/// A place as an error names it.
pub(super) fn named<const D: usize>(
    model: &Model<D>,
    tool: &Tool<D>,
    body: usize,
    point: u32,
    position: &[f64; D],
) -> ContactPlace {
    let body = model.bodies[body].name.clone();
    ContactPlace { tool: tool.name.clone(), body, point, position: position.to_vec() }
}

/// The search for candidates at the start of a step.
pub(super) struct Search<'a, const D: usize> {
    pub(super) model: &'a Model<D>,
    pub(super) points: &'a Points<D>,
    pub(super) links: &'a Connectivity<D>,
    pub(super) tools: &'a [Moving<D>],
    /// For each body, true if it has taken part in a step before: it may then overlap tools by what the motion of its
    /// domains has left.
    pub(super) has_begun: &'a [bool],
}

impl<const D: usize> Search<'_, D> {
    /// The candidates, in the order of the points.
    ///
    /// # Errors
    /// [`ContactError::Overlap`] for a body that begins inside a tool.
    pub(super) fn run(&self) -> Result<Vec<Candidate<D>>, ContactError> {
        let of_point = |p: usize| {
            let mut found = Vec::new();
            let outcome = self.near_point(p, &mut found);
            outcome.err().map(Err).into_iter().chain(found.into_iter().map(Ok))
        };
        let all: Vec<Result<Candidate<D>, ContactError>> =
            (0..self.points.len()).into_par_iter().with_min_len(PIECE).flat_map_iter(of_point).collect();
        let mut found = self.without_shared(all.into_iter().collect::<Result<_, _>>()?);
        for candidate in found.iter_mut().filter(|candidate| candidate.area == 0.0) {
            candidate.area = candidate.area_of_corner;
        }
        // Corners of domains that are flat along the tool, and bear nothing.
        found.retain(|candidate| candidate.area > 0.0);
        self.set_penalties(&mut found);
        Ok(found)
    }

    /// Sets the penalties by the stiffness of a cell below the area of a place.
    fn set_penalties(&self, candidates: &mut [Candidate<D>]) {
        let model = self.model;
        // 4G: the stiffness of a half space under a strip is between it and half of it, also for nearly incompressible bodies.
        let moduli: Vec<f64> =
            model.materials.iter().map(|m| 4.0 * shear_modulus_at_rest(m.law.as_ref())).collect();
        for candidate in candidates {
            // Beside the axis of a body of revolution, a place stands for next to no area, but moves a whole cell.
            let mut in_cell = candidate.start;
            in_cell[0] = in_cell[0].max(0.5 * candidate.size);
            let of_cell = candidate.size.powi(D as i32 - 1) * model.depth(&in_cell);
            let penalty = model.tools[candidate.key.tool as usize].control.penalty;
            let of_area = penalty * moduli[model.bodies[candidate.body].material] / candidate.size;
            candidate.penalty = of_area * candidate.area;
            candidate.penalty_if_slow = of_area * candidate.area.max(LEAST_AREA * of_cell);
        }
    }

    fn near_point(&self, p: usize, found: &mut Vec<Candidate<D>>) -> Result<(), ContactError> {
        let Search { model, points, .. } = *self;
        let number = points.body[p] as usize;
        let body = &model.bodies[number];
        let x = &points.converged.position[p];
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let mut corners: &[[f64; D]] = &[];
        let mut radius = 0.0;
        for (k, (tool, moving)) in model.tools.iter().zip(self.tools).enumerate() {
            if tool.interface_with(number).is_none() {
                continue;
            }
            if corners.is_empty() {
                corners = corners_of(points, p, &mut buffer);
                radius = corners.iter().map(|corner| norm(&minus(corner, x))).fold(0.0, f64::max);
            }
            let size = model.grid.size(points.cell[p] as usize);
            let reach = tool.control.largest_slide * size + moving.prescribed_reach(x, radius);
            // A point deep inside a tool is far from its surface, too.
            let limit = if self.has_begun[number] { reach + radius } else { f64::INFINITY };
            let Some(of_point) = moving.start.closest(tool.shape.as_ref(), *x, limit) else { continue };
            if of_point.gap > reach + radius {
                continue;
            }
            let centre = (corners.len() > 1).then_some((CENTRE as usize, x));
            for (corner, start) in corners.iter().enumerate().chain(centre) {
                let Some(near) = moving.start.closest(tool.shape.as_ref(), *start, f64::INFINITY) else {
                    continue;
                };
                if near.gap > reach {
                    continue;
                }
                if near.gap < -TOUCHING * size && !self.has_begun[number] {
                    let place = named(model, tool, number, points.id[p], start);
                    return Err(ContactError::Overlap { place, overlap: -near.gap });
                }
                let [area, area_of_corner] = match Vertex::of(points.corners(p), corner) {
                    None => {
                        let share = model.volume(points, p) / model.depth(x);
                        [share.powf((D - 1) as f64 / D as f64) / (1usize << (D - 1)) as f64; 2]
                    }
                    Some(vertex) => {
                        let (area, steepness) = vertex.area(&near.normal);
                        [if steepness < ALONG { area } else { 0.0 }, area]
                    }
                };
                let depth = model.depth(x);
                found.push(Candidate {
                    key: Key { tool: k as u32, point: points.id[p], corner: corner as u32 },
                    body: number,
                    start: *start,
                    basis: if corner == CENTRE as usize {
                        self.basis_of_point(p)
                    } else {
                        self.basis(start, x, points.cell[p], body.method)
                    },
                    area: depth * area,
                    area_of_corner: depth * area_of_corner,
                    size,
                    penalty: 0.0,
                    penalty_if_slow: 0.0,
                    near,
                    allowance: 0.0,
                    shared_by: Vec::new(),
                });
            }
        }
        Ok(())
    }

    /// The active nodes that move a point, and S_vp.
    fn basis_of_point(&self, p: usize) -> Carriers {
        let links = self.links;
        // The last group that begins at or before the point.
        let (mut group, mut beyond) = (0, links.n_groups());
        while beyond - group > 1 {
            let middle = usize::midpoint(group, beyond);
            *(if links.points_of(middle).start <= p { &mut group } else { &mut beyond }) = middle;
        }
        let (nodes, mut carriers) = (links.nodes_of(group), Carriers::default());
        links.for_each_value(p, |local, value| carriers.push(nodes[local], value));
        carriers
    }

    /// The active nodes that move a corner, and N_v there.
    fn basis(&self, corner: &[f64; D], x: &[f64; D], cell: u32, method: Method) -> Carriers {
        let grid = self.model.grid.as_ref();
        let towards = minus(x, corner);
        let inwards = if method == Method::Mpm { &INWARDS[4..] } else { &INWARDS[..] };
        let of_cell = |part: &f64| {
            let at =
                if *part == 1.0 { cell } else { grid.locate(&along(corner, *part, &towards), Some(cell))? };
            self.active(&grid.basis_at(at, corner), false)
        };
        let found = inwards.iter().find_map(of_cell);
        // The nodes of the cell of a point are active, or carried by others.
        found.or_else(|| self.active(&grid.basis_at(cell, corner), true)).unwrap_or_default()
    }

    /// A basis with the numbers of active nodes; `None` if a node is inactive. Nodes with carriers count if `is_last`.
    fn active(&self, basis: &CellBasis<D>, is_last: bool) -> Option<Carriers> {
        let mut active = Carriers::default();
        for (&node, &value) in basis.nodes().iter().zip(basis.value()) {
            let node = node as usize;
            match self.links.active_number(node) {
                Some(number) => active.push(number as u32, value),
                // A place on the border of the body: nodes beyond have no part in it.
                None if value == 0.0 => {}
                None if is_last => {
                    if let Some(number) = self.links.moves_with(node) {
                        active.push(number as u32, value);
                    }
                }
                None => return None,
            }
        }
        Some(active)
    }

    /// Joins the corners that domains share.
    fn without_shared(&self, all: Vec<Candidate<D>>) -> Vec<Candidate<D>> {
        let is_shared = |body: usize| self.model.bodies[body].method == Method::Cpdi2;
        if !self.model.bodies.iter().any(|body| body.method == Method::Cpdi2) {
            return all;
        }
        // Cells of different size share corners, too.
        let size = all.iter().map(|candidate| candidate.size).fold(f64::INFINITY, f64::min);
        let mut places: HashMap<(u32, usize, [i64; D]), Vec<u32>> = HashMap::new();
        let mut kept: Vec<Candidate<D>> = Vec::with_capacity(all.len());
        for candidate in all {
            if !is_shared(candidate.body) || candidate.key.corner == CENTRE {
                kept.push(candidate);
                continue;
            }
            let width = 1e3 * SHARED * size;
            let lattice = |x: &[f64; D]| x.map(|x| (x / width).floor() as i64);
            let at = |key: [i64; D]| (candidate.key.tool, candidate.body, key);
            // A place near the border of a cell of the lattice is entered in all cells around it.
            let near: Vec<[i64; D]> = (0..1usize << D)
                .map(|k| {
                    let sign = |d: usize| if k >> d & 1 == 1 { 1.0 } else { -1.0 };
                    lattice(&std::array::from_fn(|d| candidate.start[d] + sign(d) * SHARED * size))
                })
                .collect();
            let is_same =
                |other: &&u32| norm(&minus(&kept[**other as usize].start, &candidate.start)) <= SHARED * size;
            let of_lattice = places.get(&at(lattice(&candidate.start)));
            if let Some(&other) = of_lattice.and_then(|others| others.iter().find(is_same)) {
                let other = &mut kept[other as usize];
                other.shared_by.push(other.key.point.max(candidate.key.point));
                other.key = other.key.min(candidate.key);
                other.area += candidate.area;
                other.area_of_corner += candidate.area_of_corner;
                continue;
            }
            for key in near {
                let entries = places.entry(at(key)).or_default();
                if entries.last() != Some(&(kept.len() as u32)) {
                    entries.push(kept.len() as u32);
                }
            }
            kept.push(candidate);
        }
        kept
    }
}

/// A corner of a domain given by corners, and the edges that meet there.
struct Vertex<const D: usize> {
    /// From the corner to those at the other ends of its edges, [length].
    edges: [[f64; D]; D],
    /// Number of corners of each side of the domain.
    of_side: usize,
}

impl<const D: usize> Vertex<D> {
    /// `None` for a point whose domain is not given by corners.
    fn of(corners: &[[f64; D]], corner: usize) -> Option<Self> {
        let start = corners.get(corner)?;
        let is_box = corners.len() == 1 << D;
        let other = |k: usize| if is_box { corner ^ 1 << k } else { k + usize::from(k >= corner) };
        let edges = std::array::from_fn(|k| minus(&corners[other(k)], start));
        Some(Vertex { edges, of_side: if is_box { 1 << (D - 1) } else { D } })
    }

    /// Its share of the side that is most parallel to the surface with this normal, seen along the normal, [length^(D−1)], and
    /// the largest sine of the angle between an edge of that side and the surface.
    fn area(&self, normal: &[f64; D]) -> (f64, f64) {
        let slope = |e: &[f64; D]| dot(e, normal).abs() / norm(e);
        let steepest = (0..D).max_by(|&a, &b| slope(&self.edges[a]).total_cmp(&slope(&self.edges[b])));
        let side: Vec<&[f64; D]> = (0..D).filter(|k| Some(*k) != steepest).map(|k| &self.edges[k]).collect();
        let steepness = side.iter().map(|e| slope(e)).fold(0.0, f64::max);
        let whole = match side[..] {
            [a, b] => {
                let of_parallelogram = dot(&in_space(normal), &cross(&in_space(a), &in_space(b))).abs();
                if self.of_side == D { 0.5 * of_parallelogram } else { of_parallelogram }
            }
            [e] => norm(&along(e, -dot(e, normal), normal)),
            _ => 0.0,
        };
        (whole / self.of_side as f64, steepness)
    }
}

/// The corners of the domain of a point in the converged state.
pub(super) fn corners_of<'a, const D: usize>(
    points: &'a Points<D>,
    p: usize,
    buffer: &'a mut [[f64; D]; MAX_CORNERS],
) -> &'a [[f64; D]] {
    let corners = points.corners(p);
    if !corners.is_empty() {
        return corners;
    }
    let (x, l) = (&points.converged.position[p], points.half_lengths(p));
    if l == [0.0; D] {
        buffer[0] = *x;
        return &buffer[..1];
    }
    for (k, corner) in buffer.iter_mut().enumerate().take(1 << D) {
        *corner = std::array::from_fn(|d| x[d] + if k >> d & 1 == 1 { l[d] } else { -l[d] });
    }
    &buffer[..1 << D]
}

/// A point far from a tool at the start of the step that has come so near to it, or through a part of it, that corners of its
/// domain without a candidate may be inside: the number of the tool and of the point.
pub(super) fn missed<const D: usize, const N: usize>(
    search: &Search<D>,
    delta_d: &[[f64; N]],
) -> Option<(usize, usize)> {
    let Search { model, points, links, tools, .. } = *search;
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
            let corners = corners_of(points, p, &mut buffer);
            let radius = corners.iter().map(|corner| norm(&minus(corner, &start))).fold(0.0, f64::max);
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
