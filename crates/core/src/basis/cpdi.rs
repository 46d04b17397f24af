//! Convected particle domain interpolation, CPDI1 and CPDI2 (Sadeghirad et al., 2011 and 2013), derived from its
//! definition because the formulas first printed for CPDI2 were wrong (footnote 6 of the paper). Domains are
//! quadrilaterals (hexahedra) or triangles (tetrahedra); in space, also pyramids and wedges, which are hexahedra with
//! corners that coincide.
//!
//! Inside the domain of a point, the grid basis is replaced by an interpolation of its values at the corners, N_v(x) ≈
//! Σ_c N_c(x) N_v(x_c), so that
//!
//! S_v = Σ_c w_c N_v(x_c) with w_c = (1/V) ∫ N_c dV and ∇S_v = Σ_c g_c N_v(x_c) with g_c = (1/V) ∫ ∇N_c dV.
//!
//! On a quadrilateral or hexahedron, the integrands N_c det J and ∂N_c/∂ξ det J J⁻¹ are polynomials. Column a of J is
//! constant along axis a and linear along the others, so det J has degree D − 1 along each axis, N_c det J has degree
//! D, and the entries of det J J⁻¹ times ∂N_c/∂ξ have degree D − 1. Two Gauss points per axis integrate degree three
//! exactly, which is sufficient for D ≤ 3. On a quadrilateral, the integrals have closed forms. On a simplex, ∇N_c is
//! constant and w_c = 1/(D + 1).

use super::{Basis, PointGeometry, Support, SupportError};
use crate::grid::element::{Collapsed, ElementShape, box_shape, corner_side, gauss_points};
use crate::grid::{CellValues, Grid};
use crate::tensor::{Mat3, padded};

/// Points with a domain given by its corners. CPDI1 and CPDI2 share this basis; they differ in the update of the
/// corners.
#[derive(Debug, Clone, Copy)]
pub struct Cpdi;

/// Largest number of corners of a domain.
const MAX_CORNERS: usize = 8;

impl<const D: usize> Basis<D> for Cpdi {
    fn support(
        &self,
        grid: &dyn Grid<D>,
        point: &PointGeometry<D>,
        out: &mut Support<D>,
    ) -> Result<(), SupportError> {
        let weights = CornerWeights::new(point.corners)?;
        sum_over_corners(&weights, grid, point, out)
    }
}

/// S_v = Σ_c w_c N_v(x_c) and ∇S_v = Σ_c g_c N_v(x_c).
fn sum_over_corners<const D: usize>(
    weights: &CornerWeights<D>,
    grid: &dyn Grid<D>,
    point: &PointGeometry<D>,
    out: &mut Support<D>,
) -> Result<(), SupportError> {
    out.clear();
    out.cells.push(point.cell);
    for (corner, position) in point.corners.iter().enumerate() {
        let (cell, basis) = near_corner(grid, corner, position, point.cell)?;
        if !out.cells.contains(&cell) {
            out.cells.push(cell);
        }
        let (w, g) = (weights.value[corner], &weights.gradient[corner]);
        let (nodes, values) = (basis.nodes(), basis.value());
        if out.nodes == nodes {
            // The usual case: all corners lie in one cell.
            for (k, value) in values.iter().enumerate() {
                out.value[k] += w * value;
                (0..D).for_each(|d| out.gradient[k][d] += g[d] * value);
            }
            continue;
        }
        for (&node, &value) in nodes.iter().zip(values) {
            if value != 0.0 {
                out.add(node, w * value, g.map(|g| g * value));
            }
        }
    }
    Ok(())
}

/// Largest distance by which a corner may lie outside the grid, in cells. The corners of CPDI1 domains follow the
/// deformation of their point and leave the grid where a body turns or shears along a wall or an axis of symmetry.
pub const CORNER_MARGIN: f64 = 0.5;

