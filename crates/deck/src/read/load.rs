//! From a file to a valid deck, or to all messages about its faults.

use std::collections::{BTreeMap, HashSet};
use std::fmt;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;

use crate::diagnostic::{self, Diagnostic, Gate};
use crate::formulas::Fault;
use crate::hash::hex;
use crate::laws::NamedLibrary;
use crate::quoting::quote;
use crate::references::dangling;
use crate::source::Source;
use crate::span::escape;
use crate::{
    CellSize, Deck, GridDeck, MaterialDeck, Parameter, StatedLaw, Surroundings, check, parameters, shape,
};
use mpm_core::formula::closest;
use mpm_core::input_file::{self, InputFileError};
use mpm_core::material::Material;
use mpm_files::summary::LawLibrary;
use mpm_foreign::Library;

/// A deck that has passed all checks for which no mesh is needed.
#[derive(Debug, Clone)]
pub struct LoadedDeck {
    /// The deck, with its parameters inserted.
    pub deck: Deck,
    /// The parameters with their final values.
    pub parameters: BTreeMap<String, Parameter>,
    /// Directory of the deck, to which paths in the deck are relative.
    pub directory: PathBuf,
    /// The text with its locations, for messages of later checks.
    pub source: Source,
    /// Warnings and notes, in the order of their locations.
    pub notes: Vec<Diagnostic>,
    /// Laws that replace the laws of the deck, by material name.
    pub laws: BTreeMap<String, OwnLaw>,
    /// True if code of the libraries that the deck names may run, see [`may_run_libraries`](crate::may_run_libraries).
    pub allows_libraries: bool,
}

/// A law that a deck cannot describe.
#[derive(Clone)]
pub struct OwnLaw(pub Arc<dyn Fn() -> Box<dyn Material> + Send + Sync>);

impl fmt::Debug for OwnLaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0().fmt(f)
    }
}

impl LoadedDeck {
    /// The law of a material as it is stated: by a caller of the program, by a library or by the deck. Softening is
    /// adapted to cells of this size. `None` if there is no such material.
    ///
    /// # Errors
    /// The faults of the library that the law comes from, or of the formulas of the properties.
    pub(crate) fn stated_law(
        &self,
        material: &str,
        cells: &CellSize,
    ) -> Option<Result<StatedLaw, Vec<Diagnostic>>> {
        let law = self.effective_law(material, cells)?;
        match self.deck.materials.get(material)?.pore_stiffness(self.deck.water.as_ref()) {
            Some(stiffness) => Some(law.map(|law| law.undrained(stiffness))),
            None => Some(law),
        }
    }

    /// As [`LoadedDeck::stated_law`], without the water that cannot leave the pores.
    fn effective_law(&self, material: &str, cells: &CellSize) -> Option<Result<StatedLaw, Vec<Diagnostic>>> {
        let stated = self.deck.materials.get(material)?;
        if let Some(own) = self.laws.get(material).cloned() {
            return Some(Ok(StatedLaw::constant(move || own.0())));
        }
        if let Some(deck) = stated.law_deck().library() {
            let (source, directory) = (&self.source, self.directory.as_path());
            let is_allowed = self.allows_libraries;
            let law = NamedLibrary { source, directory, name: material, deck, is_allowed }.law();
            return Some(law.map(|law| StatedLaw::constant(move || Box::new(law.clone()))));
        }
        let surroundings = Surroundings {
            parameters: Some(&self.deck.parameters),
            dimensions: self.deck.dimensions(),
            cells: cells.clone(),
        };
        Some(stated.stated_law(&surroundings).map_err(|faults| {
            let fault = |fault: Fault| {
                let at = format!("/materials/{}/{}", escape(material), fault.key);
                let found = Diagnostic::at(&self.source, "D021", &at, fault.error.message);
                found.help(fault.error.help.unwrap_or_default())
            };
            faults.into_iter().map(fault).collect()
        }))
    }

    /// The law of a material for a single point: its softening is adapted to the cells of a structured grid, but not to
    /// those of a mesh. `None` if there is no such material.
    ///
    /// # Errors
    /// The faults of the library that the law comes from, or properties that do not fit together.
    pub fn point_law(&self, material: &str) -> Option<Result<StatedLaw, Vec<Diagnostic>>> {
        let stated = self.stated_law(material, &self.cell_size())?;
        Some(stated.and_then(|stated| match stated.contradiction(&self.source, material) {
            Some(found) => Err(vec![found]),
            None => Ok(stated),
        }))
    }

    /// The size of the cells of a structured grid; unknown for a mesh.
    pub fn cell_size(&self) -> CellSize {
        CellSize::in_deck(&self.deck)
    }

    /// The sides of the cells of a structured grid along each axis, mean values where the grid is graded and those far from
    /// refined places, [length]; `None` for a mesh.
    pub fn cell_sides(&self) -> Option<Vec<f64>> {
        let GridDeck::Structured { size, spacing, unrefined, .. } = &self.deck.grid else { return None };
        let entries =
            unrefined.as_ref().map_or(spacing, |stated| &stated.spacing).entries(self.deck.dimensions());
        Some(entries.iter().zip(size).map(|(entry, size)| size / entry.cells(*size).round()).collect())
    }

