//! Errors that end a run.
//!
//! The errors state facts. Advice refers to the keys of the input and is therefore written in the crate that knows
//! them.

use serde::{Deserialize, Serialize};

use crate::basis::SupportError;
use crate::counted::counted;
use crate::dofs::ConstraintError;
use crate::domain::Collapsed;
use crate::equilibrium::UnbalancedNode;
use crate::linear::LinearError;
use crate::memory::in_words;
use crate::model::GridMotionError;
use crate::points::coordinates;
use crate::step::Step;
use crate::stress::PointError;
use crate::terms::{BeginError, ContactError, LoadNotFinite, SurfaceLost, TermFailure};

use super::residual::MAX_ROUND_OFF;
use super::stepping::control::NoPath;

/// A material point, as named in an error.
#[derive(Debug, Clone, PartialEq)]
pub struct PointPlace {
    /// Name of the body.
    pub body: String,
    /// Permanent number of the point.
    pub point: u32,
    /// Position, [length].
    pub position: Vec<f64>,
}

impl std::fmt::Display for PointPlace {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "point {} of body `{}` at {}", self.point, self.body, coordinates(&self.position))
    }
}

/// A node with an unknown that nothing determines.
#[derive(Debug, Clone, PartialEq)]
pub struct UndeterminedNode {
    /// Position, [length].
    pub position: Vec<f64>,
    /// The unknown, in words.
    pub unknown: String,
}