/// The cell that contains a position or is nearest to it, and the distance of the position from the grid, in cells. The
/// distance is minus the sum of the negative values of the basis of that cell, continued to the position.
#[inline]
pub fn nearest_with_distance<const D: usize>(
    grid: &dyn Grid<D>,
    position: &[f64; D],
    hint: u32,
) -> (u32, f64) {
    if let Some(cell) = grid.locate(position, Some(hint)) {
        return (cell, 0.0);
    }
    let cell = grid.nearest_cell(position);
    let basis = grid.basis_at(cell, position);
    (cell, -basis.value().iter().map(|value| value.min(0.0)).sum::<f64>())
}

/// The cell and basis of a corner. Just outside the grid, the basis is continued, so that linear fields are still
/// reproduced exactly.
#[inline(always)]
fn near_corner<const D: usize>(
    grid: &dyn Grid<D>,
    corner: usize,
    position: &[f64; D],
    hint: u32,
) -> Result<(u32, CellValues), SupportError> {
    let (cell, basis) = grid.values_near(position, Some(hint));
    let outside = -basis.value().iter().map(|value| value.min(0.0)).sum::<f64>();
    if outside <= CORNER_MARGIN {
        return Ok((cell, basis));
    }
    Err(SupportError::CornerOffGrid { corner, position: padded(position), dimension: D })
}

/// Checks that a domain given by its corners lies in the grid, is not inverted and does not cross itself. The search
/// starts at `cell`.
///
/// # Errors
/// A [`SupportError`] if [`Cpdi`] would return one for this domain.
pub fn check_domain<const D: usize>(
    grid: &dyn Grid<D>,
    corners: &[[f64; D]],
    cell: u32,
) -> Result<(), SupportError> {
    for (corner, position) in corners.iter().enumerate() {
        if nearest_with_distance(grid, position, cell).1 > CORNER_MARGIN {
            return Err(SupportError::CornerOffGrid { corner, position: padded(position), dimension: D });
        }
    }
    if D == 2 && corners.len() == 4 {
        return quadrilateral(corners).map(|_| ());
    }
    CornerWeights::new(corners).map(|_| ())
}

/// Weights w_c and g_c of the corners of a domain.
struct CornerWeights<const D: usize> {
    value: [f64; MAX_CORNERS],
    gradient: [[f64; D]; MAX_CORNERS],
}

impl<const D: usize> CornerWeights<D> {
    fn new(corners: &[[f64; D]]) -> Result<Self, SupportError> {
        match ElementShape::from_nodes::<D>(corners.len()) {
            Some(ElementShape::Simplex) => Self::simplex(corners),
            Some(ElementShape::Box) if D == 2 => Self::quadrilateral(corners),
            Some(ElementShape::Box) => Self::hexahedron(corners),
            None => Self::collapsed(corners),
        }
    }

    /// Weights of a pyramid or wedge: those of a hexahedron, summed over the corners that coincide.
    fn collapsed(corners: &[[f64; D]]) -> Result<Self, SupportError> {
        let shape = Collapsed::from_corners::<D>(corners.len()).ok_or(SupportError::Distorted)?;
        let (whole, volume) = Self::integrals(&shape.hexahedron(corners))?;
        let is_inverted = |corner: usize| {
            let [a, b, c] = shape.edges_at(corner);
            edges(&[corner, a, b, c].map(|k| corners[k])).determinant() <= 0.0
        };
        let regular = if shape == Collapsed::Pyramid { 0..4 } else { 0..6 };
        if volume.is_nan() || volume <= 0.0 || regular.filter(|&k| is_inverted(k)).count() > 1 {
            return Err(SupportError::Distorted);
        }
        let mut weights = CornerWeights { value: [0.0; MAX_CORNERS], gradient: [[0.0; D]; MAX_CORNERS] };
        for (k, &corner) in shape.corners_of_hexahedron().iter().enumerate() {
            weights.value[corner] += whole.value[k] / volume;
            (0..D).for_each(|i| weights.gradient[corner][i] += whole.gradient[k][i] / volume);
        }
        Ok(weights)
    }

