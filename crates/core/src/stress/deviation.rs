//! Points that take the mean increment of their cell, and the stress that resists their deviations from it.
//!
//! **Mean.** All points of a cell take ΔF̄ = Σ v_q ΔF_q / Σ v_q with their volumes v_q at the start of the step. It is
//! linear in the displacements, with the mean gradients Σ v_q ∂S/∂X̃ / Σ v_q, so the points of a cell contribute as one
//! point: with ḡ, these gradients in the configuration of ΔF̄, the force on a node is (Σ V⁰ τ)·ḡ and the stiffness
//! between two nodes ḡ·(Σ V a)·ḡ. For a body of revolution the mean gradient of S/r has S/r̃ as its value at a point.
//!
//! **Deviation.** The mean does not see δ = ΔF − ΔF̄. A stress q resists its symmetric part e = sym(ΔF̄ᵀδ), which a
//! superposed rotation does not change: Σ = θ (q + 2βG dev e) refers to the start of the step and has the potential
//! v θ (q:e + βG |dev e|²) per point. With the gradients ḡ and γ = g − ḡ of node a, both at the start of the step, the
//! variation of e is e_ai = sym(ḡ_a ⊗ δ_i + γ_a ⊗ ΔF̄_i), where δ_i and ΔF̄_i are rows; the force is v Σ:e_ai and the
//! stiffness v (2βGθ dev e_ai : dev e_bk + Σ:(ḡ_a ⊗ γ_b + γ_a ⊗ ḡ_b) δ_ik), which is symmetric. θ, the share of q that
//! the flow of the soil leaves, is known at the start of the step. At its end, q is ΔF̄ Σ ΔF̄ᵀ/det ΔF̄.
#![allow(non_snake_case)]

use super::current::along;
use super::products::full;
use super::{Current, Lane, Lanes, WeakForm, transposed};
use crate::kinematics::Increment;
use crate::tensor::{Mat3, Sym3};

/// Resistance of a point to deviations from the mean increment of its cell, in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resistance {
    /// Cauchy stress q at the start of the step, [stress].
    pub stress: Sym3,
    /// 2βG, [stress].
    pub modulus: f64,
    /// Share θ of the stress that the flow of the soil leaves, [-].
    pub left: f64,
}

/// The deviation of a point from the mean increment of its cell, and the stress that resists it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviated {
    /// ΔF̄, [-].
    pub mean: Mat3,
    /// Σ, which refers to the start of the step, [stress].
    pub stress: Sym3,
    /// Work of the stress in the step per volume at its start, [energy/volume].
    pub work: f64,
}

impl Deviated {
    /// The deviation of a point that has not moved, without stress.
    pub const NONE: Deviated = Deviated {
        mean: Mat3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        stress: Sym3::ZERO,
        work: 0.0,
    };

    /// The deviation of ΔF from ΔF̄.
    pub fn new(mean: &Mat3, own: &Mat3, resistance: &Resistance) -> Self {
        let Resistance { stress, modulus, left } = *resistance;
        let e = Sym3::symmetric_part(&(mean.transpose() * (own - mean)));
        let added = e.deviator() * modulus;
        let work = left * (stress.dot(&e) + 0.5 * added.dot(&e));
        Deviated { mean: *mean, stress: (stress + added) * left, work }
    }

    /// Cauchy stress q at the end of the step, [stress].
    pub fn stress_at_end(&self) -> Sym3 {
        let Deviated { mean, stress, .. } = self;
        Sym3::symmetric_part(&(mean * stress.to_matrix() * mean.transpose())) * (1.0 / mean.determinant())
    }
}

/// Weak forms that refer to the same configuration and add up to one.
pub trait Summable {
    /// Adds another weak form.
    fn add(&mut self, other: &Self);
}

impl<const D: usize, const E: usize> Summable for Current<D, E> {
    #[inline(always)]
    fn add(&mut self, other: &Self) {
        for (sum, x) in self.stress.as_flattened_mut().iter_mut().zip(other.stress.as_flattened()) {
            *sum += x;
        }
        let sums = self.tangent.as_flattened_mut().as_flattened_mut().as_flattened_mut();
        for (sum, x) in sums.iter_mut().zip(other.tangent.as_flattened().as_flattened().as_flattened()) {
            *sum += x;
        }
    }
}

