//! Points whose laws are evaluated in batches.
//!
//! Such a law is not called point by point. The points are evaluated twice, with stand-ins for the law: the first
//! stand-ins record the trial strain of each point; then the law is evaluated once for all points, and the second
//! stand-ins return its responses. The strains therefore come from the same kinematics as for any other law.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::material::{
    BatchError, Material, MaterialError, Response, StateField, StrainMeasure, respond_to_batch,
};
use crate::model::Model;
use crate::points::Points;
use crate::stress::PointError;
use crate::tensor::{Sym3, Tangent};
use crate::terms::failure::{EvaluateError, LawFailure, PointFailure};

/// The points of a law that is evaluated in batches, in their current order.
pub(super) struct Batch {
    /// Number of the material.
    material: usize,
    points: Vec<usize>,
    trial: Vec<Sym3>,
    /// History variables at the start and at the end of the step, point after point.
    old: Vec<f64>,
    new: Vec<f64>,
    responses: Vec<Response>,
}

/// The batches of a model in a step; none if no material has such a law.
pub(super) fn batches<const D: usize>(model: &Model<D>, points: &Points<D>) -> Vec<Batch> {
    let has_batch = |number: &usize| model.materials[*number].law.batch().is_some();
    let batch = |material: usize| {
        let is_of = |p: &usize| model.bodies[points.body[*p] as usize].material == material;
        let chosen: Vec<usize> = (0..points.len()).filter(is_of).collect();
        let kept = model.materials[material].law.state_fields().len();
        let history = |p: &usize| &points.converged.history[p * points.history_len..][..kept];
        let old = chosen.iter().flat_map(history).copied().collect();
        let (trial, new, responses) = Default::default();
        Batch { material, points: chosen, trial, old, new, responses }
    };
    let batches = (0..model.materials.len()).filter(has_batch).map(batch);
    batches.filter(|batch| !batch.points.is_empty()).collect()
}

/// A law that records the strain for which a point calls it.
#[derive(Debug)]
pub(super) struct Noting<'a> {
    law: &'a dyn Material,
    /// The bits of the trial strain; only one thread at a time evaluates a point.
    trial: [AtomicU64; 6],
}

/// A law that returns a known response to a point.
#[derive(Debug)]
pub(super) struct Answering<'a> {
    law: &'a dyn Material,
    response: &'a Response,
    new: &'a [f64],
}

/// A law whose answer does not matter.
#[derive(Debug)]
struct Mute;

impl Batch {
    /// Stand-ins that record the strain of each point.
    pub(super) fn noting<'a, const D: usize>(&self, model: &'a Model<D>) -> Vec<Noting<'a>> {
        let law = model.materials[self.material].law.as_ref();
        let unknown = || std::array::from_fn(|_| AtomicU64::new(f64::NAN.to_bits()));
        self.points.iter().map(|_| Noting { law, trial: unknown() }).collect()
    }

    /// Evaluates the law at the strains that these stand-ins have recorded.
    ///
    /// # Errors
    /// [`EvaluateError`] if the law rejects a strain or cannot be evaluated.
    pub(super) fn evaluate<const D: usize>(
        &mut self,
        model: &Model<D>,
        noted: &[Noting],
    ) -> Result<(), EvaluateError> {
        let Batch { material, points, trial, old, new, responses } = self;
        let Some(law) = model.materials[*material].law.batch() else { return Ok(()) };
        trial.clear();
        trial.extend(noted.iter().map(Noting::strain));
        respond_to_batch(law, trial, old, new, responses).map_err(|error| match error {
            BatchError::Refused { point, error } if point < points.len() => {
                PointFailure { point: points[point], error: PointError::Material(error) }.into()
            }
            BatchError::Failed { point, message } => {
                let point = point.and_then(|point| points.get(point).copied());
                EvaluateError::Law(Box::new(LawFailure { material: *material, point, message }))
            }
            refused => {
                let message = refused.to_string();
                EvaluateError::Law(Box::new(LawFailure { material: *material, point: None, message }))
            }
        })
    }

    /// Stored elastic energy and plastic work of the points in their trial state, [energy].
    pub(super) fn energies<const D: usize>(&self, model: &Model<D>, points: &Points<D>) -> [f64; 2] {
        let Some(law) = model.materials[self.material].law.batch() else { return [0.0; 2] };
        let kept = model.materials[self.material].law.state_fields().len();
        let strain: Vec<Sym3> = self.points.iter().map(|&p| points.trial.elastic_strain[p]).collect();
        let volume: Vec<f64> = self.points.iter().map(|&p| points.original_volume[p]).collect();
        let history = |p: &usize| &points.trial.history[p * points.history_len..][..kept];
        let history: Vec<f64> = self.points.iter().flat_map(history).copied().collect();
        law.energies(&strain, &history, &volume)
    }

    /// Stand-ins that return to each point its response.
    pub(super) fn answering<'a, const D: usize>(&'a self, model: &'a Model<D>) -> Vec<Answering<'a>> {
        let law = model.materials[self.material].law.as_ref();
        let kept = law.state_fields().len();
        let answer = |(k, response)| Answering { law, response, new: &self.new[k * kept..][..kept] };
        self.responses.iter().enumerate().map(answer).collect()
    }
}