    /// True if the law of a material comes from a library.
    pub(crate) fn is_from_library(&self, material: &str) -> bool {
        let stated = self.deck.materials.get(material);
        !self.laws.contains_key(material) && stated.is_some_and(|stated| stated.library().is_some())
    }

    /// The libraries that laws come from, with the hashes of what was loaded or, before that, of their files.
    pub fn law_libraries(&self) -> Vec<LawLibrary> {
        let library = |(name, stated): (&String, &MaterialDeck)| {
            let path = self.directory.join(stated.library().filter(|_| self.is_from_library(name))?);
            let hash = hex(&contents(&path));
            Some(LawLibrary { material: name.clone(), file: path.display().to_string(), hash })
        };
        self.deck.materials.iter().filter_map(library).collect()
    }

    /// A hash of the text of the deck, of the final values of its parameters and of the files that it names: decks with
    /// the same hash describe the same analysis. The hash is the same for all builds of the program.
    pub fn hash(&self) -> String {
        // Writing numbers and words as JSON into a string cannot fail.
        let parameters = serde_json::to_string(&self.parameters).unwrap_or_default();
        let mut bytes = self.source.text().as_bytes().to_vec();
        bytes.push(0);
        bytes.extend(parameters.as_bytes());
        self.add_files(&mut bytes);
        hex(&bytes)
    }

    /// A hash of the files that the deck names.
    pub fn hash_of_files(&self) -> String {
        let mut bytes = Vec::new();
        self.add_files(&mut bytes);
        hex(&bytes)
    }

    fn add_files(&self, bytes: &mut Vec<u8>) {
        let surfaces = self.deck.bodies.iter().flat_map(|body| body.shape.files());
        let libraries = self.deck.materials.values().filter_map(MaterialDeck::library);
        let tools = self.deck.tools.iter().filter_map(|tool| tool.shape.file());
        let named = surfaces.chain(libraries).chain(tools).map(|file| self.directory.join(file));
        for file in self.mesh_path().into_iter().chain(named).filter(|path| path.is_file()) {
            bytes.push(0);
            bytes.extend(contents(&file));
        }
    }

    /// Path of the mesh file, if the grid comes from one.
    pub fn mesh_path(&self) -> Option<PathBuf> {
        match &self.deck.grid {
            GridDeck::Gmsh { file } => Some(self.directory.join(file)),
            GridDeck::Structured { .. } => None,
        }
    }
}

/// The contents of a file that a deck names; of a library, those that were loaded. A file that cannot be read counts as
/// empty: without it, no analysis can run, so none can be confused with another.
fn contents(path: &Path) -> Vec<u8> {
    match Library::contents(path) {
        Some(loaded) => loaded.to_vec(),
        None => input_file::read(path, u64::MAX).unwrap_or_default(),
    }
}

/// A deck that cannot be used.
#[derive(Debug, Clone)]
pub struct LoadFailure {
    /// The text with its locations.
    pub source: Source,
    /// All messages, in the order of their locations; at least one is an error.
    pub diagnostics: Vec<Diagnostic>,
}

impl LoadFailure {
    /// All messages as text, each with the line of the deck that it concerns.
    pub fn render(&self, colour: bool) -> String {
        diagnostic::render_all(&self.source, &self.diagnostics, colour)
    }

    /// The errors on one line.
    pub fn in_one_line(&self) -> String {
        let errors = self.diagnostics.iter().filter(|diagnostic| Diagnostic::is_error(diagnostic));
        let errors: Vec<String> = errors.map(|error| format!("{}: {}", error.code, error.message)).collect();
        errors.join("; ")
    }
}

impl fmt::Display for LoadFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.render(false).trim_end())
    }
}

impl std::error::Error for LoadFailure {}

/// Reads a deck from a file; `overrides` are names and values of parameters that replace those in the deck.
///
/// # Errors
/// All faults that can be found, each with its location.
pub fn load(path: &Path, overrides: &[(String, String)]) -> Result<LoadedDeck, Box<LoadFailure>> {
    let name = path.display().to_string();
    load_text(&name, &read(path)?, overrides)
}

/// Reads the text of a deck from a file, for [`load_text`].
///
/// # Errors
/// If the file cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>, Box<LoadFailure>> {
    input_file::read(path, Source::MAX_BYTES as u64).map_err(|error| {
        let source = Source::without_text(&path.display().to_string());
        Box::new(LoadFailure { source, diagnostics: vec![unreadable(path, &error)] })
    })
}

/// Message about a file that cannot be read; for known causes, it is the same on all systems.
fn unreadable(path: &Path, error: &InputFileError) -> Diagnostic {
    let fault = |what: &str| Diagnostic::error("D001", format!("the deck cannot be read: {what}"));
    let error = match error {
        InputFileError::Io(error) => error,
        InputFileError::TooLarge { .. } => return Source::too_large(),
        error => return fault(&error.to_string()).help("give the path of a YAML file"),
    };
    match error.kind() {
        ErrorKind::NotFound => match similar_file(path) {
            Some(name) => fault("there is no such file").help(format!("did you mean {}?", quote(&name))),
            None => fault("there is no such file").help("give the path of a YAML file"),
        },
        ErrorKind::PermissionDenied => {
            fault("permission is denied").help("change the permissions of the file, or copy it")
        }
        _ => fault(&error.to_string()).help("check that other programs can read the file, or copy it"),
    }
}

