//! The summary of a run: counts, work, quality, warnings and timings, and the data that its next step builds on.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::equilibrium::{Energy, InitialState, StepReport};
use crate::linear::{Nature, Solved};
use crate::model::{Factors, Model};
use crate::points::{Points, Split};
use crate::quality::{BalanceSoFar, Quality, Warning};
use crate::step::Step;
use crate::terms::Saved;
use crate::timing::Timings;

use super::control::Path;
use super::diagnosis::Diagnosis;
use super::pace::Pace;
use super::strength::{StageStrength, StrengthBracket};

/// The stage of a run, as checkpoints store it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct StageReached {
    /// Number of the stage, from 0.
    pub number: usize,
    /// The factors with which the stage began.
    pub began: Factors,
    /// Grid nodes, and the forces on them that are released over the stage, [force].
    pub(super) released_forces: Vec<(u32, Vec<f64>)>,
    /// For each stage after the first, up to this one, the number of splits of points before it began.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) splits_before: Vec<usize>,
}

/// The summary of a run up to its last converged step.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of converged steps.
    pub steps: usize,
    /// Number of steps accepted at the limit of round-off rather than at the tolerance.
    #[serde(default)]
    pub rounding_limited: usize,
    /// Number of steps whose equilibrium was found only by damped iterations.
    #[serde(default)]
    pub damped: usize,
    /// The points that were split, in the order of the splits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub splits: Vec<Split>,
    /// Number of torn domains that were replaced.
    #[serde(default)]
    pub replaced_domains: usize,
    /// Largest force on a part of each body so far, [`StepReport::carried`], [force].
    #[serde(default)]
    pub carried: Vec<f64>,
    /// The state before the first step, if bodies are stressed at time 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_state: Option<InitialState>,
    /// Number of attempts at a step that did not reach equilibrium.
    pub failed_attempts: usize,
    /// The current step size.
    pub pace: Pace,
    /// Data on the path so far that the next step needs.
    pub path: Path,
    /// The current stage; `None` in the first stage.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage: Option<StageReached>,
    /// The displacement that each group of lines of a moving grid has in addition to the one that its condition
    /// prescribes, [length]; empty unless the model has changed during the run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub offsets_of_lines: Vec<f64>,
    /// The factors of each stage in which the strength is reduced, in the order of the stages.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub strength: Vec<StageStrength>,
    /// Load factor of the last converged step, [-]; `None` unless all loads and prescribed motions share one.
    pub load_factor: Option<f64>,
    /// Load factor of largest magnitude in equilibrium, [-]; `None` unless all loads and prescribed motions share one.
    pub largest_load_factor: Option<f64>,
    /// The saved states of the terms of equilibrium, by term name, [`crate::terms::Term::save`].
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub terms: BTreeMap<String, Saved>,
    /// The probable cause of the failure; `None` unless the run has failed.
    pub diagnosis: Option<Diagnosis>,
    /// Largest number of faces stabilised in a step.
    pub stabilised_faces: usize,
    /// Number of evaluations of the internal force, with or without the stiffness, including those of failed steps.
    pub evaluations: usize,
    /// Number of linear solves, counted once per iteration, including those of failed steps.
    pub linear_solves: usize,
    /// Number of linear solves by conjugate gradients or GMRES.
    pub iterative_solves: usize,
    /// Number of iterations of conjugate gradients and GMRES.
    pub linear_iterations: usize,
    /// Number of linear solves whose matrix was not positive definite; those of saddle points, which never are, do not
    /// count.
    pub indefinite_solves: usize,
    /// Number of iterations of the last converged step, 0 before the first one.
    #[serde(default)]
    pub last_iterations: usize,
    /// Largest number of unknowns in a step.
    pub unknowns: usize,
    /// Work of loads and reactions so far, [energy].
    pub external_work: f64,
    /// Work done so far against the out-of-balance forces of fresh grids, [energy].
    pub regridding_work: f64,
    /// Work absorbed so far by the stabilisation of faces, and lost at the end of each step, [energy].
    pub stabilisation_work: f64,
    /// Stored energy and plastic work of bodies that were added, less those of bodies that were removed, plus the
    /// change of both in bodies that changed their material or whose material has changed, [energy].
    #[serde(default)]
    pub exchanged_energy: f64,
    /// Work absorbed so far by the damping of damped iterations, [energy].
    #[serde(default)]
    pub damping_work: f64,
    /// Sum over the steps of the magnitude of the sum of external and regridding work, [energy].
    pub gross_work: f64,
    /// Stored elastic energy, [energy].
    pub strain_energy: f64,
    /// Plastic work, [energy].
    pub plastic_work: f64,
    /// Plastic work that the history variables of the laws record but that was not done, because the strength was
    /// reduced, [energy].
    #[serde(default)]
    pub undone_work: f64,
    /// Work dissipated so far by friction between tools and bodies, [energy].
    #[serde(default)]
    pub friction_work: f64,
    /// The quality of the run.
    pub quality: Quality,
    /// The warnings in the order of the steps; new ones are appended.
    pub warnings: Vec<Warning>,
    /// Time spent in each phase.
    pub timings: Timings,
}

