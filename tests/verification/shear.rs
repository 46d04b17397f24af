//! Simple shear, Coombs et al. (2020), section 7.2: the deformation is homogeneous and prescribed, so every point must
//! show the stress of the law under F = [[1, γ], [0, 1]], whatever the method and wherever the points stand in the
//! grid.

use std::f64::consts::SQRT_2;

use mpm::kinematics::Increment;
use mpm::material::{Material, VonMises};
use mpm::stress::{Mechanics, PlaneStrain, StartOfStep};
use mpm::tensor::{Mat3, Sym3};

use crate::verification::analysis::{build_deck, watch};

const YOUNG: f64 = 10e3;
const POISSON: f64 = 0.3;

/// Shear per load step when the paper's 30 steps reach γ = 6.
const D_GAMMA: f64 = 0.2;

/// Method, points per cell and axis, and the number of steps of 0.2 over which the motion is fully prescribed.
///
/// Neighbouring rows of points start γ/(8n) apart. Once that is more than two cells of 1/8 (γ > 2n), the cells of their
/// first points can have a free node between them, whose cells are only partly filled: the homogeneous motion is no
/// longer in equilibrium there. Domains delay this to γ > 2n + 1, because they reach into neighbouring cells. The paper
/// shows stresses for n = 3 only.
const CASES: [(&str, &str, usize); 5] =
    [("mpm", "2", 20), ("mpm", "3", 30), ("mpm", "4", 30), ("gimp", "2", 24), ("gimp", "3", 30)];

/// Kirchhoff stress of every point after every equilibrated step, and the extremes of Σ_v S_vp.
struct Shear {
    stresses: Vec<Vec<Sym3>>,
    unity: Vec<[f64; 2]>,
    completed: bool,
}

fn shear(gamma: f64, steps: usize, set: &[(&str, &str)]) -> Shear {
    let (gamma, steps) = (gamma.to_string(), steps.to_string());
    let set: Vec<_> = set.iter().copied().chain([("gamma", gamma.as_str()), ("steps", &steps)]).collect();
    let (model, mut points) = build_deck("shear.yaml", &set);
    let (mut stresses, mut unity) = (Vec::new(), Vec::new());
    let outcome = watch(&model, &mut points, |points, report| {
        stresses.push(points.converged.kirchhoff_stress.clone());
        let sum_at = |p| {
            let mut sum = 0.0;
            report.grid.links.for_each_value(p, |_, value| sum += value);
            sum
        };
        let sums = (0..points.len()).map(sum_at);
        unity.push(sums.fold([f64::MAX, f64::MIN], |[low, high], s| [low.min(s), high.max(s)]));
    });
    Shear { stresses, unity, completed: outcome.is_ok() }
}

/// Largest |τ_p − τ| over the points, relative to |τ|.
fn largest_error(stresses: &[Sym3], exact: &Sym3) -> f64 {
    stresses.iter().map(|tau| (*tau - *exact).norm()).fold(0.0, f64::max) / exact.norm()
}

/// Largest difference of the stress from that of the first point, relative to the latter.
fn spread(stresses: &[Sym3]) -> f64 {
    largest_error(stresses, &stresses[0])
}

/// τ = 2G ½ ln b with b = F Fᵀ. With sinh a = γ/2 the eigenvalues of b are exp(±2a), and b = cosh(2a) I + sinh(2a) N in
/// the plane with N = [[γ/2, 1], [1, −γ/2]] / cosh a, hence ½ ln b = a N; it has no trace.
fn elastic_stress(gamma: f64) -> Sym3 {
    let shear_modulus = YOUNG / (2.0 * (1.0 + POISSON));
    let tau_12 = 2.0 * shear_modulus * (gamma / 2.0).asinh() / (1.0 + gamma * gamma / 4.0).sqrt();
    let tau_11 = tau_12 * gamma / 2.0;
    Sym3([tau_11, -tau_11, 0.0, 0.0, 0.0, SQRT_2 * tau_12])
}

