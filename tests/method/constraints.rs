//! Extensions of the unknowns: turned nodes, ties, global unknowns, and a field in addition to the displacement.

use mpm::assembly::{System, Wanted};
use mpm::deck::build::build;
use mpm::deck::load::load_text;
use mpm::dofs::{ConstraintError, Constraints, Fields};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{Kernels, Observer, Reached, Silent, SolveError, StepReport, Stepper};
use mpm::step::{At, StepContext};
use mpm::stress::PlaneStrain;
use mpm::terms::{BeginError, Character, EvaluateError, GlobalMotion, GlobalUnknowns, Saved, Term};

/// A block of 2 m × 2 m on a grid of 3 m × 3 m, under its own weight.
const BLOCK: &str = "
version: 1
title: block
analysis: {stabilisation: {mode: off}}
grid: {type: structured, origin: [0, 0], size: [3, 3], spacing: 0.5}
materials: {clay: {model: hencky, young: 1e6, poisson: 0.3, density: 2000}}
bodies:
  - {name: block, material: clay, method: mpm, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [2, 2]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81]}
steps: {count: 2}
";
const WEIGHT: f64 = 2000.0 * 9.81 * 4.0;

fn block(changes: &[(&str, &str)]) -> (Model<2>, Points<2>) {
    let text = changes.iter().fold(BLOCK.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    build(&load_text("block.yaml", text.as_bytes(), &[]).unwrap()).unwrap()
}

/// Keeps the last report.
struct Last<const D: usize = 2>(Option<StepReport<D>>);

impl<const D: usize> Observer<D> for Last<D> {
    fn converged(
        &mut self,
        _: &Model<D>,
        _: &Points<D>,
        report: &StepReport<D>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.0 = Some(report.clone());
        Ok(())
    }
}

/// Keeps all reports.
#[derive(Default)]
struct Every(Vec<StepReport<2>>);

impl Observer<2> for Every {
    fn converged(
        &mut self,
        _: &Model<2>,
        _: &Points<2>,
        report: &StepReport<2>,
        _: &Reached,
    ) -> std::io::Result<()> {
        self.0.push(report.clone());
        Ok(())
    }
}

fn solve(
    model: &Model<2>,
    points: &mut Points<2>,
    terms: Vec<Box<dyn Term<2>>>,
) -> Result<StepReport<2>, SolveError> {
    let mut last = Last(None);
    Stepper::new(model, points).with_terms(terms)?.run(&mut last)?;
    Ok(last.0.unwrap())
}

fn turned(angle: f64) -> Option<[[f64; 2]; 2]> {
    let (sin, cos) = angle.sin_cos();
    Some([[cos, sin], [-sin, cos]])
}

fn farthest(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    a.iter().flatten().zip(b.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// A floor fixed along two directions gives the same result for any choice of the directions; some nodes are also held
/// along an axis by another condition.
#[test]
fn a_fixed_floor_may_be_fixed_in_any_two_directions() {
    let fixed = [("{name: floor, nodes: {y: 0}, fix: [y]}", "{name: floor, nodes: {y: 0}, fix: [x, y]}")];
    let (model, mut points) = block(&fixed);
    let plain = solve(&model, &mut points, Vec::new()).unwrap();
    let (mut model, mut others) = block(&fixed);
    model.boundary_conditions[1].axes = turned(0.4);
    let report = solve(&model, &mut others, Vec::new()).unwrap();
    assert!(farthest(&plain.grid.delta_d, &report.grid.delta_d) < 1e-12);
    let total =
        |report: &StepReport<2>| report.reactions.iter().fold([0.0; 2], |s, r| [s[0] + r[0], s[1] + r[1]]);
    assert!(farthest(&[total(&plain)], &[total(&report)]) < 1e-8 * WEIGHT);
    assert_eq!(plain.unknowns, report.unknowns);
    for (plain, turned) in plain.moments.unwrap().iter().zip(report.moments.unwrap()).skip(1) {
        assert!((plain.moment[2] - turned.moment[2]).abs() < 0.02 * WEIGHT, "{plain:?} {turned:?}");
    }
}

/// On an inclined roller, a block slides until the side holds it: the roller carries a force only along its normal, the
/// equations stay symmetric, and the iterations converge quadratically.
#[test]
fn an_inclined_roller_bears_along_its_normal() {
    for angle in [0.1, 0.5, -0.7f64] {
        let (mut model, mut points) = block(&[]);
        model.boundary_conditions[1].axes = turned(angle);
        let report = solve(&model, &mut points, Vec::new()).unwrap();
        let [side, roller] = [report.reactions[0], report.reactions[1]];
        assert!((roller[1] / WEIGHT - 1.0).abs() < 1e-8, "{angle}: {roller:?}");
        assert!((roller[0] + roller[1] * angle.tan()).abs() < 1e-8 * WEIGHT, "{angle}: {roller:?}");
        assert!((side[0] + roller[0]).abs() < 1e-8 * WEIGHT && side[1].abs() < 1e-8 * WEIGHT, "{side:?}");
        let normal = turned(angle).unwrap()[1];
        for (node, u) in report.grid.links.active_nodes().iter().zip(&report.grid.delta_d) {
            if model.grid.node_position(*node as usize)[1] == 0.0 {
                assert!((normal[0] * u[0] + normal[1] * u[1]).abs() < 1e-12);
            }
        }
        let tail: Vec<f64> = report.residuals.iter().copied().filter(|r| *r < 0.1).collect();
        assert!(tail.windows(2).all(|pair| pair[1] < 30.0 * pair[0] * pair[0] + 1e-11), "{tail:?}");
    }
}

/// A deck puts a block on an inclined roller and moves the block up and down the slope: for any path, the roller
/// carries W cos θ along its normal, and the moving condition W sin θ along the slope.
#[test]
fn a_deck_moves_a_block_along_an_inclined_roller() {
    let angle = 30f64.to_radians();
    let (sin, cos) = angle.sin_cos();
    let left = "  - {name: left, nodes: {x: 0}, fix: [x]}\n";
    let floor = "{name: floor, nodes: {y: 0}, fix: [y]}";
    let slope = format!(
        "{{name: slope, nodes: {{y: 0}}, fix: {{normal: [{}, {}]}}}}\n  - {{name: pull, nodes: {{y: 0}}, move: {{along: \
         [{}, {}], by: 0.2}}, curve: [[0, 0], [0.5, 1], [1, 0.3]]}}",
        -2.0 * sin,
        2.0 * cos,
        cos,
        sin
    );
    let origin = "steps: {count: 2}";
    let (model, mut points) =
        block(&[(left, ""), (floor, &slope), (origin, "steps: {count: 6}\nsolver: {tolerance: 1e-12}")]);
    let mut every = Every::default();
    Stepper::new(&model, &mut points).run(&mut every).unwrap();
    assert_eq!(every.0.len(), 6);
    for (step, report) in every.0.iter().enumerate() {
        let weight = WEIGHT * (step + 1) as f64 / 6.0;
        let [roller, pull] = [report.reactions[0], report.reactions[1]];
        let errors = [
            roller[0] + weight * cos * sin,
            roller[1] - weight * cos * cos,
            pull[0] - weight * sin * cos,
            pull[1] - weight * sin * sin,
        ];
        assert!(errors.iter().all(|error| error.abs() < 1e-9 * WEIGHT), "{step}: {errors:?}");
    }
}

/// In space, the program completes the normal to a frame.
#[test]
fn an_inclined_roller_in_space_bears_along_its_normal() {
    let normal = [0.3, -0.2, 1.1f64];
    let text = "
version: 1
analysis: {idealisation: solid, stabilisation: {mode: off}}
grid: {type: structured, origin: [0, 0, 0], size: [2, 2, 3], spacing: 1}
materials: {clay: {model: hencky, young: 1e6, poisson: 0.3, density: 2000}}
bodies:
  - {name: block, material: clay, method: mpm, points_per_cell: 2, shape: {type: box, min: [0, 0, 0], max: [2, 2, 2]}}
boundary_conditions:
  - {name: sides, nodes: {box: {min: [0, 0, 0], max: [2, 0, 3]}}, fix: [y]}
  - {name: end, nodes: {x: 0}, fix: [x]}
  - {name: floor, nodes: {z: 0}, fix: {normal: [0.3, -0.2, 1.1]}}
loads:
  - {name: weight, type: gravity, acceleration: [0, 0, -9.81]}
steps: {count: 2}
";
    let (model, mut points) = build::<3>(&load_text("block.yaml", text.as_bytes(), &[]).unwrap()).unwrap();
    let mut last = Last::<3>(None);
    Stepper::new(&model, &mut points).run(&mut last).unwrap();
    let reactions = last.0.unwrap().reactions;
    let floor = reactions[2];
    let weight = 2000.0 * 9.81 * 8.0;
    assert!((floor[2] / weight - 1.0).abs() < 1e-8, "{floor:?}");
    for axis in 0..2 {
        assert!((floor[axis] - floor[2] * normal[axis] / normal[2]).abs() < 1e-8 * weight, "{floor:?}");
        assert!((reactions[1 - axis][axis] + floor[axis]).abs() < 1e-8 * weight, "{reactions:?}");
    }
}

/// The active nodes at a height, [m].
fn nodes_at(step: &StepContext<2>, height: f64) -> Vec<usize> {
    let y = |active: &usize| step.model.grid.node_position(step.links.active_nodes()[*active] as usize)[1];
    (0..step.links.n_active()).filter(|active| (y(active) - height).abs() < 1e-9).collect()
}

/// A force on a lid at the top, [N]: the nodes there have the same displacement along y, by ties or by springs to a
/// rigid plate whose motion is a global unknown.
struct Lid {
    force: f64,
    /// Stiffness of each spring, [N/m]; `None` for ties.
    spring: Option<f64>,
    nodes: Vec<usize>,
    share: f64,
    /// Motion of the plate, now and at the end of the last step, [m].
    moved: [f64; 2],
    /// Elongation of each spring at the end of the last step, by its index, [m].
    elongation: Vec<f64>,
    trial: Vec<f64>,
}

impl Lid {
    fn new(force: f64, spring: Option<f64>) -> Box<Lid> {
        let empty = || Vec::new();
        Box::new(Lid {
            force,
            spring,
            nodes: Vec::new(),
            share: 0.0,
            moved: [0.0; 2],
            elongation: empty(),
            trial: empty(),
        })
    }
}

impl Term<2> for Lid {
    fn name(&self) -> &'static str {
        "lid"
    }

    fn character(&self, _: &Model<2>) -> Character {
        Character::SMOOTH
    }

    fn begin(&mut self, step: &StepContext<2>, _: &Points<2>) -> Result<(), BeginError> {
        self.nodes = nodes_at(step, 2.0);
        self.elongation.resize(self.nodes.len(), 0.0);
        self.share = step.step.end / step.model.stepping.end_time;
        Ok(())
    }

    fn constrain(
        &self,
        step: &StepContext<2>,
        _: &Points<2>,
        constraints: &mut Constraints<2>,
    ) -> Result<(), ConstraintError> {
        let nodes = nodes_at(step, 2.0);
        let tied = if self.spring.is_none() { &nodes[1..] } else { &[] };
        tied.iter().try_for_each(|&node| constraints.tie(node, 1, &[(nodes[0], 1, 1.0)], 0.0))
    }

    fn evaluate(
        &mut self,
        _: &StepContext<2>,
        _: &mut Points<2>,
        at: At<2>,
        wanted: Wanted,
        sum: &mut System<2>,
    ) -> Result<(), EvaluateError> {
        let force = self.share * self.force;
        let Some(k) = self.spring else {
            sum.external_force_mut()[self.nodes[0]][1] += force;
            return Ok(());
        };
        let w = at.globals[0];
        self.moved[0] = self.moved[1] + w;
        self.trial =
            self.nodes.iter().zip(&self.elongation).map(|(&n, e)| e + at.delta_d[n][1] - w).collect();
        sum.border.add_residual(0, -force, force.abs());
        for (&node, elongation) in self.nodes.iter().zip(&self.trial) {
            sum.internal_force_mut()[node][1] += k * elongation;
            sum.border.add_residual(0, -k * elongation, 0.0);
            sum.border.add_to_column(0, node, 1, -k);
            sum.border.add_to_row(0, node, 1, -k);
            sum.border.add_to_corner(0, 0, k);
            if wanted == Wanted::Stiffness
                && let Some(place) = sum.place(node, node)
            {
                sum.add_block(place, &[[0.0, 0.0], [0.0, k]]);
            }
        }
        Ok(())
    }

    fn commit(&mut self, _: &StepContext<2>, _: &mut Points<2>) {
        self.moved[1] = self.moved[0];
        self.elongation.clone_from(&self.trial);
    }

    fn save(&self) -> Option<Saved> {
        Some(serde_json::json!([self.moved, self.elongation.iter().sum::<f64>()]).into())
    }

    fn global_unknowns(&self) -> Option<&dyn GlobalUnknowns<2>> {
        self.spring.map(|_| self as _)
    }
}

impl GlobalUnknowns<2> for Lid {
    fn count(&self) -> usize {
        1
    }

    fn motions(&self, _: &Model<2>) -> Vec<GlobalMotion> {
        vec![GlobalMotion { number: 0, name: "plate".to_owned(), component: 1, is_free: true }]
    }
}

#[test]
fn a_lid_of_ties_and_one_of_springs_on_a_plate_press_alike() {
    let force = -2.0e4;
    let (model, mut points) = block(&[]);
    let tied = solve(&model, &mut points, vec![Lid::new(force, None)]).unwrap();
    let tops = |report: &StepReport<2>| -> Vec<f64> {
        let nodes = report.grid.links.active_nodes().iter().zip(&report.grid.delta_d);
        let is_top = |node: &u32| (model.grid.node_position(*node as usize)[1] - 2.0).abs() < 1e-9;
        nodes.filter(|(node, _)| is_top(node)).map(|(_, u)| u[1]).collect()
    };
    let tied_tops = tops(&tied);
    assert!(
        tied_tops.len() == 5 && tied_tops.iter().all(|u| (u - tied_tops[0]).abs() < 1e-14),
        "{tied_tops:?}"
    );
    // The floor carries load and weight.
    assert!((tied.reactions[1][1] / (WEIGHT - force) - 1.0).abs() < 1e-9, "{:?}", tied.reactions);

    let spring = 1e10;
    let (model, mut points) = block(&[]);
    let mut last = Last(None);
    let terms: Vec<Box<dyn Term<2>>> = vec![Lid::new(force, Some(spring))];
    let reached = Stepper::new(&model, &mut points).with_terms(terms).unwrap().run(&mut last).unwrap();
    let (moved, elongation): ([f64; 2], f64) =
        serde_json::from_value(reached.progress.terms["lid"].value()).unwrap();
    // By the equation of the plate, the springs carry the force.
    assert!((spring * elongation / force + 1.0).abs() < 1e-9, "{elongation:e}");
    let sprung = last.0.unwrap();
    assert!((sprung.reactions[1][1] / (WEIGHT - force) - 1.0).abs() < 1e-9);
    // Stiff springs are equivalent to ties, up to their elongation.
    let gap = tops(&sprung).iter().zip(&tied_tops).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(gap < 10.0 * force.abs() / spring, "{gap:e}");
    assert!(moved[1] < -0.01 && sprung.residuals.len() < 10, "{moved:?} {:?}", sprung.residuals);
}

/// An error names the motion that nothing resists: springs without stiffness leave the plate free.
#[test]
fn a_free_motion_of_a_term_is_named() {
    let (model, mut points) = block(&[]);
    let refused = solve(&model, &mut points, vec![Lid::new(-2.0e4, Some(0.0))]).map(drop);
    let Err(error @ SolveError::Singular { .. }) = refused else { panic!("{refused:?}") };
    assert!(error.to_string().contains("nothing resists the motion of `plate`"), "{error}");
}

/// A temperature field in addition to the displacement: conduction between a floor at 1 and a top at 3 (times `unit`),
/// without thermal strain.
struct Conduction {
    unit: f64,
    /// The temperature at the top according to a second condition.
    again: f64,
    at_end: Vec<(f64, f64)>,
    start: Vec<f64>,
}

impl Term<2, 3> for Conduction {
    fn name(&self) -> &'static str {
        "conduction"
    }

    fn character(&self, _: &Model<2>) -> Character {
        Character::SMOOTH
    }

    fn begin(&mut self, step: &StepContext<2>, _: &Points<2>) -> Result<(), BeginError> {
        self.start = vec![0.0; step.links.n_active()];
        Ok(())
    }

    fn constrain(
        &self,
        step: &StepContext<2>,
        _: &Points<2>,
        constraints: &mut Constraints<3>,
    ) -> Result<(), ConstraintError> {
        let walls = [("floor", 0.0, self.unit), ("lid", 2.0, 3.0 * self.unit), ("lid", 2.0, self.again)];
        for (name, height, value) in walls {
            let wall = constraints.condition(name);
            let nodes = nodes_at(step, height);
            nodes.into_iter().try_for_each(|node| constraints.hold(node, 2, value, wall))?;
        }
        Ok(())
    }

    fn evaluate(
        &mut self,
        step: &StepContext<2>,
        points: &mut Points<2>,
        at: At<3>,
        wanted: Wanted,
        sum: &mut System<3>,
    ) -> Result<(), EvaluateError> {
        self.at_end.clear();
        for (active, value) in at.delta_d.iter().enumerate() {
            let place = step.model.grid.node_position(step.links.active_nodes()[active] as usize);
            self.at_end.push((place[1], value[2]));
        }
        for group in 0..step.links.n_groups() {
            let nodes = step.links.nodes_of(group);
            for p in step.links.points_of(group) {
                let mut links = Vec::new();
                step.links
                    .for_each_link(p, |local, _, gradient| links.push((nodes[local] as usize, *gradient)));
                let volume = points.original_volume[p];
                for (a, slope_a) in &links {
                    for (b, slope_b) in &links {
                        let k = volume * (slope_a[0] * slope_b[0] + slope_a[1] * slope_b[1]);
                        sum.internal_force_mut()[*a][2] += k * at.delta_d[*b][2];
                        if wanted == Wanted::Stiffness
                            && let Some(place) = sum.place(*a, *b)
                        {
                            let mut block = [[0.0; 3]; 3];
                            block[2][2] = k;
                            sum.add_block(place, &block);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    fn save(&self) -> Option<Saved> {
        Some(serde_json::json!(self.at_end).into())
    }
}

/// A further field has its own norm: whatever its unit, it is solved as accurately as the displacement and does not
/// change the displacement.
#[test]
fn a_further_field_is_solved_beside_the_displacement() {
    let one_step = [("count: 2", "count: 1")];
    let (model, mut points) = block(&one_step);
    let alone = solve(&model, &mut points, Vec::new()).unwrap();
    for unit in [1e-12, 1.0, 1e12] {
        let (model, mut points) = block(&one_step);
        let fields = Fields::displacement(2).and("temperature", 1);
        let kernels = Kernels::new::<PlaneStrain>();
        let stepper = Stepper::<2, 3>::with_fields(&model, &mut points, kernels, fields).unwrap();
        let conduction = Conduction { unit, again: 3.0 * unit, at_end: Vec::new(), start: Vec::new() };
        let mut last = Last(None);
        let reached = stepper.with_terms(vec![Box::new(conduction)]).unwrap().run(&mut last).unwrap();
        let report = last.0.unwrap();
        assert!(report.unknowns > alone.unknowns && report.residuals.last().unwrap() <= &1e-9);
        let moved = farthest(&report.grid.delta_d, &alone.grid.delta_d);
        let size = farthest(&alone.grid.delta_d, &vec![[0.0; 2]; alone.grid.delta_d.len()]);
        assert!(moved < 1e-9 * size, "{unit:e}: {moved:e}");
        let found: Vec<(f64, f64)> =
            serde_json::from_value(reached.progress.terms["conduction"].value()).unwrap();
        assert_eq!(found.len(), report.grid.delta_d.len());
        for (y, value) in found {
            assert!((value / unit - (1.0 + y)).abs() < 1e-9, "{unit:e}: {value:e} at {y}");
        }
    }
}

/// The message about contradictory conditions names the field.
#[test]
fn contradictions_in_a_further_field_are_refused() {
    let (model, mut points) = block(&[]);
    let fields = Fields::displacement(2).and("temperature", 1);
    let stepper =
        Stepper::<2, 3>::with_fields(&model, &mut points, Kernels::new::<PlaneStrain>(), fields).unwrap();
    let conduction = Conduction { unit: 1.0, again: 2.0, at_end: Vec::new(), start: Vec::new() };
    let refused = stepper.with_terms(vec![Box::new(conduction)]).unwrap().run(&mut Silent);
    let Err(error @ SolveError::Constraint { .. }) = refused else { panic!("{refused:?}") };
    let words = "the term `conduction` and an earlier constraint of a term prescribe different increments of \
                 `temperature` at node";
    assert!(error.to_string().contains(words), "{error}");
}

/// Contradictory displacements along directions are refused, and the message names the conditions.
#[test]
fn contradictions_along_directions_are_refused() {
    let (mut model, mut points) =
        block(&[("{name: left, nodes: {x: 0}, fix: [x]}", "{name: left, nodes: {y: 0}, uy: 0.1}")]);
    model.boundary_conditions[1].axes = turned(std::f64::consts::TAU);
    let refused = Stepper::new(&model, &mut points).run(&mut Silent);
    let Err(SolveError::Constraint { error: ConstraintError::Conflict { first, second, .. }, .. }) = refused
    else {
        panic!("{refused:?}")
    };
    assert_eq!([first.as_str(), second.as_str()], ["left", "floor"]);
}