/// The last converged step of a run: together with the points, all that a restart needs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// The last converged step; number and time are 0 before the first one.
    pub step: Step,
    /// The summary of the run so far.
    pub summary: Summary,
}

impl Reached {
    /// The state of a run before its first step.
    pub fn nothing<const D: usize>(points: &Points<D>) -> Reached {
        let summary = Summary { quality: Quality::new(points), ..Summary::default() };
        Reached { step: Step { index: 0, start: 0.0, end: 0.0 }, summary }
    }
}

/// Relative round-off of a stored energy, [-].
const ROUND_OFF: f64 = 1e-13;
/// Work, relative to the energy of an initial stress, below which it is hardly more than round-off, [-].
const LEAST_WORK: f64 = 1e-10;

/// Upper bound on each count of a run.
const MOST_COUNTED: usize = 1 << 48;

impl Reached {
    /// True if a run of this model could have reached this step.
    pub fn fits<const D: usize>(&self, model: &Model<D>) -> bool {
        let of = &self.summary;
        let counts = [
            of.steps,
            of.failed_attempts,
            of.evaluations,
            of.linear_solves,
            of.iterative_solves,
            of.linear_iterations,
            of.indefinite_solves,
            self.step.index,
        ];
        counts.iter().all(|count| *count < MOST_COUNTED)
            && 0.0 <= self.step.start
            && self.step.start < self.step.end
            && self.step.end <= model.end_time()
            && self.summary.pace.is_valid()
            && self.summary.path.fits::<D>()
            && self.summary.quality.fits(model.bodies.len())
    }
}

impl Summary {
    /// The balances of the run.
    pub fn balance(&self) -> BalanceSoFar {
        BalanceSoFar {
            steps: self.steps,
            external_work: self.external_work,
            regridding_work: self.regridding_work,
            gross_work: self.gross_work,
            energy_error: self.energy_error(),
        }
    }

    /// Difference between the work so far and the growth of the sum of stored energy and plastic work, relative to the
    /// sum of the magnitudes of all work, [-]: the error of the trapezoidal rule, which falls with the square of the
    /// step size. Round-off in the energy of an initial stress does not count.
    pub fn energy_error(&self) -> f64 {
        let work = self.external_work + self.regridding_work - self.stabilisation_work - self.damping_work;
        let missing =
            work + self.exchanged_energy - self.strain_energy - self.plastic_work - self.friction_work;
        if let Some(InitialState { energy, .. }) = self.initial_state {
            let missing = missing + energy;
            let counts = missing.abs() > ROUND_OFF * energy && self.gross_work > LEAST_WORK * energy;
            return if counts { missing / self.gross_work } else { 0.0 };
        }
        if self.gross_work > 0.0 { missing / self.gross_work } else { 0.0 }
    }

    /// The factors of the latest stage so far in which the strength is reduced; `None` before the first such stage.
    pub fn last_strength(&self) -> Option<StrengthBracket> {
        self.strength.last().map(|of_stage| of_stage.bracket)
    }

    /// The factors of a stage in which the strength is reduced.
    pub(super) fn strength_of(&mut self, stage: usize) -> &mut StrengthBracket {
        let place = self.strength.iter().position(|of_stage| of_stage.stage == stage).unwrap_or_else(|| {
            self.strength.push(StageStrength { stage, bracket: StrengthBracket::default() });
            self.strength.len() - 1
        });
        &mut self.strength[place].bracket
    }

    pub(super) fn accept<const D: usize>(&mut self, report: &StepReport<D>) {
        self.steps += 1;
        self.rounding_limited += usize::from(report.rounding_limited);
        self.damped += usize::from(report.damped);
        self.carried.clone_from(&report.carried);
        self.replaced_domains += report.replaced_domains.len();
        self.last_iterations = report.solves();
        self.stabilised_faces = self.stabilised_faces.max(report.stabilised_faces);
        self.load_factor = report.load_factor;
        if let Some(factor) = report.load_factor {
            let before = self.largest_load_factor.filter(|largest| largest.abs() >= factor.abs());
            self.largest_load_factor = before.or(Some(factor));
        }
        self.unknowns = self.unknowns.max(report.unknowns);
        let Energy {
            external_work,
            regridding_work,
            stabilisation_work,
            damping_work,
            strain_energy,
            plastic_work,
            undone_work,
            friction_work,
        } = report.energy;
        self.friction_work += friction_work;
        self.damping_work += damping_work;
        self.external_work += external_work;
        self.regridding_work += regridding_work;
        self.stabilisation_work += stabilisation_work;
        self.gross_work += (external_work + regridding_work).abs();
        self.strain_energy = strain_energy;
        self.plastic_work = plastic_work;
        self.undone_work += undone_work;
    }

    /// Counts a linear solve.
    pub(super) fn count(&mut self, solved: Solved, nature: Nature) {
        self.linear_solves += 1;
        self.linear_iterations += solved.iterations;
        self.iterative_solves += usize::from(solved.factorisation.is_iterative());
        let counts = nature != Nature::SaddlePoint && !solved.factorisation.is_definite();
        self.indefinite_solves += usize::from(counts);
    }
}
