//! Check that the map of a hexahedron is orientation-preserving everywhere.

use super::{ElementShape, MAX_NODES, adjugate};

/// Largest depth of the subdivision into octants; a hexahedron that is still undecided counts as folded.
const MAX_DIVISIONS: usize = 5;

/// Number of nodes of the quadratic interpolation along an axis.
const LATTICE: usize = 3;

/// True if the determinant of the map of a hexahedron is at most `least`, [length³], somewhere inside.
///
/// The determinant is a polynomial of degree two along each local axis. If all its Bernstein coefficients exceed the
/// limit, so does the polynomial; if one of the sampled values does not, the hexahedron folds. If neither is the case,
/// the hexahedron is divided into octants. A hexahedron that stays undecided counts as folded.
pub fn folds(corners: &[[f64; 3]], least: f64) -> bool {
    if corners.len() < MAX_NODES {
        return true;
    }
    let determinant = |xi: [f64; 3]| adjugate(&ElementShape::Box.jacobian(corners, xi)).1;
    falls_below(&determinant, [0.0; 3], 1.0, least, MAX_DIVISIONS)
}

/// True if a polynomial of degree two along each axis is at most `least` somewhere in a cube of half side `half`.
fn falls_below(
    polynomial: &dyn Fn([f64; 3]) -> f64,
    centre: [f64; 3],
    half: f64,
    least: f64,
    divisions: usize,
) -> bool {
    let number = |i: usize, j: usize, k: usize| i + LATTICE * (j + LATTICE * k);
    let mut values = [0.0; LATTICE * LATTICE * LATTICE];
    for k in 0..LATTICE {
        for j in 0..LATTICE {
            for i in 0..LATTICE {
                let offset = [i, j, k].map(|n| n as f64 - 1.0);
                values[number(i, j, k)] = polynomial(std::array::from_fn(|d| centre[d] + half * offset[d]));
            }
        }
    }
    let above = |v: &f64| *v > least;
    if !values.iter().all(above) {
        return true;
    }
    // Bernstein coefficients of a quadratic from its values at −1, 0 and 1. The outer coefficients equal the end
    // values.
    for axis in 0..3 {
        let stride = LATTICE.pow(axis);
        for first in (0..values.len()).filter(|n| n / stride % LATTICE == 0) {
            let (low, high) = (values[first], values[first + 2 * stride]);
            values[first + stride] = 2.0 * values[first + stride] - 0.5 * (low + high);
        }
    }
    if values.iter().all(above) {
        return false;
    }
    divisions == 0
        || (0..MAX_NODES).any(|part| {
            let side: [f64; 3] = super::corner_side(part);
            let middle = std::array::from_fn(|d| centre[d] + 0.5 * half * side[d]);
            falls_below(polynomial, middle, 0.5 * half, least, divisions - 1)
        })
}
