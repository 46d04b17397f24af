//! PETSc matrices, vectors and solvers as owned values. All ranks create, use and drop them together.

use std::ffi::{CStr, c_int, c_void};
use std::ptr::null;

use crate::error::{Error, check};
use crate::ffi::{self, PetscInt};
use crate::session::is_running;

/// Converts a count to a PETSc index.
///
/// # Errors
/// [`Error::Petsc`] if it is too large.
pub(crate) fn index(n: usize) -> Result<PetscInt, Error> {
    PetscInt::try_from(n).map_err(|_| Error::Petsc {
        code: ffi::PETSC_ERR_USER,
        message: format!("{n} unknowns need a PETSc library with 64-bit indices"),
    })
}

/// A vector that is distributed over the ranks.
#[derive(Debug)]
pub(crate) struct Vector(ffi::Vec_);

// SAFETY: PETSc objects belong to no thread; only one thread at a time uses them, as the caller owns them.
unsafe impl Send for Vector {}

impl Vector {
    /// A vector with `own` numbers on this rank, in blocks of `block` numbers.
    pub fn new(own: usize, block: usize) -> Result<Self, Error> {
        let mut vector = ffi::Vec_::NULL;
        // SAFETY: PETSc is running, and the pointer refers to a local variable.
        unsafe {
            let world = ffi::MPI_COMM_WORLD();
            check(ffi::VecCreateMPI(world, index(own)?, ffi::PETSC_DETERMINE, &mut vector))?;
            check(ffi::VecSetBlockSize(vector, index(block)?))?;
        }
        Ok(Vector(vector))
    }

    pub fn handle(&self) -> ffi::Vec_ {
        self.0
    }

    /// Calls `work` with the `own` numbers of this rank.
    pub fn with<T>(&mut self, own: usize, work: impl FnOnce(&mut [f64]) -> T) -> Result<T, Error> {
        // SAFETY: The vector holds `own` numbers on this rank, and is borrowed exclusively.
        unsafe { with_numbers(self.0, own, work) }
    }
}

/// Calls `work` with the numbers of a vector on this rank, which it may change.
///
/// # Safety
/// The vector must exist, hold `own` numbers on this rank, and be used by nobody else.
pub(crate) unsafe fn with_numbers<T>(
    vector: ffi::Vec_,
    own: usize,
    work: impl FnOnce(&mut [f64]) -> T,
) -> Result<T, Error> {
    let mut numbers = std::ptr::null_mut();
    // SAFETY: The caller guarantees that the vector exists.
    check(unsafe { ffi::VecGetArray(vector, &mut numbers) })?;
    // A vector without numbers on this rank may have a null pointer.
    let found = if own == 0 || numbers.is_null() {
        work(&mut [])
    } else {
        // SAFETY: There are `own` numbers until the vector takes them back.
        work(unsafe { std::slice::from_raw_parts_mut(numbers, own) })
    };
    // SAFETY: The pointer is the one that the vector returned.
    check(unsafe { ffi::VecRestoreArray(vector, &mut numbers) })?;
    Ok(found)
}

/// Calls `work` with the numbers of a vector on this rank, for reading only.
///
/// # Safety
/// The vector must exist, hold `own` numbers on this rank, and not be written meanwhile.
pub(crate) unsafe fn read_numbers<T>(
    vector: ffi::Vec_,
    own: usize,
    work: impl FnOnce(&[f64]) -> T,
) -> Result<T, Error> {
    let mut numbers = null();
    // SAFETY: The caller guarantees that the vector exists.
    check(unsafe { ffi::VecGetArrayRead(vector, &mut numbers) })?;
    let found = if own == 0 || numbers.is_null() {
        work(&[])
    } else {
        // SAFETY: There are `own` numbers until the vector takes them back.
        work(unsafe { std::slice::from_raw_parts(numbers, own) })
    };
    // SAFETY: The pointer is the one that the vector returned.
    check(unsafe { ffi::VecRestoreArrayRead(vector, &mut numbers) })?;
    Ok(found)
}

