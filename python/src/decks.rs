//! Decks: reading, writing and checking.

use mpm::codes;
use mpm::deck::diagnostic::{as_json, render_all};
use mpm::deck::load::{read as read_bytes, values};
use mpm::deck::schema::deck_schema;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::Raised;
use crate::preparation::{DeckText, loaded, pool, prepared};

/// The bytes of a deck and its values as JSON.
#[pyfunction]
pub fn read(py: Python<'_>, path: std::path::PathBuf) -> PyResult<(Py<PyBytes>, String)> {
    let found = py.detach(|| {
        let text = read_bytes(&path)?;
        let value = values(&path.display().to_string(), &text)?;
        Ok((text, value.to_string()))
    });
    let (text, value) = found.map_err(Raised::Deck)?;
    Ok((PyBytes::new(py, &text).unbind(), value))
}

/// Converts a deck from JSON to YAML.
#[pyfunction]
pub fn dump(document: &str) -> PyResult<String> {
    let invalid =
        |error: &dyn std::fmt::Display| Raised::misuse(format!("the deck cannot be written: {error}"));
    let value: serde_json::Value = serde_json::from_str(document).map_err(|error| invalid(&error))?;
    Ok(serde_yaml::to_string(&value).map_err(|error| invalid(&error))?)
}

/// Does everything that precedes the first load step, and returns the messages about the deck, as JSON and as text.
#[pyfunction]
pub fn check(
    py: Python<'_>,
    name: &str,
    text: &[u8],
    overrides: Vec<(String, String)>,
    allow_libraries: bool,
) -> PyResult<(String, String)> {
    let deck = DeckText { name, text, overrides: &overrides, allow_libraries };
    py.detach(|| {
        let (source, diagnostics) = match loaded(deck).and_then(|loaded| prepared(loaded, &pool(Some(1))?)) {
            Ok(ready) => (ready.loaded.source, ready.loaded.notes),
            Err(Raised::Deck(failure)) => (failure.source, failure.diagnostics),
            Err(other) => return Err(other),
        };
        let text = render_all(&source, &diagnostics, false).trim_end().to_owned();
        Ok((as_json(&source, &diagnostics).to_string(), text))
    })
    .map_err(PyErr::from)
}

/// The schema of decks as JSON.
#[pyfunction]
pub fn schema() -> String {
    deck_schema().to_string()
}

/// The page about a message code; `None` if there is no such code.
#[pyfunction]
pub fn text_of_code(code: &str) -> Option<&'static str> {
    codes::page(code).map(|page| page.text)
}
