//! The areas of contact points: parts of the outer sides of domains that face a tool.
//!
//! The force of a uniform stress on a tool is the sum over the outer sides of the domains (see [`crate::surface`]), and
//! so is the area on which adhesion and tension act: the projection of each side along the normal n of the tool, −A·n.
//! Sides of boxes are taken as the deformation gradient has moved them, because boxes that stay parallel to the axes
//! cover a tilted surface with gaps or overlaps.
//!
//! Areas refer to the surface of the tool: on a side at the height g above a curved tool, they shrink by det(I − g
//! ∂n/∂x).
//!
//! Boxes cover inclined ground with staircases. Their steep sides count, too, if the next side that faces the tool
//! begins at their far end; the free side of a block does not.
//!
//! Sides are divided into pieces. A piece belongs to its corner of the side if this corner touches the tool. Often it
//! does not: where domains drift apart, as boxes and the parallelograms of CPDI1 do, one of two neighbouring corners
//! touches first and keeps the other from touching; a cell of the grid can follow a curved tool at a few corners only;
//! and where ground is stretched along a tool, corners of domains below the surface touch it. A piece then belongs to
//! the nearest contact point that touches, if the piece lies on the tool, or close to it between contact points that
//! touch.

use std::f64::consts::TAU;

use rustc_hash::FxHashMap;

use crate::grid::MAX_CORNERS;
use crate::ranks::Reduction;
use crate::region::vector::{along, cross, dot, minus, norm, unit};
use crate::surface::{DomainSide, deformed_corners, sides_of_domain};
use crate::tool::Closest;

use super::candidates::{Candidate, Search};
use super::interface::Multiplier;
use super::key::{FACE, Key};
use super::motion::in_space;
use super::outer::Outer;
use super::ranks::{Plain, gathered, plain_parts};

plain_parts!([const D: usize] SidePiece<D>, { key, body, position, corner, normal, area, lift, size, is_riser, end });
plain_parts!([const D: usize] Place<D>, { key, body, start, normal, touches, is_outer });

/// Smallest cosine of the angle between the outward normal of a side and the direction into the tool with which the
/// side faces the tool, [-].
const FACING: f64 = 0.5;
/// Smallest cosine of the same angle for the risers of a staircase of boxes, [-]; and the distance from the end of a
/// riser, relative to the size of a cell, within which the next tread begins, [-].
const RISING: f64 = 0.02;
const NEXT_TREAD: f64 = 0.3;
/// Length of the pieces of a side, relative to the size of a cell, [-], and largest number of pieces along an edge.
const PIECE: f64 = 0.25;
const MOST_PIECES: usize = 32;
/// Height above the tool up to which a piece lies on it, relative to the size of a cell, [-].
const LEVEL: f64 = 0.03;
/// Distance within which contact points that touch enclose a piece, relative to the size of a cell, [-].
const AROUND: f64 = 2.0;
/// Height above the tool of a piece that such contact points enclose up to which only the drift of domains, or the
/// grid, keeps it from touching, relative to the size of a cell, [-].
const MOST_LIFT: f64 = 0.5;
/// Largest angle between the directions to contact points that enclose a piece, [rad].
const OPEN: f64 = 0.6 * TAU;
/// Distance within which a piece has the same place as a contact point, relative to the size of a cell, [-].
const SAME: f64 = 1e-6;

/// A piece of an outer side that faces a tool.
#[derive(Debug, Clone)]
pub(super) struct SidePiece<const D: usize> {
    /// The tool, the material point, and the corner of its domain to which the piece belongs.
    key: Key,
    body: usize,
    /// Centre of the piece, [length].
    position: [f64; D],
    /// The contact point at this corner, [length].
    corner: [f64; D],
    /// The normal of the tool below the piece.
    normal: [f64; D],
    /// Area projected along this normal, [length²].
    area: f64,
    /// Distance from the surface of the tool, [length].
    lift: f64,
    /// Size of the cell of the material point, [length].
    size: f64,
    /// True if the side is steep: it counts if it is the riser of a staircase, with another side that faces the tool at
    /// its far end.
    is_riser: bool,
    /// Of a steep side, the corner that is farthest from the tool, [length].
    end: [f64; D],
}

