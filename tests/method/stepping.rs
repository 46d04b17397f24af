//! Analyses with large steps, beyond limit loads and through snap-through.
#![allow(clippy::unwrap_used)]
#![allow(clippy::print_stdout, reason = "the measured numbers are part of the verification")]

use std::f64::consts::PI;
use std::path::Path;

use mpm::deck::build::build;
use mpm::deck::load::{load, load_text};
use mpm::model::{Control, Controlled, Model, Predictor, StabilisationMode, StiffnessUpdate};
use mpm::points::Points;
use mpm::solver::{
    self, Cause, Diagnosis, FailedAttempt, Kind, Observer, Reached, Silent, SolveError, Step, StepReport,
    Stepper,
};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// One converged step.
#[derive(Debug, Clone, PartialEq)]
struct Record {
    step: Step,
    factor: Option<f64>,
    residual: f64,
    /// True if round-off prevents the step from reaching the tolerance.
    rounding_limited: bool,
    reactions: Vec<[f64; 2]>,
    /// Displacement of the first probe.
    probe: [f64; 2],
    unknowns: usize,
}

#[derive(Default)]
struct Recorder {
    steps: Vec<Record>,
    failed: Vec<(Step, &'static str)>,
    diagnosis: Option<Diagnosis>,
    /// Stop the run after this step.
    stop_after: Option<usize>,
    /// State at the stop.
    reached: Option<(Points<2>, Reached)>,
}

impl Observer<2> for Recorder {
    fn converged(
        &mut self,
        model: &Model<2>,
        points: &Points<2>,
        report: &StepReport<2>,
        reached: &Reached,
    ) -> std::io::Result<()> {
        let place = points.by_id();
        let mut probe = [0.0; 2];
        if let Some(chosen) = model.probes.first() {
            for &id in &chosen.points {
                let p = place[id as usize];
                for d in 0..2 {
                    let moved = points.converged.position[p][d] - points.original_position[p][d];
                    probe[d] += moved / chosen.points.len() as f64;
                }
            }
        }
        self.steps.push(Record {
            step: report.step,
            factor: report.load_factor,
            residual: *report.residuals.last().unwrap(),
            rounding_limited: report.rounding_limited,
            reactions: report.reactions.clone(),
            probe,
            unknowns: report.unknowns,
        });
        if self.stop_after == Some(report.step.index) {
            // The state as a checkpoint stores it.
            let text = serde_json::to_string(reached).unwrap();
            self.reached = Some((points.clone(), serde_json::from_str(&text).unwrap()));
        }
        Ok(())
    }

    fn failed(
        &mut self,
        _: &Model<2>,
        _: &Points<2>,
        attempt: &FailedAttempt<2>,
        ended: Option<Cause<2>>,
    ) -> std::io::Result<()> {
        self.failed.push((attempt.step, attempt.error.code().unwrap_or_default()));
        self.diagnosis = ended.map(|cause| cause.diagnosis.clone());
        Ok(())
    }

