//! A triangle of a surface: the volume that it contributes, and the side on which a position lies.

use crate::region::polygon::turn;
use robust::{Coord3D, orient3d};

use crate::region::vector::{cross, dot, minus};

/// Corners of a triangle, counterclockwise as seen from outside, [length].
pub type Triangle = [[f64; 3]; 3];

/// Enclosed volume by the divergence theorem: the sum of the signed volumes of the tetrahedra over all facets.
pub(super) fn volume(triangles: &[Triangle]) -> f64 {
    // Relative to a corner of the surface: far from the origin the tetrahedra would be large and cancel.
    let about = triangles[0][0];
    let six_times = |t: &Triangle| {
        let [a, b, c] = t.map(|x| minus(&x, &about));
        dot(&a, &cross(&b, &c))
    };
    triangles.iter().map(six_times).sum::<f64>() / 6.0
}

/// Positive if x lies on the inner side of a facet, zero in its plane; the sign is exact.
pub(super) fn depth(t: &Triangle, x: &[f64; 3]) -> f64 {
    // The exact predicate is slow for coplanar positions; facets normal to an axis have a simple test.
    if (0..3).any(|d| t.iter().all(|corner| corner[d] == x[d])) {
        return 0.0;
    }
    let at = |x: &[f64; 3]| Coord3D { x: x[0], y: x[1], z: x[2] };
    orient3d(at(&t[0]), at(&t[1]), at(&t[2]), at(x))
}

/// An axis along which the projection of a triangle has a positive area; `None` if its corners are collinear.
pub(super) fn plane_axis(t: &Triangle) -> Option<usize> {
    (0..3).find(|&axis| {
        let [a, b, c] = t.map(|x| across(&x, axis));
        turn(&a, &b, &c) != 0.0
    })
}

/// The coordinates of a position along the two axes other than `axis`.
pub(super) fn across(x: &[f64; 3], axis: usize) -> [f64; 2] {
    [x[(axis + 1) % 3], x[(axis + 2) % 3]]
}
