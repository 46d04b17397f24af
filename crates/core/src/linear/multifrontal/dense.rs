//! Dense operations on one front: they compute the columns of its pivots in the factors, and the update of the
//! remaining matrix by these columns.
//!
//! There is one factor L for LLᵀ, or the two factors L and Uᵀ for LU, where L contains the pivots and U has a diagonal
//! of ones. Both are lower triangular, and each is updated from the right by the other (or L by itself): the columns of
//! L are the columns of the matrix minus products of rows of L and rows of Uᵀ; the columns of Uᵀ are the rows of the
//! matrix minus products of rows of Uᵀ and rows of L, divided by the pivots. The same operations therefore serve both
//! factorisations.
//!
//! Columns are stored one after another with a stride that is a multiple of [`PAD`], so that whole vectors of rows can
//! be read and written. Values above the diagonal and in padding rows are arbitrary but finite, and never change a
//! result. Every entry is summed over the columns to its left in a fixed order, whatever the width of a vector.

use std::ops::Range;

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, MatMut, MatRef, Par};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Strides are multiples of this number, and as many additional values follow the last column.
pub(super) const PAD: usize = 8;

/// With at least this number of registers, three vectors of rows are processed at once; otherwise two.
const MANY_REGISTERS: usize = 32;

/// Number of columns that are eliminated together in registers.
const WIDTH: usize = 4;

/// Number of columns of a large front that are updated together by the columns to their left, and then eliminated.
const BLOCK: usize = 96;

/// A front with more pivots than this is processed by kernels for large matrices.
const MANY: usize = 128;
/// A front with more values in its columns than this is processed by kernels for large matrices.
const MAX_ENTRIES: usize = 1 << 15;

/// Number of columns of the border that are updated together in a large front.
const TILE: usize = 512;

/// Number of rows that are updated together in a large front.
const HIGH: usize = 384;

/// A matrix product with fewer multiplications than this is computed by one thread.
const SHARED: usize = 4 << 20;

/// The stride of columns with this number of rows.
pub(super) fn stride(rows: usize) -> usize {
    rows.next_multiple_of(PAD)
}

/// Number of values in `columns` columns with this number of rows.
pub(super) fn room(rows: usize, columns: usize) -> usize {
    if columns == 0 { 0 } else { stride(rows) * columns + PAD }
}

fn is_large(rows: usize, pivots: usize) -> bool {
    pivots > MANY || rows * pivots > MAX_ENTRIES
}

/// Replaces the matrix columns of the pivots of a front by the columns of its one or two factors, with the diagonal
/// entries of L as reciprocals. Writes the update of the remaining matrix, −L Lᵀ or −L U, to `update`: the lower
/// triangle, followed for LU by the transposed upper triangle. Returns false if a pivot of LLᵀ is not positive, or a
/// pivot of LU is zero or not finite.
pub(super) fn eliminate(
    factors: usize,
    rows: usize,
    pivots: usize,
    panel: &mut [f64],
    update: &mut [f64],
) -> bool {
    if factors == 1 {
        return Dense { panels: [panel], rows, pivots, updates: [update] }.eliminate();
    }
    let (lower, upper) = panel.split_at_mut(panel.len() / 2);
    let (below, right) = update.split_at_mut(update.len() / 2);
    Dense { panels: [lower, upper], rows, pivots, updates: [below, right] }.eliminate()
}

/// Number of the factor that updates, from the right, the factor with this number.
const fn other<const F: usize>(factor: usize) -> usize {
    F - 1 - factor
}

