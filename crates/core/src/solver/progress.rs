//! What the next step of a run builds on and a restart must restore, apart from what is reported.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::model::{Factors, Model, SavedRelease};
use crate::points::{Points, Split};
use crate::quality::Quality;
use crate::step::Step;
use crate::terms::Saved;

use super::stepping::control::Path;
use super::stepping::limit::{LimitLoad, StageLimit};
use super::stepping::pace::Pace;
use super::stepping::rest::StageRest;
use super::stepping::strength::{StageStrength, StrengthBracket};
use super::summary::{MAX_COUNT, Summary};

/// The last converged step of a run: together with the points, all that a restart needs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// What the next step builds on.
    pub progress: Progress,
    /// What is reported on the run so far.
    pub summary: Summary,
}

/// What the next step builds on, apart from the points. Once a step has converged, no further step depends on the
/// [`Summary`].
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// The last converged step; number and time are 0 before the first one.
    pub step: Step,
    /// The current step size.
    pub pace: Pace,
    /// Data on the path so far.
    pub path: Path,
    /// The current stage; `None` in the first stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<StageReached>,
    /// The displacement that each group of lines of a moving grid has in addition to the one that its condition
    /// prescribes, [length]; empty unless the model has changed during the run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub offsets_of_lines: Vec<f64>,
    /// The points that were split, in the order of the splits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub splits: Vec<Split>,
    /// Largest force on a part of each body so far, [`StepReport::carried`](super::StepReport::carried), [force].
    pub carried: Vec<f64>,
    /// Number of iterations of the last converged step, 0 before the first one.
    pub last_iterations: usize,
    /// The factors of each stage in which the strength is reduced, in the order of the stages.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub strength: Vec<StageStrength>,
    /// The load in each stage that runs until its limit, in the order of the stages.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub limits: Vec<StageLimit>,
    /// The motion in each stage that runs until its bodies are at rest, in the order of the stages.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rests: Vec<StageRest>,
    /// The saved states of the terms of equilibrium, by term name, [`crate::terms::Term::save`].
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub terms: BTreeMap<String, Saved>,
}

/// The stage of a run, as checkpoints store it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StageReached {
    /// Number of the stage, from 0.
    pub number: usize,
    /// The factors with which the stage began.
    pub began: Factors,
    /// Grid nodes, and the forces on them that are released over the stage, [force].
    pub(super) released_forces: Vec<(u32, Vec<f64>)>,
    /// Forces on sides of domains and on points that are released over the stage.
    #[serde(default)]
    pub(super) released: SavedRelease,
    /// For each stage after the first, up to this one, the number of splits of points before it began.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) splits_before: Vec<usize>,
}

impl Reached {
    /// The state of a run before its first step.
    pub fn nothing<const D: usize>(points: &Points<D>) -> Reached {
        let summary = Summary { quality: Quality::new(points), ..Summary::default() };
        Reached { progress: Progress::default(), summary }
    }

    /// True if a run of this model could have reached this step.
    pub fn fits<const D: usize>(&self, model: &Model<D>) -> bool {
        self.progress.fits(model) && self.summary.fits(model)
    }
}

impl Progress {
    /// True if a run of this model could have come this far.
    fn fits<const D: usize>(&self, model: &Model<D>) -> bool {
        self.step.index < MAX_COUNT
            && 0.0 <= self.step.start
            && self.step.start < self.step.end
            && self.step.end <= model.end_time()
            && self.pace.is_valid()
            && self.path.fits::<D>()
    }

    /// Number of the current stage, from 0.
    pub fn stage_number(&self) -> usize {
        self.stage.as_ref().map_or(0, |stage| stage.number)
    }

    /// The factors of the latest stage so far in which the strength is reduced; `None` before the first such stage.
    pub fn last_strength(&self) -> Option<StrengthBracket> {
        self.strength.last().map(|found| found.bracket)
    }

    /// The load of a stage that runs until its limit.
    pub(super) fn limit_of(&mut self, stage: usize) -> &mut LimitLoad {
        let place = self.limits.iter().position(|found| found.stage == stage).unwrap_or_else(|| {
            self.limits.push(StageLimit { stage, limit: LimitLoad::default() });
            self.limits.len() - 1
        });
        &mut self.limits[place].limit
    }

    /// The motion in a stage that runs until its bodies are at rest.
    pub(super) fn rest_of(&mut self, stage: usize) -> &mut StageRest {
        let place = self.rests.iter().position(|found| found.stage == stage).unwrap_or_else(|| {
            self.rests.push(StageRest { stage, ..StageRest::default() });
            self.rests.len() - 1
        });
        &mut self.rests[place]
    }

    /// The factors of a stage in which the strength is reduced.
    pub(super) fn strength_of(&mut self, stage: usize) -> &mut StrengthBracket {
        let place = self.strength.iter().position(|found| found.stage == stage).unwrap_or_else(|| {
            self.strength.push(StageStrength { stage, bracket: StrengthBracket::default() });
            self.strength.len() - 1
        });
        &mut self.strength[place].bracket
    }
}
