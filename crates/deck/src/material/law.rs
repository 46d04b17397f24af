//! From the properties of a material to its law.

use std::collections::BTreeMap;

use super::MaterialDeck;
use super::built_law::BuiltLaw;
use super::cell_size::CellSize;
use super::laws;
use super::property::Settings;
use super::reading::Reading;
use crate::Parameter;
use crate::formulas::Fault;
use mpm_core::material::Material;

/// What the properties of a material may refer to.
#[derive(Debug, Clone, Default)]
pub struct Surroundings<'a> {
    /// Parameters of the deck.
    pub parameters: Option<&'a BTreeMap<String, Parameter>>,
    /// Number of axes.
    pub dimensions: usize,
    /// Position at which the properties have typical values, [length]: that of a point of a body of the material;
    /// before bodies are filled, the centre of the box around such a body; the origin if there is no such body.
    pub typical: [f64; 3],
    /// Size of the cells.
    pub cells: CellSize,
}

impl MaterialDeck {
    /// The first property out of its range, or the first contradiction, at a point where the varying properties have
    /// these values.
    pub fn fault_at(&self, built: &BuiltLaw, properties: &[f64]) -> Option<String> {
        for (varying, value) in built.varying.iter().zip(properties) {
            let range = self.range(&varying.key);
            if !range.contains(*value) {
                return Some(format!("`{}` is {value}; it must be {}", varying.key, range.in_words()));
            }
        }
        (built.consistency)(properties).map(|found| found.message)
    }

    /// The law of the material, formed without a deck; no property of the material may vary.
    ///
    /// # Errors
    /// The first fault or contradiction.
    pub fn law_alone(&self) -> Result<Box<dyn Material>, String> {
        let first = |faults: Vec<Fault>| {
            let text = |fault: Fault| format!("`{}`: {}", fault.key, fault.error.message);
            faults.into_iter().next().map(text).unwrap_or_default()
        };
        let built = self.law(&Surroundings::default()).map_err(first)?;
        match (built.consistency)(&[]) {
            None => Ok(built.law),
            Some(found) => Err(found.message),
        }
    }

    /// The law of the material.
    ///
    /// # Errors
    /// The faults of its formulas.
    pub fn law(&self, surroundings: &Surroundings) -> Result<BuiltLaw, Vec<Fault>> {
        let none = BTreeMap::new();
        let Surroundings { parameters, dimensions, typical, cells } = surroundings;
        let read = Reading::new(Settings::new(parameters.unwrap_or(&none), *dimensions, *typical), cells);
        laws::of(self, read)
    }
}
