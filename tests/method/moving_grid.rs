//! Grids whose lines follow prescribed displacements: closed forms, rigid motion, and bitwise equal results.

use mpm::deck::build::build;
use mpm::deck::diagnostic::Diagnostic;
use mpm::deck::load::{LoadedDeck, load_text};
use mpm::model::Model;
use mpm::points::{PointArray, Points};
use mpm::solver::{
    Observer, Reached, Silent, Solvable, SolveError, StepReport, Stepper, resume_stage, run, run_stages,
};

type Build<const D: usize> = fn(&LoadedDeck) -> Result<(Model<D>, Points<D>), Vec<Diagnostic>>;

/// The state of the points, by permanent number, after every step, and the states from which a run can resume.
struct Every<const D: usize> {
    steps: Vec<State>,
    resumable: Vec<(Points<D>, Reached)>,
    /// Grid lines along the last axis, for each step.
    lines: Vec<Vec<f64>>,
}

#[derive(Debug, Clone, PartialEq)]
struct State {
    position: Vec<f64>,
    kirchhoff: Vec<f64>,
    gradient: Vec<f64>,
    reactions: Vec<f64>,
}

impl<const D: usize> Observer<D> for Every<D> {
    fn converged(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        report: &StepReport<D>,
        reached: &Reached,
    ) -> std::io::Result<()> {
        let values = |array| points.array(array).values;
        self.steps.push(State {
            position: values(PointArray::Position),
            kirchhoff: values(PointArray::KirchhoffStress),
            gradient: values(PointArray::DeformationGradient),
            reactions: report.reactions.iter().flatten().copied().collect(),
        });
        self.resumable.push((points.clone(), reached.clone()));
        let axis = &model.grid.lines().unwrap().axes()[D - 1];
        self.lines.push((0..=axis.n_cells()).map(|number| axis.line(number)).collect());
        Ok(())
    }
}

