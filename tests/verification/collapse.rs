//! Section 7.5: elasto-plastic collapse of a block under its own weight.

use mpm::basis::DomainKind;
use mpm::solver::SolveError;

use crate::long::{first, is_long};
use crate::verification::analysis::{Analysis, run, run_text, run_with_domain_volume};

fn collapse(h: &str, n: &str, method: &str, update: &str) -> Analysis {
    let set = [("h", h), ("n", n), ("method", method), ("update", update)];
    run("collapse.yaml", &set).completed()
}

/// Extent and height of the block. A point of the standard method reaches √V_p/2 beyond its position (footnote 7).
fn extent_and_height(analysis: &Analysis) -> [f64; 2] {
    let points = &analysis.points;
    let domain = analysis.model.bodies[0].method.domain();
    let reach = |p: usize, d: usize| {
        let x = points.converged.position[p][d];
        match domain {
            DomainKind::None => x + 0.5 * points.volume(p).sqrt(),
            DomainKind::Box => x + points.converged.half_lengths[p][d],
            DomainKind::Corners => points.corners(p).iter().map(|c| c[d]).fold(x, f64::max),
        }
    };
    [0, 1].map(|d| (0..points.len()).map(|p| reach(p, d)).fold(0.0, f64::max))
}

/// In every step, the vertical reactions carry the weight.
fn assert_balanced(analysis: &Analysis) {
    let weight: f64 = analysis.points.mass.iter().sum::<f64>() * 10.0;
    assert!((weight - 8.0 * 8.0 * 1000.0 * 10.0).abs() < 1e-6 * weight);
    for (k, step) in analysis.steps.iter().enumerate() {
        let applied = weight * (k + 1) as f64 / analysis.steps.len() as f64;
        let vertical: f64 = step.reactions.iter().map(|r| r[1]).sum();
        assert!((vertical - applied).abs() < 1e-8 * applied, "step {}: {vertical} for {applied}", k + 1);
    }
}

/// No point is beyond the yield surface, eq. (43).
fn assert_admissible(analysis: &Analysis) {
    for tau in &analysis.points.converged.kirchhoff_stress {
        assert!(tau.deviator().norm() <= 20e3 * (1.0 + 1e-9));
    }
    assert!(analysis.points.converged.history.iter().any(|e| *e > 0.1), "the block flows");
}

/// Table 6: all twelve extents and heights, m; without `tests/run --long`, the ten with the fewest points.
#[test]
fn table_6() {
    const PAPER: [(&str, &str, f64, f64); 12] = [
        ("2", "3", 13.343, 6.357),
        ("2", "6", 13.359, 6.437),
        ("2", "9", 13.380, 6.452),
        ("1", "3", 13.662, 6.245),
        ("1", "6", 13.735, 6.277),
        ("1", "9", 13.750, 6.289),
        ("0.5", "3", 13.731, 6.245),
        ("0.5", "6", 13.797, 6.251),
        ("0.5", "9", 13.812, 6.255),
        ("0.25", "3", 13.787, 6.234),
        ("0.25", "6", 13.847, 6.231),
        ("0.25", "9", 13.863, 6.226),
    ];
    for &(h, n, extent, height) in first(10, &PAPER) {
        let analysis = collapse(h, n, "mpm", "corners");
        let [x, y] = extent_and_height(&analysis);
        println!("h = {h}, {n}²: extent {x:.4} (paper {extent}), height {y:.4} (paper {height})");
        assert!((x - extent).abs() < 6e-4 && (y - height).abs() < 6e-4, "h = {h}, {n}²: {x:.4} {y:.4}");
        assert_balanced(&analysis);
        assert_admissible(&analysis);
    }
}

/// Table 7 for the updates whose values can be reproduced with V_p = det(F) V_p0, eq. (22): (32), (38), (39), and the
/// extent for (37); the printed height for (37) belongs to a single point that the calculation does not determine.
#[test]
fn table_7() {
    for (update, extent, height) in [
        ("determinant", 13.645, Some(6.316)),
        ("diagonal-corrected", 13.769, Some(6.257)),
        ("diagonal-incremental", 13.769, Some(6.257)),
        ("corners", 13.769, None),
    ] {
        let analysis = collapse("1", "6", "gimp", update);
        let [x, y] = extent_and_height(&analysis);
        println!("{update}: extent {x:.4} (paper {extent}), height {y:.4} (paper {height:?})");
        assert!((x - extent).abs() < 6e-4, "{update}: extent {x:.4}");
        assert!(height.is_none_or(|height| (y - height).abs() < 6e-4), "{update}: height {y:.4}");
        assert_admissible(&analysis);
    }
}

