//! Section 7.4: annulus under torsion on grids of triangles, a manufactured solution.

use crate::verification::analysis::{Analysis, run};

const INNER: f64 = 0.75;
const OUTER: f64 = 1.25;

/// Rotation at the radius `r`, eq. (44); its maximum is α.
fn theta(r: f64, alpha: f64) -> f64 {
    alpha * 16.0 * ((r - INNER) * (r - OUTER)).powi(2) / (INNER - OUTER).powi(4)
}

/// Displacement of the point at the original position X.
fn exact(place: [f64; 2], alpha: f64) -> [f64; 2] {
    let (s, c) = theta(place[0].hypot(place[1]), alpha).sin_cos();
    [c * place[0] - s * place[1] - place[0], s * place[0] + c * place[1] - place[1]]
}

/// Mean distance of the points from their exact positions, weighted with their volume, m.
fn error(analysis: &Analysis) -> f64 {
    let points = &analysis.points;
    let (mut sum, mut volume) = (0.0, 0.0);
    for p in 0..points.len() {
        let u = exact(points.original_position[p], 0.1);
        let off = |d: usize| points.converged.position[p][d] - points.original_position[p][d] - u[d];
        sum += off(0).hypot(off(1)) * points.original_volume[p];
        volume += points.original_volume[p];
    }
    assert!((volume / (std::f64::consts::PI * (OUTER * OUTER - INNER * INNER)) - 1.0).abs() < 0.05);
    sum / volume
}

fn annulus(segments: usize, n: usize) -> Analysis {
    run("annulus.yaml", &[("segments", &segments.to_string()), ("n", &n.to_string())])
}

/// Slope of ln(error) over ln(h) by least squares, where h is inversely proportional to the number of segments.
fn slope(results: &[(usize, f64)]) -> f64 {
    let pairs: Vec<(f64, f64)> = results.iter().map(|(s, e)| (-(*s as f64).ln(), e.ln())).collect();
    let n = pairs.len() as f64;
    let (mx, my) = pairs.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let above: f64 = pairs.iter().map(|(x, y)| (x - mx) * (y - my)).sum();
    above / pairs.iter().map(|(x, _)| (x - mx).powi(2)).sum::<f64>()
}

/// The body force of the deck balances the divergence of the Cauchy stress of the motion: the deck's formulas are
/// compared with finite differences, on the deformed body, of the stress computed from b = F Fᵀ.
#[test]
fn the_body_force_balances_the_stress_of_the_motion() {
    let (model, _) = crate::verification::analysis::build_deck("annulus.yaml", &[]);
    let mpm::model::Action::BodyForce(formula) = &model.loads[0].action else { panic!("a body force") };
    let alpha = 0.1;
    // Cauchy stress at the material point X; E = 1, ν = 0, J = 1: σ = ½ ln(F Fᵀ).
    let stress = |x: [f64; 2]| {
        let h = 1e-5;
        let y = |x: [f64; 2]| {
            let u = exact(x, alpha);
            [x[0] + u[0], x[1] + u[1]]
        };
        let mut f = mpm::tensor::Mat3::identity();
        for j in 0..2 {
            let (mut plus, mut minus) = (x, x);
            plus[j] += h;
            minus[j] -= h;
            for i in 0..2 {
                f[(i, j)] = (y(plus)[i] - y(minus)[i]) / (2.0 * h);
            }
        }
        (mpm::tensor::Sym3::symmetric_part(&(f * f.transpose())).map_eigenvalues(f64::ln) * 0.5, f)
    };
    for x in [[0.9, 0.1], [-0.3, 0.95], [0.6, -0.9], [0.8, 0.8]] {
        let (_, f) = stress(x);
        let inverse = f.try_inverse().unwrap();
        let h = 1e-4;
        let mut divergence = [0.0; 2];
        for k in 0..2 {
            let (mut plus, mut minus) = (x, x);
            plus[k] += h;
            minus[k] -= h;
            let (plus, minus) = (stress(plus).0, stress(minus).0);
            for (i, sum) in divergence.iter_mut().enumerate() {
                for j in 0..2 {
                    // ∂/∂x_j = Σ_k ∂/∂X_k F⁻¹_kj
                    let slope = (plus.component(i, j) - minus.component(i, j)) / (2.0 * h);
                    *sum += slope * inverse[(k, j)];
                }
            }
        }
        let b = formula.evaluate(&x, &x, 1.0);
        for i in 0..2 {
            assert!((b[i] + divergence[i]).abs() < 1e-5, "{x:?}: {b:?} {divergence:?}");
        }
    }
}

/// Fig. 19 on the coarser grids: with enough points, the order of the error approaches 2; with one point per triangle,
/// it does not.
#[test]
fn the_error_falls_with_refinement_if_there_are_enough_points() {
    let study = |n: usize| -> Vec<(usize, f64)> {
        [18, 36, 72, 144].map(|s| (s, error(&annulus(s, n).completed()))).to_vec()
    };
    let fine = study(36);
    println!("36 points: {fine:?}, slope {:.2}", slope(&fine));
    assert!(slope(&fine) > 1.75);
    let few = error(&annulus(72, 1).completed());
    println!("1 point at 72 segments: {few:.3e}");
    assert!(few > 2.0 * fine[2].1);
    // With one point per triangle the finer grids tear, and the run ends with an error instead of writing steps that
    // are not in equilibrium.
    assert!(annulus(144, 1).summary.is_err());
}

/// Fig. 19 with all five grids and 144 points per triangle; the largest run has 1.4 million points.
#[test]
#[ignore = "minutes: runs in `tests/run --long`"]
fn the_displacement_converges_with_order_two() {
    let results = [18, 36, 72, 144, 288].map(|s| (s, error(&annulus(s, 144).completed())));
    println!("144 points: {results:?}, slope {:.3}", slope(&results));
    assert!((slope(&results) - 2.0).abs() < 0.15);
}
