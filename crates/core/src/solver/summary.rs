//! What is reported on a run: counts, work, quality, warnings and timings.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::equilibrium::{Energy, InitialState, StepReport};
use crate::linear::{Nature, Solved};
use crate::model::Model;
use crate::quality::{BalanceSoFar, Quality, Warning};
use crate::terms::{Amount, Ledger, NamedEnergy, Role, continued};
use crate::timing::Timings;

use super::diagnosis::Diagnosis;
use super::placing::Placed;

/// What is reported on a run up to its last converged step; [`Progress`](super::Progress) holds what the next step
/// needs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Number of converged steps.
    pub steps: usize,
    /// Number of steps accepted at the limit of round-off rather than at the tolerance.
    pub rounding_limited: usize,
    /// Number of steps whose equilibrium was found only by damped iterations.
    pub damped: usize,
    /// Number of steps with inertia.
    #[serde(default)]
    pub moving: usize,
    /// Number of steps with viscosity.
    #[serde(default)]
    pub viscous: usize,
    /// Number of torn domains that were replaced.
    pub replaced_domains: usize,
    /// The state before the first step, if bodies are stressed at time 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub initial_state: Option<InitialState>,
    /// Number of attempts at a step that did not reach equilibrium.
    pub failed_attempts: usize,
    /// Load factor of the last converged step, [-]; `None` unless all loads and prescribed motions share one.
    pub load_factor: Option<f64>,
    /// Load factor of largest magnitude in equilibrium, [-]; `None` unless all loads and prescribed motions share one.
    pub largest_load_factor: Option<f64>,
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
    pub exchanged_energy: f64,
    /// Work absorbed so far by the damping of damped iterations, [energy].
    pub damping_work: f64,
    /// Sum over the steps of the magnitude of the sum of external and regridding work, [energy].
    pub gross_work: f64,
    /// Stored elastic energy, [energy].
    pub strain_energy: f64,
    /// Plastic work, [energy].
    pub plastic_work: f64,
    /// Plastic work that the history variables of the laws record but that was not done, because the strength was
    /// reduced, [energy].
    pub undone_work: f64,
    /// Work dissipated so far by friction between tools and bodies, [energy].
    pub friction_work: f64,
    /// The energies that the terms report under names of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub further_energies: Vec<NamedEnergy>,
    /// The bodies that stages have placed onto others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub placed: Vec<Placed>,
    /// The probable cause for which steps far shorter than requested were cut last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cut: Option<String>,
    /// The quality of the run.
    pub quality: Quality,
    /// The warnings in the order of the steps; new ones are appended.
    pub warnings: Vec<Warning>,
    /// Time spent in each phase.
    pub timings: Timings,
    /// Processor time of all threads in the attempts of each stage that reduces the strength; a part of `timings`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub searches: BTreeMap<usize, Duration>,
}

/// Upper bound on each count of a run.
pub(super) const MAX_COUNT: usize = 1 << 48;
/// Relative round-off of a stored energy, [-].
const ROUND_OFF: f64 = 1e-13;
/// Work, relative to the energy of an initial stress, below which it is hardly more than round-off, [-].
const MIN_WORK: f64 = 1e-10;

impl Summary {
    /// True if this can be the summary of a run of this model.
    pub(super) fn fits<const D: usize>(&self, model: &Model<D>) -> bool {
        let counts = [
            self.steps,
            self.failed_attempts,
            self.evaluations,
            self.linear_solves,
            self.iterative_solves,
            self.linear_iterations,
            self.indefinite_solves,
        ];
        counts.iter().all(|count| *count < MAX_COUNT) && self.quality.fits(model.bodies.len())
    }

    /// The balances of the run.
    pub fn balance(&self) -> BalanceSoFar {
        BalanceSoFar {
            steps: self.steps,
            moving: self.moving,
            external_work: self.external_work,
            regridding_work: self.regridding_work,
            gross_work: self.gross_work,
            energy_error: self.energy_error(),
            defect: match self.gross_work.max(self.kinetic_energy()) {
                all if all > 0.0 => self.defect() / all,
                _ => 0.0,
            },
        }
    }