    fn interrupted(&self) -> bool {
        self.reached.is_some()
    }
}

fn deck(name: &str, set: &[(&str, &str)]) -> (Model<2>, Points<2>) {
    let set: Vec<_> = set.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    build(&load(&Path::new(ROOT).join("inputs").join(name), &set).unwrap()).unwrap()
}

fn text(text: &str) -> (Model<2>, Points<2>) {
    build(&load_text("deck", text.as_bytes(), &[]).unwrap()).unwrap()
}

fn run((model, mut points): (Model<2>, Points<2>)) -> (Result<Reached, SolveError>, Recorder, Points<2>) {
    let mut recorder = Recorder::default();
    let outcome = solver::run(&model, &mut points, &mut recorder);
    for record in &recorder.steps {
        let limit = if record.rounding_limited { 1e-6 } else { model.newton.tolerance };
        assert!(record.residual <= limit);
    }
    (outcome, recorder, points)
}

/// Largest coordinate of the points along each axis.
fn extent(points: &Points<2>) -> [f64; 2] {
    [0, 1].map(|d| points.converged.position.iter().map(|x| x[d]).fold(f64::NEG_INFINITY, f64::max))
}

/// Section 7.5 in 5 steps instead of 40, and section 7.3 in 3 instead of 50: both runs finish without intervention, the
/// collapse with cut steps where necessary.
#[test]
fn the_collapse_in_five_steps_and_the_beam_in_three_end_by_themselves() {
    for method in ["gimp", "cpdi2"] {
        let fine = run(deck("collapse.yaml", &[("h", "0.25"), ("n", "3"), ("method", method)]));
        fine.0.unwrap();
        for mode in [StabilisationMode::Off, StabilisationMode::Auto] {
            let mut parts =
                deck("collapse.yaml", &[("h", "0.25"), ("n", "3"), ("method", method), ("steps", "5")]);
            parts.0.stabilisation.mode = mode;
            let (outcome, recorder, points) = run(parts);
            let Reached { summary, .. } = outcome.unwrap();
            let (coarse, fine) = (extent(&points), extent(&fine.2));
            println!(
                "collapse, {method}, {mode:?}: {} steps, {} failed attempts, extent {coarse:.3?}, in 40 steps {fine:.3?}",
                summary.steps, summary.failed_attempts
            );
            let times: Vec<f64> = recorder.steps.iter().map(|r| r.step.end).collect();
            assert!((1..=5).all(|k| times.contains(&(f64::from(k) / 5.0))), "{times:?}");
            assert!(summary.steps >= 5 && summary.steps < 20);
            assert!((coarse[0] / fine[0] - 1.0).abs() < 0.03 && (coarse[1] / fine[1] - 1.0).abs() < 0.03);
        }
    }
    for method in ["gimp", "cpdi2", "mpm"] {
        let fine = run(deck("beam.yaml", &[("method", method)]));
        let coarse = run(deck("beam.yaml", &[("method", method), ("steps", "3")]));
        coarse.0.unwrap();
        let [a, b] = [&coarse.1, &fine.1].map(|r| r.steps.last().unwrap().probe);
        println!("beam, {method}: {} steps, tip {a:.4?}, in 50 steps {b:.4?}", coarse.1.steps.len());
        assert_eq!(coarse.1.steps.last().unwrap().step.end, 1.0);
        assert!((a[1] - b[1]).abs() < 0.02 * b[1].abs(), "{a:?} {b:?}");
    }
}

/// A strip of von Mises material, of half width 1 and length 4, hangs from its upper end in plane strain. Lower bound
/// of the limit load: a stress field in which every section carries the weight below it gives a stress of √2 ρ_y at the
/// top. Upper bound: a slip line from the top at 45° gives 4 / 3.5 times as much. The run ends between the bounds and
/// reports the reason.
#[test]
fn a_load_beyond_the_limit_ends_with_the_limit_load() {
    let lower = 2f64.sqrt() * 1e3 / 4.0;
    for (spacing, points) in [(0.5, 1), (0.25, 1), (0.125, 1)] {
        let (outcome, recorder, _) = run(text(&format!(
            "version: 1
analysis: {{stabilisation: {{mode: auto}}}}
grid: {{type: structured, origin: [0, -2], size: [2, 6], spacing: {spacing}}}
materials: {{m: {{model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 1e3}}}}
bodies: [{{name: strip, material: m, shape: {{type: box, min: [0, 0], max: [1, 4]}}, points_per_cell: {points}}}]
boundary_conditions:
  - {{name: top, nodes: {{y: 4}}, fix: [y]}}
  - {{name: axis, nodes: {{x: 0}}, fix: [x]}}
loads: [{{name: pull, type: body-force, force: [0, {}]}}]
steps: {{count: 10}}",
            -2.0 * lower
        )));
        let error = outcome.unwrap_err();
        let diagnosis = recorder.diagnosis.clone().unwrap();
        let reached = diagnosis.largest_load_factor.unwrap();
        println!("h = {spacing}: {error}\n{diagnosis}\n{:.4} of the lower bound", 2.0 * reached);
        assert_eq!(diagnosis.kind, Kind::PlasticCollapse, "{error}");
        assert!((1.0..4.0 / 3.5).contains(&(2.0 * reached)), "{reached}");
        assert_eq!(reached, recorder.steps.last().unwrap().factor.unwrap());
        assert!(recorder.failed.len() >= 10, "it was approached by smaller and smaller steps");
        assert!(diagnosis.flowing > 0.1);
    }
}

/// Arc-length control and displacement control of the apex follow the same path: through the limit point, the
/// snap-through and the stiffening.
#[test]
fn a_truss_is_followed_through_its_snap() {
    let (outcome, by_length, _) = run(deck("arch.yaml", &[]));
    outcome.unwrap();
    let mut parts = deck("arch.yaml", &[]);
    parts.0.stepping.control = Control::Displacement { controlled: Controlled::Probe(0), axis: 1, to: -3.0 };
    let (outcome, by_apex, _) = run(parts);
    outcome.unwrap();
    let path = |recorder: &Recorder| -> Vec<[f64; 2]> {
        let start = [[0.0; 2]];
        start.into_iter().chain(recorder.steps.iter().map(|r| [-r.probe[1], r.factor.unwrap()])).collect()
    };
    let (a, b) = (path(&by_length), path(&by_apex));
    // Displacement control reaches the prescribed displacement.
    for record in &by_apex.steps {
        assert!((record.probe[1] + 3.0 * record.step.end).abs() < 1e-9, "{record:?}");
    }
    let at = |path: &[[f64; 2]], apex: f64| {
        let k = path.windows(2).position(|w| w[0][0] <= apex && apex < w[1][0]).unwrap();
        let [p, q] = [path[k], path[k + 1]];
        p[1] + (q[1] - p[1]) * (apex - p[0]) / (q[0] - p[0])
    };
    let peak = |path: &[[f64; 2]]| path.iter().map(|p| p[1]).take(path.len() / 2).fold(0.0, f64::max);
    let valley =
        |path: &[[f64; 2]]| path.iter().filter(|p| p[0] > 1.0).map(|p| p[1]).fold(f64::INFINITY, f64::min);
    println!(
        "limit {:.5} and {:.5}, valley {:.5} and {:.5}, at the end {:.4?} and {:.4?}",
        peak(&a),
        peak(&b),
        valley(&a),
        valley(&b),
        a.last().unwrap(),
        b.last().unwrap()
    );
    assert!((peak(&a) / peak(&b) - 1.0).abs() < 0.02);
    assert!(valley(&b) < 0.15 * peak(&b) && valley(&a) < 0.2 * peak(&a), "it snaps through");
    assert!(a.last().unwrap()[1] > 2.0 * peak(&a) && b.last().unwrap()[1] > 2.0 * peak(&b), "and stiffens");
    for apex in [0.2, 0.5, 0.8, 1.2, 2.2, 2.5] {
        let [f, g] = [at(&a, apex), at(&b, apex)];
        assert!((f - g).abs() < 0.03 * peak(&b).max(g), "{apex}: {f} {g}");
    }
    // Load control cannot follow the path: its largest load is the limit load.
    let mut parts = deck("arch.yaml", &[("steps", "100")]);
    parts.0.stepping.control = Control::Load;
    let (_, by_load, _) = run(parts);
    let jump = by_load.steps.windows(2).find(|w| w[1].probe[1] < -1.8 && w[0].probe[1] > -0.9);
    let limit = jump.map(|w| w[0].factor.unwrap());
    println!("under a growing load: {} steps, snap from {limit:?}", by_load.steps.len());
    assert!(
        by_load.steps.iter().all(|r| {
            let apex = -r.probe[1];
            !(1.0..1.9).contains(&apex)
        }),
        "there is no equilibrium under that load on the way"
    );
}

/// A run resumed after any step continues with the same bits, even where steps are cut or the load factor is unknown:
/// its next step depends on the progress, and not on the summary.
#[test]
fn a_run_goes_on_where_it_stopped() {
    let mut cases = vec![("arch", deck("arch.yaml", &[("steps", "20"), ("h", "0.5")]), 7)];
    cases.push(("collapse", deck("collapse.yaml", &[("h", "0.5"), ("n", "2"), ("steps", "4")]), 2));
    for (name, (model, points), stop) in cases {
        let (mut whole, mut all) = (Recorder::default(), points.clone());
        let _ = solver::run(&model, &mut all, &mut whole);
        let mut first = Recorder { stop_after: Some(stop), ..Recorder::default() };
        let mut some = points.clone();
        let stopped = solver::run(&model, &mut some, &mut first);
        assert!(matches!(stopped, Err(SolveError::Interrupted { .. })), "{name}");
        let (stopped, reached) = first.reached.take().unwrap();
        let without_summary = Reached { progress: reached.progress.clone(), ..Reached::nothing(&stopped) };
        for reached in [reached, without_summary] {
            let (mut points, mut rest) = (stopped.clone(), Recorder::default());
            let _ = solver::resume(&model, &mut points, reached, &mut rest);
            let joined: Vec<&Record> = first.steps.iter().chain(&rest.steps).collect();
            assert_eq!(joined, whole.steps.iter().collect::<Vec<_>>(), "{name}");
            assert_eq!(points.converged, all.converged, "{name}");
        }
    }
}

/// Penetration up to a tenth of the half width. The force on a rough footing lies above (2 + π) c by at most the
/// contribution of the row of cells that moves with the footing. It converges under grid refinement, both with the mean
/// dilatation of cells and with one point per cell. Cells that lock (cannot flow at constant volume) give a force that
/// is far too large.
#[test]
fn a_footing_carries_what_prandtl_says_unless_it_locks() {
    let pressure = |volumetric: &str, h: &str, n: &str, depth: &str, steps: &str| {
        let set = [("strain", volumetric), ("h", h), ("n", n), ("depth", depth), ("steps", steps)];
        let (outcome, recorder, _) = run(deck("footing.yaml", &set));
        outcome.unwrap();
        // The last third is a plateau. The modelled half of the footing has the width 1; c = 10e3.
        let forces: Vec<f64> = recorder.steps.iter().map(|r| -r.reactions[3][1] / 10e3).collect();
        let last = &forces[2 * forces.len() / 3..];
        last.iter().sum::<f64>() / last.len() as f64
    };
    let exact = 2.0 + PI;
    let locked = pressure("standard", "0.25", "3", "0.1", "10");
    for (volumetric, n, most) in [("standard", "1", 1.25), ("mean-dilatation", "2", 1.26)] {
        let coarse = pressure(volumetric, "0.25", n, "0.1", "10");
        let fine = pressure(volumetric, "0.125", n, "0.06", "12");
        println!(
            "q/c = {coarse:.3} and {fine:.3} with h = 0.25 and 0.125 m, locked {locked:.3}, exact {exact:.3}"
        );
        assert!(exact < fine && fine < coarse && coarse < exact * most, "{volumetric}: {coarse} {fine}");
        assert!(fine < exact * 1.125, "{volumetric}: {fine}");
    }
    assert!(locked > 1.35 * exact);
}

const BAR: &str = "
version: 1
grid: {type: structured, origin: [0, 0], size: [2, 4], spacing: 0.5}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3, density: 100}}
bodies:
  - {name: b, material: m, method: METHOD, shape: {type: box, min: [0, 0], max: [1, 3]}, points_per_cell: 2}
