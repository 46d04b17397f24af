//! Tests of shapes against independent tests of containment, finite differences, and each other.

mod check;
mod corners;
mod edges;
mod outlines;
mod poses;
mod triangles;

use std::f64::consts::TAU;

use super::*;
use crate::region::tests::Random;
use crate::region::vector::{dot, minus, norm};
use crate::region::{Ball, Brick, Frustum, Polygon, Primitive, Prism};
use check::{Check, check};

/// A cone penetrometer with a friction sleeve: tip at the origin, shaft upwards.
fn penetrometer() -> Vec<[f64; 2]> {
    vec![[0.0, 0.0], [0.5, 0.9], [0.5, 1.2], [0.4, 1.3], [0.4, 3.0], [0.0, 3.0]]
}

/// A wide foot with a reentrant underside around a hollow shaft, clockwise.
fn hollow_foot() -> Vec<[f64; 2]> {
    vec![[0.2, 2.0], [0.4, 2.0], [0.4, 0.8], [1.5, 0.7], [1.4, 0.0], [0.9, 0.4], [0.6, -0.2], [0.2, 0.1]]
}

/// A body with a cavity on its axis.
fn with_cavity() -> Vec<[f64; 2]> {
    vec![[0.0, -1.0], [1.0, -1.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.5], [0.4, 0.0], [0.0, -0.6]]
}

/// A polygon with a notch, that is, a reentrant corner, clockwise.
pub(super) fn notched() -> Vec<[f64; 2]> {
    vec![[0.0, 0.0], [-0.5, 1.5], [0.4, 2.0], [1.0, 0.5], [1.3, 1.9], [2.0, 2.0], [2.2, 0.1]]
}

/// A closed curve with many edges, counterclockwise.
pub(super) fn flower(n: usize) -> Vec<[f64; 2]> {
    let at = |k: usize| {
        let angle = TAU * k as f64 / n as f64;
        let r = 1.0 + 0.4 * (5.0 * angle).sin();
        [0.3 + r * angle.cos(), -0.2 + r * angle.sin()]
    };
    (0..n).map(at).collect()
}

/// True within `radius` of a polyline: in a disc at a corner or in a rectangle along a segment.
fn in_wall(corners: &[[f64; 2]], radius: f64, x: &[f64; 2]) -> bool {
    let along_segment = |ends: &[[f64; 2]]| {
        let [[a, b], [c, d]] = [ends[0], ends[1]];
        let length = (c - a).hypot(d - b);
        let [p, q] = [radius * (d - b) / length, radius * (a - c) / length];
        let rectangle = vec![[a + p, b + q], [a - p, b - q], [c - p, d - q], [c + p, d + q]];
        Polygon::new(rectangle).unwrap().contains(x)
    };
    corners.iter().any(|c| Ball::new(*c, radius).unwrap().contains(x))
        || corners.windows(2).any(along_segment)
}

#[test]
fn half_spaces() {
    let line = HalfSpace::new([1.0, 2.0], [-3.0, 4.0]).unwrap();
    let within = [[-3.0, -2.0], [5.0, 6.0]];
    check(&line, &|x| -3.0 * (x[0] - 1.0) + 4.0 * (x[1] - 2.0) < 0.0, Check { within, ..Check::default() });
    let plane = HalfSpace::new([0.0, 0.0, 0.5], [0.0, 1e-200, 2e-200]).unwrap();
    let within = [[-1.0; 3], [1.0; 3]];
    check(&plane, &|x| x[1] + 2.0 * (x[2] - 0.5) < 0.0, Check { within, ..Check::default() });
}

#[test]
fn circles_and_spheres() {
    let circle = Ball::new([0.5, -1.0], 0.7).unwrap();
    check(&circle, &|x| circle.contains(x), Check::around(&circle));
    let sphere = Ball::new([0.5, -1.0, 2.0], 0.7).unwrap();
    check(&sphere, &|x| sphere.contains(x), Check::around(&sphere));
}

#[test]
fn rectangles_and_boxes() {
    let rectangle = Brick::new([0.0, 0.5], [2.0, 1.5]).unwrap();
    check(&rectangle, &|x| rectangle.contains(x), Check::around(&rectangle));
    let brick = Brick::new([0.0, 0.5, -1.0], [2.0, 1.5, 3.0]).unwrap();
    check(&brick, &|x| brick.contains(x), Check::around(&brick));
}

#[test]
fn polygons_in_both_orders() {
    for corners in [notched(), notched().into_iter().rev().collect(), flower(200)] {
        let polygon = ClosedPolygon::new(corners).unwrap();
        check(&polygon, &|x| polygon.polygon().contains(x), Check::around(&polygon));
    }
}

