//! Division of an element into parts of which each becomes a material point.

use super::element::ElementShape;

/// Places of `n` points in a triangle: barycentric coordinates and the part of the area that each stands for.
///
/// - `n` = k²: the sides are divided into k parts, which gives k² congruent triangles; the points are their
///   centroids.
/// - `n` = 8: each of the four triangles of k = 2 is halved by its median from the corner that corresponds to the
///   first node of the triangle (in the inverted triangle in the middle, the corner opposite to that node); the
///   points are the centroids of the halves.
///
/// All points stand for the same area, and their mean is the centroid. `None` for any other `n`.
pub fn subdivide_triangle(n: usize) -> Option<Vec<([f64; 3], f64)>> {
    let points = if n == 8 { halved() } else { squared(n)? };
    Some(points.into_iter().map(|[a, b]| ([1.0 - a - b, a, b], 1.0 / n as f64)).collect())
}

/// Centroids of k² congruent triangles: coordinates along the two sides from the first node.
fn squared(n: usize) -> Option<Vec<[f64; 2]>> {
    let k = n.isqrt();
    if n == 0 || k * k != n {
        return None;
    }
    let place = |i: usize, shift: f64| (i as f64 + shift) / k as f64;
    let mut points = Vec::new();
    for j in 0..k {
        for i in 0..k - j {
            points.push([place(i, 1.0 / 3.0), place(j, 1.0 / 3.0)]);
            if i + j + 2 <= k {
                points.push([place(i, 2.0 / 3.0), place(j, 2.0 / 3.0)]);
            }
        }
    }
    Some(points)
}

/// Centroids of the halves of four congruent triangles.
fn halved() -> Vec<[f64; 2]> {
    // First corner and the size, negative for the inverted triangle.
    let quarters = [([0.0, 0.0], 0.5), ([0.5, 0.0], 0.5), ([0.0, 0.5], 0.5), ([0.5, 0.5], -0.5)];
    let half = [[0.5, 1.0 / 6.0], [1.0 / 6.0, 0.5]]; // centroids of the halves of the whole triangle
    let place = |corner: [f64; 2], size: f64, x: [f64; 2]| [corner[0] + size * x[0], corner[1] + size * x[1]];
    quarters.iter().flat_map(|(corner, size)| half.map(|x| place(*corner, *size, x))).collect()
}

/// Positions of `nx` × `ny` points in a quadrilateral, [length], and the part of the area that each stands for.
///
/// Lines of constant local coordinates divide the element into `nx` parts along the side from the first to the
/// second node and `ny` along the next one. The parts are quadrilaterals with straight sides; the points are their
/// centroids and the weights their exact areas, so linear fields are integrated exactly. Points go along the first
/// side first.
pub fn subdivide_quadrilateral(corners: &[[f64; 2]; 4], nx: usize, ny: usize) -> Vec<([f64; 2], f64)> {
    let shape = ElementShape::Quadrilateral;
    let area = shape.area(corners);
    let line = |i: usize, n: usize| 2.0 * (i as f64 / n as f64) - 1.0;
    let mut points = Vec::new();
    for j in 0..ny {
        for i in 0..nx {
            let part = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]]
                .map(|[i, j]| shape.map(corners, [line(i, nx), line(j, ny)]));
            points.push((shape.centroid(&part), shape.area(&part) / area));
        }
    }
    points
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

    #[test]
    fn linear_fields_are_exact_on_quadrilaterals() {
        let corners = [[0.0, 0.0], [3.0, 0.5], [2.5, 2.0], [-0.5, 1.0]];
        let centroid = ElementShape::Quadrilateral.centroid(&corners);
        for (nx, ny) in [(1, 1), (2, 2), (3, 5)] {
            let points = subdivide_quadrilateral(&corners, nx, ny);
            assert_eq!(points.len(), nx * ny);
            assert!((points.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-14);
            for d in 0..2 {
                let mean: f64 = points.iter().map(|(x, w)| w * x[d]).sum();
                assert!((mean - centroid[d]).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn a_rectangle_is_divided_into_equal_rectangles() {
        let points = subdivide_quadrilateral(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]], 2, 2);
        let expected = [[0.5, 0.25], [1.5, 0.25], [0.5, 0.75], [1.5, 0.75]];
        for ((x, w), e) in points.iter().zip(expected) {
            assert!((x[0] - e[0]).abs() < 1e-15 && (x[1] - e[1]).abs() < 1e-15 && (w - 0.25).abs() < 1e-15);
        }
    }
}
