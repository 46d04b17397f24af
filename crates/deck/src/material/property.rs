//! Properties of materials: numbers, or formulas of the original position.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;

use super::cell_size::CellSize;
use crate::formulas::{Fault, at_start};
use crate::{Expression, Parameter};
use mpm_core::formula::Formula;
use mpm_core::material::{PropertiesAt, VaryingProperty};

/// A property of a law: a number, or the index of its value among the varying properties of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Setting {
    /// The same everywhere.
    Constant(f64),
    /// The value at this index.
    Varies(usize),
}

impl Setting {
    /// The value of the property at a point with these varying properties.
    pub fn at(self, properties: &[f64]) -> f64 {
        match self {
            Setting::Constant(value) => value,
            Setting::Varies(place) => properties[place],
        }
    }
}

/// The properties of a material as they are read.
pub(super) struct Settings<'a> {
    parameters: &'a BTreeMap<String, Parameter>,
    dimensions: usize,
    formulas: Vec<Formula>,
    varying: Vec<Varying>,
    /// Cell size, if it varies; its value comes after the values of the formulas.
    cells: Option<CellSize>,
    pub(super) faults: Vec<Fault>,
}

/// A property that varies.
#[derive(Debug, Clone, PartialEq)]
pub struct Varying {
    /// Key in the material, such as `cohesion` or `softening/strain`.
    pub key: String,
    unit: &'static str,
}

impl Varying {
    /// The property, with a typical value.
    pub(super) fn typically(&self, typical: f64) -> VaryingProperty {
        VaryingProperty {
            name: Cow::Owned(self.key.replace('/', "_")),
            unit: Cow::Borrowed(self.unit),
            typical,
        }
    }
}

impl<'a> Settings<'a> {
    pub(super) fn new(parameters: &'a BTreeMap<String, Parameter>, dimensions: usize) -> Self {
        Settings {
            parameters,
            dimensions,
            formulas: Vec::new(),
            varying: Vec::new(),
            cells: None,
            faults: Vec::new(),
        }
    }

    /// Reads a property.
    pub(super) fn read(&mut self, key: &str, unit: &'static str, given: &Expression) -> Setting {
        if let Expression::Number(value) = given {
            return Setting::Constant(*value);
        }
        let formula = match at_start(vec![(key.to_owned(), given)], self.parameters, self.dimensions) {
            Ok(formulas) => formulas.into_iter().next().unwrap_or_else(|| Formula::constant(f64::NAN)),
            Err(faults) => {
                self.faults.extend(faults);
                return Setting::Constant(f64::NAN);
            }
        };
        match formula.as_constant() {
            Some(value) => Setting::Constant(value),
            None => {
                self.formulas.push(formula);
                self.varying.push(Varying { key: key.to_owned(), unit });
                Setting::Varies(self.varying.len() - 1)
            }
        }
    }

    /// The cell size; all formulas must already have been read.
    pub(super) fn cell_size(&mut self, cells: &CellSize) -> Option<Setting> {
        match cells {
            CellSize::Unknown => None,
            CellSize::Even(size) | CellSize::Mean(size) => Some(Setting::Constant(*size)),
            CellSize::Graded(_) => {
                self.cells = Some(cells.clone());
                self.varying.push(Varying { key: "cell_size".to_owned(), unit: "length" });
                Some(Setting::Varies(self.varying.len() - 1))
            }
        }
    }

    /// The properties that vary, and their values at a position.
    pub(super) fn finish(self) -> (Vec<Varying>, Arc<PropertiesAt>) {
        let Settings { formulas, cells, varying, dimensions, .. } = self;
        let at = Arc::new(move |position: &[f64; 3]| -> Vec<f64> {
            let values = formulas.iter().map(|formula| formula.evaluate(&position[..dimensions.min(3)]));
            values.chain(cells.iter().map(|cells| cells.at(position))).collect()
        });
        (varying, at)
    }
}

/// The values that a property may have.
#[derive(Debug, Clone, PartialEq)]
pub struct Range(pub(super) Value);

impl Range {
    /// True if the value is finite and in the range.
    pub fn contains(&self, value: f64) -> bool {
        let limit = |key: &str| self.0.get(key).and_then(Value::as_f64);
        value.is_finite()
            && limit("minimum").is_none_or(|low| value >= low)
            && limit("exclusiveMinimum").is_none_or(|low| value > low)
            && limit("maximum").is_none_or(|high| value <= high)
            && limit("exclusiveMaximum").is_none_or(|high| value < high)
    }

    /// The limits of the range in words, such as "above 0 and below 1"; `finite` without limits.
    pub fn in_words(&self) -> String {
        crate::schema::range_in_words(&self.0).unwrap_or_else(|| "finite".to_owned())
    }
}
