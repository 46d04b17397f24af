//! Second- and fourth-order tensors in three dimensions, their spectral functions, and index conventions.
//!
//! Symmetric second-order tensors are stored in the Mandel layout `xx, yy, zz, √2 yz, √2 xz, √2 xy`, in which the
//! double contraction is the dot product and a fourth-order tensor with minor symmetries is a 6×6 matrix: no factor
//! of two ever appears in a material. Full fourth-order tensors are nested arrays indexed `[i][j][k][l]`.
#![allow(non_snake_case)]

use std::f64::consts::SQRT_2;
use std::ops::{Add, Mul, Sub};

use nalgebra::{Matrix3, SMatrix, SVector, SymmetricEigen};

/// A general second-order tensor.
pub type Mat3 = Matrix3<f64>;

/// A fourth-order tensor with minor symmetries in the Mandel layout.
pub type Tangent = SMatrix<f64, 6, 6>;

/// A full fourth-order tensor in `D` dimensions, indexed `[i][j][k][l]`.
pub type Tensor4<const D: usize> = [[[[f64; D]; D]; D]; D];

/// Row and column of each Mandel component.
pub const MANDEL: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)];

/// Weight of each Mandel component: 1 on the diagonal, √2 off it.
const WEIGHT: [f64; 6] = [1.0, 1.0, 1.0, SQRT_2, SQRT_2, SQRT_2];

/// A symmetric second-order tensor in the Mandel layout.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sym3(pub [f64; 6]);

