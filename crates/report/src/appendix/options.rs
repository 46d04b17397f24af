//! Options of a report.

use super::error::ReportError;
use super::field::{FieldChoice, StepChoice};
use super::run::Snapshot;
use super::units::Units;

/// Options of a report.
#[derive(Debug, Clone)]
pub struct Options {
    /// The fields that colour the points, each in its own figure; if empty, the von Mises stress, or another field if
    /// the von Mises stress was not written.
    pub fields: Vec<FieldChoice>,
    /// The steps at which the points are shown; a comparison shows the last of them.
    pub steps: Vec<StepChoice>,
    /// The unit system of the decks.
    pub units: Option<Units>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            fields: Vec::new(),
            steps: vec![StepChoice::First, StepChoice::Middle, StepChoice::Last],
            units: None,
        }
    }
}

impl Options {
    /// True if a field or a step is asked for that only pictures can show.
    pub(super) fn asks_for_pictures(&self) -> bool {
        let by_number = |step: &StepChoice| matches!(step, StepChoice::Number(_));
        !self.fields.is_empty() || self.steps.iter().any(by_number)
    }

    /// The fields to show for some states.
    pub(super) fn fields(&self, snapshots: &[Snapshot]) -> Result<Vec<FieldChoice>, ReportError> {
        if self.fields.is_empty() {
            Ok(vec![FieldChoice::usual(snapshots)?])
        } else {
            Ok(self.fields.clone())
        }
    }
}
