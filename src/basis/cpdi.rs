//! Convected particle domain interpolation on quadrilaterals (hexahedra), CPDI1 and CPDI2 (Sadeghirad et al., 2011
//! and 2013), derived from its definition; the formulas first printed for CPDI2 were wrong (footnote 6).
//!
//! The grid basis inside the domain of a point is replaced by the interpolation of its values at the corners of the
//! domain, N_v(x) ≈ Σ_c N_c(x) N_v(x_c), so that
//!
//! S_v = Σ_c w_c N_v(x_c) with w_c = (1/V) ∫ N_c dV and ∇S_v = Σ_c g_c N_v(x_c) with g_c = (1/V) ∫ ∇N_c dV.
//!
//! The integrands are polynomials of degree three at most along each parametric axis; two Gauss points per axis are
//! exact.

use super::{Basis, PointGeometry, Support, SupportError};
use crate::grid::Grid;
use crate::tensor::Mat3;

/// Points whose domain is given by its corners. CPDI1 and CPDI2 share this basis; they differ in how the corners
/// follow the deformation.
#[derive(Debug, Clone, Copy)]
pub struct Cpdi;

/// Most corners of a domain.
const MAX_CORNERS: usize = 8;

impl<const D: usize> Basis<D> for Cpdi {
    fn support(
        &self,
        grid: &dyn Grid<D>,
        point: &PointGeometry<D>,
        out: &mut Support<D>,
    ) -> Result<(), SupportError> {
        let weights = CornerWeights::new(point.corners)?;
        out.clear();
        for (corner, place) in point.corners.iter().enumerate() {
            let cell = grid
                .locate(place, Some(point.cell))
                .ok_or(SupportError::CornerOffGrid { corner, position: crate::tensor::padded(place) })?;
            out.cells.push(cell);
            let basis = grid.basis_at(cell, place);
            for (&node, &value) in basis.nodes().iter().zip(basis.value()) {
                if value != 0.0 {
                    let (w, g) = (weights.value[corner], &weights.gradient[corner]);
                    out.add(node, w * value, g.map(|g| g * value));
                }
            }
        }
        Ok(())
    }
}

/// Whether a domain given by its corners lies in the grid and is neither inverted nor a bow-tie; `cell` is where to
/// look first.
///
/// # Errors
/// What [`Cpdi`] could not form basis functions from.
pub fn check_domain<const D: usize>(
    grid: &dyn Grid<D>,
    corners: &[[f64; D]],
    cell: u32,
) -> Result<(), SupportError> {
    for (corner, place) in corners.iter().enumerate() {
        grid.locate(place, Some(cell))
            .ok_or(SupportError::CornerOffGrid { corner, position: crate::tensor::padded(place) })?;
    }
    CornerWeights::new(corners).map(|_| ())
}

/// w_c and g_c of a domain.
struct CornerWeights<const D: usize> {
    value: [f64; MAX_CORNERS],
    gradient: [[f64; D]; MAX_CORNERS],
}

impl<const D: usize> CornerWeights<D> {
    /// Corners are numbered by bits: bit d says on which side along parametric axis d.
    fn new(corners: &[[f64; D]]) -> Result<Self, SupportError> {
        let mut weights = CornerWeights { value: [0.0; MAX_CORNERS], gradient: [[0.0; D]; MAX_CORNERS] };
        let n = 1usize << D;
        if corners.len() != n || n > MAX_CORNERS {
            return Err(SupportError::Distorted);
        }
        let mut volume = 0.0;
        for gauss in 0..n {
            let xi = parametric(gauss).map(|side: f64| side / 3f64.sqrt());
            let jacobian = jacobian(corners, &xi);
            let determinant = jacobian.determinant();
            let Some(inverse) = jacobian.try_inverse() else { return Err(SupportError::Distorted) };
            volume += determinant;
            for corner in 0..n {
                let (value, slope) = corner_basis(corner, &xi);
                weights.value[corner] += value * determinant;
                for i in 0..D {
                    let gradient: f64 = (0..D).map(|j| slope[j] * inverse[(j, i)]).sum();
                    weights.gradient[corner][i] += gradient * determinant;
                }
            }
        }
        // One reflex corner leaves a meaningful domain; two make a bow-tie, and all an inverted one.
        let reflex = (0..n).filter(|&c| jacobian(corners, &parametric(c)).determinant() <= 0.0).count();
        if volume.is_nan() || volume <= 0.0 || reflex > 1 {
            return Err(SupportError::Distorted);
        }
        for corner in 0..n {
            weights.value[corner] /= volume;
            weights.gradient[corner] = weights.gradient[corner].map(|g| g / volume);
        }
        Ok(weights)
    }
}

/// Parametric position of a corner, ±1 along each axis.
fn parametric<const D: usize>(corner: usize) -> [f64; D] {
    std::array::from_fn(|d| if corner >> d & 1 == 1 { 1.0 } else { -1.0 })
}

/// N_c and ∂N_c/∂ξ of the multilinear interpolation of the corners.
fn corner_basis<const D: usize>(corner: usize, xi: &[f64; D]) -> (f64, [f64; D]) {
    let side = parametric::<D>(corner);
    let factor = |d: usize| 0.5 * (1.0 + side[d] * xi[d]);
    let value = (0..D).map(factor).product();
    let slope =
        std::array::from_fn(|d| (0..D).map(|e| if e == d { 0.5 * side[d] } else { factor(e) }).product());
    (value, slope)
}

