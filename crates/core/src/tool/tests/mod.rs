//! Shapes against independent tests of containment, differences, and each other.

mod check;
mod corners;
mod outlines;
mod poses;
mod triangles;

use std::f64::consts::TAU;

use super::*;
use crate::region::{Ball, Brick, Frustum, Polygon, Primitive, Prism};
use check::{Check, check};

/// A polygon with notches and a reentrant corner, clockwise.
pub(super) fn notched() -> Vec<[f64; 2]> {
    vec![[0.0, 0.0], [-0.5, 1.5], [0.4, 2.0], [1.0, 0.5], [1.3, 1.9], [2.0, 2.0], [2.2, 0.1]]
}

/// A closed curve of many edges, counterclockwise.
pub(super) fn flower(n: usize) -> Vec<[f64; 2]> {
    let at = |k: usize| {
        let angle = TAU * k as f64 / n as f64;
        let r = 1.0 + 0.4 * (5.0 * angle).sin();
        [0.3 + r * angle.cos(), -0.2 + r * angle.sin()]
    };
    (0..n).map(at).collect()
}

/// Within half the thickness of a polyline: in a disc at a corner or in a rectangle along a segment.
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
fn extrusions_along_every_axis() {
    for axis in 0..3 {
        let extrusion = Extrusion::new(notched(), axis, [-0.4, 1.1]).unwrap();
        let prism = Prism::new(Polygon::new(notched()).unwrap(), axis, [-0.4, 1.1]).unwrap();
        check(&extrusion, &|x| prism.contains(x), Check::around(&extrusion));
    }
}
