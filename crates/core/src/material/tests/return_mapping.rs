//! The return mapping of laws in principal axes: consistency of the modulus in every region and near the boundaries
//! between regions, stresses on the yield surface, dissipation.

use super::*;

/// A fixed sequence of numbers between −1 and 1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn strains(&mut self, size: f64) -> [f64; 3] {
        let mut strains = [self.next() * size, self.next() * size, self.next() * size];
        strains.sort_by(|a, b| b.total_cmp(a));
        strains
    }
}

/// A yield function of principal Kirchhoff stresses, history variables and J, relative to the strength.
type Yields = Box<dyn Fn([f64; 3], &[f64], f64) -> f64>;

/// A law with its history variables at the start.
struct Case {
    law: Box<dyn PrincipalLaw>,
    old: Vec<f64>,
    /// Size of the strains, [-].
    size: f64,
    yields: Yields,
}

fn trace(e: [f64; 3]) -> f64 {
    e[0] + e[1] + e[2]
}

fn case<L: PrincipalLaw + Material + 'static>(
    law: L,
    size: f64,
    yields: impl Fn([f64; 3], &[f64], f64) -> f64 + 'static,
) -> Case {
    let old = law.initial_history();
    Case { law: Box::new(law), old, size, yields: Box::new(yields) }
}

/// The larger of the excesses over the shear and the tensile strength, relative to the sum of c cos φ and the
/// magnitudes of the largest and the smallest stress, [-].
fn mohr_coulomb(tau: [f64; 3], friction: Friction, tensile: f64, factor: f64) -> f64 {
    let [high, low] = [tau[0].max(tau[1]).max(tau[2]), tau[0].min(tau[1]).min(tau[2])];
    let sine = friction.friction_angle.to_radians().sin();
    let cosine = friction.friction_angle.to_radians().cos();
    let cohesion = factor * friction.cohesion;
    // The textbook form: (σ₁ − σ₃)/2 + (σ₁ + σ₃)/2 sin φ − c cos φ.
    let shear = 0.5 * (high - low) + 0.5 * (high + low) * sine - cohesion * cosine;
    shear.max(high - factor * tensile) / (cohesion * cosine + high.abs() + low.abs())
}

fn drucker_prager(tau: [f64; 3], eta: f64, xi: f64, cohesion: f64) -> f64 {
    let mean = trace(tau) / 3.0;
    let radius = (0.5 * tau.iter().map(|t| (t - mean) * (t - mean)).sum::<f64>()).sqrt();
    (radius + eta * mean - xi * cohesion) / (radius + (eta * mean).abs() + xi * cohesion)
}

