//! Subdivision of elements into parts, each of which becomes a material point.

use super::element::{ElementShape, box_shape};
use super::structured::vtk_corner;

/// A part of an element.
#[derive(Debug, Clone, PartialEq)]
pub struct ElementPart<const D: usize> {
    /// Position of its material point, [length].
    pub position: [f64; D],
    /// Volume (area), [length^`D`].
    pub volume: f64,
    /// Corners, ordered as in [`crate::points::Seed::corners`], [length].
    pub corners: Vec<[f64; D]>,
}

/// Positions of `n` points in a triangle: barycentric coordinates, and the share of the area for each point.
///
/// - `n` = k²: the sides are divided into k parts, which yields k² congruent triangles; the points are their centroids.
/// - `n` = 8: each of the four triangles for k = 2 is halved along its median from the corner that corresponds to the
///   first node of the whole triangle (in the inverted middle triangle, its corner on the side opposite that node); the
///   points are the centroids of the halves.
///
/// All points have the same area, and their mean is the centroid. `None` for any other `n`.
pub fn subdivide_triangle(n: usize) -> Option<Vec<([f64; 3], f64)>> {
    let points = if n == 8 { halved() } else { squared(n)? };
    Some(points.into_iter().map(|([a, b], _)| ([1.0 - a - b, a, b], 1.0 / n as f64)).collect())
}

/// Corners, counterclockwise, of the parts whose centroids [`subdivide_triangle`] returns, in the same order. The
/// corners are given as coordinates along the two sides from the first node.
pub fn triangle_parts(n: usize) -> Option<Vec<[[f64; 2]; 3]>> {
    let points = if n == 8 { halved() } else { squared(n)? };
    Some(points.into_iter().map(|(_, corners)| corners).collect())
}

/// Centroid and corners of a part of a triangle.
type TrianglePart = ([f64; 2], [[f64; 2]; 3]);

/// Centroid and corners of k² congruent triangles, as coordinates along the two sides from the first node.
fn squared(n: usize) -> Option<Vec<TrianglePart>> {
    let k = n.isqrt();
    if n == 0 || k * k != n {
        return None;
    }
    let position = |i: usize, shift: f64| (i as f64 + shift) / k as f64;
    let at = |i: usize, j: usize| [position(i, 0.0), position(j, 0.0)];
    let mut points = Vec::new();
    for j in 0..k {
        for i in 0..k - j {
            let centroid = [position(i, 1.0 / 3.0), position(j, 1.0 / 3.0)];
            points.push((centroid, [at(i, j), at(i + 1, j), at(i, j + 1)]));
            if i + j + 2 <= k {
                let centroid = [position(i, 2.0 / 3.0), position(j, 2.0 / 3.0)];
                points.push((centroid, [at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)]));
            }
        }
    }
    Some(points)
}

/// The halves of four congruent triangles.
fn halved() -> Vec<TrianglePart> {
    // First corner and size; the size is negative for the inverted triangle.
    let quarters = [([0.0, 0.0], 0.5), ([0.5, 0.0], 0.5), ([0.0, 0.5], 0.5), ([0.5, 0.5], -0.5)];
    // The halves of the whole triangle and their centroids.
    let half = [
        ([0.5, 1.0 / 6.0], [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5]]),
        ([1.0 / 6.0, 0.5], [[0.0, 0.0], [0.5, 0.5], [0.0, 1.0]]),
    ];
    let position =
        |corner: [f64; 2], size: f64, x: [f64; 2]| [corner[0] + size * x[0], corner[1] + size * x[1]];
    let halves = |(corner, size): ([f64; 2], f64)| {
        half.map(|(centroid, corners)| {
            (position(corner, size, centroid), corners.map(|x| position(corner, size, x)))
        })
    };
    quarters.into_iter().flat_map(halves).collect()
}

/// Divides a tetrahedron into `n` parts of equal volume; the points are their centroids.
///
/// - `n` = k³: the edges are divided into k parts. With corners at (0, 0, 0), (k, 0, 0), (k, k, 0) and (k, k, k) the
///   tetrahedron is the set k ≥ x ≥ y ≥ z ≥ 0. The planes of integer x, y, z, x − y, y − z and x − z cut it into k³
///   tetrahedra of up to three shapes.
/// - `n` = 4: each of the four faces is joined to the centroid.
///
/// The mean of the points is the centroid of the tetrahedron. `None` for any other `n`.
pub fn subdivide_tetrahedron(corners: &[[f64; 3]; 4], n: usize) -> Option<Vec<ElementPart<3>>> {
    let shape = ElementShape::Simplex;
    let volume = shape.volume(corners) / n as f64;
    let part = |local: [[f64; 3]; 4]| {
        let part = local.map(|xi| shape.map(corners, xi));
        ElementPart { position: shape.centroid(&part), volume, corners: part.to_vec() }
    };
    Some(if n == 4 { joined_to_the_centroid() } else { cubed(n)? }.into_iter().map(part).collect())
}

