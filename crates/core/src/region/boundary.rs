//! The boundary of a region, divided into flat facets.

use std::collections::HashMap;

use super::vector::{along, cross, minus, norm, unit};
use super::{Motion, Node, Primitive, Region};
use crate::grid::Axis;

/// Distance from the centre of a facet at which its two sides are examined, relative to the size of the facet, [-]. It
/// exceeds the height of an arc above its chord, at most 0.033 of the chord, and the height of a sphere above a facet,
/// at most 0.0991 of its longest edge.
const ASIDE: f64 = 0.1;

/// A flat piece of a boundary: a segment in the plane, a triangle in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facet<const D: usize> {
    /// Corners, [length]. In the boundary of a region, the normal of [`area_vector`] points out of the region.
    pub corners: [[f64; D]; D],
    /// Side of the primitive to which the facet belongs, numbered from 0.
    pub side: usize,
}

impl<const D: usize> Facet<D> {
    /// The mean of the corners, [length].
    pub fn centre(&self) -> [f64; D] {
        std::array::from_fn(|d| self.corners.iter().map(|corner| corner[d]).sum::<f64>() / D as f64)
    }

    /// The same facet seen from the other side.
    pub(crate) fn turned(mut self) -> Self {
        self.corners.swap(0, 1);
        self
    }

    fn moved(self, motion: &Motion<D>) -> Self {
        Facet { corners: self.corners.map(|corner| motion.apply(&corner)), ..self }
    }

    /// The part of the facet where a function, linear in the position, is not negative, as facets in the same
    /// orientation. The facet stays whole, or is left out, if this changes the function by at most `slack`.
    pub(crate) fn above(&self, height: impl Fn(&[f64; D]) -> f64, slack: f64) -> Vec<Self> {
        let heights = self.corners.each_ref().map(height);
        if heights.iter().all(|h| *h >= -slack) {
            return vec![*self];
        }
        if heights.iter().all(|h| *h <= slack) {
            return Vec::new();
        }
        let mut kept: Vec<[f64; D]> = Vec::with_capacity(D + 1);
        for k in 0..D {
            let next = (k + 1) % D;
            let [h, h_next] = [heights[k], heights[next]];
            if h >= 0.0 {
                kept.push(self.corners[k]);
            }
            if h * h_next < 0.0 && (D > 2 || k == 0) {
                let way = minus(&self.corners[next], &self.corners[k]);
                kept.push(along(&self.corners[k], h / (h - h_next), &way));
            }
        }
        let facet = |second: usize| {
            let corners = std::array::from_fn(|k| kept[if k == 0 { 0 } else { second + k - 1 }]);
            Facet { corners, side: self.side }
        };
        (1..=kept.len() + 1 - D).map(facet).collect()
    }

    /// The parts of the facet between the grid lines of an axis; lines within `slack`, [length], of its ends do not
    /// cut it.
    pub(crate) fn cut_along(self, d: usize, axis: &Axis, slack: f64) -> Vec<Self> {
        let ends = self.corners.map(|corner| corner[d]);
        let [low, high] = [
            ends.iter().copied().fold(f64::INFINITY, f64::min),
            ends.into_iter().fold(f64::NEG_INFINITY, f64::max),
        ];
        let (mut parts, mut rest) = (Vec::new(), vec![self]);
        let first = axis.cell_of(axis.coordinate(low)) + 1;
        for line in (first..axis.n_cells()).map(|number| axis.line(number)) {
            if line >= high - slack {
                break;
            }
            if line > low + slack {
                parts.extend(rest.iter().flat_map(|facet| facet.above(|x| line - x[d], slack)));
                rest = rest.iter().flat_map(|facet| facet.above(|x| x[d] - line, slack)).collect();
            }
        }
        parts.extend(rest);
        parts
    }

    /// Length of the longest edge, [length].
    pub(crate) fn size(&self) -> f64 {
        let from = |k: usize| norm(&minus(&self.corners[(k + 1) % D], &self.corners[k]));
        (0..D).map(from).fold(0.0, f64::max)
    }
}

