//! Closed forms for tensors with z as a principal direction: the in-plane 2×2 block decouples from zz.
//!
//! Such a tensor has four components `xx, yy, zz, √2 xy`; each is a [`Lane`], so several points can be evaluated at
//! once.
#![allow(non_snake_case)]

use std::f64::consts::FRAC_1_SQRT_2;

use super::logarithm::{artanh_over_x, ln};
use super::spectral::sinh_over_x;
use super::{Lane, Sym3};

/// Components `xx, yy, zz, √2 xy` of a tensor.
#[inline(always)]
pub fn components(t: &Sym3) -> [f64; 4] {
    [t.0[0], t.0[1], t.0[2], t.0[5]]
}

/// The tensor with components `xx, yy, zz, √2 xy`.
#[inline(always)]
pub fn tensor(t: [f64; 4]) -> Sym3 {
    Sym3([t[0], t[1], t[2], 0.0, 0.0, t[3]])
}

/// Mean, half difference and shear of the in-plane block, and the radius of its Mohr circle.
#[inline(always)]
fn mohr<T: Lane>(b: &[T; 4]) -> (T, T, T, T) {
    let m = (b[0] + b[1]) * 0.5;
    let d = (b[0] - b[1]) * 0.5;
    let s = b[3] * FRAC_1_SQRT_2;
    (m, d, s, (d * d + s * s).sqrt())
}

/// Eigenvalues and axes of a positive definite tensor in the plane, and its logarithm on these axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axes<T> {
    /// The larger and the smaller eigenvalue in the plane, and zz.
    pub values: [T; 3],
    /// Their logarithms; NaN if zz or the determinant in the plane is not positive.
    pub logarithm: [T; 3],
    /// Divided difference of the logarithm between the two eigenvalues in the plane.
    pub on_shear: T,
    /// Cosine of twice the angle from x to the axis of the larger eigenvalue; 1 if both are equal.
    pub cosine: T,
    /// Sine of twice that angle; 0 if both are equal.
    pub sine: T,
}

impl<T: Lane> Axes<T> {
    /// Decomposes a tensor with components `xx, yy, zz, √2 xy`. The error is of the order of round-off in its largest
    /// entry.
    #[inline(always)]
    pub fn new(b: &[T; 4]) -> Axes<T> {
        let (m, d, s, r) = mohr(b);
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let mean = ln((m - r) * (m + r)) * 0.5;
        let on_shear = artanh_over_x(r / m) / m;
        Axes {
            values: [m + r, m - r, b[2]],
            logarithm: [mean + on_shear * r, mean - on_shear * r, ln(b[2])],
            on_shear,
            cosine: zero.where_below(r, d / r, one),
            sine: zero.where_below(r, s / r, zero),
        }
    }
}

/// exp(e).
#[inline]
pub fn exp(e: &Sym3) -> Sym3 {
    let (m, d, _, r) = mohr(&components(e));
    let scale = m.exp();
    let slope = sinh_over_x(r);
    let c = r.cosh();
    tensor([scale * (c + slope * d), scale * (c - slope * d), e.0[2].exp(), scale * slope * e.0[5]])
}

/// ln(b) and the in-plane block of ∂ ln(b)/∂b, eq. (A.2), in the Mandel layout `xx, yy, √2 xy`. ln(b) is NaN if zz or
/// the determinant in the plane is not positive.
///
/// With the mean m and the radius r of Mohr's circle, t0 = I/√2, t1 the normalised deviator of b, t2 ⟂ t1 in the plane,
/// and w the divided difference of the logarithm, L = (m/det)(t0⊗t0 + t1⊗t1) − (r/det)(t0⊗t1 + t1⊗t0) + w t2⊗t2. Every
/// term stays finite as r → 0, where t1 becomes arbitrary.
#[inline(always)]
pub fn log_with_derivative<T: Lane>(b: &[T; 4]) -> ([T; 4], [[T; 3]; 3]) {
    let (m, d, s, r) = mohr(b);
    let det = (m - r) * (m + r);
    let mean = ln(det) * 0.5;
    let w = artanh_over_x(r / m) / m;
    let log = [mean + w * d, mean - w * d, ln(b[2]), w * b[3]];

    let (zero, one) = (T::splat(0.0), T::splat(1.0));
    let inv_det = one / det;
    let c1 = zero.where_below(r, d / r, one);
    let c2 = zero.where_below(r, s / r, zero);
    let normal = m * inv_det; // on t0 ⊗ t0 and t1 ⊗ t1
    // Components on T0 = I/√2, T1 = diag(1, −1)/√2, T2 = √2 xy.
    let l11 = normal * c1 * c1 + w * c2 * c2;
    let l22 = normal * c2 * c2 + w * c1 * c1;
    let l12 = (normal - w) * c1 * c2;
    let (l01, l02) = (zero - d * inv_det, zero - s * inv_det);
    // xx = (T0 + T1)/√2, yy = (T0 − T1)/√2.
    let half = (normal + l11) * 0.5;
    let corner = (normal - l11) * 0.5;
    let across = (l02 + l12) * FRAC_1_SQRT_2;
    let across_y = (l02 - l12) * FRAC_1_SQRT_2;
    (log, [[half + l01, corner, across], [corner, half - l01, across_y], [across, across_y, l22]])
}
