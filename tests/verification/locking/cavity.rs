//! A cylindrical cavity in an incompressible von Mises material, widened at constant length.
//!
//! A point moves from the radius R to r with r² = R² + D, D = a² − a₀². The logarithmic strain is ±ln(r/R) around and
//! along the radius, so that σ_θ − σ_r = min(−2G ln(1 − D/r²), 2k) with the shear strength k, and the pressure is the
//! integral of this difference over dr/r.

use std::f64::consts::{FRAC_PI_2, PI};

use mpm::stress::PlaneStrain;

use super::{in_powers, integral, orders};
use crate::meshes::{Cells, plane, written};
use crate::verification::analysis::run_text;
use crate::verification::surfaces::built;
use crate::verification::total_lagrangian::equilibrium;

/// Shear modulus, shear strength, and original outer radius; the original inner radius is 1.
const SHEAR: f64 = 100.0;
const STRENGTH: f64 = 1.0;
const OUTER: f64 = 24.0;
const POISSON: f64 = 0.4999;

/// Li₂(x) for 0 ≤ x < 1.
fn dilogarithm(x: f64) -> f64 {
    (1..4000).map(|k| x.powi(k) / f64::from(k * k)).sum()
}

/// Pressure at the inner radius `a` if there is none at the outer radius `b`.
fn pressure(a: f64, b: f64) -> f64 {
    let d = a * a - 1.0;
    let at_front = 1.0 - (-STRENGTH / SHEAR).exp();
    let at_outside = d / (b * b);
    assert!(at_outside < at_front && at_front < d / (a * a), "the front is inside the wall");
    STRENGTH * (d / (a * a * at_front)).ln() + SHEAR * (dilogarithm(at_front) - dilogarithm(at_outside))
}

#[test]
fn the_formula_is_the_integral_of_the_stress() {
    for (a, in_infinite_space) in [(1.1, 3.85640), (1.5, 5.01988), (2.0, 5.31999), (4.0, 5.54313)] {
        let d: f64 = a * a - 1.0;
        // Over y = ln r; the kink of the stress is an end of two intervals.
        let difference = |y: f64| -> f64 { -2.0 * SHEAR * (-d * (-2.0 * y).exp()).ln_1p() };
        let front = 0.5 * (d / (1.0 - (-STRENGTH / SHEAR).exp())).ln();
        let outside = 1e4f64.ln();
        let whole = integral([a.ln(), front], |y| difference(y).min(2.0 * STRENGTH))
            + integral([front, outside], |y| difference(y).min(2.0 * STRENGTH));
        let formula = pressure(a, 1e4);
        assert!((whole / formula - 1.0).abs() < 1e-10, "{a}: {whole} {formula}");
        assert!((formula - in_infinite_space).abs() < 1e-4, "{a}: {formula}");
    }
}

/// Relative error of the pressure when the inner radius has doubled, for a body of revolution one cell high with n
/// cells through the wall, whose sides are proportional to the radius. If there are several steps, a grid line follows
/// the inner radius.
fn error(n: usize, method: &str, volumetric: &str, steps: usize) -> f64 {
    let ratio = OUTER.powf(1.0 / n as f64);
    let beyond = n / 8;
    let end = OUTER * ratio.powi(beyond as i32);
    let follow = if steps > 1 { "follow: [{axis: x, from: 1, to: 1, condition: inside}]" } else { "" };
    let text = format!(
        "
version: 1
analysis: {{stabilisation: {{mode: off}}, idealisation: axisymmetric}}
grid:
  type: structured
  origin: [1, 0]
  size: [{}, 1]
  spacing: [[{{to: {OUTER}, cells: {n}, ratio: {ratio}}}, {{to: {end}, cells: {beyond}, ratio: {ratio}}}], 1]
  {follow}
materials:
  metal: {{model: von-mises, young: {}, poisson: {POISSON}, deviatoric_yield_stress: {}}}
bodies:
  - {{name: wall, material: metal, method: {method}, strain: {volumetric}, points_per_cell: [2, 1],
     shape: {{type: box, min: [1, 0], max: [{OUTER}, 1]}}}}
boundary_conditions:
  - {{name: inside, nodes: {{x: 1}}, ux: 1}}
  - {{name: ends, nodes: {{box: {{min: [1, 0], max: [{end}, 1]}}}}, fix: [y]}}
steps: {{count: {steps}}}
",
        end - 1.0,
        2.0 * SHEAR * (1.0 + POISSON),
        2f64.sqrt() * STRENGTH,
    );
    let analysis = run_text(&text, &[]).completed();
    let force = analysis.steps.last().unwrap().reactions[0][0];
    let found = force / (2.0 * PI * 2.0);
    found / pressure(2.0, (OUTER * OUTER + 3.0).sqrt()) - 1.0
}

fn study(method: &str, volumetric: &str, steps: usize) -> [f64; 3] {
    let errors = [8, 16, 32].map(|n| error(n, method, volumetric, steps));
    let orders = orders(&errors);
    println!("cavity, {steps} steps, {method}, {volumetric}: {}, orders {orders:.2?}", in_powers(&errors));
    errors
}

