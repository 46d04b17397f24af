//! Contact points where a sharp corner or edge of a tool meets an outer side of a domain between its corners.
//!
//! Corners of domains do not feel a tool that is smaller than a side, or sharp. A position on the edge of a tool that
//! lies above or below a side therefore has a contact point on this side: it moves with the side, and touches the plane
//! through the position that is parallel to the side. It is left out where a corner of the side meets the tool no
//! later, unless it has touched already.

use crate::grid::MAX_CORNERS;
use crate::region::around;
use crate::region::vector::{along, cross, dot, minus, norm};
use crate::surface::{DomainSide, corners_of, sides_of_domain};
use crate::tool::Closest;

use super::candidates::{Near, Search, TOUCHING};
use super::key::{FACE, FIRST_SIDE, Key};
use super::motion::in_space;
use super::outer::Outer;

/// Depth of an edge below a side, relative to the size of a cell, down to which it acts on the side, [-].
const DEEPEST: f64 = 0.25;
/// Distance from the corners of a side, relative to its size, within which its corners alone touch the tool, [-].
const AT_CORNER: f64 = 1e-3;
/// Distance of a corner of a side from the tool, relative to the size of a cell, up to which it stands for the side,
/// [-].
const AT_TOOL: f64 = 0.05;
/// Distance relative to the size of a cell at which the shape of the tool around an edge is explored, [-].
const NEARBY: f64 = 1e-3;
/// A side of a domain, with its corners.
struct Side<const D: usize> {
    corners: Vec<[f64; D]>,
    centre: [f64; D],
    /// Outward unit normal.
    normal: [f64; D],
    /// Area, [length^(D−1)].
    area: f64,
}

impl<const D: usize> Side<D> {
    fn new(side: &DomainSide, domain: &[[f64; D]]) -> Option<Self> {
        let (area, corners) = (side.area(domain), side.corners().iter().map(|&k| domain[k]).collect());
        let size = norm(&area);
        let normal = area.map(|a| a / size);
        (size > 0.0).then(|| Side { corners, centre: side.centre(domain), normal, area: size })
    }

    /// The shares of the corners in a position on the side; `None` beside the side, or at one of its corners.
    fn shares(&self, x: &[f64; D]) -> Option<Vec<f64>> {
        let shares = match self.corners[..] {
            [a, b] => {
                let edge = minus(&b, &a);
                let t = dot(&minus(x, &a), &edge) / dot(&edge, &edge);
                vec![1.0 - t, t]
            }
            [a, b, c] => self.in_triangle(x, [a, b, c]).to_vec(),
            [a, b, c, d] => {
                let [first, second, third] = self.in_triangle(x, [a, b, c]);
                if second >= 0.0 {
                    vec![first, second, third, 0.0]
                } else {
                    let [first, third, last] = self.in_triangle(x, [a, c, d]);
                    vec![first, 0.0, third, last]
                }
            }
            _ => return None,
        };
        let is_inside = shares.iter().all(|share| *share >= 0.0 && *share <= 1.0 - AT_CORNER);
        is_inside.then_some(shares)
    }

    /// The barycentric coordinates of a position in a triangle of the side.
    fn in_triangle(&self, x: &[f64; D], [a, b, c]: [[f64; D]; 3]) -> [f64; 3] {
        let n = in_space(&self.normal);
        let twice = |p: &[f64; D], q: &[f64; D], r: &[f64; D]| {
            dot(&cross(&in_space(&minus(q, p)), &in_space(&minus(r, p))), &n)
        };
        let whole = twice(&a, &b, &c);
        [twice(x, &b, &c) / whole, twice(x, &c, &a) / whole, twice(x, &a, &b) / whole]
    }
}

/// A contact point on a side, before it is known whether it counts.
struct OnSide<const D: usize> {
    near: Closest<D>,
    start: [f64; D],
}

