//! The weak form of a point as a stress and a full tangent.

use super::{Lane, Lanes, WeakForm, transposed};

/// Stress and tangent of a point for `E` components of the gradient of a basis function: those along the `D` axes and,
/// for a body of revolution, S/r, which multiplies the first component of the displacement.
///
/// With `inverse`, `stress` is σ, `tangent` is a, `volume` is V, and gradients refer to the current configuration, as
/// in the updated Lagrangian formulation; all kernels of the program provide this form. Without `inverse`, `stress`,
/// `tangent` and `volume` are P̃, Ã and V_n of the previously converged formulation.
#[derive(Debug, Clone, Copy)]
pub struct Contribution<const D: usize, const E: usize> {
    /// Stress conjugate to the gradient of the basis, `[i][j]`, for the axis i of the force and the component j of the
    /// gradient, [stress].
    pub stress: [[f64; E]; D],
    /// Derivative of the stress, `[i][j][k][l]`, [stress].
    pub tangent: [[[[f64; E]; D]; E]; D],
    /// Volume of the point in this configuration, [volume].
    pub volume: f64,
    /// ΔF⁻¹ if this is the current configuration.
    pub inverse: Option<[[f64; D]; D]>,
    /// 1/r in this configuration, [1/length]; used only if `E` exceeds `D`.
    pub per_radius: f64,
}

impl<const D: usize, const E: usize> WeakForm<D> for Contribution<D, E> {
    type Gradient<T: Lane> = [T; E];
    type Column = [[[f64; D]; E]; D];

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; D]; D]> {
        self.inverse.as_ref()
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; D], value: f64) -> [f64; E] {
        std::array::from_fn(|j| if j < D { gradient[j] } else { value * self.per_radius })
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; E]]) -> [Lanes; E] {
        transposed(nodes)
    }

    /// V g_b·Ã as `[i][j][k]`.
    #[inline(always)]
    fn column(&self, gradient: &[f64; E], force: &mut [f64; D]) -> [[[f64; D]; E]; D] {
        for (f, row) in force.iter_mut().zip(&self.stress) {
            let traction: f64 = row.iter().zip(gradient).map(|(stress, g)| stress * g).sum();
            *f += self.volume * traction;
        }
        let weighted = gradient.map(|x| x * self.volume);
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                std::array::from_fn(|k| self.tangent[i][j][k].iter().zip(&weighted).map(|(a, g)| a * g).sum())
            })
        })
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &[[[f64; D]; E]; D], gradient: &[T; E], block: &mut [[T; D]; D]) {
        for i in 0..D {
            for j in 0..E {
                for k in 0..D {
                    block[i][k] += gradient[j] * column[i][j][k];
                }
            }
        }
    }
}