    /// Weights of a triangle or tetrahedron. With the edges from the first corner as the columns of J, the rows of J⁻¹
    /// are the gradients of the shape functions of the other corners; the gradients of all shape functions sum to zero.
    fn simplex(corners: &[[f64; D]]) -> Result<Self, SupportError> {
        let mut weights = CornerWeights { value: [0.0; MAX_CORNERS], gradient: [[0.0; D]; MAX_CORNERS] };
        let jacobian = edges(corners);
        let inverse = jacobian.try_inverse().ok_or(SupportError::Distorted)?;
        let determinant = jacobian.determinant();
        if determinant.is_nan() || determinant <= 0.0 {
            return Err(SupportError::Distorted);
        }
        for corner in 0..=D {
            weights.value[corner] = 1.0 / (D + 1) as f64;
        }
        for corner in 1..=D {
            for i in 0..D {
                weights.gradient[corner][i] = inverse[(corner - 1, i)];
                weights.gradient[0][i] -= inverse[(corner - 1, i)];
            }
        }
        Ok(weights)
    }

    /// Weights of a quadrilateral. Its det J = d₀ + d·ξ is linear, so V = 4 d₀ and w_c = (1 + ξ_c·d / 3 d₀) / 4. By the
    /// divergence theorem, g_c is the vector normal to the line between the two neighbours of the corner and equal to
    /// it in length, divided by 2V.
    fn quadrilateral(corners: &[[f64; D]]) -> Result<Self, SupportError> {
        let at_corner = quadrilateral(corners)?;
        let mean = 0.25 * at_corner.iter().sum::<f64>();
        let volume = 4.0 * mean;
        let side: [[f64; 2]; 4] = std::array::from_fn(corner_side);
        let slope: [f64; 2] = std::array::from_fn(|d| {
            (0..4).map(|c| 0.25 * side[c][d] * at_corner[c]).sum::<f64>() / (3.0 * mean)
        });
        let mut weights = CornerWeights { value: [0.0; MAX_CORNERS], gradient: [[0.0; D]; MAX_CORNERS] };
        let half = 0.5 / volume;
        for (c, before, after) in [(0, 2, 1), (1, 0, 3), (3, 1, 2), (2, 3, 0)] {
            weights.value[c] = 0.25 * (1.0 + side[c][0] * slope[0] + side[c][1] * slope[1]);
            weights.gradient[c][0] = half * (corners[after][1] - corners[before][1]);
            weights.gradient[c][1] = half * (corners[before][0] - corners[after][0]);
        }
        Ok(weights)
    }

    /// Weights of a hexahedron. Bit d of a corner's number gives its side along parametric axis d.
    fn hexahedron(corners: &[[f64; D]]) -> Result<Self, SupportError> {
        let (mut weights, volume) = Self::integrals(corners)?;
        if volume.is_nan() || volume <= 0.0 || !is_meaningful(corners) {
            return Err(SupportError::Distorted);
        }
        for corner in 0..corners.len() {
            weights.value[corner] /= volume;
            weights.gradient[corner] = weights.gradient[corner].map(|g| g / volume);
        }
        Ok(weights)
    }

    /// The integrals of N_c and ∇N_c over a hexahedron, and its volume.
    fn integrals(corners: &[[f64; D]]) -> Result<(Self, f64), SupportError> {
        let mut weights = CornerWeights { value: [0.0; MAX_CORNERS], gradient: [[0.0; D]; MAX_CORNERS] };
        let n = corners.len();
        let mut volume = 0.0;
        for xi in gauss_points::<D>() {
            let jacobian = jacobian(corners, &xi);
            let determinant = jacobian.determinant();
            let Some(inverse) = jacobian.try_inverse() else { return Err(SupportError::Distorted) };
            volume += determinant;
            for corner in 0..n {
                let (value, slope) = box_shape(corner, &xi);
                weights.value[corner] += value * determinant;
                for i in 0..D {
                    let gradient: f64 = (0..D).map(|j| slope[j] * inverse[(j, i)]).sum();
                    weights.gradient[corner][i] += gradient * determinant;
                }
            }
        }
        Ok((weights, volume))
    }
}

/// det J at the corners of a valid quadrilateral, which has a positive area and at most one reflex corner. With two
/// reflex corners, it would be inverted or would cross itself.
#[inline]
fn quadrilateral<const D: usize>(corners: &[[f64; D]]) -> Result<[f64; 4], SupportError> {
    let at_corner: [f64; 4] = std::array::from_fn(|c| corner_determinant(corners, c));
    let volume: f64 = at_corner.iter().sum();
    let reflex = at_corner.iter().filter(|determinant| **determinant <= 0.0).count();
    if volume.is_nan() || volume <= 0.0 || reflex > 1 { Err(SupportError::Distorted) } else { Ok(at_corner) }
}