/// The deck in the same directory whose name is most similar to that of a missing file.
fn similar_file(path: &Path) -> Option<String> {
    let wanted = path.file_name()?.to_str()?;
    let directory = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    // In a larger directory, only this many entries are searched.
    let entries = std::fs::read_dir(directory).ok()?.take(10_000).flatten();
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.file_name().into_string().ok())
        .filter(|name| name.ends_with(".yaml") || name.ends_with(".yml"))
        .collect();
    names.sort();
    let best = closest(wanted, names.iter().map(String::as_str))?;
    Some(path.with_file_name(best).display().to_string())
}

/// Names of the parameters that the text of a deck defines; `name` stands for the file in messages.
///
/// # Errors
/// If the text is not YAML. Nothing else is checked.
pub fn parameter_names(name: &str, text: &[u8]) -> Result<Vec<String>, Box<LoadFailure>> {
    let (source, value, diagnostics) = Source::read(name, text);
    let Some(deck) = value else { return Err(Box::new(LoadFailure { source, diagnostics })) };
    let parameters = deck.get("parameters").and_then(|parameters| parameters.as_object());
    Ok(parameters.map_or_else(Vec::new, |parameters| parameters.keys().cloned().collect()))
}

/// The keys and values of a deck as they are written, before parameters and expressions are inserted; `name` stands for
/// the file in messages.
///
/// # Errors
/// If the text is not YAML, a key is given twice, or a number is not finite. Nothing else is checked.
pub fn values(name: &str, text: &[u8]) -> Result<Value, Box<LoadFailure>> {
    let (source, value, diagnostics) = Source::read(name, text);
    match value {
        Some(value) if !diagnostics.iter().any(Diagnostic::is_error) => Ok(value),
        _ => Err(Box::new(LoadFailure { source, diagnostics })),
    }
}

/// Reads a deck from text; `name` stands for the file in messages.
///
/// # Errors
/// All faults that can be found, each with its location.
pub fn load_text(
    name: &str,
    text: &[u8],
    overrides: &[(String, String)],
) -> Result<LoadedDeck, Box<LoadFailure>> {
    let (mut source, value, mut diagnostics) = Source::read(name, text);
    let mut deck = None;
    if let Some(mut value) = value {
        parameters::apply(&mut value, &mut source, overrides, &mut diagnostics);
        let before = diagnostics.len();
        let checked = shape::check(value, &mut source, &mut diagnostics);
        diagnostic::assign(Gate::Shape, &mut diagnostics[before..]);
        match checked {
            Ok(mut whole) => {
                let dimensions = whole.dimensions();
                whole.grid.apply_refinement(dimensions);
                deck = Some(whole);
            }
            Err(part) => {
                let mut found = dangling(&part, &source);
                diagnostic::assign(Gate::Meaning, &mut found);
                diagnostics.extend(found);
            }
        }
    }
    if let Some(deck) = &deck {
        let reported: HashSet<(String, &str)> =
            diagnostics.iter().filter_map(|d| Some((d.pointer.clone()?, d.code))).collect();
        let is_new =
            |d: &Diagnostic| d.pointer.as_ref().is_none_or(|at| !reported.contains(&(at.clone(), d.code)));
        diagnostics.extend(check::validate(deck, &source).into_iter().filter(is_new));
        // In a deck with errors, warnings are mostly consequences of the errors.
        if !diagnostics.iter().any(Diagnostic::is_error) {
            diagnostics.extend(check::suspicions(deck, &source));
        }
    }
    diagnostic::sort(&mut diagnostics);
    match deck {
        Some(deck) if !diagnostics.iter().any(Diagnostic::is_error) => {
            let directory = Path::new(name).parent().map(Path::to_path_buf).unwrap_or_default();
            let parameters = deck.parameters.clone();
            let (notes, laws) = (diagnostics, BTreeMap::new());
            Ok(LoadedDeck { parameters, deck, directory, source, notes, laws, allows_libraries: false })
        }
        _ => Err(Box::new(LoadFailure { source, diagnostics })),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hash_depends_on_text_and_values() {
        let text = std::fs::read_to_string("../../inputs/beam.yaml").unwrap();
        let hash = |text: &str, name: &str, value: &str| {
            load_text("deck", text.as_bytes(), &[(name.to_owned(), value.to_owned())]).unwrap().hash()
        };
        let first = hash(&text, "h", "0.5");
        assert_eq!(first.len(), 32);
        assert_eq!(first, hash(&text, "h", "5e-1"));
        assert_eq!(first, hash(&text, "n", "6"), "these are the values in the deck");
        assert_ne!(first, hash(&text, "h", "0.25"));
        assert_ne!(first, hash(&text, "method", "mpm"));
        assert_ne!(first, hash(&text.replace("12e6", "13e6"), "h", "0.5"));
    }
}