fn cases() -> Vec<Case> {
    use StrengthMeasure::{Cauchy, Kirchhoff};
    let tresca = |c: f64| Friction { cohesion: c, friction_angle: 0.0, dilation_angle: 0.0 };
    let sand = |dilation_angle| Friction { dilation_angle, ..CLAY };
    let mut cases = vec![
        case(Tresca::new(1e6, 0.3, 20e3), 0.1, move |tau, _, _| {
            mohr_coulomb(tau, tresca(20e3), f64::INFINITY, 1.0)
        }),
        case(Tresca::new(1e6, 0.3, 20e3).limiting(Cauchy), 0.1, move |tau, _, j| {
            mohr_coulomb(tau, tresca(20e3), f64::INFINITY, j)
        }),
        case(
            Tresca::new(1e6, 0.3, 20e3).softening(5e3, Softening::over(0.4)),
            0.1,
            move |tau, history, _| {
                let cohesion = 5e3 + 15e3 * (-3.0 * history[0] / 0.4).exp();
                mohr_coulomb(tau, tresca(cohesion), f64::INFINITY, 1.0)
            },
        ),
        case(softening_sand(), 0.1, |tau, history, j| {
            let share = (-3.0 * history[0] / 0.5).exp();
            let slope = |peak: f64, residual: f64| {
                let [peak, residual] = [peak, residual].map(|a| a.to_radians().tan());
                residual + share * (peak - residual)
            };
            let cohesion = 2e3 + share * 18e3;
            let friction_angle = slope(35.0, 28.0).atan().to_degrees();
            let friction = Friction { cohesion, friction_angle, dilation_angle: 0.0 };
            mohr_coulomb(tau, friction, 8e3 * cohesion / 20e3, j)
        }),
    ];
    for (measure, dilation) in [(Kirchhoff, 25.0), (Kirchhoff, 0.0), (Cauchy, 25.0), (Cauchy, 10.0)] {
        let factor = move |j: f64| if measure == Cauchy { j } else { 1.0 };
        let law = MohrCoulomb::new(1e6, 0.3, sand(dilation)).limiting(measure);
        cases.push(case(law.clone(), 0.05, move |tau, _, j| {
            mohr_coulomb(tau, CLAY, f64::INFINITY, factor(j))
        }));
        let cut = law.tensile_strength(4e3);
        cases.push(case(cut, 0.05, move |tau, _, j| mohr_coulomb(tau, CLAY, 4e3, factor(j))));
        let sine = 25f64.to_radians().sin();
        let [eta, xi] = [sine, 25f64.to_radians().cos()].map(|x| 6.0 * x / (3f64.sqrt() * (3.0 - sine)));
        let cone = DruckerPrager::new(1e6, 0.3, sand(dilation), Match::Compression).limiting(measure);
        cases.push(case(cone, 0.05, move |tau, _, j| drucker_prager(tau, eta, xi, factor(j) * 10e3)));
    }
    for law in cam_clays() {
        cases.push(case(law, 0.06, |tau, history, _| {
            let pressure = -trace(tau) / 3.0;
            let q = (1.5 * tau.iter().map(|t| (t + pressure) * (t + pressure)).sum::<f64>()).sqrt();
            ((q / 1.05).powi(2) + pressure * (pressure - history[0])) / history[0].max(pressure).powi(2)
        }));
    }
    cases
}

impl Case {
    fn respond(&self, trial: [f64; 3], old: &[f64]) -> Option<(PrincipalResponse, Vec<f64>)> {
        let mut new = old.to_vec();
        self.law.respond(trial, old, &mut new).ok().map(|response| (response, new))
    }

    /// Error of the modulus at these strains compared with central differences, relative to the stiffness at zero
    /// strain.
    fn error_of_modulus(&self, trial: [f64; 3], old: &[f64], h: f64) -> f64 {
        let (response, _) = self.respond(trial, old).expect("a response");
        let (at_rest, _) = self.respond([0.0; 3], &self.old).expect("a response");
        let scale = response.modulus[0][0].abs().max(at_rest.modulus[0][0]);
        let mut largest = 0.0f64;
        for j in 0..3 {
            let [plus, minus] = [h, -h].map(|by| {
                let mut shifted = trial;
                shifted[j] += by;
                self.respond(shifted, old).expect("a response").0.tau
            });
            for i in 0..3 {
                let numeric = (plus[i] - minus[i]) / (2.0 * h);
                largest = largest.max((numeric - response.modulus[i][j]).abs() / scale);
            }
        }
        largest
    }

    /// Relative difference of the moduli at two strains.
    fn jump(&self, a: [f64; 3], b: [f64; 3], old: &[f64]) -> f64 {
        let modulus = |e| self.respond(e, old).expect("a response").0.modulus;
        let (a, b) = (modulus(a), modulus(b));
        let norm = |m: &[[f64; 3]; 3]| m.as_flattened().iter().map(|x| x * x).sum::<f64>().sqrt();
        let difference: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] - b[i][j]));
        norm(&difference) / norm(&a).max(norm(&b)).max(f64::MIN_POSITIVE)
    }

    /// A history after some flow.
    fn flowed(&self, random: &mut Random) -> Vec<f64> {
        let (mut elastic, mut history) = ([0.0; 3], self.old.clone());
        for _ in 0..4 {
            let step = random.strains(0.3 * self.size);
            let trial = std::array::from_fn(|i| elastic[i] + step[i]);
            let mut sorted: [f64; 3] = trial;
            sorted.sort_by(|a, b| b.total_cmp(a));
            if let Some((response, new)) = self.respond(sorted, &history) {
                (elastic, history) = (response.elastic_strain, new);
            }
        }
        history
    }
}

