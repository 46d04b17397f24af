//! Surfaces of bodies: following pressures compared with the ordinary differential equation of radial motion, bodies in
//! water, and rotations.

use std::fmt::Write;

use mpm::material::{Hencky, Material, NeoHookean};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::StepReport;
use mpm::surface::SurfaceFields;

use crate::verification::analysis::watch;
use crate::verification::radial::{Inner, Radial, Shell};

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

/// Runs a deck given as text, and passes every converged step to `look`.
pub fn run(text: &str, mut look: impl FnMut(&Points<2>, &StepReport<2>)) -> (Model<2>, Points<2>) {
    let (model, mut points) = built(text);
    watch(&model, &mut points, |points, report| look(points, report)).unwrap_or_else(|e| panic!("{e}"));
    (model, points)
}

/// The laws of the shells.
fn law(name: &str) -> Box<dyn Material> {
    match name {
        "hencky" => Box::new(Hencky::new(1.0, 0.3)),
        _ => Box::new(NeoHookean::new(1.0, 0.3)),
    }
}

/// A quarter of a ring, or of a sphere as a body of revolution, whose inner radius grows from 1 to 2 (to 1.5 for the
/// Hencky sphere) in four steps under a following pressure, on a grid with n cells over 1.6, which does not line up
/// with the body. Returns the error of the pressure relative to the solution of the ordinary differential equation at
/// the mean radius that the surface has reached. The pressure of the Hencky ring has its maximum there, so that only a
/// prescribed displacement can lead to it.
fn error_of_pressure(shell: Shell, law_name: &str, method: &str, n: usize) -> f64 {
    let idealisation = if shell == Shell::Sphere { "axisymmetric" } else { "plane-strain" };
    // The Hencky sphere passes its maximum pressure long before the radius 2.
    let growth = if (shell, law_name) == (Shell::Sphere, "hencky") { 0.5 } else { 1.0 };
    let mut text = String::new();
    let _ = write!(
        text,
        "version: 1\n\
         analysis: {{idealisation: {idealisation}}}\n\
         grid: {{type: structured, origin: [0, 0], size: [3.2, 3.2], spacing: {}}}\n\
         materials: {{rubber: {{model: {law_name}, young: 1, poisson: 0.3}}}}\n\
         bodies:\n\
         - {{name: ring, material: rubber, method: {method}, points_per_cell: 4, shape: {{type: intersection, of: [\n\
           {{type: annulus, center: [0, 0], inner: 1, outer: 2}}, {{type: box, min: [0, 0], max: [3, 3]}}]}}}}\n\
         surfaces: [{{name: inner, body: ring, part: {{box: {{min: [0, 0], max: [1, 1]}}}}}}]\n\
         boundary_conditions:\n\
         - {{name: left, nodes: {{x: 0}}, fix: [x]}}\n\
         - {{name: base, nodes: {{y: 0}}, fix: [y]}}\n\
         loads: [{{name: p, type: pressure, surface: inner, pressure: 1}}]\n\
         steps: {{count: 4, control: {{type: displacement, probe: inner, axis: x, to: {growth}}}}}\n\
         output: {{probes: [{{name: inner, body: ring, nearest: [1.01, 0.011]}}]}}\n",
        1.6 / n as f64,
    );
    let law = law(law_name);
    let mut exact = Radial::new(shell, [INNER, OUTER], law.as_ref(), 200);
    let mut error = 0.0;
    run(&text, |_, report| {
        let surface = &report.list::<SurfaceFields<2>>()[0];
        let (mut sum, mut area) = (0.0, 0.0);
        for (x, a) in surface.position.iter().zip(&surface.area) {
            sum += a * x[0].hypot(x[1]);
            area += a;
        }
        exact.step(Inner::Moved(sum / area), |_| 0.0);
        error = surface.pressure[0] / exact.inner_pressure() - 1.0;
    });
    error.abs()
}

/// Errors with n = 8, 16, 32, and the order in h: the slope of the least-squares line through their logarithms.
fn order(shell: Shell, law: &str, method: &str) -> (Vec<f64>, f64) {
    let errors: Vec<f64> = [8, 16, 32].map(|n| error_of_pressure(shell, law, method, n)).to_vec();
    let order = 0.5 * (errors[0] / errors[2]).log2();
    println!("{shell:?}, {law}, {method}: {errors:.5?}, order {order:.2}");
    (errors, order)
}

/// Lowest orders and largest errors on the finest grid. The force that is lost when the points are linked to a fresh
/// grid limits the accuracy: the points of the standard method do not integrate cells exactly after the first step.
const EXPECTED: [(&str, f64, f64); 3] = [("mpm", 0.2, 0.03), ("gimp", 1.0, 0.003), ("cpdi2", 1.0, 0.003)];

/// A thick cylinder whose inner radius a following pressure doubles.
#[test]
fn a_following_pressure_doubles_the_inner_radius_of_a_ring() {
    for law in ["neo-hookean", "hencky"] {
        for (method, least, most) in EXPECTED {
            let (errors, order) = order(Shell::Cylinder, law, method);
            assert!(order > least && errors[2] < most, "{law}, {method}: {errors:?}, {order}");
        }
    }
}

