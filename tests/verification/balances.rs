//! Balances of energy, forces and moments, step by step.

use mpm::model::{Stabilisation, StabilisationMode};
use mpm::output::findings::ForceBalance;
use mpm::solver::Summary;

use crate::verification::analysis::{Analysis, build_deck, run, watch};

/// The observed orders of convergence over runs, each with twice as many steps as the one before.
fn orders(errors: &[f64]) -> Vec<f64> {
    errors.windows(2).map(|pair| (pair[0] / pair[1]).abs().log2()).collect()
}

fn runs(deck: &str, set: &[(&str, &str)], steps: &[&str]) -> Vec<Analysis> {
    let run = |steps: &&str| run(deck, &[set, &[("steps", *steps)]].concat()).completed();
    steps.iter().map(run).collect()
}

/// The work of the trapezoidal rule has an error of second order in the size of the steps; nothing else may be missing.
#[test]
fn the_balance_of_energy_closes_with_the_square_of_the_steps() {
    for (deck, method, n, steps, least) in [
        ("beam.yaml", "cpdi2", "4", ["25", "50", "100"], 1.9),
        // Points that are out of balance on a fresh grid first move elastically, then flow: the stress has a kink
        // within the step, which is sharper for larger regridding work.
        ("collapse.yaml", "cpdi2", "4", ["20", "40", "80"], 1.4),
        ("collapse.yaml", "mpm", "4", ["40", "80", "160"], 0.5),
    ] {
        let h = if deck == "beam.yaml" { "0.5" } else { "1" };
        let runs = runs(deck, &[("h", h), ("n", n), ("method", method)], &steps);
        let errors: Vec<f64> = runs.iter().map(|run| run.summary.as_ref().unwrap().energy_error()).collect();
        let orders = orders(&errors);
        println!("{deck} {method}: {errors:?}, orders {orders:.2?}");
        assert!(errors[2].abs() < 5e-4, "{errors:?}");
        assert!(orders.iter().all(|order| *order > least), "{orders:?}");
        if deck == "collapse.yaml" {
            let summary = runs[2].summary.as_ref().unwrap();
            assert!(summary.plastic_work > 10.0 * summary.strain_energy, "most of the work flows away");
        }
    }
}

/// Energy lost to the reset of the grid: next to nothing with smooth basis functions, but a share of all work with
/// standard points, whose stress jumps when they cross a cell boundary. Without this term the balance would not close.
#[test]
fn regridding_takes_energy_from_standard_points_above_all() {
    let share = |method: &str, steps: &str| {
        let run = run("beam.yaml", &[("h", "0.5"), ("n", "4"), ("method", method), ("steps", steps)]);
        let summary = run.completed().summary.unwrap();
        (summary.regridding_work / summary.external_work, summary.energy_error())
    };
    let smooth: Vec<f64> = ["25", "50", "100"].map(|steps| share("cpdi2", steps).0).to_vec();
    let (standard, error) = share("mpm", "100");
    println!("cpdi2 {smooth:?}, mpm {standard:.3} with an error of {error:.1e}");
    assert!(smooth.iter().all(|share| -5e-3 < *share && *share < 0.0), "{smooth:?}");
    assert!(orders(&smooth).iter().all(|order| *order > 0.6), "it vanishes with the steps");
    assert!(standard < -0.1 && error.abs() < 1e-3, "{standard} {error}");
}

/// The work of the face stabilisation is known, and small; the balance closes with it.
#[test]
fn stabilisation_takes_its_share() {
    let (mut model, mut points) =
        build_deck("beam.yaml", &[("h", "0.5"), ("n", "4"), ("method", "cpdi2"), ("steps", "50")]);
    model.stabilisation =
        Stabilisation { mode: StabilisationMode::On, parameter: 0.1, ..Stabilisation::default() };
    let summary = watch(&model, &mut points, |_, _| ()).unwrap();
    let share = summary.stabilisation_work / summary.external_work;
    println!("stabilisation {share:.2e}, error {:.1e}", summary.energy_error());
    assert!(share > 1e-5 && share < 0.1, "{share}");
    assert!(summary.energy_error().abs() < 1e-3);
    let without = Summary { stabilisation_work: 0.0, ..summary.clone() };
    assert!(without.energy_error().abs() > summary.energy_error().abs());
}

#[test]
fn forces_and_moments_balance_in_every_step() {
    for (deck, method, steps) in [
        ("beam.yaml", "cpdi2", "25"),
        ("beam.yaml", "mpm", "25"),
        ("collapse.yaml", "cpdi2", "20"),
        ("collapse.yaml", "mpm", "40"),
    ] {
        let h = if deck == "beam.yaml" { "0.5" } else { "1" };
        let (model, mut points) =
            build_deck(deck, &[("h", h), ("n", "4"), ("method", method), ("steps", steps)]);
        let model_of_balance = build_deck(deck, &[("h", h), ("n", "4"), ("method", method)]).0;
        let (mut forces, mut moments) = (Vec::new(), Vec::new());
        watch(&model, &mut points, |_, report| {
            forces.push(ForceBalance::new(&model_of_balance, report).relative_difference().unwrap());
            moments.push(report.moment_error.unwrap());
        })
        .unwrap();
        let worst = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
        println!("{deck} {method}: forces {:.1e}, moments {:.1e}", worst(&forces), worst(&moments));
        assert_eq!(forces.len(), steps.parse::<usize>().unwrap());
        assert!(worst(&forces) < 1e-8 && worst(&moments) < 1e-8);
    }
}

