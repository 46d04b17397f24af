//! The fields to which the components of the nodal unknowns belong.

use std::ops::Range;

use super::AXES;

/// A field of the nodal unknowns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Name in messages, tables and files.
    pub name: String,
    /// Number of components at each node.
    pub components: usize,
    /// Unit of the unknowns, and unit of what balances at a node: of reactions and out-of-balance forces. Empty if they
    /// have none.
    pub units: [String; 2],
    /// True if the equations of the field constrain other fields, as those of a pressure that keeps the volume: the
    /// equilibrium is then a saddle point, and negative pivots say nothing about its stability.
    pub is_multiplier: bool,
}

impl Field {
    /// A field with this number of components at each node.
    pub fn new(name: impl Into<String>, components: usize) -> Field {
        Field { name: name.into(), components, units: Default::default(), is_multiplier: false }
    }

    /// The same field with these units of its unknowns and of its reactions.
    #[must_use]
    pub fn with_units(self, unknown: impl Into<String>, reaction: impl Into<String>) -> Field {
        Field { units: [unknown.into(), reaction.into()], ..self }
    }

    /// The same field as multipliers of constraints on other fields.
    #[must_use]
    pub fn as_multiplier(self) -> Field {
        Field { is_multiplier: true, ..self }
    }
}

/// The fields of the nodal unknowns, the displacement first. Each has its own residual, so units do not mix.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fields {
    fields: Vec<Field>,
}

impl Fields {
    /// The displacement along `axes` axes, and no further field.
    pub fn displacement(axes: usize) -> Fields {
        Fields { fields: vec![Field::new("displacement", axes).with_units("length", "force")] }
    }

    /// Appends a further field with this number of components, without units.
    #[must_use]
    pub fn and(self, name: impl Into<String>, components: usize) -> Fields {
        self.and_field(Field::new(name, components))
    }

    /// Appends a further field.
    #[must_use]
    pub fn and_field(mut self, field: Field) -> Fields {
        self.fields.push(field);
        self
    }

    /// Each field, with its range of components.
    pub fn iter(&self) -> impl Iterator<Item = (&Field, Range<usize>)> {
        let ends = self.fields.iter().scan(0, |end, field| {
            *end += field.components;
            Some(*end)
        });
        self.fields.iter().zip(ends).map(|(field, end)| (field, end - field.components..end))
    }

    /// The fields beside the displacement, each with its range of components.
    pub fn further(&self) -> impl Iterator<Item = (&Field, Range<usize>)> {
        self.iter().skip(1)
    }

    /// True if the fields of the unknowns include multipliers of constraints.
    pub fn have_multipliers(&self) -> bool {
        self.fields.iter().any(|field| field.is_multiplier)
    }

    /// The unknown of this component in words: the displacement along an axis, or a further field by its name.
    pub fn unknown(&self, component: usize) -> String {
        match self.iter().enumerate().find(|(_, (_, components))| components.contains(&component)) {
            Some((0, _)) => displacement_along(AXES[component % 3]),
            Some((_, (field, _))) if field.components == 1 => format!("`{}`", field.name),
            Some((_, (field, components))) => {
                format!("component {} of `{}`", component - components.start + 1, field.name)
            }
            None => format!("component {} of the unknowns", component + 1),
        }
    }

    /// The components of each field.
    pub(crate) fn components(&self) -> Vec<Range<usize>> {
        self.iter().map(|(_, components)| components).collect()
    }

    /// Total number of components of all fields.
    pub fn n_components(&self) -> usize {
        self.fields.iter().map(|field| field.components).sum()
    }
}

/// The displacement along a direction, in words.
pub(super) fn displacement_along(direction: &str) -> String {
    format!("the displacement along {direction}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknowns_are_named_after_their_fields() {
        let fields = Fields::displacement(2).and("temperature", 1).and("flux", 2);
        let names: Vec<String> = (0..6).map(|component| fields.unknown(component)).collect();
        let expected = [
            "the displacement along x",
            "the displacement along y",
            "`temperature`",
            "component 1 of `flux`",
            "component 2 of `flux`",
            "component 6 of the unknowns",
        ];
        assert_eq!(names, expected);
    }
}
