//! The memory and the time of a run on several ranks, predicted from the size of its deck without filling its bodies.
//!
//! `docs/scaling.md` derives the model and describes how its constants are measured.

use crate::build::size_of;
use crate::diagnostic::Diagnostic;
use crate::load::LoadedDeck;
use mpm_core::linear::ALGEBRAIC;

/// The measured constants of the model, for points on structured grids in the plane and in space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constants {
    /// Memory of a rank before it has points, MPI and PETSc included, [byte].
    pub rank: f64,
    /// CPU time per point and evaluation, for all work of a step except the linear solver, [s].
    pub point: f64,
    /// CPU time per unknown and iteration of the linear solver, including a share of its set-up, [s].
    pub unknown: f64,
    /// Messages that a rank waits for in an iteration of the linear solver.
    pub messages: f64,
    /// Time of a short message, [s].
    pub latency: f64,
    /// Time per byte of a long message, [s].
    pub byte: f64,
}

impl Constants {
    /// The constants of the machine that `docs/scaling.md` describes; `is_wide` is true for domains that reach into the
    /// cells around their own.
    pub fn measured(dimensions: usize, is_wide: bool) -> Self {
        let (point, unknown, messages) = match (dimensions < 3, is_wide) {
            (true, false) => (0.15e-6, 0.1e-6, 60.0),
            (true, true) => (0.2e-6, 0.3e-6, 110.0),
            (false, false) => (0.25e-6, 0.3e-6, 100.0),
            (false, true) => (0.6e-6, 1.3e-6, 290.0),
        };
        Constants { rank: 60e6, point, unknown, messages, latency: 4.5e-6, byte: 9.6e-10 }
    }
}

/// Number of evaluations per step that the prediction assumes.
pub const EVALUATIONS: f64 = 5.0;
/// Number of iterations of the linear solver per solution that the prediction assumes.
pub const ITERATIONS: f64 = 12.0;

/// A run on several ranks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plan {
    /// Number of ranks.
    pub ranks: usize,
    /// Number of points.
    pub points: f64,
    /// Number of unknowns.
    pub unknowns: f64,
    /// True if the equations are solved iteratively.
    pub is_iterative: bool,
    /// Memory of a rank, its part of the files included, [byte].
    pub memory: f64,
    /// Time of an evaluation of all points, [s].
    pub evaluation: f64,
    /// Time of a solution of the equations, [s]; `None` if they are factorised.
    pub solution: Option<f64>,
    /// Number of nodes that a rank shares with others, relative to the number of its own nodes.
    pub shared: f64,
}

impl Plan {
    /// The plan of a deck on this number of ranks.
    ///
    /// # Errors
    /// The faults that make its size unknown.
    pub fn new(loaded: &LoadedDeck, ranks: usize) -> Result<Plan, Vec<Diagnostic>> {
        let dimensions = loaded.deck.dimensions();
        let size = if dimensions == 3 { size_of::<3>(loaded)? } else { size_of::<2>(loaded)? };
        let size = if ranks > 1 { size.on_several_ranks() } else { size };
        let (n, d) = (ranks as f64, dimensions as f64);
        let constants = Constants::measured(dimensions, size.is_wide);
        // The own nodes of a rank form a cube (square), and the rank shares two layers of nodes along each axis with
        // other ranks.
        let own = size.unknowns / d / n;
        let side = own.powf(1.0 / d).max(1.0);
        let shared = if ranks == 1 { 0.0 } else { ((side + 2.0) / side).powf(d) - 1.0 };
        let part = (size.memory_of_points + size.memory_of_stiffness) / n;
        let memory = constants.rank + size.memory_of_grid + part * (1.0 + 0.5 * shared);
        let evaluation = constants.point * size.points / n
            + if ranks == 1 {
                0.0
            } else {
                6.0 * constants.latency + 16.0 * d * own * shared * constants.byte
            };
        let halo = 8.0 * d * own * shared * constants.byte;
        let reductions = n.log2().ceil() * 3.0 * constants.latency;
        let slower = if size.is_mesh { ALGEBRAIC } else { 1.0 };
        let iteration = slower * constants.unknown * size.unknowns / n
            + if ranks == 1 { 0.0 } else { constants.messages * constants.latency + 6.0 * halo + reductions };
        Ok(Plan {
            ranks,
            points: size.points,
            unknowns: size.unknowns,
            is_iterative: size.is_iterative,
            memory,
            evaluation,
            solution: size.is_iterative.then_some(ITERATIONS * iteration),
            shared,
        })
    }
}