/// Normal of a facet times its area (length in the plane), [length^(D−1)]. In the plane, the normal points to the right
/// of the path from the first corner to the second; in space, it follows the right-hand rule.
pub fn area_vector<const D: usize>(corners: &[[f64; D]; D]) -> [f64; D] {
    let mut area = [0.0; D];
    if D == 2 {
        let edge = minus(&corners[1], &corners[0]);
        (area[0], area[1]) = (edge[1], -edge[0]);
    } else if D == 3 {
        let edge = |k: usize| -> [f64; 3] { std::array::from_fn(|d| corners[k][d] - corners[0][d]) };
        let twice = cross(&edge(1), &edge(2));
        area = std::array::from_fn(|d| 0.5 * twice[d]);
    }
    area
}

/// Derivative of [`area_vector`] with respect to the position of corner `k`, `[i][j]`, [length^(D−2)].
pub fn area_derivative<const D: usize>(corners: &[[f64; D]; D], k: usize) -> [[f64; D]; D] {
    let mut derivative = [[0.0; D]; D];
    if D == 2 {
        let sign = if k == 1 { 1.0 } else { -1.0 };
        (derivative[0][1], derivative[1][0]) = (sign, -sign);
    } else if D == 3 {
        // A motion δ of the corner changes the area vector by ½ δ × (the edge from the previous corner to the next
        // one).
        let edge = minus(&corners[(k + 1) % D], &corners[(k + 2) % D]);
        for i in 0..D {
            let (j, l) = ((i + 1) % D, (i + 2) % D);
            derivative[i][j] = 0.5 * edge[l];
            derivative[i][l] = -0.5 * edge[j];
        }
    }
    derivative
}

/// Reason why the boundary of a region cannot be divided into facets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoBoundary {
    /// The region is or contains a group of cells.
    #[error("the boundary of a group of cells in a union, intersection or difference is not available")]
    Cells,
    /// The side number refers to a union, intersection or difference, or exceeds the number of sides.
    #[error("the shape of the body has no edge {0}")]
    NoSide(usize),
    /// There would be too many facets.
    #[error("it would be divided into more than {MAX_FACETS} pieces")]
    TooMany,
}

/// Largest number of facets of a boundary.
pub const MAX_FACETS: usize = 10_000_000;

impl<const D: usize> Region<D> {
    /// The boundary as facets whose edges are at most `spacing` long, [length]; on spheres, at most 1.6 times as long.
    /// Arcs become chords.
    ///
    /// In unions, intersections and differences, a facet of a primitive belongs to the boundary if the region lies on
    /// exactly one side of the facet at its centre: where primitives cross, the boundary is exact up to the size of a
    /// facet.
    ///
    /// # Errors
    /// [`NoBoundary`].
    pub fn boundary(&self, spacing: f64) -> Result<Vec<Facet<D>>, NoBoundary> {
        if self.has_groups() {
            return Err(NoBoundary::Cells);
        }
        let (mut all, mut too_many) = (Vec::new(), false);
        self.each_primitive(&mut |primitive, motion| {
            let spacing = spacing / motion.scale();
            too_many |= about(primitive, spacing) > MAX_FACETS as f64;
            if !too_many {
                let facets = primitive.facets(spacing).into_iter();
                all.extend(facets.map(|facet| facet.moved(motion)));
            }
        });
        if too_many || all.len() > MAX_FACETS {
            return Err(NoBoundary::TooMany);
        }
        Ok(all.into_iter().filter_map(|facet| self.outward(facet)).collect())
    }

    /// True if the region is a single primitive, whose sides are numbered.
    pub fn has_numbered_sides(&self) -> bool {
        matches!(self.node, Node::Primitive(..))
    }

    pub(super) fn has_groups(&self) -> bool {
        match &self.node {
            Node::Primitive(..) => false,
            Node::Group(..) => true,
            Node::Union(parts) | Node::Intersection(parts) => parts.iter().any(Self::has_groups),
            Node::Difference(from, minus) => from.has_groups() || minus.iter().any(Self::has_groups),
        }
    }

    /// The facet with its normal pointing out of the region; `None` if it does not lie on the boundary.
    pub(super) fn outward(&self, facet: Facet<D>) -> Option<Facet<D>> {
        let area = area_vector(&facet.corners);
        let (size, length) = (facet.size(), norm(&area));
        if length == 0.0 {
            return None;
        }
        let normal = area.map(|x| x / length);
        let contains = |distance: f64| self.contains(&along(&facet.centre(), distance * size, &normal));
        match (contains(-ASIDE), contains(ASIDE)) {
            (true, false) => Some(facet),
            (false, true) => Some(facet.turned()),
            _ => None,
        }
    }
}