fn between(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
}

/// Moduli that differ by more than this belong to different regions, [-].
const JUMP: f64 = 0.02;

#[test]
fn the_modulus_is_consistent_in_all_regions_and_near_their_borders() {
    let mut random = Random(1);
    for case in cases() {
        let (mut borders, mut worst) = (0, 0.0f64);
        for number in 0..400 {
            let old = if number % 2 == 0 { case.old.clone() } else { case.flowed(&mut random) };
            let size = case.size * [1.0, 0.3, 0.05][number % 3];
            let (mut a, mut b) = (random.strains(size), random.strains(size));
            if number % 5 == 0 {
                a[1] = a[0] - 1e-5 * size; // nearly equal strains
            }
            let (near, far) = (a, b);
            if case.respond(a, &old).is_none() || case.respond(b, &old).is_none() {
                continue;
            }
            if case.jump(a, b, &old) > JUMP {
                // Bisection locates the boundary between the two regions.
                while (a[0] - b[0]).abs() + (a[1] - b[1]).abs() + (a[2] - b[2]).abs() > 1e-6 * size {
                    let middle = between(a, b, 0.5);
                    let is_first = case.jump(a, middle, &old) > case.jump(middle, b, &old);
                    *if is_first { &mut b } else { &mut a } = middle;
                }
                if case.jump(a, b, &old) > JUMP {
                    borders += 1;
                    for by in [-1e-4, 1e-4] {
                        let beside = std::array::from_fn(|i| a[i] + by * (far[i] - near[i]));
                        worst = worst.max(case.error_of_modulus(beside, &old, 1e-5 * by.abs() * size));
                    }
                }
            }
            for e in [near, far] {
                let errors = [1e-7, 1e-9].map(|h| case.error_of_modulus(e, &old, h * size / 0.05));
                worst = worst.max(errors[0].min(errors[1]));
            }
        }
        assert!(borders > 20 && worst < 1e-6, "{borders} borders, {worst:e}");
    }
}

#[test]
fn equal_strains_have_the_limit_of_the_modulus() {
    for law in laws().iter().map(AsRef::as_ref).filter(|law| !law.state_fields().is_empty()) {
        // Softening has no tangent where the deviatoric flow changes sign.
        let at_apex = (!format!("{law:?}").contains("Softening")).then_some([0.03, 0.03, 0.03]);
        let others = [[0.02, 0.02, -0.03], [0.02, -0.01, -0.01], [-0.02, -0.02, -0.02]];
        for strain in others.into_iter().chain(at_apex) {
            for gap in [0.0, 1e-14, 1e-11, 1e-9, 1e-7] {
                let e = Sym3([strain[0] + gap, strain[1], strain[2] - gap, 0.0, 0.0, 0.0]);
                assert_eq!(conformance::check_at(law, &e), [], "{law:?} {gap:e}");
            }
        }
    }
}

