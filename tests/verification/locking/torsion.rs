//! A square bar of incompressible material under a small twist, with ends free to warp (Saint-Venant 1855).
//!
//! The moment is μ ψ J for a twist ψ per length, with J = s⁴ (1/3 − 64/π⁵ Σ tanh(nπ/2)/n⁵) over odd n for the side s.
//! The motion u = ψ Z (−Y, X) + ψ φ(X, Y) e_z changes no volume, even if φ is linear between nodes: here a cure for
//! locking must leave the result of the standard method unchanged.

use std::f64::consts::PI;

use mpm::stress::Solid;

use super::{in_powers, orders};
use crate::verification::surfaces::loaded;
use crate::verification::total_lagrangian::equilibrium;

const SHEAR: f64 = 1.0;
const POISSON: f64 = 0.4999;
/// Twist per length; the error of the linear solution is of the order of its square.
const TWIST: f64 = 1e-4;

/// Moment of a bar with sides of length 1.
fn moment() -> f64 {
    let series: f64 = (0..40).map(|k| f64::from(2 * k + 1)).map(|n| (0.5 * n * PI).tanh() / n.powi(5)).sum();
    SHEAR * TWIST * (1.0 / 3.0 - 64.0 / PI.powi(5) * series)
}

/// Error of the moment of a bar with n cells across, relative to the exact moment.
fn error(n: usize, method: &str, volumetric: &str) -> f64 {
    let (h, young) = (1.0 / n as f64, 2.0 * SHEAR * (1.0 + POISSON));
    let length = 2.0 * h;
    let text = format!(
        "
version: 1
analysis: {{idealisation: solid}}
grid: {{type: structured, origin: [-0.5, -0.5, 0], size: [1, 1, {length}], spacing: {h}}}
materials: {{rubber: {{model: neo-hookean, young: {young}, poisson: {POISSON}}}}}
bodies:
  - name: bar
    material: rubber
    shape: {{type: box, min: [-0.5, -0.5, 0], max: [0.5, 0.5, {length}]}}
    method: {method}
    strain: {volumetric}
    points_per_cell: 2
boundary_conditions:
  - {{name: bottom, nodes: {{z: 0}}, fix: [x, y]}}
  - {{name: axis, nodes: {{x: 0, y: 0}}, fix: [z]}}
  - name: top
    nodes: {{z: {length}}}
    where: {{turn: factor*{TWIST}*{length}}}
    ux: X*cos(turn) - Y*sin(turn) - X
    uy: X*sin(turn) + Y*cos(turn) - Y
steps: {{count: 1}}
"
    );
    let (model, points) = mpm::deck::build::build::<3>(&loaded(&text)).unwrap_or_else(|e| panic!("{e:?}"));
    let twisted = equilibrium::<3, Solid>(model, points);
    let on_top = (0..twisted.reaction.len()).filter(|&a| twisted.place(a)[2] > 1.5 * h);
    let about_axis = |a: usize| {
        let ([x, y, _], [fx, fy, _]) = (twisted.place(a), twisted.reaction[a]);
        x * fy - y * fx
    };
    on_top.map(about_axis).sum::<f64>() / moment() - 1.0
}

/// The moment converges with order 2, from above.
#[test]
fn a_twisted_bar() {
    assert!((moment() / TWIST - 0.140577).abs() < 1e-6);
    for (method, volumetric) in [
        ("mpm", "standard"),
        ("mpm", "mean-dilatation"),
        ("gimp", "mean-dilatation"),
        ("mpm", "f-bar"),
        ("mpm", "mean"),
    ] {
        let errors = [2, 4, 8, 16].map(|n| error(n, method, volumetric));
        println!("torsion, {method}, {volumetric}: {}, {:.2?}", in_powers(&errors), orders(&errors));
        assert!(errors[3].abs() < 0.01 && orders(&errors)[2] > 1.8, "{method}, {volumetric}: {errors:?}");
    }
}
