//! What a run tells about itself.

use serde::{Deserialize, Serialize};

use crate::basis::Connectivity;
use crate::constraints::DofMap;
use crate::linear::Factorisation;
use crate::model::Model;
use crate::points::Points;
use crate::quality::Quality;
use crate::timing::Timings;

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

    /// A step is not in equilibrium; the converged state is that before it. With a diagnosis the run ends here, otherwise a
    /// smaller step follows.
    ///
    /// # Errors
    /// Any error stops the run.
    fn failed(
        &mut self,
        _model: &Model<D>,
        _points: &Points<D>,
        _attempt: &FailedAttempt<D>,
        _diagnosis: Option<&Diagnosis>,
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
    /// Displacement increment of the active nodes, [length].
    pub delta_d: Nodal<D>,
    /// Reaction on the active nodes, zero where free, [force].
    pub reaction: Nodal<D>,
}

/// Work and energy of a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energy {
    /// Work of loads and reactions over the step, by the trapezoidal rule, [energy].
    pub external_work: f64,
    /// Stored elastic energy at the end of the step, [energy].
    pub strain_energy: f64,
}

/// What is known of an equilibrated step.
#[derive(Debug, Clone)]
pub struct StepReport<const D: usize> {
    /// The step.
    pub step: Step,
    /// Residual of every evaluation, eq. (40); the first is the one before any solve.
    pub residuals: Vec<f64>,
    /// Factorisation used in each iteration.
    pub factorisations: Vec<Factorisation>,
    /// Iterations of the linear solver in all of them, none where it is direct.
    pub linear_iterations: usize,
    /// Reaction of each boundary condition, [force].
    pub reactions: Vec<[f64; D]>,
    /// Sum of all loads on the points, [force].
    pub applied: [f64; D],
    /// Work and energy.
    pub energy: Energy,
    /// Load factor at the end of the step, where there is one for all loads and prescribed motions, [-].
    pub load_factor: Option<f64>,
    /// Number of free degrees of freedom.
    pub unknowns: usize,
    /// Number of faces that are stabilised.
    pub stabilised_faces: usize,
    /// Fields of the grid.
    pub grid: GridFields<D>,
}

/// The account of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Equilibrated steps.
    pub steps: usize,
    /// Attempts at a step that did not reach equilibrium.
    pub failed_attempts: usize,
    /// How large steps are at the moment.
    pub pace: Pace,
    /// Where the run is on its path, if its load factor is unknown.
    pub path: Path,
    /// Load factor of the last step in equilibrium, where there is one for all loads and prescribed motions, [-].
    pub load_factor: Option<f64>,
    /// Largest load factor in equilibrium, where there is one for all loads and prescribed motions, [-].
    pub largest_load_factor: Option<f64>,
    /// Why the run could not go on.
    pub diagnosis: Option<Diagnosis>,
    /// Most faces that were stabilised in a step.
    pub stabilised_faces: usize,
    /// Evaluations of internal force and stiffness, those of failed steps included.
    pub evaluations: usize,
    /// Linear solves.
    pub linear_solves: usize,
    /// Linear solves by conjugate gradients.
    pub iterative_solves: usize,
    /// Iterations of conjugate gradients.
    pub linear_iterations: usize,
    /// Linear solves whose matrix was not positive definite.
    pub indefinite_solves: usize,
    /// Most unknowns in a step.
    pub unknowns: usize,
    /// Work of loads and reactions so far, [energy].
    pub external_work: f64,
    /// Stored elastic energy, [energy].
    pub strain_energy: f64,
    /// How well the run goes.
    pub quality: Quality,
    /// What the user should know about it, in the order of the steps; observers find new ones at the end.
    pub warnings: Vec<String>,
    /// Time spent by phase.
    pub timings: Timings,
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
    pub fn nothing<const D: usize>(model: &Model<D>, points: &Points<D>) -> Reached {
        let summary = Summary { quality: Quality::new(model, points), ..Summary::default() };
        Reached { step: Step { index: 0, start: 0.0, end: 0.0 }, summary }
    }
}

impl Summary {
    pub(super) fn accept<const D: usize>(&mut self, report: &StepReport<D>) {
        self.steps += 1;
        self.stabilised_faces = self.stabilised_faces.max(report.stabilised_faces);
        self.load_factor = report.load_factor;
        if let Some(factor) = report.load_factor {
            let largest = self.largest_load_factor.map_or(factor, |largest| largest.max(factor));
            self.largest_load_factor = Some(largest);
        }
        self.unknowns = self.unknowns.max(report.unknowns);
        self.external_work += report.energy.external_work;
        self.strain_energy = report.energy.strain_energy;
        self.linear_iterations += report.linear_iterations;
        for used in &report.factorisations {
            self.iterative_solves += usize::from(*used == Factorisation::Multigrid);
            let indefinite = !matches!(used, Factorisation::Cholesky | Factorisation::Multigrid);
            self.indefinite_solves += usize::from(indefinite);
        }
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

/// Sum of the reactions of each boundary condition.
pub(super) fn named_reactions<const D: usize>(
    model: &Model<D>,
    reaction: &[[f64; D]],
    dofs: &DofMap<D>,
) -> Vec<[f64; D]> {
    let mut sums = vec![[0.0; D]; model.boundary_conditions.len()];
    for (node, force) in reaction.iter().enumerate() {
        for (axis, f) in force.iter().enumerate() {
            if let Some((_, condition)) = dofs.prescribed(node, axis) {
                sums[condition][axis] += f;
            }
        }
    }
    sums
}

/// Work over the step from the forces (loads, reactions) at its start and end, and the energy stored at its end.
pub(super) fn balance_of_energy<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    delta_d: &[[f64; D]],
    forces: [(&Nodal<D>, &Nodal<D>); 2],
) -> Energy {
    let mut external_work = 0.0;
    for (load, reaction) in forces {
        for (node, du) in delta_d.iter().enumerate() {
            for d in 0..D {
                external_work += 0.5 * (load[node][d] + reaction[node][d]) * du[d];
            }
        }
    }
    let mut strain_energy = 0.0;
    for p in 0..points.len() {
        let energy = model.law(points, p).energy(&points.trial.elastic_strain[p]);
        strain_energy += energy * points.original_volume[p];
    }
    Energy { external_work, strain_energy }
}
