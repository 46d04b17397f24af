//! Points of solids that take the mean volume ratio of their cell, evaluated without fourth-order tensors: see
//! [`super::dilated`].
#![allow(non_snake_case)]

use super::products::{MANDEL_INDEX, times};
use super::{Averaged, Averaging, Isotropic, Lane, Lanes, Spatial, WeakForm, transposed};

/// [`Spatial`] under the pressure of its cell: its moduli are those of the deviator of τ, and its stress is
/// V⁰ dev τ + V P 1.
#[derive(Debug, Clone, Copy)]
pub struct AveragedSpatial {
    point: Spatial,
    /// Change of the stress with div δu: V P 1 − V⁰ dev(Dτ:1)/3, in the Mandel order without factors.
    with_volume: [f64; 6],
    /// V⁰ 1:Dτ:1/9.
    modulus: f64,
    /// V⁰ dev(Dτ:1)/3 and V⁰ dev(1:Dτ)/3, the latter `[k][l]`.
    row: [[f64; 3]; 3],
    column: [[f64; 3]; 3],
}

impl Averaging<3> for Spatial {
    type Averaged = AveragedSpatial;

    #[inline(always)]
    fn averaged(&self, factor: f64, pressure: f64) -> AveragedSpatial {
        let mut point = *self;
        point.inverse.as_flattened_mut().iter_mut().for_each(|x| *x *= factor);
        let pi = (point.stress[0][0] + point.stress[1][1] + point.stress[2][2]) / 3.0;
        let Spatial { b, moduli, stress, .. } = &mut point;
        // Trace and deviator of the change of τ, for each component of b.
        let mut traces = [0.0; 6];
        for (trace, change) in traces.iter_mut().zip(moduli.iter_mut()) {
            *trace = change[0] + change[1] + change[2];
            change[..3].iter_mut().for_each(|x| *x -= *trace / 3.0);
        }
        let mut with_volume = [0.0; 6];
        let (mut column, mut modulus) = ([[0.0; 3]; 3], 0.0);
        for k in 0..3 {
            for q in 0..3 {
                let component = MANDEL_INDEX[k][q];
                for (sum, change) in with_volume.iter_mut().zip(&moduli[component]) {
                    *sum -= change * (b[q][k] / 3.0);
                }
                for l in 0..3 {
                    column[k][l] += traces[component] * (b[q][l] / 3.0);
                }
            }
            modulus += column[k][k] / 3.0;
        }
        let mut row = [[0.0; 3]; 3];
        for k in 0..3 {
            column[k][k] -= modulus;
            for i in 0..3 {
                row[k][i] = -with_volume[MANDEL_INDEX[k][i]];
            }
            stress[k][k] += pressure - pi;
        }
        with_volume[..3].iter_mut().for_each(|x| *x += pressure);
        AveragedSpatial { point, with_volume, modulus, row, column }
    }
}

impl WeakForm<3> for AveragedSpatial {
    type Gradient<T: Lane> = [T; 3];
    type Column = [[[f64; 3]; 3]; 3];

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; 3]; 3]> {
        self.point.inverse()
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; 3], _value: f64) -> [f64; 3] {
        *gradient
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; 3]]) -> [Lanes; 3] {
        transposed(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; 3], force: &mut [f64; 3]) -> [[[f64; 3]; 3]; 3] {
        let mut column = self.point.column(gradient, force);
        for m in 0..3 {
            for i in 0..3 {
                let with_volume = self.with_volume[MANDEL_INDEX[i][m]];
                for k in 0..3 {
                    column[m][i][k] += with_volume * gradient[k];
                }
            }
        }
        column
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &[[[f64; 3]; 3]; 3], gradient: &[T; 3], block: &mut [[T; 3]; 3]) {
        Spatial::add_block(column, gradient, block);
    }
}

impl Averaged<3> for AveragedSpatial {
    #[inline(always)]
    fn modulus(&self) -> f64 {
        self.modulus
    }

    #[inline(always)]
    fn divergence(gradient: &[f64; 3]) -> [f64; 3] {
        *gradient
    }

    #[inline(always)]
    fn column_of_coupling(&self, gradient: &[f64; 3]) -> [f64; 3] {
        times(&self.column, gradient)
    }

    #[inline(always)]
    fn row_of_coupling(&self, gradient: &[f64; 3]) -> [f64; 3] {
        times(&self.row, gradient)
    }
}