/// The reason why a run ends early. The converged state of the points is then the state at the end of the last
/// converged step.
#[non_exhaustive]
#[derive(Debug, thiserror::Error)]
pub enum SolveError {
    /// The residual has not reached the tolerance.
    #[error(
        "step {step} is not in equilibrium after {}: residual {:.3e}, largest out-of-balance force at {}",
        counted(residuals.len().saturating_sub(1), "iteration", "iterations"), residuals.last().copied().unwrap_or(f64::NAN),
        worst_node(worst)
    )]
    NotConverged {
        /// Step number.
        step: usize,
        /// Residual of every evaluation, [-].
        residuals: Vec<f64>,
        /// The node with the largest out-of-balance force.
        worst: Option<UnbalancedNode>,
    },
    /// Round-off of the stiffness prevents equilibrium.
    #[error(
        "step {step} cannot be brought into equilibrium: round-off leaves a residual of {:.3e}, more than {MAX_ROUND_OFF:e}; \
         the largest out-of-balance force is at {}, and {materials}",
        residuals.last().copied().unwrap_or(f64::NAN), worst_node(worst)
    )]
    RoundOff {
        /// Step number.
        step: usize,
        /// Residual of every evaluation, [-].
        residuals: Vec<f64>,
        /// The node with the largest out-of-balance force.
        worst: Option<UnbalancedNode>,
        /// The materials whose stiffnesses are far apart, or far above the loads, as text.
        materials: String,
    },
    /// Bodies that are stressed at time 0 are out of balance.
    #[error(
        "the initial state is out of balance by {:.3e} of its forces (tolerance {:e}); the largest out-of-balance \
         force is at {}",
        residual,
        tolerance,
        worst_node(worst)
    )]
    InitialState {
        /// Residual of eq. (40) at time 0, [-].
        residual: f64,
        /// The tolerance, [-].
        tolerance: f64,
        /// The node with the largest out-of-balance force.
        worst: Option<UnbalancedNode>,
    },
    /// A term of equilibrium cannot be used, or cannot resume from its saved state.
    #[error("the term `{term}` cannot be used: {reason}")]
    Term {
        /// Name of the term.
        term: String,
        /// The reason.
        reason: String,
    },
    /// A term from outside this crate cannot begin the step or cannot be evaluated.
    #[error("step {step}: {failure}")]
    OwnTerm {
        /// Step number.
        step: usize,
        /// The failure.
        failure: Box<TermFailure>,
    },
    /// A point could not follow the displacement increment.
    #[error("step {step}, iteration {iteration}: {place}: {error}")]
    Point {
        /// Step number.
        step: usize,
        /// Iteration number.
        iteration: usize,
        /// The point.
        place: PointPlace,
        /// The failure.
        error: PointError,
        /// Residual of every evaluation so far, [-].
        residuals: Vec<f64>,
    },
    /// A law that is evaluated in batches has failed, or a law has no finite energy.
    #[error("step {step}: the law of material `{material}` has failed{}: {message}", at_point(place))]
    Law {
        /// Step number.
        step: usize,
        /// Name of the material.
        material: String,
        /// The point, if one is to blame.
        place: Option<PointPlace>,
        /// The reason.
        message: String,
    },
    /// A point is outside the grid.
    #[error("step {step}: {place} is outside the grid")]
    OffGrid {
        /// Step number.
        step: usize,
        /// The point.
        place: PointPlace,
    },
    /// The domain of a point permits no basis functions.
    #[error("step {step}: {place}: {error}")]
    Domain {
        /// Step number.
        step: usize,
        /// The point.
        place: PointPlace,
        /// The reason.
        error: SupportError,
    },
    /// A domain update has produced an invalid domain.
    #[error("step {step}: {place}: {error}")]
    Collapsed {
        /// Step number.
        step: usize,
        /// The point.
        place: PointPlace,
        /// The failure.
        error: Collapsed,
    },
    /// The stiffness is singular.
    #[error("step {step}: the stiffness is singular{}{}", at_node(node), free_motion(free))]
    Singular {
        /// Step number.
        step: usize,
        /// Names of the rigid tools and other moving parts, one of which nothing resists; empty if a motion of the
        /// bodies is the cause.
        free: Vec<String>,
        /// An unknown without stiffness, if known.
        node: Option<UndeterminedNode>,
    },
    /// A part of the bodies is free to move along an axis.
    #[error(
        "step {step}: no boundary condition holds the part of the bodies at node {} along {}",
        coordinates(node), ["x", "y", "z"][axis % 3]
    )]
    Unheld {
        /// Step number.
        step: usize,
        /// Position of a node of the part, [length].
        node: Vec<f64>,
        /// The axis along which the part is free to move.
        axis: usize,
    },
    /// The factorised stiffness matrix does not fit in memory.
    #[error("step {step}: the factorised stiffness matrix does not fit in memory{}", size_in_words(needed))]
    OutOfMemory {
        /// Step number.
        step: usize,
        /// Size of the factor, [byte], if known.
        needed: Option<u64>,
    },
    /// The iterative solver has failed, and the factor of the direct one does not fit in memory.
    #[error(
        "step {step}: the stiffness matrix is too large to factorise, and the iterative solver cannot solve the equations: \
         {error}"
    )]
    Iterative {
        /// Step number.
        step: usize,
        /// The failure of the iterations.
        error: LinearError,
    },
    /// No load factor meets the condition that determines it.
    #[error("step {step}: {reason}")]
    NoPath {
        /// Step number.
        step: usize,
        /// The reason.
        reason: NoPath,
    },
    /// The boundary conditions cannot be applied.
    #[error("step {step}: {error}")]
    Constraint {
        /// Step number.
        step: usize,
        /// The reason.
        error: ConstraintError,
    },
    /// A load has no finite value.
    #[error("step {step}: {error}")]
    Load {
        /// Step number.
        step: usize,
        /// The load, the point and the value.
        error: Box<LoadNotFinite>,
    },
    /// The grid cannot follow the prescribed displacements.
    #[error("step {step}: {error}")]
    GridMotion {
        /// Step number.
        step: usize,
        /// The reason.
        error: GridMotionError,
    },
    /// A surface has left the material that carries it.
    #[error("step {step}: {error}")]
    Surface {
        /// Step number.
        step: usize,
        /// The surface, the body and the position.
        error: Box<SurfaceLost>,
    },
    /// The contact between tools and bodies cannot be evaluated.
    #[error("step {step}: {error}")]
    Contact {
        /// Step number.
        step: usize,
        /// The reason.
        error: Box<ContactError>,
    },
    /// Another rank has an error.
    #[error("{0}")]
    OnRank(Box<RemoteError>),
    /// The user has stopped the run.
    #[error("interrupted before step {step}")]
    Interrupted {
        /// Number of the step that was not begun.
        step: usize,
    },
    /// Results cannot be written.
    #[error("cannot write results: {0}")]
    Output(#[source] std::io::Error),
}

