//! Libraries that the program has loaded, and what they state about their laws.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use mpm_core::material::{StateField, StrainMeasure};

use super::error::{Kind, LibraryError};
use super::interface::{Interface, Statement, load, load_copy};

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

/// The contents of the file of a library, and the outcome of loading it.
type Known = (Arc<[u8]>, Result<Arc<Library>, LibraryError>);

/// All libraries that were loaded. A library is never loaded again, even if its file has been replaced, so the contents
/// of each file are kept here.
static KNOWN: Mutex<BTreeMap<PathBuf, Known>> = Mutex::new(BTreeMap::new());

/// Text in a library that looks for other libraries beside its own file.
const BESIDE: &[u8] = b"$ORIGIN";

impl Library {
    /// Loads the library in a file, once in the lifetime of the program; `contents` are those of the file, and they are
    /// what is loaded. Loading runs code of the library.
    ///
    /// # Errors
    /// [`LibraryError`]; [`LibraryError::Changed`] if a file with the same path but other contents was loaded before,
    /// or if the file changes while it is loaded.
    pub fn open(path: &Path, contents: Vec<u8>) -> Result<Arc<Library>, LibraryError> {
        let path = path.canonicalize().map_err(|error| LibraryError::NotLoaded(error.to_string()))?;
        let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((loaded, outcome)) = known.get(&path) {
            return if **loaded == *contents { outcome.clone() } else { Err(LibraryError::Changed) };
        }
        let in_place = contents.windows(BESIDE.len()).any(|text| text == BESIDE);
        let copied = if in_place { None } else { load_copy(&path, &contents) };
        let loaded = match copied {
            Some(loaded) => loaded?,
            // Without a copy, the file must be the same before and after.
            None => {
                let loaded = load(&path)?;
                let now = std::fs::read(&path).unwrap_or_default();
                if now != contents {
                    return Err(LibraryError::Changed);
                }
                loaded
            }
        };
        let outcome = loaded.interface().and_then(Library::new).map(Arc::new);
        known.insert(path, (contents.into(), outcome.clone()));
        outcome
    }

    /// The contents of the library that was loaded from a file; `None` if it was not loaded.
    pub fn contents(path: &Path) -> Option<Arc<[u8]>> {
        let path = path.canonicalize().ok()?;
        let known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        known.get(&path).map(|(contents, _)| Arc::clone(contents))
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
