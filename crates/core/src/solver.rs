//! The analysis: load steps and, within each, Newton iterations to equilibrium (sections 5 and 6.3).
//!
//! A step that fails leaves no trace in the converged state. It is tried again in two halves, down to the smallest step
//! that the deck allows; only equilibrium is committed.

mod attempt;
mod control;
mod course;
mod damping;
mod diagnosis;
mod equations;
mod error;
mod evidence;
mod forcing;
mod motion;
mod newton;
mod observer;
mod pace;
mod residual;
mod step_system;
mod stepper;
mod summary;
mod unknowns;
mod update;

use crate::model::Model;
use crate::points::Points;
use crate::stress::{Axisymmetric, Mechanics, PlaneStrain, Solid};
use crate::terms::Terms;
use crate::timing::Phase;

use stepper::Stepper;

pub use crate::equilibrium::{GridFields, ReactionMoment, StepReport};
pub use crate::step::Step;
pub use attempt::{FailedAttempt, Iterate};
pub use control::{NoPath, Path, path_length};
pub use diagnosis::{Diagnosis, Kind};
pub use error::{CODES, SolveError};
pub use motion::Motion;
pub use observer::{Observer, Silent};
pub use pace::Pace;
pub use summary::{Reached, Summary};

/// A model with as many axes as there are mechanics for.
pub trait Solvable<const D: usize> {
    /// Runs an analysis from the step that has been reached, as [`go_on_with`].
    ///
    /// # Errors
    /// As [`run`].
    fn solve(
        &self,
        points: &mut Points<D>,
        reached: Reached,
        terms: Terms<D>,
        observer: &mut dyn Observer<D>,
    ) -> Result<Summary, SolveError>;
}

impl Solvable<2> for Model<2> {
    fn solve(
        &self,
        points: &mut Points<2>,
        reached: Reached,
        terms: Terms<2>,
        observer: &mut dyn Observer<2>,
    ) -> Result<Summary, SolveError> {
        if self.revolved {
            load_steps::<2, Axisymmetric>(self, points, reached, terms, observer)
        } else {
            load_steps::<2, PlaneStrain>(self, points, reached, terms, observer)
        }
    }
}

impl Solvable<3> for Model<3> {
    fn solve(
        &self,
        points: &mut Points<3>,
        reached: Reached,
        terms: Terms<3>,
        observer: &mut dyn Observer<3>,
    ) -> Result<Summary, SolveError> {
        load_steps::<3, Solid>(self, points, reached, terms, observer)
    }
}

/// Runs an analysis from the converged state of `points` to the end, telling `observer` of everything.
///
/// # Errors
/// [`SolveError`] when a step has no equilibrium, however small; `points.converged` then is the last equilibrated state.
pub fn run<const D: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    observer: &mut dyn Observer<D>,
) -> Result<Summary, SolveError>
where
    Model<D>: Solvable<D>,
{
    let nothing = Reached::nothing(points);
    model.solve(points, nothing, Vec::new(), observer)
}

/// Runs an analysis from the step that has been reached, in whose state `points` are, to the end.
///
/// # Errors
/// As [`run`].
pub fn go_on<const D: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    reached: Reached,
    observer: &mut dyn Observer<D>,
) -> Result<Summary, SolveError>
where
    Model<D>: Solvable<D>,
{
    model.solve(points, reached, Vec::new(), observer)
}

/// As [`go_on`], with terms of equilibrium beside those of the model. Their names must differ from each other.
///
/// # Errors
/// As [`run`]; [`SolveError::Term`] where a term cannot go on from what has been reached.
pub fn go_on_with<const D: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    reached: Reached,
    terms: Terms<D>,
    observer: &mut dyn Observer<D>,
) -> Result<Summary, SolveError>
where
    Model<D>: Solvable<D>,
{
    model.solve(points, reached, terms, observer)
}

/// The load steps of an analysis with its mechanics, from what has been reached to the end.
fn load_steps<const D: usize, M: Mechanics<D>>(
    model: &Model<D>,
    points: &mut Points<D>,
    reached: Reached,
    terms: Terms<D>,
    observer: &mut dyn Observer<D>,
) -> Result<Summary, SolveError> {
    let mut solver = Stepper::new::<M>(reached, terms)?;
    let mut outcome = solver.observe(|| observer.started(model, points));
    while outcome.is_ok() {
        match solver.next_step(model) {
            Some(step) => outcome = solver.try_step::<M>(model, points, step, observer),
            None => break,
        }
    }
    let Summary { timings, quality, .. } = &mut solver.reached.summary;
    timings.measure(Phase::Update, || quality.conclude(model, points));
    let finished = solver.reached.summary;
    let told = observer.finished(model, points, &finished, outcome.as_ref().err());
    outcome.and(told.map_err(SolveError::Output)).map(|()| finished)
}
