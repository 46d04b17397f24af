//! The contact points between two bodies in space: pieces of their outer sides that lie over each other.
//!
//! Each outer side of the first body is projected, along the normal of a side of the second body, onto that side. Where
//! both overlap is a polygon, which is a contact point: its shares c_v are the means, over the polygon, of the functions
//! that carry both sides. A uniform pressure on all polygons is therefore integrated as the rule of each basis integrates
//! it. Polygons on sides of GIMP domains are divided at the planes of the grid, between which the functions are
//! bilinear.

use crate::basis::Method;
use crate::grid::Grid;
use crate::region::vector::{along, cross, dot, minus, norm};

use super::body_side::Side;
use super::carriers::Carriers;
use super::motion::in_space;

/// Smallest area of a polygon, relative to that of a side of a cell, [-].
const SMALLEST: f64 = 1e-9;
/// Largest number of Newton's iterations for a position on a quadrilateral, and the accuracy at which they end, [-].
const ITERATIONS: usize = 20;
const ACCURACY: f64 = 1e-14;

/// A polygon over which two sides lie over each other, with the means over it.
pub(super) struct Overlap<const D: usize> {
    /// Area, [length²].
    pub(super) area: f64,
    /// Mean positions on both sides, [length].
    pub(super) positions: [[f64; D]; 2],
    /// The mean shares of the nodes that carry each side.
    pub(super) carriers: [Carriers; 2],
    /// The mean gap along the normal of the second side, [length].
    pub(super) gap: f64,
}

type Plane = [f64; 2];

impl<const D: usize> Side<D> {
    /// The polygon in which this side and another one lie over each other; `None` if they do not. `carried` gives the
    /// nodes that carry a position on the side of a GIMP domain.
    pub(super) fn overlap(
        &self,
        other: &Side<D>,
        grid: &dyn Grid<D>,
        carried: &dyn Fn(&Side<D>, &[f64; D]) -> Carriers,
    ) -> Option<Overlap<D>> {
        let normal = &other.normal;
        let axes = axes_across(normal);
        let origin = other.corners[0];
        let flat = |x: &[f64; D]| -> Plane { axes.map(|axis| dot(&minus(x, &origin), &axis)) };
        let [own, beyond] = [self, other].map(|side| side.corners.iter().map(flat).collect::<Vec<Plane>>());
        let polygon = clipped(&counterclockwise(own), &counterclockwise(beyond));
        let whole = area(&polygon);
        if whole <= SMALLEST * self.size * self.size {
            return None;
        }
        let mut pieces = vec![polygon];
        if [self.method, other.method].contains(&Method::Gimp) {
            pieces = divided(pieces, grid, &axes, &origin);
        }
        let mut mean =
            Overlap { area: 0.0, positions: [[0.0; D]; 2], carriers: Default::default(), gap: 0.0 };
        let height = dot(&minus(&self.centre(), &origin), normal);
        for piece in &pieces {
            for (place, weight) in quadrature(piece) {
                let foot = along(&along(&origin, place[0], &axes[0]), place[1], &axes[1]);
                // The place on each side along the normal.
                let shares = [self, other].map(|side| side.shares(&foot, normal, height));
                let [on_self, on_other] = [self, other].map(|side| side.corners.as_slice());
                let positions = [interpolated(on_self, &shares[0]), interpolated(on_other, &shares[1])];
                mean.area += weight;
                mean.gap += weight * dot(&minus(&positions[0], &positions[1]), normal);
                for (k, side) in [self, other].into_iter().enumerate() {
                    mean.positions[k] = along(&mean.positions[k], weight, &positions[k]);
                    let carriers = match side.method {
                        Method::Gimp => carried(side, &positions[k]),
                        _ => Carriers::mean(&side.carriers, &shares[k]),
                    };
                    mean.carriers[k].add_all(&carriers, weight);
                }
            }
        }
        let per_area = 1.0 / mean.area;
        mean.gap *= per_area;
        mean.positions = mean.positions.map(|x| x.map(|x| x * per_area));
        mean.carriers.iter_mut().for_each(|carriers| carriers.scale(per_area));
        (mean.area > 0.0).then_some(mean)
    }

    fn centre(&self) -> [f64; D] {
        interpolated(&self.corners, &vec![1.0 / self.corners.len() as f64; self.corners.len()])
    }

    /// The shares of the corners in the position on the side that lies over `foot` along `normal`.
    fn shares(&self, foot: &[f64; D], normal: &[f64; D], height: f64) -> Vec<f64> {
        let [a, b, c] = [0, 1, self.corners.len() - 1].map(|k| self.corners[k]);
        let edges = [minus(&b, &a), minus(&c, &a)];
        let start = along(foot, height, normal);
        // Newton's iterations for (ξ, η) and the distance along the normal.
        let (mut xi, mut eta) = (0.5, 0.5);
        if self.corners.len() == 3 {
            let (xi, eta) = solved(&edges, normal, &minus(&start, &a)).unwrap_or((1.0 / 3.0, 1.0 / 3.0));
            return vec![1.0 - xi - eta, xi, eta];
        }
        let [_, _, far, _] = [0, 1, 2, 3].map(|k| self.corners[k]);
        let twist: [f64; D] = std::array::from_fn(|d| a[d] - b[d] + far[d] - c[d]);
        for _ in 0..ITERATIONS {
            let at = along(&along(&along(&a, xi, &edges[0]), eta, &edges[1]), xi * eta, &twist);
            let tangents = [along(&edges[0], eta, &twist), along(&edges[1], xi, &twist)];
            let Some((dx, de)) = solved(&tangents, normal, &minus(&start, &at)) else { break };
            (xi, eta) = (xi + dx, eta + de);
            if dx.abs().max(de.abs()) < ACCURACY {
                break;
            }
        }
        vec![(1.0 - xi) * (1.0 - eta), xi * (1.0 - eta), xi * eta, (1.0 - xi) * eta]
    }
}

