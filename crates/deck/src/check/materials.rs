//! The properties of materials.

use super::Check;
use crate::Expression;
use crate::formulas::at_start;
use crate::gates::Checks;
use crate::laws::MaterialDeck;
use crate::material::Surroundings;
use crate::quoting::quote;
use crate::span::escape;

impl Check<'_> {
    /// Checks the formulas of a material that have the same value everywhere; numbers have been checked with the shape
    /// of the deck, and formulas that vary are checked at the points. Returns true if all numbers and all of these
    /// formulas are in their ranges.
    fn ranges(&mut self, pointer: &str, material: &MaterialDeck) -> bool {
        let mut are_in_range = true;
        for (key, given) in material.properties() {
            let value = match &given {
                Expression::Number(value) => Some(*value),
                Expression::Formula(_) => {
                    let formulas =
                        at_start(vec![(key.clone(), &given)], &self.deck.parameters, self.dimensions());
                    formulas.ok().and_then(|formulas| formulas.first()?.as_constant())
                }
            };
            let range = material.range(&key);
            let Some(value) = value.filter(|value| !range.contains(*value)) else { continue };
            are_in_range = false;
            if let Expression::Formula(text) = &given {
                let message = format!("`{text}` is {value}");
                let help = format!("must be {}", range.in_words());
                self.error("D009", &format!("{pointer}/{key}"), message, help);
            }
        }
        are_in_range
    }

    /// Checks the properties of all materials, except those that vary from point to point.
    pub(super) fn materials(&mut self) {
        let deck = self.deck;
        for (name, material) in &deck.materials {
            let pointer = format!("/materials/{}", escape(name));
            let surroundings = Surroundings {
                parameters: Some(&deck.parameters),
                dimensions: self.dimensions(),
                ..Surroundings::default()
            };
            if let Some(density) = material.density() {
                let density = vec![("density".to_owned(), density)];
                let faults = at_start(density, &deck.parameters, self.dimensions()).err();
                self.formulas(&pointer, faults.unwrap_or_default());
            }
            if material.library().is_some() {
                continue;
            }
            let is_in_range = self.ranges(&pointer, material);
            match material.stated_law(&surroundings) {
                Err(faults) => self.formulas(&pointer, faults),
                // A contradiction may be a consequence of a value out of its range.
                Ok(stated) if stated.varying.is_empty() && is_in_range => {
                    if let Some(found) = (stated.consistency)(&[]) {
                        let message = format!("material {}: {}", quote(name), found.message);
                        if found.key.is_empty() {
                            self.error_at_key("D057", &pointer, message, &found.help);
                        } else {
                            self.error("D057", &format!("{pointer}/{}", found.key), message, found.help);
                        }
                    }
                }
                Ok(_) => {}
            }
        }
        for (number, body) in deck.bodies.iter().enumerate() {
            let material = deck.materials.get(&body.material);
            if material.is_some_and(MaterialDeck::needs_initial_stress) && body.initial_stress.is_none() {
                let message = format!(
                    "the body {} has no `initial_stress`, but its material {} has no stress-free state",
                    quote(&body.name),
                    quote(&body.material)
                );
                let help = "add `initial_stress: {type: geostatic, ...}` or `{type: components, ...}`, with compression everywhere";
                self.error("D059", &format!("/bodies/{number}"), message, help);
            }
        }
    }
}