fn loaded(text: &str) -> LoadedDeck {
    load_text("moving.yaml", text.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"))
}

/// Runs a deck from its beginning, or from a state that has been reached.
fn run_from<const D: usize>(build: Build<D>, text: &str, from: Option<(Points<D>, Reached)>) -> Every<D>
where
    Model<D>: Solvable<D>,
{
    let (mut model, mut points) = build(&loaded(text)).unwrap_or_else(|found| panic!("{found:?}"));
    let mut reached = Reached::nothing(&points);
    if let Some((state, from)) = from {
        resume_stage(&mut model, &mut points, &from).unwrap();
        (points, reached) = (state, from);
    }
    let mut every = Every { steps: Vec::new(), resumable: Vec::new(), lines: Vec::new() };
    run_stages(&mut model, &mut points, reached, &mut every).unwrap_or_else(|error| panic!("{error}"));
    every
}

/// A block of height 4 between a floor and a top that is pushed down by 1.5 along the last axis, held at its sides.
fn compression(idealisation: &str, method: &str, spacing: &str, follow: &str) -> String {
    let is_solid = idealisation == "solid";
    let (axis, others) = if is_solid { ("z", "x, y") } else { ("y", "x") };
    let full = |height: f64| if is_solid { format!("[2, 2, {height}]") } else { format!("[2, {height}]") };
    let (zero, block, grid) = (if is_solid { "[0, 0, 0]" } else { "[0, 0]" }, full(4.0), full(7.0));
    format!(
        "
version: 1
analysis: {{idealisation: {idealisation}}}
grid: {{type: structured, origin: {zero}, size: {grid}, spacing: {spacing}{follow}}}
materials: {{m: {{model: hencky, young: 1e6, poisson: 0.3}}}}
bodies: [{{name: b, material: m, method: {method}, points_per_cell: 2, shape: {{type: box, min: {zero}, max: {block}}}}}]
boundary_conditions:
  - {{name: sides, nodes: {{box: {{min: {zero}, max: {grid}}}}}, fix: [{others}]}}
  - {{name: floor, nodes: {{{axis}: 0}}, fix: [{axis}]}}
  - {{name: push, nodes: {{{axis}: 4}}, u{axis}: -1.5}}
steps: {{count: 6}}
solver: {{tolerance: 1e-12}}
"
    )
}

/// Largest error of the axial Kirchhoff stress (λ + 2μ) ln(1 − u/H) in any point after any step, relative to the
/// largest stress.
fn error_of_stress<const D: usize>(every: &Every<D>) -> f64 {
    let (young, poisson) = (1e6, 0.3);
    let modulus = young * (1.0 - poisson) / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    let exact = |step: usize| modulus * f64::ln(1.0 - 1.5 * step as f64 / 6.0 / 4.0);
    assert_eq!(every.steps.len(), 6);
    let axial = |state: &State| state.kirchhoff.chunks(6).map(|tau| tau[D - 1]).collect::<Vec<_>>();
    let errors = every.steps.iter().enumerate().flat_map(|(k, state)| {
        axial(state).into_iter().map(move |tau| (tau - exact(k + 1)).abs()).collect::<Vec<_>>()
    });
    errors.fold(0.0, f64::max) / exact(6).abs()
}

#[test]
fn a_block_under_a_moving_top_is_compressed_uniformly() {
    let follow = ", follow: [{axis: y, from: 4, condition: push}]";
    let in_space = ", follow: [{axis: z, from: 4, to: 4, condition: push}]";
    let graded = "[1, [{to: 2, cells: 3, ratio: 0.8}, {to: 4, cells: 2}, {to: 7, cells: 4, ratio: 1.3}]]";
    for method in ["mpm", "gimp", "cpdi2"] {
        for (idealisation, spacing) in
            [("plane-strain", "1"), ("plane-strain", graded), ("axisymmetric", "0.5")]
        {
            let moving = error_of_stress(&run_from(
                build::<2>,
                &compression(idealisation, method, spacing, follow),
                None,
            ));
            println!("{method}, {idealisation}, spacing {spacing}: {moving:.1e}");
            assert!(moving < 1e-10, "{method} {idealisation} {spacing}: {moving:e}");
        }
        let space =
            error_of_stress(&run_from(build::<3>, &compression("solid", method, "1", in_space), None));
        let fixed = run_from(build::<2>, &compression("plane-strain", method, "1", ""), None);
        let fixed = error_of_stress(&fixed);
        println!("{method}, space: {space:.1e}; on a grid that does not move: {fixed:.2}");
        assert!(space < 1e-10, "{method}: {space:e}");
        assert!(fixed > 0.1, "{method}: the lines must move for this");
    }
}

#[test]
fn lines_stand_where_the_condition_has_moved_them_at_the_start_of_the_step() {
    let follow = ", follow: [{axis: y, from: 4, to: 5, condition: push}]";
    let every = run_from(build::<2>, &compression("plane-strain", "gimp", "1", follow), None);
    for (step, lines) in every.lines.iter().enumerate() {
        let u = -1.5 * step as f64 / 6.0;
        let below = |k: f64| k * (4.0 + u) / 4.0;
        let above = 7.0 - (2.0 - u) / 2.0;
        let exact = [0.0, below(1.0), below(2.0), below(3.0), 4.0 + u, 5.0 + u, above, 7.0];
        for (line, exact) in lines.iter().zip(exact) {
            assert!((line - exact).abs() < 1e-14, "step {step}: {lines:?}");
        }
    }
}

/// A block of clay, pushed by its nodes up to the height 1.5; it touches the upper corner of the grid.
fn carried(method: &str, shape: &str, rest: &str) -> String {
    format!(
        "
version: 1
grid: {{type: structured, origin: [0, 0], size: [4, 4], spacing: [0.5, [{{to: 4, cells: 6, ratio: 1.1}}]], follow: [
  {{axis: x, from: 0, to: 4, condition: push}}, {{axis: y, from: 0, to: 4, condition: push}}]}}
materials: {{m: {{model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 1e3, density: 1800}}}}
bodies: [{{name: b, material: m, method: {method}, points_per_cell: 2, shape: {shape}}}]
boundary_conditions: [{{name: push, nodes: {{box: {{min: [0, 0], max: [4, 1.5]}}}}, ux: 7.3, uy: 0.4*sin(9*factor)}}]
steps: {{count: 7}}
{rest}
"
    )
}

#[test]
fn a_body_that_moves_with_the_whole_grid_is_not_stressed() {
    for method in ["mpm", "gimp", "cpdi1", "cpdi2"] {
        let every = run_from(
            build::<2>,
            &carried(method, "{type: box, min: [2, 0], max: [4, 4]}", "solver: {tolerance: 1e-9}"),
            None,
        );
        let stress =
            every.steps.iter().flat_map(|state| &state.kirchhoff).fold(0.0, |most, s| s.abs().max(most));
        let turn = every
            .steps
            .iter()
            .flat_map(|state| state.gradient.iter().zip([1., 0., 0., 0., 1., 0., 0., 0., 1.].iter().cycle()));
        let strain = turn.fold(0.0, |most, (f, one)| f64::max(most, (f - one).abs()));
        let last = every.steps.last().unwrap();
        println!("{method}: stress {:.1e} of Young's modulus, strain {strain:.1e}", stress / 1e6);
        assert!(stress < 1e-13 * 1e6 && strain < 1e-13, "{method}: {stress:e} {strain:e}");
        assert!(last.position.iter().step_by(2).all(|x| *x > 9.3), "all points have left the original grid");
    }
}

/// A block that slumps under its weight on a floor, in two stages; `follow` is inserted in the deck's grid.
fn slump(method: &str, follow: &str) -> String {
    format!(
        "
version: 1
grid: {{type: structured, origin: [0, 0], size: [5, 4], spacing: 0.5{follow}}}
materials: {{clay: {{model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 10e3, density: 2000}}}}
bodies: [{{name: b, material: clay, method: {method}, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [2, 2]}}}}]
boundary_conditions:
  - {{name: axis, nodes: {{x: 0}}, fix: [x]}}
  - {{name: floor, nodes: {{y: 0}}, fix: [x, y]}}
  - {{name: push, nodes: {{y: 2}}, uy: -0.3, curve: [[0, 0], [1, 1], [2, 0.8]]}}
loads: [{{name: weight, type: gravity, acceleration: [0, -10]}}]
stages:
  - {{name: fall, steps: {{count: 4}}, factors: {{weight: 1}}}}
  - {{name: rest, steps: {{count: 4}}, release: [push], factors: {{weight: 1.1}}}}
"
    )
}

