//! An independent, slow and simple implementation of the point kernel and of the sums over points: full matrices,
//! spectral functions via nalgebra's eigenvectors, plastic flow by bisection, and stiffness by finite differences of
//! the internal force. It is compared with the program on random states of every method, idealisation and formulation,
//! and of every law but [`Law::Skewed`].

use mpm::assembly::Wanted;
use mpm::basis::Method;
use mpm::step::{At, StepContext};
use mpm::stress::{Axisymmetric, Formulation, Mechanics, PlaneStrain, Solid};
use mpm::tensor::Mat3;
use mpm::terms::Sum;
use nalgebra::{DVector, SymmetricEigen};
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::TestCaseError;

use super::oracle::motions_of_point;
use super::states::{Domain, FORMULATIONS, Law, Random, State, state_with};

/// λ and μ from Young's modulus and Poisson's ratio.
fn lame(young: f64, poisson: f64) -> (f64, f64) {
    (young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)), young / (2.0 * (1.0 + poisson)))
}

/// Isotropic function of a symmetric matrix.
fn isotropic(matrix: &Mat3, function: impl Fn(f64) -> f64) -> Mat3 {
    let SymmetricEigen { eigenvectors, eigenvalues } = SymmetricEigen::new(*matrix);
    eigenvectors * Mat3::from_diagonal(&eigenvalues.map(function)) * eigenvectors.transpose()
}

/// Response of a point.
struct Outcome {
    /// Kirchhoff stress.
    tau: Mat3,
    /// Elastic left Cauchy-Green tensor.
    b: Mat3,
    /// Equivalent plastic strain.
    kappa: f64,
}

/// Response under one of the laws of [`state_with`], with its parameters.
fn respond(law: Law, body: u16, b_trial: Mat3, kappa: f64) -> Outcome {
    let identity = Mat3::identity();
    match (law, body) {
        (Law::Hencky, _) | (Law::Both, 0) => {
            let (lambda, mu) = lame(2e6, 0.25);
            let strain = isotropic(&b_trial, f64::ln) * 0.5;
            let tau = identity * (lambda * strain.trace()) + strain * (2.0 * mu);
            Outcome { tau, b: b_trial, kappa }
        }
        (Law::NeoHookean, _) => {
            let (lambda, mu) = lame(2e6, 0.25);
            let log_j = b_trial.determinant().sqrt().ln();
            Outcome { tau: (b_trial - identity) * mu + identity * (lambda * log_j), b: b_trial, kappa }
        }
        (Law::VonMises, _) | (Law::Both, _) => {
            let ((lambda, mu), yield_radius, hardening) = (lame(1e6, 0.3), 0.25e6, 0.2e6);
            let strain = isotropic(&b_trial, f64::ln) * 0.5;
            let volumetric = identity * (strain.trace() / 3.0);
            let deviator = strain - volumetric;
            let direction = if deviator.norm() > 0.0 { deviator / deviator.norm() } else { deviator };
            let kappa_of = |flow: f64| kappa + (2.0_f64 / 3.0).sqrt() * flow;
            let excess =
                |flow: f64| 2.0 * mu * (deviator.norm() - flow) - (yield_radius + hardening * kappa_of(flow));
            let (mut low, mut high) = (0.0, deviator.norm());
            if excess(0.0) <= 0.0 {
                high = 0.0;
            }
            for _ in 0..200 {
                let middle = 0.5 * (low + high);
                if excess(middle) > 0.0 { low = middle } else { high = middle }
            }
            let flow = 0.5 * (low + high);
            let elastic = strain - direction * flow;
            let tau = identity * (lambda * elastic.trace()) + elastic * (2.0 * mu);
            Outcome { tau, b: isotropic(&elastic, |e| (2.0 * e).exp()), kappa: kappa_of(flow) }
        }
        (Law::Skewed, _) => unreachable!("it has no stress of its own to be found a second time"),
    }
}

