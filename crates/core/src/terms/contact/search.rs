//! The search for the contact points that may touch a tool in a step.

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use crate::basis::Method;
use crate::grid::MAX_CORNERS;
use crate::grid::element::Collapsed;
use crate::points::PIECE;
use crate::region::vector::{along, cross, dot, minus, norm};
use crate::surface::corners_of;
use crate::terms::failure::ContactError;
use crate::tool::{Closest, Face, facing_each_other};

use super::candidates::{Candidate, Near, Search, TOUCHING, named, radius_of};
use super::counterpart::Counterpart;
use super::key::{CENTRE, FACE, Key};
use super::motion::in_space;
use super::outer::Outer;
use super::ranks::{Failure, agreed};
use super::sides::SidePiece;

/// Distance within which domains share a corner, relative to the size of a cell, [-]; parallelograms drift apart.
const SHARED: f64 = 1e-8;
const SHARED_BY_PARALLELOGRAMS: f64 = 0.02;
/// Sine of the angle between the surface of a tool and the edges of a side of a domain up to which this side counts as
/// lying along the surface, [-]. A domain that touches the tool only with a corner adds nothing to the corner's area.
const ALONG: f64 = 0.5;
/// Cosine of the angle between normals above which the surface of a tool without edges counts as flat over a domain,
/// [-]: the radius of the surface is then many times the size of the domain.
const FLAT: f64 = 0.99;
/// Additional search distance, in cells, which lets the search skip the next material points.
const AHEAD: f64 = 4.0;

/// Distance from the faces of a re-entrant corner of a tool within which a contact point may touch all of them,
/// relative to the size of a cell, [-].
const BETWEEN_FACES: f64 = 0.25;

/// Distance from the edge of a tool within which outer sides of the body tell which of its faces they touch, relative
/// to the size of a cell, [-].
const NEAR_EDGE: f64 = 0.5;
/// Difference between the cosines of the angles at which two faces of a tool face a side, above which the side touches
/// only one of them, [-].
const BETTER: f64 = 0.2;

/// Cosine of the angle at which a face of a tool faces a side, below which the side passes this face by, [-].
const ASIDE: f64 = 0.2;
/// Distance beside a face, relative to the size of a cell, up to which a side that faces it still touches its plane,
/// [-]; for contact points that have touched the tool already, and for others. At the edge of a rough punch, corners of
/// domains stay within the tolerance of contact.
const STILL_ON_FACE: f64 = 0.05;
const ON_FACE: f64 = 1e-3;
/// Depth below the faces at an edge, relative to the size of a cell, down to which a side chooses among them, [-]; for
/// contact points that have touched the tool already, and for others.
const STILL_SHALLOW: f64 = 0.5;
const SHALLOW: f64 = 0.1;

/// A corner or the centre of a domain where it may touch a tool.
struct ContactCorner<const D: usize> {
    /// Its number in the domain, or [`CENTRE`].
    corner: usize,
    /// Its position, [length].
    start: [f64; D],
    outer: Outer<D>,
    /// True if the surface of the tool is flat over the domain.
    is_flat: bool,
}

/// A material point near a tool.
struct NearPoint<'a, const D: usize> {
    p: usize,
    tool: usize,
    corners: &'a [[f64; D]],
    /// Size of the cell of the material point, [length].
    size: f64,
    /// Largest distance that a contact point may move in the step, [length].
    reach: f64,
}

/// A position, and a lower bound on its distance from the surface of a tool, [length]; negative for a position that was
/// found inside the tool.
#[derive(Debug, Clone, Copy)]
pub(super) struct Far<const D: usize> {
    from: [f64; D],
    distance: f64,
}

/// What the search has found for a part of the material points.
#[derive(Debug, Clone, Default)]
pub(super) struct Found<const D: usize> {
    pub(super) places: Vec<Near<D>>,
    /// The pieces of outer sides that face a tool.
    pub(super) sides: Vec<SidePiece<D>>,
    candidates: Vec<Candidate<D>>,
    error: Option<ContactError>,
    /// For each tool, the last position whose distance from the tool was computed.
    far: Vec<Option<Far<D>>>,
}

