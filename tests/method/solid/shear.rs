//! Simple shear of a cube along x on inclined planes: every point has the stress of the law.

use std::f64::consts::SQRT_2;

use mpm::basis::Method;
use mpm::domain::DomainUpdate;
use mpm::grid::Structured;
use mpm::material::{Hencky, Material, VonMises};
use mpm::model::NodeSet;
use mpm::points::Points;
use mpm::tensor::{Mat3, Sym3};

use super::bodies::{Filling, cells_in, fill, homogeneous, model, watch};

const YOUNG: f64 = 10e3;
const POISSON: f64 = 0.3;
/// Shear per step.
const D_GAMMA: f64 = 0.2;
const STEPS: usize = 10;
/// Normal of the sheared planes.
const NORMAL: [f64; 3] = [0.0, 0.8, 0.6];

/// F for a given shear.
fn gradient(gamma: f64) -> Mat3 {
    let mut f = Mat3::identity();
    (0..3).for_each(|d| f[(0, d)] += gamma * NORMAL[d]);
    f
}

/// τ = 2G ½ ln b. In the plane of the direction and the normal, with sinh a = γ/2, ½ ln b = a N with N = [[γ/2, 1], [1,
/// −γ/2]] / cosh a; see the plane shear test.
fn elastic_stress(gamma: f64) -> Sym3 {
    let shear_modulus = YOUNG / (2.0 * (1.0 + POISSON));
    let tau_12 = 2.0 * shear_modulus * (gamma / 2.0).asinh() / (1.0 + gamma * gamma / 4.0).sqrt();
    let tau_11 = tau_12 * gamma / 2.0;
    let in_plane = Sym3([tau_11, -tau_11, 0.0, 0.0, 0.0, SQRT_2 * tau_12]).to_matrix();
    let [_, c, s] = NORMAL;
    let turn = Mat3::new(1.0, 0.0, 0.0, 0.0, c, -s, 0.0, s, c);
    Sym3::symmetric_part(&(turn * in_plane * turn.transpose()))
}

/// Drives the law alone with equal shear increments; returns the stress after each.
fn driven(law: &dyn Material) -> Vec<Sym3> {
    let df = gradient(D_GAMMA);
    let mut strain = Sym3::ZERO;
    let mut old: Vec<f64> = law.state_fields().iter().map(|f| f.initial).collect();
    let mut stresses = Vec::new();
    for _ in 0..STEPS {
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

/// Stress of every point after every step, for a unit cube sheared in cells of side 1/5, and the largest number of
/// unknowns.
fn shear(law: impl Material + Clone + 'static, method: Method, n: usize) -> (Vec<Vec<Sym3>>, usize) {
    let grid = Structured::<3>::new([0.0; 3], [0.2; 3], [20, 5, 5]);
    let filling = Filling { method, n: [n; 3], density: 0.0 };
    let mut seeds = fill(&grid, &cells_in(&grid, [0.0; 3], [1.0; 3]), filling, &law);
    // Only the outermost points of the outer cells prescribe the motion.
    for seed in &mut seeds {
        let depth = seed.position.iter().map(|x| x.min(1.0 - x)).fold(f64::MAX, f64::min);
        seed.outer_layer = depth < 0.2 / n as f64;
    }
    let mut points = Points::new(&seeds);
    let mut model = model(grid, law, method, DomainUpdate::Corners, STEPS);
    let condition = homogeneous(NodeSet::OuterLayer(0), &gradient(D_GAMMA), [0.0; 3], STEPS);
    model.boundary_conditions = vec![condition];
    let (mut stresses, mut free) = (Vec::new(), 0);
    let outcome = watch(&model, &mut points, |points, report| {
        stresses.push(points.converged.kirchhoff_stress.clone());
        free = free.max(report.unknowns);
    });
    outcome.unwrap_or_else(|error| panic!("{method:?} {n}: {error}"));
    (stresses, free)
}

const CASES: [(Method, usize); 5] =
    [(Method::Mpm, 2), (Method::Mpm, 3), (Method::Gimp, 2), (Method::Cpdi1, 2), (Method::Cpdi2, 2)];

fn check(law: impl Material + Clone + 'static, exact: &[Sym3]) {
    for (method, n) in CASES {
        let (stresses, free) = shear(law.clone(), method, n);
        assert!(stresses.len() == STEPS && free > 0);
        let mut error = 0.0f64;
        for (stresses, exact) in stresses.iter().zip(exact) {
            for stress in stresses {
                error = error.max((*stress - *exact).norm() / exact.norm());
            }
        }
        println!("{method:?} with {n}³ points: {free} unknowns, error {error:.1e}");
        assert!(error < 1e-11, "{method:?} {n}: {error:e}");
    }
}

#[test]
fn elastic_stress_is_the_closed_form_at_every_point_and_step() {
    let exact: Vec<Sym3> = (1..=STEPS).map(|k| elastic_stress(D_GAMMA * k as f64)).collect();
    check(Hencky::new(YOUNG, POISSON), &exact);
    let driven = driven(&Hencky::new(YOUNG, POISSON));
    assert!((driven[STEPS - 1] - exact[STEPS - 1]).norm() < 1e-13 * YOUNG);
}

#[test]
fn plastic_stress_is_that_of_the_law_at_every_point_and_step() {
    let law = VonMises::new(YOUNG, POISSON, 5e3);
    let exact = driven(&law);
    assert!((exact[STEPS - 1].deviator().norm() / 5e3 - 1.0).abs() < 1e-12, "it flows");
    check(law, &exact);
}
