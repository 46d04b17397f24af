//! Surfaces of bodies: pressures that follow them against the ordinary differential equation of radial motion, bodies in
//! water, and rotations.

use std::fmt::Write;

use mpm::material::NeoHookean;
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::StepReport;

use crate::analysis::watch;
use crate::radial::{Inner, Radial, Shell};

const INNER: f64 = 1.0;
const OUTER: f64 = 2.0;

/// The model of a deck given as text.
pub fn built(text: &str) -> (Model<2>, Points<2>) {
    mpm::deck::build::build(&loaded(text)).unwrap_or_else(|e| panic!("{e:?}"))
}

/// A deck given as text.
pub fn loaded(text: &str) -> mpm::deck::load::LoadedDeck {
    mpm::deck::load::load_text("deck.yaml", text.as_bytes(), &[]).unwrap_or_else(|e| panic!("{e}"))
}

/// Runs a model, and passes every step in equilibrium to `look`.
pub fn run(text: &str, mut look: impl FnMut(&Points<2>, &StepReport<2>)) -> (Model<2>, Points<2>) {
    let (model, mut points) = built(text);
    watch(&model, &mut points, |points, report| look(points, report)).unwrap_or_else(|e| panic!("{e}"));
    (model, points)
}

/// The mean distance from the centre of the samples of the only surface at the end, when the inner radius of the shell
/// should have grown to `to` under its inner pressure; and that pressure.
fn inner_radius(shell: Shell, axisymmetric: bool, method: &str, n: usize, to: f64) -> f64 {
    let law = NeoHookean::new(1.0, 0.3);
    let mut exact = Radial::new(shell, [INNER, OUTER], &law, 200);
    exact.step(Inner::Moved(to), |_| 0.0);
    let mut text = String::new();
    let idealisation = if axisymmetric { "axisymmetric" } else { "plane-strain" };
    let _ = write!(
        text,
        "version: 1\n\
         analysis: {{idealisation: {idealisation}}}\n\
         grid: {{type: structured, origin: [0, 0], size: [3.2, 3.2], spacing: {}}}\n\
         materials: {{rubber: {{model: neo-hookean, young: 1, poisson: 0.3}}}}\n\
         bodies:\n\
         - {{name: ring, material: rubber, method: {method}, points_per_cell: 4, shape: {{type: intersection, of: [\n\
           {{type: annulus, center: [0, 0], inner: 1, outer: 2}}, {{type: box, min: [0, 0], max: [3, 3]}}]}}}}\n\
         surfaces: [{{name: inner, body: ring, part: {{box: {{min: [0, 0], max: [1, 1]}}}}}}]\n\
         boundary_conditions:\n\
         - {{name: left, nodes: {{x: 0}}, fix: [x]}}\n\
         - {{name: base, nodes: {{y: 0}}, fix: [y]}}\n\
         loads: [{{name: p, type: pressure, surface: inner, pressure: {}}}]\n\
         steps: {{count: 4}}\n",
        1.6 / n as f64,
        exact.inner_pressure(),
    );
    let mut radius = 0.0;
    run(&text, |_, report| {
        let surface = &report.surfaces[0];
        let (mut sum, mut area) = (0.0, 0.0);
        for (x, a) in surface.position.iter().zip(&surface.area) {
            sum += a * x[0].hypot(x[1]);
            area += a;
        }
        radius = sum / area;
    });
    radius
}

/// Errors of the inner radius for n cells over 1.6, relative to its growth.
fn errors(shell: Shell, axisymmetric: bool, method: &str, to: f64) -> Vec<f64> {
    let errors: Vec<f64> = [8, 16, 32]
        .map(|n| (inner_radius(shell, axisymmetric, method, n, to) / to - 1.0).abs() * to / (to - INNER))
        .to_vec();
    println!("{shell:?}, {method}, to {to}: {errors:?}");
    errors
}

/// A thick cylinder whose inner radius a following pressure doubles, on a grid that does not line up with it.
#[test]
fn a_following_pressure_doubles_the_inner_radius_of_a_ring() {
    for (method, most) in MOST {
        let errors = errors(Shell::Cylinder, false, method, 2.0);
        assert!(errors[2] < most && errors[2] < errors[0], "{method}: {errors:?}");
    }
}

/// A hollow sphere as a body of revolution.
#[test]
fn a_following_pressure_inflates_a_sphere() {
    for (method, most) in MOST {
        let errors = errors(Shell::Sphere, true, method, 1.5);
        assert!(errors[2] < most && errors[2] < errors[0], "{method}: {errors:?}");
    }
}

