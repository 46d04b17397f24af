//! Blocks under flat tools: uniform stress, friction, dead loads.

use super::{Run, run, run_model, tools};
use crate::basis::Method;
use crate::formula::Formula;
use crate::grid::Structured;
use crate::material::Hencky;
use crate::model::{Builder, Fill, Freedom, Interface, LoadCurve, Model, Tool, ToolPart};
use crate::solver::{Solvable, SolveError};
use crate::terms::Mode;
use crate::tool::{HalfSpace, Pose};

/// A tool that fills the half-space above (normal pointing down) or below a height.
pub(super) fn plate<const D: usize>(name: &str, height: f64, up: f64) -> Tool<D> {
    let mut normal = [0.0; D];
    normal[D - 1] = up;
    let mut position = [0.0; D];
    position[D - 1] = height;
    let pose = Pose::new(position, [0.0; 3]).unwrap();
    Tool::new(name, HalfSpace::new([0.0; D], normal).unwrap(), pose)
}

/// A cube of 0.8 m on rollers, compressed by 0.2 m between its floor and a plate.
fn platen<const D: usize>(method: Method, steps: usize, h: f64) -> Run<D>
where
    Model<D>: Solvable<D>,
{
    platen_with_parts(method, steps, h, Vec::new())
}

fn platen_with_parts<const D: usize>(method: Method, steps: usize, h: f64, parts: Vec<ToolPart<D>>) -> Run<D>
where
    Model<D>: Solvable<D>,
{
    let n = (1.2 / h).round() as usize;
    let mut tool = plate::<D>("platen", 0.8, -1.0);
    tool.parts = parts;
    tool.translation[D - 1] = Freedom::Prescribed(Formula::constant(-0.2));
    let mut builder = Builder::new(Structured::new([0.0; D], [h; D], [n; D]))
        .material("rubber", Hencky::new(1e6, 0.0))
        .body("cube", "rubber", Fill { method, ..Fill::default() }, |x| x.iter().all(|x| *x < 0.8))
        .tool(tool);
    for d in 0..D {
        let held = std::array::from_fn(|k| k == d);
        builder = builder
            .fix(["left", "front", "floor"][if d == D - 1 { 2 } else { d }], held, move |x| x[d] == 0.0);
    }
    run(builder.steps(steps)).unwrap()
}

/// Under uniform stress, each part bears the forces of the contact points in its box, which moves with the tool: 9 and
/// 7 of 16 corners.
#[test]
fn parts_bear_their_share() {
    let part = |name: &str, from: f64, to: f64| ToolPart {
        name: name.to_owned(),
        sides: Some(vec![0]),
        bounds: Some([[from, 0.7], [to, 0.8]]),
    };
    let other_side = ToolPart { sides: Some(vec![1]), ..part("none", 0.0, 0.8) };
    let parts = vec![part("left", 0.0, 0.45), part("right", 0.45, 0.8), other_side];
    let run = platen_with_parts::<2>(Method::Gimp, 2, 0.2, parts);
    for report in &run.reports {
        let tool = &tools(report)[0];
        let [left, right, none] = &tool.parts[..] else { panic!("{:?}", tool.parts) };
        assert!((left.force[1] / tool.force[1] - 9.0 / 16.0).abs() < 1e-6, "{:?}", tool.parts);
        assert!((left.force[1] + right.force[1] - tool.force[1]).abs() < 1e-9 * tool.force[1].abs());
        assert!((left.moment[2] + right.moment[2] - tool.moment[2]).abs() < 1e-9 * tool.moment[2].abs());
        // The reference point is above the left end: Σ x over the corners is 2.0 m of 6.4 m.
        assert!((left.moment[2] / tool.moment[2] - 2.0 / 6.4).abs() < 1e-6, "{:?}", tool.parts);
        assert_eq!((left.contacts, right.contacts, none.contacts), (9, 7, 0));
        assert_eq!(none.force, [0.0; 2]);
    }
}

fn check_platen<const D: usize>(run: &Run<D>, tolerance: f64) {
    let expected = 1e6 * 0.75f64.ln() / 0.75;
    let area = 0.8f64.powi(D as i32 - 1);
    let last = run.reports.last().unwrap();
    for p in 0..run.points.len() {
        let j = run.points.converged.deformation_gradient[p].determinant();
        let stress = run.points.converged.kirchhoff_stress[p].component(D - 1, D - 1) / j;
        assert!(
            (stress / expected - 1.0).abs() < tolerance,
            "{stress} at {:?}",
            run.points.converged.position[p]
        );
    }
    for report in &run.reports {
        assert!(tools(report)[0].overlap < 1e-6, "{}", tools(report)[0].overlap);
        assert!(report.solves() <= 6 || run.reports.len() == 1, "{:?}", report.residuals);
    }
    let force = tools(last)[0].force[D - 1];
    assert!((force / (expected * area) - 1.0).abs() < tolerance, "{force}");
    // The body is in equilibrium between tool and floor.
    let floor = last.reactions[D - 1][D - 1];
    assert!((force + floor).abs() < 1e-9 * floor.abs(), "{force} {floor}");
    let energy = run.summary.energy_error();
    assert!(energy.abs() < 2e-3 || run.reports.len() == 1, "{energy}");
}

#[test]
fn a_platen_compresses_a_cube_uniformly() {
    for method in [Method::Gimp, Method::Cpdi1, Method::Cpdi2] {
        check_platen(&platen::<2>(method, 20, 0.1), 1e-6);
    }
    // When standard points cross cells, a uniform stress is no longer in equilibrium.
    check_platen(&platen::<2>(Method::Mpm, 1, 0.1), 1e-6);
    for method in [Method::Gimp, Method::Cpdi2] {
        check_platen(&platen::<3>(method, 20, 0.2), 1e-6);
    }
}