/// Divides a triangle as [`subdivide_triangle`] does, or a tetrahedron as [`subdivide_tetrahedron`] does.
///
/// `corners` are the `D` + 1 corners of the element, [length]. `None` if `n` is none of the numbers listed there.
pub fn subdivide_simplex<const D: usize>(corners: &[[f64; D]], n: usize) -> Option<Vec<ElementPart<D>>> {
    let shape = ElementShape::Simplex;
    let local = |x: &[f64]| std::array::from_fn::<f64, D, _>(|d| x[d]);
    match D {
        2 => {
            let area = shape.volume(&corners[..3]);
            let parts = subdivide_triangle(n)?.into_iter().zip(triangle_parts(n)?);
            let part = |(([_, a, b], share), part): (([f64; 3], f64), [[f64; 2]; 3])| ElementPart {
                position: shape.map(corners, local(&[a, b])),
                volume: share * area,
                corners: part.iter().map(|x| shape.map(corners, local(x))).collect(),
            };
            Some(parts.map(part).collect())
        }
        3 => {
            let padded = std::array::from_fn(|k| std::array::from_fn(|d| corners[k][d]));
            let parts = subdivide_tetrahedron(&padded, n)?.into_iter();
            let part = |part: ElementPart<3>| ElementPart {
                position: local(&part.position),
                volume: part.volume,
                corners: part.corners.iter().map(|x| local(x)).collect(),
            };
            Some(parts.map(part).collect())
        }
        _ => None,
    }
}

/// The four tetrahedra between the faces and the centroid of a tetrahedron, in local coordinates.
fn joined_to_the_centroid() -> Vec<[[f64; 3]; 4]> {
    let shape = ElementShape::Simplex;
    let join = |corner: usize| {
        std::array::from_fn(|k| if k == corner { shape.centre() } else { shape.node_coordinates(k) })
    };
    (0..4).map(join).collect()
}

/// k³ tetrahedra of equal volume and positive orientation in a tetrahedron, in local coordinates.
fn cubed(n: usize) -> Option<Vec<[[f64; 3]; 4]>> {
    let k = (1..=n).take_while(|k| k.checked_pow(3).is_some_and(|cube| cube <= n)).last()?;
    if k.pow(3) != n {
        return None;
    }
    // Every cube of the lattice is cut into six tetrahedra around its diagonal. The corners of each tetrahedron lie on
    // a path from the lowest corner of the cube to the opposite one, along one axis at a time.
    const STEPS: [[usize; 3]; 6] = [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2], [0, 2, 1], [2, 1, 0]];
    let mut parts = Vec::with_capacity(n);
    for (z, y, x) in (0..k).flat_map(|z| (z..k).flat_map(move |y| (y..k).map(move |x| (z, y, x)))) {
        for (number, steps) in STEPS.iter().enumerate() {
            let mut position = [x, y, z];
            let mut corners = [position; 4];
            for (corner, axis) in corners[1..].iter_mut().zip(steps) {
                position[*axis] += 1;
                *corner = position;
            }
            if corners.iter().any(|[x, y, z]| y > x || z > y) {
                continue; // outside the tetrahedron
            }
            // Odd permutations of the axes yield the opposite orientation.
            if number >= 3 {
                corners.swap(1, 2);
            }
            // Converts x, y, z to local coordinates: the corners are at (1, 0, 0), (1, 1, 0) and (1, 1, 1).
            let part = |n: usize| n as f64 / k as f64;
            parts.push(corners.map(|[x, y, z]| [part(x - y), part(y - z), part(z)]));
        }
    }
    Some(parts)
}

