//! The contact points between two bodies; in the plane: corners of one body over sides of the other.
//!
//! The outer sides of both bodies that face each other are divided where a corner of either body lies over a side of the
//! other and, for GIMP domains, where they cross a line of the grid. Between these places the functions that carry both
//! bodies are linear along the sides, so that the trapezium rule integrates a uniform pressure over both as the rule of
//! each basis does: it is in equilibrium with a uniform stress in both bodies, however their domains lie. Each place is
//! a contact point, with half of the length of the pieces beside it: a corner of either body touches the facet of the
//! other body that it lies over, so that no corner passes through a side. See [`super::facing_in_space`] for space.

use rustc_hash::FxHashMap;

use crate::basis::Method;
use crate::grid::MAX_CORNERS;
use crate::model::ModuliAtRest;
use crate::region::vector::{along, dot, minus, norm};
use crate::region::{BoxTree, around};
use crate::surface::{Places, corners_of, crossings, sides_of_domain};
use crate::terms::failure::ContactError;
use crate::tool::Closest;

use super::body_side::{AT_END, PlaceOnSides, Side};
use super::candidates::{Candidate, MIN_AREA, Search, named};
use super::carriers::Carriers;
use super::counterpart::Counterpart;
use super::facet::Facet;
use super::facing_in_space::Overlap;
use super::interface::Multiplier;
use super::key::{FACE, FIRST_SIDE, Key};
use super::outer::Outer;
use super::sides::SidePiece;

/// Largest cosine of the angle between the outward normals of two sides that face each other, [-].
const FACING: f64 = -0.5;
/// Depth of a contact point below a side, relative to the size of a cell, down to which it may touch this side, [-].
const DEEPEST: f64 = 0.6;
/// Overlap with which two bodies may begin, relative to the size of a cell, [-]: by up to a quarter of a cell, the boxes of
/// either reach beyond an oblique boundary with two points along each side of a cell.
const AT_START: f64 = 0.5;
const _: () = assert!(AT_START < DEEPEST);
/// Factor on the distance within which positions coincide (see [`Places`]) for corners of domains that are one, [-].
const SAME_CORNER: f64 = 1e3;
/// Facets count as one for a contact point if the cosine of the angle between their normals differs from 1 by less, [-].
const SAME_PLANE: f64 = 1e-12;

/// The contact points between two bodies.
struct Found<'a, const D: usize> {
    candidates: &'a mut Vec<Candidate<D>>,
    /// The contact points of each corner or side, as indices into the candidates.
    known: FxHashMap<Key, Vec<usize>>,
    /// The pieces of the surface between the bodies.
    pieces: &'a mut Vec<Piece<D>>,
}

impl<const D: usize> Found<'_, D> {
    /// Adds a contact point of the corner or side with this key.
    fn push(&mut self, key: Key, candidate: Candidate<D>) -> usize {
        self.known.entry(key).or_default().push(self.candidates.len());
        self.candidates.push(candidate);
        self.candidates.len() - 1
    }
}

/// A piece of the surface between two bodies: the index of its contact point, its centre, [length], and its area,
/// [length²].
struct Piece<const D: usize> {
    candidate: usize,
    centre: [f64; D],
    area: f64,
}

/// Where a contact point on one side faces another side.
struct Meeting<'a, const D: usize> {
    /// The side of the contact point, and the one that it faces.
    sides: [&'a Side<D>; 2],
    /// Its position, and that on the other side, [length].
    x: [f64; D],
    foot: [f64; D],
    /// Distance along the normal of the other side, [length].
    gap: f64,
    /// The nodes that carry both positions.
    own: Carriers,
    beyond: Carriers,
}