/// State of every point and internal force at all nodes of the grid after an increment.
fn evaluate<const D: usize, M: Mechanics<D>>(
    state: &State<D>,
    law: Law,
    delta_d: &[[f64; D]],
) -> (Vec<Outcome>, DVector<f64>) {
    let State { model, points, links, .. } = state;
    let mut force = DVector::zeros(D * model.grid.n_nodes());
    let mut outcomes = Vec::new();
    for p in 0..points.len() {
        let motions = motions_of_point::<D, M>(state, p);
        let mut increment = Mat3::identity(); // (7)
        for (degree, motion) in &motions {
            increment +=
                motion * links.seen_by(points.body[p], degree / D).map_or(0.0, |a| delta_d[a][degree % D]);
        }
        let strain = points.converged.elastic_strain[p].to_matrix();
        let b_n = match law {
            Law::NeoHookean => Mat3::identity() + strain * 2.0,
            _ => isotropic(&strain, |e| (2.0 * e).exp()),
        };
        let kappa = points.converged.history.get(p * points.history_len).copied().unwrap_or(0.0);
        let outcome = respond(law, points.body[p], increment * b_n * increment.transpose(), kappa); // (17)
        let inverse = increment.try_inverse().unwrap();
        for (degree, motion) in motions {
            // Power of the stress in the motion of one degree of freedom, per original volume: τ : l with l of eq. (8).
            force[degree] +=
                points.original_volume[p] * (outcome.tau * (motion * inverse).transpose()).trace();
        }
        outcomes.push(outcome);
    }
    (outcomes, force)
}

fn spread<const D: usize>(state: &State<D>, values: &[[f64; D]]) -> DVector<f64> {
    let mut all = DVector::zeros(D * state.model.grid.n_nodes());
    for (active, value) in values.iter().enumerate() {
        for d in 0..D {
            all[D * state.links.active_nodes()[active] as usize + d] = value[d];
        }
    }
    all
}

