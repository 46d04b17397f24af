//! The account of a run.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::equilibrium::{Energy, StepReport};
use crate::linear::{Named, Solved};
use crate::model::Model;
use crate::points::Points;
use crate::quality::{BalanceSoFar, Quality, Warning};
use crate::step::Step;
use crate::timing::Timings;

use super::control::Path;
use super::diagnosis::Diagnosis;
use super::pace::Pace;

/// The account of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Equilibrated steps.
    pub steps: usize,
    /// Steps among them that were accepted as far as round-off allows.
    #[serde(default)]
    pub rounding_limited: usize,
    /// Steps among them of which only damped iterations found the equilibrium.
    #[serde(default)]
    pub damped: usize,
    /// Torn domains that were replaced.
    #[serde(default)]
    pub replaced_domains: usize,
    /// [`StepReport::carried`] of the last step.
    #[serde(default)]
    pub carried: Vec<f64>,
    /// Attempts at a step that did not reach equilibrium.
    pub failed_attempts: usize,
    /// How large steps are at the moment.
    pub pace: Pace,
    /// Where the run is on its path, if its load factor is unknown.
    pub path: Path,
    /// The pattern of equations that later steps may go on with.
    #[serde(default, serialize_with = "save_kept", deserialize_with = "load_kept")]
    pub kept: Option<Arc<Named>>,
    /// Load factor of the last step in equilibrium, where there is one for all loads and prescribed motions, [-].
    pub load_factor: Option<f64>,
    /// Load factor of the largest magnitude in equilibrium, where there is one for all loads and prescribed motions, [-].
    pub largest_load_factor: Option<f64>,
    /// What the terms of equilibrium keep beside the points, [`crate::terms::Term::save`], by their names.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub terms: BTreeMap<String, serde_json::Value>,
    /// Why the run could not go on.
    pub diagnosis: Option<Diagnosis>,
    /// Most faces that were stabilised in a step.
    pub stabilised_faces: usize,
    /// Evaluations of internal force and stiffness, those of failed steps included.
    pub evaluations: usize,
    /// Linear solves, those of failed steps included.
    pub linear_solves: usize,
    /// Linear solves by conjugate gradients or GMRES.
    pub iterative_solves: usize,
    /// Their iterations.
    pub linear_iterations: usize,
    /// Linear solves whose matrix was not positive definite.
    pub indefinite_solves: usize,
    /// Linear solves of the last step in equilibrium, 0 before there is one.
    #[serde(default)]
    pub last_iterations: usize,
    /// Most unknowns in a step.
    pub unknowns: usize,
    /// Work of loads and reactions so far, [energy].
    pub external_work: f64,
    /// Work so far of the forces that are out of balance when a step starts on a fresh grid, [energy].
    pub regridding_work: f64,
    /// Work so far that the stabilisation of faces has taken, which is lost at the end of each step, [energy].
    pub stabilisation_work: f64,
    /// Work so far that damped iterations have taken between grids, [energy].
    #[serde(default)]
    pub damping_work: f64,
    /// Sum of the magnitudes of the external and regridding work of all steps, [energy].
    pub gross_work: f64,
    /// Stored elastic energy, [energy].
    pub strain_energy: f64,
    /// Work that has gone into plastic flow, [energy].
    pub plastic_work: f64,
    /// How well the run goes.
    pub quality: Quality,
    /// What the user should know about it, in the order of the steps; observers find new ones at the end.
    pub warnings: Vec<Warning>,
    /// Time spent by phase.
    pub timings: Timings,
}

fn save_kept<S: Serializer>(kept: &Option<Arc<Named>>, to: S) -> Result<S::Ok, S::Error> {
    kept.as_deref().serialize(to)
}

fn load_kept<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Arc<Named>>, D::Error> {
    Ok(Option::<Named>::deserialize(from)?.map(Arc::new))
}

/// How far a run has come: what it goes on from beside the points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// The last step in equilibrium; of number 0 and time 0 where there is none.
    pub step: Step,
    /// The account of the run so far.
    pub summary: Summary,
}

impl Reached {
    /// Nothing: a run that begins.
    pub fn nothing<const D: usize>(points: &Points<D>) -> Reached {
        let summary = Summary { quality: Quality::new(points), ..Summary::default() };
        Reached { step: Step { index: 0, start: 0.0, end: 0.0 }, summary }
    }
}

/// No run counts so far.
const UNCOUNTED: usize = 1 << 48;

impl Reached {
    /// Whether a run of this model can have reached this.
    pub fn can_be_of<const D: usize>(&self, model: &Model<D>) -> bool {
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
        counts.iter().all(|count| *count < UNCOUNTED)
            && 0.0 <= self.step.start
            && self.step.start < self.step.end
            && self.step.end <= model.stepping.end_time
            && self.summary.pace.is_possible()
            && self.summary.path.can_be_of::<D>()
            && self.summary.kept.as_ref().is_none_or(|kept| kept.can_be_of::<D>(model.grid.n_nodes()))
            && self.summary.quality.can_be_of(model.bodies.len())
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

    /// What is missing between the work so far and the energy that is stored or has gone into plastic flow, relative to
    /// the magnitudes of all work, [-]: the error of the trapezoidal rule, which falls with the square of the steps.
    pub fn energy_error(&self) -> f64 {
        let work = self.external_work + self.regridding_work - self.stabilisation_work - self.damping_work;
        let missing = work - self.strain_energy - self.plastic_work;
        if self.gross_work > 0.0 { missing / self.gross_work } else { 0.0 }
    }

    pub(super) fn accept<const D: usize>(&mut self, report: &StepReport<D>) {
        self.steps += 1;
        self.rounding_limited += usize::from(report.rounding_limited);
        self.damped += usize::from(report.damped);
        self.carried.clone_from(&report.carried);
        self.replaced_domains += report.replaced_domains.len();
        self.last_iterations = report.residuals.len() - 1;
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
        } = report.energy;
        self.damping_work += damping_work;
        self.external_work += external_work;
        self.regridding_work += regridding_work;
        self.stabilisation_work += stabilisation_work;
        self.gross_work += (external_work + regridding_work).abs();
        self.strain_energy = strain_energy;
        self.plastic_work = plastic_work;
    }

    /// Counts a linear solve.
    pub(super) fn count(&mut self, solved: Solved) {
        self.linear_solves += 1;
        self.linear_iterations += solved.iterations;
        self.iterative_solves += usize::from(solved.factorisation.is_iterative());
        self.indefinite_solves += usize::from(!solved.factorisation.is_definite());
    }
}
