//! The weak form of a point in the updated Lagrangian formulation: in the current configuration, with all moduli.
#![allow(non_snake_case)]

use super::{Lane, Lanes, WeakForm, transposed};

/// Stress and moduli of a point in the current configuration, with indices in the order in which they are contracted.
/// `T` is a number for one point, or a vector with one SIMD lane per point.
///
/// The gradient of a basis function has `E` components: those along the `D` axes and, for a body of revolution, S/r,
/// which is conjugate to the first component of the displacement. Volumetric quantities are sums over these components,
/// so `E` is also the n in the exponent 1/n of the volumetric split: 2 in plane strain, 3 otherwise.
#[derive(Debug, Clone, Copy)]
pub struct Current<const D: usize, const E: usize, T = f64> {
    /// V σ of eq. (2), which is V⁰τ with the reference volume V⁰ = V_n/J_n, `[j][i]`, [stress·volume].
    pub stress: [[T; D]; E],
    /// V a of eqs. (3) and (A.1), which is V⁰ (∂τ/∂H − τ_il δ_jk) with the displacement gradient H in the current
    /// configuration, `[l][j][i][k]`, [stress·volume].
    pub tangent: [[[[T; D]; D]; E]; E],
    /// ΔF⁻¹.
    pub inverse: [[T; D]; D],
    /// 1/r, [1/length]; used only if `E` exceeds `D`.
    pub per_radius: T,
}

/// Component of the displacement that component `j` of the gradient multiplies in the divergence.
pub(super) const fn along<const D: usize>(j: usize) -> usize {
    if j < D { j } else { 0 }
}

impl<const D: usize, const E: usize> Current<D, E> {
    /// Builds the moduli from their components.
    #[inline(always)]
    pub(super) fn with_tangent(
        stress: [[f64; D]; E],
        inverse: [[f64; D]; D],
        per_radius: f64,
        entry: impl Fn(usize, usize, usize, usize) -> f64,
    ) -> Self {
        let mut tangent = [[[[0.0; D]; D]; E]; E];
        for l in 0..E {
            for j in 0..E {
                for i in 0..D {
                    for k in 0..D {
                        tangent[l][j][i][k] = entry(i, j, k, l);
                    }
                }
            }
        }
        Current { stress, tangent, inverse, per_radius }
    }

    /// This response, for a deformation increment divided by `factor` in the directions of the volumetric split.
    #[inline(always)]
    pub(super) fn shrunk(mut self, factor: f64) -> Self {
        self.inverse.as_flattened_mut().iter_mut().for_each(|x| *x *= factor);
        self.per_radius *= factor;
        self
    }
}

impl Current<2, 2, Lanes> {
    /// Extracts one point.
    #[inline(always)]
    pub(super) fn point(&self, lane: usize) -> Current<2, 2> {
        let mut point = Current {
            stress: [[0.0; 2]; 2],
            tangent: [[[[0.0; 2]; 2]; 2]; 2],
            inverse: [[0.0; 2]; 2],
            per_radius: 0.0,
        };
        for (x, lanes) in point.stress.as_flattened_mut().iter_mut().zip(self.stress.as_flattened()) {
            *x = lanes.0[lane];
        }
        for (x, lanes) in point.inverse.as_flattened_mut().iter_mut().zip(self.inverse.as_flattened()) {
            *x = lanes.0[lane];
        }
        let tangent = point.tangent.as_flattened_mut().as_flattened_mut().as_flattened_mut();
        let all = self.tangent.as_flattened().as_flattened().as_flattened();
        for (x, lanes) in tangent.iter_mut().zip(all) {
            *x = lanes.0[lane];
        }
        point
    }
}

impl<const D: usize, const E: usize> WeakForm<D> for Current<D, E> {
    type Gradient<T: Lane> = [T; E];
    /// The contraction of the moduli with one gradient, `[j][i][k]`.
    type Column = [[[f64; D]; D]; E];

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; D]; D]> {
        Some(&self.inverse)
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; D], value: f64) -> [f64; E] {
        std::array::from_fn(|j| if j < D { gradient[j] } else { value * self.per_radius })
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; E]]) -> [Lanes; E] {
        transposed(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; E], force: &mut [f64; D]) -> [[[f64; D]; D]; E] {
        for j in 0..E {
            for i in 0..D {
                force[i] += self.stress[j][i] * gradient[j];
            }
        }
        let mut column = [[[0.0; D]; D]; E];
        for l in 0..E {
            let (sums, entries) = (column.as_flattened_mut().as_flattened_mut(), &self.tangent[l]);
            for (sum, entry) in sums.iter_mut().zip(entries.as_flattened().as_flattened()) {
                *sum += entry * gradient[l];
            }
        }
        column
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &[[[f64; D]; D]; E], gradient: &[T; E], block: &mut [[T; D]; D]) {
        for j in 0..E {
            for (entry, share) in block.as_flattened_mut().iter_mut().zip(column[j].as_flattened()) {
                *entry += gradient[j] * *share;
            }
        }
    }
}
