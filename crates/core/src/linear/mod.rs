//! Sparse linear systems: backends that solve the equations of a load step, and the solvers on which they are built.

mod backend;
mod blocks;
#[cfg(test)]
mod bodies;
mod choice;
mod direct;
mod direct_backend;
mod divided;
mod gathered;
mod krylov;
mod lattice;
mod ldlt;
mod multifrontal;
mod multigrid;
mod numbering;
pub mod ordering;
mod pivoted_lu;
mod preconditioner;
mod reduction;
mod symmetric_part;

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::counted::counted;

pub use backend::{Backend, Backends, Engine, Engines, Layout, Solved, Stiffness};
pub use blocks::{Block, BlockMatrix, Division};
pub use choice::{ALGEBRAIC, Choice, Extent};
pub use direct::Direct;
pub use direct_backend::{DirectBackend, FreeEntries};
pub use divided::Divided;
pub use gathered::Gathered;
pub use krylov::Krylov;
pub use numbering::Numbering;
pub use preconditioner::Preconditioner;

/// Pattern of a sparse square matrix by columns; for a symmetric matrix, only the lower triangle including the
/// diagonal.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Pattern {
    /// Number of unknowns.
    pub n: usize,
    /// Start of each column in `row`; `n + 1` entries.
    pub column_start: Vec<usize>,
    /// Row of each entry, ascending within a column.
    pub row: Vec<usize>,
    /// True if only the lower triangle is given.
    pub symmetric: bool,
}

impl Pattern {
    /// The pattern in the form that `faer` requires.
    fn view(&self) -> faer::sparse::SymbolicSparseColMatRef<'_, usize> {
        faer::sparse::SymbolicSparseColMatRef::new_checked(
            self.n,
            self.n,
            &self.column_start,
            None,
            &self.row,
        )
    }
}

/// The kind of factorisation that solved a system.
#[non_exhaustive]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Factorisation {
    /// LLᵀ: the matrix is positive definite.
    Cholesky,
    /// LDLᵀ: the matrix is symmetric but not positive definite.
    Ldlt,
    /// LU of an unsymmetric matrix, with positive pivots only.
    Lu,
    /// LU with a negative pivot or with pivoting; it also serves symmetric matrices that LDLᵀ cannot solve.
    LuIndefinite,
    /// No factorisation: conjugate gradients with a multigrid preconditioner, for a symmetric matrix that has shown no
    /// negative curvature.
    Multigrid,
    /// No factorisation: generalised minimal residuals with a multigrid preconditioner, for an unsymmetric matrix whose
    /// symmetric part has shown no negative curvature.
    MultigridUnsymmetric,
    /// No factorisation: generalised minimal residuals with a multigrid preconditioner, for a symmetric matrix that is
    /// not positive definite.
    MultigridIndefinite,
    /// No factorisation: generalised minimal residuals with a multigrid preconditioner, for an unsymmetric matrix whose
    /// symmetric part is not positive definite.
    MultigridIndefiniteUnsymmetric,
}

impl Factorisation {
    /// True if the matrix was positive definite. An unsymmetric matrix counts as positive definite if all pivots of its
    /// LU are positive (which holds if its symmetric part is positive definite), or if the set-up of the multigrid
    /// preconditioner has found no negative curvature of its symmetric part.
    pub fn is_definite(self) -> bool {
        use Factorisation::{Cholesky, Lu, Multigrid, MultigridUnsymmetric};
        matches!(self, Cholesky | Lu | Multigrid | MultigridUnsymmetric)
    }

    /// True if the matrix shows that an equilibrium of this nature is unstable.
    pub fn shows_instability(self, nature: Nature) -> bool {
        use Factorisation::{Ldlt, MultigridIndefinite};
        match nature {
            Nature::Potential => !self.is_definite(),
            Nature::NoPotential => matches!(self, Ldlt | MultigridIndefinite),
            Nature::SaddlePoint => false,
        }
    }

    /// True if nothing was factorised.
    pub fn is_iterative(self) -> bool {
        use Factorisation::{Cholesky, Ldlt, Lu, LuIndefinite};
        !matches!(self, Cholesky | Ldlt | Lu | LuIndefinite)
    }
}

/// The nature of an equilibrium, which decides what an indefinite matrix says about its stability.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Nature {
    /// All forces derive from a potential, at least approximately: an indefinite matrix shows an instability.
    Potential,
    /// Some forces, such as friction, have no potential. The signs of the pivots of an unsymmetric matrix depend on the
    /// order of the unknowns, so that only an indefinite symmetric matrix shows an instability.
    NoPotential,
    /// Unknowns are multipliers of constraints on others: the matrix of a saddle point is indefinite by nature.
    SaddlePoint,
}

/// The size of a factor.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FactorSize {
    /// Entries of L, or of L and U.
    pub entries: usize,
    /// Number of additions and multiplications of the factorisation, to leading order.
    pub operations: f64,
}

/// A linear system could not be solved.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, thiserror::Error)]
pub enum LinearError {
    /// The matrix is singular to working precision.
    #[error("the matrix is singular")]
    Singular {
        /// An unknown involved in the singular motion, if one can be identified.
        unknown: Option<usize>,
    },
    /// The matrix is regular, but a global unknown remains undetermined.
    #[error("a global unknown is undetermined")]
    Undetermined,
    /// The factor does not fit in memory.
    #[error("out of memory")]
    OutOfMemory {
        /// Memory needed, [byte], if known.
        needed: Option<u64>,
    },
    /// The iterative solver was requested, but nodes are held along directions other than the axes, or are tied, and
    /// there is no algebraic multigrid.
    #[error("some nodes are held along directions other than the axes, or tied to others")]
    Turned,
    /// The iterative solver was requested, but the grid is a mesh and there is no algebraic multigrid.
    #[error("the grid is a mesh, for which multigrid is available only on several ranks, through PETSc")]
    Unstructured,
    /// The matrix, or its pattern, lacks the symmetry that the solver needs.
    #[error("the matrix is not symmetric")]
    Unsymmetric,
    /// An iterative solver has not reached its tolerance.
    #[error(
        "a relative residual of {residual:.1e} remains after {}", counted(*iterations, "iteration", "iterations")
    )]
    NotConverged {
        /// Number of iterations.
        iterations: usize,
        /// Norm of the residual relative to the right-hand side.
        residual: f64,
    },
    /// A library outside this crate has failed in another way.
    #[error("the library that solves the equations has failed: {0}")]
    Library(Cow<'static, str>),
}
