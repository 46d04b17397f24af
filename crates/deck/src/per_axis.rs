//! One value for each axis.

use super::PerAxis;

/// The entries of a list; missing ones are zero.
pub(crate) fn array<const D: usize>(values: &[f64]) -> [f64; D] {
    std::array::from_fn(|d| values.get(d).copied().unwrap_or(0.0))
}

/// One value for each axis.
pub(crate) fn per_axis<T: Copy + Default, const D: usize>(value: &PerAxis<T>) -> [T; D] {
    match value {
        PerAxis::Same(value) => [*value; D],
        PerAxis::Each(values) => std::array::from_fn(|d| values.get(d).copied().unwrap_or_default()),
    }
}
