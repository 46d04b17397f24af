//! Conjugate gradients and GMRES, which share one preconditioner.

use std::ffi::c_int;
use std::ptr::null_mut;

use mpm_core::linear::LinearError;

use crate::error::{Error, check};
use crate::ffi::{self, PetscInt};
use crate::objects::{Matrix, Solver, Vector};

use super::shell::Context;

/// Largest number of iterations of either method, unless an option sets another limit.
const MAX_ITERATIONS: PetscInt = 300;

/// Number of directions after which GMRES restarts, which bounds the memory.
const RESTART: PetscInt = 40;

/// Residuals above this multiple of the right-hand side end the iterations.
const DIVERGED: f64 = 1e30;

/// How the iterations ended.
pub(super) enum Outcome {
    Converged {
        iterations: usize,
    },
    /// A direction, or the preconditioner, has shown that the matrix is not positive definite.
    Indefinite {
        iterations: usize,
    },
    Failed {
        iterations: usize,
        residual: f64,
    },
}

/// Conjugate gradients and GMRES.
#[derive(Debug)]
pub(super) struct Solvers {
    conjugate: Solver,
    general: Solver,
    /// True if the caller provides the preconditioner.
    is_shell: bool,
}

impl Solvers {
    /// The methods with the multigrid of PETSc for an assembled matrix, or with the preconditioner of the caller.
    pub fn new(
        operator: &Matrix,
        assembled: Option<&Matrix>,
        apply: Option<ffi::PCApply>,
    ) -> Result<Self, Error> {
        let conjugate = Solver::new(c"cg", c"")?;
        let general = Solver::new(c"gmres", c"")?;
        let is_shell = assembled.is_none();
        let pc = conjugate.pc()?;
        // SAFETY: All objects exist; both solvers count their references to the preconditioner.
        unsafe {
            check(ffi::PCSetType(pc, if is_shell { c"shell" } else { c"gamg" }.as_ptr()))?;
            // The smoothers must not see a later matrix than the one for which they were set up.
            check(ffi::PCSetUseAmat(pc, ffi::PETSC_FALSE))?;
            if is_shell {
                check(ffi::PCShellSetApply(pc, apply))?;
            }
            check(ffi::KSPSetPC(general.handle(), pc))?;
            check(ffi::KSPSetPCSide(conjugate.handle(), ffi::PC_LEFT))?;
            check(ffi::KSPSetPCSide(general.handle(), ffi::PC_RIGHT))?;
            check(ffi::KSPGMRESSetRestart(general.handle(), RESTART))?;
        }
        for solver in [&conjugate, &general] {
            solver.set_matrices(operator, assembled.unwrap_or(operator))?;
            let (keep, ksp) = (ffi::PETSC_DEFAULT_REAL, solver.handle());
            // SAFETY: The solver exists.
            unsafe {
                check(ffi::KSPSetNormType(ksp, ffi::KSP_NORM_UNPRECONDITIONED))?;
                check(ffi::KSPSetTolerances(ksp, keep, 0.0, DIVERGED, MAX_ITERATIONS))?;
                check(ffi::KSPSetFromOptions(ksp))?;
            }
        }
        Ok(Solvers { conjugate, general, is_shell })
    }

    /// Sets up the multigrid of PETSc for the values of an assembled matrix.
    pub fn set_up(&self, operator: &Matrix, assembled: &Matrix) -> Result<(), LinearError> {
        self.conjugate.set_matrices(operator, assembled)?;
        self.general.set_matrices(operator, assembled)?;
        self.conjugate.set_up()?;
        let mut reason = 0;
        // SAFETY: The preconditioner exists.
        check(unsafe { ffi::PCGetFailedReason(self.conjugate.pc()?, &mut reason) })?;
        if reason == 0 { Ok(()) } else { Err(LinearError::Singular { unknown: None }) }
    }

    /// Solves with one of the methods; `b` is the right-hand side and `x` the solution.
    pub fn solve<const D: usize, const N: usize>(
        &mut self,
        use_conjugate: bool,
        operator: &Matrix,
        context: &mut Context<D, N>,
        b: &Vector,
        x: &mut Vector,
        tolerance: f64,
    ) -> Result<Outcome, LinearError> {
        let solver = if use_conjugate { &self.conjugate } else { &self.general };
        let ksp = solver.handle();
        let (keep, keep_most) = (ffi::PETSC_DEFAULT_REAL, ffi::PETSC_DEFAULT);
        // SAFETY: The solver exists.
        check(unsafe { ffi::KSPSetTolerances(ksp, tolerance, keep, keep, keep_most) })?;
        let outcome = self.with_context(operator, context, || solver.solve(b, x));
        context.raise()?;
        let reason = outcome?;
        let (mut iterations, mut residual) = (0, 0.0);
        // SAFETY: The solver exists.
        unsafe {
            check(ffi::KSPGetIterationNumber(ksp, &mut iterations))?;
            check(ffi::KSPGetResidualNorm(ksp, &mut residual))?;
        }
        let iterations = iterations.max(0) as usize;
        match reason {
            1.. => Ok(Outcome::Converged { iterations }),
            ffi::KSP_DIVERGED_INDEFINITE_MAT | ffi::KSP_DIVERGED_INDEFINITE_PC => {
                Ok(Outcome::Indefinite { iterations })
            }
            ffi::KSP_DIVERGED_PC_FAILED => Err(LinearError::Singular { unknown: None }),
            _ => Ok(Outcome::Failed { iterations, residual }),
        }
    }

    /// Runs a solver with a context that its callbacks can reach.
    fn with_context<const D: usize, const N: usize>(
        &self,
        operator: &Matrix,
        context: &mut Context<D, N>,
        run: impl FnOnce() -> Result<c_int, Error>,
    ) -> Result<c_int, Error> {
        let pointer = (&raw mut *context).cast();
        operator.set_context(pointer)?;
        let pc = self.conjugate.pc()?;
        if self.is_shell {
            // SAFETY: The pointer is valid until it is taken back below, before the borrow ends.
            check(unsafe { ffi::PCShellSetContext(pc, pointer) })?;
        }
        let outcome = run();
        operator.set_context(null_mut())?;
        if self.is_shell {
            // SAFETY: The preconditioner exists.
            check(unsafe { ffi::PCShellSetContext(pc, null_mut()) })?;
        }
        outcome
    }
}
