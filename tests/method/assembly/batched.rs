//! A law that is evaluated in batches returns the same results as a law that is evaluated point by point.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use mpm::assembly::Wanted;
use mpm::basis::Method;
use mpm::material::{
    BatchError, BatchLaw, Hencky, Material, MaterialError, Response, StateField, StrainMeasure, VonMises,
    conformance::check, respond_alone,
};
use mpm::step::{At, StepContext};
use mpm::stress::{Axisymmetric, CellStrain, Mechanics, PlaneStrain, PointError, Solid};
use mpm::tensor::Sym3;
use mpm::terms::{EvaluateError, Sum};

use super::states::{FORMULATIONS, Law, State, random_state, with_laws};

/// A law of the library that accepts batches and evaluates them point by point.
#[derive(Debug)]
pub struct InBatches {
    law: Box<dyn Material>,
    /// Number of batches so far.
    pub calls: Arc<AtomicUsize>,
    /// Index of the first call that fails, and the error.
    failure: Option<(usize, BatchError)>,
}

impl InBatches {
    pub fn new(law: Box<dyn Material>) -> Self {
        InBatches { law, calls: Arc::default(), failure: None }
    }

    pub fn failing(self, call: usize, error: BatchError) -> Self {
        InBatches { failure: Some((call, error)), ..self }
    }
}

impl BatchLaw for InBatches {
    fn respond(
        &self,
        trial: &[Sym3],
        old: &[f64],
        new: &mut [f64],
        responses: &mut [Response],
    ) -> Result<(), BatchError> {
        // A single point belongs to an evaluation of the moduli at rest, not to a batch.
        let call = if trial.len() > 1 { self.calls.fetch_add(1, Ordering::Relaxed) } else { 0 };
        if let Some((_, error)) = self.failure.as_ref().filter(|(first, _)| call >= *first && call > 0) {
            return Err(error.clone());
        }
        let n = self.law.state_fields().len();
        for (point, strain) in trial.iter().enumerate() {
            let history = point * n..(point + 1) * n;
            responses[point] = (self.law)
                .update(strain, &old[history.clone()], &mut new[history])
                .map_err(|error| BatchError::Refused { point, error })?;
        }
        Ok(())
    }

    fn energies(&self, elastic_strain: &[Sym3], history: &[f64], volume: &[f64]) -> [f64; 2] {
        let n = self.law.state_fields().len();
        let mut sums = [0.0; 2];
        for (p, (strain, volume)) in elastic_strain.iter().zip(volume).enumerate() {
            sums[0] += self.law.energy(strain, &history[p * n..(p + 1) * n]) * volume;
            sums[1] += self.law.plastic_work(&history[p * n..(p + 1) * n]) * volume;
        }
        sums
    }
}

impl Material for InBatches {
    fn state_fields(&self) -> &[StateField] {
        self.law.state_fields()
    }

    fn strain_measure(&self) -> StrainMeasure {
        self.law.strain_measure()
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        respond_alone(self, trial, old, new)
    }

    fn elastic_strain(&self, tau: &Sym3, history: &[f64]) -> Result<Sym3, MaterialError> {
        self.law.elastic_strain(tau, history)
    }

    fn batch(&self) -> Option<&dyn BatchLaw> {
        Some(self)
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        self.law.energy(elastic_strain, history)
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        self.law.plastic_work(history)
    }

    fn tangent_is_symmetric(&self) -> bool {
        self.law.tangent_is_symmetric()
    }
}

/// Makes laws accept batches; returns their call counts.
fn batch<const D: usize>(state: &mut State<D>, numbers: &[usize]) -> Vec<Arc<AtomicUsize>> {
    let mut calls = Vec::new();
    for &number in numbers {
        let law = &mut state.model.materials[number].law;
        let batched = InBatches::new(std::mem::replace(law, Box::new(Hencky::new(1.0, 0.0))));
        calls.push(batched.calls.clone());
        *law = Box::new(batched);
    }
    calls
}

/// Internal force, a product with the stiffness, and the trial state of all points.
fn evaluated<const D: usize, M: Mechanics<D>>(state: &mut State<D>, wanted: Wanted) -> [Vec<f64>; 5] {
    let State { model, points, links, delta_d } = state;
    let context = StepContext::first(model, links);
    let mut sum = Sum::from_model::<M>(&context, points).unwrap();
    sum.evaluate(&context, points, At::new(delta_d), wanted).unwrap();
    let mut product = delta_d.clone();
    if wanted == Wanted::Stiffness {
        sum.system_mut().multiply(delta_d, &mut product);
    }
    let of = |tensors: &[Sym3]| tensors.iter().flat_map(|t| t.0).collect::<Vec<f64>>();
    let force = sum.system().internal_force().as_flattened().to_vec();
    let trial = &points.trial;
    [
        force,
        product.into_flattened(),
        of(&trial.kirchhoff_stress),
        of(&trial.elastic_strain),
        trial.history.clone(),
    ]
}

