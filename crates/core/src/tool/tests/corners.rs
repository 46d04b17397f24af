//! Positions on surfaces, edges, corners and medial axes, extreme positions, and invalid shapes.

use super::*;
use crate::region::ShapeError as PrimitiveError;
use crate::region::surface::SurfaceError;
use crate::region::surface::tests::cube;
use crate::region::tests::Random;
use crate::region::vector::{minus, norm};

fn plane_shapes() -> Vec<Box<dyn Shape<2>>> {
    vec![
        Box::new(HalfSpace::new([0.0, 0.0], [0.0, 1.0]).unwrap()),
        Box::new(Ball::new([1.0, 0.0], 1.0).unwrap()),
        Box::new(Brick::new([0.0; 2], [1.0; 2]).unwrap()),
        Box::new(ClosedPolygon::new(notched()).unwrap()),
        Box::new(ClosedPolygon::new(flower(50)).unwrap()),
        Box::new(Wall::new(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], 0.1).unwrap()),
    ]
}

fn shapes_in_space() -> Vec<Box<dyn Shape<3>>> {
    vec![
        Box::new(HalfSpace::new([0.0; 3], [0.0, 0.0, 1.0]).unwrap()),
        Box::new(Ball::new([0.0; 3], 1.0).unwrap()),
        Box::new(Brick::new([0.0; 3], [1.0; 3]).unwrap()),
        Box::new(Frustum::new([0.0; 3], [0.0, 0.0, 1.0], [1.0, 0.0]).unwrap()),
        Box::new(Frustum::cylinder([0.0; 3], [1.0, 0.0, 0.0], 0.5).unwrap()),
        Box::new(Extrusion::new(notched(), 2, [0.0, 1.0]).unwrap()),
        Box::new(Revolution::new([0.0; 3], [0.0, 0.0, 1.0], penetrometer()).unwrap()),
        Box::new(Revolution::new([0.0; 3], [0.0, 1.0, 0.0], hollow_foot()).unwrap()),
        Box::new(Revolution::new([0.5; 3], [0.0, 1.0, 0.0], with_cavity()).unwrap()),
        Box::new(TriangulatedSurface::new(&cube([0.0; 3], 1.0)).unwrap()),
    ]
}

/// Every position has a finite closest point, the same in every call.
fn check_total<const D: usize>(shape: &dyn Shape<D>) {
    for k in 0..7usize.pow(D as u32) {
        let x: [f64; D] = std::array::from_fn(|d| {
            [-0.5, -1e-300, 0.0, 0.5, 1.0, 1.0 + 1e-15, 2.0][k / 7usize.pow(d as u32) % 7]
        });
        let found = shape.closest(x).unwrap();
        assert!(found.is_finite() && (norm(&found.normal) - 1.0).abs() < 1e-9, "{shape:?} {x:?} {found:?}");
        assert_eq!(shape.closest(x), Some(found));
        // The closest point is on the surface, and is its own closest point.
        let again = shape.closest(found.point).unwrap();
        assert!(again.gap.abs() < 1e-14, "{shape:?} {x:?} {found:?} {again:?}");
    }
    for strange in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let x = std::array::from_fn(|d| if d == 0 { strange } else { 0.0 });
        assert_eq!(shape.closest(x), None);
        assert_eq!(shape.closest_within(x, 1.0), None);
        assert_eq!(shape.first_contact(x, [0.5; D]), None);
        assert_eq!(shape.first_contact([0.5; D], x), None);
    }
    assert_eq!(shape.closest_within([0.5; D], f64::NAN), None);
    assert_eq!(shape.closest_within([0.5; D], -1.0), None);
    for far in [1e6, 1e9] {
        assert!(shape.closest([far; D]).is_some_and(|found| found.gap > 0.1 * far), "{shape:?}");
    }
    for far in [1e30, 1e200, f64::MAX] {
        assert!(shape.closest([far; D]).is_none_or(|found| found.is_finite()));
        let _ = shape.first_contact([-far; D], [far; D]);
    }
    assert!(shape.closest([1e30; D]).is_none_or(|found| found.gap > 1e29));
    assert_eq!(shape.first_contact([0.5; D], [0.5; D]), None);
}

