//! A factorisation by MUMPS.

use std::ffi::CStr;

use mpm_core::linear::LinearError;
use mpm_core::ranks::Ranks;

use crate::error::{Error, check, text_at};
use crate::ffi::{self, PetscInt};
use crate::objects::{Matrix, Solver, Vector};

/// Extra working space of MUMPS for pivoting, [%]; it is doubled after each failure for lack of space.
const ROOM: PetscInt = 20;
const MAX_ROOM: PetscInt = 1280;

/// MUMPS errors for lack of working space, the need for which depends on the pivots.
const TOO_LITTLE_ROOM: [PetscInt; 7] = [-8, -9, -11, -14, -15, -17, -20];

/// MUMPS errors for lack of memory.
const OUT_OF_MEMORY: [PetscInt; 3] = [-7, -13, -19];

/// MUMPS errors for a structurally singular matrix and for a numerically singular one.
const SINGULAR: [PetscInt; 2] = [-6, -10];

/// The signs of the pivots of a factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pivots {
    /// Number of zero pivots.
    pub zero: usize,
    /// True if there are negative pivots; for an unsymmetric matrix, true if their number is odd.
    pub negative: bool,
}

/// True if PETSc can use MUMPS.
pub(super) fn has_mumps() -> Result<bool, Error> {
    // SAFETY: PETSc is running. It registers its solvers when the first matrix is created, or here.
    check(unsafe { ffi::MatInitializePackage() })?;
    let mut has = true;
    for kind in [ffi::MAT_FACTOR_LU, ffi::MAT_FACTOR_CHOLESKY] {
        let (mut found, mut for_matrix, mut function) = (0, 0, None);
        let (mumps, matrix) = (c"mumps".as_ptr(), c"mpiaij".as_ptr());
        // SAFETY: PETSc is running, and the results are local variables.
        check(unsafe {
            ffi::MatSolverTypeGet(mumps, matrix, kind, &mut found, &mut for_matrix, &mut function)
        })?;
        has &= found != 0 && for_matrix != 0;
    }
    Ok(has)
}

/// A factor, or another solver that options have chosen.
#[derive(Debug)]
pub(super) struct Factor {
    solver: Solver,
    /// The factor of MUMPS; it belongs to the solver.
    mumps: Option<ffi::Mat>,
}

// SAFETY: As for the objects that a factor consists of.
unsafe impl Send for Factor {}

impl Factor {
    /// Factorises a matrix with these values. The layout of the factor is kept for matrices of the same pattern.
    pub fn renew(
        kept: &mut Option<Factor>,
        matrix: &mut Matrix,
        values: &[f64],
        symmetric: bool,
        ranks: &Ranks,
    ) -> Result<Pivots, LinearError> {
        let mut room = ROOM;
        loop {
            matrix.set_values(values)?;
            let factor = match kept {
                Some(factor) => factor,
                None => kept.insert(Factor::new(matrix, symmetric, room)?),
            };
            factor.solver.set_matrices(matrix, matrix)?;
            factor.solver.set_up()?;
            let status = factor.status()?;
            let has_failed = factor.has_failed()?;
            if status == 0 && !has_failed {
                return factor.pivots(symmetric, ranks);
            }
            *kept = None;
            if SINGULAR.contains(&status) {
                return Err(LinearError::Singular { unknown: None });
            }
            let wants_room = TOO_LITTLE_ROOM.contains(&status);
            if !wants_room || room >= MAX_ROOM {
                let is_memory = wants_room || OUT_OF_MEMORY.contains(&status);
                return Err(match status {
                    _ if is_memory => LinearError::OutOfMemory { needed: None },
                    0 => LinearError::Singular { unknown: None },
                    _ => LinearError::Library(format!("MUMPS ends with error {status}").into()),
                });
            }
            room *= 2;
        }
    }

