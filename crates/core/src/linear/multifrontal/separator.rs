//! A dense front that is assembled from the matrices that other factorisations have left for their kept unknowns.

use std::ops::Range;

use super::elimination::add_rows;
use super::{Multifrontal, dense};

/// Largest number of values in a message, unless a single column has more values.
const MESSAGE: usize = 1 << 19;

/// Columns of a matrix left for kept unknowns, without the entries above the diagonal: for each factor, column by
/// column.
pub(in crate::linear) struct Columns<'a> {
    /// Order of the matrix.
    pub n: usize,
    pub range: Range<usize>,
    pub numbers: Numbers<'a>,
}

/// The location of the values of columns.
#[derive(Clone, Copy)]
pub(in crate::linear) enum Numbers<'a> {
    /// In a matrix whose first stored column has this index.
    From(usize, &'a [f64]),
    /// One after another.
    Packed(&'a [f64]),
}

impl Columns<'_> {
    /// Number of values of one factor.
    fn len(&self) -> usize {
        self.range.clone().map(|column| self.n - column).sum()
    }

    /// Calls `visit` with the index and the values of each column of one of the `factors`.
    fn for_each(&self, factor: usize, factors: usize, mut visit: impl FnMut(usize, &[f64])) {
        let mut place = factor * self.len();
        let stride = dense::stride(self.n);
        for column in self.range.clone() {
            let len = self.n - column;
            match self.numbers {
                Numbers::From(first, numbers) => {
                    let numbers = &numbers[factor * (numbers.len() / factors)..];
                    visit(column, &numbers[(column - first) * stride + column..][..len]);
                }
                Numbers::Packed(numbers) => visit(column, &numbers[place..place + len]),
            }
            place += len;
        }
    }

    /// The values one after another.
    pub fn packed(&self, factors: usize) -> Vec<f64> {
        let mut packed = Vec::with_capacity(factors * self.len());
        (0..factors).for_each(|factor| {
            self.for_each(factor, factors, |_, numbers| packed.extend_from_slice(numbers));
        });
        packed
    }
}

/// Divides the columns of a matrix into messages, none of which has columns on both sides of `border`. Returns for each
/// message its columns and its number of values.
pub(in crate::linear) fn messages(
    n: usize,
    border: usize,
    factors: usize,
) -> impl Iterator<Item = (Range<usize>, usize)> {
    let mut first = 0;
    std::iter::from_fn(move || {
        let end = if first < border { border } else { n };
        let (start, mut len) = (first, 0);
        while first < end && (len == 0 || len + factors * (n - first) <= MESSAGE) {
            len += factors * (n - first);
            first += 1;
        }
        (first > start).then_some((start..first, len))
    })
}

/// Frees the columns of a matrix of order `n` before column `first`.
pub(in crate::linear) fn forget(matrix: &mut Vec<f64>, n: usize, first: usize, factors: usize) {
    let len = matrix.len() / factors;
    let start = dense::stride(n) * first;
    let mut end = 0;
    for factor in 0..factors {
        matrix.copy_within(factor * len + start..(factor + 1) * len, end);
        end += len - start;
    }
    matrix.truncate(end);
    matrix.shrink_to_fit();
}

impl Multifrontal {
    /// Adds columns to a dense front; `rows` are the row indices of the columns in the front, ascending. Before the
    /// elimination, the columns of pivots are added to `panel`; after it, the columns of the border to `left`.
    pub fn add_columns(&self, panel: &mut [f64], left: &mut [f64], columns: &Columns, rows: &[u32]) {
        let Some(front) = self.fronts.front.first() else { return };
        let factors = front.factors;
        for k in 0..factors {
            columns.for_each(k, factors, |column, numbers| {
                let at = rows[column] as usize;
                let (target, height, offset) = match at.checked_sub(front.pivots) {
                    None => (&mut *panel, front.rows, 0),
                    Some(_) => (&mut *left, front.border_len(), front.pivots),
                };
                let stride = dense::stride(height);
                let start = k * (target.len() / factors) + (at - offset) * stride;
                add_rows(numbers, &rows[column..], offset, &mut target[start..start + stride]);
            });
        }
    }

    /// Eliminates the pivots of a dense front; returns false in the same cases as [`Multifrontal::factorise`].
    pub fn eliminate(&self, panel: &mut [f64], left: &mut [f64]) -> bool {
        let Some(front) = self.fronts.front.first() else { return true };
        if front.pivots == 0 {
            left.fill(0.0);
            return true;
        }
        dense::eliminate(front.factors, front.rows, front.pivots, panel, left)
    }
}
