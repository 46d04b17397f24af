//! Terms of equilibrium from outside the crate: their failures, and their part in stages.

use std::path::Path;
use std::sync::{Arc, Mutex};

use mpm::assembly::{System, Wanted};
use mpm::deck::build::build;
use mpm::deck::load::{load, load_text};
use mpm::model::Model;
use mpm::points::{PointArray, Points};
use mpm::solver::{Reached, Silent, SolveError, Stepper, run_stages, run_stages_with_terms};
use mpm::step::{At, Nodal, StepContext};
use mpm::terms::{BeginError, Character, EvaluateError, Saved, Term, TermFailure};
use serde_json::Value;

/// A term without force that cannot be evaluated if a node moves too far, or from some step on.
struct Brittle {
    /// Largest motion of a node along an axis that the term can follow, [length].
    most: f64,
    /// Number of the first step that the term cannot begin.
    last: usize,
    may_succeed_if_smaller: bool,
    /// Largest motion so far, [length].
    farthest: Arc<Mutex<f64>>,
}

impl Brittle {
    fn failure(&self, reason: &str) -> TermFailure {
        let (term, reason) = (Term::<2>::name(self).to_owned(), reason.to_owned());
        TermFailure { term, reason, may_succeed_if_smaller: self.may_succeed_if_smaller }
    }
}

impl Term<2> for Brittle {
    fn name(&self) -> &'static str {
        "brittle"
    }

    fn character(&self, _: &Model<2>) -> Character {
        Character::SMOOTH
    }

    fn begin(&mut self, step: &StepContext<2>, _: &Points<2>) -> Result<(), BeginError> {
        if step.step.index >= self.last { Err(self.failure("it has aged").into()) } else { Ok(()) }
    }

    fn evaluate(
        &mut self,
        _: &StepContext<2>,
        _: &mut Points<2>,
        at: At<2>,
        _: Wanted,
        _: &mut System<2>,
    ) -> Result<(), EvaluateError> {
        let motion = at.delta_d.iter().flatten().fold(0.0, |most: f64, u| most.max(u.abs()));
        if motion > self.most {
            return Err(self.failure("a node moves too far").into());
        }
        let mut farthest = self.farthest.lock().unwrap();
        *farthest = farthest.max(motion);
        Ok(())
    }
}

/// A short run of the collapse with this term.
fn run(most: f64, last: usize, may_succeed_if_smaller: bool) -> (Result<Reached, SolveError>, f64) {
    let set = [("h", "1"), ("n", "2"), ("method", "gimp"), ("steps", "20")];
    let set = set.map(|(k, v)| (k.to_owned(), v.to_owned()));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs/collapse.yaml");
    let (mut model, mut points) = build::<2>(&load(&path, &set).unwrap()).unwrap();
    model.stepping.end_time *= 4.0 / model.stepping.count as f64;
    model.stepping.count = 4;
    let farthest = Arc::new(Mutex::new(0.0));
    let term = Brittle { most, last, may_succeed_if_smaller, farthest: farthest.clone() };
    let stepper = Stepper::new(&model, &mut points).with_terms(vec![Box::new(term)]).unwrap();
    let outcome = stepper.run(&mut Silent);
    let farthest = *farthest.lock().unwrap();
    (outcome, farthest)
}

#[test]
fn a_step_is_cut_if_a_term_can_follow_a_smaller_one() {
    let (whole, farthest) = run(f64::INFINITY, usize::MAX, true);
    let whole = whole.unwrap().summary;
    assert_eq!((whole.steps, whole.failed_attempts), (4, 0));
    let (cut, farthest_of_cut) = run(0.6 * farthest, usize::MAX, true);
    let cut = cut.unwrap().summary;
    assert!(cut.steps > 4 && cut.failed_attempts > 0, "{} {}", cut.steps, cut.failed_attempts);
    assert!(farthest_of_cut <= 0.6 * farthest);
}

#[test]
fn a_run_ends_if_a_term_fails_for_good() {
    let (_, farthest) = run(f64::INFINITY, usize::MAX, false);
    let (outcome, _) = run(0.6 * farthest, usize::MAX, false);
    let error = outcome.unwrap_err();
    assert_eq!(error.code(), Some("S015"));
    assert!(matches!(&error, SolveError::OwnTerm { failure, .. } if failure.term == "brittle"), "{error}");
    let (outcome, _) = run(f64::INFINITY, 3, false);
    let error = outcome.unwrap_err();
    assert_eq!(error.to_string(), "step 3: the term `brittle` cannot be evaluated: it has aged");
}

/// The weight of all points under the acceleration −10 along y; it grows in proportion to time up to time 1. The term
/// counts the steps to which it has contributed.
#[derive(Default)]
struct OwnWeight {
    steps: u64,
    at_end: Nodal<2>,
    at_start: Nodal<2>,
    may_slump: bool,
}

impl OwnWeight {
    fn on_nodes(step: &StepContext<2>, points: &Points<2>, time: f64) -> Nodal<2> {
        let mut nodal = vec![[0.0; 2]; step.links.n_active()];
        for group in 0..step.links.n_groups() {
            let nodes = step.links.nodes_of(group);
            for p in step.links.points_of(group) {
                let force = -10.0 * points.mass[p] * time.min(1.0);
                step.links.for_each_value(p, |local, value| nodal[nodes[local] as usize][1] += value * force);
            }
        }
        nodal
    }
}

