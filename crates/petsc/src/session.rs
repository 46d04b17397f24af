//! Start and end of MPI and PETSc.

use std::ffi::{CStr, CString, c_char, c_int};
use std::marker::PhantomData;
use std::ptr::null_mut;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, check, keep_message, text_at};
use crate::ffi;
use crate::mpi::Mpi;

/// True from the first call of [`start`] with valid options onwards.
static STARTED: AtomicBool = AtomicBool::new(false);

/// True while PETSc objects may be used.
static RUNNING: AtomicBool = AtomicBool::new(false);

/// Default options, which those of the user override: no signal handlers, and multigrid products whose sums do not
/// depend on the order in which messages arrive, unlike the sums of the other algorithms.
const PRESET: [(&CStr, &CStr); 2] = [(c"-no_signal_handler", c"true"), (c"-matptap_via", c"allatonce")];

/// Length of the longest version string of an MPI library.
const VERSION_LENGTH: usize = 8192;

/// True while PETSc objects may be used and destroyed.
pub(crate) fn is_running() -> bool {
    RUNNING.load(Ordering::Acquire)
}

/// MPI and PETSc, which run until this value is dropped; the communicator and all solvers must not be used after that.
/// The session stays on the thread that started it.
///
/// If the thread panics, its session aborts all ranks, which would otherwise wait for this rank.
#[derive(Debug)]
pub struct Session {
    communicator: Arc<Mpi>,
    /// True if the session has started MPI, and so ends it.
    has_started_mpi: bool,
    /// Both libraries end on the thread that started them.
    _on_this_thread: PhantomData<*mut ()>,
}

/// Starts MPI, unless it is already running, and PETSc with these options, separated by blanks, such as `"-ksp_monitor
/// -pc_gamg_threshold 0.02"`. PETSc also reads the environment variable `PETSC_OPTIONS` and the file `~/.petscrc`.
///
/// PETSc then handles no signals and prints no errors.
///
/// # Errors
/// [`Error`] if one of the libraries does not start.
pub fn start(options: &str) -> Result<Session, Error> {
    let arguments = std::iter::once("mpm").chain(options.split_whitespace());
    let arguments: Result<Vec<CString>, _> = arguments.map(CString::new).collect();
    let arguments = arguments.map_err(|_| Error::Options)?;
    if STARTED.swap(true, Ordering::AcqRel) {
        return Err(Error::StartedBefore);
    }
    let has_started_mpi = start_mpi()?;
    // PETSc keeps the arguments until it ends.
    let mut pointers: Vec<*mut c_char> = arguments.into_iter().map(CString::into_raw).collect();
    let mut count = pointers.len() as c_int;
    pointers.push(null_mut());
    let mut pointers = pointers.leak().as_mut_ptr();
    // SAFETY: MPI is running; the arguments stay in memory, and the last pointer is null.
    unsafe {
        for (name, value) in PRESET {
            check(ffi::PetscOptionsSetValue(null_mut(), name.as_ptr(), value.as_ptr()))?;
        }
        check(ffi::PetscInitialize(&mut count, &mut pointers, null_mut(), null_mut()))?;
        check(ffi::PetscPushErrorHandler(Some(keep_message), null_mut()))?;
    }
    RUNNING.store(true, Ordering::Release);
    Ok(Session { communicator: Arc::new(Mpi::world()), has_started_mpi, _on_this_thread: PhantomData })
}

/// Starts MPI unless it is already running; returns true if it was not.
fn start_mpi() -> Result<bool, Error> {
    let (mut runs, mut provided) = (0, 0);
    // SAFETY: MPI allows the first call at any time, the second before its start, and the third after it.
    let code = unsafe {
        ffi::MPI_Initialized(&mut runs);
        match runs {
            0 => ffi::MPI_Init_thread(null_mut(), null_mut(), ffi::MPI_THREAD_SERIALIZED, &mut provided),
            _ => ffi::MPI_Query_thread(&mut provided),
        }
    };
    match code {
        0 if provided < ffi::MPI_THREAD_SERIALIZED => Err(Error::Threads),
        0 => {
            return_memory();
            Ok(runs == 0)
        }
        code => Err(Error::Mpi(code)),
    }
}

/// Makes the C library return memory to the system. Network drivers (PSM2) switch this off when MPI starts; a rank
/// would then keep its peak memory for good. Arrays of half a mebibyte and more are taken from the system one by
/// one, because arrays that come and go with each step would otherwise leave gaps, which cost 7 % more memory on four
/// ranks.
fn return_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        let settings =
            [(ffi::M_MMAP_MAX, 1 << 16), (ffi::M_MMAP_THRESHOLD, 1 << 19), (ffi::M_TRIM_THRESHOLD, 1 << 22)];
        for (name, value) in settings {
            // SAFETY: The function may be called at any time; it refuses what it does not know.
            unsafe { ffi::mallopt(name, value) };
        }
    }
}

impl Session {
    /// The communicator of all ranks.
    pub fn communicator(&self) -> Arc<Mpi> {
        Arc::clone(&self.communicator)
    }

    /// Ends all ranks at once, with this exit code.
    pub fn abort(&self, code: i32) -> ! {
        abort(code)
    }
}

fn abort(code: i32) -> ! {
    // SAFETY: MPI is running as long as the session lives.
    unsafe { ffi::MPI_Abort(ffi::MPI_COMM_WORLD(), code) };
    std::process::exit(code)
}

impl Drop for Session {
    fn drop(&mut self) {
        if std::thread::panicking() {
            abort(101);
        }
        RUNNING.store(false, Ordering::Release);
        let mut ended = 0;
        // SAFETY: Both libraries have been started, and this is the thread that started the session.
        unsafe {
            ffi::PetscFinalize();
            ffi::MPI_Finalized(&mut ended);
            if ended == 0 && self.has_started_mpi {
                ffi::MPI_Finalize();
            }
        }
    }
}

/// The versions of both libraries, such as `PETSc 3.18.5, Open MPI 4.1.4`.
pub fn version() -> String {
    let [mut major, mut minor, mut patch, mut release] = [0; 4];
    let mut text = vec![0 as c_char; VERSION_LENGTH + 1];
    let mut length = 0;
    // SAFETY: Both functions may be called at any time; the buffer has room for the longest answer.
    let text = unsafe {
        ffi::PetscGetVersionNumber(&mut major, &mut minor, &mut patch, &mut release);
        ffi::MPI_Get_library_version(text.as_mut_ptr(), &mut length);
        text_at(text.as_ptr())
    };
    format!("PETSc {major}.{minor}.{patch}, {}", short(&text))
}

/// The name and the number in the version string of an MPI library.
fn short(text: &str) -> String {
    let first = text.lines().next().unwrap_or_default();
    let first = first.split(',').next().unwrap_or_default();
    let words =
        first.split_whitespace().map(|word| word.trim_end_matches(':')).filter(|word| *word != "Version");
    let bare = |word: &str| match word.strip_prefix('v') {
        Some(number) if number.starts_with(|c: char| c.is_ascii_digit()) => number.to_owned(),
        _ => word.to_owned(),
    };
    words.map(bare).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_short() {
        let open = "Open MPI v4.1.4, package: Debian OpenMPI, ident: 4.1.4, repo rev: v4.1.4, May 26, 2022";
        assert_eq!(short(open), "Open MPI 4.1.4");
        assert_eq!(short("MPICH Version:      4.0.2\nMPICH Release date: Thu"), "MPICH 4.0.2");
        assert!(version().starts_with("PETSc 3."), "{}", version());
    }
}
