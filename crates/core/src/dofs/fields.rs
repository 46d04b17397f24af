//! The fields to which the components of the nodal unknowns belong.

use std::ops::Range;

use super::AXES;

/// The fields of the nodal unknowns. Each has its own residual, so units do not mix.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fields {
    fields: Vec<(String, usize)>,
}

impl Fields {
    /// The displacement along `axes` axes, and no further field.
    pub fn displacement(axes: usize) -> Fields {
        Fields { fields: vec![("displacement".to_owned(), axes)] }
    }

    /// Appends a further field with this number of components.
    pub fn and(mut self, name: impl Into<String>, components: usize) -> Fields {
        self.fields.push((name.into(), components));
        self
    }

    /// The name of each field, with its range of components.
    pub fn iter(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        let ends = self.fields.iter().scan(0, |end, (_, n)| {
            *end += n;
            Some(*end)
        });
        self.fields.iter().zip(ends).map(|((name, n), end)| (name.as_str(), end - n..end))
    }

    /// The unknown of this component in words: the displacement along an axis, or a further field by its name.
    pub fn unknown(&self, component: usize) -> String {
        match self.iter().enumerate().find(|(_, (_, components))| components.contains(&component)) {
            Some((0, _)) => displacement_along(AXES[component % 3]),
            Some((_, (name, components))) if components.len() == 1 => format!("`{name}`"),
            Some((_, (name, components))) => {
                format!("component {} of `{name}`", component - components.start + 1)
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
        self.fields.iter().map(|(_, n)| n).sum()
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