impl<const D: usize> Search<'_, D> {
    /// Finds the candidates, in the order of the material points.
    ///
    /// # Errors
    /// [`ContactError::Overlap`] for a body that begins inside a tool; all ranks fail if one rank has such a body.
    pub(super) fn run(
        &self,
        pieces: &mut Vec<Found<D>>,
        candidates: &mut Vec<Candidate<D>>,
    ) -> Result<(), Failure> {
        pieces.resize_with(self.points.len().div_ceil(PIECE), Found::default);
        let in_piece = |(piece, found): (usize, &mut Found<D>)| {
            let points = piece * PIECE..((piece + 1) * PIECE).min(self.points.len());
            let mut far = std::mem::take(&mut found.far);
            far.clear();
            far.resize(self.tools.len(), None);
            found.places.clear();
            found.sides.clear();
            let mut near = points.map(|p| self.near_point(p, &mut far, found));
            let error = near.find_map(Result::err);
            (found.far, found.error) = (far, error);
        };
        pieces.par_iter_mut().enumerate().for_each(in_piece);
        let error = pieces.iter_mut().find_map(|found| found.error.take());
        agreed(self.links.reduction(), error.map_or(Ok(()), Err))?;
        self.join_shared(pieces);
        let moduli = self.moduli();
        let link = |found: &mut Found<D>| {
            found
                .candidates
                .extend(found.places.drain(..).filter_map(|place| self.candidate(place, &moduli)));
        };
        pieces.par_iter_mut().for_each(link);
        candidates.clear();
        pieces.iter_mut().for_each(|found| candidates.append(&mut found.candidates));
        let between_bodies = agreed(self.links.reduction(), self.between_bodies(candidates))?;
        if let Some(found) = pieces.first_mut() {
            found.sides.extend(between_bodies);
        }
        Ok(())
    }

    /// Adds the contact points of a material point; `far` bounds the distance of each tool from a position nearby.
    fn near_point(
        &self,
        p: usize,
        far: &mut [Option<Far<D>>],
        found: &mut Found<D>,
    ) -> Result<(), ContactError> {
        let Search { model, points, .. } = *self;
        let number = points.body[p] as usize;
        let x = &points.converged.position[p];
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let (radius, size) = (radius_of(points, p), model.grid.size(points.cell[p] as usize));
        for (k, (tool, moving)) in model.tools.iter().zip(self.tools).enumerate() {
            if tool.interface_with(number).is_none() {
                continue;
            }
            let reach = tool.control.largest_slide * size + moving.prescribed_reach(x, radius);
            if far[k].is_some_and(|far| far.distance - norm(&minus(x, &far.from)) > reach + radius) {
                continue;
            }
            // A material point deep inside a tool is also far from the surface of the tool.
            let limit = if self.has_begun[number] { reach + radius + AHEAD * size } else { f64::INFINITY };
            let closest = moving.start.closest(tool.shape.as_ref(), *x, limit);
            let distance = closest.as_ref().map_or(limit, |found| found.gap);
            far[k] = Some(Far { from: *x, distance });
            let begins = !self.has_begun[number];
            let is_near =
                |near: &Closest<D>| near.gap <= reach + radius && (begins || near.gap >= -reach - radius);
            if let Some(near) = closest.filter(is_near) {
                let corners = corners_of(points, p, &mut buffer);
                self.near_tool(&NearPoint { p, tool: k, corners, size, reach }, near, found)?;
            }
        }
        Ok(())
    }

    /// Adds those contact points of a material point that the tool may reach; `near` is the point on the tool closest
    /// to the centre of the material point.
    fn near_tool(
        &self,
        point: &NearPoint<D>,
        near: Closest<D>,
        found: &mut Found<D>,
    ) -> Result<(), ContactError> {
        let Search { model, points, .. } = *self;
        let (tool, moving) = (&model.tools[point.tool], &self.tools[point.tool]);
        let at_start = |x: &[f64; D]| moving.start.closest(tool.shape.as_ref(), *x, f64::INFINITY);
        let mut at_corners = [None; MAX_CORNERS];
        at_corners.iter_mut().zip(point.corners).for_each(|(found, corner)| *found = at_start(corner));
        let at_corners = &mut at_corners[..point.corners.len()];
        let is_parallel = |found: &Closest<D>| dot(&found.normal, &near.normal) > FLAT;
        let is_flat =
            !tool.shape.has_edges() && at_corners.iter().all(|found| found.as_ref().is_some_and(is_parallel));
        let asleep = if is_flat { self.awake[point.tool] } else { f64::INFINITY };
        let outer = self.outer_sides(point.p, point.tool, point.corners, &mut found.sides);
        for (corner, (start, at_corner)) in point.corners.iter().zip(&mut *at_corners).enumerate() {
            if let Some(near) = at_corner.filter(|found| found.gap <= asleep) {
                let place = ContactCorner { corner, start: *start, outer: outer[corner], is_flat };
                if !self.add_places(point, &place, near, found)? {
                    *at_corner = None;
                }
            }
        }
        self.edges_on_sides(point.p, point.tool, point.reach, at_corners, &mut found.places);
        // A surface that is flat over the domain meets the corners first; otherwise the centre may touch it, too.
        if point.corners.len() > 1 && !is_flat {
            let start = points.converged.position[point.p];
            let place =
                ContactCorner { corner: CENTRE as usize, start, outer: Outer::default(), is_flat: false };
            self.add_places(point, &place, near, found)?;
        }
        Ok(())
    }

    /// Adds the contact points at a corner or centre: one or, in a re-entrant corner of the tool, one for each face
    /// that the body may touch there. Beside an edge of the tool, an outer side of the body touches the plane of the
    /// face that it faces during the step: a blunt corner that slides over flat ground does not plough, and a corner of
    /// a domain at the edge of a punch does not change from the base to the side. False if the corner lies aside: it
    /// then does not stand for its sides either, which may meet the edge.
    fn add_places(
        &self,
        point: &NearPoint<D>,
        place: &ContactCorner<D>,
        near: Closest<D>,
        found: &mut Found<D>,
    ) -> Result<bool, ContactError> {
        let (tool, moving) = (&self.model.tools[point.tool], &self.tools[point.tool]);
        let x = moving.start.to_tool(&place.start);
        let faces = tool.shape.faces_near(&x, NEAR_EDGE * point.size);
        if faces.len() < 2 {
            self.add_place(point, place, near, None, found)?;
            return Ok(true);
        }
        let depth = (-near.gap).max(0.0);
        let within = |face: &&Face<D>| face.closest.gap.abs() <= BETWEEN_FACES * point.size;
        let close: Vec<Face<D>> = faces.iter().filter(within).copied().collect();
        let several = facing_each_other(&close, depth);
        for (number, face) in several.iter().enumerate() {
            self.add_place(point, place, moving.start.in_space(face), Some(number), found)?;
        }
        if !several.is_empty() {
            return Ok(true);
        }
        let towards = |normal: &[f64; D]| {
            place
                .outer
                .normals()
                .iter()
                .map(|outward| -dot(outward, normal))
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let faces: Vec<(Closest<D>, f64)> =
            faces.iter().map(|face| (moving.start.in_space(&face.closest), face.beside)).collect();
        let best = faces.iter().max_by(|a, b| towards(&a.0.normal).total_cmp(&towards(&b.0.normal))).copied();
        // Updates move the corners of boxes from one place beside the edge to another.
        let is_box = self.points.corners(point.p).is_empty();
        let has_touched = !is_box && self.kept.contains_key(&self.key(point, place, None));
        let on_face = if is_box {
            TOUCHING
        } else if has_touched {
            STILL_ON_FACE
        } else {
            ON_FACE
        };
        let deepest = if has_touched { STILL_SHALLOW } else { SHALLOW };
        let is_shallow = |found: &Closest<D>| found.gap >= -deepest * point.size;
        let is_preferred = |(face, _): &(Closest<D>, f64)| {
            let others = faces.iter().filter(|other| dot(&other.0.normal, &face.normal) < FLAT);
            let next = others.map(|other| towards(&other.0.normal)).fold(f64::NEG_INFINITY, f64::max);
            let next = if is_box { towards(&near.normal) } else { next };
            towards(&face.normal) > next + BETTER && is_shallow(face) && is_shallow(&near)
        };
        let (chosen, face) = match best.filter(is_preferred) {
            // The side does not face the closest face, and lies beside the one that it faces.
            Some((_, beside)) if beside > on_face * point.size => {
                if towards(&near.normal) < ASIDE {
                    return Ok(false);
                }
                (near, None)
            }
            Some((face, _)) => (face, Some(0)),
            None => (near, None),
        };
        self.add_place(point, place, chosen, face, found)?;
        Ok(true)
    }

    /// Identifies a contact point at a corner or centre; `face` is the number of its face, if there are several.
    fn key(&self, point: &NearPoint<D>, place: &ContactCorner<D>, face: Option<usize>) -> Key {
        let corner = place.corner as u32 + FACE * face.unwrap_or(0) as u32;
        Key { tool: point.tool as u32, point: self.points.id[point.p], corner }
    }

    /// Adds a contact point if the tool may reach it; `near` is the place on the tool that it faces, and `face` the
    /// number of the face there, if there are several.
    fn add_place(
        &self,
        point: &NearPoint<D>,
        place: &ContactCorner<D>,
        near: Closest<D>,
        face: Option<usize>,
        found: &mut Found<D>,
    ) -> Result<(), ContactError> {
        let Search { model, points, .. } = *self;
        let key = self.key(point, place, face);
        let NearPoint { p, tool, corners: _, size, reach } = *point;
        let ContactCorner { corner, start, outer, is_flat } = *place;
        let (number, x) = (points.body[p] as usize, &points.converged.position[p]);
        if near.gap > reach {
            return Ok(());
        }
        if near.gap < -TOUCHING * size && !self.has_begun[number] {
            let place = named(model, &Counterpart::Tool(&model.tools[tool]), number, points.id[p], &start);
            return Err(ContactError::Overlap { place, overlap: -near.gap });
        }
        let [area, area_of_corner] = match Vertex::new(points.corners(p), corner) {
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
        found.places.push(Near {
            p: Some(p),
            body: number,
            key,
            start,
            size,
            closest: near,
            is_flat,
            keeps_face: face.is_some(),
            area: depth * area,
            area_of_corner: depth * area_of_corner,
            outer,
            shared_by: Vec::new(),
        });
        Ok(())
    }

    /// Joins the corners that domains share; the first of them takes over the area of the others.
    fn join_shared(&self, pieces: &mut Vec<Found<D>>) {
        // CPDI1 domains share corners as long as they have not drifted apart; boxes differ in the means over their
        // sides.
        let is_shared = |body: usize| matches!(self.model.bodies[body].method, Method::Cpdi1 | Method::Cpdi2);
        if !(0..self.model.bodies.len()).any(is_shared) {
            return;
        }
        // Domains in cells of different sizes may share a corner: the smallest size decides.
        let places = pieces.iter().flat_map(|found| &found.places);
        let size =
            self.links.reduction().smallest(places.map(|place| place.size).fold(f64::INFINITY, f64::min));
        self.add_neighbours(pieces, is_shared);
        let distance = |body: usize| {
            let is_cpdi1 = self.model.bodies[body].method == Method::Cpdi1;
            size * if is_cpdi1 { SHARED_BY_PARALLELOGRAMS } else { SHARED }
        };
        let most = (0..self.model.bodies.len()).filter(|body| is_shared(*body)).map(distance);
        let width = most.fold(1e3 * SHARED * size, |most, distance| most.max(4.0 * distance));
        let lattice = |x: &[f64; D]| x.map(|x| (x / width).floor() as i64);
        // The last entry in each cell of a lattice; and for each entry, its contact point and the previous entry in the
        // same cell.
        let mut last: FxHashMap<(u32, u32, usize, [i64; D]), usize> = FxHashMap::default();
        let mut entries: Vec<([usize; 2], Option<usize>)> = Vec::new();
        for piece in 0..pieces.len() {
            for k in 0..pieces[piece].places.len() {
                let place = &pieces[piece].places[k];
                let (start, number, tool) = (place.start, place.body, place.key.tool);
                let face = place.key.corner / FACE;
                if !is_shared(number) || place.key.corner % FACE >= CENTRE {
                    continue;
                }
                let mut entry = last.get(&(tool, face, number, lattice(&start))).copied();
                let same = loop {
                    let Some(([i, j], before)) = entry.map(|entry| entries[entry]) else { break None };
                    if norm(&minus(&pieces[i].places[j].start, &start)) <= distance(number) {
                        break Some([i, j]);
                    }
                    entry = before;
                };
                if let Some([i, j]) = same {
                    let joined = pieces[piece].places[k].take();
                    pieces[i].places[j].join(joined);
                    continue;
                }
                // A contact point near the boundary of a lattice cell is entered in all cells around it.
                let mut cell_before = None;
                for corner in 0..1usize << D {
                    let sign = |d: usize| if corner >> d & 1 == 1 { 1.0 } else { -1.0 };
                    let cell = lattice(&std::array::from_fn(|d| start[d] + sign(d) * distance(number)));
                    if cell_before.replace(cell) != Some(cell) {
                        let before = last.insert((tool, face, number, cell), entries.len());
                        entries.push(([piece, k], before));
                    }
                }
            }
        }
    }
}

/// A corner of a domain that is given by its corners, with the edges that meet there.
struct Vertex<const D: usize> {
    /// From the corner to the other ends of its edges, [length]; three of four at the tip of a pyramid.
    edges: [[f64; D]; D],
    /// Number of corners of each side of the domain.
    corners_per_side: usize,
}

impl<const D: usize> Vertex<D> {
    /// The corner with this index; `None` for a centre, or for a point whose domain is not given by corners.
    fn new(corners: &[[f64; D]], corner: usize) -> Option<Self> {
        let start = corners.get(corner)?;
        let is_box = corners.len() == 1 << D;
        let collapsed = Collapsed::from_corners::<D>(corners.len());
        let other = |k: usize| match collapsed {
            Some(shape) => shape.edges_at(corner)[k],
            None if is_box => corner ^ 1 << k,
            None => k + usize::from(k >= corner),
        };
        let edges = std::array::from_fn(|k| minus(&corners[other(k)], start));
        Some(Vertex { edges, corners_per_side: if is_box { 1 << (D - 1) } else { D } })
    }

    /// The share of the corner in the side most parallel to the surface with this normal, projected along the normal,
    /// [length^(D−1)], and the largest sine of the angle between an edge of that side and the surface.
    fn area(&self, normal: &[f64; D]) -> (f64, f64) {
        let slope = |e: &[f64; D]| dot(e, normal).abs() / norm(e);
        let steepest = (0..D).max_by(|&a, &b| slope(&self.edges[a]).total_cmp(&slope(&self.edges[b])));
        let side: Vec<&[f64; D]> = (0..D).filter(|k| Some(*k) != steepest).map(|k| &self.edges[k]).collect();
        let steepness = side.iter().map(|e| slope(e)).fold(0.0, f64::max);
        let whole = match side[..] {
            [a, b] => {
                let parallelogram = dot(&in_space(normal), &cross(&in_space(a), &in_space(b))).abs();
                if self.corners_per_side == D { 0.5 * parallelogram } else { parallelogram }
            }
            [e] => norm(&along(e, -dot(e, normal), normal)),
            _ => 0.0,
        };
        (whole / self.corners_per_side as f64, steepness)
    }
}
