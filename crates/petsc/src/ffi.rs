//! Declarations of MPI and PETSc functions, as in the headers of Open MPI 4, MPICH 4 and PETSc 3.18.
#![allow(non_camel_case_types, non_snake_case, clippy::upper_case_acronyms, reason = "names of C")]

use std::ffi::{c_char, c_int, c_void};

pub use handles::*;

/// Handles of Open MPI: pointers to library objects.
#[cfg(open_mpi)]
mod handles {
    use std::ffi::c_void;

    pub type MPI_Comm = *mut c_void;
    pub type MPI_Datatype = *mut c_void;
    pub type MPI_Request = *mut c_void;

    /// A library object of which only the address matters.
    #[repr(C)]
    pub struct Object {
        _private: [u8; 0],
    }

    unsafe extern "C" {
        static ompi_mpi_comm_world: Object;
        static ompi_mpi_byte: Object;
    }

    pub fn MPI_COMM_WORLD() -> MPI_Comm {
        (&raw const ompi_mpi_comm_world).cast_mut().cast()
    }

    pub fn MPI_BYTE() -> MPI_Datatype {
        (&raw const ompi_mpi_byte).cast_mut().cast()
    }

    pub const NO_REQUEST: MPI_Request = std::ptr::null_mut();
    pub const MPI_STATUSES_IGNORE: *mut c_void = std::ptr::null_mut();
}

/// Handles of MPICH and its relatives: integers.
#[cfg(not(open_mpi))]
mod handles {
    use std::ffi::{c_int, c_void};

    pub type MPI_Comm = c_int;
    pub type MPI_Datatype = c_int;
    pub type MPI_Request = c_int;

    pub fn MPI_COMM_WORLD() -> MPI_Comm {
        0x4400_0000
    }

    pub fn MPI_BYTE() -> MPI_Datatype {
        0x4c00_010d
    }

    pub const NO_REQUEST: MPI_Request = 0x2c00_0000;
    pub const MPI_STATUSES_IGNORE: *mut c_void = std::ptr::without_provenance_mut(1);
}

pub const MPI_THREAD_SERIALIZED: c_int = 2;

unsafe extern "C" {
    pub fn MPI_Init_thread(
        argc: *mut c_int,
        argv: *mut *mut *mut c_char,
        required: c_int,
        provided: *mut c_int,
    ) -> c_int;
    pub fn MPI_Initialized(flag: *mut c_int) -> c_int;
    pub fn MPI_Query_thread(provided: *mut c_int) -> c_int;
    pub fn MPI_Finalized(flag: *mut c_int) -> c_int;
    pub fn MPI_Finalize() -> c_int;
    pub fn MPI_Abort(comm: MPI_Comm, code: c_int) -> c_int;
    pub fn MPI_Get_library_version(version: *mut c_char, length: *mut c_int) -> c_int;
    pub fn MPI_Comm_dup(comm: MPI_Comm, new: *mut MPI_Comm) -> c_int;
    pub fn MPI_Comm_rank(comm: MPI_Comm, rank: *mut c_int) -> c_int;
    pub fn MPI_Comm_size(comm: MPI_Comm, size: *mut c_int) -> c_int;
    pub fn MPI_Allgather(
        send: *const c_void,
        send_count: c_int,
        send_type: MPI_Datatype,
        receive: *mut c_void,
        receive_count: c_int,
        receive_type: MPI_Datatype,
        comm: MPI_Comm,
    ) -> c_int;
    pub fn MPI_Allgatherv(
        send: *const c_void,
        send_count: c_int,
        send_type: MPI_Datatype,
        receive: *mut c_void,
        receive_counts: *const c_int,
        displacements: *const c_int,
        receive_type: MPI_Datatype,
        comm: MPI_Comm,
    ) -> c_int;
    pub fn MPI_Alltoall(
        send: *const c_void,
        send_count: c_int,
        send_type: MPI_Datatype,
        receive: *mut c_void,
        receive_count: c_int,
        receive_type: MPI_Datatype,
        comm: MPI_Comm,
    ) -> c_int;
    pub fn MPI_Bcast(
        buffer: *mut c_void,
        count: c_int,
        datatype: MPI_Datatype,
        root: c_int,
        comm: MPI_Comm,
    ) -> c_int;
    pub fn MPI_Isend(
        buffer: *const c_void,
        count: c_int,
        datatype: MPI_Datatype,
        to: c_int,
        tag: c_int,
        comm: MPI_Comm,
        request: *mut MPI_Request,
    ) -> c_int;
    pub fn MPI_Irecv(
        buffer: *mut c_void,
        count: c_int,
        datatype: MPI_Datatype,
        from: c_int,
        tag: c_int,
        comm: MPI_Comm,
        request: *mut MPI_Request,
    ) -> c_int;
    pub fn MPI_Waitall(count: c_int, requests: *mut MPI_Request, statuses: *mut c_void) -> c_int;
}

