//! What watches a run.

use crate::equilibrium::StepReport;
use crate::model::Model;
use crate::points::Points;
use crate::step::Step;

use super::attempt::FailedAttempt;
use super::diagnosis::Diagnosis;
use super::error::SolveError;
use super::summary::Summary;

/// Everything that watches a run: writers, progress, and the recorder used by tests.
pub trait Observer<const D: usize> {
    /// The run begins from the converged state of `points`.
    ///
    /// # Errors
    /// Any error stops the run.
    fn started(&mut self, _model: &Model<D>, _points: &Points<D>) -> std::io::Result<()> {
        Ok(())
    }

    /// An evaluation of the out-of-balance force.
    fn iteration(&mut self, _step: Step, _iteration: usize, _residual: f64) {}

    /// A step is in equilibrium and committed.
    ///
    /// # Errors
    /// Any error stops the run.
    fn converged(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _report: &StepReport<D>,
        _summary: &Summary,
    ) -> std::io::Result<()> {
        Ok(())
    }

    /// A step is not in equilibrium; the converged state is that before it. A smaller step
    /// or a last resort follows, unless the run has `ended` here: with the attempt that tells why, this one or that before the
    /// last resorts, and its diagnosis.
    ///
    /// # Errors
    /// Any error stops the run.
    fn failed(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _attempt: &FailedAttempt<D>,
        _ended: Option<(&FailedAttempt<D>, &Diagnosis)>,
    ) -> std::io::Result<()> {
        Ok(())
    }

    /// Whether the run should stop before the next step.
    fn interrupted(&self) -> bool {
        false
    }

    /// The run has ended, with an error or without; `points.converged` is the last equilibrated state.
    ///
    /// # Errors
    /// An error becomes the outcome of a run that had none.
    fn finished(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _summary: &Summary,
        _error: Option<&SolveError>,
    ) -> std::io::Result<()> {
        Ok(())
    }
}

/// An observer that does nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl<const D: usize> Observer<D> for Silent {}
