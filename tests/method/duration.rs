//! Laws whose response depends on the duration of a step.

use std::sync::Arc;

use mpm::basis::Method;
use mpm::grid::Structured;
use mpm::material::{Elasticity, Material, MaterialError, Response, StateField, Varying, VaryingProperty};
use mpm::model::{Builder, Fill};
use mpm::solver::{Silent, Stepper};
use mpm::step::Step;
use mpm::tensor::Sym3;

/// Elasticity whose shear stress relaxes: in a step of duration Δt, the deviator of the elastic strain falls to
/// 1/(1 + Δt/T) of its trial value, the implicit Euler rule.
#[derive(Debug, Clone, Copy)]
struct Relaxing {
    elasticity: Elasticity,
    /// T.
    time: f64,
    /// Δt of the current step; 0 outside a step.
    duration: f64,
}

impl Material for Relaxing {
    fn state_fields(&self) -> &[StateField] {
        &[]
    }

    fn update(&self, trial: &Sym3, _: &[f64], _: &mut [f64]) -> Result<Response, MaterialError> {
        let left = 1.0 / (1.0 + self.duration / self.time);
        let elastic_strain = Sym3::IDENTITY * (trial.trace() / 3.0) + trial.deviator() * left;
        let tau = self.elasticity.stress(&elastic_strain);
        let tangent = Elasticity { shear: left * self.elasticity.shear, ..self.elasticity }.tangent();
        if tau.norm().is_finite() {
            Ok(Response { tau, elastic_strain, tangent })
        } else {
            Err(MaterialError::NotFinite)
        }
    }

    fn energy(&self, strain: &Sym3, _: &[f64]) -> f64 {
        self.elasticity.energy(strain)
    }

    fn for_duration(&self, duration: f64) -> Option<Box<dyn Material>> {
        Some(Box::new(Relaxing { duration, ..*self }))
    }
}

#[test]
fn a_step_knows_its_duration() {
    assert_eq!(Step { index: 3, start: 0.25, end: 1.0 }.duration(), 0.75);
}

/// The elastic strain of each point of a strained block of this law whose nodes are held, after four steps of duration T.
fn relaxed_strains(law: impl Material + 'static, strain: Sym3) -> Vec<Sym3> {
    let fill = Fill { method: Method::Mpm, points_per_cell: 2, density: 1.0, ..Fill::default() };
    let (mut model, mut points) = Builder::new(Structured::new([0.0; 2], [1.0; 2], [2; 2]))
        .material("resin", law)
        .body("block", "resin", fill, |_| true)
        .fix("all", [true; 2], |_| true)
        .steps(4)
        .build()
        .unwrap();
    model.stepping.end_time = 2.0;
    points.converged.elastic_strain.fill(strain);
    let summary = Stepper::new(&model, &mut points).run(&mut Silent).unwrap().summary;
    assert_eq!(summary.steps, 4);
    points.converged.elastic_strain.clone()
}

/// In each of four steps of duration T, half of the deviator relaxes; also if properties of the law vary in space.
#[test]
fn a_law_receives_the_duration_of_the_step() {
    let elasticity = Elasticity::from_young_poisson(1e6, 0.25);
    let strain = Sym3([3e-3, 1e-3, 0.0, 0.0, 0.0, 2e-3]);
    let expected = Sym3::IDENTITY * (strain.trace() / 3.0) + strain.deviator() * 0.0625;
    let uniform = Relaxing { elasticity, time: 0.5, duration: 0.0 };
    let time = VaryingProperty { name: "time".into(), unit: "time".into(), typical: 0.5 };
    let relaxing = move |properties: &[f64]| Relaxing { time: properties[0], ..uniform };
    let varying = Varying::new(&[time], Arc::new(|_: &[f64; 3]| vec![0.5]), relaxing);
    for found in relaxed_strains(uniform, strain).into_iter().chain(relaxed_strains(varying, strain)) {
        assert!((found - expected).norm() < 1e-15, "{found:?}");
    }
}