#[test]
fn walls() {
    let bent = vec![[0.0, 0.0], [1.0, 0.2], [1.1, 1.0], [2.0, 0.9], [2.3, 0.0]];
    let crossing = vec![[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
    for corners in [bent, crossing, vec![[0.0, 0.0], [0.5, 2.0]]] {
        let wall = Wall::new(corners.clone(), 0.12).unwrap();
        let inside = |x: &[f64; 2]| in_wall(&corners, 0.06, x);
        check(&wall, &inside, Check { depth_is_distance: false, ..Check::around(&wall) });
    }
}

#[test]
fn cylinders_and_cones() {
    for radii in [[0.5, 0.5], [0.8, 0.3], [0.6, 0.0], [0.0, 0.7]] {
        let frustum = Frustum::new([0.2, -0.3, 0.1], [1.0, 0.9, 1.5], radii).unwrap();
        check(&frustum, &|x| frustum.contains(x), Check::around(&frustum));
        let upright = Frustum::new([0.0; 3], [0.0, 0.0, 2.0], radii).unwrap();
        check(&upright, &|x| upright.contains(x), Check::around(&upright));
    }
}

#[test]
fn bodies_of_revolution() {
    for section in [penetrometer(), hollow_foot(), with_cavity()] {
        for direction in [[0.0, 0.0, 1.0], [1.0, -2.0, 3.0]] {
            let body = Revolution::new([0.3, -0.2, 0.1], direction, section.clone()).unwrap();
            let length = norm(&direction);
            let inside = |x: &[f64; 3]| {
                let from_start = minus(x, &[0.3, -0.2, 0.1]);
                let h = dot(&from_start, &direction) / length;
                body.section().contains(&[(dot(&from_start, &from_start) - h * h).max(0.0).sqrt(), h])
            };
            check(&body, &inside, Check::around(&body));
        }
    }
}

#[test]
fn a_cone_is_a_body_of_revolution() {
    let (start, end) = ([0.2, -0.3, 0.1], [1.0, 0.9, 1.5]);
    let axis = minus(&end, &start);
    for [lower, upper] in [[0.5, 0.5], [0.6, 0.0], [0.2, 0.9]] {
        let frustum = Frustum::new(start, end, [lower, upper]).unwrap();
        let h = norm(&axis);
        let section: Vec<_> = [[0.0, 0.0], [lower, 0.0], [upper, h], [0.0, h]].into();
        let section = if upper == 0.0 { section[..3].to_vec() } else { section };
        let body = Revolution::new(start, axis, section).unwrap();
        let mut random = Random(8);
        let within = Check::around(&frustum).within;
        for _ in 0..2000 {
            let [x, y] = [0, 1].map(|_| random.inside(&within));
            let (a, b) = (frustum.closest(x).unwrap(), body.closest(x).unwrap());
            assert!(
                (a.gap - b.gap).abs() < 1e-14 && norm(&minus(&a.normal, &b.normal)) < 1e-11,
                "{a:?} {b:?}"
            );
            match (frustum.first_contact(x, y), body.first_contact(x, y)) {
                (Some(s), Some(t)) => assert!((s - t).abs() < 1e-9, "{s} {t}"),
                (s, t) => assert_eq!(s, t, "{x:?} {y:?}"),
            }
        }
    }
}

#[test]
fn extrusions_along_every_axis() {
    for axis in 0..3 {
        let extrusion = Extrusion::new(notched(), axis, [-0.4, 1.1]).unwrap();
        let prism = Prism::new(Polygon::new(notched()).unwrap(), axis, [-0.4, 1.1]).unwrap();
        check(&extrusion, &|x| prism.contains(x), Check::around(&extrusion));
    }
}

/// A section gives the same results as the same body of revolution in space, on both sides of the axis and on it.
#[test]
fn a_section_is_a_body_of_revolution() {
    for corners in [penetrometer(), hollow_foot(), with_cavity()] {
        let body = Revolution::new([0.0; 3], [0.0, 1.0, 0.0], corners.clone()).unwrap();
        let half =
            ClosedPolygon::section(corners.iter().map(|x| [x[0] - 0.7, x[1]]).collect(), -0.7).unwrap();
        let section = Section::new(std::sync::Arc::new(half), -0.7);
        let mut random = Random(3);
        for k in 0..3000 {
            let mut draw = || {
                let [x, y] = random.inside(&[[-2.0, -1.5], [2.0, 3.5]]);
                if k % 5 == 0 { [0.0, y] } else { [x, y] }
            };
            let [from, to] = [draw(), draw()];
            let (a, b) = (
                section.closest([from[0] - 0.7, from[1]]).unwrap(),
                body.closest([from[0], from[1], 0.0]).unwrap(),
            );
            assert!((a.gap - b.gap).abs() < 1e-12, "{from:?} {a:?} {b:?}");
            // On the axis, the direction towards a circle around it is arbitrary.
            if from[0] != 0.0 || a.normal[0] == 0.0 {
                assert!(norm(&minus(&a.normal, &[b.normal[0], b.normal[1]])) < 1e-9, "{from:?} {a:?} {b:?}");
            }
            let (s, t) = (
                section.first_contact([from[0] - 0.7, from[1]], [to[0] - 0.7, to[1]]),
                body.first_contact([from[0], from[1], 0.0], [to[0], to[1], 0.0]),
            );
            match (s, t) {
                (Some(s), Some(t)) => assert!((s - t).abs() < 1e-6, "{from:?} {to:?} {s} {t}"),
                (s, t) => assert_eq!(s, t, "{from:?} {to:?}"),
            }
        }
    }
}

/// On its axis, a tip pushes along the axis, at its end and inside.
#[test]
fn tips_push_along_their_axis() {
    let half = ClosedPolygon::section(penetrometer(), 0.0).unwrap();
    let section = Section::new(std::sync::Arc::new(half), 0.0);
    let cone = Frustum::new([0.0; 3], [0.0, 0.9, 0.0], [0.0, 0.5]).unwrap();
    for depth in [0.0, 1e-9, 1e-3, 0.1] {
        let found = section.closest([0.0, depth]).unwrap();
        assert!((found.gap + depth).abs() < 1e-14 && found.normal == [0.0, -1.0], "{depth} {found:?}");
        let found = cone.closest([0.0, depth, 0.0]).unwrap();
        assert!((found.gap + depth).abs() < 1e-14 && found.normal == [0.0, -1.0, 0.0], "{depth} {found:?}");
    }
    // Beside the axis, on both sides of it, the closest face pushes.
    let [right, left] = [0.01, -0.01].map(|x| section.closest([x, 0.1]).unwrap());
    assert!(
        right.normal[0] > 0.8 && left.normal == [-right.normal[0], right.normal[1]] && left.gap == right.gap
    );
}

/// On its bisector, a wedge pushes along the bisector, at its edge and inside; beside it, the closest face pushes.
#[test]
fn wedges_push_along_their_middle() {
    for (rise, turned) in [(0.5, false), (1.0, true), (2.0, false)] {
        let mut corners =
            vec![[0.3, 0.1], [0.8, 0.1 + 0.5 * rise], [0.8, 3.0], [-0.2, 3.0], [-0.2, 0.1 + 0.5 * rise]];
        if turned {
            corners.reverse();
        }
        let wedge = ClosedPolygon::new(corners.clone()).unwrap();
        let roof = Extrusion::new(corners, 1, [0.0, 2.0]).unwrap();
        for depth in [0.0, 1e-9, 1e-6, 1e-3] {
            let found = wedge.closest([0.3, 0.1 + depth]).unwrap();
            assert!(
                (found.gap + depth).abs() < 1e-15 && (found.normal[1] + 1.0).abs() < 1e-15,
                "{depth} {found:?}"
            );
            assert!(found.normal[0].abs() < 1e-12 && found.normal_derivative == [[0.0; 2]; 2]);
            let found = roof.closest([0.3, 1.0, 0.1 + depth]).unwrap();
            assert!(
                (found.gap + depth).abs() < 1e-15 && (found.normal[2] + 1.0).abs() < 1e-15,
                "{depth} {found:?}"
            );
        }
        let [left, right] = [-1e-4, 1e-4].map(|x| wedge.closest([0.3 + x, 0.101]).unwrap());
        assert!(left.normal[0] < -0.4 && right.normal[0] > 0.4 && (left.gap - right.gap).abs() < 1e-15);
    }
}

/// A corner on a straight side has no effect: the gap beside it is the gap of the side.
#[test]
fn corners_on_straight_sides_change_nothing() {
    let square = ClosedPolygon::new(vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]).unwrap();
    let divided =
        ClosedPolygon::new(vec![[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]).unwrap();
    for beside in [-9e-3, -1e-6, 0.0, 1e-6, 9e-3] {
        for depth in [0.0, 1e-9, 1e-4] {
            let [a, b] = [&square, &divided].map(|shape| shape.closest([1.0 + beside, depth]).unwrap());
            assert_eq!((a.gap, a.normal, a.point), (b.gap, b.normal, b.point), "{beside} {depth}");
        }
    }
}