/// An obstacle that no step size removes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Obstacle {
    /// Boundary conditions or ties of one node contradict each other.
    Conflict,
    /// Other conditions keep a surface from its prescribed displacement.
    Unmet,
    /// A formula has no finite value.
    NotFinite,
    /// Nodes on the axis of revolution are free to leave it.
    LooseAxis,
    /// The factorised stiffness matrix does not fit in memory.
    Memory,
}

impl From<&ConstraintError> for Obstacle {
    fn from(error: &ConstraintError) -> Self {
        match error {
            ConstraintError::Conflict { .. } | ConstraintError::Tie { .. } => Obstacle::Conflict,
            ConstraintError::Unmet { .. } => Obstacle::Unmet,
            ConstraintError::NotFinite { .. } => Obstacle::NotFinite,
            ConstraintError::LooseAxis { .. } => Obstacle::LooseAxis,
        }
    }
}

/// The codes of all errors, each with its title.
pub const CODES: &[(&str, &str)] = &[
    ("S001", "a step that does not reach equilibrium"),
    ("S002", "a point that cannot follow the deformation"),
    ("S003", "a point outside the grid"),
    ("S004", "a domain that cannot be used"),
    ("S005", "a domain that collapses"),
    ("S006", "a singular stiffness"),
    ("S007", "a part that nothing holds"),
    ("S008", "not enough memory"),
    ("S009", "boundary conditions that cannot be applied"),
    ("S010", "a load without a value"),
    ("S011", "results that cannot be written"),
    ("S012", "equations that the iterative solver cannot solve"),
    ("S013", "a path that cannot be followed"),
    ("S014", "a stiffness so large that its round-off hides the loads"),
    ("S015", "a term of the equilibrium equations that cannot be used"),
    ("S016", "a surface that has left the material"),
    ("S017", "an initial state out of balance"),
    ("S018", "a grid that cannot move as prescribed"),
    ("S019", "a law that cannot be evaluated"),
    ("S020", "contact that cannot be evaluated"),
];

fn worst_node(worst: &Option<UnbalancedNode>) -> String {
    match worst {
        Some(node) => format!("node {}: {}", coordinates(&node.position), exponents(&node.force)),
        None => "no node".to_string(),
    }
}

fn exponents(force: &[f64]) -> String {
    let numbers: Vec<String> = force.iter().map(|x| format!("{x:.3e}")).collect();
    format!("({})", numbers.join(", "))
}

fn size_in_words(needed: &Option<u64>) -> String {
    needed.map_or(String::new(), |bytes| format!(": it takes {}", in_words(bytes as f64)))
}

fn at_point(place: &Option<PointPlace>) -> String {
    place.as_ref().map_or(String::new(), |place| format!(" at {place}"))
}

fn free_motion(free: &[String]) -> String {
    let names: Vec<String> = free.iter().map(|name| format!("`{name}`")).collect();
    match &names[..] {
        [] => String::new(),
        [name] => format!(": nothing resists the motion of {name} in its free components"),
        _ => format!(": nothing resists the motion of one of {} in its free components", names.join(", ")),
    }
}

fn at_node(node: &Option<UndeterminedNode>) -> String {
    match node {
        Some(UndeterminedNode { position, unknown }) => {
            format!(": nothing determines {unknown} at node {}", coordinates(position))
        }
        None => String::new(),
    }
}