/// Compares point states, internal force, and the change of the force along a random direction. `None` if a point
/// starts or stops flowing in between, because the derivative does not exist there.
fn check<const D: usize, M: Mechanics<D>>(
    state: &mut State<D>,
    law: Law,
    seed: u64,
) -> Result<(), TestCaseError> {
    let base = state.delta_d.clone();
    let random = &mut Random(seed);
    let direction: Vec<[f64; D]> = base.iter().map(|_| [0; D].map(|_| random.within(-1.0, 1.0))).collect();
    let mut sum =
        Sum::from_model::<M>(&StepContext::first(&state.model, &state.links), &state.points).unwrap();
    if sum
        .evaluate(
            &StepContext::first(&state.model, &state.links),
            &mut state.points,
            At::new(&base),
            Wanted::Stiffness,
        )
        .is_err()
    {
        return Err(TestCaseError::reject("the increment turns a point inside out"));
    }
    // The program drops nodes that points touch only weakly and passes their share on to other nodes; the sums here do
    // not.
    let is_dropped = |degree: usize| !state.links.is_active(degree / D);
    let motions = (0..state.points.len()).flat_map(|p| motions_of_point::<D, M>(state, p));
    if motions.into_iter().any(|(degree, motion)| motion.norm() > 0.0 && is_dropped(degree)) {
        return Err(TestCaseError::reject("a node is left out"));
    }
    let (outcomes, force) = evaluate::<D, M>(state, law, &base);
    let ours = spread(state, sum.system().internal_force());
    let error = (&ours - &force).amax() / force.amax();
    prop_assert!(error < 1e-11, "internal force: {error:e}");

    let trial = &state.points.trial;
    let stress = outcomes.iter().map(|o| o.tau.amax()).fold(f64::MIN_POSITIVE, f64::max);
    for (p, outcome) in outcomes.iter().enumerate() {
        let body = state.points.body[p];
        let off = (trial.kirchhoff_stress[p].to_matrix() - outcome.tau).amax() / stress;
        prop_assert!(off < 1e-12, "stress of point {p} of body {body}: {off:e}");
        let measure = state.model.law(&state.points, p).strain_measure();
        let b = measure.left_cauchy_green(&trial.elastic_strain[p]).to_matrix();
        prop_assert!((b - outcome.b).amax() < 1e-12 * outcome.b.amax());
        if let Some(kappa) = trial.history.get(p * state.points.history_len) {
            prop_assert!((kappa - outcome.kappa).abs() < 1e-13);
        }
    }

    let mut change = direction.clone();
    sum.system_mut().multiply(&direction, &mut change);
    let flows = |outcomes: &[Outcome]| -> Vec<bool> {
        (outcomes.iter().enumerate())
            .map(|(p, o)| {
                state
                    .points
                    .converged
                    .history
                    .get(p * state.points.history_len)
                    .is_some_and(|k| o.kappa > k + 1e-15)
            })
            .collect()
    };
    let at = |by: f64| {
        let moved: Vec<[f64; D]> =
            (base.iter().zip(&direction)).map(|(u, x)| std::array::from_fn(|d| u[d] + by * x[d])).collect();
        evaluate::<D, M>(state, law, &moved)
    };
    // Richardson extrapolation of central differences; the error is of fourth order. The error of a wrong stiffness would
    // not fall with the step, that of differences in a state far from linear does.
    let error_with = |step: f64| {
        let [(a, fa), (b, fb), (c, fc), (d, fd)] = [step, -step, 2.0 * step, -2.0 * step].map(at);
        // Otherwise, the force has a kink within the differences.
        let is_smooth = [a, b, c, d].iter().all(|o| flows(o) == flows(&outcomes));
        let numeric = ((fa - fb) * 8.0 - (fc - fd)) / (12.0 * step);
        is_smooth.then(|| (spread(state, &change) - &numeric).amax() / numeric.amax())
    };
    if let Some(error) = error_with(1e-4).filter(|error| *error >= 1e-8).and_then(|_| error_with(2e-5)) {
        prop_assert!(error < 1e-8, "stiffness: {error:e}");
    }
    Ok(())
}

/// Random combinations of the properties of a state.
fn kinds() -> impl Strategy<Value = (Method, Domain, Law, Formulation, u64, usize)> {
    let methods = vec![
        (Method::Mpm, Domain::Box),
        (Method::Gimp, Domain::Box),
        (Method::Cpdi1, Domain::Box),
        (Method::Cpdi2, Domain::Box),
        (Method::Cpdi1, Domain::Simplex),
        (Method::Cpdi2, Domain::Simplex),
    ];
    let laws = vec![Law::Hencky, Law::NeoHookean, Law::VonMises, Law::Both];
    (select(methods), select(laws), select(FORMULATIONS.to_vec()), any::<u64>(), 2..40_usize).prop_map(
        |((method, domain), law, formulation, seed, n_points)| {
            (method, domain, law, formulation, seed, n_points)
        },
    )
}

fn check_kind<const D: usize, M: Mechanics<D>>(
    (method, domain, law, formulation, seed, n_points): (Method, Domain, Law, Formulation, u64, usize),
) -> Result<(), TestCaseError> {
    let mut state = state_with::<D, M>(method, domain, law, n_points, seed);
    state.model.formulation = formulation;
    check::<D, M>(&mut state, law, seed)
}

fn config() -> ProptestConfig {
    ProptestConfig { cases: 96, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn plane_strain_is_that_of_the_slow_kernel(kind in kinds()) {
        check_kind::<2, PlaneStrain>(kind)?;
    }

    #[test]
    fn bodies_of_revolution_are_those_of_the_slow_kernel(kind in kinds()) {
        check_kind::<2, Axisymmetric>(kind)?;
    }

    #[test]
    fn solids_are_those_of_the_slow_kernel(kind in kinds()) {
        check_kind::<3, Solid>(kind)?;
    }
}