/// Table 7, (34): the printed values 13.425 and 6.441 result if the volume of a point is taken from its domain; with
/// det(F) V_p0 this update gives other values.
#[test]
fn table_7_with_the_volume_of_the_domain() {
    let [extent, height] = [13.4252, 6.4413];
    let set = [("h", "1"), ("n", "6"), ("method", "gimp"), ("update", "stretch")];
    let [x, y] = extent_and_height(&run_with_domain_volume("collapse.yaml", &set).completed());
    println!("extent {x:.4} (reference {extent}), height {y:.4} (reference {height})");
    assert!((x - extent).abs() < 6e-4 && (y - height).abs() < 6e-4, "{x:.4} {y:.4}");
    let [x, y] = extent_and_height(&collapse("1", "6", "gimp", "stretch"));
    println!("det(F) V_p0: extent {x:.4}, height {y:.4}");
    assert!((x - extent).abs().max((y - height).abs()) > 0.01, "{x:.4} {y:.4}");
}

/// Table 7, (33): the independent program obtains the printed 14.415 and 5.546, but one of its domains has a negative
/// length in the last step. Here the negative length is an error; the step before the error agrees.
#[test]
fn table_7_with_a_domain_that_collapses() {
    let set = [("h", "1"), ("n", "6"), ("method", "gimp"), ("update", "diagonal")];
    let analysis = run_with_domain_volume("collapse.yaml", &set);
    let error = analysis.summary.as_ref().unwrap_err();
    let [x, y] = extent_and_height(&analysis);
    println!("step {}: extent {x:.6}, height {y:.6}; then {error}", analysis.steps.len());
    assert!(matches!(error, SolveError::Collapsed { step: 40, .. }), "{error}");
    assert_eq!(analysis.steps.len(), 39);
    assert!((x - 14.1021133).abs() < 1e-6 && (y - 5.7150683).abs() < 1e-6, "{x:.7} {y:.7}");
}

/// Table 8 with (38), to the printed digits for residuals down to 1e-12. Smaller residuals are round-off.
#[test]
fn table_8() {
    const PAPER: [(usize, &[f64]); 4] = [
        (10, &[2.656e0, 2.697e-4, 1.626e-9, 6.057e-15]),
        (20, &[2.794e0, 3.088e-2, 2.410e-2, 2.568e-3, 3.910e-5, 6.949e-10]),
        (30, &[2.701e0, 2.380e-2, 4.626e-2, 6.193e-3, 2.225e-4, 1.356e-7, 6.713e-14]),
        (40, &[2.410e0, 1.759e-2, 3.049e-2, 5.156e-3, 1.497e-4, 1.944e-7, 3.159e-13]),
    ];
    let analysis = collapse("1", "6", "gimp", "diagonal-corrected");
    for (step, paper) in PAPER {
        let ours = &analysis.steps[step - 1].residuals;
        println!("step {step}: {ours:?}");
        assert_eq!(ours.len(), paper.len());
        for (ours, paper) in ours.iter().zip(paper) {
            let close = if *paper > 1e-12 { (ours / paper - 1.0).abs() < 5e-4 } else { *ours < 1e-12 };
            assert!(close, "step {step}: {ours:.4e} for {paper:.3e}");
        }
    }
    // Once a residual is below 1e-3, the number of correct digits doubles.
    for step in analysis.steps.iter().filter(|s| s.residuals.len() > 4) {
        for pair in step.residuals.windows(2).filter(|pair| pair[0] < 1e-3) {
            assert!(pair[1] < 100.0 * pair[0] * pair[0] || pair[1] < 1e-13, "{:?}", step.residuals);
        }
    }
}

