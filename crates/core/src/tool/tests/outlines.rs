//! Outlines: areas, closed boundaries, sizes, errors.

use std::f64::consts::PI;

use super::*;
use crate::region::area_vector;
use crate::region::surface::tests::torus;
use crate::region::vector::{along, minus, norm};

/// Area of the outline of a shape. Checks that the facets form a closed surface (their area vectors add to zero) and
/// are no larger than `size`.
fn closed_area<const D: usize>(shape: &dyn Shape<D>, size: f64) -> f64 {
    let outline = shape.outline(size).unwrap();
    let mut sum = [0.0; D];
    for (facet, area) in outline.facets.iter().zip(&outline.areas) {
        let corners = facet.map(|corner| outline.vertices[corner as usize]);
        let vector = area_vector(&corners);
        assert!((norm(&vector) - area).abs() < 1e-15);
        sum = along(&sum, 1.0, &vector);
        for k in 0..D {
            assert!(norm(&minus(&corners[(k + 1) % D], &corners[k])) < size * (1.0 + 1e-9), "{corners:?}");
        }
    }
    assert!(norm(&sum) < 1e-11, "{sum:?}");
    outline.area()
}

#[test]
fn flat_shapes_have_their_area() {
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12 * b, "{a} {b}");
    near(closed_area(&Brick::new([0.0; 2], [1.0, 2.0]).unwrap(), 0.3), 6.0);
    near(closed_area(&Brick::new([0.0; 3], [1.0, 2.0, 3.0]).unwrap(), 0.3), 22.0);
    // The brick is thinner than a facet.
    near(closed_area(&Brick::new([0.0; 3], [1.0, 2.0, 1e-3]).unwrap(), 0.3), 4.0 + 6e-3);
    let square = vec![[0.0, 0.0], [0.0, 2.0], [2.0, 2.0], [2.0, 0.0]];
    near(closed_area(&ClosedPolygon::new(square.clone()).unwrap(), 0.3), 8.0);
    near(closed_area(&Extrusion::new(square, 0, [0.0, 0.5]).unwrap(), 0.3), 8.0 + 4.0);
    let ring = TriangulatedSurface::new(&torus(2.0, 0.5, 24, 13)).unwrap();
    let area: f64 = ring.surface().triangles().iter().map(|t| norm(&area_vector(t))).sum();
    near(closed_area(&ring, 0.3), area);
}

#[test]
fn curved_shapes_approach_their_area() {
    let converges = |shape: &dyn Fn(f64) -> f64, exact: f64| {
        let [coarse, fine] = [0.1, 0.05].map(|size| (shape(size) - exact).abs() / exact);
        assert!(coarse < 0.01 && fine < 0.3 * coarse, "{coarse} {fine}");
    };
    let circle = Ball::new([1.0, 2.0], 1.0).unwrap();
    converges(&|size| closed_area(&circle, size), 2.0 * PI);
    let sphere = Ball::new([1.0, 2.0, 3.0], 1.0).unwrap();
    converges(&|size| closed_area(&sphere, size), 4.0 * PI);
    let cylinder = Frustum::cylinder([0.0; 3], [0.0, 3.0, 0.0], 1.0).unwrap();
    converges(&|size| closed_area(&cylinder, size), 2.0 * PI * 4.0);
    let section = vec![[1.0, 0.0], [2.0, 0.0], [2.0, 3.0], [1.0, 3.0]];
    let pipe = Revolution::new([0.0; 3], [0.0, 3.0, 4.0], section).unwrap();
    converges(&|size| closed_area(&pipe, 2.0 * size), 2.0 * PI * 3.0 * (1.0 + 2.0) + 2.0 * PI * 3.0);
    let cone = Frustum::new([0.0; 3], [0.0, 0.0, 4.0], [3.0, 0.0]).unwrap();
    converges(&|size| closed_area(&cone, 2.0 * size), 9.0 * PI + 15.0 * PI);
}

#[test]
fn walls_are_cut_at_the_inner_sides_of_bends() {
    let straight = Wall::new(vec![[0.0, 0.0], [2.0, 0.0]], 0.2).unwrap();
    let ends = closed_area(&straight, 0.01) - 4.0;
    assert!((ends / (0.2 * PI) - 1.0).abs() < 1e-3, "{ends}");
    // A right angle takes half the thickness from each of two sides and adds a quarter of a circle.
    let bent = Wall::new(vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]], 0.2).unwrap();
    let round = closed_area(&bent, 0.01) - (8.0 - 0.2);
    assert!((round / (0.25 * PI) - 1.0).abs() < 1e-2, "{round}");
    let other = Wall::new(vec![[0.0, 0.0], [2.0, 0.0], [2.0, -2.0]], 0.2).unwrap();
    assert!((closed_area(&other, 0.01) - closed_area(&bent, 0.01)).abs() < 1e-12);
}

#[test]
fn planes_have_a_patch() {
    let plane = HalfSpace::new([0.0, 0.0, 1.0], [0.0, 3.0, 4.0]).unwrap();
    assert_eq!(plane.outline(0.1), Err(NoOutline::Unbounded));
    let patch = plane.outline_near([5.0, 0.0, 0.0], 2.0, 0.5).unwrap();
    assert!((patch.area() - 16.0).abs() < 1e-12);
    for (facet, area) in patch.facets.iter().zip(&patch.areas) {
        let corners = facet.map(|corner| patch.vertices[corner as usize]);
        assert!(corners.iter().all(|x| plane.closest(*x).unwrap().gap.abs() < 1e-14));
        let normal = area_vector(&corners).map(|x| x / area);
        assert!(norm(&minus(&normal, &[0.0, 0.6, 0.8])) < 1e-12);
    }
    let line = HalfSpace::new([0.0, 0.0], [1.0, 1.0]).unwrap().outline_near([0.0, 1.0], 1.5, 0.1).unwrap();
    assert!((line.area() - 3.0).abs() < 1e-12 && line.vertices.len() == 31);
    let first = area_vector(&line.facets[0].map(|corner| line.vertices[corner as usize]));
    assert!(first[0] > 0.0 && first[1] > 0.0);
}

#[test]
fn impossible_sizes_are_refused() {
    let sphere = Ball::new([0.0; 3], 1.0).unwrap();
    for size in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(sphere.outline(size), Err(NoOutline::Size { size }));
    }
    assert!(matches!(sphere.outline(f64::NAN), Err(NoOutline::Size { .. })));
    assert_eq!(sphere.outline(1e-4), Err(NoOutline::TooMany));
    let plane = HalfSpace::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap();
    assert_eq!(plane.outline_near([0.0; 3], 1.0, 1e-9), Err(NoOutline::TooMany));
    assert_eq!(plane.outline_near([0.0; 3], -1.0, 1.0), Err(NoOutline::Size { size: -1.0 }));
}
