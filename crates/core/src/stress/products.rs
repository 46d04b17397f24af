//! Products of small matrices shared by the kernels.

use crate::tensor::Sym3;
use std::f64::consts::FRAC_1_SQRT_2;

#[inline(always)]
pub(super) fn times(a: &[[f64; 3]; 3], x: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i][0] * x[0] + a[i][1] * x[1] + a[i][2] * x[2])
}

/// A symmetric tensor as a full matrix, times a factor.
#[inline(always)]
pub(super) fn full(t: &Sym3, factor: f64) -> [[f64; 3]; 3] {
    let [xx, yy, zz] = [t.0[0] * factor, t.0[1] * factor, t.0[2] * factor];
    let shear = FRAC_1_SQRT_2 * factor;
    let [yz, xz, xy] = [t.0[3] * shear, t.0[4] * shear, t.0[5] * shear];
    [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
}

/// Index of component (i, j) of a symmetric tensor in the Mandel layout.
pub(super) const MANDEL_INDEX: [[usize; 3]; 3] = [[0, 5, 4], [5, 1, 3], [4, 3, 2]];
