//! The functions of a shared library, as `examples/laws/mpm_law.h` declares them. All unsafe code of this crate is
//! here.
//!
//! Two things are taken on trust, because nothing can check them: the functions have the types that the header
//! declares, and they write only to their result arguments.
#![allow(unsafe_code, reason = "functions of other languages cannot be called otherwise")]

use std::error::Error;
use std::ffi::{CStr, c_char};
use std::mem::size_of;
use std::path::Path;

use super::error::{Kind, LibraryError};

/// The version of the interface.
pub const VERSION: i32 = 1;

/// Largest number of parameters, and of history variables.
const MAX_VARIABLES: i64 = 1000;

#[repr(C)]
#[derive(Default)]
struct Sizes {
    size: i64,
    n_parameters: i64,
    n_history: i64,
    /// Spare room, in case the structure of a library is larger.
    room: [i64; 29],
}

/// Size of the structure `mpm_sizes`, [byte].
const SIZE: i64 = 3 * size_of::<i64>() as i64;

#[repr(C)]
struct Variable {
    name: *const c_char,
    unit: *const c_char,
    initial: f64,
}

type Abi = unsafe extern "C" fn() -> i32;
type WriteSizes = unsafe extern "C" fn(*mut Sizes);
type Describe = unsafe extern "C" fn(i64, *mut Variable);
type Update =
    unsafe extern "C" fn(*const f64, *const f64, *const f64, *mut f64, *mut f64, *mut f64, *mut f64) -> i32;
type Refuse = unsafe extern "C" fn(*const f64) -> *const c_char;
type Energy = unsafe extern "C" fn(*const f64, *const f64, *const f64) -> f64;
type PlasticWork = unsafe extern "C" fn(*const f64, *const f64) -> f64;
type Invert = unsafe extern "C" fn(*const f64, *const f64, *const f64, *mut f64) -> i32;
type StartFrom = unsafe extern "C" fn(*const f64, *const f64, f64, *mut f64);
type IsSymmetric = unsafe extern "C" fn(*const f64) -> i32;
type Measure = unsafe extern "C" fn() -> i32;

/// The functions of a library. Parameters and history variables are slices of the lengths that the library states; with
/// other lengths, the library is not called: results of the return mapping are then not finite, and the other methods
/// act as if the library lacked the function.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Interface {
    pub(crate) n_parameters: usize,
    pub(crate) n_history: usize,
    describe_parameter: Option<Describe>,
    describe_history: Option<Describe>,
    update: Update,
    refuse: Option<Refuse>,
    energy: Option<Energy>,
    plastic_work: Option<PlasticWork>,
    invert: Option<Invert>,
    start_from: Option<StartFrom>,
    is_symmetric: Option<IsSymmetric>,
    measure: Option<Measure>,
}

/// What a library states about a parameter or a history variable.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Statement {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) initial: f64,
}

/// Results of the return mapping in plain components; the tangent is stored row by row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Answer {
    pub(crate) stress: [f64; 6],
    pub(crate) elastic_strain: [f64; 6],
    pub(crate) tangent: [f64; 36],
}

/// Loads a library and never unloads it: its functions stay valid while the program runs.
///
/// # Errors
/// [`LibraryError::NotLoaded`].
pub(crate) fn load(path: &Path) -> Result<Loaded, LibraryError> {
    let library = open(path).map_err(|error| {
        // The source of the error is the system's own message, which names the fault, such as an undefined symbol.
        let system_message = error.source().map(ToString::to_string);
        LibraryError::NotLoaded(system_message.unwrap_or_else(|| error.to_string()))
    })?;
    Ok(Loaded(Box::leak(Box::new(library))))
}