    fn new(matrix: &Matrix, symmetric: bool, room: PetscInt) -> Result<Self, Error> {
        let solver = Solver::new(c"preonly", c"direct_")?;
        solver.set_matrices(matrix, matrix)?;
        let pc = solver.pc()?;
        let kind: &CStr = if symmetric { c"cholesky" } else { c"lu" };
        // SAFETY: All objects exist; PETSc copies the strings.
        unsafe {
            check(ffi::PCSetType(pc, kind.as_ptr()))?;
            check(ffi::PCFactorSetMatSolverType(pc, c"mumps".as_ptr()))?;
            check(ffi::KSPSetFromOptions(solver.handle()))?;
        }
        let mumps = factor_of_mumps(pc);
        if let Some(factor) = mumps {
            // Options of MUMPS: the root on one rank, to count negative pivots (13); working space (14); counting of
            // zero pivots (24); the determinant, for its sign (33).
            for (number, value) in [(13, 1), (14, room), (24, 1), (33, PetscInt::from(!symmetric))] {
                // SAFETY: The factor is a MUMPS factor.
                check(unsafe { ffi::MatMumpsSetIcntl(factor, number, value) })?;
            }
        }
        Ok(Factor { solver, mumps })
    }

    /// The MUMPS error code.
    fn status(&self) -> Result<PetscInt, Error> {
        self.mumps.map_or(Ok(0), |factor| information(factor, 1)).map(|status| status.min(0))
    }

    fn has_failed(&self) -> Result<bool, Error> {
        let mut reason = 0;
        // SAFETY: The preconditioner exists.
        check(unsafe { ffi::PCGetFailedReason(self.solver.pc()?, &mut reason) })?;
        Ok(reason != 0)
    }

    /// The signs of the pivots. A solver other than MUMPS does not report them; they then count as positive.
    fn pivots(&self, symmetric: bool, ranks: &Ranks) -> Result<Pivots, LinearError> {
        let Some(factor) = self.mumps else { return Ok(Pivots { zero: 0, negative: false }) };
        let zero = information(factor, 28)?.max(0) as usize;
        let negative = if symmetric { information(factor, 12)? > 0 } else { determinant(factor)? < 0.0 };
        // Rank 0 knows both values.
        let known = ranks.gather_all((zero as u64, negative)).into_iter().next();
        let (zero, negative) = known.unwrap_or((zero as u64, negative));
        Ok(Pivots { zero: zero as usize, negative })
    }

    /// Solves for one right-hand side.
    pub fn solve(&self, b: &Vector, x: &mut Vector) -> Result<(), LinearError> {
        match self.solver.solve(b, x)? {
            reason if reason < 0 => Err(LinearError::Singular { unknown: None }),
            _ => Ok(()),
        }
    }
}

/// The factor that a preconditioner will compute, if it is a MUMPS factor.
fn factor_of_mumps(pc: ffi::PC) -> Option<ffi::Mat> {
    let mut factor = ffi::Mat::NULL;
    let mut name = std::ptr::null();
    // SAFETY: The preconditioner exists, and so does the factor if no call has failed; the name is a string or null.
    unsafe {
        check(ffi::PCFactorSetUpMatSolverType(pc)).ok()?;
        check(ffi::PCFactorGetMatrix(pc, &mut factor)).ok()?;
        check(ffi::MatFactorGetSolverType(factor, &mut name)).ok()?;
        (text_at(name) == "mumps").then_some(factor)
    }
}

/// An entry of INFOG.
fn information(factor: ffi::Mat, number: PetscInt) -> Result<PetscInt, Error> {
    let mut value = 0;
    // SAFETY: The factor is a MUMPS factor.
    check(unsafe { ffi::MatMumpsGetInfog(factor, number, &mut value) })?;
    Ok(value)
}

/// A number with the sign of the determinant; known only on rank 0.
fn determinant(factor: ffi::Mat) -> Result<f64, Error> {
    let mut value = 0.0;
    // SAFETY: The factor is a MUMPS factor.
    check(unsafe { ffi::MatMumpsGetRinfog(factor, 12, &mut value) })?;
    Ok(value)
}
