//! Fields of the points that only some analyses need, declared at run time.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::column::{append, gather};
use super::declare::FieldKind;
use crate::counted::counted;

/// Largest number of components per point of a further field.
const MAX_COMPONENTS: usize = 1 << 10;

/// A further field with its initial values.
#[derive(Debug, Clone, PartialEq)]
pub struct PointFieldSpec {
    /// Name in files, checkpoints and arrays: letters, digits and underscores, starting with a letter.
    pub name: String,
    /// Unit, `-` for plain numbers.
    pub unit: String,
    /// Number of components per point. Files treat 3 components as a vector, 6 as a symmetric tensor in the order xx,
    /// yy, zz, xy, yz, xz without factors √2, and 9 as a tensor row by row.
    pub components: usize,
    /// When the field changes.
    pub kind: FieldKind,
    /// Initial values: all components of the point with the lowest permanent number, then those of the next point, and
    /// so on.
    pub start: Vec<f64>,
}

/// Name, shape and kind of a further field, as stored in checkpoints.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FurtherField {
    /// Name of the field.
    pub name: String,
    /// Unit, `-` for plain numbers.
    pub unit: String,
    /// Number of components per point.
    pub components: usize,
    /// When the field changes.
    pub kind: FieldKind,
}

impl fmt::Display for FurtherField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FurtherField { unit, components, .. } = self;
        let kind = match self.kind {
            FieldKind::Fixed => "fixed data",
            FieldKind::Motion => "a motion",
            FieldKind::Answer => "a response",
        };
        write!(f, "{kind} ({components} per point, in [{unit}])")
    }
}

/// A further field that cannot be declared.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FieldError {
    /// The name contains characters other than letters, digits and underscores, or does not start with a letter.
    #[error(
        "`{0}` cannot be the name of a point field: use letters, digits and underscores, starting with a letter"
    )]
    Name(String),
    /// Another field already has the name.
    #[error("there is already a point field `{0}`")]
    Taken(String),
    /// There are no components, or too many.
    #[error("the field `{name}` has {components} components; 1 to {MAX_COMPONENTS} are possible")]
    Components {
        /// Name of the field.
        name: String,
        /// Number of components per point.
        components: usize,
    },
    /// The number of initial values does not match the number of points.
    #[error(
        "the field `{name}` has {}, but needs {wanted}", counted(*.found, "initial value", "initial values")
    )]
    Length {
        /// Name of the field.
        name: String,
        /// Number of initial values.
        found: usize,
        /// Number of points times number of components.
        wanted: usize,
    },
    /// An initial value is infinite or NaN.
    #[error("the initial value of the field `{name}` at point {point} is {value}")]
    NotFinite {
        /// Name of the field.
        name: String,
        /// Permanent number of the point.
        point: usize,
        /// The value.
        value: String,
    },
}

/// A handle to a further field, valid only for the points for which the field was declared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FieldHandle(usize);

/// All further fields of some points. Values are in the current order of the points, as in the declared fields; the
/// components of a point are consecutive.
#[derive(Debug, Clone, Default)]
pub struct Further {
    fields: Vec<Kept>,
}

/// A further field and its values.
#[derive(Debug, Clone)]
struct Kept {
    field: FurtherField,
    converged: Vec<f64>,
    /// Trial values: always present for responses of laws, and for fields of the motion once they have been written;
    /// otherwise empty.
    trial: Vec<f64>,
}