/// The shares of two edges in a vector, up to a part along the normal.
fn solved<const D: usize>(edges: &[[f64; D]; 2], normal: &[f64; D], vector: &[f64; D]) -> Option<(f64, f64)> {
    let [a, b, n, v] = [&edges[0], &edges[1], normal, vector].map(in_space);
    let determinant = dot(&cross(&a, &b), &n);
    let found = (dot(&cross(&v, &b), &n) / determinant, dot(&cross(&a, &v), &n) / determinant);
    (found.0.is_finite() && found.1.is_finite()).then_some(found)
}

fn interpolated<const D: usize>(corners: &[[f64; D]], shares: &[f64]) -> [f64; D] {
    corners.iter().zip(shares).fold([0.0; D], |sum, (x, share)| along(&sum, *share, x))
}

/// Two unit vectors across a normal.
fn axes_across<const D: usize>(normal: &[f64; D]) -> [[f64; D]; 2] {
    let least = (0..D).min_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
    let mut first: [f64; D] = std::array::from_fn(|d| if d == least { 1.0 } else { 0.0 });
    first = along(&first, -dot(&first, normal), normal);
    let length = norm(&first);
    first = first.map(|x| x / length);
    let second = cross(&in_space(normal), &in_space(&first));
    [first, std::array::from_fn(|d| second[d])]
}

fn area(polygon: &[Plane]) -> f64 {
    let pairs = polygon.iter().zip(polygon.iter().cycle().skip(1));
    0.5 * pairs.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
}

fn counterclockwise(mut polygon: Vec<Plane>) -> Vec<Plane> {
    if area(&polygon) < 0.0 {
        polygon.reverse();
    }
    polygon
}

/// The part of a convex polygon on the side of a line on which a function is at least 0; the function is given at two
/// positions by `level`.
fn cut(polygon: &[Plane], level: impl Fn(&Plane) -> f64) -> Vec<Plane> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (a, b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
        let (from, to) = (level(a), level(b));
        if from >= 0.0 {
            kept.push(*a);
        }
        if (from > 0.0 && to < 0.0) || (from < 0.0 && to > 0.0) {
            let t = from / (from - to);
            kept.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
        }
    }
    kept
}

/// The intersection of two convex polygons, both counterclockwise.
fn clipped(polygon: &[Plane], by: &[Plane]) -> Vec<Plane> {
    let edges = by.iter().zip(by.iter().cycle().skip(1));
    edges.fold(polygon.to_vec(), |left, (a, b)| {
        cut(&left, |x| (b[0] - a[0]) * (x[1] - a[1]) - (b[1] - a[1]) * (x[0] - a[0]))
    })
}

/// The polygons between the planes of the grid.
fn divided<const D: usize>(
    mut pieces: Vec<Vec<Plane>>,
    grid: &dyn Grid<D>,
    axes: &[[f64; D]; 2],
    origin: &[f64; D],
) -> Vec<Vec<Plane>> {
    for (d, axis) in grid.lines().into_iter().flat_map(|lines| lines.axes().iter().enumerate()) {
        let coordinate = |x: &Plane| origin[d] + x[0] * axes[0][d] + x[1] * axes[1][d];
        pieces = pieces
            .into_iter()
            .flat_map(|piece| {
                let along: Vec<f64> = piece.iter().map(|x| axis.coordinate(coordinate(x))).collect();
                let low = along.iter().copied().fold(f64::INFINITY, f64::min);
                let high = along.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let (mut left, mut found) = (piece, Vec::new());
                let mut line = low.floor() + 1.0;
                while line < high {
                    let at = axis.position(line);
                    found.push(cut(&left, |x| at - coordinate(x)));
                    left = cut(&left, |x| coordinate(x) - at);
                    line += 1.0;
                }
                found.push(left);
                found
            })
            .filter(|piece| piece.len() > 2)
            .collect();
    }
    pieces
}

/// Positions in a convex polygon and their weights: the rule is exact for polynomials of degree two.
fn quadrature(polygon: &[Plane]) -> Vec<(Plane, f64)> {
    let mut places = Vec::new();
    for k in 1..polygon.len().saturating_sub(1) {
        let triangle = [polygon[0], polygon[k], polygon[k + 1]];
        let third = area(&triangle) / 3.0;
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let [a, b] = [triangle[a], triangle[b]];
            places.push(([0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])], third));
        }
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polygons_are_clipped_and_integrated() {
        let square = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
        let other = counterclockwise(vec![[1.0, -1.0], [1.0, 3.0], [5.0, 1.0]]);
        let both = clipped(&square, &other);
        let found: f64 = quadrature(&both).iter().map(|(_, weight)| weight).sum();
        assert!((area(&both) - 2.0).abs() < 1e-14 && (found - 2.0).abs() < 1e-14, "{both:?}");
        // ∫ x² y over the square between x = 1 and 2, y = 0 and 2 is not of degree two; ∫ x y is.
        let moment: f64 = quadrature(&both).iter().map(|(x, weight)| weight * x[0] * x[1]).sum();
        assert!((moment - 3.0).abs() < 1e-13, "{moment}");
        assert!(area(&clipped(&square, &[[3.0, 0.0], [4.0, 0.0], [4.0, 1.0]])) == 0.0);
    }
}