boundary_conditions:
  - {name: floor, nodes: {y: 0}, fix: [y]}
  - {name: side, nodes: {x: 0}, fix: [x]}
loads:
  - {name: w, type: gravity, acceleration: [0, -10], curve: [[0, 0], [0.6, 1], [1, 0]]}
steps: {count: 50, LARGEST}
output: {every: 50, probes: [{name: top, body: b, nearest: [0.1, 2.9]}]}
";

/// Kinks at the end of a requested step and elsewhere; steps grow across both.
#[test]
fn kinks_are_met_by_steps_that_grow() {
    for kink in [0.6, 0.603] {
        let deck =
            BAR.replace("METHOD", "mpm").replace("LARGEST", "largest: 16").replace("0.6", &kink.to_string());
        let (outcome, recorder, _) = run(text(&deck));
        let Reached { summary, .. } = outcome.unwrap();
        assert!(summary.steps < 15, "{}", summary.steps);
        assert_eq!(summary.largest_load_factor, Some(1.0));
        assert!(recorder.steps.iter().any(|r| r.step.end == kink && r.factor == Some(1.0)), "{kink}");
    }
}

/// Without load only round-off remains, so a relative residual cannot decrease.
#[test]
fn a_body_is_unloaded_to_nothing() {
    for method in ["mpm", "gimp", "cpdi2"] {
        for count in ["50", "400"] {
            let deck = BAR.replace("METHOD", method).replace("50, LARGEST", count);
            let (outcome, _, points) = run(text(&deck));
            assert_eq!(outcome.unwrap().summary.failed_attempts, 0, "{method}, {count} steps");
            let stress = points.converged.kirchhoff_stress.iter().map(|s| s.dot(s).sqrt());
            let largest = stress.fold(0.0, f64::max);
            println!("{method}, {count} steps: {largest:.1e} Pa are left of {:.1e} Pa", 3e3);
            assert!(largest < 30.0, "{method}: {largest:e}");
        }
    }
}

