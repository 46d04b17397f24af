//! Second- and fourth-order tensors in three dimensions, their spectral functions, and index conventions.
//!
//! Symmetric second-order tensors are stored in the Mandel layout `xx, yy, zz, √2 yz, √2 xz, √2 xy`, in which the
//! double contraction is the dot product and a fourth-order tensor with minor symmetries is a 6×6 matrix: material
//! laws need no factors of two. Full fourth-order tensors are nested arrays indexed `[i][j][k][l]`.
#![allow(non_snake_case)]

mod exponential;
pub mod lane;
mod logarithm;
pub mod plane;
pub mod spectral;

use std::f64::consts::SQRT_2;
use std::ops::{Add, Mul, Sub};

use nalgebra::{Matrix3, SMatrix, SVector};

pub(crate) use exponential::exp;
pub use lane::{Lane, Lanes};
pub(crate) use logarithm::ln;
pub use spectral::{
    PrincipalDerivative, Spectrum, exp_derivative, log_derivative, log_divided_difference,
    log_with_derivative,
};

/// A general second-order tensor.
pub type Mat3 = Matrix3<f64>;

/// A fourth-order tensor with minor symmetries in the Mandel layout.
pub type Tangent = SMatrix<f64, 6, 6>;

/// A full fourth-order tensor in `D` dimensions, indexed `[i][j][k][l]`.
pub type Tensor4<const D: usize> = [[[[f64; D]; D]; D]; D];

/// Row and column of each Mandel component.
pub const MANDEL: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)];

/// Row and column of each component of a symmetric tensor in files and arrays, in the order of ParaView: xx, yy, zz,
/// xy, yz, xz.
pub const SYMMETRIC: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)];

/// Weight of each Mandel component: 1 on the diagonal, √2 off the diagonal.
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
    #[inline]
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

    /// Components in the order of [`SYMMETRIC`], without the factors of the Mandel layout.
    #[inline]
    pub fn components(&self) -> [f64; 6] {
        let [xx, yy, zz, yz, xz, xy] = self.0;
        [xx, yy, zz, xy / SQRT_2, yz / SQRT_2, xz / SQRT_2]
    }

    /// The tensor with these components, in the order of [`SYMMETRIC`], without the factors of the Mandel layout.
    #[inline]
    pub fn from_components([xx, yy, zz, xy, yz, xz]: [f64; 6]) -> Sym3 {
        Sym3([xx, yy, zz, yz * SQRT_2, xz * SQRT_2, xy * SQRT_2])
    }

    /// Trace.
    #[inline(always)]
    pub fn trace(&self) -> f64 {
        self.0[0] + self.0[1] + self.0[2]
    }

    /// Deviator.
    #[inline(always)]
    pub fn deviator(&self) -> Sym3 {
        *self - Sym3::IDENTITY * (self.trace() / 3.0)
    }

    /// Double contraction with another symmetric tensor.
    #[inline(always)]
    pub fn dot(&self, other: &Sym3) -> f64 {
        let mut sum = 0.0;
        for c in 0..6 {
            sum += self.0[c] * other.0[c];
        }
        sum
    }

    /// Frobenius norm.
    #[inline(always)]
    pub fn norm(&self) -> f64 {
        self.dot(self).sqrt()
    }

    /// Contraction `t : self` with a fourth-order tensor.
    pub fn contract(&self, t: &Tangent) -> Sym3 {
        let v = t * SVector::<f64, 6>::from(self.0);
        Sym3(v.into())
    }

    /// Eigenvalues and eigenvectors.
    pub fn spectrum(&self) -> Spectrum {
        Spectrum::new(self)
    }

    /// The isotropic function that applies `f` to each eigenvalue.
    pub fn map_eigenvalues(&self, f: impl Fn(f64) -> f64) -> Sym3 {
        let spectrum = self.spectrum();
        spectrum.compose(spectrum.values.map(f))
    }

    /// True if z is a principal direction (no out-of-plane shear); the closed forms of [`plane`] then apply.
    pub fn is_plane(&self) -> bool {
        self.0[3] == 0.0 && self.0[4] == 0.0
    }
}

impl Add for Sym3 {
    type Output = Sym3;
    #[inline(always)]
    fn add(self, other: Sym3) -> Sym3 {
        Sym3(std::array::from_fn(|c| self.0[c] + other.0[c]))
    }
}

impl Sub for Sym3 {
    type Output = Sym3;
    #[inline(always)]
    fn sub(self, other: Sym3) -> Sym3 {
        Sym3(std::array::from_fn(|c| self.0[c] - other.0[c]))
    }
}

impl Mul<f64> for Sym3 {
    type Output = Sym3;
    #[inline(always)]
    fn mul(self, factor: f64) -> Sym3 {
        Sym3(std::array::from_fn(|c| self.0[c] * factor))
    }
}

/// A vector padded with zeros to three components.
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn spd(values: [f64; 3], angles: [f64; 3]) -> Sym3 {
        let q = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]).into_inner();
        Sym3::symmetric_part(&(q * Mat3::from_diagonal(&values.into()) * q.transpose()))
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
        fn plane_closed_forms_match_the_spectral_ones(v in prop::array::uniform3(0.2..4.0f64), q in -3.0..3.0f64, gap in 0.0..16.0f64) {
            // The second in-plane eigenvalue approaches the first down to round-off.
            let v = [v[0], v[0] * (1.0 + 10f64.powf(-gap)), v[2]];
            let b = spd(v, [0.0, 0.0, q]);
            let b = Sym3([b.0[0], b.0[1], b.0[2], 0.0, 0.0, b.0[5]]);
            let general = b.map_eigenvalues(f64::ln);
            let (log, L) = plane::log_with_derivative(&plane::components(&b));
            let log = plane::tensor(log);
            prop_assert!((log - general).norm() < 1e-14 * (1.0 + general.norm()));
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
