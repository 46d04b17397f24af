//! What a run tells about itself.

use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::basis::Connectivity;
use crate::constraints::DofMap;
use crate::linear::Factorisation;
use crate::linear::Named;
use crate::model::Model;
use crate::points::Points;
use crate::quality::{Quality, Warning};
use crate::timing::Timings;

use super::balance::{Energy, ReactionMoment};
use super::equations::Solved;
#[cfg(doc)]
use super::residual::MOST_OF_ROUND_OFF;
use super::{Diagnosis, FailedAttempt, Nodal, Path, SolveError, Step};
use crate::stepping::Pace;

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

/// The fields of the grid in a load step.
#[derive(Debug, Clone)]
pub struct GridFields<const D: usize> {
    /// The links of the step; tells which nodes are active.
    pub links: Connectivity<D>,
    /// Number of connected parts of the active nodes.
    pub parts: usize,
    /// Displacement increment of the active nodes, [length].
    pub delta_d: Nodal<D>,
    /// Reaction on the active nodes, zero where free, [force].
    pub reaction: Nodal<D>,
}

/// What is known of an equilibrated step.
#[derive(Debug, Clone)]
pub struct StepReport<const D: usize> {
    /// The step.
    pub step: Step,
    /// Residual of every evaluation, eq. (40); the first is the one before any solve.
    pub residuals: Vec<f64>,
    /// Whether the step has been accepted as far as round-off allows, [`MOST_OF_ROUND_OFF`] at most, rather than to the
    /// tolerance.
    pub rounding_limited: bool,
    /// What is out of balance at the nodes of each body alone, relative to the forces on it; none for one body, [-].
    pub body_residuals: Vec<f64>,
    /// The largest norm of the external forces and reactions on a part of each body, in this step or before, [force].
    pub carried: Vec<f64>,
    /// Whether only damped iterations found the equilibrium.
    pub damped: bool,
    /// Permanent numbers of the points whose torn domains were replaced, ascending.
    pub replaced_domains: Vec<u32>,
    /// Factorisation used in each iteration.
    pub factorisations: Vec<Factorisation>,
    /// Iterations of the linear solver in all of them, none where it is direct.
    pub linear_iterations: usize,
    /// Reaction of each boundary condition, [force].
    pub reactions: Vec<[f64; D]>,
    /// Moment of the reaction of each boundary condition; none for bodies of revolution.
    pub moments: Option<Vec<ReactionMoment<D>>>,
    /// Resultant of each load on the points, [force].
    pub loads: Vec<[f64; D]>,
    /// Work and energy.
    pub energy: Energy,
    /// Moment of loads and reactions together, relative to all of them, [-]; none for bodies of revolution.
    pub moment_error: Option<f64>,
    /// Load factor at the end of the step, where there is one for all loads and prescribed motions, [-].
    pub load_factor: Option<f64>,
    /// Number of free degrees of freedom.
    pub unknowns: usize,
    /// Number of faces that are stabilised.
    pub stabilised_faces: usize,
    /// Fields of the grid.
    pub grid: GridFields<D>,
}

impl<const D: usize> StepReport<D> {
    /// Sum of all loads on the points, [force].
    pub fn applied(&self) -> [f64; D] {
        // The sum of no numbers would be −0.
        std::array::from_fn(|d| self.loads.iter().fold(0.0, |sum, force| sum + force[d]))
    }
}

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

/// f_int − f_ext on the prescribed degrees of freedom, zero on the free ones.
pub(super) fn reactions_of<const D: usize>(
    f_ext: &[[f64; D]],
    f_int: &[[f64; D]],
    dofs: &DofMap<D>,
) -> Nodal<D> {
    (0..f_ext.len())
        .map(|n| {
            std::array::from_fn(|d| if dofs.free(n, d).is_none() { f_int[n][d] - f_ext[n][d] } else { 0.0 })
        })
        .collect()
}

/// Sum of the reactions of each boundary condition, by [`DofMap::bearers`].
pub(super) fn named_reactions<const D: usize>(
    model: &Model<D>,
    reaction: &[[f64; D]],
    dofs: &DofMap<D>,
) -> Vec<[f64; D]> {
    let mut sums = vec![[0.0; D]; model.boundary_conditions.len()];
    for (node, force) in reaction.iter().enumerate() {
        for (axis, f) in force.iter().enumerate() {
            let conditions = dofs.bearers(model, node, axis);
            let share = f / conditions.len().max(1) as f64;
            for condition in conditions {
                sums[condition][axis] += share;
            }
        }
    }
    sums
}