/// The centre of a piece as weights of the corners of its side.
type Weights = [f64; 4];

/// The pieces of a side with these corners, [length].
fn pieces<const D: usize>(side: &DomainSide, domain: &[[f64; D]], size: f64) -> Vec<Weights> {
    let corner = |k: usize| domain[side.corners()[k]];
    let count = |a: usize, b: usize| {
        let pieces = norm(&minus(&corner(b), &corner(a))) / (PIECE * size);
        // An even number divides a side equally among its corners.
        2 * ((0.5 * pieces).ceil() as usize).clamp(1, MOST_PIECES / 2)
    };
    let middle = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    match side.corners().len() {
        2 => {
            let n = count(0, 1);
            (0..n).map(|k| [1.0 - middle(k, n), middle(k, n), 0.0, 0.0]).collect()
        }
        3 => vec![
            [2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0, 0.0],
            [1.0 / 6.0, 2.0 / 3.0, 1.0 / 6.0, 0.0],
            [1.0 / 6.0, 1.0 / 6.0, 2.0 / 3.0, 0.0],
        ],
        _ => {
            let (n, m) = (count(0, 1), count(0, 3));
            let weights = |k: usize| {
                let (s, t) = (middle(k % n, n), middle(k / n, m));
                [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]
            };
            (0..n * m).map(weights).collect()
        }
    }
}

/// The ratio of an area on the surface of a tool to that on the parallel surface at the height of this closest point,
/// [-]: det(I − g ∂n/∂x), 0 where the closest point is an edge.
fn on_tool<const D: usize>(near: &Closest<D>) -> f64 {
    let h = &near.normal_derivative;
    let trace: f64 = (0..D).map(|d| h[d][d]).sum();
    let minors: f64 = (0..D)
        .flat_map(|i| (0..i).map(move |j| [i, j]))
        .map(|[i, j]| h[i][i] * h[j][j] - h[i][j] * h[j][i])
        .sum();
    (1.0 - near.gap * trace + near.gap * near.gap * minors).max(0.0)
}

impl<const D: usize> SidePiece<D> {
    /// A piece at `position`, [length], of the surface between two bodies that belongs to a contact point.
    pub(super) fn between_bodies(candidate: &Candidate<D>, position: [f64; D], area: f64) -> Self {
        let Place { key, body, start, normal, .. } = Place::new(candidate, false);
        let Candidate { near, size, .. } = candidate;
        SidePiece {
            key,
            body,
            position,
            corner: start,
            normal,
            area,
            lift: near.gap,
            size: *size,
            is_riser: false,
            end: position,
        }
    }
}