/// The columns of the pivots and the updates of one or two factors.
struct Dense<'a, const F: usize> {
    panels: [&'a mut [f64]; F],
    rows: usize,
    pivots: usize,
    updates: [&'a mut [f64]; F],
}

impl<const F: usize> Dense<'_, F> {
    fn eliminate(self) -> bool {
        if is_large(self.rows, self.pivots) { self.by_blocks() } else { Arch::new().dispatch(self) }
    }

    fn by_blocks(self) -> bool {
        let Dense { mut panels, rows, pivots, updates } = self;
        let stride = stride(rows);
        for first in (0..pivots).step_by(BLOCK) {
            let width = BLOCK.min(pivots - first);
            let halves = panels.each_mut().map(|panel| {
                let (done, rest) = panel.split_at_mut(first * stride);
                (&*done, rest)
            });
            let done = halves.each_ref().map(|half| half.0);
            let rest = halves.map(|half| half.1);
            if first > 0 {
                let left = done.map(|done| {
                    MatRef::from_column_major_slice_with_stride(done, stride, first, stride)
                        .subrows(first, rows - first)
                });
                for factor in 0..F {
                    let block = &mut *rest[factor];
                    let block = MatMut::from_column_major_slice_with_stride_mut(block, stride, width, stride);
                    let block = block.subrows_mut(first, rows - first);
                    subtract_product(block, left[factor], left[other::<F>(factor)].subrows(0, width));
                }
            }
            let panels = rest.map(|rest| &mut rest[first..]);
            let block = Columns { panels, stride, rows: stride - first, columns: width };
            if !Arch::new().dispatch(block) {
                return false;
            }
        }
        let border = rows - pivots;
        if border > 0 {
            let below = panels.each_ref().map(|panel| {
                MatRef::from_column_major_slice_with_stride(panel, stride, pivots, stride)
                    .subrows(pivots, border)
            });
            for (factor, update) in updates.into_iter().enumerate() {
                take(update, below[factor], below[other::<F>(factor)]);
            }
        }
        true
    }
}

/// `block` −= `left` `right`ᵀ.
fn subtract_product(block: MatMut<'_, f64>, left: MatRef<'_, f64>, right: MatRef<'_, f64>) {
    if block.nrows() * block.ncols() * left.ncols() < SHARED {
        matmul(block, Accum::Add, left, right.transpose(), -1.0, Par::Seq);
        return;
    }
    let mut pieces = Vec::new();
    let (mut block, mut left) = (block, left);
    while block.nrows() > 0 {
        let high = HIGH.min(block.nrows());
        let (upper, lower) = block.split_at_row_mut(high);
        pieces.push((upper, left.subrows(0, high)));
        left = left.subrows(high, left.nrows() - high);
        block = lower;
    }
    pieces.into_par_iter().for_each(|(block, left)| {
        matmul(block, Accum::Add, left, right.transpose(), -1.0, Par::Seq);
    });
}

/// Sets the lower triangle of `update` to −`left` `right`ᵀ.
fn take(update: &mut [f64], left: MatRef<'_, f64>, right: MatRef<'_, f64>) {
    let order = left.nrows();
    let stride = stride(order);
    let tile = |(number, columns): (usize, &mut [f64])| {
        let first = number * TILE;
        let width = TILE.min(order - first);
        let columns = MatMut::from_column_major_slice_with_stride_mut(columns, stride, width, stride);
        let (square, below) = columns.subrows_mut(first, order - first).split_at_row_mut(width);
        let right = right.subrows(first, width).transpose();
        triangular::matmul(
            square,
            BlockStructure::TriangularLower,
            Accum::Replace,
            left.subrows(first, width),
            BlockStructure::Rectangular,
            right,
            BlockStructure::Rectangular,
            -1.0,
            Par::Seq,
        );
        let others = left.subrows(first + width, order - first - width);
        matmul(below, Accum::Replace, others, right, -1.0, Par::Seq);
    };
    let update = &mut update[..stride * order];
    if order * order / 2 * left.ncols() < SHARED {
        update.chunks_mut(TILE * stride).enumerate().for_each(tile);
    } else {
        update.par_chunks_mut(TILE * stride).enumerate().for_each(tile);
    }
}

/// A front that is processed in registers only.
impl<const F: usize> WithSimd for Dense<'_, F> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Dense { mut panels, rows, pivots, updates } = self;
        let stride = stride(rows);
        let panels_of_columns = panels.each_mut().map(|panel| &mut **panel);
        let columns = Columns { panels: panels_of_columns, stride, rows: stride, columns: pivots };
        if !columns.with_simd(simd) {
            return false;
        }
        let border = rows - pivots;
        if border > 0 {
            for (factor, update) in updates.into_iter().enumerate() {
                let (left, right) = (&*panels[factor], &*panels[other::<F>(factor)]);
                let product = Product { left, right, stride, terms: pivots, offset: pivots, column: pivots };
                product.take(simd, update, border);
            }
        }
        true
    }
}

