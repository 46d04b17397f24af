//! Edges and corners at which several faces meet: their normal, and the faces near a position.

use super::*;
use crate::region::surface::tests::cube;
use crate::region::vector::{minus, norm};
use crate::tool::facing_each_other;

/// The unit cube as a box, an extrusion, and triangles in two orders.
fn cubes() -> Vec<Box<dyn Shape<3>>> {
    let triangles = cube([0.0; 3], 1.0);
    let turned: Vec<_> = triangles.iter().rev().map(|[a, b, c]| [*b, *c, *a]).collect();
    let square = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    vec![
        Box::new(Brick::new([0.0; 3], [1.0; 3]).unwrap()),
        Box::new(Extrusion::new(square, 2, [0.0, 1.0]).unwrap()),
        Box::new(TriangulatedSurface::new(&triangles).unwrap()),
        Box::new(TriangulatedSurface::new(&turned).unwrap()),
    ]
}

#[test]
fn one_cube_however_it_is_given() {
    let cubes = cubes();
    let ticks = [-0.25, 0.0, 0.125, 0.25, 0.75, 1.0, 1.125];
    for k in 0..343 {
        let x: [f64; 3] = std::array::from_fn(|d| ticks[k / 7usize.pow(d as u32) % 7]);
        let found: Vec<_> = cubes.iter().map(|cube| cube.closest(x).unwrap()).collect();
        for other in &found[1..] {
            assert!((other.gap - found[0].gap).abs() < 1e-14, "{x:?}: {found:?}");
            assert!(norm(&minus(&other.normal, &found[0].normal)) < 1e-14, "{x:?}: {found:?}");
        }
        for cube in &cubes[1..] {
            let [mut a, mut b] = [&cubes[0], cube].map(|cube| {
                cube.faces_near(&x, 0.5)
                    .iter()
                    .map(|face| (face.closest.normal, face.closest.gap))
                    .collect::<Vec<_>>()
            });
            for faces in [&mut a, &mut b] {
                faces.sort_by(|a, b| a.0.map(|n| n.round() as i32).cmp(&b.0.map(|n| n.round() as i32)));
            }
            assert_eq!(a.len(), b.len(), "{x:?}: {a:?} {b:?}");
            for (a, b) in a.iter().zip(&b) {
                assert!(norm(&minus(&a.0, &b.0)) < 1e-14 && (a.1 - b.1).abs() < 1e-14, "{x:?}: {a:?} {b:?}");
            }
        }
    }
}

#[test]
fn edges_push_along_the_middle_of_their_faces() {
    let along = |x: [f64; 3]| Brick::new([0.0; 3], [1.0; 3]).unwrap().closest(x).unwrap();
    let edge = along([0.0, 0.5, 0.0]);
    assert!(edge.gap == 0.0 && norm(&minus(&edge.normal, &[-0.5f64.sqrt(), 0.0, -0.5f64.sqrt()])) < 1e-15);
    let corner = along([0.125; 3]);
    assert!((corner.gap + 0.125 * 3f64.sqrt()).abs() < 1e-15 && norm(&corner.point) < 1e-15, "{corner:?}");
    // Halfway between opposite faces there is no middle: one of them is chosen.
    assert_eq!(Brick::new([0.0; 2], [1.0, 4.0]).unwrap().closest([0.5, 2.0]).unwrap().normal, [1.0, 0.0]);
}

#[test]
fn faces_of_a_re_entrant_corner_face_each_other() {
    let corners = vec![[-1.0, -1.0], [4.0, -1.0], [4.0, 0.0], [0.0, 0.0], [0.0, 3.0], [-1.0, 3.0]];
    for reversed in [false, true] {
        let mut corners = corners.clone();
        if reversed {
            corners.reverse();
        }
        let polygon = ClosedPolygon::new(corners.clone()).unwrap();
        let prism = Extrusion::new(corners, 1, [0.0, 1.0]).unwrap();
        let faces = |x: [f64; 2], depth: f64| {
            let found = facing_each_other(&polygon.faces_near(&x, 0.25), depth);
            let in_space = facing_each_other(&prism.faces_near(&[x[0], 0.5, x[1]], 0.25), depth);
            assert_eq!(in_space.len(), found.len());
            found.iter().map(|face| (face.normal, face.gap)).collect::<Vec<_>>()
        };
        let both = vec![([0.0, 1.0], 0.125), ([1.0, 0.0], 0.0625)];
        assert_eq!(faces([0.0625, 0.125], 0.0), both);
        assert_eq!(faces([0.0, 0.0], 0.0), vec![([0.0, 1.0], 0.0), ([1.0, 0.0], 0.0)]);
        // Slightly inside both faces.
        assert_eq!(faces([-0.0625, -0.03125], 0.0625).len(), 2);
        // One face alone, none, and a convex corner.
        for x in [[2.0, 0.125], [0.0625, 2.0], [2.0, 2.0], [4.0, -1.0], [-1.0, 3.0], [3.9375, -0.0625]] {
            assert!(faces(x, 0.0).is_empty(), "{x:?}");
        }
    }
}
