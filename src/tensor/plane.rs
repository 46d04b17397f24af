//! Closed forms for tensors of which z is a principal direction: the in-plane 2×2 block decouples from zz.
#![allow(non_snake_case)]

use std::f64::consts::SQRT_2;

use super::Sym3;
use super::spectral::{artanh_over_x, sinh_over_x};

/// Mean, half difference and shear of the in-plane block, and the radius of its Mohr circle.
#[inline(always)]
fn mohr(b: &Sym3) -> (f64, f64, f64, f64) {
    let m = 0.5 * (b.0[0] + b.0[1]);
    let d = 0.5 * (b.0[0] - b.0[1]);
    let s = b.0[5] / SQRT_2;
    (m, d, s, (d * d + s * s).sqrt())
}

/// ln(b) for a positive definite b.
#[inline]
pub fn log(b: &Sym3) -> Sym3 {
    let (m, _, _, r) = mohr(b);
    let mean = 0.5 * ((m - r) * (m + r)).ln();
    let slope = artanh_over_x(r / m) / m;
    let d = 0.5 * (b.0[0] - b.0[1]);
    Sym3([mean + slope * d, mean - slope * d, b.0[2].ln(), 0.0, 0.0, slope * b.0[5]])
}

/// exp(e).
#[inline]
pub fn exp(e: &Sym3) -> Sym3 {
    let (m, d, _, r) = mohr(e);
    let scale = m.exp();
    let slope = sinh_over_x(r);
    let c = r.cosh();
    Sym3([scale * (c + slope * d), scale * (c - slope * d), e.0[2].exp(), 0.0, 0.0, scale * slope * e.0[5]])
}

/// ln(b) together with the in-plane block of ∂ ln(b)/∂b, eq. (A.2), in the Mandel layout `xx, yy, √2 xy`.
///
/// With t0 = I/√2, t1 the normalised deviator of b and t2 ⟂ t1 in the plane,
/// L = (m/det)(t0⊗t0 + t1⊗t1) − (r/det)(t0⊗t1 + t1⊗t0) + w t2⊗t2, w the divided difference of the logarithm.
/// Every term stays finite as r → 0, where t1 becomes arbitrary.
#[inline(always)]
pub fn log_with_derivative(b: &Sym3) -> (Sym3, [[f64; 3]; 3]) {
    let (m, d, s, r) = mohr(b);
    let det = (m - r) * (m + r);
    let mean = 0.5 * det.ln();
    let w = artanh_over_x(r / m) / m;
    let log = Sym3([mean + w * d, mean - w * d, b.0[2].ln(), 0.0, 0.0, w * b.0[5]]);

    let inv_det = 1.0 / det;
    let (c1, c2) = if r > 0.0 { (d / r, s / r) } else { (1.0, 0.0) };
    let normal = m * inv_det; // on t0 ⊗ t0 and t1 ⊗ t1
    // Components on T0 = I/√2, T1 = diag(1, −1)/√2, T2 = √2 xy.
    let l11 = normal * c1 * c1 + w * c2 * c2;
    let l22 = normal * c2 * c2 + w * c1 * c1;
    let l12 = (normal - w) * c1 * c2;
    let (l01, l02) = (-d * inv_det, -s * inv_det);
    // xx = (T0 + T1)/√2, yy = (T0 − T1)/√2.
    let half = 0.5 * (normal + l11);
    let across = (l02 + l12) / SQRT_2;
    let across_y = (l02 - l12) / SQRT_2;
    let L = [
        [half + l01, 0.5 * (normal - l11), across],
        [0.5 * (normal - l11), half - l01, across_y],
        [across, across_y, l22],
    ];
    (log, L)
}
