//! Inverse map of an element: local coordinates of a position.

use super::{ElementShape, adjugate, cross, dot, minus};

impl ElementShape {
    /// Local coordinates ξ of a position; the inverse of [`map`](Self::map) in and around the element.
    ///
    /// The map of a simplex is linear and invertible everywhere. The map of a quadrilateral or hexahedron can fold over
    /// at some distance from the element, unless opposite sides are parallel; the result is `None` beyond the fold.
    pub fn inverse<const D: usize>(self, corners: &[[f64; D]], x: &[f64; D]) -> Option<[f64; D]> {
        match self {
            ElementShape::Simplex => linear(corners, x),
            ElementShape::Box => multilinear(corners, x),
        }
    }
}

/// Local coordinates of a position in a simplex.
fn linear<const D: usize>(corners: &[[f64; D]], x: &[f64; D]) -> Option<[f64; D]> {
    let origin = *corners.first()?;
    let shape = ElementShape::Simplex;
    if corners.len() < shape.n_nodes::<D>() {
        return None;
    }
    Some(solve(&shape.jacobian(corners, shape.centre()), minus(*x, origin)))
}

/// Solves J x = b.
fn solve<const D: usize>(jacobian: &[[f64; D]; D], b: [f64; D]) -> [f64; D] {
    let (adjugate, determinant) = adjugate(jacobian);
    adjugate.map(|row| dot(row, b) / determinant)
}

/// Local coordinates of a position in a quadrilateral or hexahedron.
fn multilinear<const D: usize>(corners: &[[f64; D]], x: &[f64; D]) -> Option<[f64; D]> {
    if D == 2 {
        let [p, q, r, s] = *corners else { return None };
        let xi = bilinear([p, q, r, s].map(|c| [c[0], c[1]]), [x[0], x[1]])?;
        return Some(std::array::from_fn(|d| xi[d]));
    }
    trilinear(corners, x)
}

/// Local coordinates of a position in a quadrilateral.
///
/// With x = p + (1+ξ)/2 b + (1+η)/2 c + (1+ξ)(1+η)/4 d, elimination of ξ yields a quadratic equation for η. The
/// derivative of the quadratic at a root is the determinant of the map, so the root in the element is the one with the
/// positive square root; no iteration is needed. One Newton step removes the round-off of the formula.
fn bilinear(corners: [[f64; 2]; 4], x: [f64; 2]) -> Option<[f64; 2]> {
    let [p, q, r, s] = corners;
    let (b, c, h) = (minus(q, p), minus(s, p), minus(x, p));
    let d = minus(minus(r, s), b);
    let quadratic = -cross(c, d);
    let linear = cross(h, d) + cross(b, c);
    let constant = cross(h, b);
    let square = linear * linear - 4.0 * quadratic * constant;
    if square.is_nan() || square <= 0.0 {
        return None;
    }
    let root = square.sqrt();
    let v =
        if linear >= 0.0 { -2.0 * constant / (linear + root) } else { (root - linear) / (2.0 * quadratic) };
    let along = [b[0] + v * d[0], b[1] + v * d[1]];
    let rest = [h[0] - v * c[0], h[1] - v * c[1]];
    let u = (rest[0] * along[0] + rest[1] * along[1]) / (along[0] * along[0] + along[1] * along[1]);

    let shape = ElementShape::Box;
    let mut xi = [2.0 * u - 1.0, 2.0 * v - 1.0];
    let [[j00, j01], [j10, j11]] = shape.jacobian(&corners, xi);
    let error = minus(x, shape.map(&corners, xi));
    let determinant = j00 * j11 - j01 * j10;
    xi[0] += (j11 * error[0] - j01 * error[1]) / determinant;
    xi[1] += (j00 * error[1] - j10 * error[0]) / determinant;
    xi.iter().all(|v| v.is_finite()).then_some(xi)
}

/// Largest number of Newton steps.
const MAX_STEPS: usize = 60;
/// Convergence tolerance of a Newton step in local coordinates: the remaining error is of the order of its square.
const LAST_STEP: f64 = 1e-8;
/// Smallest fraction of a Newton step that the line search tries.
const SHORTEST: f64 = 1e-6;
/// Local coordinates larger than this are certainly outside the element.
const FAR: f64 = 1e3;

/// Local coordinates of a position in a hexahedron. Newton's method starts from the centre or, if that fails, from the
/// centres of the eight octants.
fn trilinear<const D: usize>(corners: &[[f64; D]], x: &[f64; D]) -> Option<[f64; D]> {
    if corners.len() < ElementShape::Box.n_nodes::<D>() || x.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let parts = (0..1usize << D).map(|part| super::corner_side(part).map(|side: f64| 0.5 * side));
    std::iter::once([0.0; D]).chain(parts).find_map(|start| newton(corners, x, start))
}

/// Newton's method with a line search that keeps the distance decreasing and the determinant of the map positive.
fn newton<const D: usize>(corners: &[[f64; D]], x: &[f64; D], start: [f64; D]) -> Option<[f64; D]> {
    let shape = ElementShape::Box;
    let mut xi = start;
    let mut error = minus(*x, shape.map(corners, xi));
    let mut jacobian = shape.jacobian(corners, xi);
    for _ in 0..MAX_STEPS {
        let step = solve(&jacobian, error);
        let largest = step.iter().fold(0.0f64, |m, s| m.max(s.abs()));
        if largest <= LAST_STEP {
            return Some(std::array::from_fn(|d| xi[d] + step[d]));
        }
        let mut part = 1.0;
        (xi, error, jacobian) = loop {
            if !largest.is_finite() || part < SHORTEST {
                return None;
            }
            let next = std::array::from_fn(|d| xi[d] + part * step[d]);
            let left = minus(*x, shape.map(corners, next));
            let there = shape.jacobian(corners, next);
            if dot(left, left) < dot(error, error) && adjugate(&there).1 > 0.0 {
                break (next, left, there);
            }
            part *= 0.5;
        };
        if xi.iter().any(|x| x.abs() > FAR) {
            return None;
        }
    }
    None
}