/// The path of a higher arch is the same with coarse and fine steps. With fine steps, the out-of-balance force of a
/// fresh grid exceeds the load increment; still, no run may turn back.
#[test]
fn the_length_of_the_path_may_be_coarse_or_fine() {
    let limits: Vec<f64> = ["23", "60", "500"]
        .iter()
        .map(|steps| {
            let (outcome, recorder, _) = run(deck("arch.yaml", &[("rise", "2"), ("steps", steps)]));
            outcome.unwrap();
            let apex: Vec<f64> = recorder.steps.iter().map(|r| r.probe[1]).collect();
            // Beyond the snap, the apex of this arch rises a little, with coarse and fine steps alike, before it goes
            // down.
            let before = apex.iter().take_while(|y| **y > -1.5);
            assert!(before.is_sorted_by(|a, b| a > b), "{steps}: {apex:?}");
            assert!(apex.last().is_some_and(|y| *y < -2.4), "{steps}: {apex:?}");
            let until_snap = recorder.steps.iter().take_while(|r| r.probe[1] > -1.5);
            let limit = until_snap.filter_map(|r| r.factor).fold(0.0, f64::max);
            let end = recorder.steps.last().and_then(|r| r.factor).unwrap();
            println!("{steps} steps: limit {limit:.5}, at the end {end:.5}");
            limit
        })
        .collect();
    assert!((limits[0] / limits[2] - 1.0).abs() < 0.04 && (limits[1] / limits[2] - 1.0).abs() < 0.02);
}