/// The laws of all points: stand-ins for laws evaluated in batches; for the other points, laws whose answers do not
/// matter.
pub(super) fn laws_that_note<'a>(
    batches: &[Batch],
    stand_ins: &'a [Vec<Noting>],
    n_points: usize,
) -> Vec<&'a dyn Material> {
    let mut laws: Vec<&dyn Material> = vec![&Mute; n_points];
    replace(&mut laws, batches, stand_ins);
    laws
}

/// The laws of all points: stand-ins for laws evaluated in batches, and for the other points, their laws in
/// the current step.
pub(super) fn laws_that_answer<'a, const D: usize>(
    model: &'a Model<D>,
    points: &Points<D>,
    step_laws: &'a [Option<Box<dyn Material>>],
    batches: &[Batch],
    stand_ins: &'a [Vec<Answering>],
) -> Vec<&'a dyn Material> {
    let law = |p: usize| match step_laws.get(model.bodies[points.body[p] as usize].material) {
        Some(Some(law)) => law.as_ref(),
        _ => model.law(points, p),
    };
    let mut laws: Vec<&dyn Material> = (0..points.len()).map(law).collect();
    replace(&mut laws, batches, stand_ins);
    laws
}

fn replace<'a, L: Material>(laws: &mut [&'a dyn Material], batches: &[Batch], stand_ins: &'a [Vec<L>]) {
    for (batch, stand_ins) in batches.iter().zip(stand_ins) {
        for (&p, stand_in) in batch.points.iter().zip(stand_ins) {
            laws[p] = stand_in;
        }
    }
}

impl Noting<'_> {
    fn strain(&self) -> Sym3 {
        Sym3(self.trial.each_ref().map(|bits| f64::from_bits(bits.load(Ordering::Relaxed))))
    }
}

/// A response without stress.
fn no_stress(trial: &Sym3) -> Response {
    Response { tau: Sym3::ZERO, elastic_strain: *trial, tangent: Tangent::zeros() }
}

impl Material for Noting<'_> {
    fn state_fields(&self) -> &[StateField] {
        self.law.state_fields()
    }

    fn strain_measure(&self) -> StrainMeasure {
        self.law.strain_measure()
    }

    fn update(&self, trial: &Sym3, _: &[f64], _: &mut [f64]) -> Result<Response, MaterialError> {
        for (bits, x) in self.trial.iter().zip(&trial.0) {
            bits.store(x.to_bits(), Ordering::Relaxed);
        }
        Ok(no_stress(trial))
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        self.law.energy(elastic_strain, history)
    }
}

impl Material for Answering<'_> {
    fn state_fields(&self) -> &[StateField] {
        self.law.state_fields()
    }

    fn strain_measure(&self) -> StrainMeasure {
        self.law.strain_measure()
    }

    fn update(&self, _: &Sym3, _: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        new.copy_from_slice(self.new);
        Ok(*self.response)
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        self.law.energy(elastic_strain, history)
    }
}

impl Material for Mute {
    fn state_fields(&self) -> &[StateField] {
        &[]
    }

    /// The measure that takes the least work to compute.
    fn strain_measure(&self) -> StrainMeasure {
        StrainMeasure::LeftCauchyGreen
    }

    fn update(&self, trial: &Sym3, _: &[f64], _: &mut [f64]) -> Result<Response, MaterialError> {
        Ok(no_stress(trial))
    }

    fn energy(&self, _: &Sym3, _: &[f64]) -> f64 {
        0.0
    }
}