/// A block on a floor under inclined gravity: `tangent` is the ratio of its components along and normal to the floor.
fn tilted(friction: f64, tangent: f64, method: Method) -> Result<Run<2>, SolveError> {
    let mut floor = plate::<2>("floor", 0.0, 1.0);
    floor.interface = Some(Interface::with_friction(friction));
    let fill = Fill { method, density: 1000.0, ..Fill::default() };
    let inside = |x: &[f64; 2]| x[0] > 0.0 && x[0] < 1.0 && x[1] > 0.0 && x[1] < 0.25;
    let builder = Builder::new(Structured::new([-0.5, -0.25], [0.125; 2], [16, 8]))
        .material("rubber", Hencky::new(1e6, 0.0))
        .body("block", "rubber", fill, inside)
        .gravity("weight", [10.0 * tangent, -10.0])
        .tool(floor)
        .steps(2);
    let (mut model, points) = builder.build().unwrap();
    model.newton.tolerance = 1e-11;
    run_model(&model, points)
}

#[test]
fn a_block_sticks_on_a_slope_below_the_angle_of_friction_and_slides_above() {
    for method in [Method::Gimp, Method::Cpdi2] {
        for tangent in [0.27, 0.2999] {
            let stuck = tilted(0.3, tangent, method).unwrap();
            let floor = &tools(stuck.reports.last().unwrap())[0];
            assert!((floor.force[0] + tangent * 2500.0).abs() < 1e-9 * 2500.0, "{:?}", floor.force);
            assert!((floor.force[1] - 2500.0).abs() < 1e-9 * 2500.0, "{:?}", floor.force);
        }
        let failed = tilted(0.3, 0.3001, method);
        assert!(failed.is_err(), "it slides");
    }
}

/// A block on a floor with friction, pressed by a rough plate and then pulled sideways.
fn pulled(interface: Interface, method: Method) -> Run<2> {
    let mut top = plate::<2>("top", 0.25, -1.0);
    top.interface = Some(Interface::ROUGH);
    let moved = |text| Freedom::Prescribed(Formula::parse(text, &["factor", "t"]).unwrap());
    top.translation = [moved("0.016 * max(t - 0.5, 0)"), moved("-0.01 * min(t, 0.5)")];
    top.curve = LoadCurve::ramp(1.0);
    let mut floor = plate::<2>("floor", 0.0, 1.0);
    floor.interface = Some(interface);
    let inside = |x: &[f64; 2]| x[0] > 0.0 && x[0] < 1.0 && x[1] > 0.0 && x[1] < 0.25;
    let builder = Builder::new(Structured::new([-0.5, -0.25], [0.125; 2], [16, 8]))
        .material("rubber", Hencky::new(1e6, 0.0))
        .body("block", "rubber", Fill { method, ..Fill::default() }, inside)
        .tool(top)
        .tool(floor)
        .steps(8);
    let (mut model, points) = builder.build().unwrap();
    // The block begins to slide in the fifth step.
    model.newton.max_iterations = 40;
    // A rough block lifts at its ends, where the iterations may need smaller steps.
    model.stepping.smallest = 0.05;
    run_model(&model, points).unwrap()
}

#[test]
fn a_sliding_block_is_held_back_by_exactly_the_friction() {
    for method in [Method::Mpm, Method::Gimp, Method::Cpdi2] {
        let sliding = pulled(Interface::with_friction(0.2), method);
        let last = sliding.reports.last().unwrap();
        let [top, floor] = tools(last) else { panic!("two tools") };
        let area: f64 = floor.contacts.iter().map(|contact| contact.area).sum();
        // An end of the block may lift; the corners of all other domains contribute their shares of the unit length.
        assert!(area > 0.7 && (area < 1.03 || method != Method::Cpdi2), "{area}");
        assert!(floor.contacts.iter().all(|contact| contact.mode == Mode::Slip));
        assert!((floor.force[0] / floor.force[1] + 0.2).abs() < 1e-9, "{:?}", floor.force);
        for d in 0..2 {
            assert!((top.force[d] + floor.force[d]).abs() < 1e-8 * top.force[1].abs(), "{:?}", top.force);
        }
        let moment = last.moment_error.unwrap();
        assert!(moment < 1e-9, "{moment}");
        assert!(sliding.summary.friction_work > 0.1, "{}", sliding.summary.friction_work);
        let energy = sliding.summary.energy_error();
        assert!(energy.abs() < 1e-2, "{energy}");
        let stuck = pulled(Interface::ROUGH, method);
        let slip = tools(stuck.reports.last().unwrap())[1].slip;
        assert!(slip <= 1e-4 * 0.125, "{slip}");
    }
}

/// Once the contact points that touch no longer change, each residual is about the square of the one before.
#[test]
fn iterations_converge_quadratically_in_stick_and_in_slip() {
    for (interface, mode) in [(Interface::ROUGH, Mode::Stick), (Interface::with_friction(0.2), Mode::Slip)] {
        let run = pulled(interface, Method::Gimp);
        let mut seen = 0;
        for report in run.reports.iter().skip(4) {
            for [before, last] in report.residuals.array_windows() {
                if *last <= 1e-7 && (1e-6..0.05).contains(before) {
                    seen += 1;
                    assert!(*last < before.powf(1.8).max(1e-12), "{:?}", report.residuals);
                }
            }
        }
        assert!(seen > 2, "{seen}");
        let last = run.reports.last().unwrap();
        let alike = tools(last)[1].contacts.iter().filter(|contact| contact.mode == mode).count();
        assert!(alike > 8, "{alike}");
    }
}
