//! Position relative to one cell: inside, on the boundary, or at a distance.

use crate::grid::bins::{Bounds, bounds};
use crate::grid::element::{ElementShape, MAX_NODES, cross, dot, minus, vector_product};
use crate::tensor::padded;

/// Safety factor on first-order estimates of a distance.
const SAFETY: f64 = 100.0;

/// Shape and corner positions of a cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell<const D: usize> {
    pub(super) x: [[f64; D]; MAX_NODES],
    pub(super) shape: ElementShape,
}

impl<const D: usize> std::ops::Deref for Cell<D> {
    type Target = [[f64; D]];

    fn deref(&self) -> &[[f64; D]] {
        &self.x[..self.shape.n_nodes::<D>()]
    }
}

impl<const D: usize> Cell<D> {
    /// Edges as pairs of positions; in space each edge occurs twice.
    pub(super) fn edges(&self) -> impl Iterator<Item = ([f64; D], [f64; D])> + '_ {
        self.shape.sides::<D>().iter().flat_map(|side| {
            // In the plane, a side is one edge; it must not be returned in reverse as well.
            let n = if side.len() == 2 { 1 } else { side.len() };
            (0..n).map(|k| (self.x[side[k]], self.x[side[(k + 1) % side.len()]]))
        })
    }

    /// Bounding box of the corners.
    pub(super) fn bounds(&self) -> Bounds<D> {
        bounds(self.iter().copied())
    }

    /// Size of a cell of this volume, [length]: the side of a square (cube) of the same volume.
    pub(super) fn size_of(volume: f64) -> f64 {
        match D {
            2 => volume.sqrt(),
            3 => volume.cbrt(),
            _ => volume.powf(1.0 / D as f64),
        }
    }

    /// True if a position is inside the cell and farther than `margin` from its boundary. For a hexahedron, the
    /// distance is estimated conservatively.
    pub(super) fn holds(&self, x: &[f64; D], margin: f64) -> bool {
        if (self.shape, D) != (ElementShape::Box, 3) {
            return self.is_within(x, margin);
        }
        if !within(&self.bounds(), x, 0.0) {
            return false;
        }
        let Some(xi) = self.shape.inverse(self, x) else { return false };
        // A local coordinate is interpolated from its values at the corners; its gradient follows from the gradients
        // ∇N.
        let gradients = self.shape.gradients(self, xi);
        (0..D).all(|d| {
            let slope: [f64; D] = std::array::from_fn(|i| {
                let side = |k: usize| self.shape.node_coordinates::<D>(k)[d];
                (0..self.len()).map(|k| side(k) * gradients[k][i]).sum()
            });
            1.0 - xi[d].abs() > SAFETY * margin * dot(slope, slope).sqrt()
        })
    }

    /// True if a position is inside the cell or at most `tolerance` outside it. For a hexahedron, the test is exact up
    /// to a factor of the order of its distortion.
    pub(super) fn touches(&self, x: &[f64; D], tolerance: f64) -> bool {
        if (self.shape, D) == (ElementShape::Box, 3) {
            return within(&self.bounds(), x, tolerance)
                && self.shape.inverse(self, x).is_some_and(|xi| {
                    let inside = xi.map(|xi| xi.clamp(-1.0, 1.0));
                    let away = minus(*x, self.shape.map(self, inside));
                    inside == xi || dot(away, away) <= tolerance * tolerance
                });
        }
        // Near a sharp corner, the lines (planes) of the sides also pass close to positions far beyond the corner,
        // hence the third test.
        self.is_within(x, -tolerance)
            && (self.is_within(x, 0.0) || self.distance_squared(x) <= tolerance * tolerance)
    }

    /// Squared distance of a position from the cell; zero inside. The curved faces of a hexahedron are replaced by flat
    /// triangles between their edges and centres.
    pub(super) fn distance_squared(&self, x: &[f64; D]) -> f64 {
        let inside = match (self.shape, D) {
            (ElementShape::Box, 3) => self.touches(x, 0.0),
            _ => self.is_within(x, 0.0),
        };
        if inside {
            return 0.0;
        }
        if D == 3 {
            return self.distance_squared_of_faces(padded(x));
        }
        self.edges().map(|(a, b)| distance_squared(x, a, b)).fold(f64::INFINITY, f64::min)
    }

    /// True if a position is on the inner side of every edge line (face plane), at least `margin` away from each.
    fn is_within(&self, x: &[f64; D], margin: f64) -> bool {
        if D == 3 {
            let x = padded(x);
            return self.shape.sides::<D>().iter().all(|side| {
                let [a, b, c] = [side[0], side[1], side[2]].map(|k| padded(&self.x[k]));
                let normal = vector_product(minus(b, a), minus(c, a)); // outward normal
                -dot(normal, minus(x, a)) >= margin * dot(normal, normal).sqrt()
            });
        }
        self.edges().all(|(a, b)| {
            let edge = [b[0] - a[0], b[1] - a[1]];
            let distance = cross(edge, [x[0] - a[0], x[1] - a[1]]);
            distance >= margin * (edge[0] * edge[0] + edge[1] * edge[1]).sqrt()
        })
    }

    fn distance_squared_of_faces(&self, x: [f64; 3]) -> f64 {
        let mut least = f64::INFINITY;
        for side in self.shape.sides::<D>() {
            let corner = |k: usize| padded(&self.x[side[k % side.len()]]);
            if side.len() == 3 {
                least = least.min(distance_squared_of_triangle(x, [corner(0), corner(1), corner(2)]));
                continue;
            }
            let centre = std::array::from_fn(|d| (0..4).map(|k| 0.25 * corner(k)[d]).sum());
            for k in 0..side.len() {
                least = least.min(distance_squared_of_triangle(x, [corner(k), corner(k + 1), centre]));
            }
        }
        least
    }

    /// Corners of the linear part that replaces the cell at positions where its map has no inverse: the nearer half of
    /// a quadrilateral, or the tetrahedron at the nearest corner of a hexahedron. Only the first `D` + 1 are used.
    pub(super) fn linear_part(&self, x: &[f64; D]) -> [usize; 4] {
        if self.shape == ElementShape::Simplex {
            return [0, 1, 2, 3];
        }
        if D == 2 {
            let near = |a: usize, b: usize| distance_squared(x, self.x[a], self.x[b]);
            let first = near(0, 1).min(near(1, 2)) <= near(2, 3).min(near(3, 0));
            return if first { [0, 1, 2, 3] } else { [0, 2, 3, 1] };
        }
        let away = |k: usize| {
            let away = minus(*x, self.x[k]);
            dot(away, away)
        };
        let corner = (1..self.len()).fold(0, |near, k| if away(k) < away(near) { k } else { near });
        // The two neighbours around the bottom or top, and the corner above or below.
        let base = corner & 4;
        [corner, base | (corner + 1) & 3, base | (corner + 3) & 3, corner ^ 4]
    }
}

