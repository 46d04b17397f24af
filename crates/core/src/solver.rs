//! The analysis: load steps and, within each, Newton iterations to equilibrium (sections 5 and 6.3).
//!
//! | File | Content |
//! |---|---|
//! | `stepper` | the sequence of steps |
//! | `stepping`: `pace`, `control` | the size of steps; beyond the paper: unknown load factor, prediction |
//! | `stepping`: `strength` | factors of a strength reduction, and displacements during it |
//! | `stepping`: `rest` | the end of a motion with inertia |
//! | `stepping`: `splitting` | domains that have become too long are split between steps |
//! | `refusal` | the recovery from a failed attempt |
//! | `stages`, `release` | the transition between stages: what is added and removed, and the forces that are released |
//! | `change` | the change of a model between two steps |
//! | `load_step`, `step_system` | one attempt at a step, and the equations that it sets up once |
//! | `newton` | the iterations: forces and K of an iterate, eqs. (19)-(23), (28), residual, what follows from it |
//! | `increment`, `unknowns` | δd, eqs. (26), (30); Δd, reactions and global unknowns, eq. (28) |
//! | `line_search` | the decision to accept an iterate, or to evaluate it again, in most cases after a shorter δd |
//! | `residual`: `body_residual`, `round_off` | eq. (40) for connected parts and for bodies; its round-off |
//! | `update` | motion of points and domains, section 6.4 |
//! | `equations` | choice of the linear solver, border of global unknowns |
//! | `initial_state` | equilibrium of bodies that are stressed at time 0 |
//! | `progress` | what the next step builds on and a restart restores |
//! | `conclusion` | the report on an attempt, and the commit of a converged step |
//! | `summary`, `observer` | reports on the run, and their receiver |
//! | `course` | the record of the iterations, with f^R of eq. (28); beyond the paper: inexact solves |
//! | `damping` | beyond the paper: damping |
//! | `collective` | collective decisions of the ranks of a run |
//! | `attempt`, `error`, `located` | how attempts end, also on another rank, and the point or node at fault |
//! | `diagnosis`: `evidence`, `stiffness` | why attempts fail; stiffness contrasts between materials |
//!
//! A step that fails leaves no trace in the converged state. It is retried in two halves, down to the smallest step
//! that the deck allows; only equilibrium is accepted and reported. While bodies slump, the points move on over several
//! fresh grids; if no equilibrium follows, the points are restored.

mod attempt;
mod change;
mod collective;
mod conclusion;
mod course;
mod damping;
mod diagnosis;
mod equations;
mod error;
mod experiments;
mod increment;
mod initial_state;
mod line_search;
mod load_step;
mod located;
mod newton;
mod observer;
mod placing;
mod progress;
mod refusal;
mod release;
mod residual;
mod stages;
mod step_system;
mod stepper;
mod stepping;
mod summary;
mod unknowns;
mod update;

use crate::model::Model;
use crate::points::Points;
use crate::stress::{Axisymmetric, PlaneStrain, Solid};

pub use crate::equilibrium::{
    FurtherReaction, GridFields, InitialState, NodalField, ReactionMoment, StepReport, UnbalancedNode,
};
pub use crate::step::{Experiment, Step};
pub use attempt::{FailedAttempt, Iterate};
pub use change::change_model;
pub use diagnosis::{Circumstances, Diagnosis, Finding, Kind, Loss};
pub use error::{CODES, Obstacle, RemoteError, SolveError, UndeterminedNode};
pub use observer::{Cause, Observer, Silent};
pub use placing::{Placed, added_points};
pub use progress::{Progress, Reached, StageReached};
pub use stages::{
    Change, Extension, FurtherTerms, resume_stage, run_extended, run_stages, run_stages_with_terms,
    run_with_changes,
};
pub use stepper::{Kernels, Stepper};
pub use stepping::control::{Motion, NoPath, Path, path_length};
pub use stepping::limit::{LimitLoad, StageLimit};
pub use stepping::pace::Pace;
pub use stepping::rest::StageRest;
pub use stepping::strength::{StageStrength, StrengthBracket};
pub use summary::Summary;

/// A model in a number of dimensions that the solver supports.
pub trait Solvable<const D: usize> {
    /// The solver code compiled for the mechanics of this model.
    fn kernels(&self) -> Kernels<D>;
}

// Crates that inlined the functions of these implementations would compile the solution of a step again.
impl Solvable<2> for Model<2> {
    #[inline(never)]
    fn kernels(&self) -> Kernels<2> {
        if self.revolved { Kernels::new::<Axisymmetric>() } else { Kernels::new::<PlaneStrain>() }
    }
}

impl Solvable<3> for Model<3> {
    #[inline(never)]
    fn kernels(&self) -> Kernels<3> {
        Kernels::new::<Solid>()
    }
}

/// Runs an analysis, or its current stage, from the converged state of `points` to the end and reports every event to
/// `observer`. The grid must not move between steps; [`run_stages`] moves it and begins further stages.
///
/// # Errors
/// [`SolveError`] if a step, however small, has no equilibrium, or if the run cannot go on for another reason;
/// `points.converged` is then the last equilibrated state.
pub fn run<const D: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    observer: &mut dyn Observer<D>,
) -> Result<Reached, SolveError>
where
    Model<D>: Solvable<D>,
{
    let mut stepper = Stepper::new(model, points);
    stepper.expect_fixed_grid()?;
    let started = stepper.start(observer);
    let step = stepper.kernels.step;
    let outcome = started.and_then(|()| {
        while step(&mut stepper, observer)? {}
        Ok(())
    });
    stepper.finish(outcome, observer)
}

/// Continues an analysis, or its current stage, to the end from a step that has been reached; `points` must be in the
/// state of that step.
///
/// # Errors
/// As for [`run`] and [`Stepper::resume`].
pub fn resume<const D: usize>(
    model: &Model<D>,
    points: &mut Points<D>,
    reached: Reached,
    observer: &mut dyn Observer<D>,
) -> Result<Reached, SolveError>
where
    Model<D>: Solvable<D>,
{
    Stepper::new(model, points).resume(reached)?.run(observer)
}
