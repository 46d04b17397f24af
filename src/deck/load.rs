//! From a file to a deck that can be used, or to all messages about why it cannot.

use std::collections::BTreeMap;
use std::fmt;
use std::io::Read;
use std::path::Path;

use super::diagnostic::{self, Diagnostic};
use super::source::Source;
use super::{Deck, Expression, Parameter, parameters, shape, validate};
use crate::formula::{Formula, FormulaError};

/// A deck that passed every check which needs no mesh.
#[derive(Debug, Clone)]
pub struct LoadedDeck {
    /// The deck, its parameters inserted.
    pub deck: Deck,
    /// The parameters with their final values.
    pub parameters: BTreeMap<String, Parameter>,
    /// The text and its places, for messages of later checks.
    pub source: Source,
    /// Warnings and notes, in the order of their places.
    pub notes: Vec<Diagnostic>,
}

/// Why a deck cannot be used.
#[derive(Debug, Clone)]
pub struct LoadFailure {
    /// The text and its places.
    pub source: Source,
    /// All messages, in the order of their places; at least one is an error.
    pub diagnostics: Vec<Diagnostic>,
}

impl LoadFailure {
    /// All messages as text, each with its line of the deck.
    pub fn render(&self, colour: bool) -> String {
        diagnostic::render_all(&self.source, &self.diagnostics, colour)
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
/// All faults that can be found, each with its place.
pub fn load(path: &Path, overrides: &[(String, String)]) -> Result<LoadedDeck, Box<LoadFailure>> {
    let name = path.display().to_string();
    match read_bounded(path) {
        Ok(text) => load_text(&name, &text, overrides),
        Err(error) => {
            let diagnostic = Diagnostic::error("D001", format!("the deck cannot be read: {error}"));
            Err(Box::new(LoadFailure { source: Source::without_text(&name), diagnostics: vec![diagnostic] }))
        }
    }
}

/// Reads just enough of a file to know that it is too large, should it be (a device never ends).
fn read_bounded(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut text = Vec::new();
    let limit = Source::MAX_BYTES as u64 + 1;
    std::fs::File::open(path)?.take(limit).read_to_end(&mut text)?;
    Ok(text)
}

/// Reads a deck from text; `name` stands for the file in messages.
///
/// # Errors
/// All faults that can be found, each with its place.
pub fn load_text(
    name: &str,
    text: &[u8],
    overrides: &[(String, String)],
) -> Result<LoadedDeck, Box<LoadFailure>> {
    let (mut source, value, mut diagnostics) = Source::read(name, text);
    let mut deck = None;
    if let Some(mut value) = value {
        parameters::apply(&mut value, &mut source, overrides, &mut diagnostics);
        deck = shape::check(value, &source, &mut diagnostics);
    }
    if let Some(deck) = &deck {
        diagnostics.extend(validate::validate(deck, &source));
    }
    diagnostic::sort(&mut diagnostics);
    match deck {
        Some(deck) if !diagnostics.iter().any(Diagnostic::is_error) => {
            Ok(LoadedDeck { parameters: deck.parameters.clone(), deck, source, notes: diagnostics })
        }
        _ => Err(Box::new(LoadFailure { source, diagnostics })),
    }
}

impl Expression {
    /// The formula of x and y that this stands for; the names of numeric parameters are known in it.
    ///
    /// # Errors
    /// The first fault of the text. A deck that passed its checks has none.
    pub fn formula(&self, parameters: &BTreeMap<String, Parameter>) -> Result<Formula, FormulaError> {
        match self {
            Expression::Number(value) => Ok(Formula::constant(*value)),
            Expression::Formula(text) => {
                let constants: Vec<(&str, f64)> = parameters
                    .iter()
                    .filter_map(|(name, parameter)| match parameter {
                        Parameter::Number(value) => Some((name.as_str(), *value)),
                        Parameter::Word(_) => None,
                    })
                    .collect();
                Formula::parse_with_constants(text, &["x", "y"], &constants)
            }
        }
    }
}