/// In one step, the points are integration points of finite elements, so that all methods agree; with the mean
/// dilatation, the error has order 2. The standard method constrains the volume at each of the two points of a cell,
/// which is more than the nodes can satisfy: its pressure is hundreds of times too large.
#[test]
fn widened_in_one_step() {
    let standard = study("mpm", "mean-dilatation", 1);
    for method in ["mpm", "gimp", "cpdi2"] {
        let cured = study(method, "mean-dilatation", 1);
        assert!(cured.iter().zip(standard).all(|(a, b)| (a / b - 1.0).abs() < 1e-6), "{method}: {cured:?}");
        assert!((0.5 * (cured[0] / cured[2]).log2() - 2.0).abs() < 0.2, "{method}: {cured:?}");
        if method != "cpdi2" {
            let centred = study(method, "f-bar", 1);
            assert!(centred.iter().zip(&cured).all(|(a, b)| (a / b - 1.0).abs() < 0.06), "{centred:?}");
        }
        let locked = study(method, "standard", 1);
        assert!(locked.iter().zip(&cured).all(|(locked, cured)| *locked > 1e4 * cured), "{locked:?}");
    }
}

/// In ten steps the material moves through the cells. With domains, the order is the same as in one step. Standard
/// points no longer integrate cells exactly, and the error changes its sign from grid to grid.
#[test]
fn widened_in_ten_steps() {
    for method in ["gimp", "cpdi2"] {
        let cured = study(method, "mean-dilatation", 10);
        assert!(cured[2] > 0.0 && cured[2] < 1.2e-3, "{method}: {cured:?}");
        assert!((0.5 * (cured[0] / cured[2]).log2() - 1.9).abs() < 0.2, "{method}: {cured:?}");
    }
    for (volumetric, most) in [("mean-dilatation", [0.03, 0.012, 0.006]), ("f-bar", [0.05, 0.016, 0.014])] {
        let errors = study("mpm", volumetric, 10);
        assert!(errors.iter().zip(most).all(|(error, most)| error.abs() < most), "{volumetric}: {errors:?}");
    }
    for method in ["mpm", "gimp"] {
        let locked = study(method, "standard", 10);
        assert!(locked[2] > 1.0, "{method}: {locked:?}");
    }
    let centred = study("gimp", "f-bar", 10);
    assert!(centred[2].abs() < 1e-3, "{centred:?}");
    assert!((0.5 * (centred[0] / centred[2]).log2() - 1.9).abs() < 0.2, "{centred:?}");
}

/// Relative error of the pressure in a quarter of an elastic ring in the plane, radii 1 and 2, the inner radius
/// doubled.
fn error_of_ring(n: usize, cells: Cells, volumetric: &str) -> f64 {
    let mesh = written(&plane([n, n], cells, |s, t| {
        let angle = FRAC_PI_2 * t;
        [if t == 1.0 { 0.0 } else { (1.0 + s) * angle.cos() }, (1.0 + s) * angle.sin()]
    }));
    let points = if cells == Cells::Simplices { "points_per_triangle: 1" } else { "points_per_cell: 2" };
    let (model, points) = built(&format!(
        "
version: 1
grid: {{type: gmsh, file: \"{}\"}}
materials: {{rubber: {{model: hencky, young: {}, poisson: {POISSON}}}}}
bodies: [{{name: ring, material: rubber, method: mpm, strain: {volumetric}, {points}, shape: {{type: cells, group: body}}}}]
boundary_conditions:
  - {{name: axis, nodes: {{x: 0}}, fix: [x]}}
  - {{name: plane, nodes: {{y: 0}}, fix: [y]}}
  - {{name: inside, nodes: {{group: left}}, ux: x, uy: y}}
steps: {{count: 1}}
",
        mesh.path().display(),
        2.0 * SHEAR * (1.0 + POISSON),
    ));
    let ring = equilibrium::<2, PlaneStrain>(model, points);
    let mut force = 0.0;
    for (a, reaction) in ring.reaction.iter().enumerate() {
        let [x, y] = ring.place(a);
        if (x.hypot(y) - 1.0).abs() < 1e-9 {
            force += reaction[0] * x + reaction[1] * y;
        }
    }
    let exact = SHEAR * (dilogarithm(3.0 / 4.0) - dilogarithm(3.0 / 7.0));
    force / PI / exact - 1.0
}

/// A quarter of a ring, for which ΔF̄ scales the two directions of the plane. The order is 2, and the error of the
/// standard method is a hundred times larger.
#[test]
fn rings_in_the_plane() {
    for cells in [Cells::Boxes, Cells::Simplices] {
        let study = |volumetric: &str| {
            let errors = [4, 8, 16].map(|n| error_of_ring(n, cells, volumetric));
            println!("ring, {cells:?}, {volumetric}: {}, orders {:.2?}", in_powers(&errors), orders(&errors));
            errors
        };
        let cured = study("mean-dilatation");
        assert!(cured[2].abs() < 1.5e-3, "{cells:?}: {cured:?}");
        assert!(orders(&cured).iter().all(|order| *order > 1.8), "{cells:?}: {cured:?}");
        if cells == Cells::Boxes {
            let centred = study("f-bar");
            assert!(centred[2].abs() < 1.5e-3, "{centred:?}");
            assert!(orders(&centred).iter().all(|order| *order > 1.8), "{centred:?}");
        }
        let locked = error_of_ring(16, cells, "standard");
        assert!(locked.abs() > 50.0 * cured[2].abs(), "{cells:?}: {locked}");
    }
}