/// Plastic work τ : Δε^p is never negative, even where flow is not associated, since no dilation angle exceeds the
/// friction angle: on the Mohr-Coulomb surface τ · m = 2c√N − (N − N_ψ) τ₁, and on the cone ξ c − (η − η̄) p; τ₁ and p
/// do not exceed their values at the apex, 2c√N/(N − 1) and ξ c/η, at which both expressions are at least zero (equal
/// to zero for N_ψ = 1 and η̄ = 0). If the strength limits the Cauchy stress, c is multiplied by J, and with softening,
/// the strength at the end of the step is used; neither changes this result. On the ellipse of Cam-clay, τ · m = P P_c.
/// Part of the work is stored in the hardening of Cam-clay, so for this law the test covers only the sum, not the part
/// that is dissipated as heat.
#[test]
fn stresses_return_to_the_surface_and_plastic_work_is_never_negative() {
    let mut random = Random(2);
    for case in cases() {
        let (mut yielded, mut refused) = (0, 0);
        for _ in 0..200 {
            let (mut elastic, mut history, mut volume) = ([0.0; 3], case.old.clone(), 0.0f64);
            for _ in 0..10 {
                let step = random.strains(0.5 * case.size);
                let mut trial: [f64; 3] = std::array::from_fn(|i| elastic[i] + step[(i + 1) % 3]);
                trial.sort_by(|a, b| b.total_cmp(a));
                let Some((response, new)) = case.respond(trial, &history) else {
                    refused += 1;
                    break;
                };
                volume += trace(step);
                let surface = (case.yields)(response.tau, &new, volume.exp());
                assert!(surface < 1e-10, "{surface:e} beyond the surface");
                if response.elastic_strain != trial {
                    yielded += 1;
                    assert!(surface.abs() < 1e-12, "{surface:e} off the surface at {trial:?}");
                    let work: f64 =
                        (0..3).map(|i| response.tau[i] * (trial[i] - response.elastic_strain[i])).sum();
                    assert!(work >= -1e-9 * 1e6 * case.size.powi(2), "{work:e}");
                }
                (elastic, history) = (response.elastic_strain, new);
            }
        }
        assert!(yielded > 500 && refused * 50 < yielded, "{yielded} yielded, {refused} refused");
    }
}

/// An unconfined point that flows from its peak: if the softening strain is just above its least value, the stress
/// falls gradually; just below it, the stress jumps or has no solution.
#[test]
fn softening_has_a_solution_down_to_the_least_strain() {
    let angles =
        |cohesion, friction_angle, dilation_angle| Friction { cohesion, friction_angle, dilation_angle };
    for (peak, residual) in [
        (angles(20e3, 0.0, 0.0), angles(5e3, 0.0, 0.0)),
        (angles(20e3, 30.0, 0.0), angles(2e3, 30.0, 0.0)),
        (angles(20e3, 30.0, 10.0), angles(15e3, 20.0, 0.0)),
        (angles(20e3, 35.0, 35.0), angles(20e3, 30.0, 30.0)),
    ] {
        let (young, poisson) = (1e7, 0.3);
        let least = least_softening_strain([young, poisson], [peak, residual]);
        if peak.friction_angle == 0.0 {
            let shear = young / (2.0 * (1.0 + poisson));
            assert!((least * shear / (3f64.sqrt() * 15e3) - 1.0).abs() < 1e-14, "{least}");
        }
        let slope = peak.friction_angle.to_radians().tan();
        let root = slope + (1.0 + slope * slope).sqrt();
        let strength = 2.0 * peak.cohesion * root;
        let sine = peak.dilation_angle.to_radians().sin();
        let dilation = (1.0 + sine) / (1.0 - sine);
        let at_peak = Elasticity::from_young_poisson(young, poisson).principal_strain([
            0.0,
            -0.5 * strength,
            -strength,
        ]);
        let flow = |strain: f64| {
            let law = MohrCoulomb::new(young, poisson, peak)
                .limiting(StrengthMeasure::Kirchhoff)
                .softening(residual, Softening::over(strain));
            let mut new = law.initial_history();
            // In the direction of flow.
            let trial = [at_peak[0] + 1e-9 * dilation, at_peak[1], at_peak[2] - 1e-9];
            law.respond(trial, &law.initial_history(), &mut new).ok().map(|_| new[0])
        };
        let gradual = flow(1.01 * least).expect("a response");
        assert!(gradual > 1e-10 && gradual < 1e-6, "{gradual:e}");
        assert!(flow(0.99 * least).is_none_or(|kappa| kappa > 1e-5), "{:?}", flow(0.99 * least));
    }
}
