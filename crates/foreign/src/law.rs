//! A law from a library, as the solver evaluates it.
//!
//! The library uses plain components of tensors and of the tangent; the solver uses the Mandel layout, in which shear
//! components carry a factor √2.

use std::f64::consts::SQRT_2;
use std::sync::Arc;

use mpm_core::counted::counted;
use mpm_core::material::{Material, MaterialError, Response, StateField, StrainMeasure};
use mpm_core::tensor::{Sym3, Tangent};

use super::interface::Answer;
use super::library::Library;

/// Weight of each component in the Mandel layout, which has the same order as the library.
const WEIGHT: [f64; 6] = [1.0, 1.0, 1.0, SQRT_2, SQRT_2, SQRT_2];

fn plain(tensor: &Sym3) -> [f64; 6] {
    std::array::from_fn(|c| tensor.0[c] / WEIGHT[c])
}

fn weighted(plain: &[f64; 6]) -> Sym3 {
    Sym3(std::array::from_fn(|c| plain[c] * WEIGHT[c]))
}

fn are_finite(values: &[f64]) -> bool {
    values.iter().all(|x| x.is_finite())
}

/// A law from a library, with parameter values.
#[derive(Debug, Clone)]
pub struct LibraryLaw {
    library: Arc<Library>,
    parameters: Vec<f64>,
    is_symmetric: bool,
}

impl LibraryLaw {
    /// The law of a library with parameter values, in the order of [`Library::parameters`].
    ///
    /// # Errors
    /// The reason why the law cannot have these values, in the words of the library unless their number is wrong.
    pub fn new(library: Arc<Library>, parameters: Vec<f64>) -> Result<LibraryLaw, String> {
        let (needed, given) = (library.parameters.len(), parameters.len());
        if given != needed {
            let needed = counted(needed, "parameter", "parameters");
            let were = if given == 1 { "was" } else { "were" };
            return Err(format!("the law needs {needed}, but {given} {were} given"));
        }
        if let Some(reason) = library.interface.refusal(&parameters) {
            return Err(reason);
        }
        let is_symmetric = library.interface.is_symmetric(&parameters);
        Ok(LibraryLaw { library, parameters, is_symmetric })
    }
}

impl Material for LibraryLaw {
    fn state_fields(&self) -> &[StateField] {
        &self.library.fields
    }

    fn strain_measure(&self) -> StrainMeasure {
        self.library.measure
    }

    fn update(&self, trial: &Sym3, old: &[f64], new: &mut [f64]) -> Result<Response, MaterialError> {
        if !are_finite(&trial.0) {
            return Err(MaterialError::NotFinite);
        }
        let answer = self.library.interface.update(&self.parameters, &plain(trial), old, new);
        let Answer { stress, elastic_strain, tangent } = answer.map_err(MaterialError::Refused)?;
        if ![&stress[..], &elastic_strain, &tangent, new].into_iter().all(are_finite) {
            return Err(MaterialError::ResponseNotFinite);
        }
        Ok(Response {
            tau: weighted(&stress),
            elastic_strain: weighted(&elastic_strain),
            tangent: Tangent::from_fn(|i, j| tangent[6 * i + j] * WEIGHT[i] * WEIGHT[j]),
        })
    }

    fn start_from(&self, elastic_strain: &Sym3, volume_ratio: f64, history: &mut [f64]) {
        self.library.interface.start_from(&self.parameters, &plain(elastic_strain), volume_ratio, history);
    }

    fn elastic_strain(&self, tau: &Sym3, history: &[f64]) -> Result<Sym3, MaterialError> {
        match self.library.interface.elastic_strain(&self.parameters, &plain(tau), history) {
            None => Err(MaterialError::NoInverse),
            Some(Ok(strain)) if are_finite(&strain) => Ok(weighted(&strain)),
            Some(_) => Err(MaterialError::NoStrain),
        }
    }

    fn energy(&self, elastic_strain: &Sym3, history: &[f64]) -> f64 {
        let stated = self.library.interface.energy(&self.parameters, &plain(elastic_strain), history);
        stated.unwrap_or_else(|| {
            let response = self.update(elastic_strain, history, &mut history.to_vec());
            response.map_or(f64::NAN, |response| 0.5 * response.tau.dot(elastic_strain))
        })
    }

    fn plastic_work(&self, history: &[f64]) -> f64 {
        self.library.interface.plastic_work(&self.parameters, history).unwrap_or(0.0)
    }

    /// True if the plastic work has changed; if the library does not state it, any change of a variable counts.
    fn has_yielded(&self, initial: &[f64], history: &[f64]) -> bool {
        let work = |history| self.library.interface.plastic_work(&self.parameters, history);
        match (work(initial), work(history)) {
            (Some(before), Some(now)) => before != now,
            _ => initial != history,
        }
    }

    fn tangent_is_symmetric(&self) -> bool {
        self.is_symmetric
    }
}
