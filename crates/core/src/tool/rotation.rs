//! Rotations in space as matrices and rotation vectors.

use crate::region::vector::{along, cross, dot, norm, unit};

/// A matrix, `[i][j]`.
pub(super) type Matrix = [[f64; 3]; 3];

/// The matrix whose columns are the images of the unit vectors.
fn from_images(image: impl Fn(&[f64; 3]) -> [f64; 3]) -> Matrix {
    let columns: Matrix = std::array::from_fn(|k| image(&unit(k)));
    transposed(&columns)
}

pub(super) fn transposed<const D: usize>(m: &[[f64; D]; D]) -> [[f64; D]; D] {
    std::array::from_fn(|i| std::array::from_fn(|j| m[j][i]))
}

pub(super) fn apply<const D: usize>(m: &[[f64; D]; D], x: &[f64; D]) -> [f64; D] {
    std::array::from_fn(|i| dot(&m[i], x))
}

pub(super) fn product<const D: usize>(a: &[[f64; D]; D], b: &[[f64; D]; D]) -> [[f64; D]; D] {
    std::array::from_fn(|i| (0..D).fold([0.0; D], |row, k| along(&row, a[i][k], &b[k])))
}

/// (1 − cos t) / t² and (t − sin t) / t³.
fn coefficients(t: f64) -> [f64; 2] {
    let half = 0.5 * t;
    let sine = if half == 0.0 { 1.0 } else { half.sin() / half };
    let s = t * t;
    let third = if t.abs() < 0.5 {
        // The series is accurate to round-off where the difference would cancel.
        let terms = [1.0 / 6.0, 20.0, 42.0, 72.0, 110.0, 156.0, 210.0];
        terms[1..].iter().rev().fold(1.0, |sum, divisor| 1.0 - s / divisor * sum) * terms[0]
    } else {
        (t - t.sin()) / (t * s)
    };
    [0.5 * sine * sine, third]
}

/// The rotation exp(v̂) by the angle |v|, [rad], about v (Rodrigues).
pub(super) fn exponential(v: &[f64; 3]) -> Matrix {
    let t = norm(v);
    let sine = if t == 0.0 { 1.0 } else { t.sin() / t };
    let [second, _] = coefficients(t);
    from_images(|e| {
        let once = cross(v, e);
        along(&along(e, sine, &once), second, &cross(v, &once))
    })
}

/// exp(v̂) x − x, without cancellation.
pub(super) fn turning(v: &[f64; 3], x: &[f64; 3]) -> [f64; 3] {
    let t = norm(v);
    let sine = if t == 0.0 { 1.0 } else { t.sin() / t };
    let [second, _] = coefficients(t);
    let once = cross(v, x);
    along(&once.map(|x| sine * x), second, &cross(v, &once))
}

/// The left Jacobian J, for which d exp(v̂) = ŵ exp(v̂) with w = J dv; v̂ is the skew matrix of v (Chirikjian,
/// *Stochastic Models, Information Theory, and Lie Groups* 2, 2012).
pub(super) fn left_jacobian(v: &[f64; 3]) -> Matrix {
    let [second, third] = coefficients(norm(v));
    from_images(|e| {
        let once = cross(v, e);
        along(&along(e, second, &once), third, &cross(v, &once))
    })
}

/// The rotation vector of a rotation, [rad]; its length is at most π.
pub(super) fn logarithm(r: &Matrix) -> [f64; 3] {
    // The quaternion from its largest component (Shepperd, *J. Guid. Control* 1 (1978) 223), multiplied by 4 times that
    // component.
    let trace = r[0][0] + r[1][1] + r[2][2];
    let largest = (0..3).max_by(|&a, &b| r[a][a].total_cmp(&r[b][b])).unwrap_or(0);
    let skew: [f64; 3] = std::array::from_fn(|k| r[(k + 2) % 3][(k + 1) % 3] - r[(k + 1) % 3][(k + 2) % 3]);
    let (scalar, vector) = if trace >= r[largest][largest] {
        (1.0 + trace, skew)
    } else {
        let symmetric = std::array::from_fn(|k| {
            if k == largest { 1.0 + 2.0 * r[k][k] - trace } else { r[k][largest] + r[largest][k] }
        });
        (skew[largest], symmetric)
    };
    let length = norm(&vector);
    if length == 0.0 {
        return [0.0; 3];
    }
    let sign = if scalar < 0.0 { -1.0 } else { 1.0 };
    let angle = 2.0 * length.atan2(sign * scalar);
    vector.map(|x| sign * angle / length * x)
}