/// Facets with indexed corners: the corner positions in the order of their first use, and for each corner of each facet
/// the index of its position. Corners with equal coordinates count as one corner. There must be fewer than 2³² corners.
pub(crate) fn indexed<const D: usize>(facets: &[[[f64; D]; D]]) -> (Vec<[f64; D]>, Vec<[u32; D]>) {
    let mut numbers: HashMap<[u64; D], u32> = HashMap::new();
    let mut places = Vec::new();
    let mut number = |x: [f64; D]| {
        // Adding zero turns −0 into +0.
        let x = x.map(|x| x + 0.0);
        *numbers.entry(x.map(f64::to_bits)).or_insert_with(|| {
            places.push(x);
            (places.len() - 1) as u32
        })
    };
    let corners = facets.iter().map(|corners| corners.map(&mut number)).collect();
    (places, corners)
}

/// Number of equal parts, each at most `spacing` long, into which a length is divided.
pub(crate) fn parts(length: f64, spacing: f64) -> usize {
    ((length / spacing - 1e-9).ceil() as usize).max(1)
}

/// Number of chords of a circle with this radius; a multiple of 4, so that symmetric halves and quarters consist of
/// whole chords.
pub(crate) fn chords(radius: f64, spacing: f64) -> usize {
    parts(std::f64::consts::TAU * radius, spacing).max(24).next_multiple_of(4)
}

/// Facets of a side of a cell; `corners` are the corners of the side in cyclic order. The edges of the facets are at
/// most `spacing` long, [length]. The side is a segment in the plane, a triangle or a quadrilateral in space; for other
/// numbers of corners, there are no facets.
pub fn divided<const D: usize>(corners: &[[f64; D]], spacing: f64, side: usize) -> Vec<Facet<D>> {
    match corners {
        [a, b] => divide(a, b, spacing, side),
        [a, b, c] => triangle([a, b, c], spacing, side),
        [a, b, c, d] => {
            let longest = |pairs: [[&[f64; D]; 2]; 2]| {
                pairs.iter().map(|[from, to]| norm(&minus(to, from))).fold(0.0, f64::max)
            };
            let n = parts(longest([[a, b], [d, c]]), spacing);
            let m = parts(longest([[a, d], [b, c]]), spacing);
            let at = |i: usize, j: usize| -> [f64; D] {
                let (s, t) = (i as f64 / n as f64, j as f64 / m as f64);
                std::array::from_fn(|k| {
                    (1.0 - s) * ((1.0 - t) * a[k] + t * d[k]) + s * ((1.0 - t) * b[k] + t * c[k])
                })
            };
            crossed_quadrilaterals(n, m, &at, side)
        }
        _ => Vec::new(),
    }
}

/// Segments of a straight side in the plane; empty in space.
pub(super) fn divide<const D: usize>(a: &[f64; D], b: &[f64; D], spacing: f64, side: usize) -> Vec<Facet<D>> {
    let edge = minus(b, a);
    let n = parts(norm(&edge), spacing);
    let at = |k: usize| if k == n { *b } else { along(a, k as f64 / n as f64, &edge) };
    (0..n).filter_map(|k| segment(at(k), at(k + 1), side)).collect()
}

/// Chords of a circle in the plane; empty in space.
pub(super) fn circle<const D: usize>(
    centre: &[f64; D],
    radius: f64,
    spacing: f64,
    side: usize,
) -> Vec<Facet<D>> {
    let n = chords(radius, spacing);
    let at = |k: usize| {
        let [s, c] = sine_and_cosine_of_part(k % n, n);
        let mut place = *centre;
        place[0] += radius * c;
        place[1 % D] += radius * s;
        place
    };
    (0..n).filter_map(|k| segment(at(k), at(k + 1), side)).collect()
}

/// Sine and cosine of k/n of a full turn; exact for quarter turns.
pub(super) fn sine_and_cosine_of_part(k: usize, n: usize) -> [f64; 2] {
    let quarters = (4 * k).is_multiple_of(n).then(|| 4 * k / n);
    match quarters {
        Some(0) => [0.0, 1.0],
        Some(1) => [1.0, 0.0],
        Some(2) => [0.0, -1.0],
        Some(3) => [-1.0, 0.0],
        _ => (std::f64::consts::TAU * k as f64 / n as f64).sin_cos().into(),
    }
}

