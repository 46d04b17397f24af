//! Columns: the values of a field of all points, whatever their type.
//!
//! Kernels read the arrays of the points by their names and types. Code that treats all fields alike, such as a change
//! of the order of the points or a checkpoint, works on their columns. A column has a fixed number of values per point,
//! or no entries at all, which stand for zeros.

use std::any::Any;

use rayon::prelude::*;

use super::PIECE;
use super::value::{PointValues, Restored, Value};

/// The values of a field. Where a function takes another column, it must belong to the same field.
pub trait Column: Any + Send + Sync {
    /// Number of values.
    fn len(&self) -> usize;

    /// Number of components of a value.
    fn width(&self) -> usize;

    /// Changes the number of values; new values are zero.
    fn resize(&mut self, len: usize);

    /// Removes all values and frees their memory.
    fn forget(&mut self);

    /// Exchanges the values with those of another column.
    fn swap(&mut self, other: &mut dyn Column);

    /// Copies the values of another column.
    fn copy(&mut self, other: &dyn Column);

    /// Reorders the values, `n` for each point.
    fn reorder(&mut self, order: &[u32], n: usize);

    /// Like [`Column::reorder`], but into another column of the same length.
    fn reorder_into(&self, order: &[u32], n: usize, room: &mut dyn Column);

    /// Appends another column; `counts` are the numbers of values of both, including values without entries.
    fn append(&mut self, other: &dyn Column, counts: [usize; 2]);

    /// The first `count` values as numbers; zero for values that have no entry.
    fn numbers(&self, count: usize) -> Box<dyn Iterator<Item = f64> + '_>;

    /// The values at the points with these indices as numbers, `n` values each; empty if the column has no entries.
    fn numbers_at(&self, places: &[u32], n: usize) -> Vec<f64>;

    /// Replaces all values by values with these numbers.
    fn take_numbers(&mut self, numbers: &[f64]);

    /// `n` values for each point in this order, as users see them; zero for values that have no entry.
    fn values(&self, n: usize, order: &[usize]) -> PointValues;
}

/// The values of a column of the same field.
fn same<T: 'static>(column: &dyn Column) -> &Vec<T> {
    let column: &dyn Any = column;
    match column.downcast_ref() {
        Some(values) => values,
        None => unreachable!("the columns of a field have the same type"),
    }
}

/// As [`same`], to be changed.
fn same_mut<T: 'static>(column: &mut dyn Column) -> &mut Vec<T> {
    let column: &mut dyn Any = column;
    match column.downcast_mut() {
        Some(values) => values,
        None => unreachable!("the columns of a field have the same type"),
    }
}

impl<T: Restored + 'static> Column for Vec<T> {
    fn len(&self) -> usize {
        Vec::len(self)
    }

    fn width(&self) -> usize {
        T::COMPONENTS
    }

    fn resize(&mut self, len: usize) {
        Vec::resize(self, len, T::ZERO);
    }

    fn forget(&mut self) {
        *self = Vec::new();
    }

    fn swap(&mut self, other: &mut dyn Column) {
        std::mem::swap(self, same_mut(other));
    }

    fn copy(&mut self, other: &dyn Column) {
        self.clone_from(same(other));
    }

    fn reorder(&mut self, order: &[u32], n: usize) {
        *self = gather(self, order, n);
    }

    fn reorder_into(&self, order: &[u32], n: usize, room: &mut dyn Column) {
        let places = same_mut::<T>(room).par_chunks_exact_mut(n.max(1)).with_min_len(PIECE);
        places.zip(order).for_each(|(place, &p)| place.copy_from_slice(&self[p as usize * n..][..n]));
    }

    fn append(&mut self, other: &dyn Column, counts: [usize; 2]) {
        append(self, same(other), counts);
    }

    fn numbers(&self, count: usize) -> Box<dyn Iterator<Item = f64> + '_> {
        let n = T::COMPONENTS;
        Box::new((0..count * n).map(move |k| self.get(k / n).map_or(0.0, |value| value.number(k % n))))
    }

    fn numbers_at(&self, places: &[u32], n: usize) -> Vec<f64> {
        if self.is_empty() {
            return Vec::new();
        }
        let mut numbers = Vec::with_capacity(places.len() * n * T::COMPONENTS);
        for &p in places {
            for value in &self[p as usize * n..][..n] {
                (0..T::COMPONENTS).for_each(|c| numbers.push(value.number(c)));
            }
        }
        numbers
    }

    fn take_numbers(&mut self, numbers: &[f64]) {
        *self = numbers.chunks_exact(T::COMPONENTS).map(T::from_numbers).collect();
    }

    fn values(&self, n: usize, order: &[usize]) -> PointValues {
        PointValues::stored(self, n, order)
    }
}

/// Reorders the values of points, `n` for each point; empty if there are no values.
pub(super) fn gather<T: Copy + Send + Sync>(values: &[T], order: &[u32], n: usize) -> Vec<T> {
    if values.is_empty() {
        Vec::new()
    } else if n == 1 {
        order.par_iter().with_min_len(PIECE).map(|&p| values[p as usize]).collect()
    } else {
        order.iter().flat_map(|&p| &values[p as usize * n..][..n]).copied().collect()
    }
}

/// Appends `others` to `values`; `counts` are the lengths of both, and an array without entries stands for zeros.
pub(super) fn append<T: Value>(values: &mut Vec<T>, others: &[T], counts: [usize; 2]) {
    if values.is_empty() && others.is_empty() {
        return;
    }
    // Growth by doubling would take twice the memory even when few points arrive.
    values.reserve_exact((counts[0] + counts[1]).saturating_sub(values.len()));
    values.resize(counts[0], T::ZERO);
    values.extend(others);
    values.resize(counts[0] + counts[1], T::ZERO);
}