impl<const D: usize> Search<'_, D> {
    /// Adds the contact points at which edges of a tool meet the outer sides of a material point; `reach` is the
    /// largest distance that a contact point may move in the step, and `at_corners` are the gaps of the corners,
    /// [length].
    pub(super) fn edges_on_sides(
        &self,
        p: usize,
        tool: usize,
        reach: f64,
        at_corners: &[Option<Closest<D>>],
        found: &mut Vec<Near<D>>,
    ) {
        let Search { model, points, outer, edges, kept, .. } = *self;
        let (mask, edges) = (outer.of_point(points.id[p]), &edges[tool]);
        let number = points.body[p] as usize;
        if mask == 0 || edges.is_empty() {
            return;
        }
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let corners = corners_of(points, p, &mut buffer);
        let size = model.grid.size(points.cell[p] as usize);
        for (k, side) in sides_of_domain::<D>(corners.len()).enumerate().filter(|(k, _)| mask >> k & 1 == 1) {
            let [low, high] = around(&side.corners().iter().map(|&k| corners[k]).collect::<Vec<_>>());
            let bounds = [low.map(|x| x - reach), high.map(|x| x + reach)];
            let near = edges.within(&bounds);
            let Some(whole) = (!near.is_empty()).then(|| Side::new(&side, corners)).flatten() else {
                continue;
            };
            let gaps = side.corners().iter().filter_map(|&corner| at_corners[corner].as_ref());
            let gap = gaps.map(|found| found.gap).fold(f64::INFINITY, f64::min);
            for (edge, x) in near {
                let key = Key {
                    tool: tool as u32,
                    point: points.id[p],
                    corner: FIRST_SIDE + k as u32 + FACE * edge as u32,
                };
                let Some(OnSide { near, start }) = self.edge_on_side(tool, &whole, &x, reach, size) else {
                    continue;
                };
                // A corner of the side touches the tool, or meets it no later.
                if gap <= near.gap.max(0.0) + AT_TOOL * size && !kept.contains_key(&key) {
                    continue;
                }
                // What overlaps at the start is reported by the corners of domains.
                if near.gap < -TOUCHING * size && !self.has_begun[number] {
                    continue;
                }
                let share = whole.area / side.corners().len() as f64 * model.depth(&whole.centre);
                found.push(Near {
                    p: Some(p),
                    body: number,
                    key,
                    start,
                    size,
                    closest: near,
                    is_flat: false,
                    keeps_face: true,
                    area: 0.0,
                    area_of_corner: share,
                    outer: Outer::default(),
                    shared_by: Vec::new(),
                });
            }
        }
    }

    /// The contact point at which a position on an edge of a tool meets a side; `None` if it is too far from the side,
    /// or if a face of the tool meets the side instead.
    fn edge_on_side(
        &self,
        tool: usize,
        side: &Side<D>,
        x: &[f64; D],
        reach: f64,
        size: f64,
    ) -> Option<OnSide<D>> {
        let shares = side.shares(x)?;
        // A side with four corners need not be plane.
        let start: [f64; D] = std::array::from_fn(|d| {
            shares.iter().zip(&side.corners).map(|(share, corner)| share * corner[d]).sum()
        });
        let gap = dot(&minus(x, &start), &side.normal);
        if gap > reach || gap < -DEEPEST * size {
            return None;
        }
        let (shape, moving) = (self.model.tools[tool].shape.as_ref(), &self.tools[tool]);
        let closest = |x: [f64; D]| moving.start.closest(shape, x, f64::INFINITY);
        let normal = side.normal.map(|n| -n);
        let distance = NEARBY * size;
        // Towards the side, the edge is the closest part of the tool.
        let beyond = closest(along(x, distance, &normal))?;
        if norm(&minus(&beyond.point, x)) > 1e-3 * distance {
            return None;
        }
        let near = Closest { gap, normal, point: *x, part: beyond.part, normal_derivative: [[0.0; D]; D] };
        Some(OnSide { near, start })
    }

    /// The shares of the corners of the domain of a material point in a position on one of its sides.
    pub(super) fn shares_on_side(&self, p: usize, corner: u32, x: &[f64; D]) -> Vec<(usize, f64)> {
        let mut buffer = [[0.0; D]; MAX_CORNERS];
        let corners = corners_of(self.points, p, &mut buffer);
        let number = (corner % FACE - FIRST_SIDE) as usize;
        let Some(side) = sides_of_domain::<D>(corners.len()).nth(number) else { return Vec::new() };
        let shares = Side::new(&side, corners).and_then(|whole| whole.shares(x)).unwrap_or_default();
        side.corners().iter().copied().zip(shares).filter(|(_, share)| *share != 0.0).collect()
    }
}