/// Loads a library, like [`load`], from a copy of the contents of its file in memory, so that nothing can come between
/// reading and loading; `None` if the system has no such copies.
pub(crate) fn load_copy(path: &Path, contents: &[u8]) -> Option<Result<Loaded, LibraryError>> {
    let copy = copy_in_memory(path, contents)?;
    let place = copy.path();
    let loaded = load(&place).map_err(|error| match error {
        LibraryError::NotLoaded(message) => {
            let (place, path) = (place.display().to_string(), path.display().to_string());
            LibraryError::NotLoaded(message.replace(&place, &path))
        }
        error => error,
    });
    if loaded.is_ok() {
        // The system has mapped the copy into memory, but recognises libraries by their paths: the number of the file,
        // which is the path of the copy, must not be given to another one.
        std::mem::forget(copy);
    }
    Some(loaded)
}

/// A file in memory.
#[cfg(target_os = "linux")]
struct InMemory(std::fs::File);

#[cfg(target_os = "linux")]
impl InMemory {
    fn path(&self) -> std::path::PathBuf {
        use std::os::fd::AsRawFd;
        format!("/proc/self/fd/{}", self.0.as_raw_fd()).into()
    }
}

/// A file in memory with these contents, named like the library in messages of the system; `None` if the system has
/// none.
#[cfg(target_os = "linux")]
fn copy_in_memory(path: &Path, contents: &[u8]) -> Option<InMemory> {
    use std::ffi::{CString, c_int, c_uint};
    use std::io::Write;
    use std::os::fd::FromRawFd;
    use std::os::unix::ffi::OsStrExt;

    unsafe extern "C" {
        fn memfd_create(name: *const c_char, flags: c_uint) -> c_int;
    }
    /// The file is closed when another program takes the place of this one.
    const CLOSED_ON_EXECUTION: c_uint = 1;
    let name = CString::new(path.file_name()?.as_bytes().get(..200.min(path.file_name()?.len()))?).ok()?;
    // SAFETY: the name ends with a zero byte.
    let number = unsafe { memfd_create(name.as_ptr(), CLOSED_ON_EXECUTION) };
    if number < 0 {
        return None;
    }
    // SAFETY: the number belongs to a new file, which has no other owner.
    let mut copy = unsafe { std::fs::File::from_raw_fd(number) };
    copy.write_all(contents).ok()?;
    let copy = InMemory(copy);
    // Not every system shows open files by name.
    copy.path().exists().then_some(copy)
}

#[cfg(not(target_os = "linux"))]
struct InMemory;

#[cfg(not(target_os = "linux"))]
impl InMemory {
    fn path(&self) -> std::path::PathBuf {
        std::path::PathBuf::new()
    }
}

#[cfg(not(target_os = "linux"))]
fn copy_in_memory(_: &Path, _: &[u8]) -> Option<InMemory> {
    None
}

/// A library that stays loaded.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Loaded(&'static libloading::Library);

/// Binds all symbols at once, so that a symbol that the library cannot resolve is reported here, not during a run.
#[cfg(unix)]
fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    use libloading::os::unix::{Library, RTLD_LOCAL, RTLD_NOW};
    // SAFETY: the user names the library to have its code run, which begins with its initialisers.
    unsafe { Library::open(Some(path), RTLD_NOW | RTLD_LOCAL) }.map(Into::into)
}

#[cfg(not(unix))]
fn open(path: &Path) -> Result<libloading::Library, libloading::Error> {
    // SAFETY: as above.
    unsafe { libloading::Library::new(path) }
}

impl Loaded {
    /// A function by its name; `F` must be its type in the header.
    fn function<F: Copy>(&self, name: &'static str) -> Option<F> {
        // SAFETY: the type is that in the header, which the library is trusted to follow; the library is never
        // unloaded.
        unsafe { self.0.get::<F>(name) }.ok().map(|function| *function)
    }

    fn required<F: Copy>(&self, name: &'static str) -> Result<F, LibraryError> {
        self.function(name).ok_or(LibraryError::NoFunction(name))
    }

