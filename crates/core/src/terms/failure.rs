//! Reasons why a term cannot be evaluated.

mod contact;

use crate::dofs::ConstraintError;
use crate::points::coordinates;
use crate::ranks::Reduction;
use crate::stress::PointError;

pub use contact::{ContactError, ContactPlace};

/// The reason why a term cannot begin a step.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BeginError {
    /// A force has no finite value.
    #[error(transparent)]
    Load(Box<LoadNotFinite>),
    /// A prescribed motion has no finite value.
    #[error(transparent)]
    Constraint(ConstraintError),
    /// A surface has left the material that carries it.
    #[error(transparent)]
    Surface(Box<SurfaceLost>),
    /// The contact with tools cannot be evaluated.
    #[error(transparent)]
    Contact(Box<ContactError>),
    /// A term from outside this crate cannot begin the step.
    #[error(transparent)]
    Term(Box<TermFailure>),
}

impl From<TermFailure> for BeginError {
    fn from(failure: TermFailure) -> Self {
        BeginError::Term(Box::new(failure))
    }
}

impl From<LoadNotFinite> for BeginError {
    fn from(error: LoadNotFinite) -> Self {
        BeginError::Load(Box::new(error))
    }
}

impl From<Box<LoadNotFinite>> for BeginError {
    fn from(error: Box<LoadNotFinite>) -> Self {
        BeginError::Load(error)
    }
}

/// No cell near a position on a surface has material at every node.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "surface `{surface}` of body `{body}` has left the material at {}: no cell within one cell size of that \
     position has material at every node",
    coordinates(.position)
)]
pub struct SurfaceLost {
    /// Name of the surface.
    pub surface: String,
    /// Name of the body.
    pub body: String,
    /// Position, [length].
    pub position: Vec<f64>,
}

/// A load has no finite value at some position.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(
    "load `{load}` is not finite at {place} at {}: the formula `{formula}` gives {value} at \
     load factor {factor:?}",
    coordinates(.position)
)]
pub struct LoadNotFinite {
    /// Name of the load.
    pub load: String,
    /// The material point or the surface on which the load acts.
    pub place: String,
    /// Permanent number of the material point.
    pub point: Option<u32>,
    /// Position at which the load has no finite value, [length].
    pub position: Vec<f64>,
    /// The load factor.
    pub factor: f64,
    /// Text of the first formula whose value is not finite; it may be that of a named intermediate value.
    pub formula: String,
    /// Value of this formula.
    pub value: f64,
}

/// The reason why a term cannot be evaluated.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq)]
pub enum EvaluateError {
    /// A point could not follow the increment; a smaller one may succeed.
    Point(PointFailure),
    /// The evaluation of a law in batches has failed.
    Law(Box<LawFailure>),
    /// The contact with tools cannot be evaluated.
    Contact(Box<ContactError>),
    /// A condition on a surface is not met.
    Constraint(Box<ConstraintError>),
    /// A term from outside this crate cannot be evaluated.
    Term(Box<TermFailure>),
    /// The evaluation has failed on another rank.
    OnRank {
        /// True if a smaller increment cannot succeed.
        is_final: bool,
    },
}

impl EvaluateError {
    /// True if a smaller increment cannot succeed.
    pub fn is_final(&self) -> bool {
        match self {
            EvaluateError::Law(_) | EvaluateError::Constraint(_) => true,
            EvaluateError::Point(_) | EvaluateError::Contact(_) => false,
            EvaluateError::Term(failure) => !failure.may_succeed_if_smaller,
            EvaluateError::OnRank { is_final } => *is_final,
        }
    }
}

/// Lets the evaluation of a term succeed only if it succeeds on all ranks. Errors that a smaller increment cannot avoid
/// take precedence.
pub(super) fn agree<T>(reduction: &Reduction, outcome: Result<T, EvaluateError>) -> Result<T, EvaluateError> {
    let own = outcome.as_ref().err();
    let [fails, is_final] = [own.is_some(), own.is_some_and(EvaluateError::is_final)];
    let mut numbers = [fails, is_final].map(|is| f64::from(u8::from(is)));
    reduction.maximum(&mut numbers);
    let [fails, is_final] = numbers.map(|number| number > 0.0);
    let remote = EvaluateError::OnRank { is_final };
    match outcome {
        Err(error) if error.is_final() == is_final => Err(error),
        Ok(found) if !fails => Ok(found),
        _ => Err(remote),
    }
}

impl From<TermFailure> for EvaluateError {
    fn from(failure: TermFailure) -> Self {
        EvaluateError::Term(Box::new(failure))
    }
}

impl From<ContactError> for EvaluateError {
    fn from(error: ContactError) -> Self {
        EvaluateError::Contact(Box::new(error))
    }
}

impl From<ConstraintError> for EvaluateError {
    fn from(error: ConstraintError) -> Self {
        EvaluateError::Constraint(Box::new(error))
    }
}

impl From<PointFailure> for EvaluateError {
    fn from(failure: PointFailure) -> Self {
        EvaluateError::Point(failure)
    }
}

/// The reason why a term from outside this crate cannot begin a step or cannot be evaluated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("the term `{term}` cannot be evaluated: {reason}")]
pub struct TermFailure {
    /// Name of the term.
    pub term: String,
    /// The reason.
    pub reason: String,
    /// True if the step may succeed with a smaller increment.
    pub may_succeed_if_smaller: bool,
}

/// The evaluation of a law in batches has failed.
#[derive(Debug, Clone, PartialEq)]
pub struct LawFailure {
    /// Number of the material.
    pub material: usize,
    /// Index of the point, if a single point is to blame.
    pub point: Option<usize>,
    /// The reason.
    pub message: String,
}

/// A point failed during assembly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointFailure {
    /// Index of the point.
    pub point: usize,
    /// The failure.
    pub error: PointError,
}
