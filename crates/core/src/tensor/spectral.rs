//! Spectral decomposition of symmetric tensors; logarithm, exponential and their derivatives.
//!
//! Repeated and nearly equal eigenvalues, as at every unloaded point, need no special treatment: eigenvectors are
//! orthonormal to round-off for any gap, and divided differences are formed without cancellation.
#![allow(non_snake_case)]

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use super::logarithm::{SERIES, artanh_over_x};
use super::{Sym3, Tangent};

/// Pairs of eigenvalues, in the order of the shear components of the Mandel layout.
const PAIRS: [(usize, usize); 3] = [(1, 2), (0, 2), (0, 1)];

/// Eigenvalues and eigenvectors of a symmetric tensor, in no particular order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spectrum {
    /// Eigenvalues.
    pub values: [f64; 3],
    /// Orthonormal eigenvectors: `vectors[a]` belongs to `values[a]`.
    pub vectors: [[f64; 3]; 3],
}

/// Derivative of an isotropic tensor function in the eigenbasis of its argument.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PrincipalDerivative {
    /// Derivative of eigenvalue `i` of the function with respect to eigenvalue `j` of the argument, `[i][j]`.
    pub normal: [[f64; 3]; 3],
    /// Divided differences for the pairs (1, 2), (0, 2) and (0, 1).
    pub across: [f64; 3],
}

impl Spectrum {
    /// Decomposes a tensor. The error is of the order of round-off in its largest entry; NaN yields NaN.
    ///
    /// The deviator is scaled to B with eigenvalues 2cos θ, 2cos(θ ± 2π/3). The sign of B is chosen so that the largest
    /// eigenvalue is the best separated one (Eberly, *A Robust Eigensolver for 3×3 Symmetric Matrices*). That
    /// eigenvalue and its eigenvector v are well conditioned. One rotation in the plane normal to v then diagonalises
    /// the rest, exactly for any gap.
    #[inline]
    pub fn new(t: &Sym3) -> Spectrum {
        let [xx, yy, zz, ..] = t.0;
        let mut mean = (xx + yy + zz) / 3.0;
        let mut d = [xx - mean, yy - mean, zz - mean];
        let o = [t.0[3] * FRAC_1_SQRT_2, t.0[4] * FRAC_1_SQRT_2, t.0[5] * FRAC_1_SQRT_2];
        let shears = o[0].abs() + o[1].abs() + o[2].abs();
        let mut size = d[0].abs() + d[1].abs() + d[2].abs() + shears;
        let mut least = f64::MIN_POSITIVE;
        let trace = d[0] + d[1] + d[2];
        if trace.abs() > 1e-3 * size {
            // If the entries differ only by a few units in the last place, the rounding error of the mean is as large
            // as these differences.
            least = least.max(1e-8 * size);
            d = std::array::from_fn(|k| d[k] - trace / 3.0);
            mean += trace / 3.0;
            size = d[0].abs() + d[1].abs() + d[2].abs() + shears;
        }
        if size < least {
            return Spectrum {
                values: [xx, yy, zz],
                vectors: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            };
        }
        let (d, o) = (scaled(&d, 1.0 / size), scaled(&o, 1.0 / size));
        let squares = dot(&d, &d) + 2.0 * dot(&o, &o);
        let radius = (squares / 6.0).sqrt();
        let det = d[0] * (d[1] * d[2] - o[0] * o[0]) - o[2] * (o[2] * d[2] - o[0] * o[1])
            + o[1] * (o[2] * o[0] - d[1] * o[1]);
        let radius = radius.copysign(det);
        let half_det = (det / (2.0 * radius * radius * radius)).min(1.0);
        let (d, o) = (scaled(&d, 1.0 / radius), scaled(&o, 1.0 / radius));
        let B = [[d[0], o[2], o[1]], [o[2], d[1], o[0]], [o[1], o[0], d[2]]];
        let (values, vectors) = deflated(&B, largest_root(half_det));
        let scale = radius * size;
        Spectrum { values: std::array::from_fn(|a| mean + scale * values[a]), vectors }
    }

    /// The tensor Σ f_a n_a ⊗ n_a with these eigenvectors and eigenvalues `f`.
    #[inline]
    pub fn compose(&self, f: [f64; 3]) -> Sym3 {
        let mut sum = Sym3::ZERO;
        for (f, n) in f.iter().zip(&self.vectors) {
            sum = sum + square(n) * *f;
        }
        sum
    }

