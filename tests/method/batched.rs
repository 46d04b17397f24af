//! Runs with a law that is evaluated in batches.
#![allow(clippy::unwrap_used)]

use std::sync::atomic::Ordering;

use mpm::deck::build::build;
use mpm::deck::load::load_text;
use mpm::material::{BatchError, Hencky, MaterialError};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{Silent, SolveError, Stepper};
use mpm::tensor::Sym3;

use crate::assembly::batched::InBatches;

const ELASTIC: &str = "{model: hencky, young: 12e6, poisson: 0.2, density: 0}";
const PLASTIC: &str = "{model: von-mises, young: 12e6, poisson: 0.2, deviatoric_yield_stress: 2e5, hardening_modulus: 4e6, density: 0}";

/// The beam of `inputs/beam.yaml` under a part of its load.
fn beam(material: &str, volumetric: &str) -> (Model<2>, Points<2>) {
    let text = std::fs::read_to_string("inputs/beam.yaml").unwrap();
    let text = text
        .replace(ELASTIC, material)
        .replace("method: \"${method}\",", &format!("method: \"${{method}}\", strain: {volumetric},"))
        .replace("-100e3", "-10e3");
    assert!(text.contains(material) && text.contains(volumetric) && text.contains("-10e3"));
    let sets = [("steps", "5"), ("n", "4")].map(|(key, value)| (key.to_owned(), value.to_owned()));
    build(&load_text("beam.yaml", text.as_bytes(), &sets).unwrap()).unwrap()
}

/// Makes the law of a model accept batches.
fn batch(model: &mut Model<2>, with: impl FnOnce(InBatches) -> InBatches) -> Box<dyn Fn() -> usize> {
    let law = std::mem::replace(&mut model.materials[0].law, Box::new(Hencky::new(1.0, 0.0)));
    let batched = with(InBatches::new(law));
    let calls = batched.calls.clone();
    model.materials[0].law = Box::new(batched);
    Box::new(move || calls.load(Ordering::Relaxed))
}

/// Positions, stresses and histories.
fn results(points: &Points<2>) -> [Vec<f64>; 3] {
    let of = |tensors: &[Sym3]| tensors.iter().flat_map(|t| t.0).collect::<Vec<f64>>();
    let state = &points.converged;
    [state.position.as_flattened().to_vec(), of(&state.kirchhoff_stress), state.history.clone()]
}

#[test]
fn a_run_with_a_law_in_batches_is_the_same() {
    for (material, volumetric) in
        [(ELASTIC, "standard"), (PLASTIC, "standard"), (PLASTIC, "mean-dilatation"), (PLASTIC, "f-bar")]
    {
        let (model, mut alone) = beam(material, volumetric);
        let expected = Stepper::new(&model, &mut alone).run(&mut Silent).unwrap().summary;
        let (mut model, mut batched) = beam(material, volumetric);
        let calls = batch(&mut model, |law| law);
        let summary = Stepper::new(&model, &mut batched).run(&mut Silent).unwrap().summary;
        assert_eq!((summary.evaluations, calls()), (expected.evaluations, expected.evaluations));
        assert!(material == ELASTIC || alone.converged.history.iter().any(|kappa| *kappa > 1e-3));
        for (a, b) in results(&alone).iter().zip(&results(&batched)) {
            let largest = a.iter().fold(f64::MIN_POSITIVE, |most, x| most.max(x.abs()));
            let off = a.iter().zip(b).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) / largest;
            println!("{volumetric}: relative difference {off:e}");
            assert!(off < 1e-10, "{volumetric}: {off:e}");
        }
    }
}

#[test]
fn a_failed_batch_ends_the_run_at_once_with_its_message() {
    for point in [Some(5), None] {
        let (mut model, mut points) = beam(ELASTIC, "standard");
        let message = "ValueError: shapes (7,) and (8,) do not match".to_owned();
        let calls = batch(&mut model, |law| law.failing(6, BatchError::Failed { point, message }));
        let error = Stepper::new(&model, &mut points).run(&mut Silent).unwrap_err();
        assert_eq!((calls(), error.code()), (7, Some("S019")));
        let text = error.to_string();
        assert!(text.starts_with("step 2: the law of material `steel` has failed"), "{text}");
        assert!(text.ends_with("ValueError: shapes (7,) and (8,) do not match"), "{text}");
        assert_eq!(text.contains("of body `beam`"), point.is_some(), "{text}");
    }
}

#[test]
fn a_step_whose_strain_a_batch_refuses_is_cut() {
    let (mut model, mut points) = beam(ELASTIC, "standard");
    let refused = BatchError::Refused { point: 5, error: MaterialError::NoResponse };
    let calls = batch(&mut model, |law| law.failing(6, refused));
    let error = Stepper::new(&model, &mut points).run(&mut Silent).unwrap_err();
    assert!(matches!(error, SolveError::Point { step: 2, .. }), "{error}");
    assert!(error.to_string().ends_with("the law has no response to the trial elastic strain"), "{error}");
    assert!(calls() > 12, "{} calls", calls());
}
