//! Element tests: comparisons with closed-form solutions, and laws that make the iterations difficult.

use super::response::respond;
use super::*;
use crate::material::{
    Elasticity, Friction, Hencky, MohrCoulomb, NeoHookean, Response, Softening, StateField, StrainMeasure,
    VonMises,
};

const YOUNG: f64 = 1e6;
const POISSON: f64 = 0.3;
const YIELD: f64 = 20e3;

fn states(
    law: &dyn Material,
    path: Path,
    confining: f64,
    turning_points: &[f64],
    steps: usize,
) -> Vec<ElementState> {
    let test = ElementTest::new(law, &law.initial_history(), &(Sym3::IDENTITY * -confining)).unwrap();
    let initial = *test.initial_stress();
    let targets = turning_points.iter().map(move |measure| path.target(*measure, &initial));
    let start = std::iter::once(Ok(test.state().clone()));
    start.chain(test.follow(targets, steps)).collect::<Result<_, _>>().unwrap()
}

fn close(value: f64, expected: f64, scale: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance * scale, "{value:e} instead of {expected:e}");
}

#[test]
fn steps_are_even_between_the_targets() {
    let law = Hencky::new(YOUNG, POISSON);
    let through: Vec<f64> = states(&law, Path::Oedometer, 0.0, &[0.25, -0.25], 2)
        .iter()
        .map(|state| -state.strain.0[1])
        .collect();
    assert_eq!(through, [0.0, 0.125, 0.25, 0.0, -0.25]);
    let test = ElementTest::new(&law, &[], &Sym3::ZERO).unwrap();
    assert_eq!(test.clone().follow([], 5).count(), 0);
    assert_eq!(test.follow([Target::strain(&Sym3::ZERO)], 0).count(), 1, "at least one step");
}

#[test]
fn oedometric_and_isotropic_compression_of_hencky() {
    let law = Hencky::new(YOUNG, POISSON);
    let Elasticity { bulk, shear } = Elasticity::from_young_poisson(YOUNG, POISSON);
    for state in states(&law, Path::Oedometer, 0.0, &[0.5, -0.2], 7) {
        let axial = state.strain.0[1];
        close(state.kirchhoff_stress.0[1], (bulk + 4.0 / 3.0 * shear) * axial, YOUNG, 1e-15);
        close(state.kirchhoff_stress.0[0], (bulk - 2.0 / 3.0 * shear) * axial, YOUNG, 1e-15);
        close(state.cauchy_stress().0[1], state.kirchhoff_stress.0[1] / axial.exp(), YOUNG, 1e-15);
        assert_eq!((state.log_volume_ratio(), state.strain.0[0], state.shear), (axial, 0.0, 0.0));
    }
    for (state, measure) in states(&law, Path::Isotropic, 0.0, &[0.6], 6).iter().zip(0..) {
        let third = -0.2 * f64::from(measure) / 6.0;
        for axis in 0..3 {
            close(state.kirchhoff_stress.0[axis], 3.0 * bulk * third, YOUNG, 1e-15);
        }
        close(state.volume_ratio(), (3.0 * third).exp(), 1.0, 1e-15);
        close(state.pressure(), -3.0 * bulk * third / (3.0 * third).exp(), YOUNG, 1e-15);
        close(state.deviatoric_stress(), 0.0, YOUNG, 1e-15);
    }
}

#[test]
fn an_initial_stress_is_added_to_that_of_hencky() {
    let law = Hencky::new(YOUNG, POISSON);
    let states = states(&law, Path::Oedometer, 50e3, &[0.1], 1);
    close(states[0].pressure(), 50e3, 50e3, 1e-14);
    let Elasticity { bulk, shear } = Elasticity::from_young_poisson(YOUNG, POISSON);
    close(states[1].kirchhoff_stress.0[1], -50e3 - 0.1 * (bulk + 4.0 / 3.0 * shear), YOUNG, 1e-14);
}

