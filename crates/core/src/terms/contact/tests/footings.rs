//! Footings and cylinders on elastic ground.

use std::f64::consts::PI;

use super::{Run, run, run_model, tools};
use crate::basis::Method;
use crate::formula::Formula;
use crate::grid::Structured;
use crate::material::Hencky;
use crate::model::{Builder, Control, Controlled, Fill, Freedom, Interface, LoadCurve, Tool, ToolLoad};
use crate::region::{Ball, Brick};
use crate::tool::Pose;

/// A rough footing on a block, pushed in by a prescribed motion or a load.
fn footing(motion: Freedom, load: f64) -> Run<2> {
    controlled(motion, load, Control::Load, 1)
}

/// The footing problem with this control of the load factor, in this number of steps.
fn controlled(motion: Freedom, load: f64, control: Control, steps: usize) -> Run<2> {
    let shape = Brick::new([-0.5, 0.0], [0.5, 0.5]).unwrap();
    let mut tool = Tool::new("footing", shape, Pose::new([1.0, 1.0], [0.0; 3]).unwrap());
    tool.interface = Some(Interface::ROUGH);
    tool.translation[1] = motion;
    tool.loads.push(ToolLoad { force: [0.0, load], moment: [0.0; 3], curve: LoadCurve::ramp(1.0) });
    let builder = Builder::new(Structured::new([0.0; 2], [0.25; 2], [8, 6]))
        .material("clay", Hencky::new(1e6, 0.3))
        .body("ground", "clay", Fill { method: Method::Gimp, ..Fill::default() }, |x| x[1] < 1.0)
        .fix("sides", [true, false], |x| x[0] == 0.0 || x[0] == 2.0)
        .fix("floor", [true, true], |x| x[1] == 0.0)
        .tool(tool)
        .steps(steps);
    let (mut model, points) = builder.build().unwrap();
    model.stepping.control = control;
    // The states of the contact points need more iterations than the deformation of the bodies.
    model.newton.max_iterations = 60;
    model.stepping.smallest = 0.01;
    run_model(&model, points).unwrap()
}

#[test]
fn a_footing_sinks_under_a_dead_load_as_far_as_the_load_pushes_it() {
    let pushed = footing(Freedom::Prescribed(Formula::constant(-0.02)), 0.0);
    let force = tools(&pushed.reports[0])[0].force[1];
    assert!(force < -1e3, "{force}");
    let loaded = footing(Freedom::Free, force);
    let tool = &tools(&loaded.reports[0])[0];
    assert!((tool.force[1] / force - 1.0).abs() < 1e-9, "{} {force}", tool.force[1]);
    assert!((tool.displacement[1] / -0.02 - 1.0).abs() < 1e-5, "{}", tool.displacement[1]);
}

/// The load factor follows from the displacement of the footing, whether a load or a prescribed motion grows with the
/// factor.
#[test]
fn the_displacement_of_a_footing_determines_its_load_and_its_motion() {
    let pushed = footing(Freedom::Prescribed(Formula::constant(-0.02)), 0.0);
    let force = tools(&pushed.reports[0])[0].force[1];
    let control = Control::Displacement { controlled: Controlled::Tool(0), axis: 1, to: -0.02 };
    let motion = Formula::parse("-0.05 * factor - 0.03 * factor^2", &["factor", "t"]).unwrap();
    let ways = [(Freedom::Free, -1e5), (Freedom::Prescribed(motion), 0.0)];
    for (freedom, load) in ways {
        let run = controlled(freedom, load, control, 1);
        let (tool, factor) = (&tools(&run.reports[0])[0], run.reports[0].load_factor.unwrap());
        assert!((tool.displacement[1] / -0.02 - 1.0).abs() < 1e-9, "{}", tool.displacement[1]);
        assert!((tool.force[1] / force - 1.0).abs() < 1e-5, "{} {force}", tool.force[1]);
        if load == 0.0 {
            assert!((0.05 * factor + 0.03 * factor * factor - 0.02).abs() < 1e-9, "{factor}");
        } else {
            assert!((factor * load / tool.force[1] - 1.0).abs() < 1e-8, "{factor} {}", tool.force[1]);
            assert!((tool.load[1] / tool.force[1] - 1.0).abs() < 1e-8, "{:?}", tool.load);
        }
    }
}

