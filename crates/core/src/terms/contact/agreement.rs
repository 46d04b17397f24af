//! Agreement of all ranks on what each of them finds.

use crate::ranks::Reduction;
use crate::terms::EvaluateError;
use crate::terms::failure::ContactError;

/// The reason why contact cannot be evaluated on this rank.
#[derive(Debug)]
pub(super) enum Failure {
    /// An error on this rank.
    Own(ContactError),
    /// Another rank has an error.
    OnRank,
}

impl From<ContactError> for Failure {
    fn from(error: ContactError) -> Self {
        Failure::Own(error)
    }
}

impl From<Failure> for EvaluateError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Own(error) => error.into(),
            Failure::OnRank => EvaluateError::OnRank { is_final: false },
        }
    }
}

/// Turns success into failure unless all ranks have succeeded.
pub(super) fn agreed<T>(reduction: &Reduction, outcome: Result<T, ContactError>) -> Result<T, Failure> {
    let fails = reduction.any(outcome.is_err());
    let outcome = outcome.map_err(Failure::Own);
    if fails { outcome.and(Err(Failure::OnRank)) } else { outcome }
}

/// Sets each value to true if it is true on any rank.
pub(super) fn any_of_each(reduction: &Reduction, values: &mut [bool]) {
    let mut numbers: Vec<f64> = values.iter().map(|is| f64::from(u8::from(*is))).collect();
    reduction.maximum(&mut numbers);
    values.iter_mut().zip(numbers).for_each(|(is, number)| *is = number > 0.0);
}