/// At lateral stress 0, τ_yy = E e_yy and e_xx = −ν e_yy; in plane strain, τ_yy = E/(1 − ν²) e_yy.
#[test]
fn compression_of_hencky_between_free_sides() {
    let law = Hencky::new(YOUNG, POISSON);
    for state in states(&law, Path::TriaxialDrained, 0.0, &[0.4, -0.4], 5) {
        let axial = state.strain.0[1];
        close(state.kirchhoff_stress.0[1], YOUNG * axial, YOUNG, 1e-14);
        close(state.strain.0[0], -POISSON * axial, 1.0, 1e-14);
        assert_eq!(state.strain.0[0], state.strain.0[2]);
    }
    for state in states(&law, Path::Biaxial, 0.0, &[0.4], 5) {
        let axial = state.strain.0[1];
        close(state.kirchhoff_stress.0[1], YOUNG / (1.0 - POISSON * POISSON) * axial, YOUNG, 1e-14);
        close(state.cauchy_stress().0[0], 0.0, YOUNG, 1e-14);
        assert_eq!(state.strain.0[2], 0.0);
    }
}

/// Beyond yield, √(2 J₂) of the Kirchhoff stress is ρ_y, so q = √(3/2) ρ_y/J.
#[test]
fn drained_triaxial_compression_of_von_mises() {
    let law = VonMises::new(YOUNG, POISSON, YIELD);
    let confining = 100e3;
    let states = states(&law, Path::TriaxialDrained, confining, &[0.2, 0.15, 0.3], 40);
    let mut flowed = 0;
    for pair in states.windows(2) {
        let (before, state) = (&pair[0], &pair[1]);
        let stress = state.cauchy_stress();
        close(stress.0[0], -confining, confining, 1e-13);
        close(stress.0[2], -confining, confining, 1e-13);
        if state.history[0] > before.history[0] {
            flowed += 1;
            close(state.deviatoric_stress(), 1.5f64.sqrt() * YIELD / state.volume_ratio(), YIELD, 1e-12);
        }
    }
    assert!((60..110).contains(&flowed), "{flowed} steps flow, the others are elastic");
}

#[test]
fn undrained_compression_keeps_the_volume() {
    let law = VonMises::new(YOUNG, POISSON, YIELD).hardening(0.2e6);
    for state in states(&law, Path::TriaxialUndrained, 100e3, &[0.3, -0.1], 97) {
        close(state.volume_ratio(), 1.0, 1.0, 1e-14);
        close(state.deformation_gradient().determinant(), 1.0, 1.0, 1e-14);
        close(state.pressure(), 100e3, 100e3, 1e-11);
        close(state.deviatoric_strain(), state.strain.0[1].abs(), 1.0, 1e-15);
    }
}

/// b = I + γ (e_x⊗e_y + e_y⊗e_x) + γ² e_x⊗e_x and J = 1: τ = μ (b − I) for the neo-Hookean law, and τ_xy = 2 G
/// arsinh(γ/2) / √(1 + γ²/4) for Hencky's law.
#[test]
fn simple_shear_at_constant_height() {
    let shear = Elasticity::from_young_poisson(YOUNG, POISSON).shear;
    let path = Path::SimpleShear { constant_normal_stress: false };
    for state in states(&NeoHookean::new(YOUNG, POISSON), path, 0.0, &[2.0, -1.0], 9) {
        let gamma = state.shear;
        let expected = [shear * gamma * gamma, 0.0, 0.0, 0.0, 0.0, shear * gamma];
        for (c, (i, j)) in crate::tensor::MANDEL.into_iter().enumerate() {
            close(state.kirchhoff_stress.component(i, j), expected[c], YOUNG, 1e-14);
        }
        assert_eq!(state.volume_ratio(), 1.0);
    }
    for state in states(&Hencky::new(YOUNG, POISSON), path, 0.0, &[3.0], 9) {
        let half = 0.5 * state.shear;
        let expected = half.asinh() / (1.0 + half * half).sqrt();
        close(state.kirchhoff_stress.component(0, 1), 2.0 * shear * expected, YOUNG, 1e-14);
        close(state.logarithmic_strain().component(0, 1), expected, 1.0, 1e-14);
    }
}