#[cfg(wide_indices)]
pub type PetscInt = i64;
#[cfg(not(wide_indices))]
pub type PetscInt = i32;

pub type PetscCount = isize;
pub type PetscErrorCode = c_int;
/// A C enumeration with the values 0 and 1.
pub type PetscBool = c_int;

macro_rules! handles {
    ($($name:ident),*) => {$(
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        #[repr(transparent)]
        pub struct $name(pub *mut c_void);

        impl $name {
            pub const NULL: Self = Self(std::ptr::null_mut());
        }
    )*};
}
handles!(Mat, Vec_, KSP, PC, MatNullSpace);

pub const PETSC_FALSE: PetscBool = 0;
pub const PETSC_TRUE: PetscBool = 1;
pub const PETSC_DETERMINE: PetscInt = -1;
pub const PETSC_DEFAULT: PetscInt = -2;
pub const PETSC_DEFAULT_REAL: f64 = -2.0;
pub const PETSC_ERR_MEM: PetscErrorCode = 55;
pub const PETSC_ERR_USER: PetscErrorCode = 83;
pub const PETSC_ERR_MAT_LU_ZRPVT: PetscErrorCode = 71;
pub const PETSC_ERR_MAT_CH_ZRPVT: PetscErrorCode = 81;
pub const PETSC_ERROR_INITIAL: c_int = 0;
pub const INSERT_VALUES: c_int = 1;
pub const MAT_FACTOR_LU: c_int = 1;
pub const MAT_FACTOR_CHOLESKY: c_int = 2;
pub const MAT_SYMMETRIC: c_int = 1;
pub const MAT_STRUCTURALLY_SYMMETRIC: c_int = 2;
pub const MAT_SYMMETRY_ETERNAL: c_int = 10;
pub const MAT_STRUCTURAL_SYMMETRY_ETERNAL: c_int = 25;
pub const MATOP_MULT: c_int = 3;
pub const KSP_NORM_UNPRECONDITIONED: c_int = 2;
pub const PC_LEFT: c_int = 0;
pub const PC_RIGHT: c_int = 1;
pub const KSP_DIVERGED_INDEFINITE_PC: c_int = -8;
pub const KSP_DIVERGED_INDEFINITE_MAT: c_int = -10;
pub const KSP_DIVERGED_PC_FAILED: c_int = -11;

pub type ErrorHandler = unsafe extern "C" fn(
    comm: MPI_Comm,
    line: c_int,
    function: *const c_char,
    file: *const c_char,
    code: PetscErrorCode,
    kind: c_int,
    message: *const c_char,
    context: *mut c_void,
) -> PetscErrorCode;
pub type MatMultiply = unsafe extern "C" fn(matrix: Mat, x: Vec_, y: Vec_) -> PetscErrorCode;
pub type PCApply = unsafe extern "C" fn(pc: PC, x: Vec_, y: Vec_) -> PetscErrorCode;

