//! Balances of energy, forces and moments, step by step.

use mpm::output::findings::ForceBalance;
use mpm::solver::Summary;
use mpm::stabilisation::{Stabilisation, Where};

use crate::analysis::{Analysis, build_deck, run, watch};

/// The observed order of convergence over runs with twice the number of steps each.
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
        // Points that are out of balance on a fresh grid first move elastically, then flow: the stress has a kink within
        // the step, the sharper the more there is to regrid.
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

/// What a fresh grid costs: next to nothing where basis functions are smooth, a part of all work with standard points,
/// whose stress jumps when they cross a cell border. Without it the balance would not close.
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

/// What the stabilisation of faces takes is known, and small; the balance closes with it.
#[test]
fn stabilisation_takes_its_share() {
    let (mut model, mut points) =
        build_deck("beam.yaml", &[("h", "0.5"), ("n", "4"), ("method", "cpdi2"), ("steps", "50")]);
    model.stabilisation = Stabilisation { mode: Where::On, parameter: 0.1, ..Stabilisation::default() };
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
