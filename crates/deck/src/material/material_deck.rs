//! What a material of a deck states: its properties, their ranges, and the law that they form.

use std::collections::BTreeMap;

use serde_json::Value;

use super::property::{Range, Settings};
use super::reading::Reading;
use super::stated_law::{StatedLaw, Surroundings};
use crate::formulas::Fault;
use crate::schema::{resolve, strict_schema};
use crate::{Drainage, Expression, MaterialDeck};
use mpm_core::material::Material;

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

    /// Reads the properties of the material.
    ///
    /// # Errors
    /// The faults of its formulas.
    pub fn stated_law(&self, surroundings: &Surroundings) -> Result<StatedLaw, Vec<Fault>> {
        let none = BTreeMap::new();
        let Surroundings { parameters, dimensions, cells } = surroundings;
        let settings = Settings::new(parameters.unwrap_or(&none), *dimensions);
        self.law_deck().read(Reading::new(settings, cells))
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
        let stated = self.stated_law(&Surroundings::default()).map_err(first)?;
        match (stated.consistency)(&[]) {
            None if self.drainage() == Some(Drainage::Undrained) => match self.pore_stiffness(None) {
                Some(stiffness) => Ok(stated.undrained(stiffness).law(&[0.0; 3])),
                None => {
                    Err("`drainage: undrained` needs `undrained_poisson` in a law without a deck".to_owned())
                }
            },
            None => Ok(stated.law(&[0.0; 3])),
            Some(found) => Err(found.message),
        }
    }

    /// The first property out of its range, or the first contradiction, at a point where the varying properties have
    /// these values.
    pub fn fault_at(&self, stated: &StatedLaw, properties: &[f64]) -> Option<String> {
        for (varying, value) in stated.varying.iter().zip(properties) {
            let range = self.range(&varying.key);
            if !range.contains(*value) {
                return Some(format!("`{}` is {value}; it must be {}", varying.key, range.in_words()));
            }
        }
        (stated.consistency)(properties).map(|found| found.message)
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
            Value::String(text)
                if !["model", "match", "strength", "file", "drainage"].contains(&key.as_str()) =>
            {
                found.push((path, Expression::Formula(text.clone())));
            }
            Value::Object(_) => collect(&path, value, found),
            _ => {}
        }
    }
}