unsafe extern "C" {
    pub fn PetscInitialize(
        argc: *mut c_int,
        argv: *mut *mut *mut c_char,
        file: *const c_char,
        help: *const c_char,
    ) -> PetscErrorCode;
    pub fn PetscFinalize() -> PetscErrorCode;
    pub fn PetscOptionsSetValue(
        options: *mut c_void,
        name: *const c_char,
        value: *const c_char,
    ) -> PetscErrorCode;
    pub fn PetscPushErrorHandler(handler: Option<ErrorHandler>, context: *mut c_void) -> PetscErrorCode;
    pub fn PetscGetVersionNumber(
        major: *mut PetscInt,
        minor: *mut PetscInt,
        subminor: *mut PetscInt,
        release: *mut PetscInt,
    ) -> PetscErrorCode;

    pub fn VecCreateMPI(comm: MPI_Comm, own: PetscInt, all: PetscInt, vector: *mut Vec_) -> PetscErrorCode;
    pub fn VecSetBlockSize(vector: Vec_, size: PetscInt) -> PetscErrorCode;
    pub fn VecDestroy(vector: *mut Vec_) -> PetscErrorCode;
    pub fn VecGetArray(vector: Vec_, numbers: *mut *mut f64) -> PetscErrorCode;
    pub fn VecRestoreArray(vector: Vec_, numbers: *mut *mut f64) -> PetscErrorCode;
    pub fn VecGetArrayRead(vector: Vec_, numbers: *mut *const f64) -> PetscErrorCode;
    pub fn VecRestoreArrayRead(vector: Vec_, numbers: *mut *const f64) -> PetscErrorCode;

    pub fn MatInitializePackage() -> PetscErrorCode;
    pub fn MatCreate(comm: MPI_Comm, matrix: *mut Mat) -> PetscErrorCode;
    pub fn MatCreateShell(
        comm: MPI_Comm,
        own_rows: PetscInt,
        own_columns: PetscInt,
        rows: PetscInt,
        columns: PetscInt,
        context: *mut c_void,
        matrix: *mut Mat,
    ) -> PetscErrorCode;
    pub fn MatShellSetOperation(
        matrix: Mat,
        operation: c_int,
        function: Option<unsafe extern "C" fn()>,
    ) -> PetscErrorCode;
    pub fn MatShellSetContext(matrix: Mat, context: *mut c_void) -> PetscErrorCode;
    pub fn MatShellGetContext(matrix: Mat, context: *mut c_void) -> PetscErrorCode;
    pub fn MatSetSizes(
        matrix: Mat,
        own_rows: PetscInt,
        own_columns: PetscInt,
        rows: PetscInt,
        columns: PetscInt,
    ) -> PetscErrorCode;
    pub fn MatSetType(matrix: Mat, name: *const c_char) -> PetscErrorCode;
    pub fn MatSetBlockSize(matrix: Mat, size: PetscInt) -> PetscErrorCode;
    pub fn MatSetOption(matrix: Mat, option: c_int, value: PetscBool) -> PetscErrorCode;
    pub fn MatSetPreallocationCOO(
        matrix: Mat,
        n: PetscCount,
        rows: *mut PetscInt,
        columns: *mut PetscInt,
    ) -> PetscErrorCode;
    pub fn MatSetValuesCOO(matrix: Mat, values: *const f64, mode: c_int) -> PetscErrorCode;
    pub fn MatSetNearNullSpace(matrix: Mat, space: MatNullSpace) -> PetscErrorCode;
    pub fn MatNullSpaceCreateRigidBody(coordinates: Vec_, space: *mut MatNullSpace) -> PetscErrorCode;
    pub fn MatNullSpaceDestroy(space: *mut MatNullSpace) -> PetscErrorCode;
    pub fn MatMult(matrix: Mat, x: Vec_, y: Vec_) -> PetscErrorCode;
    pub fn MatDestroy(matrix: *mut Mat) -> PetscErrorCode;
    pub fn MatSolverTypeGet(
        solver: *const c_char,
        matrix: *const c_char,
        factor: c_int,
        found_solver: *mut PetscBool,
        found_matrix: *mut PetscBool,
        function: *mut Option<unsafe extern "C" fn(Mat, c_int, *mut Mat) -> PetscErrorCode>,
    ) -> PetscErrorCode;
    pub fn MatFactorGetSolverType(factor: Mat, name: *mut *const c_char) -> PetscErrorCode;
    pub fn MatMumpsSetIcntl(factor: Mat, number: PetscInt, value: PetscInt) -> PetscErrorCode;
    pub fn MatMumpsGetInfog(factor: Mat, number: PetscInt, value: *mut PetscInt) -> PetscErrorCode;
    pub fn MatMumpsGetRinfog(factor: Mat, number: PetscInt, value: *mut f64) -> PetscErrorCode;

    pub fn KSPCreate(comm: MPI_Comm, solver: *mut KSP) -> PetscErrorCode;
    pub fn KSPSetOptionsPrefix(solver: KSP, prefix: *const c_char) -> PetscErrorCode;
    pub fn KSPSetType(solver: KSP, name: *const c_char) -> PetscErrorCode;
    pub fn KSPSetFromOptions(solver: KSP) -> PetscErrorCode;
    pub fn KSPSetOperators(solver: KSP, matrix: Mat, preconditioner: Mat) -> PetscErrorCode;
    pub fn KSPSetTolerances(
        solver: KSP,
        relative: f64,
        absolute: f64,
        divergence: f64,
        most: PetscInt,
    ) -> PetscErrorCode;
    pub fn KSPSetNormType(solver: KSP, norm: c_int) -> PetscErrorCode;
    pub fn KSPSetPCSide(solver: KSP, side: c_int) -> PetscErrorCode;
    pub fn KSPGMRESSetRestart(solver: KSP, most: PetscInt) -> PetscErrorCode;
    pub fn KSPSetUp(solver: KSP) -> PetscErrorCode;
    pub fn KSPSolve(solver: KSP, b: Vec_, x: Vec_) -> PetscErrorCode;
    pub fn KSPGetConvergedReason(solver: KSP, reason: *mut c_int) -> PetscErrorCode;
    pub fn KSPGetIterationNumber(solver: KSP, n: *mut PetscInt) -> PetscErrorCode;
    pub fn KSPGetResidualNorm(solver: KSP, norm: *mut f64) -> PetscErrorCode;
    pub fn KSPGetPC(solver: KSP, pc: *mut PC) -> PetscErrorCode;
    pub fn KSPSetPC(solver: KSP, pc: PC) -> PetscErrorCode;
    pub fn KSPDestroy(solver: *mut KSP) -> PetscErrorCode;

    pub fn PCSetType(pc: PC, name: *const c_char) -> PetscErrorCode;
    pub fn PCSetUseAmat(pc: PC, use_matrix: PetscBool) -> PetscErrorCode;
    pub fn PCFactorSetMatSolverType(pc: PC, name: *const c_char) -> PetscErrorCode;
    pub fn PCFactorSetUpMatSolverType(pc: PC) -> PetscErrorCode;
    pub fn PCFactorGetMatrix(pc: PC, factor: *mut Mat) -> PetscErrorCode;
    pub fn PCGetFailedReason(pc: PC, reason: *mut c_int) -> PetscErrorCode;
    pub fn PCShellSetApply(pc: PC, apply: Option<PCApply>) -> PetscErrorCode;
    pub fn PCShellSetContext(pc: PC, context: *mut c_void) -> PetscErrorCode;
    pub fn PCShellGetContext(pc: PC, context: *mut c_void) -> PetscErrorCode;
}

/// Allocator settings of the GNU C library, as in its `malloc.h`.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub use allocator::*;

#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod allocator {
    use std::ffi::c_int;

    pub const M_TRIM_THRESHOLD: c_int = -1;
    pub const M_MMAP_THRESHOLD: c_int = -3;
    pub const M_MMAP_MAX: c_int = -4;

    unsafe extern "C" {
        pub fn mallopt(name: c_int, value: c_int) -> c_int;
    }
}