/// Sums, over the first `terms` columns, of the products of row `offset` + r on the left and row `column` + c on the
/// right.
#[derive(Clone, Copy)]
struct Product<'a> {
    left: &'a [f64],
    right: &'a [f64],
    stride: usize,
    terms: usize,
    offset: usize,
    column: usize,
}

impl Product<'_> {
    /// Writes the sums, with their sign changed, to the lower triangle of `update`, column by column.
    #[inline(always)]
    fn take<S: Simd>(self, simd: S, update: &mut [f64], border: usize) {
        let height = stride(border);
        let mut column = 0;
        while column < border {
            let width = WIDTH.min(border - column);
            let first = column / S::F64_LANES * S::F64_LANES;
            let product = Product { column: self.column + column, ..self };
            let out = &mut update[column * height..];
            match width {
                1 => product.write::<S, 1>(simd, out, height, first),
                2 => product.write::<S, 2>(simd, out, height, first),
                3 => product.write::<S, 3>(simd, out, height, first),
                _ => product.write::<S, WIDTH>(simd, out, height, first),
            }
            column += width;
        }
    }

    /// The sums for `M` vectors of rows from `row` on and `N` columns.
    #[inline(always)]
    fn tile<S: Simd, const M: usize, const N: usize>(self, simd: S, row: usize) -> [[S::f64s; M]; N] {
        let mut sum = [[simd.splat_f64s(0.0); M]; N];
        let mut at = self.offset + row;
        let mut scalar = self.column;
        for _ in 0..self.terms {
            let left = S::as_simd_f64s(&self.left[at..at + M * S::F64_LANES]).0;
            let left: &[S::f64s; M] = match left.try_into() {
                Ok(left) => left,
                Err(_) => return sum,
            };
            let right = &self.right[scalar..scalar + N];
            for c in 0..N {
                let factor = simd.splat_f64s(right[c]);
                for v in 0..M {
                    sum[c][v] = simd.mul_add_f64s(left[v], factor, sum[c][v]);
                }
            }
            at += self.stride;
            scalar += self.stride;
        }
        sum
    }

    /// Writes the sums, with their sign changed, to `N` columns of `height` rows, from row `first` on.
    #[inline(always)]
    fn write<S: Simd, const N: usize>(self, simd: S, out: &mut [f64], height: usize, first: usize) {
        let mut row = first;
        let lanes = S::F64_LANES;
        while S::REGISTER_COUNT >= MANY_REGISTERS && row + 3 * lanes <= height {
            self.write_tile::<S, 3, N>(simd, out, height, row);
            row += 3 * lanes;
        }
        while row + 2 * lanes <= height {
            self.write_tile::<S, 2, N>(simd, out, height, row);
            row += 2 * lanes;
        }
        if row < height {
            self.write_tile::<S, 1, N>(simd, out, height, row);
        }
    }

    #[inline(always)]
    fn write_tile<S: Simd, const M: usize, const N: usize>(
        self,
        simd: S,
        out: &mut [f64],
        height: usize,
        row: usize,
    ) {
        let sum = self.tile::<S, M, N>(simd, row);
        for c in 0..N {
            let place = c * height + row;
            let out = S::as_mut_simd_f64s(&mut out[place..place + M * S::F64_LANES]).0;
            for v in 0..M {
                out[v] = simd.neg_f64s(sum[c][v]);
            }
        }
    }
}

/// Columns of a front; the square at their top is the diagonal block.
struct Columns<'a, const F: usize> {
    panels: [&'a mut [f64]; F],
    stride: usize,
    /// Rows, padding included: a multiple of [`PAD`].
    rows: usize,
    columns: usize,
}

impl<const F: usize> WithSimd for Columns<'_, F> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> bool {
        let mut first = 0;
        while first < self.columns {
            let width = WIDTH.min(self.columns - first);
            let is_regular = match width {
                1 => self.eliminate::<S, 1>(simd, first),
                2 => self.eliminate::<S, 2>(simd, first),
                3 => self.eliminate::<S, 3>(simd, first),
                _ => self.eliminate::<S, WIDTH>(simd, first),
            };
            if !is_regular {
                return false;
            }
            first += width;
        }
        true
    }
}

/// A block on the diagonal of the columns of a factor: entry `[c][r]` in column c and row r.
type Diagonal<const N: usize> = [[f64; N]; N];