impl<const D: usize> Search<'_, D> {
    /// The outer sides at the corners of a material point; their pieces that face a tool are added to `found`. `starts`
    /// are the contact points at the corners, [length].
    pub(super) fn outer_sides(
        &self,
        p: usize,
        tool: usize,
        starts: &[[f64; D]],
        found: &mut Vec<SidePiece<D>>,
    ) -> [Outer<D>; MAX_CORNERS] {
        let Search { model, points, outer, .. } = *self;
        let mut at_corners = [Outer::default(); MAX_CORNERS];
        let mask = outer.of_point(points.id[p]);
        if mask == 0 {
            return at_corners;
        }
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let corners = deformed_corners(points, p, &mut buffer);
        let (shape, moving) = (model.tools[tool].shape.as_ref(), &self.tools[tool]);
        let size = model.grid.size(points.cell[p] as usize);
        let is_box = points.corners(p).is_empty();
        for (number, side) in sides_of_domain::<D>(corners.len()).enumerate() {
            if mask >> number & 1 == 0 {
                continue;
            }
            let (whole, pieces) = (side.area(corners), pieces(&side, corners, size));
            let gap = |k: usize| {
                let found = moving.start.closest(shape, corners[k], f64::INFINITY);
                found.map_or(f64::INFINITY, |found| found.gap)
            };
            let far_end = || {
                let gaps = side.corners().iter().map(|&k| (k, gap(k)));
                gaps.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| corners[k])
            };
            let least = if is_box { RISING } else { FACING };
            let mut faces = false;
            for weights in &pieces {
                let place = |d: usize| {
                    side.corners().iter().zip(weights).map(|(&k, weight)| weight * corners[k][d]).sum()
                };
                let position: [f64; D] = std::array::from_fn(place);
                let Some(near) = moving.start.closest(shape, position, f64::INFINITY) else { continue };
                let projected = -dot(&whole, &near.normal);
                if projected < least * norm(&whole) {
                    continue;
                }
                let is_riser = projected < FACING * norm(&whole);
                faces |= !is_riser;
                let nearest = (0..side.corners().len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b]));
                let corner = side.corners()[nearest.unwrap_or(0)];
                let Some(&start) = starts.get(corner) else { continue };
                found.push(SidePiece {
                    key: Key { tool: tool as u32, point: points.id[p], corner: corner as u32 },
                    body: points.body[p] as usize,
                    position,
                    corner: start,
                    normal: near.normal,
                    area: model.depth(&near.point) * projected * on_tool(&near) / pieces.len() as f64,
                    lift: near.gap,
                    size,
                    is_riser,
                    end: is_riser.then(far_end).flatten().unwrap_or(position),
                });
            }
            for &corner in side.corners() {
                at_corners[corner].add(number, faces, &whole);
            }
        }
        at_corners
    }
}

/// A contact point to which pieces may belong.
struct Place<const D: usize> {
    key: Key,
    body: usize,
    start: [f64; D],
    /// The normal of the tool there at the start of the step.
    normal: [f64; D],
    /// True if it touched the tool at the end of the last step.
    touches: bool,
    /// True if it belongs to an outer side.
    is_outer: bool,
}

impl<const D: usize> Place<D> {
    /// The place of a contact point. Contact points of two bodies take each other's pieces: they count for the same
    /// body, and the normals of both surfaces as that of the second.
    fn new(candidate: &Candidate<D>, touches: bool) -> Self {
        let &Candidate { key, body, start, is_on_second, .. } = candidate;
        let is_between_bodies = candidate.facet.is_some();
        let sign = if is_on_second { -1.0 } else { 1.0 };
        Place {
            key,
            body: if is_between_bodies { 0 } else { body },
            start,
            normal: candidate.near.normal.map(|n| sign * n),
            touches,
            is_outer: is_between_bodies || candidate.outer.has_any(),
        }
    }
}

/// Gives the pieces of sides to contact points, whose multipliers at the start of the step tell which of them touch.
/// All ranks must call this together.
pub(super) fn share_out<const D: usize>(
    reduction: &Reduction,
    pieces: Vec<SidePiece<D>>,
    candidates: &mut [Candidate<D>],
    start: &[Multiplier<D>],
) {
    // Under tension, the multiplier is negative.
    let place = |(candidate, multiplier): (&Candidate<D>, &Multiplier<D>)| {
        Place::new(candidate, multiplier.normal != 0.0)
    };
    let places = gathered(reduction, candidates.iter().zip(start).map(place).collect());
    let pieces = without_loose_risers(gathered(reduction, pieces));
    let size = pieces.iter().map(|piece| piece.size).fold(0.0, f64::max);
    if size == 0.0 {
        return;
    }
    let lattice = Lattice::new(&places, AROUND * size);
    let mut areas: FxHashMap<Key, f64> = FxHashMap::default();
    for piece in &pieces {
        if let Some(taker) = lattice.taker(&places, piece) {
            *areas.entry(places[taker].key).or_default() += piece.area;
        }
    }
    let beside: Vec<[f64; D]> = pieces.iter().map(|piece| piece.position).collect();
    let sides = Lattice::of_positions(beside.iter().copied().enumerate(), size);
    for candidate in candidates {
        let area = areas.get(&candidate.key).copied().unwrap_or(0.0);
        let has_sides_beside = || {
            sides
                .around(&candidate.start)
                .any(|k| norm(&minus(&beside[k], &candidate.start)) <= candidate.size)
        };
        // Where no side is left, as in a cut, a contact point stands for the side of its own domain.
        if candidate.facet.is_some() || candidate.outer.has_any() || area > 0.0 || has_sides_beside() {
            candidate.area = area;
        }
    }
}

