//! Dense operations on one front: the Cholesky factor of its pivot columns, and their update of the rest of the matrix.
//!
//! Columns are stored one after the other with a stride that is a multiple of [`PAD`], so that whole vectors of rows
//! can be read and written; values above the diagonal are arbitrary and never used. Every entry is one sum over the
//! columns to the left, in order, whatever the width of a vector.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::{Accum, MatMut, MatRef, Par};
use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

/// Strides are multiples of this, and this number of values follows the last column.
pub(super) const PAD: usize = 8;

/// With at least this many registers, three vectors of rows are processed at once, otherwise two.
const MANY_REGISTERS: usize = 32;

/// Columns that are eliminated together in registers.
const WIDTH: usize = 4;

/// Columns of a large front that are eliminated together before the others are updated.
const BLOCK: usize = 96;

/// A front with more pivots than this, or more numbers in its columns than that, is processed by kernels for large
/// matrices.
const MANY: usize = 128;
const MOST: usize = 1 << 15;

/// Columns of the border that are updated together in a large front.
const TILE: usize = 512;

/// Rows that are updated together in a large front.
const HIGH: usize = 384;

/// A product of fewer operations is computed by one thread.
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
    pivots > MANY || rows * pivots > MOST
}

/// Replaces the `pivots` columns of `rows` rows by those of the factor, with the reciprocals of the pivots on the
/// diagonal; and writes their update of the rest of the matrix, −L Lᵀ, to the lower triangle of `update`. False if a
/// pivot is not positive.
pub(super) fn eliminate(panel: &mut [f64], rows: usize, pivots: usize, update: &mut [f64]) -> bool {
    if !is_large(rows, pivots) {
        return Arch::new().dispatch(Small { panel, rows, pivots, update });
    }
    let stride = stride(rows);
    for first in (0..pivots).step_by(BLOCK) {
        let width = BLOCK.min(pivots - first);
        let (done, rest) = panel.split_at_mut(first * stride);
        if first > 0 {
            let left = MatRef::from_column_major_slice_with_stride(done, stride, first, stride);
            let left = left.subrows(first, rows - first);
            let block = MatMut::from_column_major_slice_with_stride_mut(rest, stride, width, stride);
            let block = block.subrows_mut(first, rows - first);
            subtract_product(block, left, left.subrows(0, width));
        }
        let block = Columns { panel: &mut rest[first..], stride, rows: stride - first, columns: width };
        if !Arch::new().dispatch(block) {
            return false;
        }
    }
    let border = rows - pivots;
    if border > 0 {
        let left = MatRef::from_column_major_slice_with_stride(panel, stride, pivots, stride);
        take(update, left.subrows(pivots, border));
    }
    true
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

/// The lower triangle of `update` = −`left` `left`ᵀ.
fn take(update: &mut [f64], left: MatRef<'_, f64>) {
    let order = left.nrows();
    let stride = stride(order);
    let tile = |(number, columns): (usize, &mut [f64])| {
        let first = number * TILE;
        let width = TILE.min(order - first);
        let columns = MatMut::from_column_major_slice_with_stride_mut(columns, stride, width, stride);
        let (square, below) = columns.subrows_mut(first, order - first).split_at_row_mut(width);
        let own = left.subrows(first, width);
        triangular::matmul(
            square,
            BlockStructure::TriangularLower,
            Accum::Replace,
            own,
            BlockStructure::Rectangular,
            own.transpose(),
            BlockStructure::Rectangular,
            -1.0,
            Par::Seq,
        );
        let others = left.subrows(first + width, order - first - width);
        matmul(below, Accum::Replace, others, own.transpose(), -1.0, Par::Seq);
    };
    let update = &mut update[..stride * order];
    if order * order / 2 * left.ncols() < SHARED {
        update.chunks_mut(TILE * stride).enumerate().for_each(tile);
    } else {
        update.par_chunks_mut(TILE * stride).enumerate().for_each(tile);
    }
}

/// A front that is processed in registers only.
struct Small<'a> {
    panel: &'a mut [f64],
    rows: usize,
    pivots: usize,
    update: &'a mut [f64],
}