impl SolveError {
    /// The stable code, listed in [`CODES`]; `None` if the user has stopped the run.
    pub fn code(&self) -> Option<&'static str> {
        Some(match self {
            SolveError::OnRank(error) => {
                return CODES.iter().map(|(code, _)| *code).find(|code| *code == error.code);
            }
            SolveError::NotConverged { .. } => "S001",
            SolveError::Point { .. } => "S002",
            SolveError::OffGrid { .. } => "S003",
            SolveError::Domain { .. } => "S004",
            SolveError::Collapsed { .. } => "S005",
            SolveError::Singular { .. } => "S006",
            SolveError::Unheld { .. } => "S007",
            SolveError::OutOfMemory { .. } => "S008",
            SolveError::Constraint { .. } => "S009",
            SolveError::Load { .. } => "S010",
            SolveError::Surface { .. } => "S016",
            SolveError::Output(_) => "S011",
            SolveError::Iterative { .. } => "S012",
            SolveError::NoPath { .. } => "S013",
            SolveError::RoundOff { .. } => "S014",
            SolveError::Term { .. } | SolveError::OwnTerm { .. } => "S015",
            SolveError::InitialState { .. } => "S017",
            SolveError::GridMotion { .. } => "S018",
            SolveError::Law { .. } => "S019",
            SolveError::Contact { .. } => "S020",
            SolveError::Interrupted { .. } => return None,
        })
    }

    /// An error of another rank about which nothing is known yet.
    pub(super) fn elsewhere() -> SolveError {
        SolveError::OnRank(Box::default())
    }

    /// The error for results that cannot be written. It holds a copy of `failure`, because the caller still needs the
    /// original.
    pub fn output(failure: &std::io::Error) -> SolveError {
        SolveError::Output(std::io::Error::new(failure.kind(), failure.to_string()))
    }

    /// The error of a term that cannot begin a step.
    pub(super) fn begin(error: BeginError, step: Step) -> SolveError {
        let step = step.index;
        match error {
            BeginError::Load(error) => SolveError::Load { step, error },
            BeginError::Constraint(error) => SolveError::Constraint { step, error },
            BeginError::Surface(error) => SolveError::Surface { step, error },
            BeginError::Contact(error) => SolveError::Contact { step, error },
            BeginError::Term(failure) => SolveError::OwnTerm { step, failure },
        }
    }

    /// The obstacle that no step size removes; `None` for errors of other kinds.
    pub fn obstacle(&self) -> Option<Obstacle> {
        match self {
            SolveError::Constraint { error, .. } => Some(Obstacle::from(error)),
            SolveError::Load { .. } => Some(Obstacle::NotFinite),
            SolveError::OutOfMemory { .. } => Some(Obstacle::Memory),
            _ => None,
        }
    }

    /// True if a domain is torn.
    pub(super) fn is_torn(&self) -> bool {
        match self {
            SolveError::OnRank(error) => error.is_torn,
            error => matches!(error, SolveError::Domain { .. }),
        }
    }

    /// True if iterations have led to no equilibrium.
    pub(super) fn is_about_iterations(&self) -> bool {
        matches!(
            self,
            SolveError::NotConverged { .. }
                | SolveError::Point { .. }
                | SolveError::Singular { .. }
                | SolveError::Iterative { .. }
                | SolveError::OffGrid { .. }
        )
    }

    /// True if a smaller step may succeed.
    pub fn is_retryable(&self) -> bool {
        if let SolveError::Contact { error, .. } = self {
            return error.may_succeed_if_smaller();
        }
        if let SolveError::OwnTerm { failure, .. } = self {
            return failure.may_succeed_if_smaller;
        }
        if let SolveError::OnRank(error) = self {
            return error.is_retryable;
        }
        matches!(
            self,
            SolveError::NotConverged { .. }
                | SolveError::Point { .. }
                | SolveError::Collapsed { .. }
                | SolveError::Singular { .. }
                | SolveError::Iterative { .. }
                | SolveError::OffGrid { .. }
                | SolveError::Domain { .. }
                | SolveError::NoPath { reason: NoPath::NoIntersection | NoPath::Reversed, .. }
        )
    }

    /// Residuals of the failed step, [-]; empty for errors that do not record them.
    pub fn residuals(&self) -> &[f64] {
        match self {
            SolveError::NotConverged { residuals, .. }
            | SolveError::RoundOff { residuals, .. }
            | SolveError::Point { residuals, .. } => residuals,
            SolveError::OnRank(error) => &error.residuals,
            _ => &[],
        }
    }
}

/// The error of another rank, as this rank knows it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct RemoteError {
    /// Number of the rank; `None` while nothing is known about the error.
    pub rank: Option<usize>,
    /// Code of the error.
    pub code: String,
    /// The error in words.
    pub text: String,
    /// Residuals of the failed step, [-].
    pub residuals: Vec<f64>,
    /// True if a smaller step may succeed.
    pub is_retryable: bool,
    /// True if points or domains could not follow the grid.
    pub has_lost_points: bool,
    /// True if a domain is torn.
    pub is_torn: bool,
}

impl std::fmt::Display for RemoteError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.rank {
            Some(rank) => write!(f, "rank {rank}: {}", self.text),
            None => f.write_str(&self.text),
        }
    }
}