/// Divides a quadrilateral or hexahedron along lines (planes) of constant local coordinates.
///
/// `n` is the number of parts along each local axis: from the first to the second corner, from the second to the third
/// and, in space, from the bottom to the top. The parts are quadrilaterals (hexahedra) whose volumes sum to the volume
/// of the element. The points are the centroids of the parts, so that linear fields are integrated exactly. If the
/// domain of a point is given by its corners, the basis functions are means over this domain and reproduce linear
/// fields at the point. The first axis varies fastest.
///
/// `corners` are in VTK order, [length]. `None` if their number is wrong.
pub fn subdivide_box<const D: usize>(corners: &[[f64; D]], n: [usize; D]) -> Option<Vec<ElementPart<D>>> {
    let shape = ElementShape::Box;
    if corners.len() != shape.n_nodes::<D>() {
        return None;
    }
    let position = |at: [f64; D]| {
        let mut x = [0.0; D];
        for (k, corner) in corners.iter().enumerate() {
            let (value, _) = box_shape(vtk_corner(k), &at);
            for d in 0..D {
                x[d] += value * corner[d];
            }
        }
        x
    };
    let line = |d: usize, i: usize| 2.0 * i as f64 / n[d] as f64 - 1.0;
    let mut parts = Vec::with_capacity(n.iter().product());
    for number in 0..n.iter().product() {
        let mut rest: usize = number;
        let index = n.map(|n| {
            let i = rest % n;
            rest /= n;
            i
        });
        let part: Vec<[f64; D]> = (0..1usize << D)
            .map(|c| position(std::array::from_fn(|d| line(d, index[d] + (c >> d & 1)))))
            .collect();
        let around: Vec<[f64; D]> = (0..part.len()).map(|k| part[vtk_corner(k)]).collect();
        parts.push(ElementPart {
            position: shape.centroid(&around),
            volume: shape.volume(&around),
            corners: part,
        });
    }
    Some(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_are_divided_evenly() {
        for n in [1, 4, 8, 9, 16, 25, 64] {
            let points = subdivide_triangle(n).unwrap();
            assert_eq!(points.len(), n);
            let weight: f64 = points.iter().map(|(_, w)| w).sum();
            assert!((weight - 1.0).abs() < 1e-14);
            for k in 0..3 {
                let mean: f64 = points.iter().map(|(b, w)| b[k] * w).sum();
                assert!((mean - 1.0 / 3.0).abs() < 1e-14, "{n}: {mean}");
            }
            assert!(points.iter().all(|(b, _)| b.iter().all(|v| *v > 0.0)));
            let parts = triangle_parts(n).unwrap();
            assert_eq!(parts.len(), n);
            for ([_, a, b], part) in points.iter().map(|(b, _)| b).zip(&parts) {
                let centroid = ElementShape::Simplex.centroid(part);
                assert!((centroid[0] - a).abs() < 1e-15 && (centroid[1] - b).abs() < 1e-15);
                assert!((ElementShape::Simplex.volume(part) - 0.5 / n as f64).abs() < 1e-15);
            }
        }
        assert!([0, 2, 3, 5, 15, 17, usize::MAX].iter().all(|n| subdivide_triangle(*n).is_none()));
    }

    #[test]
    fn all_parts_of_a_triangle_are_met_once() {
        for k in [2, 3, 4] {
            let mut parts: Vec<_> = subdivide_triangle(k * k).unwrap();
            let n = parts.len();
            let part = |b: [f64; 3]| b.map(|v| (v * k as f64) as usize);
            parts.sort_by_key(|(b, _)| part(*b));
            parts.dedup_by_key(|(b, _)| part(*b));
            assert_eq!(parts.len(), n);
        }
    }

    const TETRAHEDRON: [[f64; 3]; 4] = [[0.1, 0.0, 0.2], [2.0, 0.1, 0.0], [0.3, 1.5, 0.1], [0.2, 0.4, 1.1]];

    /// Barycentric coordinates in [`TETRAHEDRON`].
    fn barycentric(x: &[f64; 3]) -> [f64; 4] {
        let xi = ElementShape::Simplex.inverse(&TETRAHEDRON, x).unwrap();
        [1.0 - xi[0] - xi[1] - xi[2], xi[0], xi[1], xi[2]]
    }

    #[test]
    fn tetrahedra_are_divided_evenly() {
        let whole = ElementShape::Simplex.volume(&TETRAHEDRON);
        for n in [1, 4, 8, 27, 64, 125] {
            let parts = subdivide_tetrahedron(&TETRAHEDRON, n).unwrap();
            assert_eq!(parts.len(), n);
            let mut mean = [0.0; 3];
            for part in &parts {
                let volume = ElementShape::Simplex.volume(&part.corners);
                assert!((volume - whole / n as f64).abs() < 1e-14 && volume > 0.0, "{n}: {volume}");
                assert!((part.volume - volume).abs() < 1e-14);
                assert!(part.corners.iter().all(|x| barycentric(x).iter().all(|b| *b > -1e-12)));
                (0..3).for_each(|d| mean[d] += part.position[d] / n as f64);
            }
            let centroid = ElementShape::Simplex.centroid(&TETRAHEDRON);
            assert!((0..3).all(|d| (mean[d] - centroid[d]).abs() < 1e-14));
        }
        let refused = [0, 2, 3, 5, 9, 26, usize::MAX];
        assert!(refused.iter().all(|n| subdivide_tetrahedron(&TETRAHEDRON, *n).is_none()));
    }

    /// The parts have equal volumes that sum to the whole, and no centroid lies inside another part: the parts fill the
    /// tetrahedron.
    #[test]
    fn parts_of_a_tetrahedron_do_not_overlap() {
        for n in [4, 8, 27] {
            let parts = subdivide_tetrahedron(&TETRAHEDRON, n).unwrap();
            for (a, one) in parts.iter().enumerate() {
                for (b, other) in parts.iter().enumerate() {
                    let xi = ElementShape::Simplex.inverse(&other.corners, &one.position).unwrap();
                    let inside = xi.iter().all(|x| *x > 0.0) && xi.iter().sum::<f64>() < 1.0;
                    assert_eq!(inside, a == b, "{n}: {a} {b}");
                }
            }
        }
    }

    fn check_box<const D: usize>(corners: &[[f64; D]], n: [usize; D]) {
        let parts = subdivide_box(corners, n).unwrap();
        assert_eq!(parts.len(), n.iter().product::<usize>());
        let whole = ElementShape::Box.volume(corners);
        assert!((parts.iter().map(|p| p.volume).sum::<f64>() - whole).abs() < 1e-14 * whole);
        // The centroids of the parts, weighted by volume, average to the centroid of the whole.
        let centroid = ElementShape::Box.centroid(corners);
        for d in 0..D {
            let moment: f64 = parts.iter().map(|p| p.volume * p.position[d]).sum();
            assert!((moment / whole - centroid[d]).abs() < 1e-14);
        }
    }

    #[test]
    fn parts_of_quadrilaterals_and_hexahedra_fill_them() {
        let base = [[0.0, 0.0], [3.0, 0.5], [2.5, 2.0], [-0.5, 1.0]];
        let solid: Vec<[f64; 3]> = (0..8)
            .map(|k| {
                let [x, y] = base[k % 4];
                if k < 4 { [x, y, 0.1 * x] } else { [0.8 * x, 1.1 * y + 0.2, 1.5 - 0.1 * y] }
            })
            .collect();
        for (nx, ny, nz) in [(1, 1, 1), (2, 2, 2), (3, 5, 2)] {
            check_box(&base, [nx, ny]);
            check_box(&solid, [nx, ny, nz]);
        }
        assert!(subdivide_box(&base[..3], [1, 1]).is_none());
    }

    #[test]
    fn a_rectangle_and_a_brick_are_divided_into_equal_parts() {
        let parts = subdivide_box(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]], [2, 2]).unwrap();
        let expected = [[0.5, 0.25], [1.5, 0.25], [0.5, 0.75], [1.5, 0.75]];
        for (part, e) in parts.iter().zip(expected) {
            let x = part.position;
            assert!((x[0] - e[0]).abs() < 1e-15 && (x[1] - e[1]).abs() < 1e-15);
            assert!((part.volume - 0.5).abs() < 1e-15);
        }
        let brick: Vec<[f64; 3]> = (0..8)
            .map(|k| ElementShape::Box.node_coordinates::<3>(k))
            .map(|[x, y, z]| [x, 2.0 * y, 3.0 * z])
            .collect();
        let parts = subdivide_box(&brick, [1, 2, 3]).unwrap();
        assert!(parts.iter().all(|part| (part.volume - 8.0).abs() < 1e-14));
        assert!((0..3).all(|d| (parts[1].position[d] - [0.0, 1.0, -2.0][d]).abs() < 1e-15));
        assert_eq!(parts[1].corners[5], [1.0, 0.0, -1.0]);
    }
}
