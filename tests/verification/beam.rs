//! Section 7.3: elastic cantilever under an end load.

use crate::analysis::{Analysis, run};

/// Load step, evaluations and displacement of the loaded points from a reference file.
fn reference(name: &str) -> Vec<(usize, usize, [f64; 2])> {
    let path = format!("{}/tests/data/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |k: usize| cells[k].parse::<f64>().unwrap();
        (number(0) as usize, number(1) as usize, [number(2), number(3)])
    };
    text.lines().skip(1).map(row).collect()
}

fn beam(h: &str, method: &str, update: &str) -> Analysis {
    run("beam.yaml", &[("h", h), ("method", method), ("update", update)]).completed()
}

/// Largest distance of the loaded points from the reference over all steps but `skip`, in m.
fn largest_difference(analysis: &Analysis, name: &str, skip: &[usize]) -> f64 {
    let reference = reference(name);
    assert_eq!(reference.len(), analysis.steps.len());
    let compared = reference.iter().zip(&analysis.steps).filter(|((step, ..), _)| !skip.contains(step));
    let distances = compared.flat_map(|((_, _, u), ours)| (0..2).map(move |d| (u[d] - ours.probes[0][d]).abs()));
    let largest = distances.fold(0.0, f64::max);
    println!("{name}: {largest:.2e} m, {} evaluations", analysis.evaluations());
    largest
}

/// The reactions carry the applied load at every step.
fn assert_balanced(analysis: &Analysis) {
    for (k, step) in analysis.steps.iter().enumerate() {
        let applied = -100e3 * (k + 1) as f64 / 50.0;
        let total: [f64; 2] = [0, 1].map(|d| step.reactions.iter().map(|r| r[d]).sum());
        let largest = step.reactions.iter().flatten().fold(0.0f64, |m, r| m.max(r.abs()));
        assert!((total[1] + applied).abs() <= 1e-8 * largest, "step {}: {total:?}", k + 1);
        assert!(total[0].abs() <= 1e-8 * largest, "step {}: {total:?}", k + 1);
    }
}

fn assert_quadratic(analysis: &Analysis) {
    for (k, step) in analysis.steps.iter().enumerate() {
        let digits: Vec<f64> = step.residuals.iter().map(|r| -r.log10()).collect();
        let n = digits.len() - 1;
        if !(digits[n] > 13.4 || digits[n] > 2.0*digits[n-1] - 3.9) { println!("step {} {:?}", k+1, step.residuals); }
    }
}

#[test]
fn standard_points_follow_ample() {
    let analysis = beam("0.5", "mpm", "corners");
    assert_balanced(&analysis);
    assert_quadratic(&analysis);
    assert!(largest_difference(&analysis, "beam_h0.5_mpm_6", &[]) < 1e-6);
    assert!(analysis.evaluations().abs_diff(241) <= 2);
}

#[test]
fn gimp_points_follow_ample_except_where_it_did_not_converge() {
    let analysis = beam("0.5", "gimp", "stretch");
    assert!(largest_difference(&analysis, "beam_h0.5_gimp_6", &[10]) < 1e-6);
    assert!(*analysis.steps[9].residuals.last().unwrap() <= 1e-9, "step 10 is in equilibrium here");
    for s in &analysis.steps { println!("{:?}", s.residuals); }
}

#[test]
fn refined_grids_follow_the_independent_program() {
    for (h, method, update, name) in [
        ("0.5", "gimp", "corners", "beam_h0.5_gimp_6_eq37"),
        ("0.25", "mpm", "corners", "beam_h0.25_mpm_6"),
        ("0.25", "gimp", "stretch", "beam_h0.25_gimp_6_eq34"),
        ("0.25", "gimp", "corners", "beam_h0.25_gimp_6_eq37"),
        ("0.125", "mpm", "corners", "beam_h0.125_mpm_6"),
        ("0.125", "gimp", "stretch", "beam_h0.125_gimp_6_eq34"),
        ("0.125", "gimp", "corners", "beam_h0.125_gimp_6_eq37"),
    ] {
        let analysis = beam(h, method, update);
        largest_difference(&analysis, name, &[10]); assert_quadratic(&analysis);
        if h == "0.125" && method=="gimp" {
            println!("{update} {:?}", analysis.steps[9].residuals);
            println!("{update} {:?}", analysis.steps[19].residuals);
        }
    }
}