/// The derivatives of a basis function at the start of a step: at a point, or their mean over the points of a cell.
#[derive(Debug, Clone, Copy)]
pub struct Slopes<'a, const D: usize> {
    /// ∂S/∂X̃, [1/length].
    pub gradient: &'a [f64; D],
    /// S/r̃, [1/length].
    pub per_radius: f64,
}

/// The weak form of the stress that resists the deviation of a point.
pub trait Deviating<const D: usize>: WeakForm<D> {
    /// The weak form of a point whose volume is `volume` at the start of the step.
    fn new(
        mean: &Increment<D>,
        own: &Increment<D>,
        deviated: &Deviated,
        resistance: &Resistance,
        volume: f64,
    ) -> Self;

    /// Data of a basis function from its derivatives at the point, `own`, and their mean.
    fn gradients(own: Slopes<D>, mean: Slopes<D>) -> Self::Gradient<f64>;
}

/// Second-order tensor, one index of which contracts with gradients, `[j][i]`.
type Rows<const D: usize, const E: usize> = [[f64; D]; E];

/// [`Deviating`] for `E` components of the gradient; see [`Current`].
#[derive(Debug, Clone, Copy)]
pub struct Deviation<const D: usize, const E: usize> {
    /// ΔF̄ and δ, the partners of γ and ḡ.
    partners: [Rows<D, E>; 2],
    /// v Σ.
    stress: [[f64; E]; E],
    /// 2βGθ v.
    modulus: f64,
}

impl<const D: usize, const E: usize> Deviation<D, E> {
    /// 2βGθ v dev e_bk, without the components that do no work.
    #[inline(always)]
    fn stress_of_motion(&self, k: usize, gradients: &[[f64; E]; 2]) -> [[f64; E]; E] {
        let mut product = [[0.0; E]; E];
        for (partner, gradient) in self.partners.iter().zip(gradients) {
            for j in 0..E {
                for l in 0..E {
                    product[j][l] += gradient[j] * partner[l][k];
                }
            }
        }
        let mut trace = 0.0;
        for j in 0..E {
            trace += product[j][j];
        }
        let mut stress = [[0.0; E]; E];
        for j in 0..E {
            for l in 0..E {
                // The hoop stretch has no shear.
                if (j < D) == (l < D) {
                    let spherical = if j == l { trace / 3.0 } else { 0.0 };
                    stress[j][l] = self.modulus * (0.5 * (product[j][l] + product[l][j]) - spherical);
                }
            }
        }
        stress
    }
}

impl<const D: usize, const E: usize> Deviating<D> for Deviation<D, E> {
    #[inline(always)]
    fn new(
        mean: &Increment<D>,
        own: &Increment<D>,
        deviated: &Deviated,
        resistance: &Resistance,
        volume: f64,
    ) -> Self {
        let mut partners = [[[0.0; D]; E]; 2];
        for j in 0..E {
            for i in 0..D {
                let [mean, own] = match (j < D, i == 0) {
                    (true, _) => [mean.dF[i][j], own.dF[i][j]],
                    (false, true) => [mean.hoop, own.hoop],
                    (false, false) => [0.0; 2],
                };
                (partners[0][j][i], partners[1][j][i]) = (mean, own - mean);
            }
        }
        let all = full(&deviated.stress, volume);
        let mut stress = [[0.0; E]; E];
        for j in 0..E {
            for l in 0..E {
                if (j < D) == (l < D) {
                    stress[j][l] = all[j][l];
                }
            }
        }
        Deviation { partners, stress, modulus: resistance.modulus * resistance.left * volume }
    }

    #[inline(always)]
    fn gradients(own: Slopes<D>, mean: Slopes<D>) -> [[f64; E]; 2] {
        let mut gradients = [[0.0; E]; 2];
        for j in 0..E {
            let along = |slopes: Slopes<D>| if j < D { slopes.gradient[j] } else { slopes.per_radius };
            let [own, mean] = [along(own), along(mean)];
            (gradients[0][j], gradients[1][j]) = (own - mean, mean);
        }
        gradients
    }
}