fn segment<const D: usize>(a: [f64; D], b: [f64; D], side: usize) -> Option<Facet<D>> {
    (D == 2).then(|| Facet { corners: std::array::from_fn(|k| if k == 0 { a } else { b }), side })
}

/// Triangles of a parallelogram in space with this corner and these edges; empty in the plane.
pub(super) fn parallelogram<const D: usize>(
    corner: &[f64; D],
    edges: [&[f64; D]; 2],
    spacing: f64,
    side: usize,
) -> Vec<Facet<D>> {
    let [n, m] = edges.map(|edge| parts(norm(edge), spacing));
    let at = |i: usize, j: usize| {
        along(&along(corner, i as f64 / n as f64, edges[0]), j as f64 / m as f64, edges[1])
    };
    crossed_quadrilaterals(n, m, &at, side)
}

/// Four triangles, around the mean of the corners, for each cell of a grid of n × m cells in space; empty in the plane.
/// The pattern is symmetric, and a bilinear function has the same mean over the corners of the triangles as over the
/// cell.
fn crossed_quadrilaterals<const D: usize>(
    n: usize,
    m: usize,
    at: &dyn Fn(usize, usize) -> [f64; D],
    side: usize,
) -> Vec<Facet<D>> {
    let mut facets = Vec::new();
    for corners in corners_of_cells(n, m, at) {
        let middle = std::array::from_fn(|d| 0.25 * corners.iter().map(|corner| corner[d]).sum::<f64>());
        facets.extend((0..4).filter_map(|k| triangle_of(corners[k], corners[(k + 1) % 4], middle, side)));
    }
    facets
}

/// The corners, in cyclic order, of each cell of a grid of n × m cells.
fn corners_of_cells<const D: usize>(
    n: usize,
    m: usize,
    at: &dyn Fn(usize, usize) -> [f64; D],
) -> impl Iterator<Item = [[f64; D]; 4]> {
    let cells = (0..n).flat_map(move |i| (0..m).map(move |j| (i, j)));
    cells.map(move |(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
}

/// Two triangles for each cell of a curved grid of n × m cells in space, without triangles that have shrunk to a line;
/// empty in the plane.
pub(crate) fn quadrilaterals<const D: usize>(
    n: usize,
    m: usize,
    at: &dyn Fn(usize, usize) -> [f64; D],
    side: usize,
) -> Vec<Facet<D>> {
    let mut facets = Vec::new();
    for corners in corners_of_cells(n, m, at) {
        for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
            let [a, b, c] = [corners[a], corners[b], corners[c]];
            facets.extend((a != b && b != c && c != a).then(|| triangle_of(a, b, c, side)).flatten());
        }
    }
    facets
}

/// A triangle in space, divided evenly; empty in the plane.
pub(super) fn triangle<const D: usize>(corners: [&[f64; D]; 3], spacing: f64, side: usize) -> Vec<Facet<D>> {
    let [a, b, c] = corners;
    let (ab, ac) = (minus(b, a), minus(c, a));
    let longest = [norm(&ab), norm(&ac), norm(&minus(c, b))].into_iter().fold(0.0, f64::max);
    let n = parts(longest, spacing);
    let at = |i: usize, j: usize| along(&along(a, i as f64 / n as f64, &ab), j as f64 / n as f64, &ac);
    let mut facets = Vec::new();
    for (i, j) in (0..n).flat_map(|i| (0..n - i).map(move |j| (i, j))) {
        facets.extend(triangle_of(at(i, j), at(i + 1, j), at(i, j + 1), side));
        if i + j + 1 < n {
            facets.extend(triangle_of(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), side));
        }
    }
    facets
}

fn triangle_of<const D: usize>(a: [f64; D], b: [f64; D], c: [f64; D], side: usize) -> Option<Facet<D>> {
    (D == 3).then(|| Facet { corners: std::array::from_fn(|k| [a, b, c][k.min(2)]), side })
}

/// Number of facets of a convex primitive, up to a factor, estimated from its extents.
fn about<const D: usize>(primitive: &dyn Primitive<D>, spacing: f64) -> f64 {
    let extent = |d: usize| {
        let [low, high] = primitive.extent(&unit(d));
        high - low
    };
    let largest = (0..D).map(extent).fold(0.0, f64::max);
    4.0 * D as f64 * (largest / spacing).powi(D as i32 - 1)
}