impl<const F: usize> Columns<'_, F> {
    /// Completes `N` columns, given the columns before them.
    #[inline(always)]
    fn eliminate<S: Simd, const N: usize>(&mut self, simd: S, first: usize) -> bool {
        let start = first / S::F64_LANES * S::F64_LANES;
        let mut updated = start;
        for factor in 0..F {
            updated = self.update_first::<S, N>(simd, factor, first, start);
        }
        let Some(diagonal) = self.diagonal::<N>(first) else { return false };
        for factor in 0..F {
            self.finish_all::<S, N>(simd, factor, first, start..updated, &diagonal);
        }
        true
    }

    /// Updates the vectors of rows from `start` on that contain the diagonal block, and those below it that can be
    /// updated at no extra cost; returns the row after them.
    #[inline(always)]
    fn update_first<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        factor: usize,
        first: usize,
        start: usize,
    ) -> usize {
        let lanes = S::F64_LANES;
        let mut row = start;
        if S::REGISTER_COUNT >= MANY_REGISTERS && start + 3 * lanes <= self.rows {
            self.update::<S, 3, N>(simd, factor, first, start);
            row += 3 * lanes;
        } else if start + 2 * lanes <= self.rows {
            self.update::<S, 2, N>(simd, factor, first, start);
            row += 2 * lanes;
        }
        while row < first + N {
            self.update::<S, 1, N>(simd, factor, first, row);
            row += lanes;
        }
        row
    }

    /// Completes all rows of a factor, given the diagonal blocks; the rows in `updated` need no further update.
    #[inline(always)]
    fn finish_all<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        factor: usize,
        first: usize,
        updated: Range<usize>,
        diagonal: &[Diagonal<N>; F],
    ) {
        let lanes = S::F64_LANES;
        let right = &diagonal[other::<F>(factor)];
        // L of LLᵀ and Uᵀ of LU are divided by the diagonal entries of L; L of LU is not.
        let is_divided = factor + 1 == F;
        let mut row = updated.start;
        while row < updated.end {
            let values = self.load::<S, 1, N>(simd, factor, row, first);
            self.finish::<S, 1, N>(simd, factor, first, row, values, right, is_divided);
            row += lanes;
        }
        for c in 0..N {
            for r in c..N {
                self.panels[factor][(first + c) * self.stride + first + r] = diagonal[factor][c][r];
            }
        }
        while S::REGISTER_COUNT >= MANY_REGISTERS && row + 3 * lanes <= self.rows {
            let values = self.reduced::<S, 3, N>(simd, factor, first, row);
            self.finish::<S, 3, N>(simd, factor, first, row, values, right, is_divided);
            row += 3 * lanes;
        }
        while row + 2 * lanes <= self.rows {
            let values = self.reduced::<S, 2, N>(simd, factor, first, row);
            self.finish::<S, 2, N>(simd, factor, first, row, values, right, is_divided);
            row += 2 * lanes;
        }
        if row < self.rows {
            let values = self.reduced::<S, 1, N>(simd, factor, first, row);
            self.finish::<S, 1, N>(simd, factor, first, row, values, right, is_divided);
        }
    }

    #[expect(clippy::manual_memcpy, reason = "a copy through memory takes a tenth of the total time")]
    #[inline(always)]
    fn load<S: Simd, const M: usize, const N: usize>(
        &self,
        simd: S,
        factor: usize,
        row: usize,
        first: usize,
    ) -> [[S::f64s; M]; N] {
        let mut values = [[simd.splat_f64s(0.0); M]; N];
        for c in 0..N {
            let place = (first + c) * self.stride + row;
            let column = S::as_simd_f64s(&self.panels[factor][place..place + M * S::F64_LANES]).0;
            for v in 0..M {
                values[c][v] = column[v];
            }
        }
        values
    }

    #[expect(clippy::manual_memcpy, reason = "a copy through memory takes a tenth of the total time")]
    #[inline(always)]
    fn store<S: Simd, const M: usize, const N: usize>(
        &mut self,
        factor: usize,
        row: usize,
        first: usize,
        values: &[[S::f64s; M]; N],
    ) {
        for c in 0..N {
            let place = (first + c) * self.stride + row;
            let column = S::as_mut_simd_f64s(&mut self.panels[factor][place..place + M * S::F64_LANES]).0;
            for v in 0..M {
                column[v] = values[c][v];
            }
        }
    }

    /// Entries minus the updates by the columns before them.
    #[inline(always)]
    fn reduced<S: Simd, const M: usize, const N: usize>(
        &self,
        simd: S,
        factor: usize,
        first: usize,
        row: usize,
    ) -> [[S::f64s; M]; N] {
        let (left, right) = (&*self.panels[factor], &*self.panels[other::<F>(factor)]);
        let product = Product { left, right, stride: self.stride, terms: first, offset: 0, column: first };
        let taken = product.tile::<S, M, N>(simd, row);
        let mut values = self.load::<S, M, N>(simd, factor, row, first);
        for c in 0..N {
            for v in 0..M {
                values[c][v] = simd.sub_f64s(values[c][v], taken[c][v]);
            }
        }
        values
    }

    #[inline(always)]
    fn update<S: Simd, const M: usize, const N: usize>(
        &mut self,
        simd: S,
        factor: usize,
        first: usize,
        row: usize,
    ) {
        let values = self.reduced::<S, M, N>(simd, factor, first, row);
        self.store::<S, M, N>(factor, row, first, &values);
    }

    /// The diagonal blocks of the factors, with the diagonal entries of the first block as reciprocals.
    #[inline(always)]
    fn diagonal<const N: usize>(&self, first: usize) -> Option<[Diagonal<N>; F]> {
        let mut blocks = [[[0.0; N]; N]; F];
        for (block, panel) in blocks.iter_mut().zip(&self.panels) {
            for c in 0..N {
                for r in c..N {
                    block[c][r] = panel[(first + c) * self.stride + first + r];
                }
            }
        }
        let is_regular = match &mut blocks[..] {
            [l] => llt(l),
            [l, u] => lu(l, u),
            _ => false,
        };
        is_regular.then_some(blocks)
    }

    /// Divides rows of a factor by the diagonal block of the other factor (for LLᵀ, of the same factor) and stores
    /// them.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "all are needed in registers")]
    fn finish<S: Simd, const M: usize, const N: usize>(
        &mut self,
        simd: S,
        factor: usize,
        first: usize,
        row: usize,
        mut x: [[S::f64s; M]; N],
        right: &Diagonal<N>,
        is_divided: bool,
    ) {
        for c in 0..N {
            if is_divided {
                let reciprocal = simd.splat_f64s(right[c][c]);
                for v in 0..M {
                    x[c][v] = simd.mul_f64s(x[c][v], reciprocal);
                }
            }
            for d in c + 1..N {
                let factor = simd.splat_f64s(right[c][d]);
                for v in 0..M {
                    x[d][v] = simd.negate_mul_add_f64s(x[c][v], factor, x[d][v]);
                }
            }
        }
        self.store::<S, M, N>(factor, row, first, &x);
    }
}