/// Hencky's law depends on the whole deformation only, here F = [[1, γ], [0, h]] with the height h.
#[test]
fn simple_shear_at_constant_normal_stress() {
    let path = Path::SimpleShear { constant_normal_stress: true };
    let law = Hencky::new(YOUNG, POISSON);
    let confining = 200e3;
    let states = states(&law, path, confining, &[0.8], 20);
    let b_of = |state: &ElementState| law.strain_measure().left_cauchy_green(&state.elastic_strain);
    for state in &states {
        close(state.cauchy_stress().0[1], -confining, confining, 1e-13);
        let F = state.deformation_gradient();
        close(F[(0, 1)], state.shear, 1.0, 1e-15);
        let b = Sym3::symmetric_part(&(F * b_of(&states[0]).to_matrix() * F.transpose()));
        assert!((b - b_of(state)).norm() < 1e-13, "{b:?} {state:?}");
    }
    let last = &states[20];
    assert!(last.log_volume_ratio() > 0.01, "{last:?} has grown in height");
    assert_eq!([last.strain.0[0], last.strain.0[2]], [0.0, 0.0]);
}

const PATHS: [Path; 7] = [
    Path::Oedometer,
    Path::Isotropic,
    Path::TriaxialDrained,
    Path::TriaxialUndrained,
    Path::Biaxial,
    Path::SimpleShear { constant_normal_stress: false },
    Path::SimpleShear { constant_normal_stress: true },
];

/// Stresses and volumes that are held stay constant, and the paths end where they should.
#[test]
fn every_law_follows_every_path() {
    for law in crate::material::tests::laws() {
        let confining = 0.005 * crate::material::axial_modulus_at_rest(law.as_ref());
        for path in PATHS {
            let states = states(law.as_ref(), path, confining, &[0.1, -0.05], 100);
            for state in &states {
                let stress = state.cauchy_stress();
                match path {
                    Path::TriaxialDrained | Path::Biaxial => {
                        close(stress.0[0], -confining, confining, 1e-8);
                    }
                    Path::SimpleShear { constant_normal_stress: true } => {
                        close(stress.0[1], -confining, confining, 1e-8);
                    }
                    Path::TriaxialUndrained => close(state.volume_ratio(), 1.0, 1.0, 1e-14),
                    _ => {}
                }
            }
            let last = &states[200];
            let measure = match path {
                Path::SimpleShear { .. } => last.shear,
                Path::Isotropic => -last.log_volume_ratio(),
                _ => -last.strain.0[1],
            };
            close(measure, -0.05, 1.0, 1e-15);
        }
    }
}

/// The work of the stresses is stored or dissipated, along fixed axes and in shear.
#[test]
fn work_is_energy_and_plastic_work() {
    let law = VonMises::new(YOUNG, POISSON, YIELD).hardening(0.2e6);
    let shear = Path::SimpleShear { constant_normal_stress: true };
    for path in [Path::TriaxialDrained, Path::Biaxial, Path::Oedometer, shear] {
        let states = states(&law, path, 50e3, &[0.15, 0.05], 2000);
        let mut work = 0.0;
        for pair in states.windows(2) {
            let [a, b] = [&pair[0], &pair[1]];
            let middle = 0.5 * (a.deformation_gradient() + b.deformation_gradient());
            let dF = b.deformation_gradient() - a.deformation_gradient();
            let rate = Sym3::symmetric_part(&(dF * middle.try_inverse().unwrap()));
            work += 0.5 * (a.kirchhoff_stress + b.kirchhoff_stress).dot(&rate);
        }
        let stored = |state: &ElementState| law.energy(&state.elastic_strain, &state.history);
        let [first, last] = [&states[0], &states[4000]];
        let expected = stored(last) - stored(first) + law.plastic_work(&last.history);
        assert!(last.history[0] > 0.05);
        close(work, expected, expected, 2e-5);
    }
}