/// The beam under a dead load has no limit load: its path keeps rising.
#[test]
fn the_length_of_the_path_leads_a_cantilever_on() {
    for steps in ["50", "100"] {
        let mut parts = deck("beam.yaml", &[("h", "0.5"), ("n", "4"), ("method", "gimp"), ("steps", steps)]);
        parts.0.stepping.control = Control::ArcLength { length: None };
        // Finally, the beam leaves the grid.
        let (_, recorder, _) = run(parts);
        let factors: Vec<f64> = recorder.steps.iter().filter_map(|r| r.factor).collect();
        println!("{steps} steps: up to {:?}", factors.last());
        assert!(factors.is_sorted() && *factors.last().unwrap() > 2.0, "{factors:?}");
    }
}

#[test]
fn a_load_that_does_not_move_the_probe_is_reported_at_once() {
    let bar = BAR.replace("METHOD", "mpm").replace(", LARGEST", "").replace("poisson: 0.3", "poisson: 0");
    let mut parts = text(&bar);
    parts.0.stepping.control = Control::Displacement { controlled: Controlled::Probe(0), axis: 0, to: 1.0 };
    let (outcome, recorder, _) = run(parts);
    let error = outcome.unwrap_err();
    println!("{error}: {:?}", recorder.diagnosis);
    assert_eq!((error.code(), recorder.failed.len()), (Some("S013"), 1));
}