#[test]
fn every_position_has_a_closest_point() {
    plane_shapes().iter().for_each(|shape| check_total(&**shape));
    shapes_in_space().iter().for_each(|shape| check_total(&**shape));
}

#[test]
fn at_centres_the_choice_is_fixed() {
    let circle = Ball::new([3.0, 4.0], 2.0).unwrap();
    let centre = circle.closest([3.0, 4.0]).unwrap();
    assert_eq!((centre.gap, centre.normal, centre.point), (-2.0, [1.0, 0.0], [5.0, 4.0]));
    assert_eq!(centre.normal_derivative, [[0.0; 2]; 2]);
    // All four faces are equally near; of each two opposite ones, the upper one counts.
    let square = Brick::new([0.0; 2], [2.0; 2]).unwrap().closest([1.0; 2]).unwrap();
    assert!((square.gap + 2f64.sqrt()).abs() < 1e-15 && (square.normal[0] - 0.5f64.sqrt()).abs() < 1e-15);
    assert_eq!((square.normal[1], square.part), (square.normal[0], 1));
    let axis = Frustum::cylinder([0.0; 3], [0.0, 0.0, 9.0], 1.0).unwrap().closest([0.0, 0.0, 4.0]).unwrap();
    assert_eq!((axis.gap, axis.normal[2], axis.part), (-1.0, 0.0, 0));
}

#[test]
fn corners_and_edges_have_the_curvature_of_rounded_surfaces() {
    // The position is beyond the corner (1, 1) by (0.3, 0.4), so the normals are those of a circle of radius 0.5;
    // beyond the edge of the brick, they are the normals of a cylinder of this radius.
    let square = ClosedPolygon::new(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]).unwrap();
    let corner = square.closest([1.3, 1.4]).unwrap();
    let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-14);
    assert!(close(&corner.normal, &[0.6, 0.8]) && (corner.gap - 0.5).abs() < 1e-15);
    let expected = [[0.64, -0.48], [-0.48, 0.36]].map(|row| row.map(|x| x / 0.5));
    assert!(close(corner.normal_derivative.as_flattened(), expected.as_flattened()), "{corner:?}");
    // At a reentrant corner, the position is inside the tool, and the normals point to the centre of the circle.
    let corners = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [1.0, 1.0], [0.0, 1.0]];
    let reentrant = ClosedPolygon::new(corners).unwrap().closest([1.03, 0.96]).unwrap();
    assert!((reentrant.gap + 0.05).abs() < 1e-15 && close(&reentrant.normal, &[-0.6, 0.8]), "{reentrant:?}");
    assert!((reentrant.normal_derivative[0][0] + 0.64 / 0.05).abs() < 1e-11);
    let edge = Brick::new([0.0; 3], [1.0; 3]).unwrap().closest([1.3, 0.5, 1.4]).unwrap();
    assert!(
        (edge.normal_derivative[0][2] + 0.48 / 0.5).abs() < 1e-14 && edge.normal_derivative[1] == [0.0; 3]
    );
}