/// ∂x/∂ξ, with ones on the diagonal beyond `D`.
fn jacobian<const D: usize>(corners: &[[f64; D]], xi: &[f64; D]) -> Mat3 {
    let mut jacobian = Mat3::identity();
    for d in 0..D {
        jacobian[(d, d)] = 0.0;
    }
    for (corner, x) in corners.iter().enumerate() {
        let (_, slope) = corner_basis(corner, xi);
        for i in 0..D {
            for j in 0..D {
                jacobian[(i, j)] += x[i] * slope[j];
            }
        }
    }
    jacobian
}

/// Volume (area) of a domain given by its corners.
pub fn domain_volume<const D: usize>(corners: &[[f64; D]]) -> f64 {
    (0..1usize << D)
        .map(|gauss| jacobian(corners, &parametric(gauss).map(|side: f64| side / 3f64.sqrt())).determinant())
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Corners of a distorted unit quadrilateral.
    fn quadrilateral() -> impl Strategy<Value = [[f64; 2]; 4]> {
        prop::array::uniform4(prop::array::uniform2(-0.3..0.3f64)).prop_map(|shift| {
            std::array::from_fn(|c| {
                let base: [f64; 2] = parametric(c);
                std::array::from_fn(|d| 0.5 * base[d] + shift[c][d] * 0.9)
            })
        })
    }

    /// Eight Gauss points on [−1, 1].
    const GAUSS: [(f64, f64); 8] = [
        (-0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
        (-0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
        (-0.525_532_409_916_329, 0.313_706_645_877_887_27),
        (-0.183_434_642_495_649_8, 0.362_683_783_378_361_96),
        (0.183_434_642_495_649_8, 0.362_683_783_378_361_96),
        (0.525_532_409_916_329, 0.313_706_645_877_887_27),
        (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
        (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
    ];

    proptest! {
        #[test]
        fn weights_are_the_integrals_over_the_quadrilateral(corners in quadrilateral()) {
            let weights = CornerWeights::new(&corners).unwrap();
            let (mut volume, mut value, mut gradient) = (0.0, [0.0; 4], [[0.0; 2]; 4]);
            for (xi, a) in GAUSS {
                for (eta, b) in GAUSS {
                    let j = jacobian(&corners, &[xi, eta]);
                    let inverse = j.try_inverse().unwrap();
                    let dv = a * b * j.determinant();
                    volume += dv;
                    for c in 0..4 {
                        let (n, slope) = corner_basis(c, &[xi, eta]);
                        value[c] += n * dv;
                        for i in 0..2 {
                            gradient[c][i] += (slope[0] * inverse[(0, i)] + slope[1] * inverse[(1, i)]) * dv;
                        }
                    }
                }
            }
            prop_assert!((domain_volume(&corners) - volume).abs() < 1e-13);
            for c in 0..4 {
                prop_assert!((weights.value[c] - value[c] / volume).abs() < 1e-13);
                for i in 0..2 {
                    prop_assert!((weights.gradient[c][i] - gradient[c][i] / volume).abs() < 1e-11);
                }
            }
            // Closed forms: by the divergence theorem the gradients are those of the boundary polygon.
            let ring = [0, 1, 3, 2];
            for k in 0..4 {
                let (before, after) = (corners[ring[(k + 3) % 4]], corners[ring[(k + 1) % 4]]);
                let g = weights.gradient[ring[k]];
                prop_assert!((g[0] - (after[1] - before[1]) / (2.0 * volume)).abs() < 1e-12);
                prop_assert!((g[1] + (after[0] - before[0]) / (2.0 * volume)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn inverted_and_bow_tie_domains_are_refused() {
        let square: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        assert!(CornerWeights::new(&square).is_ok());
        let inverted = [square[1], square[0], square[3], square[2]];
        assert!(CornerWeights::new(&inverted).is_err());
        let bow_tie = [square[0], square[1], square[3], square[2]];
        assert!(CornerWeights::new(&bow_tie).is_err());
        assert!(CornerWeights::new(&[[f64::NAN; 2]; 4]).is_err());
        assert!(CornerWeights::new(&[[1.0; 2]; 4]).is_err());
        let arrow = [square[0], square[1], square[2], [0.3, 0.3]];
        assert!(CornerWeights::new(&arrow).is_ok());
    }

    #[test]
    fn a_hexahedron_is_integrated_likewise() {
        let mut corners: Vec<[f64; 3]> = (0..8).map(parametric).collect();
        corners[7] = [1.4, 1.2, 0.9];
        corners[1] = [1.1, -0.8, -1.2];
        let weights = CornerWeights::new(&corners).unwrap();
        assert!((weights.value.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        for i in 0..3 {
            for j in 0..3 {
                let sum: f64 = (0..8).map(|c| weights.gradient[c][i] * corners[c][j]).sum();
                assert!((sum - f64::from(u8::from(i == j))).abs() < 1e-14);
            }
        }
    }
}