impl WithSimd for Small<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Small { panel, rows, pivots, update } = self;
        let stride = stride(rows);
        let columns = Columns { panel, stride, rows: stride, columns: pivots };
        if !columns.with_simd(simd) {
            return false;
        }
        let border = rows - pivots;
        if border > 0 {
            take_in_registers(simd, panel, stride, pivots, update, border);
        }
        true
    }
}

/// Writes −L Lᵀ of the rows from `pivots` on, column by column.
#[inline(always)]
fn take_in_registers<S: Simd>(
    simd: S,
    panel: &[f64],
    stride: usize,
    pivots: usize,
    update: &mut [f64],
    border: usize,
) {
    let height = self::stride(border);
    let mut column = 0;
    while column < border {
        let width = WIDTH.min(border - column);
        let first = column / S::F64_LANES * S::F64_LANES;
        let product = Product { panel, stride, terms: pivots, offset: pivots, column: pivots + column };
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

/// Σ over the first `terms` columns of the panel of row `offset` + r times row `column` + c.
#[derive(Clone, Copy)]
struct Product<'a> {
    panel: &'a [f64],
    stride: usize,
    terms: usize,
    offset: usize,
    column: usize,
}

impl Product<'_> {
    /// The sums for `M` vectors of rows from `row` on and `N` columns.
    #[inline(always)]
    fn tile<S: Simd, const M: usize, const N: usize>(self, simd: S, row: usize) -> [[S::f64s; M]; N] {
        let mut sum = [[simd.splat_f64s(0.0); M]; N];
        let mut at = self.offset + row;
        let mut scalar = self.column;
        for _ in 0..self.terms {
            let left = S::as_simd_f64s(&self.panel[at..at + M * S::F64_LANES]).0;
            let left: &[S::f64s; M] = match left.try_into() {
                Ok(left) => left,
                Err(_) => return sum,
            };
            let right = &self.panel[scalar..scalar + N];
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

    /// Writes the sums with their sign changed to `N` columns of `height` rows, from row `first` on.
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

/// Columns of a front whose topmost square is its diagonal block.
struct Columns<'a> {
    panel: &'a mut [f64],
    stride: usize,
    /// Rows, padding included: a multiple of [`PAD`].
    rows: usize,
    columns: usize,
}

impl WithSimd for Columns<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) -> bool {
        let mut first = 0;
        while first < self.columns {
            let width = WIDTH.min(self.columns - first);
            let positive = match width {
                1 => self.eliminate::<S, 1>(simd, first),
                2 => self.eliminate::<S, 2>(simd, first),
                3 => self.eliminate::<S, 3>(simd, first),
                _ => self.eliminate::<S, WIDTH>(simd, first),
            };
            if !positive {
                return false;
            }
            first += width;
        }
        true
    }
}