/// Replaces a block by its Cholesky factor, with diagonal entries as reciprocals. False if a pivot is not positive.
#[inline(always)]
fn llt<const N: usize>(l: &mut Diagonal<N>) -> bool {
    for c in 0..N {
        // NaN does not count as positive.
        if l[c][c] > 0.0 {
            l[c][c] = 1.0 / l[c][c].sqrt();
        } else {
            return false;
        }
        for r in c + 1..N {
            l[c][r] *= l[c][c];
        }
        for d in c + 1..N {
            for r in d..N {
                l[d][r] -= l[c][r] * l[c][d];
            }
        }
    }
    true
}

/// Replaces the lower triangle of a block by L, with the reciprocals of the pivots, and its transposed upper triangle
/// by Uᵀ. False if a pivot is zero or not finite.
#[inline(always)]
fn lu<const N: usize>(l: &mut Diagonal<N>, u: &mut Diagonal<N>) -> bool {
    for c in 0..N {
        if !(l[c][c].is_finite() && l[c][c] != 0.0) {
            return false;
        }
        l[c][c] = 1.0 / l[c][c];
        u[c][c] = 1.0;
        for r in c + 1..N {
            u[c][r] *= l[c][c];
        }
        for d in c + 1..N {
            for r in d..N {
                l[d][r] -= l[c][r] * u[c][d];
            }
            for r in d + 1..N {
                u[d][r] -= u[c][r] * l[c][d];
            }
        }
    }
    true
}