    /// The functions of the library, after a check of the version and the sizes.
    ///
    /// # Errors
    /// Faults in the version, the sizes or the functions.
    pub(crate) fn interface(&self) -> Result<Interface, LibraryError> {
        let abi: Abi = self.required("mpm_law_abi")?;
        // SAFETY: the function takes no arguments.
        let version = unsafe { abi() };
        if version != VERSION {
            return Err(LibraryError::Version { found: version, needed: VERSION });
        }
        let sizes = self.sizes()?;
        let needed = |count: usize, name: &'static str| match count {
            0 => Ok(self.function(name)),
            _ => self.required(name).map(Some),
        };
        let (n_parameters, n_history) = (sizes.n_parameters as usize, sizes.n_history as usize);
        Ok(Interface {
            n_parameters,
            n_history,
            describe_parameter: needed(n_parameters, "mpm_law_parameter")?,
            describe_history: needed(n_history, "mpm_law_history")?,
            update: self.required("mpm_law_update")?,
            refuse: self.function("mpm_law_refuse"),
            energy: self.function("mpm_law_energy"),
            plastic_work: self.function("mpm_law_plastic_work"),
            invert: self.function("mpm_law_elastic_strain"),
            start_from: self.function("mpm_law_start"),
            is_symmetric: self.function("mpm_law_tangent_is_symmetric"),
            measure: self.function("mpm_law_measure"),
        })
    }

    fn sizes(&self) -> Result<Sizes, LibraryError> {
        let write: WriteSizes = self.required("mpm_law_sizes")?;
        let mut sizes = Sizes::default();
        // SAFETY: the structure has room for more than the library writes.
        unsafe { write(&raw mut sizes) };
        if sizes.size != SIZE {
            return Err(LibraryError::Size { found: sizes.size, expected: SIZE });
        }
        for (kind, count) in [(Kind::Parameter, sizes.n_parameters), (Kind::History, sizes.n_history)] {
            if !(0..=MAX_VARIABLES).contains(&count) {
                return Err(LibraryError::Count { kind, count, most: MAX_VARIABLES });
            }
        }
        Ok(sizes)
    }
}

/// A string from a library; `None` for a null pointer.
///
/// # Errors
/// If it is not UTF-8.
fn text(start: *const c_char) -> Result<Option<String>, std::str::Utf8Error> {
    if start.is_null() {
        return Ok(None);
    }
    // SAFETY: the library returns strings that end with a zero byte.
    let text = unsafe { CStr::from_ptr(start) };
    text.to_str().map(|text| Some(text.to_owned()))
}

impl Interface {
    /// What the library states about the parameter or history variable with this number.
    ///
    /// # Errors
    /// If it has no name, or a string is not UTF-8.
    pub(crate) fn statement(&self, kind: Kind, number: usize) -> Result<Statement, LibraryError> {
        let describe = match kind {
            Kind::Parameter => self.describe_parameter.filter(|_| number < self.n_parameters),
            Kind::History => self.describe_history.filter(|_| number < self.n_history),
        };
        let no_name = LibraryError::NoName { kind, number };
        let Some(describe) = describe else { return Err(no_name) };
        let mut variable = Variable { name: std::ptr::null(), unit: std::ptr::null(), initial: f64::NAN };
        // SAFETY: the number is below the count that the library states.
        unsafe { describe(number as i64, &raw mut variable) };
        let not_text = |_| LibraryError::NotText { kind, number };
        let name = text(variable.name).map_err(not_text)?.filter(|name| !name.is_empty());
        let unit = text(variable.unit).map_err(not_text)?.unwrap_or_else(|| "-".to_owned());
        Ok(Statement { name: name.ok_or(no_name)?, unit, initial: variable.initial })
    }