    /// This decomposition with the eigenvalues in descending order.
    #[inline]
    pub fn descending(mut self) -> Spectrum {
        for (a, b) in [(0, 1), (1, 2), (0, 1)] {
            if self.values[a] < self.values[b] {
                self.values.swap(a, b);
                self.vectors.swap(a, b);
            }
        }
        self
    }

    /// Derivative of an isotropic tensor function whose eigenvalues each depend on all eigenvalues of the argument.
    #[inline]
    pub fn full_derivative(&self, derivative: &PrincipalDerivative) -> Tangent {
        let squares = [square(&self.vectors[0]), square(&self.vectors[1]), square(&self.vectors[2])];
        let mut sum = Tangent::zeros();
        for (row, e) in derivative.normal.iter().zip(&squares) {
            let across = squares[0] * row[0] + squares[1] * row[1] + squares[2] * row[2];
            for (mut column, entry) in sum.column_iter_mut().zip(across.0) {
                for (sum, x) in column.iter_mut().zip(e.0) {
                    *sum += x * entry;
                }
            }
        }
        for ((a, b), across) in PAIRS.into_iter().zip(derivative.across) {
            add_dyad(&mut sum, &product(&self.vectors[a], &self.vectors[b]), across);
        }
        sum
    }

    /// Derivative of an isotropic tensor function. `slope` is the derivative of the scalar function at each eigenvalue;
    /// `across` is its divided difference for the pairs (1, 2), (0, 2) and (0, 1).
    ///
    /// The derivative is diagonal in the eigenbasis: `slope` on n_a ⊗ n_a, `across` on the symmetric part of
    /// √2 n_a ⊗ n_b.
    #[inline]
    pub fn derivative(&self, slope: [f64; 3], across: [f64; 3]) -> Tangent {
        let mut sum = Tangent::zeros();
        for (n, slope) in self.vectors.iter().zip(slope) {
            add_dyad(&mut sum, &square(n), slope);
        }
        for ((a, b), across) in PAIRS.into_iter().zip(across) {
            add_dyad(&mut sum, &product(&self.vectors[a], &self.vectors[b]), across);
        }
        sum
    }

    /// Evaluates `f` for each pair of eigenvalues, in the order of `across` in [`Spectrum::derivative`].
    #[inline]
    fn on_pairs(&self, f: impl Fn(f64, f64) -> f64) -> [f64; 3] {
        std::array::from_fn(|pair| {
            let (a, b) = PAIRS[pair];
            f(self.values[a], self.values[b])
        })
    }
}

/// Largest root of β³ − 3β − 2h = 0 for 0 ≤ h ≤ 1, which is 2 cos(arccos(h)/3).
///
/// The root is simple and lies in [√3, 2]. A polynomial approximates it to 10⁻⁵; two Newton steps reach round-off.
#[inline]
fn largest_root(h: f64) -> f64 {
    let mut root = 1.732_060_9 + h * (0.332_823_4 + h * (-0.091_843_9 + h * (0.035_024_4 - h * 0.008_070_8)));
    for _ in 0..2 {
        let square = root * root;
        root -= (root * (square - 3.0) - 2.0 * h) / (3.0 * square - 3.0);
    }
    root
}

/// Eigenvalues and eigenvectors of a traceless matrix with `root` as a simple, well-separated eigenvalue.
#[inline]
fn deflated(B: &[[f64; 3]; 3], root: f64) -> ([f64; 3], [[f64; 3]; 3]) {
    // The rows of B − root I span the plane normal to the eigenvector. The cross product of the two best-conditioned
    // rows gives the eigenvector.
    let row =
        |i: usize| -> [f64; 3] { std::array::from_fn(|j| if i == j { B[i][j] - root } else { B[i][j] }) };
    let rows = [row(0), row(1), row(2)];
    let mut v = cross(&rows[0], &rows[1]);
    let mut length = dot(&v, &v);
    for (i, j) in [(0, 2), (1, 2)] {
        let other = cross(&rows[i], &rows[j]);
        let other_length = dot(&other, &other);
        if other_length > length {
            (v, length) = (other, other_length);
        }
    }
    let scale = 1.0 / length.sqrt();
    let v = scaled(&v, scale);
    let u = if v[0].abs() > v[1].abs() {
        let scale = 1.0 / (v[0] * v[0] + v[2] * v[2]).sqrt();
        [-v[2] * scale, 0.0, v[0] * scale]
    } else {
        let scale = 1.0 / (v[1] * v[1] + v[2] * v[2]).sqrt();
        [0.0, v[2] * scale, -v[1] * scale]
    };
    let w = cross(&v, &u);
    let times = |x: &[f64; 3]| -> [f64; 3] { std::array::from_fn(|i| dot(&B[i], x)) };
    let (Bu, Bw) = (times(&u), times(&w));
    let (uu, uw, ww) = (dot(&u, &Bu), dot(&w, &Bu), dot(&w, &Bw));
    // Rotate by the smaller of the two angles that make uw vanish.
    let difference = ww - uu;
    let spread = (difference * difference + 4.0 * uw * uw).sqrt();
    let tan = if spread > 0.0 { 2.0 * uw / (difference + spread.copysign(difference)) } else { 0.0 };
    let cos = 1.0 / (1.0 + tan * tan).sqrt();
    let sin = tan * cos;
    let first = std::array::from_fn(|i| cos * u[i] - sin * w[i]);
    let second = std::array::from_fn(|i| sin * u[i] + cos * w[i]);
    ([dot(&v, &times(&v)), uu - tan * uw, ww + tan * uw], [v, first, second])
}