impl<const D: usize> Search<'_, D> {
    /// Adds the contact points between bodies to the candidates; the result are the pieces of the surfaces between them.
    ///
    /// # Errors
    /// [`ContactError::Overlap`] for two bodies of which one begins inside the other.
    pub(super) fn between_bodies(
        &self,
        candidates: &mut Vec<Candidate<D>>,
    ) -> Result<Vec<SidePiece<D>>, ContactError> {
        let pairs = || self.model.contacts.iter().enumerate().filter(|(_, pair)| pair.interface.is_some());
        if pairs().next().is_none() {
            return Ok(Vec::new());
        }
        let moduli = self.moduli();
        let in_contact = |body: usize| pairs().any(|(_, pair)| pair.bodies.contains(&body));
        let sides: Vec<Vec<Side<D>>> = (0..self.model.bodies.len())
            .map(|body| if in_contact(body) { self.sides_of_body(body, &moduli) } else { Vec::new() })
            .collect();
        let (first, mut pieces) = (candidates.len(), Vec::new());
        for (number, pair) in pairs() {
            let found = Found { candidates, known: FxHashMap::default(), pieces: &mut pieces };
            self.between(number, pair.bodies.map(|body| sides[body].as_slice()), found)?;
        }
        take_shares(&mut candidates[first..]);
        let of_surface = |piece: Piece<D>| {
            SidePiece::between_bodies(&candidates[piece.candidate], piece.centre, piece.area)
        };
        Ok(pieces.into_iter().map(of_surface).collect())
    }

    /// The outer sides of a body.
    fn sides_of_body(&self, body: usize, moduli: &ModuliAtRest<D>) -> Vec<Side<D>> {
        let Search { model, points, outer, .. } = *self;
        let method = model.bodies[body].method;
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let mut sides = Vec::new();
        for p in (0..points.len()).filter(|&p| points.body[p] as usize == body) {
            let mask = outer.of_point(points.id[p]);
            if mask == 0 {
                continue;
            }
            let corners = corners_of(points, p, &mut buffer);
            let size = model.grid.size(points.cell[p] as usize);
            for (number, side) in
                sides_of_domain::<D>(corners.len()).enumerate().filter(|(k, _)| mask >> k & 1 == 1)
            {
                let area = side.area(corners);
                let length = norm(&area);
                if length.is_nan() || length <= 0.0 {
                    continue;
                }
                let places: Vec<[f64; D]> = side.corners().iter().map(|&k| corners[k]).collect();
                sides.push(Side {
                    p,
                    number,
                    owners: side.corners().iter().map(|&k| (points.id[p], k as u32)).collect(),
                    carriers: places.iter().map(|x| self.basis(p, x, method).1).collect(),
                    corners: places,
                    normal: area.map(|a| a / length),
                    size,
                    stiffness: 4.0 * moduli.at(points, p) / size,
                    method,
                });
            }
        }
        // Neighbouring domains share corners: the one of the material point with the lowest number stands for all.
        let mut places = Places::new(SAME_CORNER * self.smallest);
        let numbers: Vec<Vec<u32>> =
            sides.iter().map(|side| side.corners.iter().map(|x| places.number(x)).collect()).collect();
        let mut owner: FxHashMap<u32, (u32, u32)> = FxHashMap::default();
        for (side, numbers) in sides.iter().zip(&numbers) {
            for (own, number) in side.owners.iter().zip(numbers) {
                owner.entry(*number).and_modify(|first| *first = (*first).min(*own)).or_insert(*own);
            }
        }
        for (side, numbers) in sides.iter_mut().zip(&numbers) {
            side.owners = numbers.iter().map(|number| owner[number]).collect();
        }
        sides
    }

    /// Adds the contact points between two bodies.
    fn between(
        &self,
        pair: usize,
        [first, second]: [&[Side<D>]; 2],
        mut found: Found<D>,
    ) -> Result<(), ContactError> {
        let Search { model, .. } = *self;
        let number = model.tools.len() + pair;
        let boxes: Vec<_> = second.iter().map(|side| around(&side.corners)).collect();
        let tree = BoxTree::new(&boxes);
        for side in first {
            let reach = self.reach(number, side.size);
            let [low, high] = around(&side.corners);
            let is_near = |[other_low, other_high]: &[[f64; D]; 2]| {
                (0..D).all(|d| low[d] - reach <= other_high[d] && other_low[d] <= high[d] + reach)
            };
            let mut near: Vec<usize> = Vec::new();
            tree.visit(is_near, |item| near.push(tree.order[item] as usize));
            near.sort_unstable();
            for other in near.into_iter().map(|k| &second[k]) {
                if dot(&side.normal, &other.normal) > FACING {
                    continue;
                }
                if D == 2 {
                    self.add_in_plane(number, [side, other], &mut found)?;
                } else {
                    self.add_in_space(number, [side, other], &mut found)?;
                }
            }
        }
        Ok(())
    }

    /// Adds the contact points between two sides in the plane.
    fn add_in_plane(
        &self,
        number: usize,
        [side, other]: [&Side<D>; 2],
        found: &mut Found<D>,
    ) -> Result<(), ContactError> {
        let model = self.model;
        let lines = |a: &[f64; D], b: &[f64; D]| crossings(model.grid.as_ref(), a, b);
        for ends in side.places_over(other, &lines).windows(2) {
            let [a, b] = [ends[0], ends[1]];
            let middle = side.position(0.5 * (a.first + b.first));
            let area = 0.5 * (b.first - a.first) * norm(&side.edge()) * model.depth(&middle);
            for (place, beyond) in [(a, b), (b, a)] {
                let Some(candidate) = self.add(number, [side, other], place, area, found)? else { continue };
                let centre = side.position(0.75 * place.first + 0.25 * beyond.first);
                found.pieces.push(Piece { candidate, centre, area });
            }
        }
        Ok(())
    }

    /// Adds the contact point between two sides in space.
    fn add_in_space(
        &self,
        number: usize,
        [side, other]: [&Side<D>; 2],
        found: &mut Found<D>,
    ) -> Result<(), ContactError> {
        let carried = |side: &Side<D>, x: &[f64; D]| self.basis(side.p, x, side.method).1;
        let Some(overlap) = side.overlap(other, self.model.grid.as_ref(), &carried) else { return Ok(()) };
        let Overlap { area, positions: [x, foot], carriers: [own, beyond], gap } = overlap;
        let corner = FIRST_SIDE + side.number as u32;
        let key = Key { tool: number as u32, point: self.points.id[side.p], corner };
        let meeting = Meeting { sides: [side, other], x, foot, gap, own, beyond };
        if !self.is_within_reach(&meeting, number)? {
            return Ok(());
        }
        let forming = found.known.get(&key).map_or(0, Vec::len);
        let numbered = Key { corner: corner + FACE * forming as u32, ..key };
        if let Some(candidate) = self.on_facet(numbered, meeting) {
            let candidate = found.push(key, Candidate { area, ..candidate });
            found.pieces.push(Piece { candidate, centre: x, area });
        }
        Ok(())
    }

    /// True if a contact point may touch the side that it faces in the step.
    ///
    /// # Errors
    /// [`ContactError::Overlap`] if one of two bodies begins inside the other.
    fn is_within_reach(&self, meeting: &Meeting<D>, number: usize) -> Result<bool, ContactError> {
        let Search { model, points, .. } = *self;
        let Meeting { sides: [own, other], x, gap, .. } = meeting;
        let pair = Counterpart::new(model, number as u32);
        let size = own.size.min(other.size);
        if *gap > self.reach(number, size) || *gap < -DEEPEST * size {
            return Ok(false);
        }
        let bodies = [own, other].map(|side| points.body[side.p] as usize);
        let has_begun = bodies.iter().all(|body| self.has_begun[*body]);
        if *gap < -AT_START * size && !has_begun {
            let place = named(model, &pair, bodies[0], points.id[own.p], x);
            return Err(ContactError::Overlap { place, overlap: -gap });
        }
        Ok(true)
    }

    /// Distance up to which sides of bodies may touch in a step, [length].
    fn reach(&self, number: usize, size: f64) -> f64 {
        self.within.max(Counterpart::new(self.model, number as u32).control().largest_slide * size)
    }

    /// Adds an area to the contact point at a place on two sides, which is new if there is none; its index, or `None` if
    /// it cannot touch.
    fn add(
        &self,
        number: usize,
        sides: [&Side<D>; 2],
        place: PlaceOnSides,
        area: f64,
        found: &mut Found<D>,
    ) -> Result<Option<usize>, ContactError> {
        let corners = [Side::<D>::corner_at(place.first), Side::<D>::corner_at(place.second)];
        // A corner touches the other side; a crossing with a line of the grid is a place on the first side.
        let (own, other, at) = match corners {
            [None, Some(_)] => (sides[1], sides[0], place.second),
            _ => (sides[0], sides[1], place.first),
        };
        let x = own.position(at);
        let gap = dot(&minus(&x, &other.corners[0]), &other.normal);
        let foot = along(&x, -gap, &other.normal);
        let size = own.size.min(other.size);
        let (point, corner) = Side::<D>::corner_at(at)
            .map_or((self.points.id[own.p], FIRST_SIDE + own.number as u32), |corner| own.owners[corner]);
        let key = Key { tool: number as u32, point, corner };
        let is_same = |k: &&usize| {
            let candidate = &found.candidates[**k];
            dot(&candidate.near.normal, &other.normal) > 1.0 - SAME_PLANE
                && norm(&minus(&candidate.start, &x)) <= AT_END * size
        };
        let forming = found.known.get(&key).map_or(&[][..], Vec::as_slice);
        if let Some(&same) = forming.iter().find(is_same) {
            found.candidates[same].area += area;
            return Ok(Some(same));
        }
        let numbered = Key { corner: corner + FACE * forming.len() as u32, ..key };
        let on_own = match Side::<D>::corner_at(at) {
            Some(corner) => own.carriers[corner].clone(),
            None => self.carriers_at(own, at),
        };
        let beyond = self.carriers_at(other, other.fraction(&foot));
        let meeting = Meeting { sides: [own, other], x, foot, gap, own: on_own, beyond };
        if !self.is_within_reach(&meeting, number)? {
            return Ok(None);
        }
        let candidate = self.on_facet(numbered, meeting);
        Ok(candidate.map(|candidate| found.push(key, Candidate { area, ..candidate })))
    }

    /// The nodes that carry a position on a side in the plane, given as a fraction of the side.
    fn carriers_at(&self, side: &Side<D>, fraction: f64) -> Carriers {
        match side.method {
            Method::Gimp => self.basis(side.p, &side.position(fraction), side.method).1,
            _ => Carriers::mean(&side.carriers, &[1.0 - fraction, fraction]),
        }
    }

    /// A contact point that faces a side, without area.
    fn on_facet(&self, key: Key, meeting: Meeting<D>) -> Option<Candidate<D>> {
        let Search { model, points, .. } = *self;
        let Meeting { sides: [own, other], x, foot, gap, own: mut basis, beyond } = meeting;
        let size = own.size.min(other.size);
        // The nodes of the contact point, then those of the facet.
        let first = basis.len();
        let mut slopes = vec![[0.0; 2]; first];
        for (node, value) in beyond.iter() {
            basis.push(node as u32, -value);
            slopes.push([0.0; 2]);
        }
        let mut edges = [[0.0; D]; 2];
        for ((corner, carriers), shares) in other.corners.iter().zip(&other.carriers).zip(other.slopes()) {
            for (edge, share) in edges.iter_mut().zip(shares) {
                *edge = along(edge, *share, corner);
            }
            for (node, value) in carriers.iter() {
                let place = basis.place_from(first, node).unwrap_or_else(|| {
                    basis.push(node as u32, 0.0);
                    slopes.push([0.0; 2]);
                    basis.len() - 1
                });
                (0..2).for_each(|m| slopes[place][m] += shares[m] * value);
            }
        }
        let facet = Facet::new(edges, slopes, &other.normal)?;
        let normal = facet.normal()?;
        // Of two materials in series, the softer one decides.
        let series = |a: f64, b: f64| if a + b > 0.0 { a * b / (a + b) } else { 0.0 };
        let stiffness = series(own.stiffness, other.stiffness);
        let mut in_cell = x;
        in_cell[0] = in_cell[0].max(0.5 * size);
        let least = MIN_AREA * size.powi(D as i32 - 1) * model.depth(&in_cell);
        let body = points.body[own.p] as usize;
        let number = key.tool as usize - model.tools.len();
        Some(Candidate {
            key,
            body,
            start: x,
            is_flat: false,
            keeps_face: true,
            reach: basis.reach(),
            basis,
            area: 0.0,
            outer: Outer::default(),
            bearing: 0.0,
            size,
            stiffness,
            penalty: Counterpart::new(model, key.tool).control().penalty * stiffness,
            penalty_if_slow: least,
            held: None,
            near: Closest { gap, normal, point: foot, part: 0, normal_derivative: [[0.0; D]; D] },
            allowance: 0.0,
            shared_by: Vec::new(),
            facet: Some(Box::new(facet)),
            is_on_second: model.contacts[number].bodies[1] == body,
            share: 1.0,
            at_rest: self.stress_across([own.p, other.p], &normal),
        })
    }

    /// The multiplier per unit area that the mean of the Cauchy stresses of two material points gives on a side with
    /// this inward normal, [stress]; bodies under tension part.
    fn stress_across(&self, points: [usize; 2], normal: &[f64; D]) -> Multiplier<D> {
        let mut pull = [0.0; D];
        for p in points {
            let state = &self.points.converged;
            let tau = &state.kirchhoff_stress[p];
            let half = 0.5 / state.deformation_gradient[p].determinant();
            for (i, pull) in pull.iter_mut().enumerate() {
                *pull += half * (0..D).map(|j| tau.component(i, j) * normal[j]).sum::<f64>();
            }
        }
        let pressure = -dot(&pull, normal);
        if pressure > 0.0 {
            Multiplier { normal: pressure, shear: along(&pull, pressure, normal).map(|t| -t) }
        } else {
            Multiplier::default()
        }
    }
}

/// Completes contact points whose areas are known: until now, their stiffness and penalty are those of a unit area, and
/// the penalty for slow updates is the least area that it assumes. Contact points of one corner share what it keeps from
/// step to step by their areas.
fn take_shares<const D: usize>(candidates: &mut [Candidate<D>]) {
    let mut areas: FxHashMap<Key, f64> = FxHashMap::default();
    for candidate in &*candidates {
        *areas.entry(candidate.key.of_corner()).or_default() += candidate.area;
    }
    for candidate in candidates {
        let (area, whole) = (candidate.area, areas[&candidate.key.of_corner()]);
        candidate.share = if whole > 0.0 { area / whole } else { 1.0 };
        candidate.bearing = area;
        candidate.at_rest = candidate.at_rest.times(area);
        candidate.stiffness *= area;
        candidate.penalty_if_slow = candidate.penalty * area.max(candidate.penalty_if_slow);
        candidate.penalty *= area;
    }
}