    /// All energies of the run so far, in the order in which the balance adds them up. The plastic work is the work
    /// that was done.
    pub fn energies(&self) -> Vec<NamedEnergy> {
        let stored = |name, energy| NamedEnergy::stored(name, [0.0, energy]);
        let mut all = vec![
            NamedEnergy::supplied("external", self.external_work),
            NamedEnergy::supplied("regridding", self.regridding_work),
            NamedEnergy::dissipated("stabilisation", self.stabilisation_work),
            NamedEnergy::dissipated("damping", self.damping_work),
            NamedEnergy::supplied("exchanged", self.exchanged_energy),
            stored("elastic", self.strain_energy),
            NamedEnergy::dissipated("plastic", self.plastic_work),
            NamedEnergy::dissipated("friction", self.friction_work),
        ];
        all.extend(self.further_energies.iter().cloned());
        all.extend(self.initial_state.iter().map(|state| NamedEnergy::supplied("initial", state.energy)));
        all
    }

    /// Energy that was supplied so far but neither stored nor dissipated, [energy].
    pub fn unexplained_energy(&self) -> f64 {
        let shares = self.energies().into_iter().map(|energy| energy.unexplained());
        shares.reduce(|sum, share| sum + share).unwrap_or(0.0)
    }

    /// The largest kinetic energy that is known of a motion with inertia, at its start or now, [energy].
    fn kinetic_energy(&self) -> f64 {
        let of_motion = self.further_energies.iter().filter(|energy| energy.name == Ledger::KINETIC);
        let amounts = of_motion.map(|energy| match energy.amount {
            Amount::State { now, start } => now.max(start),
            Amount::Accrued(energy) => energy,
        });
        amounts.fold(0.0, f64::max)
    }

    /// Work of the mean stresses of steps with inertia that was neither stored nor dissipated by the laws, [energy].
    pub fn defect(&self) -> f64 {
        let is_defect = |energy: &&NamedEnergy| energy.name == Ledger::DEFECT;
        self.further_energies.iter().filter(is_defect).map(|energy| energy.amount.value()).sum()
    }

    /// Energy that was supplied so far but neither stored nor dissipated, relative to the sum of the magnitudes of all
    /// work, [-]: the error of the trapezoidal rule, which falls with the square of the step size. Round-off in the
    /// energy of an initial stress does not count.
    pub fn energy_error(&self) -> f64 {
        let missing = self.unexplained_energy();
        let all = self.gross_work.max(self.kinetic_energy());
        if let Some(InitialState { energy, .. }) = self.initial_state {
            let counts = missing.abs() > ROUND_OFF * energy && all > MIN_WORK * energy;
            return if counts { missing / all } else { 0.0 };
        }
        if all > 0.0 { missing / all } else { 0.0 }
    }

    /// Adds the account of a converged step.
    pub(super) fn accept<const D: usize>(&mut self, report: &StepReport<D>) {
        self.steps += 1;
        self.rounding_limited += usize::from(report.rounding_limited);
        self.damped += usize::from(report.damped);
        self.moving += usize::from(report.energy.further.iter().any(|energy| energy.name == Ledger::KINETIC));
        self.viscous += usize::from(report.viscosity > 0.0);
        self.replaced_domains += report.replaced_domains.len();
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
            ref further,
        } = report.energy;
        self.add_further(further);
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

    /// Adds the energies of a step that terms report under names of their own. What they supply and the change of what
    /// they store count as work.
    fn add_further(&mut self, step: &[NamedEnergy]) {
        let before = self.further_energies.clone();
        self.further_energies = continued(std::mem::take(&mut self.further_energies), step);
        let gross = |energy: &NamedEnergy| {
            let earlier = before.iter().find(|earlier| earlier.is_same(energy));
            let start = match energy.amount {
                Amount::Accrued(_) => 0.0,
                Amount::State { start, .. } => earlier.map_or(start, |earlier| earlier.amount.value()),
            };
            (energy.role != Role::Dissipated).then(|| (energy.amount.value() - start).abs())
        };
        step.iter().filter_map(gross).for_each(|work| self.gross_work += work);
    }

    /// Adds processor time to that of the search for the factor of safety in a stage.
    pub(super) fn spend_on_search(&mut self, stage: usize, cpu: Duration) {
        let spent = self.searches.entry(stage).or_default();
        *spent = spent.saturating_add(cpu);
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