/// True if a hexahedron of positive volume is valid: at most one reflex corner, or two on one edge (an extruded
/// arrowhead). With more, or with a reversed reflex edge, it would be inverted or would cross itself.
fn is_meaningful<const D: usize>(corners: &[[f64; D]]) -> bool {
    let is_reflex = |c: &usize| corner_determinant(corners, *c) <= 0.0;
    let mut reflex = (0..corners.len()).filter(is_reflex);
    let (Some(a), Some(b)) = (reflex.next(), reflex.next()) else { return true };
    let along = a ^ b;
    if reflex.next().is_some() || !along.is_power_of_two() {
        return false;
    }
    // The edge that starts at a corner and runs along the axis of the reflex edge, whose lower end is `a`.
    let edge =
        |from: usize| -> [f64; D] { std::array::from_fn(|d| corners[from | along][d] - corners[from][d]) };
    let others = (0..corners.len()).filter(|c| c & along == 0 && *c != a).map(edge);
    let towards: f64 = others.map(|other| (0..D).map(|d| other[d] * edge(a)[d]).sum::<f64>()).sum();
    towards > 0.0
}

/// det ∂x/∂ξ of a quadrilateral or hexahedron at a corner. The columns are half the edges at that corner.
#[inline(always)]
fn corner_determinant<const D: usize>(corners: &[[f64; D]], corner: usize) -> f64 {
    let edge = |axis: usize| -> [f64; D] {
        let (high, low) = (&corners[corner | 1 << axis], &corners[corner & !(1 << axis)]);
        std::array::from_fn(|i| 0.5 * (high[i] - low[i]))
    };
    let minor = |a: &[f64; D], b: &[f64; D], i: usize, j: usize| a[i] * b[j] - a[j] * b[i];
    if D == 2 {
        return minor(&edge(0), &edge(1), 0, 1);
    }
    let (a, b, c) = (edge(0), edge(1), edge(2));
    a[0] * minor(&b, &c, 1, 2) - a[1] * minor(&b, &c, 0, 2) + a[2] * minor(&b, &c, 0, 1)
}

/// Edges of a simplex from its first corner, as columns; rows and columns beyond `D` are those of the unit matrix.
fn edges<const D: usize>(corners: &[[f64; D]]) -> Mat3 {
    let mut edges = Mat3::identity();
    for j in 0..D {
        for i in 0..D {
            edges[(i, j)] = corners[j + 1][i] - corners[0][i];
        }
    }
    edges
}

/// ∂x/∂ξ of a quadrilateral or hexahedron; rows and columns beyond `D` are those of the unit matrix.
fn jacobian<const D: usize>(corners: &[[f64; D]], xi: &[f64; D]) -> Mat3 {
    let mut jacobian = Mat3::identity();
    for d in 0..D {
        jacobian[(d, d)] = 0.0;
    }
    for (corner, x) in corners.iter().enumerate() {
        let (_, slope) = box_shape(corner, xi);
        for i in 0..D {
            for j in 0..D {
                jacobian[(i, j)] += x[i] * slope[j];
            }
        }
    }
    jacobian
}

/// Volume (area) of a domain given by its corners, [volume]; zero if the number of corners is invalid.
pub fn domain_volume<const D: usize>(corners: &[[f64; D]]) -> f64 {
    match ElementShape::from_nodes::<D>(corners.len()) {
        Some(ElementShape::Simplex) => edges(corners).determinant() / (1..=D).product::<usize>() as f64,
        Some(ElementShape::Box) if D == 2 => (0..4).map(|corner| corner_determinant(corners, corner)).sum(),
        Some(ElementShape::Box) => gauss_points::<D>().map(|xi| jacobian(corners, &xi).determinant()).sum(),
        None => Collapsed::from_corners::<D>(corners.len()).map_or(0.0, |shape| shape.volume(corners)),
    }
}

#[cfg(test)]
mod tests;
