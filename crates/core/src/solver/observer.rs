//! The interface of everything that follows a run.

use crate::equilibrium::{InitialState, StepReport};
use crate::model::Model;
use crate::points::Points;
use crate::step::Step;

use super::attempt::FailedAttempt;
use super::diagnosis::Diagnosis;
use super::error::SolveError;
use super::progress::Reached;

/// The cause of the failure that ends a run.
#[derive(Debug, Clone, Copy)]
pub struct Cause<'a, const D: usize> {
    /// The failed attempt that shows the cause: the last one, or the last one before any last resort.
    pub attempt: &'a FailedAttempt<D>,
    /// The diagnosis of this attempt.
    pub diagnosis: &'a Diagnosis,
}

/// A follower of a run: a writer of results, a progress display, or a recorder in tests.
///
/// Each of several ranks has an observer, which receives the points and the part of the grid of that rank. All
/// observers are called together, so that they can exchange data through the ranks of the points.
pub trait Observer<const D: usize> {
    /// Called before the first step, which begins from the converged state of `points`.
    ///
    /// # Errors
    /// Any error stops the run.
    fn started(&mut self, _model: &Model<D>, _points: &Points<D>) -> std::io::Result<()> {
        Ok(())
    }

    /// Called before the first step with the initial state, if bodies are stressed at time 0.
    fn initial_state(&mut self, _state: &InitialState) {}

    /// Called after every evaluation of the out-of-balance force, unless it is repeated with a shorter increment or
    /// with the stiffness. If the nodes have further fields, `_by_field` states the residual of each field, the
    /// displacement first, [-]; otherwise it is empty.
    fn iteration(&mut self, _step: Step, _iteration: usize, _residual: f64, _by_field: &[f64]) {}

    /// Called when a step is in equilibrium and committed; `reached` is the end of this step.
    ///
    /// # Errors
    /// Any error stops the run.
    fn converged(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _report: &StepReport<D>,
        _reached: &Reached,
    ) -> std::io::Result<()> {
        Ok(())
    }

    /// Called when an attempt at a step has failed; the converged state is the state before the step. A further attempt
    /// follows, unless this one ends the stage or the run. If it ends the run, `ended` states the cause.
    ///
    /// # Errors
    /// Any error stops the run.
    fn failed(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _attempt: &FailedAttempt<D>,
        _ended: Option<Cause<D>>,
    ) -> std::io::Result<()> {
        Ok(())
    }

    /// Called when bodies begin to slide in a converged step while their strength is reduced. Half of the step is
    /// then attempted instead, to find the factor at which sliding begins; the converged state is the state before the
    /// step.
    ///
    /// # Errors
    /// Any error stops the run.
    fn bisected(&mut self, _model: &Model<D>, _points: &Points<D>, _step: Step) -> std::io::Result<()> {
        Ok(())
    }

    /// Called when a stage that another one follows has ended, before the next stage changes the points.
    ///
    /// # Errors
    /// Any error stops the run.
    fn stage_ended(&mut self, _model: &Model<D>, _points: &Points<D>) -> std::io::Result<()> {
        Ok(())
    }

    /// Called when a stage after the first has begun, before its first step. `reached` is the end of the previous stage
    /// together with the new stage: it belongs to the points as the new stage has changed them. `None` if the stage
    /// could not begin, which ends the run; the points are then in no state from which a run can resume.
    fn stage_began(&mut self, _reached: Option<&Reached>) {}

    /// True if the run is to stop before the next step.
    fn interrupted(&self) -> bool {
        false
    }

    /// Called when the run has ended, with or without an error; `points.converged` is the last state in equilibrium,
    /// with the changes of any stage that has begun since then.
    ///
    /// # Errors
    /// An error becomes the outcome of a run that ended without one.
    fn finished(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _reached: &Reached,
        _error: Option<&SolveError>,
    ) -> std::io::Result<()> {
        Ok(())
    }
}

/// An observer that does nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl<const D: usize> Observer<D> for Silent {}
