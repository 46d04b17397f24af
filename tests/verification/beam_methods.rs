//! Section 7.3, the methods compared on the cantilever: evaluation counts (Table 4) and the response with CPDI2
//! compared with that with GIMP (Fig. 17).

use crate::long::{first, is_long};
use crate::verification::analysis::{Analysis, run};

const SIZES: [&str; 3] = ["0.5", "0.25", "0.125"];

/// Length of the beam, m.
const LENGTH: f64 = 10.0;

fn beam(method: &str, h: &str, n: &str, tolerance: &str) -> Analysis {
    run("beam.yaml", &[("h", h), ("method", method), ("n", n), ("tolerance", tolerance)])
}

/// A row of `beam_counts.csv`.
struct Counts {
    method: String,
    h: String,
    ample: Option<usize>,
    independent: [usize; 2],
    paper: usize,
}

fn counts() -> Vec<Counts> {
    let path = format!("{}/tests/data/beam_counts.csv", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).unwrap();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let count = |k: usize| cells[k].parse::<usize>();
        Counts {
            method: cells[0].to_owned(),
            h: cells[1].to_owned(),
            ample: count(2).ok(),
            independent: [count(3).unwrap(), count(4).unwrap()],
            paper: count(5).unwrap(),
        }
    };
    text.lines().skip(1).map(row).collect()
}

/// Table 4: evaluations over 50 steps, 6² points, GIMP with update (37). `tests/run --long` adds h = 0.125 m.
///
/// The paper states a tolerance of 1e-9, but its counts belong to 1e-6, except for GIMP on the two finer grids, where
/// no power of ten gives them (`docs/verification/beam.md`). The counts are therefore compared with two other programs
/// at both tolerances, and with the paper at 1e-6 where agreement is possible: standard points and CPDI2 within 2 of
/// about 210, GIMP at h = 0.5 m within 3. In the remaining two rows, this program and the independent one both need 10
/// and 12 evaluations fewer than the paper, which is not tested. The test also asserts that 1e-9 is not the paper's
/// tolerance.
#[test]
fn table_4() {
    println!("method h: at 1e-9 (AMPLE, independent), at 1e-6 (independent, paper)");
    for row in counts().into_iter().filter(|row| is_long() || row.h != "0.125") {
        let Counts { method, h, ample, independent, paper } = row;
        let [strict, loose] =
            ["1e-9", "1e-6"].map(|tolerance| beam(&method, &h, "6", tolerance).completed().evaluations());
        println!(
            "{method} {h}: {strict} ({ample:?}, {}), {loose} ({}, {paper})",
            independent[0], independent[1]
        );
        for (ours, theirs) in [(strict, ample), (strict, Some(independent[0])), (loose, Some(independent[1]))]
        {
            if let Some(theirs) = theirs {
                assert!(
                    ours.abs_diff(theirs) <= 2,
                    "{method}, h = {h} m: {ours} evaluations, reference {theirs}"
                );
            }
        }
        assert!(
            strict >= paper + 20,
            "{method}, h = {h} m: the paper's count {paper} is not one of 1e-9, {strict}"
        );
        let allowed = match (method.as_str(), h.as_str()) {
            ("gimp", "0.5") => Some(3),
            ("gimp", _) => None,
            _ => Some(2),
        };
        if let Some(allowed) = allowed {
            assert!(loose.abs_diff(paper) <= allowed, "{method}, h = {h} m: {loose} at 1e-6, paper {paper}");
        }
    }
}

/// Largest distance between the loaded points of two analyses over the steps that both have, and the number of those
/// steps.
fn largest_distance(a: &Analysis, b: &Analysis) -> (f64, usize) {
    let steps = a.steps.len().min(b.steps.len());
    let apart = |k: usize| distance(a, b, k);
    ((0..steps).map(apart).fold(0.0, f64::max), steps)
}

/// Distance between the loaded points of two analyses after step `k` + 1, m.
fn distance(a: &Analysis, b: &Analysis, k: usize) -> f64 {
    let (u, v) = (a.steps[k].probes[0], b.steps[k].probes[0]);
    (u[0] - v[0]).hypot(u[1] - v[1])
}

/// Fig. 17: "very similar to that of the generalised interpolation method". With 6² points for both methods, and with
/// 3² points for CPDI2 and 6² for GIMP (Fig. 17 compared with Fig. 15), the loaded points stay within 0.6 % of the beam
/// length of each other; each halving of h brings the two methods with 6² points closer together at the end. The final
/// differences are those in `docs/verification/beam.md`.
#[test]
fn cpdi2_responds_like_gimp() {
    // CPDI2 minus GIMP at the end, with 6² and 3² points for CPDI2, m.
    let stated = [
        [[0.05133, 0.00683], [0.02364, 0.01165]],
        [[0.03880, 0.00920], [0.04310, 0.02296]],
        [[0.02378, 0.00674], [0.03040, 0.01763]],
    ];
    let mut before = f64::INFINITY;
    for (&h, stated) in first(2, &SIZES).iter().zip(stated) {
        let gimp = beam("gimp", h, "6", "1e-9").completed();
        for (n, stated) in ["6", "3"].into_iter().zip(stated) {
            let cpdi2 = beam("cpdi2", h, n, "1e-9").completed();
            let (largest, steps) = largest_distance(&gimp, &cpdi2);
            let last = [0, 1].map(|d| cpdi2.steps[49].probes[0][d] - gimp.steps[49].probes[0][d]);
            println!("h = {h} m, CPDI2 {n}², GIMP 6²: at most {largest:.5} m apart, {last:.5?} m at the end");
            assert_eq!(steps, 50);
            assert!(largest < 0.006 * LENGTH, "h = {h} m, {n}²: {largest} m");
            assert!((0..2).all(|d| (last[d] - stated[d]).abs() < 1e-4), "h = {h} m, {n}²: {last:?} m");
            if n == "6" {
                let last = last[0].hypot(last[1]);
                assert!(last < 0.85 * before, "h = {h} m: {last} m after {before} m");
                before = last;
            }
        }
    }
}

/// GIMP with update (37) and 3² points, compared with CPDI2 with 3² points up to the step that GIMP reaches. With
/// nearly empty cells, some steps have no equilibrium, and round-off decides which steps: if stress and load are
/// multiplied by one of 24 factors between 0.6 and 7, which changes only the round-off, the analysis ends after step
/// 20, 40 or 50 for h = 0.5 m, between 15 and 50 for h = 0.25 m, and after 5 or 6 for h = 0.125 m. The test therefore
/// requires the steps that all these analyses reach. Up to there, the two methods differ by up to 2.2 %, 1.9 % and
/// 0.06 % of the beam length.
#[test]
fn gimp_with_few_points_responds_like_cpdi2_as_far_as_it_gets() {
    for (h, reached, bound) in [("0.5", 20, 0.023), ("0.25", 15, 0.02), ("0.125", 5, 0.001)] {
        let gimp = beam("gimp", h, "3", "1e-9");
        let cpdi2 = beam("cpdi2", h, "3", "1e-9").completed();
        let (largest, steps) = largest_distance(&gimp, &cpdi2);
        let last = distance(&gimp, &cpdi2, steps - 1);
        println!("h = {h} m, 3²: {steps} steps, at most {largest:.5} m apart, {last:.5} m in the last");
        if let Err(error) = &gimp.summary {
            println!("  {error}");
        }
        assert!(steps >= reached, "h = {h} m: {steps} steps");
        assert!(largest < bound * LENGTH, "h = {h} m: {largest} m");
    }
}
