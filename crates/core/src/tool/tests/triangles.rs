//! Triangulated surfaces: the tree compared with all triangles, signs with the exact winding number.

use super::*;
use crate::region::surface::Triangle;
use crate::region::surface::tests::{cube, sphere, torus};
use crate::region::tests::Random;
use crate::region::vector::{along, cross, dot, minus, norm};

/// Distance of a position from a triangle: from its plane if the foot lies inside, otherwise from an edge.
fn slow_distance(x: &[f64; 3], t: &Triangle) -> f64 {
    let (ab, ac, ax) = (minus(&t[1], &t[0]), minus(&t[2], &t[0]), minus(x, &t[0]));
    let n = cross(&ab, &ac);
    let squared = dot(&n, &n);
    let (v, w) = (dot(&cross(&ax, &ac), &n) / squared, dot(&cross(&ab, &ax), &n) / squared);
    if v >= 0.0 && w >= 0.0 && v + w <= 1.0 {
        return dot(&ax, &n).abs() / squared.sqrt();
    }
    let from_edge = |k: usize| {
        let edge = minus(&t[(k + 1) % 3], &t[k]);
        let s = (dot(&minus(x, &t[k]), &edge) / dot(&edge, &edge)).clamp(0.0, 1.0);
        norm(&minus(x, &along(&t[k], s, &edge)))
    };
    (0..3).map(from_edge).fold(f64::INFINITY, f64::min)
}

fn check_surface(triangles: &[Triangle], positions: usize) {
    let shape = TriangulatedSurface::new(triangles).unwrap();
    let contains = |x: &[f64; 3]| shape.surface().contains(x);
    check(&shape, &contains, Check { positions, ..Check::around(&shape) });
    let mut random = Random(9);
    for k in 0..positions {
        let mut x = random.inside(&Check::around(&shape).within);
        if k % 2 == 0 {
            // Close to the surface, where contact takes place.
            let near = shape.closest(x).unwrap();
            x = along(&near.point, random.between(-0.01, 0.01), &near.normal);
        }
        let found = shape.closest(x).unwrap();
        let slow = triangles.iter().map(|t| slow_distance(&x, t)).fold(f64::INFINITY, f64::min);
        assert!((found.gap.abs() - slow).abs() < 1e-13, "{x:?} {found:?} {slow}");
        assert!((slow_distance(&x, &triangles[found.part]) - slow).abs() < 1e-13, "{found:?}");
        assert_eq!(found.gap < 0.0, contains(&x), "{x:?} {found:?}");
    }
}

#[test]
fn a_torus_of_3200_triangles() {
    let ring = torus(2.0, 0.5, 80, 20);
    assert_eq!(ring.len(), 3200);
    check_surface(&ring, 400);
}

#[test]
fn a_sphere_of_2880_triangles() {
    let ball = sphere([1.0, 2.0, 3.0], 1.5, 48, 31);
    assert_eq!(ball.len(), 2880);
    check_surface(&ball, 400);
}

#[test]
fn surfaces_with_sharp_edges() {
    check_surface(&cube([0.0; 3], 1.0), 1000);
    // Coarse tori have obtuse, acute and reentrant edges.
    check_surface(&torus(1.0, 0.6, 3, 3), 1000);
    check_surface(&sphere([0.0; 3], 1.0, 3, 2), 1000);
}

#[test]
fn cavities_and_sheets_that_touch_at_a_corner() {
    let mut cavity = cube([1.0; 3], 1.0);
    cavity.iter_mut().for_each(|t| t.swap(1, 2));
    let hollow = [cube([0.0; 3], 3.0), cavity].concat();
    let touching = [cube([0.0; 3], 1.0), cube([1.0; 3], 1.0)].concat();
    for triangles in [hollow, touching] {
        let shape = TriangulatedSurface::new(&triangles).unwrap();
        let mut random = Random(1);
        for _ in 0..4000 {
            let x = random.inside(&[[0.5; 3], [1.5; 3]]);
            let found = shape.closest(x).unwrap();
            assert_eq!(found.gap < 0.0, shape.surface().contains(&x), "{x:?} {found:?}");
        }
    }
}

/// A single sheet has a pseudonormal at its corner; where two sheets meet at a corner, the exact test decides.
#[test]
fn beyond_a_corner_of_two_sheets_is_outside() {
    let spike = |mirrored: bool| {
        let side = if mirrored { -1.0 } else { 1.0 };
        let [tip, a, b, c] = [[0.0; 3], [0.3, -0.3, -1.0], [1.0, -0.3, -1.0], [0.3, 0.6, -1.0]]
            .map(|[x, y, z]| [side * x, y, z]);
        let facets = [[a, c, b], [tip, a, b], [tip, b, c], [tip, c, a]];
        facets.map(|[a, b, c]| if mirrored { [a, c, b] } else { [a, b, c] }).to_vec()
    };
    let shape = TriangulatedSurface::new(&[spike(false), spike(true)].concat()).unwrap();
    assert_eq!(shape.surface().shells(), 2);
    let (mut random, mut at_tip) = (Random(4), 0);
    for _ in 0..2000 {
        let x = random.inside(&[[-0.5; 3], [0.5; 3]]);
        let found = shape.closest(x).unwrap();
        assert_eq!(found.gap < 0.0, shape.surface().contains(&x), "{x:?} {found:?}");
        at_tip += usize::from(norm(&found.point) < 1e-14);
    }
    assert!(at_tip > 300, "{at_tip}");
}

#[test]
fn no_path_slips_through_an_edge() {
    // The paths run through the corners, edges and diagonals of a cube, where each facet alone could miss them.
    let shape = TriangulatedSurface::new(&cube([0.0; 3], 1.0)).unwrap();
    for k in 0..5i32.pow(3) {
        let target = [k % 5, k / 5 % 5, k / 25].map(|i| f64::from(i) * 0.25);
        let on_surface = target.iter().any(|x| *x == 0.0 || *x == 1.0);
        let from = [0.5; 3];
        let outwards = minus(&target, &from);
        let to = along(&target, 1e-9, &outwards);
        if on_surface {
            let t = shape.first_contact(from, to).unwrap();
            assert!((t - 1.0).abs() < 1e-8, "{target:?} {t}");
            assert!(shape.first_contact(to, from).is_some_and(|t| t < 1e-8));
            assert_eq!(shape.first_contact(from, along(&target, -1e-9, &outwards)), None);
        }
    }
}