impl Sym3 {
    /// The zero tensor.
    pub const ZERO: Sym3 = Sym3([0.0; 6]);
    /// The second-order identity.
    pub const IDENTITY: Sym3 = Sym3([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);

    /// The symmetric part of a matrix.
    pub fn symmetric_part(m: &Mat3) -> Sym3 {
        Sym3(std::array::from_fn(|c| {
            let (i, j) = MANDEL[c];
            0.5 * (m[(i, j)] + m[(j, i)]) * WEIGHT[c]
        }))
    }

    /// The tensor as a full matrix.
    pub fn to_matrix(&self) -> Mat3 {
        let mut m = Mat3::zeros();
        for (c, &(i, j)) in MANDEL.iter().enumerate() {
            let x = self.0[c] / WEIGHT[c];
            m[(i, j)] = x;
            m[(j, i)] = x;
        }
        m
    }

    /// Component `(i, j)`.
    pub fn component(&self, i: usize, j: usize) -> f64 {
        match (i.min(j), i.max(j)) {
            (0, 0) => self.0[0],
            (1, 1) => self.0[1],
            (2, 2) => self.0[2],
            (1, 2) => self.0[3] / SQRT_2,
            (0, 2) => self.0[4] / SQRT_2,
            _ => self.0[5] / SQRT_2,
        }
    }

    /// Trace.
    pub fn trace(&self) -> f64 {
        self.0[0] + self.0[1] + self.0[2]
    }

    /// Deviator.
    pub fn deviator(&self) -> Sym3 {
        *self - Sym3::IDENTITY * (self.trace() / 3.0)
    }

    /// Double contraction with another symmetric tensor.
    pub fn dot(&self, other: &Sym3) -> f64 {
        let mut sum = 0.0;
        for c in 0..6 {
            sum += self.0[c] * other.0[c];
        }
        sum
    }

    /// Frobenius norm.
    pub fn norm(&self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Contraction `t : self` with a fourth-order tensor.
    pub fn contract(&self, t: &Tangent) -> Sym3 {
        let v = t * SVector::<f64, 6>::from(self.0);
        Sym3(v.into())
    }

    /// Eigenvalues and the matrix whose columns are the eigenvectors.
    pub fn eigen(&self) -> ([f64; 3], Mat3) {
        let e = SymmetricEigen::new(self.to_matrix());
        (e.eigenvalues.into(), e.eigenvectors)
    }

    /// The isotropic function that applies `f` to each eigenvalue.
    pub fn map_eigenvalues(&self, f: impl Fn(f64) -> f64) -> Sym3 {
        let (values, vectors) = self.eigen();
        let diagonal = Mat3::from_diagonal(&SVector::<f64, 3>::from(values.map(f)));
        Sym3::symmetric_part(&(vectors * diagonal * vectors.transpose()))
    }

    /// Whether z is a principal direction (no out-of-plane shear), so that the closed forms of [`plane`] apply.
    pub fn is_plane(&self) -> bool {
        self.0[3] == 0.0 && self.0[4] == 0.0
    }
}

impl Add for Sym3 {
    type Output = Sym3;
    fn add(self, other: Sym3) -> Sym3 {
        Sym3(std::array::from_fn(|c| self.0[c] + other.0[c]))
    }
}

impl Sub for Sym3 {
    type Output = Sym3;
    fn sub(self, other: Sym3) -> Sym3 {
        Sym3(std::array::from_fn(|c| self.0[c] - other.0[c]))
    }
}

impl Mul<f64> for Sym3 {
    type Output = Sym3;
    fn mul(self, factor: f64) -> Sym3 {
        Sym3(self.0.map(|x| x * factor))
    }
}

/// A vector as three components, zero beyond `D`.
pub fn padded<const D: usize>(v: &[f64; D]) -> [f64; 3] {
    std::array::from_fn(|d| if d < D { v[d] } else { 0.0 })
}

/// `a ⊗ b` of two symmetric tensors as a fourth-order tensor.
pub fn dyad(a: &Sym3, b: &Sym3) -> Tangent {
    SVector::<f64, 6>::from(a.0) * SVector::<f64, 6>::from(b.0).transpose()
}

/// Entry `[i][j][k][l]` of a fourth-order tensor in the Mandel layout.
pub fn mandel_entry(t: &Tangent, i: usize, j: usize, k: usize, l: usize) -> f64 {
    let (r, c) = (mandel_index(i, j), mandel_index(k, l));
    t[(r, c)] / (WEIGHT[r] * WEIGHT[c])
}

fn mandel_index(i: usize, j: usize) -> usize {
    if i == j { i } else { 6 - i - j }
}

/// The divided difference (ln a − ln b) / (a − b) of the logarithm for a, b > 0, exact to round-off for any gap.
///
/// With m the mean of a and b and x = (a − b)/(a + b) it equals artanh(x) / (x m); a series replaces artanh(x)/x
/// where the quotient would lose digits.
#[inline]
pub fn log_divided_difference(a: f64, b: f64) -> f64 {
    let m = 0.5 * (a + b);
    artanh_over_x(0.5 * (a - b) / m) / m
}

/// artanh(x)/x for |x| < 1.
#[inline]
fn artanh_over_x(x: f64) -> f64 {
    let y = x * x;
    if y < 2.5e-3 {
        // 1 + y/3 + y²/5 + …; the first neglected term is below 3e-20.
        1.0 + y * (1.0 / 3.0 + y * (0.2 + y * (1.0 / 7.0 + y * (1.0 / 9.0 + y * (1.0 / 11.0 + y / 13.0)))))
    } else {
        let x = y.sqrt();
        x.atanh() / x
    }
}

/// L = ∂ ln(b) / ∂ b of eq. (A.2) for a symmetric positive definite b.
///
/// In the eigenbasis of b it is diagonal: 1/λ_a on the pair (a, a), the divided difference of the logarithm on (a, b).
pub fn log_derivative(b: &Sym3) -> Tangent {
    let (values, vectors) = b.eigen();
    let mut L = Tangent::zeros();
    for (c, &(i, j)) in MANDEL.iter().enumerate() {
        let n = vectors.column(i) * vectors.column(j).transpose();
        let e = Sym3::symmetric_part(&n) * if c < 3 { 1.0 } else { SQRT_2 };
        let slope = if c < 3 { 1.0 / values[i] } else { log_divided_difference(values[i], values[j]) };
        L += dyad(&e, &e) * slope;
    }
    L
}

/// Closed forms for tensors of which z is a principal direction: the in-plane 2×2 block decouples from zz.
pub mod plane {
    use super::*;

    /// Mean, half difference and shear of the in-plane block, and the radius of its Mohr circle.
    #[inline]
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
        let slope = if r < 1e-3 {
            1.0 + r * r / 6.0 * (1.0 + r * r / 20.0 * (1.0 + r * r / 42.0))
        } else {
            r.sinh() / r
        };
        let c = r.cosh();
        Sym3([
            scale * (c + slope * d),
            scale * (c - slope * d),
            e.0[2].exp(),
            0.0,
            0.0,
            scale * slope * e.0[5],
        ])
    }

    /// ln(b) together with the in-plane block of ∂ ln(b)/∂b, eq. (A.2), in the Mandel layout `xx, yy, √2 xy`.
    ///
    /// With t0 = I/√2, t1 the normalised deviator of b and t2 ⟂ t1 in the plane,
    /// L = (m/det)(t0⊗t0 + t1⊗t1) − (r/det)(t0⊗t1 + t1⊗t0) + w t2⊗t2, w the divided difference of the logarithm.
    /// Every term stays finite as r → 0, where t1 becomes arbitrary.
    #[inline]
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spd(values: [f64; 3], angles: [f64; 3]) -> Sym3 {
        let q = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).into_inner();
        Sym3::symmetric_part(&(q * Mat3::from_diagonal(&values.into()) * q.transpose()))
    }