#[test]
fn the_largest_load_factor_may_be_negative() {
    let mut parts = deck("arch.yaml", &[("steps", "10")]);
    parts.0.stepping.control = Control::Displacement { controlled: Controlled::Probe(0), axis: 1, to: 0.2 };
    let (outcome, recorder, _) = run(parts);
    let factors: Vec<f64> = recorder.steps.iter().filter_map(|r| r.factor).collect();
    let least = factors.iter().copied().fold(0.0, f64::min);
    assert!(least < -0.01, "{factors:?}");
    assert_eq!(outcome.unwrap().summary.largest_load_factor, Some(least));
}

/// The predictor and the kept tangent give the same equilibria with fewer factorisations. A resumed run continues with
/// the same bits.
#[test]
fn a_prediction_and_a_kept_tangent_change_the_way_only() {
    let start = || {
        let mut parts = text(
            &BAR.replace("METHOD", "gimp").replace(", LARGEST", "").replace("density: 100", "density: 1e4"),
        );
        parts.0.stepping.count = 20;
        parts
    };
    let (outcome, plain, _) = run(start());
    let plain_solves = outcome.unwrap().summary.linear_solves;
    for (predictor, tangent) in [
        (Predictor::LastStep, StiffnessUpdate::Fresh),
        (Predictor::None, StiffnessUpdate::Kept),
        (Predictor::LastStep, StiffnessUpdate::Kept),
    ] {
        let with = || {
            let mut parts = start();
            parts.0.newton.predictor = predictor;
            parts.0.newton.tangent = tangent;
            parts
        };
        let (outcome, recorder, points) = run(with());
        let Reached { summary, .. } = outcome.unwrap();
        println!(
            "{predictor:?}, {tangent:?}: {} solves, {} evaluations",
            summary.linear_solves, summary.evaluations
        );
        if tangent == StiffnessUpdate::Fresh {
            assert!(summary.linear_solves < plain_solves);
        }
        for (a, b) in plain.steps.iter().zip(&recorder.steps) {
            for (a, b) in a.reactions.iter().flatten().zip(b.reactions.iter().flatten()) {
                assert!((a - b).abs() < 1e-3, "{a} {b}");
            }
        }
        let (model, mut stopped) = with();
        let mut recorder = Recorder { stop_after: Some(9), ..Recorder::default() };
        solver::run(&model, &mut stopped, &mut recorder).unwrap_err();
        let (mut stopped, reached) = recorder.reached.unwrap();
        solver::resume(&model, &mut stopped, reached, &mut Recorder::default()).unwrap();
        assert!(stopped.converged.position == points.converged.position, "{predictor:?}, {tangent:?}");
    }
}

/// After the last step, `step` returns `None`, however often it is called.
#[test]
fn no_step_follows_the_end_of_the_analysis() {
    let (model, mut points) = deck("new/column.yaml", &[]);
    let n_steps = model.stepping.count;
    let mut stepper = Stepper::new(&model, &mut points);
    for index in 1..=n_steps {
        assert_eq!(stepper.step(&mut Silent).unwrap().unwrap().step.index, index);
    }
    for _ in 0..2 {
        assert!(stepper.step(&mut Silent).unwrap().is_none());
        assert_eq!(stepper.reached().progress.step.index, n_steps);
    }
}
