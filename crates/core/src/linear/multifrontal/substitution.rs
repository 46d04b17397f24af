//! Forward and backward substitution, front by front: with L and Lᵀ, or with L and U.

use pulp::{Arch, Simd, WithSimd};

use super::dense;
use super::fronts::{Front, Fronts};

/// A direction of substitution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pass {
    /// With L; the right-hand sides of the kept unknowns become the right-hand sides of the equations left for them.
    Forward,
    /// With Lᵀ or U, given the solution for the kept unknowns.
    Backward,
}

/// Replaces the right-hand side, in the order of elimination, by the solution of one pass; `y` is working space for the
/// rows of a front.
pub(super) fn substitute(pass: Pass, fronts: &Fronts, factor: &[f64], x: &mut [f64], y: &mut [f64]) {
    Arch::new().dispatch(Substitution { pass, fronts, factor, x, y });
}

struct Substitution<'a> {
    pass: Pass,
    fronts: &'a Fronts,
    factor: &'a [f64],
    /// The solution, in the order of elimination.
    x: &'a mut [f64],
    /// Working space for the rows of a front.
    y: &'a mut [f64],
}

impl WithSimd for Substitution<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let fronts = self.fronts.eliminated();
        match self.pass {
            Pass::Forward => fronts.iter().for_each(|front| self.forward(simd, front)),
            Pass::Backward => fronts.iter().rev().for_each(|front| self.backward(simd, front)),
        }
    }
}

impl Substitution<'_> {
    #[inline(always)]
    fn forward<S: Simd>(&mut self, simd: S, front: &Front) {
        let stride = dense::stride(front.rows);
        let panel = &self.factor[front.panel..front.panel + front.panel_len() / front.factors];
        let y = &mut self.y[..stride];
        y[..front.pivots].copy_from_slice(&self.x[front.first..front.first + front.pivots]);
        y[front.pivots..].fill(0.0);
        let mut first = 0;
        while first < front.pivots {
            let width = 4.min(front.pivots - first);
            let columns = &panel[first * stride..];
            match width {
                4 => eliminate::<S, 4>(simd, columns, stride, first, y),
                3 => eliminate::<S, 3>(simd, columns, stride, first, y),
                2 => eliminate::<S, 2>(simd, columns, stride, first, y),
                _ => eliminate::<S, 1>(simd, columns, stride, first, y),
            }
            first += width;
        }
        self.x[front.first..front.first + front.pivots].copy_from_slice(&y[..front.pivots]);
        let border = &self.fronts.border[front.border..front.border + front.border_len()];
        for (y, &place) in y[front.pivots..].iter().zip(border) {
            self.x[place as usize] += y;
        }
    }

    #[inline(always)]
    fn backward<S: Simd>(&mut self, simd: S, front: &Front) {
        let stride = dense::stride(front.rows);
        // The columns of the last factor of the front: those of L for LLᵀ, or those of Uᵀ for LU.
        let end = front.panel + front.panel_len();
        let panel = &self.factor[end - front.panel_len() / front.factors..end];
        let y = &mut self.y[..stride];
        y[..front.pivots].copy_from_slice(&self.x[front.first..front.first + front.pivots]);
        let border = &self.fronts.border[front.border..front.border + front.border_len()];
        for (y, &place) in y[front.pivots..].iter_mut().zip(border) {
            *y = self.x[place as usize];
        }
        y[front.rows..].fill(0.0);
        let mut end = front.pivots;
        while end > 0 {
            let width = if end.is_multiple_of(4) { 4 } else { end % 4 };
            let first = end - width;
            let columns = &panel[first * stride..];
            match width {
                4 => insert::<S, 4>(simd, columns, stride, first, y),
                3 => insert::<S, 3>(simd, columns, stride, first, y),
                2 => insert::<S, 2>(simd, columns, stride, first, y),
                _ => insert::<S, 1>(simd, columns, stride, first, y),
            }
            end = first;
        }
        self.x[front.first..front.first + front.pivots].copy_from_slice(&y[..front.pivots]);
    }
}

/// Finishes `N` values and subtracts their contributions from the values below.
#[inline(always)]
fn eliminate<S: Simd, const N: usize>(simd: S, columns: &[f64], stride: usize, first: usize, y: &mut [f64]) {
    let column: [&[f64]; N] = std::array::from_fn(|c| &columns[c * stride..(c + 1) * stride]);
    let mut x = [0.0; N];
    for c in 0..N {
        let mut value = y[first + c];
        for b in 0..c {
            value -= column[b][first + c] * x[b];
        }
        x[c] = value * column[c][first + c];
        y[first + c] = x[c];
    }
    let below = first + N;
    let factor: [S::f64s; N] = std::array::from_fn(|c| simd.splat_f64s(-x[c]));
    // After the head, the range consists of whole vectors, because `stride` is a multiple of the vector width.
    let (head, y) = S::as_mut_rsimd_f64s(&mut y[below..stride]);
    let parts: [(&[f64], &[S::f64s]); N] = std::array::from_fn(|c| S::as_rsimd_f64s(&column[c][below..]));
    for (r, y) in head.iter_mut().enumerate() {
        for c in 0..N {
            *y -= parts[c].0[r] * x[c];
        }
    }
    let vectors: [&[S::f64s]; N] = std::array::from_fn(|c| &parts[c].1[..y.len()]);
    for (r, y) in y.iter_mut().enumerate() {
        let mut value = *y;
        for c in 0..N {
            value = simd.mul_add_f64s(vectors[c][r], factor[c], value);
        }
        *y = value;
    }
}

/// Finishes `N` values, given the values below.
#[inline(always)]
fn insert<S: Simd, const N: usize>(simd: S, columns: &[f64], stride: usize, first: usize, y: &mut [f64]) {
    let column: [&[f64]; N] = std::array::from_fn(|c| &columns[c * stride..(c + 1) * stride]);
    let below = first + N;
    let (head, vectors) = S::as_rsimd_f64s(&y[below..stride]);
    let parts: [(&[f64], &[S::f64s]); N] = std::array::from_fn(|c| S::as_rsimd_f64s(&column[c][below..]));
    let entries: [&[S::f64s]; N] = std::array::from_fn(|c| &parts[c].1[..vectors.len()]);
    let mut sums = [simd.splat_f64s(0.0); N];
    for (r, &y) in vectors.iter().enumerate() {
        for c in 0..N {
            sums[c] = simd.mul_add_f64s(entries[c][r], y, sums[c]);
        }
    }
    let mut sum: [f64; N] = std::array::from_fn(|c| simd.reduce_sum_f64s(sums[c]));
    for (r, y) in head.iter().enumerate() {
        for c in 0..N {
            sum[c] += parts[c].0[r] * y;
        }
    }
    for c in (0..N).rev() {
        let mut value = y[first + c] - sum[c];
        for b in c + 1..N {
            value -= column[c][first + b] * y[first + b];
        }
        y[first + c] = value * column[c][first + c];
    }
}