    fn close(a: &Tangent, b: &Tangent, tol: f64) {
        assert!((a - b).norm() <= tol * b.norm(), "{a} {b}");
    }

    #[test]
    fn divided_difference_matches_its_series() {
        assert!((log_divided_difference(2.0, 1.0) - std::f64::consts::LN_2).abs() < 3e-16);
        for gap in [1e-3f64, 1e-6, 1e-9, 1e-13, 1e-16] {
            let delta = (1.0 + gap) - 1.0; // the gap that is left after rounding
            let exact = 1.0 - delta / 2.0 + delta.powi(2) / 3.0 - delta.powi(3) / 4.0 + delta.powi(4) / 5.0;
            assert!((log_divided_difference(1.0 + gap, 1.0) - exact).abs() < 3e-16);
        }
        assert_eq!(log_divided_difference(3.0, 3.0), 1.0 / 3.0);
    }

    proptest! {
        #[test]
        fn mandel_layout_preserves_the_double_contraction(a in prop::array::uniform9(-1.0..1.0f64), b in prop::array::uniform9(-1.0..1.0f64)) {
            let (a, b) = (Mat3::from_row_slice(&a), Mat3::from_row_slice(&b));
            let (a, b) = (0.5 * (a + a.transpose()), 0.5 * (b + b.transpose()));
            let (sa, sb) = (Sym3::symmetric_part(&a), Sym3::symmetric_part(&b));
            prop_assert!((sa.dot(&sb) - a.component_mul(&b).sum()).abs() < 1e-14);
            prop_assert!((sa.to_matrix() - a).norm() < 1e-15);
        }

        #[test]
        fn log_derivative_matches_central_differences(v in prop::array::uniform3(0.2..4.0f64), q in prop::array::uniform3(-3.0..3.0f64)) {
            let b = spd(v, q);
            let numeric = Tangent::from_fn(|r, c| {
                let h = 1e-6;
                let (mut p, mut m) = (b, b);
                p.0[c] += h;
                m.0[c] -= h;
                (p.map_eigenvalues(f64::ln).0[r] - m.map_eigenvalues(f64::ln).0[r]) / (2.0 * h)
            });
            close(&numeric, &log_derivative(&b), 1e-8);
        }

        #[test]
        fn plane_closed_forms_match_the_spectral_ones(v in prop::array::uniform3(0.2..4.0f64), q in -3.0..3.0f64, gap in 0.0..16.0f64) {
            // The second in-plane eigenvalue approaches the first down to round-off.
            let v = [v[0], v[0] * (1.0 + 10f64.powf(-gap)), v[2]];
            let b = spd(v, [0.0, 0.0, q]);
            let b = Sym3([b.0[0], b.0[1], b.0[2], 0.0, 0.0, b.0[5]]);
            let general = b.map_eigenvalues(f64::ln);
            let (log, L) = plane::log_with_derivative(&b);
            prop_assert!((log - general).norm() < 1e-14 * (1.0 + general.norm()));
            prop_assert!((plane::log(&b) - log).norm() == 0.0);
            prop_assert!((plane::exp(&log) - b).norm() < 2e-15 * b.norm());
            let full = log_derivative(&b);
            let rows = [0, 1, 5];
            for r in 0..3 {
                for c in 0..3 {
                    prop_assert!((L[r][c] - full[(rows[r], rows[c])]).abs() < 1e-13 * full.norm());
                }
            }
        }
    }
}