/// A clamped cantilever with a force on the points of its end. Its standard points have basis functions that represent
/// linear fields exactly, so the lever arm is that of the loaded points in the current configuration.
const CLAMPED: &str = "version: 1
grid: {type: structured, origin: [0, -3], size: [5, 6], spacing: 0.5}
materials: {m: {model: hencky, young: 1e6, poisson: 0.3, density: 10}}
bodies: [{name: beam, material: m, shape: {type: box, min: [0, 0], max: [4, 1]}, method: mpm, points_per_cell: 4}]
boundary_conditions:
  - {name: clamp, nodes: {x: 0}, fix: [x, y]}
loads:
  - {name: end, type: point-force, body: beam, points: {nearest: [4, 0.5], count: 2}, total: [300, -2000]}
  - {name: weight, type: gravity, acceleration: [0, -9], curve: [[0, 0], [1, 0]]}
steps: {count: 4}
solver: {tolerance: 1e-12}
output: {probes: [{name: tip, body: beam, nearest: [4, 0.5], count: 2}]}";

#[test]
fn a_clamp_takes_the_moment_of_the_force_at_the_end() {
    let loaded = mpm::deck::load::load_text("deck", CLAMPED.as_bytes(), &[]).unwrap();
    let (model, mut points) = mpm::deck::build::build(&loaded).unwrap();
    let ids = model.probes[0].points.clone();
    let mut steps = Vec::new();
    watch(&model, &mut points, |points, report| {
        let place = points.by_id();
        let tip: [f64; 2] = std::array::from_fn(|d| {
            ids.iter().map(|id| points.converged.position[place[*id as usize]][d]).sum::<f64>() / 2.0
        });
        let clamp = report.moments.as_ref().unwrap()[0];
        steps.push((tip, clamp, report.loads.clone(), report.applied(), report.reactions[0]));
    })
    .unwrap();
    assert_eq!(steps.len(), 4);
    for (number, (tip, clamp, loads, applied, reaction)) in steps.iter().enumerate() {
        let factor = (number + 1) as f64 / 4.0;
        let force = [300.0 * factor, -2000.0 * factor];
        for d in 0..2 {
            assert!((loads[0][d] - force[d]).abs() < 1e-12 * 2000.0, "{loads:?}");
            assert!(loads[1][d].abs() < 1e-12, "the weight does not act");
            assert_eq!(applied[d], loads[0][d] + loads[1][d]);
            assert!((reaction[d] + force[d]).abs() < 1e-9 * 2000.0);
        }
        let about = clamp.about.unwrap();
        // The moment refers to the mean position of the clamp's active nodes: three over the height of the beam, all
        // fixed.
        assert!(about[0].abs() < 1e-15 && (about[1] - 0.5).abs() < 0.5, "{about:?}");
        let arm = [tip[0] - about[0], tip[1] - about[1]];
        let expected = -(arm[0] * force[1] - arm[1] * force[0]);
        let [moment] = clamp.components() else { panic!("one moment in the plane") };
        println!("step {}: {moment} for {expected}", number + 1);
        assert!(expected > 0.0, "the clamp turns the beam against its sag, counter-clockwise");
        assert!((moment - expected).abs() < 1e-9 * expected.abs(), "{moment} for {expected}");
    }
    let sag = steps[3].0[1];
    assert!(sag < 0.45, "the arm of the reached configuration is another one: {sag}");
}

/// A block on two walls at right angles: the node in the corner belongs to both, and so does its reaction along x.
#[test]
fn conditions_share_the_reaction_of_a_node_they_both_hold() {
    let deck = |sides: &str| {
        format!(
            "version: 1
grid: {{type: structured, origin: [0, 0], size: [4, 4], spacing: 1}}
materials: {{m: {{model: hencky, young: 1e5, poisson: 0.3, density: 10}}}}
bodies: [{{name: block, material: m, shape: {{type: box, min: [0, 0], max: [4, 2]}}, method: mpm, points_per_cell: 4}}]
boundary_conditions: [{sides}]
loads: [{{name: weight, type: gravity, acceleration: [0, -9]}}]
steps: {{count: 2}}"
        )
    };
    let reactions = |sides: &str| {
        let analysis = crate::verification::analysis::run_text(&deck(sides), &[]).completed();
        analysis.steps.last().unwrap().reactions.clone()
    };
    let (base, left, right) = (
        "{name: base, nodes: {y: 0}, fix: [x, y]}",
        "{name: left, nodes: {x: 0}, fix: [x]}",
        "{name: right, nodes: {x: 4}, fix: [x]}",
    );
    let first = reactions(&format!("{base}, {left}, {right}"));
    let last = reactions(&format!("{left}, {right}, {base}"));
    let scale = 10.0 * 9.0 * 8.0;
    for d in 0..2 {
        for (a, b) in [(first[0], last[2]), (first[1], last[0]), (first[2], last[1])] {
            assert!(
                (a[d] - b[d]).abs() < 1e-9 * scale,
                "the order in the deck does not matter: {first:?}, {last:?}"
            );
        }
    }
    let [_, left_x, right_x] = [first[0][0], first[1][0], first[2][0]];
    assert!(
        (left_x + right_x).abs() < 1e-9 * scale && left_x > 0.01 * scale,
        "a symmetric problem: {first:?}"
    );
    assert!(first[0][0].abs() < 1e-9 * scale);
    assert!((first[0][1] - scale).abs() < 1e-9 * scale, "the base carries the weight");
    // Two conditions on the same nodes each take half of the reaction.
    let twice = reactions(&format!("{base}, {left}, {right}, {{name: again, nodes: {{x: 0}}, ux: 0}}"));
    let left = twice[1][0] + twice[3][0];
    assert!(twice[1][0] < left_x && twice[3] == twice[1], "{twice:?}");
    assert!((left + twice[2][0] + twice[0][0]).abs() < 1e-9 * scale);
}