#[test]
fn a_loaded_and_a_driven_footing_follow_an_arc_length() {
    let along = |freedom, load| controlled(freedom, load, Control::ArcLength { length: Some(0.02) }, 4);
    let loaded = along(Freedom::Free, -1e5);
    let driven = along(Freedom::Prescribed(Formula::constant(-0.1)), 0.0);
    for report in &loaded.reports {
        let (tool, factor) = (&tools(report)[0], report.load_factor.unwrap());
        assert!((factor * -1e5 / tool.force[1] - 1.0).abs() < 1e-8, "{factor} {}", tool.force[1]);
    }
    let [a, b] = [&loaded, &driven].map(|run| &tools(run.reports.last().unwrap())[0]);
    // Steps that are cut differently end at slightly different points of the same path.
    let stiffness = [a, b].map(|tool| tool.force[1] / tool.displacement[1]);
    assert!((stiffness[0] / stiffness[1] - 1.0).abs() < 5e-3, "{stiffness:?}");
    assert!((a.displacement[1] / b.displacement[1] - 1.0).abs() < 0.02, "{:?}", a.displacement);
    let lengths: Vec<f64> = loaded.reports.iter().map(|report| tools(report)[0].displacement[1]).collect();
    assert!(lengths.is_sorted_by(|a, b| a > b), "{lengths:?}");
}

/// Errors, relative to Hertz's solution, of the half width and of the share of the load near the middle, for a cylinder
/// on a block.
fn hertz(cells: usize, method: Method) -> [f64; 2] {
    let h = 1.0 / cells as f64;
    let (modulus, poisson, radius) = (1e6, 0.3, 1.0);
    let shape = Ball::new([0.0, radius], radius).unwrap();
    let mut tool = Tool::new("cylinder", shape, Pose::new([0.0, 1.0], [0.0; 3]).unwrap());
    tool.translation[1] = Freedom::Prescribed(Formula::constant(-0.012));
    let builder = Builder::new(Structured::new([0.0; 2], [h; 2], [cells, cells + 2]))
        .material("steel", Hencky::new(modulus, poisson))
        .body("block", "steel", Fill { method, ..Fill::default() }, |x| x[1] < 1.0)
        .fix("sides", [true, false], |x| x[0] == 0.0 || x[0] == 1.0)
        .fix("floor", [false, true], |x| x[1] == 0.0)
        .tool(tool)
        .steps(2);
    let run = run(builder).unwrap();
    let state = &tools(run.reports.last().unwrap())[0];
    // The symmetry plane halves the cylinder.
    let load = 2.0 * -state.force[1];
    let half_width = (4.0 * load * radius * (1.0 - poisson * poisson) / (PI * modulus)).sqrt();
    // ∫ p x² dx = P a²/4.
    let second: f64 = state.contacts.iter().map(|c| -2.0 * c.force[1] * c.position[0].powi(2)).sum();
    let measured = 2.0 * (second / load).sqrt();
    // The share of the load within half of the half width: 2/π (asin ½ + ½ √¾), interpolated in the sums at the contact
    // points.
    let mut places: Vec<[f64; 2]> =
        state.contacts.iter().map(|c| [c.position[0], -2.0 * c.force[1]]).collect();
    places.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut sums = vec![[0.0, 0.0]];
    let mut sum = 0.0;
    for pair in places.chunk_by(|a, b| (a[0] - b[0]).abs() < 0.25 * h) {
        let force: f64 = pair.iter().map(|[_, f]| f).sum();
        let x = pair.iter().map(|[x, _]| x).sum::<f64>() / pair.len() as f64;
        // At the plane of symmetry, the whole force belongs to the first half interval; elsewhere half of it lies
        // before x.
        let before = if x < 0.25 * h { 0.0 } else { 0.5 * force };
        sums.push([x, sum + before]);
        sum += force;
    }
    let at = 0.5 * half_width;
    let k = sums.iter().position(|[x, _]| *x > at).unwrap();
    let ([x0, s0], [x1, s1]) = (sums[k - 1], sums[k]);
    let share = (s0 + (s1 - s0) * (at - x0) / (x1 - x0)) / load;
    let expected = 2.0 / PI * (0.5f64.asin() + 0.5 * 0.75f64.sqrt());
    [measured / half_width - 1.0, share / expected - 1.0]
}

#[test]
fn a_cylinder_presses_like_hertz() {
    for method in [Method::Gimp, Method::Cpdi2] {
        let coarse = hertz(32, method);
        let fine = hertz(64, method);
        assert!(coarse[0].abs() < 0.08 && fine[0].abs() < 0.04, "{coarse:?} {fine:?}");
        assert!(coarse[1].abs() < 0.04 && fine[1].abs() < 0.02, "{coarse:?} {fine:?}");
    }
}