/// Largest error on the finest grid. Points of the standard method do not integrate cut cells; their error falls slowly.
const MOST: [(&str, f64); 3] = [("mpm", 0.05), ("gimp", 0.005), ("cpdi2", 0.005)];

/// A block under pressure on all sides, held at its equilibrium stretch and turned by 90°: the nodes need no forces at any
/// angle. Exact, because the sides of the domains are the facets of the surface.
#[test]
fn a_block_under_pressure_has_no_residual_at_any_angle() {
    let (young, poisson, e) = (1.0, 0.3, -0.05);
    let [lame, shear] = [young * poisson / (1.3 * 0.4), young / 2.6];
    let pressure = -2.0 * (lame + shear) * e * f64::exp(-2.0 * e);
    let stretch = f64::exp(e);
    let text = format!(
        "version: 1\n\
         grid: {{type: structured, origin: [-2, -2], size: [4, 4], spacing: 0.25}}\n\
         materials: {{rubber: {{model: hencky, young: {young}, poisson: {poisson}}}}}\n\
         bodies: [{{name: block, material: rubber, method: cpdi2, points_per_cell: 2, \
                   shape: {{type: box, min: [-1, -0.5], max: [1, 0.5]}}}}]\n\
         surfaces: [{{name: all, body: block, spacing: 0.125}}]\n\
         boundary_conditions:\n\
         - name: turn\n  \
           nodes: {{box: {{min: [-2, -2], max: [2, 2]}}}}\n  \
           where: {{a: factor*pi/2}}\n  \
           ux: \"{stretch}*(cos(a)*X - sin(a)*Y) - X\"\n  \
           uy: \"{stretch}*(sin(a)*X + cos(a)*Y) - Y\"\n\
         loads: [{{name: p, type: pressure, surface: all, pressure: {pressure}, curve: [[0, 1], [1, 1]]}}]\n\
         steps: {{count: 10}}\n"
    );
    let mut steps = 0;
    run(&text, |_, report| {
        steps += 1;
        let largest = report.grid.reaction.iter().flatten().fold(0.0f64, |most, r| most.max(r.abs()));
        assert!(largest < 1e-10 * pressure, "step {steps}: {largest:e} of {pressure}");
        assert!(report.loads[0].iter().all(|f| f.abs() < 1e-12 * pressure), "{:?}", report.loads);
        assert!((report.surfaces[0].area.iter().sum::<f64>() / stretch - 6.0).abs() < 1e-10);
    });
    assert_eq!(steps, 10);
}

/// A body that nothing but water holds up displaces its weight.
#[test]
fn a_floating_body_displaces_its_weight() {
    let text = "version: 1\n\
         grid: {type: structured, origin: [0, 0], size: [2, 4], spacing: 0.25}\n\
         materials: {wood: {model: hencky, young: 1e7, poisson: 0, density: 600}}\n\
         bodies: [{name: boat, material: wood, method: gimp, points_per_cell: 2, \
                   shape: {type: box, min: [0, 1], max: [1, 2]}}]\n\
         surfaces: [{name: hull, body: boat}]\n\
         boundary_conditions: [{name: left, nodes: {x: 0}, fix: [x]}]\n\
         loads:\n\
         - {name: weight, type: gravity, acceleration: [0, -9.81]}\n\
         - {name: water, type: pressure, surface: hull, hydrostatic: {level: 1.5, unit_weight: 9.81e3}}\n\
         steps: {count: 1}\n";
    let weight = 600.0 * 9.81;
    let (_, points) = run(text, |_, report| {
        let [gravity, water] = [report.loads[0][1], report.loads[1][1]];
        assert!((gravity + weight).abs() < 1e-9 * weight && (water - weight).abs() < 1e-8 * weight);
        let deepest = report.surfaces[0].position.iter().fold(f64::INFINITY, |y, x| y.min(x[1]));
        // The draught of the base; the elastic shortening is of the order of 1e-4.
        assert!((1.5 - deepest - 0.6).abs() < 1e-3, "{deepest}");
        let orders = mpm::quality::newton_order(&report.residuals);
        println!("residuals {:?}, order {orders:?}", report.residuals);
    });
    assert!(points.converged.position.iter().all(|x| x[1] > 0.8 && x[1] < 2.0));
}