/// The pieces without those of steep sides that do not lead to the next tread of a staircase, such as the free side of
/// a block.
fn without_loose_risers<const D: usize>(mut pieces: Vec<SidePiece<D>>) -> Vec<SidePiece<D>> {
    let size = pieces.iter().map(|piece| piece.size).fold(0.0, f64::max);
    if size == 0.0 || !pieces.iter().any(|piece| piece.is_riser) {
        return pieces;
    }
    let treads: Vec<(u32, usize, [f64; D])> = (pieces.iter().filter(|piece| !piece.is_riser))
        .map(|piece| (piece.key.tool, piece.body, piece.position))
        .collect();
    let lattice = Lattice::of_positions(treads.iter().map(|tread| tread.2).enumerate(), NEXT_TREAD * size);
    pieces.retain(|piece| {
        let follows = |k: usize| {
            let (tool, body, position) = &treads[k];
            let is_same = *tool == piece.key.tool && *body == piece.body;
            is_same && norm(&minus(position, &piece.end)) <= NEXT_TREAD * piece.size
        };
        !piece.is_riser || lattice.around(&piece.end).any(follows)
    });
    pieces
}

/// Positions in the cells of a lattice.
struct Lattice<const D: usize> {
    /// Size of its cells, [length].
    width: f64,
    in_cell: FxHashMap<[i64; D], Vec<usize>>,
    by_key: FxHashMap<Key, usize>,
}

impl<const D: usize> Lattice<D> {
    /// The contact points that touch, and those at corners of outer sides.
    fn new(places: &[Place<D>], width: f64) -> Self {
        let near = places.iter().enumerate().filter(|(_, place)| place.touches || place.is_outer);
        let mut lattice = Self::of_positions(near.map(|(k, place)| (k, place.start)), width);
        lattice.by_key = places.iter().enumerate().map(|(k, place)| (place.key, k)).collect();
        lattice
    }

    fn of_positions(positions: impl Iterator<Item = (usize, [f64; D])>, width: f64) -> Self {
        let mut lattice = Lattice { width, in_cell: FxHashMap::default(), by_key: FxHashMap::default() };
        for (k, x) in positions {
            lattice.in_cell.entry(lattice.cell(&x)).or_default().push(k);
        }
        lattice
    }

    fn cell(&self, x: &[f64; D]) -> [i64; D] {
        x.map(|x| (x / self.width).floor() as i64)
    }

    /// The numbers of the positions in the cells around a position.
    fn around(&self, x: &[f64; D]) -> impl Iterator<Item = usize> {
        let cell = self.cell(x);
        let cells = (0..3usize.pow(D as u32)).filter_map(move |number| {
            let step = |d: usize| (number / 3usize.pow(d as u32) % 3) as i64 - 1;
            self.in_cell.get(&std::array::from_fn(|d| cell[d].saturating_add(step(d))))
        });
        cells.flatten().copied()
    }