/// The law alone, driven by `steps` equal increments of simple shear: the stress after each.
fn driven(law: &dyn Material, gamma: f64, steps: usize) -> Vec<Sym3> {
    let d_gamma = gamma / steps as f64;
    let df = Mat3::new(1.0, d_gamma, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let mut strain = Sym3::ZERO;
    let mut old: Vec<f64> = law.state_fields().iter().map(|f| f.initial).collect();
    let mut stresses = Vec::new();
    for _ in 0..steps {
        let b_n = strain.map_eigenvalues(|e| (2.0 * e).exp()).to_matrix();
        let trial = Sym3::symmetric_part(&(df * b_n * df.transpose())).map_eigenvalues(|b| 0.5 * b.ln());
        let mut new = old.clone();
        let response = law.update(&trial, &old, &mut new).unwrap();
        strain = response.elastic_strain;
        old = new;
        stresses.push(response.tau);
    }
    stresses
}

#[test]
fn closed_form_is_half_the_logarithm_of_b() {
    for gamma in [0.1, 1.0, 6.0] {
        let f = Mat3::new(1.0, gamma, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
        let b = Sym3::symmetric_part(&(f * f.transpose()));
        let tau = b.map_eigenvalues(f64::ln) * (0.5 * YOUNG / (1.0 + POISSON));
        assert!((tau - elastic_stress(gamma)).norm() < 1e-13 * tau.norm());
    }
}

/// Paper: the standard method agrees with the analytical solution "to a normalised error of the order of 1e-5" and all
/// points have the same stress "to machine precision".
#[test]
fn elastic_stress_is_the_closed_form_at_every_point_and_step() {
    for (method, n, steps) in CASES {
        let run = shear(D_GAMMA * steps as f64, steps, &[("method", method), ("n", n)]);
        assert!(run.completed && run.stresses.len() == steps);
        let (mut error, mut uneven) = (0.0f64, 0.0f64);
        for (step, stresses) in run.stresses.iter().enumerate() {
            let exact = elastic_stress(D_GAMMA * (step + 1) as f64);
            error = error.max(largest_error(stresses, &exact));
            uneven = uneven.max(spread(stresses));
        }
        println!("elastic, {method} n = {n}: error {error:.1e}, spread {uneven:.1e}");
        assert!(error < 1e-11, "{method} {n}: error {error:e}");
        assert!(uneven < 1e-11, "{method} {n}: spread {uneven:e}");
    }
}

#[test]
fn plastic_stress_is_that_of_the_law_alone_at_every_point_and_step() {
    let law = VonMises::new(YOUNG, POISSON, 5e3);
    for (method, n, steps) in CASES {
        let gamma = D_GAMMA * steps as f64;
        for steps in [steps / 2, steps] {
            let run = shear(gamma, steps, &[("method", method), ("n", n), ("yield", "5e3")]);
            assert!(run.completed && run.stresses.len() == steps);
            let mut error = 0.0f64;
            for (stresses, exact) in run.stresses.iter().zip(&driven(&law, gamma, steps)) {
                error = error.max(largest_error(stresses, exact));
                for tau in stresses {
                    assert!(tau.deviator().norm() < 5e3 * (1.0 + 1e-9), "outside the yield surface");
                }
            }
            println!("plastic, {method} n = {n}, {steps} steps: error {error:.1e}");
            assert!(error < 1e-10, "{method} {n} {steps}: error {error:e}");
        }
    }
}

/// Smallest eigenvalue of the acoustic tensor n_j a_ijkl n_l over all directions n in the plane, relative to the shear
/// modulus, after each of `steps` increments of the law alone.
fn acoustic(law: &VonMises, gamma: f64, steps: usize) -> Vec<f64> {
    let df = [[1.0, gamma / steps as f64], [0.0, 1.0]];
    let mut strain = Sym3::ZERO;
    let mut smallest = Vec::new();
    for _ in 0..steps {
        let b_n = PlaneStrain::elastic_left_cauchy_green(law.strain_measure(), &strain);
        let start = StartOfStep { b_n, J_n: 1.0, volume_n: 1.0 };
        let increment = Increment::flat(df);
        let point = PlaneStrain::respond_current(&start, &increment, law, &[0.0], &mut [0.0]).unwrap();
        strain = point.elastic_strain;
        let c = point.weak;
        let along = |degrees: i32| {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let n = [cos, sin];
            let q = |i: usize, k: usize| -> f64 {
                (0..4).map(|m| n[m / 2] * c.tangent[m % 2][m / 2][i][k] * n[m % 2]).sum()
            };
            let (mean, half) = (0.5 * (q(0, 0) + q(1, 1)), 0.5 * (q(0, 0) - q(1, 1)));
            mean - half.hypot(q(0, 1))
        };
        let lowest = (0..180).map(along).fold(f64::MAX, f64::min);
        smallest.push(lowest * 2.0 * (1.0 + POISSON) / YOUNG);
    }
    smallest
}

/// Once the material has yielded, the shear stress falls with γ, and the homogeneous motion loses its stability: the
/// equations are no longer elliptic.
#[test]
fn homogeneous_shear_is_stable_until_the_law_yields() {
    let law = VonMises::new(YOUNG, POISSON, 5e3);
    let steps = 120;
    let stresses = driven(&law, 6.0, steps);
    let acoustic = acoustic(&law, 6.0, steps);
    let first = stresses.iter().position(|tau| tau.deviator().norm() > 4.999e3).unwrap();
    assert!(first == 19, "yields beyond γ = 0.95");
    assert!(stresses[first..].windows(2).all(|tau| tau[1].0[5] < tau[0].0[5]), "the shear stress falls");
    println!("acoustic tensor: {:.3} G before yielding, {:.3} G after", acoustic[first - 1], acoustic[first]);
    assert!(acoustic[..first].iter().all(|a| *a > 0.3) && acoustic[first..].iter().all(|a| *a < -0.2));
}

/// The finite increments are the only source of error: it falls with first order, relative to a run of the law alone
/// with very fine increments.
///
/// The grid is coarse because homogeneous shear is unstable here (see above), so that its round-off grows with every
/// step: at h = 0.125 m from 1e-14 to 1e-10 in 120 steps and to a stress that varies by 40 % in 240, while the 30 steps
/// of the paper leave it at 1e-13. With h = 0.25 m too few nodes are free.
#[test]
fn plastic_stress_converges_with_smaller_increments() {
    const FINE: usize = 15 * 4096;
    let truth = driven(&VonMises::new(YOUNG, POISSON, 5e3), 6.0, FINE);
    let mut errors = Vec::new();
    for steps in [15, 30, 60, 120, 240] {
        let run = shear(6.0, steps, &[("h", "0.25"), ("n", "3"), ("yield", "5e3")]);
        assert!(run.completed);
        // All runs are compared at the 15 shears that they share.
        let error = (1..=15)
            .map(|k| largest_error(&run.stresses[k * steps / 15 - 1], &truth[k * FINE / 15 - 1]))
            .fold(0.0, f64::max);
        errors.push(error);
    }
    let orders: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
    println!("errors {errors:.4?}, orders {orders:.3?}");
    assert!(orders.iter().all(|&order| order > 0.9), "errors {errors:?}, orders {orders:?}");
}

/// Paper: the update of eq. (34) is the only exception. It lengthens domains in y although simple shear keeps their
/// height; the domains of the outer layers leave the physical domain, partition of unity is lost and the stress varies.
#[test]
fn update_by_the_stretch_tensor_loses_uniform_stress_and_the_others_do_not() {
    for update in ["none", "determinant", "diagonal", "corners", "diagonal-corrected", "diagonal-incremental"]
    {
        let run = shear(6.0, 30, &[("method", "gimp"), ("n", "3"), ("update", update)]);
        assert!(run.completed);
        let worst = run.stresses.iter().map(|s| spread(s)).fold(0.0, f64::max);
        let lost = run.unity.iter().flatten().map(|s| (s - 1.0).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-10, "{update}: spread {worst:e}");
        assert!(lost < 1e-12, "{update}: partition of unity lost by {lost:e}");
    }
    let run = shear(6.0, 30, &[("method", "gimp"), ("n", "3"), ("update", "stretch")]);
    let spreads: Vec<f64> = run.stresses.iter().map(|s| spread(s)).collect();
    assert!(spreads[0] < 1e-12, "the domains of the first step are those of the start: {:e}", spreads[0]);
    assert!(spreads[1..].is_sorted() && spreads[1] > 0.02 && spreads[29] > 0.5, "{spreads:?}");
    let lowest: Vec<f64> = run.unity.iter().map(|[low, _]| *low).collect();
    assert!(lowest.is_sorted_by(|a, b| a >= b) && lowest[29] < 0.9, "{lowest:?}");
}

/// CPDI with either kind of corner update carries the homogeneous motion exactly.
#[test]
fn cpdi_points_carry_the_homogeneous_motion() {
    for method in ["cpdi1", "cpdi2"] {
        let set = [("method", method), ("n", "3"), ("gamma", "3"), ("steps", "15")];
        let analysis = crate::verification::analysis::run("shear.yaml", &set).completed();
        let g: f64 = 10e3 / (2.0 * 1.3);
        let exact = 2.0 * g * 1.5f64.asinh() / (1.0f64 + 2.25).sqrt();
        let worst = analysis
            .points
            .converged
            .kirchhoff_stress
            .iter()
            .map(|tau| (tau.component(0, 1) / exact - 1.0).abs())
            .fold(0.0, f64::max);
        println!("{method}: {worst:.1e}");
        assert!(worst < 1e-11);
        // The domains are sheared with the material: parallelograms of unchanged area.
        for p in 0..analysis.points.len() {
            let area = mpm::basis::domain_volume(analysis.points.corners(p));
            assert!((area / analysis.points.original_volume[p] - 1.0).abs() < 1e-11);
        }
    }
}
