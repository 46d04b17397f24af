//! What a report shows.

use super::error::ReportError;
use super::field::{FieldChoice, StepChoice};
use super::run::Snapshot;
use super::units::Units;

/// What a report shows.
#[derive(Debug, Clone)]
pub struct Options {
    /// The fields that the points are coloured by, each in a figure of its own; where there are none, the von Mises stress,
    /// or another field if that was not written.
    pub fields: Vec<FieldChoice>,
    /// The steps that the points are shown at; a comparison shows the last of them.
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
    /// The fields that are shown of some states.
    pub(super) fn fields(&self, snapshots: &[Snapshot]) -> Result<Vec<FieldChoice>, ReportError> {
        if self.fields.is_empty() {
            Ok(vec![FieldChoice::usual(snapshots)?])
        } else {
            Ok(self.fields.clone())
        }
    }
}