/// The stress of a hyperelastic law is a function of the whole deformation, so a path of strains with shear can be
/// divided into arbitrary steps.
#[test]
fn a_history_of_strains_with_shear_gives_the_stress_of_its_end() {
    for law in [&Hencky::new(YOUNG, POISSON) as &dyn Material, &NeoHookean::new(YOUNG, POISSON)] {
        let strains = [[0.1, -0.2, 0.05, 0.02, -0.1, 0.3], [-0.1, 0.2, 0.1, 0.1, 0.2, -0.1]].map(Sym3);
        let test = ElementTest::new(law, &[], &Sym3::ZERO).unwrap();
        let last = test.follow(strains.map(|e| Target::strain(&e)), 1).last().unwrap().unwrap();
        let b = StrainMeasure::Logarithmic.left_cauchy_green(&strains[1]);
        let found = law.strain_measure().left_cauchy_green(&last.elastic_strain);
        assert!((b - found).norm() < 1e-14, "{b:?} {found:?}");
        assert!((last.logarithmic_strain() - strains[1]).norm() < 1e-15);
    }
}

#[test]
fn a_history_of_stresses_is_reached() {
    let law = VonMises::new(YOUNG, POISSON, YIELD).hardening(0.5e6);
    let stresses = [[-50e3, -60e3, -50e3], [-20e3, -60e3, -40e3], [0.0; 3], [-50e3; 3]];
    let test = ElementTest::new(&law, &[0.0], &(Sym3::IDENTITY * -50e3)).unwrap();
    let targets = stresses.map(Target::stress);
    let states: Vec<ElementState> = test.follow(targets, 1).collect::<Result<_, _>>().unwrap();
    for (state, stress) in states.iter().zip(stresses) {
        for (found, wanted) in state.cauchy_stress().0.into_iter().zip(stress) {
            close(found, wanted, 50e3, 1e-13);
        }
    }
    assert!(states[1].history[0] > 0.0 && states[3].history[0] == states[1].history[0]);
}

/// Central differences at states with and without shear, for a law in each measure.
#[test]
fn rates_of_the_stress_are_its_derivatives() {
    let laws: [&dyn Material; 2] =
        [&VonMises::new(YOUNG, POISSON, YIELD).hardening(0.2e6), &NeoHookean::new(YOUNG, POISSON)];
    for law in laws {
        let history = law.initial_history();
        let mut test = ElementTest::new(law, &history, &(Sym3::IDENTITY * -10e3)).unwrap();
        let skew = Sym3([0.05, -0.1, 0.02, 0.03, 0.01, -0.04]);
        let start = test.advance(&Target { shear: 0.3, ..Target::strain(&skew) }).unwrap().clone();
        let axial = test_state(law);
        for (start, strain, shear) in [
            (&start, Sym3([0.1, 0.1, -0.1, 0.01, 0.1, -0.06]), 0.5),
            (&axial, axial.strain + Sym3([0.02, -0.1, 0.03, 0.0, 0.0, 0.0]), 0.0),
        ] {
            let at = |strain: &Sym3| respond(law, start, strain, shear).unwrap();
            for (axis, rate) in at(&strain).rates.iter().enumerate() {
                let mut by = Sym3::ZERO;
                by.0[axis] = 1e-6;
                let difference = (at(&(strain + by)).stress - at(&(strain - by)).stress) * 0.5e6;
                assert!((difference - *rate).norm() < 1e-8 * YOUNG, "{difference:?} {rate:?}");
            }
        }
    }
}

fn test_state(law: &dyn Material) -> ElementState {
    states(law, Path::Oedometer, 10e3, &[0.02], 1).remove(1)
}

/// A law whose bulk modulus changes abruptly in compression, and which accepts only increments up to a bound.
#[derive(Debug)]
struct Awkward {
    stiffer: f64,
    largest_increment: f64,
    stress_at_zero: f64,
    /// Ratio of the returned tangent to the correct one.
    tangent_factor: f64,
    /// Sudden increase of the pressure under compression.
    jump: f64,
}

