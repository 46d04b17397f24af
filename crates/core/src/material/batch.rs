//! Laws that are evaluated for all their points at once, such as laws in another language, where a call costs more than
//! the arithmetic of one point.

use super::{MaterialError, Response};
use crate::tensor::{Sym3, Tangent};

/// A law that is evaluated in batches of points. The solver calls it once per evaluation of the internal force, with
/// all points of its material, on the thread of that evaluation.
pub trait BatchLaw {
    /// Batch form of [`Material::update`](super::Material::update): the return mapping of every point from its trial
    /// elastic strain, which is finite. `old` holds the converged history variables, point after point; `new` has the
    /// same layout, starts as a copy of `old`, and receives the trial history variables. The response to `trial[p]` is
    /// written to `responses[p]`; a response that is not finite or is not written means that the law refuses the
    /// strain. The response of a point depends neither on the other points nor on their order.
    ///
    /// # Errors
    /// [`BatchError`] if a point has no response, or the law cannot be evaluated.
    fn respond(
        &self,
        trial: &[Sym3],
        old: &[f64],
        new: &mut [f64],
        responses: &mut [Response],
    ) -> Result<(), BatchError>;

    /// Batch form of [`Material::energy`](super::Material::energy) and
    /// [`Material::plastic_work`](super::Material::plastic_work), summed over points with these original volumes:
    /// stored elastic energy and plastic work, [energy]. `history` is laid out as in [`BatchLaw::respond`]. The result
    /// is NaN if the law cannot be evaluated, which ends the run.
    fn energies(&self, elastic_strain: &[Sym3], history: &[f64], volume: &[f64]) -> [f64; 2];
}

/// Failure of a law in a batch of points.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BatchError {
    /// The law has no response to the trial strain of a point. The step is then attempted with a smaller increment.
    #[error("point {point} of the batch: {error}")]
    Refused {
        /// Index of the point in the batch.
        point: usize,
        /// The failure.
        error: MaterialError,
    },
    /// The law cannot be evaluated. The run then ends.
    #[error("{message}")]
    Failed {
        /// Index of the point in the batch, if the failure is due to one point.
        point: Option<usize>,
        /// The reason.
        message: String,
    },
}

/// A response that has not been written.
const UNWRITTEN: Response = Response {
    tau: Sym3([f64::NAN; 6]),
    elastic_strain: Sym3([f64::NAN; 6]),
    tangent: Tangent::from_array_storage(nalgebra::ArrayStorage([[f64::NAN; 6]; 6])),
};

/// The responses of a batch of points, with their trial history variables in `new`; previous contents of both are
/// overwritten.
///
/// # Errors
/// [`BatchError`], also if a strain or a response is not finite.
pub(crate) fn respond_to_batch(
    law: &dyn BatchLaw,
    trial: &[Sym3],
    old: &[f64],
    new: &mut Vec<f64>,
    responses: &mut Vec<Response>,
) -> Result<(), BatchError> {
    if let Some(point) = trial.iter().position(|strain| !are_finite(&strain.0)) {
        return Err(BatchError::Refused { point, error: MaterialError::NotFinite });
    }
    old.clone_into(new);
    responses.clear();
    responses.resize(trial.len(), UNWRITTEN);
    law.respond(trial, old, new, responses)?;
    let kept = old.len() / trial.len().max(1);
    let is_refused = |point: &usize| {
        let Response { tau, elastic_strain, tangent } = &responses[*point];
        let history = &new[point * kept..][..kept];
        ![&tau.0, &elastic_strain.0, tangent.as_slice(), history].into_iter().all(are_finite)
    };
    match (0..trial.len()).find(is_refused) {
        Some(point) => Err(BatchError::Refused { point, error: MaterialError::NoResponse }),
        None => Ok(()),
    }
}

fn are_finite(values: &[f64]) -> bool {
    values.iter().all(|x| x.is_finite())
}

/// The response, at one point, of a law that is evaluated in batches; the point forms a batch of its own. This function
/// serves to implement [`Material::update`](super::Material::update).
///
/// # Errors
/// [`MaterialError`] if the point has no response; [`MaterialError::Failed`] if the law cannot be evaluated.
pub fn respond_alone(
    law: &dyn BatchLaw,
    trial: &Sym3,
    old: &[f64],
    new: &mut [f64],
) -> Result<Response, MaterialError> {
    let (mut history, mut responses) = (Vec::new(), Vec::new());
    let outcome = respond_to_batch(law, std::slice::from_ref(trial), old, &mut history, &mut responses);
    outcome.map_err(|error| match error {
        BatchError::Refused { error, .. } => error,
        BatchError::Failed { .. } => MaterialError::Failed,
    })?;
    new.copy_from_slice(&history);
    responses.pop().ok_or(MaterialError::Failed)
}