impl Term<2> for OwnWeight {
    fn name(&self) -> &'static str {
        "own weight"
    }

    fn character(&self, _: &Model<2>) -> Character {
        Character { may_slump: self.may_slump, ..Character::SMOOTH }
    }

    fn begin(&mut self, step: &StepContext<2>, points: &Points<2>) -> Result<(), BeginError> {
        self.at_end = OwnWeight::on_nodes(step, points, step.step.end);
        self.at_start = OwnWeight::on_nodes(step, points, step.step.start);
        Ok(())
    }

    fn evaluate(
        &mut self,
        _: &StepContext<2>,
        _: &mut Points<2>,
        _: At<2>,
        _: Wanted,
        sum: &mut System<2>,
    ) -> Result<(), EvaluateError> {
        for (sum, force) in sum.external_force_mut().iter_mut().zip(&self.at_end) {
            sum[1] += force[1];
        }
        Ok(())
    }

    fn force_at_start(&self, force: &mut Nodal<2>) {
        for (sum, force) in force.iter_mut().zip(&self.at_start) {
            sum[1] += force[1];
        }
    }

    fn commit(&mut self, _: &StepContext<2>, _: &mut Points<2>) {
        self.steps += 1;
    }

    fn save(&self) -> Option<Saved> {
        let steps = self.steps;
        Some(Saved::new(move || Value::from(steps)))
    }

    fn restore(&mut self, saved: &Value) -> Result<(), String> {
        self.steps = saved.as_u64().ok_or("the number of steps is missing")?;
        Ok(())
    }
}

/// A column whose upper half is dug away in the second stage.
fn column(factors: &str) -> (Model<2>, Points<2>) {
    let deck = format!(
        "version: 1
grid: {{type: structured, origin: [0, 0], size: [1, 6], spacing: 1}}
materials: {{clay: {{model: hencky, young: 1e6, poisson: 0.3, density: 1800}}}}
bodies:
  - {{name: lower, material: clay, method: cpdi2, points_per_cell: 2, shape: {{type: box, min: [0, 0], max: [1, 3]}}}}
  - {{name: upper, material: clay, method: cpdi2, points_per_cell: 2, shape: {{type: box, min: [0, 3], max: [1, 5]}}}}
boundary_conditions:
  - {{name: sides, nodes: {{box: {{min: [0, 0], max: [1, 6]}}}}, fix: [x]}}
  - {{name: floor, nodes: {{y: 0}}, fix: [y]}}
loads: [{{name: weight, type: gravity, acceleration: [0, -10]}}]
stages:
  - {{name: weight, steps: {{count: 3}}{factors}}}
  - {{name: dig, remove: [upper], steps: {{count: 4}}}}
"
    );
    build(&load_text("column.yaml", deck.as_bytes(), &[]).unwrap()).unwrap()
}

/// The forces of a further term count when a stage removes a body, and its state passes from stage to stage.
#[test]
fn a_further_term_acts_in_all_stages() {
    let (mut model, mut points) = column(", factors: {weight: 1}");
    let reached = Reached::nothing(&points);
    run_stages(&mut model, &mut points, reached, &mut Silent).unwrap();
    let expected = points.array(PointArray::Position).values;

    let (mut model, mut points) = column("");
    let reached = Reached::nothing(&points);
    let further = |_: &Model<2>| vec![Box::new(OwnWeight::default()) as Box<dyn Term<2>>];
    let reached = run_stages_with_terms(&mut model, &mut points, reached, &further, &mut Silent).unwrap();
    let found = points.array(PointArray::Position).values;
    let difference = expected.iter().zip(&found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("positions differ by {difference:e}");
    assert_eq!(expected.len(), found.len());
    assert!(difference < 1e-10, "{difference:e}");
    assert_eq!(reached.progress.terms["own weight"].value(), Value::from(reached.summary.steps as u64));
}

/// In a collapse in large steps, the bodies slump under the weight of the model, and under that of a further term if
/// the term allows it; otherwise, the iterations stay on one grid, and damping does no work.
#[test]
fn bodies_slump_only_if_all_terms_allow_it() {
    let collapse = |own: Option<bool>| {
        let set = [("h", "0.5"), ("n", "3"), ("steps", "1"), ("smallest", "0.5")];
        let set = set.map(|(k, v)| (k.to_owned(), v.to_owned()));
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("inputs/collapse.yaml");
        let (mut model, mut points) = build::<2>(&load(&path, &set).unwrap()).unwrap();
        let mut further: Vec<Box<dyn Term<2>>> = Vec::new();
        if let Some(may_slump) = own {
            model.loads.clear();
            further.push(Box::new(OwnWeight { may_slump, ..OwnWeight::default() }));
        }
        let stepper = Stepper::new(&model, &mut points).with_terms(further).unwrap();
        let outcome = stepper.run(&mut Silent);
        (outcome, points.array(PointArray::Position).values)
    };
    let (built_in, expected) = collapse(None);
    let (allowed, found) = collapse(Some(true));
    let (forbidden, _) = collapse(Some(false));
    let difference = expected.iter().zip(&found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let work = [built_in, allowed].map(|outcome| outcome.unwrap().summary.damping_work);
    println!("damping work {work:?}, positions differ by {difference:e}");
    assert!(work[0] > 1e5 && (work[1] / work[0] - 1.0).abs() < 1e-6, "{work:?}");
    let error = forbidden.err();
    assert!(matches!(error, Some(SolveError::NotConverged { .. })), "no equilibrium is near: {error:?}");
    assert!(difference < 1e-6, "{difference:e}");
}