/// True if a position is inside a box or at most `tolerance` outside it along each axis.
fn within<const D: usize>([lower, upper]: &Bounds<D>, x: &[f64; D], tolerance: f64) -> bool {
    (0..D).all(|d| lower[d] - tolerance <= x[d] && x[d] <= upper[d] + tolerance)
}

/// Square of the distance of a position from a segment.
pub(super) fn distance_squared<const D: usize>(x: &[f64; D], a: [f64; D], b: [f64; D]) -> f64 {
    let (edge, to) = (minus(b, a), minus(*x, a));
    let length = dot(edge, edge);
    let t = if length > 0.0 { (dot(to, edge) / length).clamp(0.0, 1.0) } else { 0.0 };
    let away: [f64; D] = std::array::from_fn(|d| to[d] - t * edge[d]);
    dot(away, away)
}

/// Square of the distance of a position from a triangle in space, or from a segment if two corners coincide.
pub fn distance_squared_of_triangle(x: [f64; 3], triangle: [[f64; 3]; 3]) -> f64 {
    let [a, b, c] = triangle;
    let normal = vector_product(minus(b, a), minus(c, a));
    let left_of =
        |from: [f64; 3], to: [f64; 3]| dot(vector_product(minus(to, from), minus(x, from)), normal) >= 0.0;
    if left_of(a, b) && left_of(b, c) && left_of(c, a) && dot(normal, normal) > 0.0 {
        return dot(normal, minus(x, a)).powi(2) / dot(normal, normal);
    }
    let edges = [(a, b), (b, c), (c, a)];
    edges.map(|(a, b)| distance_squared(&x, a, b)).into_iter().fold(f64::INFINITY, f64::min)
}