impl Columns<'_> {
    /// Completes `N` columns, given those before them.
    #[inline(always)]
    fn eliminate<S: Simd, const N: usize>(&mut self, simd: S, first: usize) -> bool {
        let lanes = S::F64_LANES;
        let start = first / lanes * lanes;
        // The vectors that hold the diagonal block, and others below that cost no more.
        let mut row = start;
        if S::REGISTER_COUNT >= MANY_REGISTERS && start + 3 * lanes <= self.rows {
            self.update::<S, 3, N>(simd, first, start);
            row += 3 * lanes;
        } else if start + 2 * lanes <= self.rows {
            self.update::<S, 2, N>(simd, first, start);
            row += 2 * lanes;
        }
        while row < first + N {
            self.update::<S, 1, N>(simd, first, row);
            row += lanes;
        }
        let Some(diagonal) = self.diagonal::<N>(first) else { return false };
        let updated = row;
        row = start;
        while row < updated {
            let values = self.load::<S, 1, N>(simd, row, first);
            self.finish::<S, 1, N>(simd, first, row, values, &diagonal);
            row += lanes;
        }
        for c in 0..N {
            for r in c..N {
                self.panel[(first + c) * self.stride + first + r] = diagonal[c][r];
            }
        }
        while S::REGISTER_COUNT >= MANY_REGISTERS && row + 3 * lanes <= self.rows {
            let values = self.reduced::<S, 3, N>(simd, first, row);
            self.finish::<S, 3, N>(simd, first, row, values, &diagonal);
            row += 3 * lanes;
        }
        while row + 2 * lanes <= self.rows {
            let values = self.reduced::<S, 2, N>(simd, first, row);
            self.finish::<S, 2, N>(simd, first, row, values, &diagonal);
            row += 2 * lanes;
        }
        if row < self.rows {
            let values = self.reduced::<S, 1, N>(simd, first, row);
            self.finish::<S, 1, N>(simd, first, row, values, &diagonal);
        }
        true
    }

    #[expect(clippy::manual_memcpy, reason = "a copy through memory takes a tenth of the total time")]
    #[inline(always)]
    fn load<S: Simd, const M: usize, const N: usize>(
        &self,
        simd: S,
        row: usize,
        first: usize,
    ) -> [[S::f64s; M]; N] {
        let mut values = [[simd.splat_f64s(0.0); M]; N];
        for c in 0..N {
            let place = (first + c) * self.stride + row;
            let column = S::as_simd_f64s(&self.panel[place..place + M * S::F64_LANES]).0;
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
        row: usize,
        first: usize,
        values: &[[S::f64s; M]; N],
    ) {
        for c in 0..N {
            let place = (first + c) * self.stride + row;
            let column = S::as_mut_simd_f64s(&mut self.panel[place..place + M * S::F64_LANES]).0;
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
        first: usize,
        row: usize,
    ) -> [[S::f64s; M]; N] {
        let product =
            Product { panel: self.panel, stride: self.stride, terms: first, offset: 0, column: first };
        let taken = product.tile::<S, M, N>(simd, row);
        let mut values = self.load::<S, M, N>(simd, row, first);
        for c in 0..N {
            for v in 0..M {
                values[c][v] = simd.sub_f64s(values[c][v], taken[c][v]);
            }
        }
        values
    }

    #[inline(always)]
    fn update<S: Simd, const M: usize, const N: usize>(&mut self, simd: S, first: usize, row: usize) {
        let values = self.reduced::<S, M, N>(simd, first, row);
        self.store::<S, M, N>(row, first, &values);
    }

    /// The Cholesky factor of the diagonal block by columns, with reciprocal pivots.
    #[inline(always)]
    fn diagonal<const N: usize>(&self, first: usize) -> Option<[[f64; N]; N]> {
        let mut l = [[0.0; N]; N];
        for c in 0..N {
            for r in c..N {
                l[c][r] = self.panel[(first + c) * self.stride + first + r];
            }
        }
        for c in 0..N {
            // NaN does not count as positive.
            if l[c][c] > 0.0 {
                l[c][c] = 1.0 / l[c][c].sqrt();
            } else {
                return None;
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
        Some(l)
    }

    /// Divides rows by the diagonal block and stores them.
    #[inline(always)]
    fn finish<S: Simd, const M: usize, const N: usize>(
        &mut self,
        simd: S,
        first: usize,
        row: usize,
        mut x: [[S::f64s; M]; N],
        diagonal: &[[f64; N]; N],
    ) {
        for c in 0..N {
            let reciprocal = simd.splat_f64s(diagonal[c][c]);
            for v in 0..M {
                x[c][v] = simd.mul_f64s(x[c][v], reciprocal);
            }
            for d in c + 1..N {
                let factor = simd.splat_f64s(diagonal[c][d]);
                for v in 0..M {
                    x[d][v] = simd.negate_mul_add_f64s(x[c][v], factor, x[d][v]);
                }
            }
        }
        self.store::<S, M, N>(row, first, &x);
    }
}