/// Table 7, CPDI2: the largest corner of a domain.
#[test]
fn table_7_cpdi2() {
    let analysis = collapse("1", "6", "cpdi2", "corners");
    let [x, y] = extent_and_height(&analysis);
    println!("CPDI2: extent {x:.4} (paper 13.780), height {y:.4} (paper 6.292)");
    assert!((x - 13.780).abs() < 6e-4, "extent {x:.4}");
    assert!((y - 6.292).abs() < 1e-3, "height {y:.4}");
    assert_balanced(&analysis);
    assert_admissible(&analysis);
}

/// With domains and h = 0.5 m, the stiffness in step 31 is indefinite by a billionth of the stiffness of weak nodes. A
/// solver that treats it as singular finds no equilibrium there.
#[test]
fn weakly_indefinite_steps_converge() {
    let analysis = collapse("0.5", "6", "gimp", "corners");
    assert_eq!(analysis.steps.len(), 40);
    assert!(analysis.evaluations() <= 240, "{}", analysis.evaluations());
    assert_admissible(&analysis);
}

/// CPDI1, whose corners follow the deformation of their point, leaves the plane of symmetry and the base slightly, and
/// the run completes: balanced, admissible, with the extent and height of CPDI2 within 0.02 %, closer on finer
/// grids.
#[test]
fn cpdi1_slides_along_walls() {
    let mut before = f64::INFINITY;
    for &h in first(2, &["1", "0.5", "0.25"]) {
        let [one, two] = ["cpdi1", "cpdi2"].map(|method| collapse(h, "6", method, "corners"));
        assert_balanced(&one);
        assert_admissible(&one);
        let (a, b) = (extent_and_height(&one), extent_and_height(&two));
        let apart = (0..2).map(|d| (a[d] / b[d] - 1.0).abs()).fold(0.0, f64::max);
        println!("h = {h} m: CPDI1 {a:.4?}, CPDI2 {b:.4?} m");
        assert!(apart < 2e-4 && apart < before, "h = {h} m: {a:?} {b:?}");
        before = apart;
    }
}

/// On a graded grid whose cells have sides of 0.2 to 0.3 m around the block, the extent and height with standard points
/// lie between those on even grids with h = 0.25 m. With CPDI2 they are within 1 mm of the even grid, and with GIMP
/// they differ from the even grid by less than the results with other numbers of points do (`tests/run --long`).
#[test]
fn a_graded_grid_gives_the_results_of_even_ones() {
    let spacing =
        "spacing: [[{to: 4, cells: 16, ratio: 1.03}, {to: 8, cells: 16, ratio: 0.97}, {to: 14, cells: 24},
        {to: 16, cells: 6, ratio: 1.1}], [{to: 4, cells: 16}, {to: 8, cells: 16, ratio: 1.02}]]";
    let text = include_str!("../../inputs/collapse.yaml").replace("spacing: \"${h}\"", spacing);
    let graded = |n: &str, method: &str| {
        let analysis = run_text(&text, &[("n", n), ("method", method)]).completed();
        if method != "gimp" {
            assert_balanced(&analysis); // GIMP domains lose the part of their weight that lies beyond the base
        }
        assert_admissible(&analysis);
        let [x, y] = extent_and_height(&analysis);
        println!("graded, {method}, {n}²: extent {x:.4}, height {y:.4}");
        [x, y]
    };
    let even = |n: &str, method: &str| extent_and_height(&collapse("0.25", n, method, "corners"));
    let apart = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|d: usize| (a[d] - b[d]).abs());
    for &n in first(1, &["3", "6"]) {
        // Table 6, h = 0.25 m: the lowest and highest values, to half a digit.
        let [x, y] = graded(n, "mpm");
        assert!((13.7865..13.8635).contains(&x) && (6.2255..6.2345).contains(&y), "{x:.4} {y:.4}");
    }
    let difference = apart(graded("3", "cpdi2"), even("3", "cpdi2"));
    assert!(difference.into_iter().all(|d| d < 1e-3), "{difference:?}");
    if !is_long() {
        return;
    }
    let [few, more] = ["3", "6"].map(|n| even(n, "gimp"));
    let (difference, scatter) = (apart(graded("3", "gimp"), few), apart(few, more));
    println!(
        "GIMP: {difference:.4?} m from the even grid, whose numbers of points differ by {scatter:.4?} m"
    );
    assert!((0..2).all(|d| difference[d] < scatter[d]), "{difference:?} {scatter:?}");
}
