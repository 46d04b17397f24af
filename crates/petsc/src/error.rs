//! Errors of MPI and PETSc.

use std::borrow::Cow;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::sync::{Mutex, PoisonError};

use mpm_core::linear::LinearError;
use mpm_core::ranks::Ranks;

use crate::ffi;

/// MPI or PETSc has failed, or cannot be used.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// A session has been started before: the libraries can be started only once in a process.
    #[error("MPI and PETSc can be started only once")]
    StartedBefore,
    /// MPI and PETSc are not running.
    #[error("MPI and PETSc are not running")]
    NotStarted,
    /// The options contain a zero byte.
    #[error("the options for PETSc contain a zero byte")]
    Options,
    /// MPI cannot be started.
    #[error("MPI cannot be started (error {0})")]
    Mpi(i32),
    /// MPI cannot be called from more than one thread.
    #[error(
        "this MPI library cannot be called by several threads in turn; it was built without support for threads"
    )]
    Threads,
    /// PETSc was built without this library.
    #[error("this PETSc library was built without {0}, which the direct solver needs")]
    Without(&'static str),
    /// A PETSc function has failed.
    #[error("PETSc: {message}")]
    Petsc {
        /// The PETSc error code.
        code: i32,
        /// The PETSc error message.
        message: String,
    },
}

/// A backend was used before it was prepared.
pub(crate) const NOT_PREPARED: LinearError =
    LinearError::Library(Cow::Borrowed("the matrix was not prepared"));

/// The message of the last error.
static MESSAGE: Mutex<String> = Mutex::new(String::new());

/// Keeps the message of an error; used in place of PETSc's own error handler, which prints it.
pub(crate) unsafe extern "C" fn keep_message(
    _: ffi::MPI_Comm,
    _: c_int,
    function: *const c_char,
    _: *const c_char,
    code: ffi::PetscErrorCode,
    kind: c_int,
    message: *const c_char,
    _: *mut c_void,
) -> ffi::PetscErrorCode {
    if kind == ffi::PETSC_ERROR_INITIAL {
        // SAFETY: PETSc passes strings that end with a zero byte, or null.
        let [function, message] = [function, message].map(|text| unsafe { text_at(text) });
        let line = message.split_whitespace().collect::<Vec<_>>().join(" ");
        *MESSAGE.lock().unwrap_or_else(PoisonError::into_inner) = format!("{line} ({function})");
    }
    code
}

/// Copies a C string.
///
/// # Safety
/// The pointer must be null or point to a string that ends with a zero byte.
pub(crate) unsafe fn text_at(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: The caller guarantees such a string.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Turns a PETSc error code into an error with the message that belongs to it.
pub(crate) fn check(code: ffi::PetscErrorCode) -> Result<(), Error> {
    if code == 0 {
        return Ok(());
    }
    let mut message = std::mem::take(&mut *MESSAGE.lock().unwrap_or_else(PoisonError::into_inner));
    if message.is_empty() {
        message = format!("error {code}");
    }
    Err(Error::Petsc { code, message })
}

impl From<Error> for LinearError {
    fn from(error: Error) -> Self {
        match error {
            Error::Petsc { code: ffi::PETSC_ERR_MEM, .. } => LinearError::OutOfMemory { needed: None },
            Error::Petsc { code: ffi::PETSC_ERR_MAT_LU_ZRPVT | ffi::PETSC_ERR_MAT_CH_ZRPVT, .. } => {
                LinearError::Singular { unknown: None }
            }
            other => LinearError::Library(other.to_string().into()),
        }
    }
}

/// Returns an error on all ranks if any of them has one; a rank keeps its own error if no other is worse.
pub(crate) fn agree<T>(ranks: &Ranks, outcome: Result<T, LinearError>) -> Result<T, LinearError> {
    let weight = |error: &LinearError| match error {
        LinearError::Singular { .. } => 1,
        LinearError::NotConverged { .. } => 2,
        LinearError::OutOfMemory { .. } => 4,
        LinearError::Library(_) => 5,
        _ => 3,
    };
    let own = outcome.as_ref().err().map_or(0, weight);
    let worst = ranks.largest(f64::from(own)) as i32;
    match outcome {
        outcome if worst == own => outcome,
        _ => Err(match worst {
            1 => LinearError::Singular { unknown: None },
            2 => LinearError::NotConverged { iterations: 0, residual: f64::NAN },
            4 => LinearError::OutOfMemory { needed: None },
            _ => LinearError::Library("another rank has failed".into()),
        }),
    }
}