/// n ⊗ n.
#[inline]
fn square(n: &[f64; 3]) -> Sym3 {
    let [x, y, z] = *n;
    Sym3([x * x, y * y, z * z, SQRT_2 * y * z, SQRT_2 * x * z, SQRT_2 * x * y])
}

/// The symmetric part of √2 a ⊗ b; its norm is 1 for orthonormal a and b.
#[inline]
fn product(a: &[f64; 3], b: &[f64; 3]) -> Sym3 {
    let shear = |i: usize, j: usize| a[i] * b[j] + a[j] * b[i];
    Sym3([
        SQRT_2 * a[0] * b[0],
        SQRT_2 * a[1] * b[1],
        SQRT_2 * a[2] * b[2],
        shear(1, 2),
        shear(0, 2),
        shear(0, 1),
    ])
}

/// Adds `factor` e ⊗ e to `sum`.
#[inline]
fn add_dyad(sum: &mut Tangent, e: &Sym3, factor: f64) {
    for (mut column, entry) in sum.column_iter_mut().zip(e.0) {
        let scaled = factor * entry;
        for (entry, x) in column.iter_mut().zip(e.0) {
            *entry += scaled * x;
        }
    }
}

// `array::map` is not always inlined; `from_fn` is.

#[inline(always)]
fn scaled(a: &[f64; 3], factor: f64) -> [f64; 3] {
    std::array::from_fn(|i| a[i] * factor)
}

#[inline(always)]
fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// ln(b) and L = ∂ ln(b)/∂b, eq. (A.2); ln(b) is finite only if b is positive definite.
#[inline]
pub fn log_with_derivative(b: &Sym3) -> (Sym3, Tangent) {
    let spectrum = b.spectrum();
    let [x, y, z] = spectrum.values;
    let L = spectrum.derivative([1.0 / x, 1.0 / y, 1.0 / z], spectrum.on_pairs(log_divided_difference));
    (spectrum.compose([x.ln(), y.ln(), z.ln()]), L)
}

/// L = ∂ ln(b)/∂b, eq. (A.2), for a positive definite b.
pub fn log_derivative(b: &Sym3) -> Tangent {
    log_with_derivative(b).1
}

/// The derivative ∂ exp(e)/∂e.
pub fn exp_derivative(e: &Sym3) -> Tangent {
    let spectrum = e.spectrum();
    spectrum.derivative(spectrum.values.map(f64::exp), spectrum.on_pairs(exp_divided_difference))
}

/// Divided difference (ln a − ln b)/(a − b) for a, b > 0, accurate to round-off for any gap.
///
/// With the mean m of a and b and x = (a − b)/(a + b) it equals artanh(x)/(x m), which is expanded in a series where
/// the quotient would lose digits.
#[inline]
pub fn log_divided_difference(a: f64, b: f64) -> f64 {
    let m = 0.5 * (a + b);
    let x = 0.5 * (a - b) / m;
    if x * x < SERIES { artanh_over_x(x.abs()) / m } else { (a / b).ln() / (a - b) }
}

/// Divided difference (eᵃ − eᵇ)/(a − b), accurate to round-off for any gap.
#[inline]
fn exp_divided_difference(a: f64, b: f64) -> f64 {
    (0.5 * (a + b)).exp() * sinh_over_x(0.5 * (a - b))
}

/// sinh(x)/x.
#[inline]
pub(super) fn sinh_over_x(x: f64) -> f64 {
    let y = x * x;
    if y < 1e-6 { 1.0 + y / 6.0 * (1.0 + y / 20.0 * (1.0 + y / 42.0)) } else { x.sinh() / x }
}

#[cfg(test)]
mod tests;