    /// The contact point to which a piece belongs.
    fn taker(&self, places: &[Place<D>], piece: &SidePiece<D>) -> Option<usize> {
        let is_same = |k: usize| {
            let place = &places[k];
            place.key.tool == piece.key.tool
                && place.body == piece.body
                && dot(&place.normal, &piece.normal) > FACING
        };
        let is_here = |k: &usize| norm(&minus(&places[*k].start, &piece.corner)) <= SAME * piece.size;
        // Domains that share a corner have one contact point there, under the number of one of them.
        let shared = || self.around(&piece.corner).filter(|&k| is_same(k)).find(is_here);
        let faces = (0..D as u32).map(|face| Key { corner: piece.key.corner + FACE * face, ..piece.key });
        let known = faces.filter_map(|key| self.by_key.get(&key).copied()).find(|&k| is_same(k));
        let own = known.or_else(shared);
        if own.is_some_and(|own| places[own].touches) {
            return own;
        }
        let way = |k: usize| minus(&places[k].start, &piece.position);
        let mut near: Vec<(f64, usize)> = (self.around(&piece.position))
            .filter(|&k| places[k].touches && is_same(k))
            .map(|k| (norm(&way(k)), k))
            .filter(|(distance, _)| *distance <= AROUND * piece.size)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let Some((distance, nearest)) = near.first().copied() else { return own };
        let lies_on_it = piece.lift <= LEVEL * piece.size && distance <= piece.size;
        let tangential = |&(_, k): &(f64, usize)| along(&way(k), -dot(&way(k), &piece.normal), &piece.normal);
        let is_between =
            || piece.lift <= MOST_LIFT * piece.size && encloses(near.iter().map(tangential), &piece.normal);
        if lies_on_it || is_between() { Some(nearest) } else { own }
    }
}

/// True if directions along a surface with this normal point to all sides.
fn encloses<const D: usize>(directions: impl Iterator<Item = [f64; D]>, normal: &[f64; D]) -> bool {
    let across = (0..D).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
    let e = unit::<D>(across);
    let first = along(&e, -dot(&e, normal), normal);
    let second = cross(&in_space(normal), &in_space(&first));
    let angle = |way: [f64; D]| dot(&in_space(&way), &second).atan2(dot(&way, &first));
    let mut angles: Vec<f64> = directions.map(angle).collect();
    angles.sort_by(f64::total_cmp);
    let [Some(least), Some(most)] = [angles.first(), angles.last()] else { return false };
    let last = least + TAU - most;
    angles.windows(2).map(|pair| pair[1] - pair[0]).fold(last, f64::max) <= OPEN
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_shrink_towards_a_convex_tool() {
        use crate::region::Ball;
        use crate::tool::Shape;
        // On a parallel circle of radius 1.25 and a parallel sphere of radius 1.5 around tools of radius 1.
        let circle = Ball::new([0.0; 2], 1.0).unwrap().closest([0.75, 1.0]).unwrap();
        assert!((on_tool(&circle) - 1.0 / 1.25).abs() < 1e-12);
        let sphere = Ball::new([0.0; 3], 1.0).unwrap().closest([0.0, 1.5, 0.0]).unwrap();
        assert!((on_tool(&sphere) - 1.0 / 1.5f64.powi(2)).abs() < 1e-12);
    }

    #[test]
    fn neighbours_on_all_sides_enclose() {
        let enclosed = |ways: &[[f64; 2]]| encloses(ways.iter().copied(), &[0.0, 1.0]);
        assert!(
            enclosed(&[[1.0, 0.0], [-2.0, 0.0]]) && !enclosed(&[[1.0, 0.0], [2.0, 0.0]]) && !enclosed(&[])
        );
        let enclosed = |ways: &[[f64; 3]]| encloses(ways.iter().copied(), &[0.0, 0.0, 1.0]);
        assert!(enclosed(&[[1.0, 0.0, 0.0], [-1.0, 0.1, 0.0], [-1.0, -1.0, 0.0]]));
        assert!(!enclosed(&[[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]));
    }
}