impl Further {
    /// Adds a field; `id` lists the permanent numbers of the points in their current order, and `taken` is true for
    /// names that declared fields and arrays use.
    ///
    /// # Errors
    /// [`FieldError`].
    pub(super) fn declare(
        &mut self,
        spec: PointFieldSpec,
        id: &[u32],
        taken: impl Fn(&str) -> bool,
    ) -> Result<FieldHandle, FieldError> {
        let PointFieldSpec { name, unit, components, kind, start } = spec;
        let is_word = name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
        if !is_word || !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return Err(FieldError::Name(name));
        }
        if taken(&name) || self.handle(&name).is_some() {
            return Err(FieldError::Taken(name));
        }
        if !(1..=MAX_COMPONENTS).contains(&components) {
            return Err(FieldError::Components { name, components });
        }
        let (found, wanted) = (start.len(), id.len() * components);
        if found != wanted {
            return Err(FieldError::Length { name, found, wanted });
        }
        let mut by_id: Vec<usize> = (0..id.len()).collect();
        by_id.sort_by_key(|p| id[*p]);
        if let Some(place) = start.iter().position(|value| !value.is_finite()) {
            let (point, value) = (id[by_id[place / components]] as usize, start[place].to_string());
            return Err(FieldError::NotFinite { name, point, value });
        }
        let mut rank = vec![0; id.len()];
        by_id.iter().enumerate().for_each(|(k, p)| rank[*p] = k as u32);
        let converged = gather(&start, &rank, components);
        let trial = if kind == FieldKind::Answer { converged.clone() } else { Vec::new() };
        self.fields.push(Kept { field: FurtherField { name, unit, components, kind }, converged, trial });
        Ok(FieldHandle(self.fields.len() - 1))
    }

    /// True if there are no further fields.
    pub fn is_empty(&self) -> bool {
        self.fields.is_empty()
    }

    /// The fields in the order of their declaration.
    pub fn iter(&self) -> impl Iterator<Item = (FieldHandle, &FurtherField)> {
        self.fields.iter().enumerate().map(|(k, kept)| (FieldHandle(k), &kept.field))
    }

    /// The handle of the field with this name.
    pub fn handle(&self, name: &str) -> Option<FieldHandle> {
        self.fields.iter().position(|kept| kept.field.name == name).map(FieldHandle)
    }

    /// Name, shape and kind of a field.
    pub fn field(&self, handle: FieldHandle) -> &FurtherField {
        &self.fields[handle.0].field
    }

    /// Values at the end of the last equilibrated step.
    pub fn converged(&self, handle: FieldHandle) -> &[f64] {
        &self.fields[handle.0].converged
    }

    /// Values of the current step: those at its end if they exist, otherwise those at its start.
    pub fn trial(&self, handle: FieldHandle) -> &[f64] {
        let kept = &self.fields[handle.0];
        if kept.trial.is_empty() { &kept.converged } else { &kept.trial }
    }

    /// Mutable values of the current step; empty for a fixed field. The first call in a step initialises the values of
    /// a field of the motion with the converged ones.
    pub fn trial_mut(&mut self, handle: FieldHandle) -> &mut [f64] {
        let Kept { field, converged, trial } = &mut self.fields[handle.0];
        if field.kind == FieldKind::Motion && trial.is_empty() {
            trial.clone_from(converged);
        }
        trial
    }

    /// Makes the trial values the converged ones. Responses are copied, not moved: trial values that the next step does
    /// not overwrite remain.
    pub(super) fn commit(&mut self) {
        for Kept { field, converged, trial } in &mut self.fields {
            match field.kind {
                FieldKind::Fixed => (),
                FieldKind::Answer => converged.copy_from_slice(trial),
                FieldKind::Motion if trial.is_empty() => (),
                FieldKind::Motion => *converged = std::mem::take(trial),
            }
        }
    }

    /// Rearranges the values into another order of the points and discards trial values.
    pub(super) fn reorder(&mut self, order: &[u32]) {
        for Kept { field, converged, .. } in &mut self.fields {
            *converged = gather(converged, order, field.components);
        }
        self.begin();
    }

    /// Appends the values of other points, with zeros for the fields that those points lack.
    pub(super) fn append(&mut self, other: &Further, counts: [usize; 2]) {
        for Kept { field, converged, .. } in &mut self.fields {
            let others = other.handle(&field.name).map_or(&[][..], |handle| other.converged(handle));
            append(converged, others, counts.map(|n| n * field.components));
        }
        self.begin();
    }

    /// The same fields without points.
    pub(super) fn emptied(&self) -> Further {
        let mut emptied = self.clone();
        for Kept { converged, trial, .. } in &mut emptied.fields {
            (*converged, *trial) = (Vec::new(), Vec::new());
        }
        emptied
    }

    /// Replaces the converged values, field by field; fields without values become zero at all `n` points.
    pub(super) fn take(&mut self, values: Vec<Vec<f64>>, n: usize) {
        for (Kept { field, converged, .. }, values) in self.fields.iter_mut().zip(values) {
            *converged = values;
            converged.resize(n * field.components, 0.0);
        }
        self.begin();
    }

    /// Resets the trial values for a step that begins from the converged state.
    pub(super) fn begin(&mut self) {
        for Kept { field, converged, trial } in &mut self.fields {
            match field.kind {
                FieldKind::Answer => trial.clone_from(converged),
                FieldKind::Fixed | FieldKind::Motion => *trial = Vec::new(),
            }
        }
    }

    /// The converged values, for changes between two steps.
    pub(crate) fn converged_mut(&mut self, handle: FieldHandle) -> &mut [f64] {
        &mut self.fields[handle.0].converged
    }

    /// Replaces the converged values.
    ///
    /// # Panics
    /// If their number differs.
    pub fn restore(&mut self, handle: FieldHandle, values: &[f64]) {
        let kept = &mut self.fields[handle.0];
        kept.converged.copy_from_slice(values);
        self.begin();
    }
}