    /// Return mapping from a trial strain in plain components; `new` starts as a copy of `old`.
    ///
    /// # Errors
    /// The error number that the law returns if it refuses the strain.
    pub(crate) fn update(
        &self,
        parameters: &[f64],
        trial: &[f64; 6],
        old: &[f64],
        new: &mut [f64],
    ) -> Result<Answer, i32> {
        let mut answer =
            Answer { stress: [f64::NAN; 6], elastic_strain: [f64::NAN; 6], tangent: [f64::NAN; 36] };
        if !self.fits(parameters, old) || new.len() != old.len() {
            return Ok(answer);
        }
        new.copy_from_slice(old);
        // SAFETY: all arrays have the lengths that the header states.
        let number = unsafe {
            (self.update)(
                parameters.as_ptr(),
                trial.as_ptr(),
                old.as_ptr(),
                new.as_mut_ptr(),
                answer.stress.as_mut_ptr(),
                answer.elastic_strain.as_mut_ptr(),
                answer.tangent.as_mut_ptr(),
            )
        };
        if number == 0 { Ok(answer) } else { Err(number) }
    }

    /// True if arrays have the lengths that the library states.
    fn fits(&self, parameters: &[f64], history: &[f64]) -> bool {
        parameters.len() == self.n_parameters && history.len() == self.n_history
    }

    /// The reason why parameters cannot have these values, if the law gives one.
    pub(crate) fn refusal(&self, parameters: &[f64]) -> Option<String> {
        let refuse = self.refuse.filter(|_| parameters.len() == self.n_parameters)?;
        // SAFETY: the array has the length that the header states; the string ends with a zero byte.
        let reason = unsafe { refuse(parameters.as_ptr()) };
        text(reason).unwrap_or_else(|_| Some("its reason is not UTF-8".to_owned()))
    }

    /// Stored energy per initial volume; `None` if the library has no function for it.
    pub(crate) fn energy(&self, parameters: &[f64], strain: &[f64; 6], history: &[f64]) -> Option<f64> {
        let energy = self.energy.filter(|_| self.fits(parameters, history))?;
        // SAFETY: all arrays have the lengths that the header states.
        Some(unsafe { energy(parameters.as_ptr(), strain.as_ptr(), history.as_ptr()) })
    }

    /// Plastic work per initial volume; `None` if the library has no function for it.
    pub(crate) fn plastic_work(&self, parameters: &[f64], history: &[f64]) -> Option<f64> {
        let work = self.plastic_work.filter(|_| self.fits(parameters, history))?;
        // SAFETY: all arrays have the lengths that the header states.
        Some(unsafe { work(parameters.as_ptr(), history.as_ptr()) })
    }

    /// Elastic strain that produces a stress; `None` if the library has no function for it.
    ///
    /// # Errors
    /// The error number that the law returns if there is no such strain.
    pub(crate) fn elastic_strain(
        &self,
        parameters: &[f64],
        stress: &[f64; 6],
        history: &[f64],
    ) -> Option<Result<[f64; 6], i32>> {
        let invert = self.invert.filter(|_| self.fits(parameters, history))?;
        let mut strain = [f64::NAN; 6];
        // SAFETY: all arrays have the lengths that the header states.
        let number =
            unsafe { invert(parameters.as_ptr(), stress.as_ptr(), history.as_ptr(), strain.as_mut_ptr()) };
        Some(if number == 0 { Ok(strain) } else { Err(number) })
    }

    /// Adapts initial history variables to an initial elastic strain.
    pub(crate) fn start_from(&self, parameters: &[f64], strain: &[f64; 6], ratio: f64, history: &mut [f64]) {
        let Some(start) = self.start_from.filter(|_| self.fits(parameters, history)) else { return };
        // SAFETY: all arrays have the lengths that the header states.
        unsafe { start(parameters.as_ptr(), strain.as_ptr(), ratio, history.as_mut_ptr()) }
    }

    /// True if the tangent is symmetric with these parameters.
    pub(crate) fn is_symmetric(&self, parameters: &[f64]) -> bool {
        let Some(is_symmetric) = self.is_symmetric.filter(|_| parameters.len() == self.n_parameters) else {
            return true;
        };
        // SAFETY: the array has the length that the header states.
        unsafe { is_symmetric(parameters.as_ptr()) != 0 }
    }

    /// Number of the strain measure.
    pub(crate) fn measure(&self) -> i32 {
        // SAFETY: the function takes no arguments.
        self.measure.map_or(0, |measure| unsafe { measure() })
    }
}