/// All descriptions of the unit cube agree, even on a lattice through its edges, corners and diagonals.
#[test]
fn a_box_is_an_extrusion_and_a_triangulated_surface() {
    let brick = Brick::new([0.0; 3], [1.0; 3]).unwrap();
    let square = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let others: [Box<dyn Shape<3>>; 2] = [
        Box::new(Extrusion::new(square, 1, [0.0, 1.0]).unwrap()),
        Box::new(TriangulatedSurface::new(&cube([0.0; 3], 1.0)).unwrap()),
    ];
    let mut random = Random(3);
    for k in 0..3000 {
        let lattice = |d: u32| f64::from(k / 13i32.pow(d) % 13 - 3) * 0.15;
        let x: [f64; 3] = if k < 2197 {
            std::array::from_fn(|d| lattice(d as u32))
        } else {
            random.inside(&[[-0.7; 3], [1.7; 3]])
        };
        let expected = brick.closest(x).unwrap();
        for shape in &others {
            let found = shape.closest(x).unwrap();
            assert!((found.gap - expected.gap).abs() < 1e-14, "{x:?} {found:?} {expected:?}");
            // Inside, positions of the lattice lie on the medial axis; on an edge, any normal between those of its
            // faces is correct.
            if expected.gap > 1e-9 {
                assert!(
                    norm(&minus(&found.normal, &expected.normal)) < 1e-12,
                    "{x:?} {found:?} {expected:?}"
                );
                let pairs = found.normal_derivative.as_flattened().iter();
                let mut pairs = pairs.zip(expected.normal_derivative.as_flattened());
                assert!(pairs.all(|(a, b)| (a - b).abs() < 1e-9), "{x:?} {found:?} {expected:?}");
            }
        }
    }
}

#[test]
fn malformed_shapes_are_refused() {
    let not_finite = |error: ShapeError| {
        assert!(matches!(error, ShapeError::Primitive(PrimitiveError::NotFinite { .. })), "{error:?}");
    };
    not_finite(HalfSpace::new([f64::NAN, 0.0], [0.0, 1.0]).unwrap_err());
    not_finite(HalfSpace::new([0.0, 0.0], [0.0, f64::INFINITY]).unwrap_err());
    not_finite(ClosedPolygon::new(vec![[0.0, 0.0], [1.0, 0.0], [f64::NAN, 1.0]]).unwrap_err());
    not_finite(Wall::new(vec![[0.0, 0.0], [f64::NAN, 1.0]], 0.1).unwrap_err());
    not_finite(Extrusion::new(notched(), 0, [0.0, f64::NAN]).unwrap_err());
    not_finite(Pose::new([0.0, f64::NAN], [0.0; 3]).unwrap_err());
    let not_positive = |error: ShapeError| {
        assert!(matches!(error, ShapeError::Primitive(PrimitiveError::NotPositive { .. })), "{error:?}");
    };
    not_positive(HalfSpace::new([0.0, 0.0], [0.0, 0.0]).unwrap_err());
    not_positive(Wall::new(vec![[0.0, 0.0], [1.0, 1.0]], 0.0).unwrap_err());
    not_positive(Extrusion::new(notched(), 0, [1.0, 1.0]).unwrap_err());
    not_positive(Ball::new([0.0, 0.0], 0.0).unwrap_err().into());
    assert_eq!(Wall::new(vec![[0.0; 2]], 0.1).unwrap_err(), ShapeError::Corners { corners: 1 });
    let twice = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0]];
    assert_eq!(Wall::new(twice.clone(), 0.1).unwrap_err(), ShapeError::ZeroEdge { edge: 1 });
    assert_eq!(ClosedPolygon::new(twice).unwrap_err(), ShapeError::ZeroEdge { edge: 1 });
    let bow = vec![[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
    let crossing = PrimitiveError::SelfCrossing { sides: [0, 2] };
    assert_eq!(ClosedPolygon::new(bow).unwrap_err(), ShapeError::Primitive(crossing));
    not_positive(Revolution::new([0.0; 3], [0.0; 3], penetrometer()).unwrap_err());
    let beyond = vec![[0.0, 0.0], [1.0, 0.0], [-0.5, 1.0]];
    let error = ShapeError::NegativeRadius { corner: 2, radius: -0.5 };
    assert_eq!(Revolution::new([0.0; 3], [1.0; 3], beyond).unwrap_err(), error);
    let mut open = cube([0.0; 3], 1.0);
    open.remove(3);
    let error = TriangulatedSurface::new(&open).unwrap_err();
    assert!(matches!(error, ShapeError::Surface(SurfaceError::Open { n: 3, .. })), "{error:?}");
}