impl Material for Awkward {
    fn state_fields(&self) -> &[StateField] {
        const { &[StateField::new("last", "-", 0.0)] }
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        if (trial.0[1] - old[0]).abs() > self.largest_increment {
            return Err(MaterialError::NoResponse);
        }
        new[0] = trial.0[1];
        let factor = if trial.trace() < -0.01 { self.stiffer } else { 1.0 };
        let elasticity = Elasticity { bulk: YOUNG * factor, shear: 0.5 * YOUNG };
        let kink = 0.01 * YOUNG * (factor - 1.0) + self.stress_at_zero
            - if trial.trace() < -0.01 { self.jump } else { 0.0 };
        let tau = elasticity.stress(trial) + Sym3::IDENTITY * kink;
        Ok(Response { tau, elastic_strain: *trial, tangent: elasticity.tangent() * self.tangent_factor })
    }

    fn energy(&self, _: &Sym3, _: &[f64]) -> f64 {
        0.0
    }
}

const SMOOTH: Awkward = Awkward {
    stiffer: 1.0,
    largest_increment: f64::INFINITY,
    stress_at_zero: 0.0,
    tangent_factor: 1.0,
    jump: 0.0,
};

#[test]
fn a_kink_of_the_law_is_passed() {
    let stiff = Awkward { stiffer: 1000.0, ..SMOOTH };
    for path in [Path::TriaxialDrained, Path::Biaxial] {
        for state in states(&stiff, path, 0.0, &[0.3, -0.2], 3) {
            close(state.cauchy_stress().0[0], 0.0, YOUNG, 1e-9);
        }
    }
    let test = ElementTest::new(&stiff, &[0.0], &Sym3::ZERO).unwrap();
    let stress = [-30e3, -50e3, 5e3];
    let state = test.follow([Target::stress(stress)], 1).last().unwrap().unwrap();
    for (found, wanted) in state.cauchy_stress().0.into_iter().zip(stress) {
        close(found, wanted, 50e3, 1e-9);
    }
}

/// Newton's method diverges with a tangent of the wrong sign; bisection does not need the tangent.
#[test]
fn a_single_strain_is_found_without_the_tangent() {
    for tangent_factor in [-1.0, 0.0, 1e-3] {
        let law = Awkward { tangent_factor, ..SMOOTH };
        for state in states(&law, Path::TriaxialDrained, 0.0, &[0.3, -0.2], 3) {
            close(state.cauchy_stress().0[0], 0.0, YOUNG, 1e-9);
        }
    }
}

/// The lateral stress jumps past its held value when ln J reaches −0.01, at the axial strain 0.01/(1 − 2 ν) with ν =
/// 2/7.
#[test]
fn a_stress_that_jumps_over_the_held_one_is_an_error() {
    let law = Awkward { jump: 0.3 * YOUNG, ..SMOOTH };
    let mut test = ElementTest::new(&law, &[0.0], &Sym3::ZERO).unwrap();
    let error = test.advance(&Path::TriaxialDrained.target(0.3, &Sym3::ZERO)).unwrap_err();
    let ElementTestError::Step { step: 1, reached, cause: Cause::NoStrain { axis: 'x', .. } } = error else {
        panic!("{error}");
    };
    close(reached, 0.07 / 3.0 / 0.3, 1.0, 1.0 / 1024.0);
}

#[test]
fn a_step_too_large_for_the_law_is_divided() {
    let law = Awkward { largest_increment: 0.001, ..SMOOTH };
    let states = states(&law, Path::Oedometer, 0.0, &[0.3], 1);
    close(states[1].kirchhoff_stress.0[1], -(YOUNG + 2.0 / 3.0 * YOUNG) * 0.3, YOUNG, 1e-13);
    let law = Awkward { largest_increment: 0.0001, ..SMOOTH };
    let mut test = ElementTest::new(&law, &[0.0], &Sym3::ZERO).unwrap();
    let begun = test.state().clone();
    let target = Path::Oedometer.target(0.3, &Sym3::ZERO);
    let error = test.advance(&target).unwrap_err();
    let cause = Cause::Law(MaterialError::NoResponse);
    assert_eq!(error, ElementTestError::Step { step: 1, reached: 0.0, cause });
    assert_eq!(test.state(), &begun);
}