impl Drop for Vector {
    fn drop(&mut self) {
        if is_running() {
            // SAFETY: The vector is owned.
            unsafe { ffi::VecDestroy(&mut self.0) };
        }
    }
}

/// A square matrix that is distributed over the ranks by rows.
#[derive(Debug)]
pub(crate) struct Matrix(ffi::Mat);

// SAFETY: As for vectors.
unsafe impl Send for Matrix {}

impl Matrix {
    /// A sparse matrix with `own` rows on this rank, in blocks of `block` rows, from the rows and columns of entries on
    /// any rank. Entries at the same position are added up.
    pub fn sparse(
        own: usize,
        block: usize,
        mut rows: Vec<PetscInt>,
        mut columns: Vec<PetscInt>,
    ) -> Result<Self, Error> {
        assert_eq!(rows.len(), columns.len(), "each entry has a row and a column");
        let mut matrix = Matrix(ffi::Mat::NULL);
        let own = index(own)?;
        let all = ffi::PETSC_DETERMINE;
        // SAFETY: PETSc is running; it may change the two lists, which have the stated length, during the call only.
        unsafe {
            check(ffi::MatCreate(ffi::MPI_COMM_WORLD(), &mut matrix.0))?;
            check(ffi::MatSetSizes(matrix.0, own, own, all, all))?;
            check(ffi::MatSetType(matrix.0, c"mpiaij".as_ptr()))?;
            check(ffi::MatSetBlockSize(matrix.0, index(block)?))?;
            let n = rows.len() as ffi::PetscCount;
            check(ffi::MatSetPreallocationCOO(matrix.0, n, rows.as_mut_ptr(), columns.as_mut_ptr()))?;
        }
        Ok(matrix)
    }

    /// A matrix known only through its product with a vector; see [`Matrix::set_context`].
    pub fn shell(own: usize, block: usize, product: ffi::MatMultiply) -> Result<Self, Error> {
        let mut matrix = Matrix(ffi::Mat::NULL);
        let own = index(own)?;
        let all = ffi::PETSC_DETERMINE;
        let context = std::ptr::null_mut();
        // SAFETY: PETSc calls functions of all kinds through pointers of one type; it calls this one with the arguments
        // of a product.
        unsafe {
            let product = std::mem::transmute::<ffi::MatMultiply, unsafe extern "C" fn()>(product);
            let world = ffi::MPI_COMM_WORLD();
            check(ffi::MatCreateShell(world, own, own, all, all, context, &mut matrix.0))?;
            check(ffi::MatShellSetOperation(matrix.0, ffi::MATOP_MULT, Some(product)))?;
            check(ffi::MatSetBlockSize(matrix.0, index(block)?))?;
        }
        Ok(matrix)
    }

    /// Sets the context that the product receives. The pointer must be valid whenever the matrix is used.
    pub fn set_context(&self, context: *mut c_void) -> Result<(), Error> {
        // SAFETY: The matrix exists; the pointer is only stored.
        check(unsafe { ffi::MatShellSetContext(self.0, context) })
    }

    /// States that the matrix is symmetric, or that its pattern is.
    pub fn set_symmetric(&self, symmetric: bool) -> Result<(), Error> {
        let also = [ffi::MAT_SYMMETRIC, ffi::MAT_SYMMETRY_ETERNAL];
        let pattern = [ffi::MAT_STRUCTURALLY_SYMMETRIC, ffi::MAT_STRUCTURAL_SYMMETRY_ETERNAL];
        for option in pattern.iter().chain(also.iter().filter(|_| symmetric)) {
            // SAFETY: The matrix exists.
            check(unsafe { ffi::MatSetOption(self.0, *option, ffi::PETSC_TRUE) })?;
        }
        Ok(())
    }