#[test]
fn a_grid_whose_motion_is_zero_changes_no_bit() {
    let still =
        ", follow: [{axis: x, from: 0, to: 5, condition: axis}, {axis: y, from: 0, to: 4, condition: floor}]";
    for method in ["mpm", "gimp", "cpdi2"] {
        // On a grid that may move, the forces that a stage releases stay at nodes.
        let [with, without] = [still, ""].map(|follow| {
            run_from(build::<2>, &slump(method, follow).replace("release: [push], ", ""), None)
        });
        assert!(with.steps.len() >= 8 && with.steps == without.steps, "{method}");
    }
}

#[test]
fn resumed_runs_and_any_number_of_threads_have_the_same_bits() {
    let follow = ", follow: [{axis: y, from: 2, condition: push}]";
    for method in ["mpm", "gimp", "cpdi2"] {
        let deck = slump(method, follow);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| run_from(build::<2>, &deck, None))
        };
        let (one, two) = (on(1), on(2));
        assert!(one.steps == two.steps, "{method}: threads");
        assert!(one.lines[4] != one.lines[0], "the grid has moved");
        for (after, (points, reached)) in one.resumable.iter().enumerate() {
            let text = serde_json::to_string(reached).unwrap();
            let from = (points.clone(), serde_json::from_str(&text).unwrap());
            let resumed = run_from(build::<2>, &deck, Some(from));
            assert!(resumed.steps == one.steps[after + 1..], "{method}: resumed after step {}", after + 1);
        }
    }
}

/// Users of the library must move the grid themselves, or leave it to `run_stages`.
#[test]
fn a_grid_that_has_not_been_moved_is_refused() {
    let follow = ", follow: [{axis: y, from: 4, condition: push}]";
    let text = compression("plane-strain", "gimp", "1", follow);
    let built = || build::<2>(&loaded(&text)).unwrap();
    let (model, mut points) = built();
    let refused = run(&model, &mut points, &mut Silent).unwrap_err();
    assert!(matches!(refused, SolveError::GridMotion { step: 1, .. }), "{refused}");
    assert_eq!(refused.code(), Some("S018"));
    let mut stepper = Stepper::new(&model, &mut points);
    assert!(stepper.step(&mut Silent).is_ok(), "the grid of the first step is there");
    assert!(matches!(stepper.step(&mut Silent), Err(SolveError::GridMotion { step: 2, .. })));

    let (mut model, mut points) = built();
    let mut reached = Reached::nothing(&points);
    for _ in 0..6 {
        model.place_grid(reached.progress.step.end).unwrap();
        let mut stepper = Stepper::new(&model, &mut points).resume(reached).unwrap();
        stepper.step(&mut Silent).unwrap().unwrap();
        reached = stepper.reached().clone();
    }
    let whole = run_from(build::<2>, &text, None);
    assert_eq!(points.array(PointArray::Position).values, whole.steps[5].position);
}

/// The check covers every stage, and the times between the steps.
#[test]
fn motions_that_squeeze_cells_are_found_before_the_run() {
    let follow = ", follow: [{axis: y, from: 2, condition: push}]";
    let refused = |from: &str, to: &str| {
        let text = slump("gimp", follow).replace(from, to);
        let found = build::<2>(&loaded(&text)).unwrap_err();
        assert_eq!((found.len(), found[0].code), (1, "D054"));
        found[0].message.clone()
    };
    let message = refused("[2, 0.8]", "[1.5, -7], [2, 0]");
    assert_eq!(
        message,
        "at time 1.44, between the original grid lines y = 2 and 4, cells would shrink to 0.094 of their original size; \
         the smallest allowed ratio is 0.1"
    );
    // The second stage begins where the first one ends.
    let by_factors = slump("gimp", follow)
        .replace(", curve: [[0, 0], [1, 1], [2, 0.8]]", "")
        .replace("factors: {weight: 1}", "factors: {weight: 1, push: 2}")
        .replace("release: [push], factors: {weight: 1.1}", "factors: {push: 9}");
    let found = build::<2>(&loaded(&by_factors)).unwrap_err();
    assert!(
        found[0].message.starts_with("at time 1.58, between the original grid lines y = 0 and 2"),
        "{found:?}"
    );
    // A formula may also go astray between the times of the steps.
    let message = refused("uy: -0.3", "uy: -1.9*sin(4*pi*factor)^2");
    assert!(
        message.contains("between the original grid lines y = 0 and 2") && message.contains("shrink to 0.0"),
        "{message}"
    );
    let message = refused("uy: -0.3", "uy: sqrt(0.9 - factor)");
    assert_eq!(message, "at time 0.91, the displacement of the grid lines is NaN");
}