impl<const D: usize, const E: usize> WeakForm<D> for Deviation<D, E> {
    /// γ and ḡ.
    type Gradient<T: Lane> = [[T; E]; 2];
    /// Their partners in the product with the stress of one motion, `[j][i][k]` for each.
    type Column = [[[[f64; D]; D]; E]; 2];

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; D]; D]> {
        None
    }

    /// The data of a node without part in the mean.
    #[inline(always)]
    fn gradient(&self, gradient: &[f64; D], value: f64) -> [[f64; E]; 2] {
        let none = Slopes { gradient: &[0.0; D], per_radius: 0.0 };
        Self::gradients(Slopes { gradient, per_radius: value }, none)
    }

    #[inline(always)]
    fn pack(nodes: &[[[f64; E]; 2]]) -> [[Lanes; E]; 2] {
        let mut parts = [[[0.0; E]; Lanes::WIDTH]; 2];
        for (n, node) in nodes.iter().enumerate() {
            (parts[0][n], parts[1][n]) = (node[0], node[1]);
        }
        [transposed(&parts[0][..nodes.len()]), transposed(&parts[1][..nodes.len()])]
    }

    #[inline(always)]
    fn column(&self, gradients: &[[f64; E]; 2], force: &mut [f64; D]) -> Self::Column {
        // v Σ·γ and v Σ·ḡ.
        let mut traction = [[0.0; E]; 2];
        for part in 0..2 {
            for j in 0..E {
                for l in 0..E {
                    traction[part][j] += self.stress[j][l] * gradients[part][l];
                }
            }
            for j in 0..E {
                for i in 0..D {
                    force[i] += traction[part][j] * self.partners[part][j][i];
                }
            }
        }
        let mut column = [[[[0.0; D]; D]; E]; 2];
        for k in 0..D {
            let stress = self.stress_of_motion(k, gradients);
            for part in 0..2 {
                for j in 0..E {
                    for l in 0..E {
                        for i in 0..D {
                            column[part][j][i][k] += stress[j][l] * self.partners[part][l][i];
                        }
                    }
                    if j < D || along::<D>(j) == k {
                        column[part][j][k][k] += traction[1 - part][j];
                    }
                }
            }
        }
        column
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &Self::Column, gradients: &[[T; E]; 2], block: &mut [[T; D]; D]) {
        for (column, gradient) in column.iter().zip(gradients) {
            Current::<D, E>::add_block(column, gradient, block);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tensor::Mat3;

    const MODULUS: f64 = 3e5;

    fn resistance(left: f64) -> Resistance {
        Resistance { stress: Sym3([2e4, -3e4, 1e4, 5e3, -8e3, 1.5e4]), modulus: MODULUS, left }
    }

    fn increments() -> [Mat3; 2] {
        let mean = Mat3::new(1.02, 0.05, -0.01, 0.02, 0.97, 0.03, 0.01, -0.04, 1.01);
        [mean, mean + Mat3::new(0.01, -0.02, 0.005, 0.015, 0.01, -0.01, 0.0, 0.02, -0.005)]
    }

    fn stored(stress: &Sym3) -> f64 {
        0.5 * stress.dot(stress) / MODULUS
    }

    #[test]
    fn a_superposed_rotation_turns_only_the_stress_at_the_end() {
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, -1.1, 2.0).into_inner();
        let [mean, own] = increments();
        let still = Deviated::new(&mean, &own, &resistance(0.8));
        let turned = Deviated::new(&(turn * mean), &(turn * own), &resistance(0.8));
        assert!((turned.stress - still.stress).norm() < 1e-12 * still.stress.norm());
        assert!((turned.work - still.work).abs() < 1e-12 * still.work.abs());
        let expected = turn * still.stress_at_end().to_matrix() * turn.transpose();
        assert!((turned.stress_at_end().to_matrix() - expected).norm() < 1e-12 * expected.norm());
    }

    /// The dissipation is that of `docs/theory.md`.
    #[test]
    fn work_is_stored_without_flow_and_dissipated_with_it() {
        let [mean, own] = increments();
        let e = Sym3::symmetric_part(&(mean.transpose() * (own - mean)));
        let start = Resistance { stress: resistance(1.0).stress.deviator(), ..resistance(1.0) };
        for left in [1.0, 0.7, 0.0] {
            let Deviated { stress, work, .. } = Deviated::new(&mean, &own, &Resistance { left, ..start });
            let dissipated = work - (stored(&stress) - stored(&start.stress));
            let (q, x) = (start.stress, e.deviator() * MODULUS);
            let squares = (1.0 + left) * q.dot(&q) + 2.0 * left * q.dot(&x) + left * x.dot(&x);
            let expected = 0.5 * (1.0 - left) * squares / MODULUS;
            assert!((dissipated - expected).abs() < 1e-12 * stored(&q), "{left}: {dissipated} {expected}");
            assert!(dissipated >= -1e-12 * stored(&q));
        }
    }
}
