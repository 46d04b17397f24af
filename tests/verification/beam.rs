//! Section 7.3: elastic cantilever under an end load.

use mpm::solver::SolveError;

use crate::long::first;
use crate::verification::analysis::{Analysis, run, run_with_domain_volume};

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

/// Largest distance of the loaded points from the reference over all steps except `skip`, in m.
fn largest_difference(analysis: &Analysis, name: &str, skip: &[usize]) -> f64 {
    let reference = reference(name);
    assert_eq!(reference.len(), analysis.steps.len());
    let compared = reference.iter().zip(&analysis.steps).filter(|((step, ..), _)| !skip.contains(step));
    let distances =
        compared.flat_map(|((_, _, u), ours)| (0..2).map(move |d| (u[d] - ours.probes[0][d]).abs()));
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

/// Number of correct digits to which a residual corresponds.
fn digits(residual: f64) -> f64 {
    -residual.log10()
}

/// True if the last iteration of a step doubles the number of correct digits, up to a constant: r' ≤ 2·10⁴ r², or
/// round-off. The constant is the ratio of axial to bending stiffness of the beam; its axial and bending residuals fall
/// in turn. A tangent with an error of a hundredth converges linearly and fails this.
fn ends_quadratically(residuals: &[f64]) -> bool {
    match residuals {
        [.., before, last] => digits(*last) >= (2.0 * digits(*before) - 4.3).min(13.4),
        _ => false,
    }
}

/// Every step except `skip` ends quadratically.
fn assert_quadratic(analysis: &Analysis, skip: &[usize]) {
    for (k, step) in analysis.steps.iter().enumerate().filter(|(k, _)| !skip.contains(&(k + 1))) {
        assert!(ends_quadratically(&step.residuals), "step {}: {:?}", k + 1, step.residuals);
    }
}

#[test]
fn the_test_of_quadratic_convergence_refuses_linear_convergence() {
    assert!(ends_quadratically(&[1.0, 1e-2, 1e-4, 1e-8, 1e-14]));
    assert!(ends_quadratically(&[1.0, 2.4e-4, 5.5e-5, 1.5e-10]));
    for rate in [0.5, 0.1, 1e-2] {
        let mut linear = vec![1.0];
        while linear[linear.len() - 1] > 1e-9 {
            linear.push(linear[linear.len() - 1] * rate);
        }
        assert!(!ends_quadratically(&linear), "{rate}");
    }
}

#[test]
fn standard_points_follow_ample() {
    let analysis = beam("0.5", "mpm", "corners");
    assert_balanced(&analysis);
    assert_quadratic(&analysis, &[]);
    assert!(largest_difference(&analysis, "beam_h0.5_mpm_6", &[]) < 1e-6);
    assert!(analysis.evaluations().abs_diff(241) <= 2);
}

#[test]
fn gimp_points_follow_ample_except_where_it_did_not_converge() {
    let analysis = beam("0.5", "gimp", "stretch");
    assert!(largest_difference(&analysis, "beam_h0.5_gimp_6", &[10]) < 1e-6);
    // In step 10 nearly empty cells make the residual rise and fall, here and in both reference programs.
    assert_quadratic(&analysis, &[10]);
    assert!(analysis.steps[9].residuals.iter().any(|r| *r <= 1e-9), "step 10 is in equilibrium here");
    assert!(analysis.evaluations().abs_diff(248) <= 2);
}

/// Fig. 13: more points per cell smooth the curves, and the displacement converges with the number of points. Roughness
/// is the root mean square of the third difference of u_x over the steps, from step 10 on.
#[test]
fn more_points_smooth_the_response() {
    for h in ["0.5", "0.25"] {
        let tips = ["3", "6", "12"].map(|n| {
            let analysis = run("beam.yaml", &[("h", h), ("n", n), ("method", "mpm")]).completed();
            analysis.steps.iter().map(|step| step.probes[0]).collect::<Vec<_>>()
        });
        let roughness = tips.each_ref().map(|tips| {
            let third = tips[9..].windows(4).map(|u| u[3][0] - 3.0 * u[2][0] + 3.0 * u[1][0] - u[0][0]);
            (third.map(|d| d * d).sum::<f64>() / (tips.len() - 12) as f64).sqrt()
        });
        let last = tips.each_ref().map(|tips| tips[49]);
        println!("h = {h} m: roughness {roughness:.4?} m, at the end {last:.5?} m");
        assert!(roughness[1] < 0.6 * roughness[0] && roughness[2] < 0.25 * roughness[0], "{roughness:?}");
        assert!((last[2][0] - last[1][0]).abs() < 0.3 * (last[1][0] - last[0][0]).abs(), "{last:?}");
        for tips in &tips {
            assert!(
                tips[19][1] < 0.8 * tips[49][1],
                "most of the vertical displacement comes in the first 20 steps"
            );
        }
    }
}

/// The shape that eq. (37) gives to the domain at the free corner depends on nodes of nearly empty cells. Two correct
/// programs drift apart by a few micrometres there, so the tolerance for the update `corners` is 5e-6 m on the coarser
/// grids.
#[test]
fn refined_grids_follow_the_independent_program() {
    let cases = [
        ("0.25", "mpm", "corners", "beam_h0.25_mpm_6", 1e-6),
        ("0.25", "gimp", "stretch", "beam_h0.25_gimp_6_eq34", 1e-6),
        ("0.5", "gimp", "corners", "beam_h0.5_gimp_6_eq37", 5e-6),
        ("0.25", "gimp", "corners", "beam_h0.25_gimp_6_eq37", 5e-6),
        ("0.125", "mpm", "corners", "beam_h0.125_mpm_6", 1e-6),
    ];
    for &(h, method, update, name, tolerance) in first(4, &cases) {
        let analysis = beam(h, method, update);
        assert!(largest_difference(&analysis, name, &[]) < tolerance);
        let counts: usize = reference(name).iter().map(|r| r.1).sum();
        assert!(analysis.evaluations().abs_diff(counts) <= 3);
        if update == "stretch" || method == "mpm" {
            assert_quadratic(&analysis, &[]);
        }
        if method == "mpm" {
            assert_balanced(&analysis);
        }
    }
}

/// Table 3, load step 10 (h = 0.125 m, GIMP): all printed digits agree, except that the last two entries agree to 1 %.
/// The later columns of the table are not reproduced by any update; see `docs/verification/beam.md`.
#[test]
fn table_3_step_10() {
    const PAPER: [f64; 5] = [1.622e1, 1.242e-1, 2.436e-4, 5.524e-5, 1.470e-10];
    let cases = [("stretch", "beam_h0.125_gimp_6_eq34"), ("corners", "beam_h0.125_gimp_6_eq37")];
    for &(update, name) in first(1, &cases) {
        let analysis = beam("0.125", "gimp", update);
        let ours = &analysis.steps[9].residuals;
        assert_eq!(ours.len(), PAPER.len());
        for (k, (ours, paper)) in ours.iter().zip(PAPER).enumerate() {
            println!("{update} NR it. {k}: paper {paper:.3e}, here {ours:.3e}");
            let tolerance = if k < 3 { 5e-4 } else { 1e-2 };
            assert!((ours / paper - 1.0).abs() < tolerance, "NR it. {k}: paper {paper:.3e}, here {ours:.4e}");
        }
        assert_quadratic(&analysis, &[]);
        assert!(largest_difference(&analysis, name, &[]) < 1e-6);
    }
}

/// CPDI2 with 6² and 3² points per cell, against the independent program; section 7.3, Fig. 17.
#[test]
fn cpdi2_follows_the_independent_program() {
    let cases = [
        ("0.5", "3", "beam_h0.5_cpdi2_3"),
        ("0.5", "6", "beam_h0.5_cpdi2_6"),
        ("0.25", "6", "beam_h0.25_cpdi2_6"),
        ("0.125", "6", "beam_h0.125_cpdi2_6"),
    ];
    for &(h, n, name) in first(3, &cases) {
        let set = [("h", h), ("n", n), ("method", "cpdi2")];
        let analysis = run("beam.yaml", &set).completed();
        assert!(largest_difference(&analysis, name, &[]) < 1e-6);
        let counts: usize = reference(name).iter().map(|r| r.1).sum();
        assert!(analysis.evaluations().abs_diff(counts) <= 2);
        assert_balanced(&analysis);
        assert_quadratic(&analysis, &[]);
    }
}

/// Fig. 15(b): the update with F_ii, eq. (33), shrinks the domains of the turning beam. With the volume of a point
/// taken from its domain the paper loses the beam in step 19; the independent program has a domain of negative length
/// in step 18 and loses points in step 20. Here the negative length is an error; the step before the error agrees.
#[test]
fn domains_that_shrink_in_rotation_end_the_analysis() {
    let set = [("h", "0.5"), ("method", "gimp"), ("update", "diagonal")];
    let analysis = run_with_domain_volume("beam.yaml", &set);
    let error = analysis.summary.as_ref().unwrap_err();
    println!("{} steps, then: {error}", analysis.steps.len());
    assert!(matches!(error, SolveError::Collapsed { step: 18, .. }), "{error}");
    assert_eq!(analysis.steps.len(), 17);
    // By step 17 the smallest domain has 2 % of its volume, and the two programs have drifted apart by 1.5e-5 m.
    for (step, expected, tolerance) in
        [(10, [-1.7093302690f64, -5.0105466913], 1e-6), (17, [-3.4708841721, -6.6134286048], 2e-5)]
    {
        let u = analysis.steps[step - 1].probes[0];
        println!("step {step}: {u:.9?}, reference {expected:.9?}");
        assert!((0..2).all(|d| (u[d] - expected[d]).abs() < tolerance), "step {step}: {u:?}");
    }
    assert!(analysis.steps.iter().all(|step| step.residuals.last().is_some_and(|r| *r <= 1e-9)));
    assert_balanced(&analysis);
}