    /// Sets the near-null space to the rigid-body motions of the own nodes, which are at these positions.
    pub fn set_near_rigid_motions<const D: usize>(
        &self,
        positions: impl Iterator<Item = [f64; D]>,
    ) -> Result<(), Error> {
        let positions: Vec<f64> = positions.flatten().collect();
        let mut coordinates = Vector::new(positions.len(), D)?;
        coordinates.with(positions.len(), |numbers| numbers.copy_from_slice(&positions))?;
        let mut space = ffi::MatNullSpace::NULL;
        // SAFETY: All objects exist; the matrix counts its references to the space.
        unsafe {
            check(ffi::MatNullSpaceCreateRigidBody(coordinates.0, &mut space))?;
            check(ffi::MatSetNearNullSpace(self.0, space))?;
            check(ffi::MatNullSpaceDestroy(&mut space))
        }
    }

    /// Sets the values of the entries, in the order in which their positions were given.
    pub fn set_values(&mut self, values: &[f64]) -> Result<(), Error> {
        // SAFETY: The caller gives one value for each position.
        check(unsafe { ffi::MatSetValuesCOO(self.0, values.as_ptr(), ffi::INSERT_VALUES) })
    }

    /// `y = A x`.
    pub fn multiply(&self, x: &Vector, y: &mut Vector) -> Result<(), Error> {
        // SAFETY: All three objects exist.
        check(unsafe { ffi::MatMult(self.0, x.handle(), y.handle()) })
    }
}

impl Drop for Matrix {
    fn drop(&mut self) {
        if is_running() {
            // SAFETY: The matrix is owned.
            unsafe { ffi::MatDestroy(&mut self.0) };
        }
    }
}

/// A linear solver with its preconditioner.
#[derive(Debug)]
pub(crate) struct Solver(ffi::KSP);

// SAFETY: As for vectors.
unsafe impl Send for Solver {}

impl Solver {
    /// A solver of this type; its options start with `prefix`.
    pub fn new(kind: &CStr, prefix: &CStr) -> Result<Self, Error> {
        let mut solver = Solver(ffi::KSP::NULL);
        // SAFETY: PETSc is running and copies the strings.
        unsafe {
            check(ffi::KSPCreate(ffi::MPI_COMM_WORLD(), &mut solver.0))?;
            check(ffi::KSPSetOptionsPrefix(solver.0, prefix.as_ptr()))?;
            check(ffi::KSPSetType(solver.0, kind.as_ptr()))?;
        }
        Ok(solver)
    }

    pub fn handle(&self) -> ffi::KSP {
        self.0
    }

    /// The preconditioner.
    pub fn pc(&self) -> Result<ffi::PC, Error> {
        let mut pc = ffi::PC::NULL;
        // SAFETY: The solver exists.
        check(unsafe { ffi::KSPGetPC(self.0, &mut pc) })?;
        Ok(pc)
    }

    /// Sets the matrix, and the matrix from which the preconditioner is formed.
    pub fn set_matrices(&self, matrix: &Matrix, preconditioner: &Matrix) -> Result<(), Error> {
        // SAFETY: All three objects exist.
        check(unsafe { ffi::KSPSetOperators(self.0, matrix.0, preconditioner.0) })
    }

    /// Sets up the preconditioner.
    pub fn set_up(&self) -> Result<(), Error> {
        // SAFETY: The solver exists.
        check(unsafe { ffi::KSPSetUp(self.0) })
    }

    /// Solves A x = b; returns the reason why the solver ended, negative if it failed.
    pub fn solve(&self, b: &Vector, x: &mut Vector) -> Result<c_int, Error> {
        let mut reason = 0;
        // SAFETY: All three objects exist.
        unsafe {
            check(ffi::KSPSolve(self.0, b.handle(), x.handle()))?;
            check(ffi::KSPGetConvergedReason(self.0, &mut reason))?;
        }
        Ok(reason)
    }
}

impl Drop for Solver {
    fn drop(&mut self) {
        if is_running() {
            // SAFETY: The solver is owned.
            unsafe { ffi::KSPDestroy(&mut self.0) };
        }
    }
}
