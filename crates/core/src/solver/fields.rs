//! The fields to which the components of the nodal unknowns belong.

use std::ops::Range;

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

    /// The components of each field.
    pub(super) fn components(&self) -> Vec<Range<usize>> {
        self.iter().map(|(_, components)| components).collect()
    }

    /// Total number of components of all fields.
    pub fn n_components(&self) -> usize {
        self.fields.iter().map(|(_, n)| n).sum()
    }
}

/// The Euclidean norm.
pub(super) fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|x| x * x).sum::<f64>().sqrt()
}