/// A hollow sphere as a body of revolution.
#[test]
fn a_following_pressure_inflates_a_sphere() {
    for law in ["neo-hookean", "hencky"] {
        for (method, least, most) in EXPECTED {
            let (errors, order) = order(Shell::Sphere, law, method);
            // The error has no constant sign on these grids, which blurs the order.
            assert!(order > 0.8 * least && errors[2] < most, "{law}, {method}: {errors:?}, {order}");
        }
    }
}

/// An eighth of a hollow sphere in space.
#[test]
fn a_following_pressure_inflates_a_sphere_in_space() {
    let law = NeoHookean::new(1.0, 0.3);
    let mut exact = Radial::new(Shell::Sphere, [INNER, OUTER], &law, 200);
    exact.step(Inner::Moved(1.5), |_| 0.0);
    let errors = [4.0, 8.0].map(|n| {
        let text = format!(
            "version: 1
analysis: {{idealisation: solid}}
grid: {{type: structured, origin: [0, 0, 0], size: [3.2, 3.2, 3.2], spacing: {h}}}
materials: {{rubber: {{model: neo-hookean, young: 1, poisson: 0.3}}}}
bodies:
- name: shell
  material: rubber
  method: gimp
  points_per_cell: 3
  shape:
    type: intersection
    of:
    - {{type: difference, from: {{type: sphere, center: [0, 0, 0], radius: 2}}, minus: [{{type: sphere, center: [0, 0, 0], radius: 1}}]}}
    - {{type: box, min: [0, 0, 0], max: [3, 3, 3]}}
surfaces: [{{name: inner, body: shell, spacing: {spacing}, part: {{box: {{min: [1e-4, 1e-4, 1e-4], max: [1, 1, 1]}}}}}}]
boundary_conditions:
- {{name: left, nodes: {{x: 0}}, fix: [x]}}
- {{name: front, nodes: {{y: 0}}, fix: [y]}}
- {{name: base, nodes: {{z: 0}}, fix: [z]}}
loads: [{{name: p, type: pressure, surface: inner, pressure: {p}}}]
steps: {{count: 4}}
",
            h = 1.6 / n,
            spacing = 0.8 / n,
            p = exact.inner_pressure()
        );
        let (model, mut points) =
            mpm::deck::build::build::<3>(&loaded(&text)).unwrap_or_else(|e| panic!("{e:?}"));
        let mut radius = MeanRadius { from: 0.0, to: 0.0 };
        mpm::solver::run(&model, &mut points, &mut radius).unwrap_or_else(|e| panic!("{e}"));
        (radius.to - radius.from - 0.5).abs() / 0.5
    });
    println!("sphere in space: {errors:?}");
    // Relative to the growth by 0.5; with 16 cells the error is 1.1·10⁻⁴.
    assert!(errors[0] < 0.15 && errors[1] < 0.02, "{errors:?}");
}

/// The mean radius of the samples of the first surface at the start and at the end.
struct MeanRadius {
    from: f64,
    to: f64,
}

impl mpm::solver::Observer<3> for MeanRadius {
    fn converged(
        &mut self,
        model: &Model<3>,
        _: &Points<3>,
        report: &StepReport<3>,
        _: &mpm::solver::Reached,
    ) -> std::io::Result<()> {
        let length = |x: &[f64; 3]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
        let mean = |places: &[[f64; 3]], areas: &[f64]| {
            let sum: f64 = places.iter().zip(areas).map(|(x, a)| a * length(x)).sum();
            sum / areas.iter().sum::<f64>()
        };
        let (surface, now) = (&model.surfaces[0], &report.list::<SurfaceFields<3>>()[0]);
        let areas: Vec<f64> = (0..surface.len()).map(|k| length(&surface.original_area(k))).collect();
        (self.from, self.to) = (mean(&surface.samples, &areas), mean(&now.position, &now.area));
        Ok(())
    }
}

/// A block under pressure on all sides, held at its equilibrium stretch and turned by 90°: the nodes need no forces at
/// any angle. The result is exact, because the sides of the domains are the facets of the surface.
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
        assert!(
            (report.list::<SurfaceFields<2>>()[0].area.iter().sum::<f64>() / stretch - 6.0).abs() < 1e-10
        );
    });
    assert_eq!(steps, 10);
}

/// A body that only water holds up displaces its own weight of water.
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
        let deepest =
            report.list::<SurfaceFields<2>>()[0].position.iter().fold(f64::INFINITY, |y, x| y.min(x[1]));
        // The draught of the base; the elastic shortening is of the order of 1e-4.
        assert!((1.5 - deepest - 0.6).abs() < 1e-3, "{deepest}");
        let orders = mpm::quality::newton_order(&report.residuals);
        println!("residuals {:?}, order {orders:?}", report.residuals);
    });
    assert!(points.converged.position.iter().all(|x| x[1] > 0.8 && x[1] < 2.0));
}
