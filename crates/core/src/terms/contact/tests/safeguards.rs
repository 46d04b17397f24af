//! Errors that contact reports, and the continuation of a run from its saved state.

use super::blocks::plate;
use super::{Reports, run, tools};
use crate::basis::Method;
use crate::formula::Formula;
use crate::grid::Structured;
use crate::material::Hencky;
use crate::model::{Builder, Fill, Freedom, Interface, Tool};
use crate::region::Brick;
use crate::solver::{Silent, SolveError, Stepper};
use crate::terms::ContactError;
use crate::tool::{Pose, Shape};

fn block(method: Method, tool: Tool<2>, steps: usize) -> Builder<2> {
    Builder::new(Structured::new([-0.5, 0.0], [0.25; 2], [8, 8]))
        .material("rubber", Hencky::new(1e6, 0.2))
        .body("block", "rubber", Fill { method, ..Fill::default() }, |x| {
            x[0] > 0.0 && x[0] < 1.0 && x[1] < 1.0
        })
        .fix("floor", [true, true], |x| x[1] == 0.0)
        .tool(tool)
        .steps(steps)
}

fn contact_error(builder: Builder<2>) -> ContactError {
    match run(builder) {
        Err(SolveError::Contact { error, .. }) => *error,
        Err(error) => panic!("{error}"),
        Ok(_) => panic!("accepted"),
    }
}

#[test]
fn a_tool_inside_a_body_at_the_start_is_refused() {
    for method in [Method::Mpm, Method::Gimp, Method::Cpdi2] {
        let error = contact_error(block(method, plate("plate", 0.9, -1.0), 1));
        let ContactError::Overlap { place, overlap } = error else { panic!("{error}") };
        assert_eq!((place.other.as_str(), place.body.as_str()), ("tool `plate`", "block"));
        assert!(overlap > 0.0 && overlap < 0.1 + 1e-12, "{overlap}");
        // Deep inside the tool, the overlap is found, too.
        let error = contact_error(block(method, plate("plate", -9.0, -1.0), 1));
        assert!(matches!(error, ContactError::Overlap { .. }), "{error}");
        let slight = run(block(method, plate("plate", 1.0 - 1e-9, -1.0), 1));
        assert!(slight.is_ok(), "{:?}", slight.err());
    }
}

#[test]
fn large_motions_are_cut() {
    // A blade that would jump to the other side of the upper half of the block.
    let blade = Brick::new([-0.3, 0.0], [1.5, 0.05]).unwrap();
    let mut tool = Tool::new("blade", blade, Pose::new([0.0, 1.1], [0.0; 3]).unwrap());
    tool.translation[1] = Freedom::Prescribed(Formula::constant(-0.5));
    let (mut model, mut points) = block(Method::Gimp, tool, 1).build().unwrap();
    let failed = Stepper::new(&model, &mut points.clone()).run(&mut Silent);
    assert!(matches!(failed, Err(SolveError::Contact { .. })), "{failed:?}");
    model.stepping.smallest = 0.01;
    let mut reports = Reports(Vec::new());
    let summary = Stepper::new(&model, &mut points).run(&mut reports).unwrap().summary;
    assert!(summary.steps > 3 && summary.failed_attempts > 0, "{} steps", summary.steps);
    let state = &tools(reports.0.last().unwrap())[0];
    assert!((state.displacement[1] + 0.5).abs() < 1e-12);
    assert!(points.converged.position.iter().all(|x| x[1] < 0.6), "nothing is left above the blade");
}

#[test]
fn a_tool_without_support_is_refused() {
    let mut tool = plate("plate", 1.2, -1.0);
    tool.translation[1] = Freedom::Free;
    let error = contact_error(block(Method::Gimp, tool, 1));
    assert!(matches!(error, ContactError::Loose { component: "along y", .. }), "{error}");
    let mut tool = plate("plate", 1.2, -1.0);
    tool.translation[1] = Freedom::Prescribed(Formula::parse("1/(factor - 1)", &["factor", "t"]).unwrap());
    let error = contact_error(block(Method::Gimp, tool, 1));
    assert!(matches!(error, ContactError::NotFinite { .. }), "{error}");
}

fn turned_footing() -> Tool<2> {
    let shape = Brick::new([-0.3, 0.0], [0.3, 0.3]).unwrap();
    let mut tool = Tool::new("footing", shape, Pose::new([0.5, 1.0], [0.0; 3]).unwrap());
    tool.interface = Some(Interface::with_friction(0.3));
    tool.translation[1] = Freedom::Prescribed(Formula::constant(-0.08));
    tool.rotation[2] = Freedom::Prescribed(Formula::constant(0.1));
    tool
}

#[test]
fn a_run_goes_on_from_its_saved_state_with_the_same_bits() {
    for method in [Method::Mpm, Method::Gimp, Method::Cpdi2] {
        let (model, mut points) = block(method, turned_footing(), 6).build().unwrap();
        let mut again = points.clone();
        let mut whole = Reports(Vec::new());
        Stepper::new(&model, &mut points).run(&mut whole).unwrap();
        let mut stepper = Stepper::new(&model, &mut again);
        for _ in 0..3 {
            stepper.step(&mut Silent).unwrap();
        }
        let saved = serde_json::to_string(stepper.reached()).unwrap();
        let mut rest = Reports(Vec::new());
        let reached = serde_json::from_str(&saved).unwrap();
        Stepper::new(&model, &mut again).resume(reached).unwrap().run(&mut rest).unwrap();
        assert_eq!(points.converged.position, again.converged.position, "{method:?}");
        assert_eq!(
            whole.0[3..].iter().map(tools).collect::<Vec<_>>(),
            rest.0.iter().map(tools).collect::<Vec<_>>()
        );
    }
}

#[test]
fn a_square_turns_in_its_hole_and_no_point_slips_through() {
    for method in [Method::Gimp, Method::Cpdi2] {
        let hole = |x: &[f64; 2]| x.iter().all(|x| (x - 1.0).abs() < 0.25);
        let shape = Brick::new([-0.25; 2], [0.25; 2]).unwrap();
        let mut tool = Tool::new("square", shape, Pose::new([1.0, 1.0], [0.0; 3]).unwrap());
        tool.interface = Some(Interface::with_friction(0.1));
        tool.rotation[2] = Freedom::Prescribed(Formula::constant(0.5));
        let (mut model, mut points) = Builder::new(Structured::new([0.0; 2], [0.125; 2], [16, 16]))
            .material("clay", Hencky::new(1e6, 0.3))
            .body("block", "clay", Fill { method, ..Fill::default() }, |x| !hole(x))
            .fix("border", [true, true], |x| x.iter().any(|x| *x == 0.0 || *x == 2.0))
            .tool(tool)
            .steps(20)
            .build()
            .unwrap();
        model.stepping.smallest = 0.01;
        model.newton.max_iterations = 40;
        let mut reports = Reports(Vec::new());
        Stepper::new(&model, &mut points).run(&mut reports).unwrap();
        let state = tools(reports.0.last().unwrap())[0].clone();
        assert!((state.rotation[2] - 0.5).abs() < 1e-9);
        for x in &points.converged.position {
            let gap = state.pose.closest(&shape as &dyn Shape<2>, *x, f64::INFINITY).unwrap().gap;
            assert!(gap > 0.0, "{x:?} {gap}");
        }
    }
}
