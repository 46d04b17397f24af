//! Properties of materials: numbers, or formulas of the original position.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use serde_json::Value;

use super::cell_size::CellSize;
use crate::formulas::{Fault, at_start};
use crate::schema::{resolve, strict_schema};
use crate::{Expression, MaterialDeck, Parameter};
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

impl MaterialDeck {
    /// The numbers and formulas of the material, each with its key, such as `cohesion` or `softening/strain`.
    pub fn properties(&self) -> Vec<(String, Expression)> {
        let mut found = Vec::new();
        collect("", &serde_json::to_value(self).unwrap_or_default(), &mut found);
        found
    }

    /// The name of the law.
    pub fn model(&self) -> String {
        let value = serde_json::to_value(self).unwrap_or_default();
        value["model"].as_str().unwrap_or_default().to_owned()
    }

    /// The range of a property as the schema of decks states it.
    pub fn range(&self, key: &str) -> Range {
        let variant = strict_schema().pointer("/definitions/MaterialDeck/allOf");
        let is_own = |branch: &&Value| {
            branch.pointer("/if/properties/model/const").and_then(Value::as_str) == Some(&self.model())
        };
        let branch = variant.and_then(Value::as_array).and_then(|branches| branches.iter().find(is_own));
        let mut schema = branch.and_then(|branch| branch.get("then"));
        for part in key.split('/') {
            let key = format!("/properties/{part}");
            schema = schema.and_then(|of| {
                let choices = [Some(of), Some(resolve(of)), of.pointer("/anyOf/0").map(resolve)];
                choices.into_iter().flatten().find_map(|of| of.pointer(&key))
            });
        }
        Range(schema.cloned().unwrap_or_default())
    }
}

/// Adds the numbers and strings of a mapping, except words chosen from a fixed list and the path of a file.
fn collect(prefix: &str, value: &Value, found: &mut Vec<(String, Expression)>) {
    for (key, value) in value.as_object().into_iter().flatten() {
        let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}/{key}") };
        match value {
            Value::Number(number) => {
                found.push((path, Expression::Number(number.as_f64().unwrap_or(f64::NAN))))
            }
            Value::String(text) if !["model", "match", "strength", "file"].contains(&key.as_str()) => {
                found.push((path, Expression::Formula(text.clone())));
            }
            Value::Object(_) => collect(&path, value, found),
            _ => {}
        }
    }
}

/// The values that a property may have.
#[derive(Debug, Clone, PartialEq)]
pub struct Range(Value);

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