/// Largest difference relative to the largest value.
fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let largest = a.iter().fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
    a.iter().zip(b).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / largest
}

fn check_states<const D: usize, M: Mechanics<D>>() -> f64 {
    let mut worst = 0.0f64;
    for (method, law) in with_laws(&[Method::Mpm, Method::Gimp, Method::Cpdi2]) {
        let mut treatments = vec![CellStrain::Standard, CellStrain::MeanDilatation];
        treatments.extend(method.has_centres().then_some(CellStrain::FBar));
        for volumetric in treatments {
            for formulation in FORMULATIONS {
                for wanted in [Wanted::Force, Wanted::Stiffness] {
                    // One case has batches only for the second of two bodies.
                    let choices: &[&[usize]] = if law == Law::Both { &[&[0, 1], &[1]] } else { &[&[0]] };
                    for numbers in choices {
                        let mut state = random_state::<D, M>(method, law, 60, 7);
                        state.model.formulation = formulation;
                        state.model.bodies.iter_mut().for_each(|body| body.strain = volumetric);
                        let alone = evaluated::<D, M>(&mut state, wanted);
                        let calls = batch(&mut state, numbers);
                        let batched = evaluated::<D, M>(&mut state, wanted);
                        for (a, b) in alone.iter().zip(&batched) {
                            let error = difference(a, b);
                            worst = worst.max(error);
                            assert!(
                                error <= 1e-13,
                                "{method:?} {law:?} {volumetric:?} {formulation:?}: {error:e}"
                            );
                        }
                        assert!(calls.iter().all(|calls| calls.load(Ordering::Relaxed) == 1));
                    }
                }
            }
        }
    }
    worst
}

#[test]
fn laws_in_batches_give_the_same_and_are_called_once() {
    let worst =
        [check_states::<2, PlaneStrain>(), check_states::<2, Axisymmetric>(), check_states::<3, Solid>()];
    println!("largest relative differences {worst:?}");
}

#[test]
fn batches_have_the_same_bits_with_any_number_of_threads() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut state = random_state::<2, PlaneStrain>(Method::Gimp, Law::Both, 300, 3);
            batch(&mut state, &[0, 1]);
            evaluated::<2, PlaneStrain>(&mut state, Wanted::Stiffness)
        })
    };
    assert!(with(1) == with(2) && with(1) == with(5));
}

#[test]
fn a_refused_strain_names_the_point_and_a_failure_the_law() {
    let outcome = |error: BatchError| {
        let mut state = random_state::<2, PlaneStrain>(Method::Mpm, Law::Hencky, 60, 7);
        let law = InBatches::new(Box::new(Hencky::new(2e6, 0.25)));
        law.calls.store(1, Ordering::Relaxed);
        state.model.materials[0].law = Box::new(law.failing(1, error));
        let State { model, points, links, delta_d } = &mut state;
        let context = StepContext::first(model, links);
        let mut sum = Sum::from_model::<PlaneStrain>(&context, points).unwrap();
        sum.evaluate(&context, points, At::new(delta_d), Wanted::Force).unwrap_err()
    };
    let refused = outcome(BatchError::Refused { point: 7, error: MaterialError::NoResponse });
    let EvaluateError::Point(failure) = refused else { panic!("{refused:?}") };
    assert_eq!((failure.point, failure.error), (7, PointError::Material(MaterialError::NoResponse)));
    for point in [Some(3), None] {
        let failed = outcome(BatchError::Failed { point, message: "no such array".to_owned() });
        let EvaluateError::Law(failure) = failed else { panic!("{failed:?}") };
        assert_eq!((failure.point, failure.message.as_str()), (point, "no such array"));
    }
    // An index outside the batch is a failure of the law.
    let outside = outcome(BatchError::Refused { point: 60, error: MaterialError::NoResponse });
    assert!(matches!(outside, EvaluateError::Law(_)));
}

#[test]
fn laws_in_batches_conform() {
    for law in
        [Box::new(Hencky::new(2e6, 0.25)) as Box<dyn Material>, Box::new(VonMises::new(1e6, 0.3, 20e3))]
    {
        assert_eq!(check(&InBatches::new(law), 0.3), []);
    }
}