/// [`Isotropic`] under the pressure of its cell. With s = dev τ, π = tr τ/3 and the stress s + J P 1, its stiffness
/// between two nodes is V⁰ (λ′ g_a⊗g_b + μ′ g_b⊗g_a − ⅔ (g_a⊗s g_b + s g_a⊗g_b) + (g_a·(s + (J P + μ′) 1)·g_b) 1) with
/// μ′ = μ̂ + π − J P and λ′ = J P − ⅔ (μ̂ + π).
#[derive(Debug, Clone, Copy)]
pub struct AveragedIsotropic {
    inverse: [[f64; 3]; 3],
    /// V⁰ s + V P 1.
    stress: [[f64; 3]; 3],
    /// −⅔ V⁰ s.
    deviator: [[f64; 3]; 3],
    /// V⁰ λ′.
    lambda: f64,
    /// V⁰ μ′.
    mu: f64,
    /// V⁰ 1:Dτ:1/9.
    modulus: f64,
}

impl Averaging<3> for Isotropic {
    type Averaged = AveragedIsotropic;

    #[inline(always)]
    fn averaged(&self, factor: f64, pressure: f64) -> AveragedIsotropic {
        let Isotropic { mut inverse, mut stress, lambda, mu } = *self;
        inverse.as_flattened_mut().iter_mut().for_each(|x| *x *= factor);
        let pi = (stress[0][0] + stress[1][1] + stress[2][2]) / 3.0;
        (0..3).for_each(|i| stress[i][i] -= pi);
        let deviator = stress.map(|row| row.map(|x| x * (-2.0 / 3.0)));
        (0..3).for_each(|i| stress[i][i] += pressure);
        AveragedIsotropic {
            inverse,
            stress,
            deviator,
            lambda: pressure - 2.0 / 3.0 * (mu + pi),
            mu: mu + pi - pressure,
            modulus: lambda + 2.0 / 3.0 * (mu + pi),
        }
    }
}

/// Contribution of node b to the stiffness of all pairs with this node; all vectors except the gradient are multiplied
/// by V⁰.
#[derive(Debug, Clone, Copy)]
pub struct AveragedVectors {
    /// g_b.
    gradient: [f64; 3],
    /// λ′ g_b − ⅔ s g_b.
    lambda: [f64; 3],
    /// μ′ g_b.
    mu: [f64; 3],
    /// (s + (J P + μ′) 1) g_b.
    diagonal: [f64; 3],
}

impl WeakForm<3> for AveragedIsotropic {
    /// g and −⅔ V⁰ s g.
    type Gradient<T: Lane> = [T; 6];
    type Column = AveragedVectors;

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; 3]; 3]> {
        Some(&self.inverse)
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; 3], _value: f64) -> [f64; 6] {
        let [x, y, z] = *gradient;
        let [a, b, c] = times(&self.deviator, gradient);
        [x, y, z, a, b, c]
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; 6]]) -> [Lanes; 6] {
        transposed(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; 6], force: &mut [f64; 3]) -> AveragedVectors {
        let [x, y, z, deviator @ ..] = *gradient;
        let gradient = [x, y, z];
        let traction = times(&self.stress, &gradient);
        for (f, t) in force.iter_mut().zip(traction) {
            *f += t;
        }
        let mu = gradient.map(|g| self.mu * g);
        AveragedVectors {
            gradient,
            lambda: std::array::from_fn(|i| self.lambda * gradient[i] + deviator[i]),
            mu,
            diagonal: std::array::from_fn(|i| traction[i] + mu[i]),
        }
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &AveragedVectors, row: &[T; 6], block: &mut [[T; 3]; 3]) {
        let AveragedVectors { gradient, lambda, mu, diagonal } = column;
        let on_diagonal = row[0] * diagonal[0] + row[1] * diagonal[1] + row[2] * diagonal[2];
        for i in 0..3 {
            for k in 0..3 {
                let off_diagonal = row[i] * lambda[k] + row[3 + i] * gradient[k] + row[k] * mu[i];
                block[i][k] += if i == k { off_diagonal + on_diagonal } else { off_diagonal };
            }
        }
    }
}

impl Averaged<3> for AveragedIsotropic {
    #[inline(always)]
    fn modulus(&self) -> f64 {
        self.modulus
    }

    #[inline(always)]
    fn divergence(gradient: &[f64; 6]) -> [f64; 3] {
        [gradient[0], gradient[1], gradient[2]]
    }

    /// The contribution of a node, V⁰ dev(1:Dτ)·g/3 = ⅔ V⁰ s g.
    #[inline(always)]
    fn column_of_coupling(&self, gradient: &[f64; 6]) -> [f64; 3] {
        [-gradient[3], -gradient[4], -gradient[5]]
    }

    #[inline(always)]
    fn row_of_coupling(&self, gradient: &[f64; 6]) -> [f64; 3] {
        self.column_of_coupling(gradient)
    }
}