/// A perfectly plastic law cannot carry a stress outside its yield surface; the test ends where the stress reaches that
/// surface.
#[test]
fn a_stress_that_the_law_cannot_carry_is_an_error() {
    let law = VonMises::new(YOUNG, POISSON, YIELD);
    let test = ElementTest::new(&law, &[0.0], &Sym3::ZERO).unwrap();
    let strength = 1.5f64.sqrt() * YIELD;
    let targets = [0.9, 1.25, 0.1].map(|share| Target::stress([0.0, -share * strength, 0.0]));
    let results: Vec<_> = test.follow(targets, 1).collect();
    assert_eq!(results.len(), 2, "the iterator ends at the error");
    let Err(ElementTestError::Step { step: 2, reached, cause: Cause::NoStrain { axis: 'y', .. } }) =
        results[1]
    else {
        panic!("{results:?}");
    };
    // On the way from 0.9 to 1.25 of the strength, the Kirchhoff stress reaches the strength at about 0.3 of the step.
    assert!((0.2..0.35).contains(&reached), "{reached}");
}

#[test]
fn a_test_begins_where_its_law_can() {
    let law = VonMises::new(YOUNG, POISSON, YIELD);
    let outside = Sym3([0.0, -100e3, 0.0, 0.0, 0.0, 0.0]);
    let test = ElementTest::new(&law, &[0.0], &outside).unwrap();
    assert!(test.was_returned());
    close(test.state().deviatoric_stress(), 1.5f64.sqrt() * YIELD, YIELD, 1e-12);
    assert!(!ElementTest::new(&law, &[0.0], &(outside * 0.1)).unwrap().was_returned());
    assert!(!ElementTest::new(&law, &[0.0], &Sym3::ZERO).unwrap().was_returned());

    // A test of a law without an inverse can begin only without stress, and only if the stress is zero at zero strain.
    assert!(ElementTest::new(&SMOOTH, &[0.0], &Sym3::ZERO).is_ok());
    let no_inverse = ElementTestError::Initial(MaterialError::NoInverse);
    assert_eq!(ElementTest::new(&SMOOTH, &[0.0], &outside).unwrap_err(), no_inverse);
    let stressed = Awkward { stress_at_zero: -1.0, ..SMOOTH };
    assert_eq!(ElementTest::new(&stressed, &[0.0], &Sym3::ZERO).unwrap_err(), no_inverse);
}

/// Sand that loses its strength within a small strain cannot release its elastic strain along the path of drained
/// compression.
#[test]
fn a_point_that_snaps_back_has_jumped() {
    let friction = |friction_angle: f64| Friction { cohesion: 0.0, friction_angle, dilation_angle: 10.0 };
    let loaded = |strain: f64, steps: usize| {
        let law =
            MohrCoulomb::new(1e8, 0.3, friction(40.0)).softening(friction(20.0), Softening::over(strain));
        states(&law, Path::TriaxialDrained, 100e3, &[0.02], steps)
    };
    for steps in [80, 800] {
        let found = loaded(0.003, steps);
        let jumps: Vec<usize> = (0..found.len()).filter(|step| found[*step].has_jumped).collect();
        let [jump] = jumps[..] else { panic!("{steps} steps: {jumps:?}") };
        let [before, after] = [jump - 1, jump].map(|step| found[step].deviatoric_stress());
        assert!(after < 0.5 * before, "{steps} steps: from {before} to {after} in step {jump}");
        assert!(loaded(0.1, steps).iter().all(|state| !state.has_jumped), "a slow loss of strength");
    }
}
