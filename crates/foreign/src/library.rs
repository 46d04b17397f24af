//! Libraries that the program has loaded, and what they state about their laws.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use mpm_core::material::{StateField, StrainMeasure};

use super::error::{Kind, LibraryError};
use super::interface::{Interface, Statement, load};

/// A parameter of a law.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Described {
    /// Name of the parameter.
    pub name: String,
    /// Unit of the parameter, as text.
    pub unit: String,
}

/// A library that has been loaded, with its law. It stays loaded until the program ends.
#[derive(Debug)]
pub struct Library {
    pub(crate) interface: Interface,
    pub(crate) parameters: Vec<Described>,
    pub(crate) fields: Vec<StateField>,
    pub(crate) measure: StrainMeasure,
}

/// The hash of the file of a library, and the outcome of loading it.
type Known = (u128, Result<Arc<Library>, LibraryError>);

/// All libraries that were loaded. If a path is requested again, the system returns the library that it already has,
/// even if the file has been replaced, so the hash of each file is kept here.
static KNOWN: Mutex<BTreeMap<PathBuf, Known>> = Mutex::new(BTreeMap::new());

impl Library {
    /// Loads the library in a file, once in the lifetime of the program; `hash` is the hash of the file contents.
    /// Loading runs code of the library.
    ///
    /// # Errors
    /// [`LibraryError`]; [`LibraryError::Changed`] if a file with the same path but other contents was loaded before.
    pub fn open(path: &Path, hash: u128) -> Result<Arc<Library>, LibraryError> {
        let path = path.canonicalize().map_err(|error| LibraryError::NotLoaded(error.to_string()))?;
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((loaded_hash, outcome)) = known.get(&path) {
            return if *loaded_hash == hash { outcome.clone() } else { Err(LibraryError::Changed) };
        }
        let loaded = load(&path)?;
        let outcome = loaded.interface().and_then(Library::new).map(Arc::new);
        known.insert(path, (hash, outcome.clone()));
        outcome
    }

    fn new(interface: Interface) -> Result<Library, LibraryError> {
        if black_box(f64::MIN_POSITIVE) * black_box(0.5) == 0.0 {
            return Err(LibraryError::Arithmetic);
        }
        let parameters = statements(&interface, Kind::Parameter, interface.n_parameters)?;
        let history = statements(&interface, Kind::History, interface.n_history)?;
        if let Some(variable) = history.iter().find(|variable| !variable.initial.is_finite()) {
            return Err(LibraryError::NotFinite { name: variable.name.clone(), value: variable.initial });
        }
        let measure = match interface.measure() {
            0 => StrainMeasure::Logarithmic,
            1 => StrainMeasure::LeftCauchyGreen,
            other => return Err(LibraryError::Measure(other)),
        };
        let field = |Statement { name, unit, initial }: Statement| StateField {
            name: name.into(),
            unit: unit.into(),
            initial,
        };
        let described = |Statement { name, unit, .. }| Described { name, unit };
        Ok(Library {
            interface,
            parameters: parameters.into_iter().map(described).collect(),
            fields: history.into_iter().map(field).collect(),
            measure,
        })
    }

    /// The parameters of the law, in the order of the library.
    pub fn parameters(&self) -> &[Described] {
        &self.parameters
    }
}

/// What a library states about its parameters or its history variables, all of which have different names.
fn statements(interface: &Interface, kind: Kind, count: usize) -> Result<Vec<Statement>, LibraryError> {
    let mut all: Vec<Statement> = Vec::with_capacity(count);
    for number in 0..count {
        let statement = interface.statement(kind, number)?;
        let Statement { name, .. } = &statement;
        if !is_word(name) {
            return Err(LibraryError::NotWord { kind, number, name: name.clone() });
        }
        if all.iter().any(|other| other.name == *name) {
            return Err(LibraryError::Twice { kind, name: name.clone() });
        }
        all.push(statement);
    }
    Ok(all)
}

fn is_word(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}
