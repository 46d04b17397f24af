//! Points that take the volume ratio of their cell: the mean over the cell, or the value at its centre.
//!
//! **Mean dilatation.** The volume ratio of the points of a cell is θ = Σ v_q ΔJ_q / Σ v_q with their volumes v_q at
//! the start of the step. Its variation is δθ/θ = h·δu with the mean gradient h = Σ V_q g_q / Σ V_q over the current
//! volumes V_q = v_q ΔJ_q. The virtual work of a point with the reference volume V⁰ = v/J_n is then V⁰ τ̄ : δL̄ with
//! δL̄ = δL + (h·δu − div δu)/n 1: the deviator of τ̄ is conjugate to the gradients of the point, its mean π to the
//! mean gradient. Summed over the cell, the work of the means is the work of the pressure P = Σ V⁰π / Σ V on the
//! divergence at every point. Each point thus keeps a weak form of the usual kind, with the stress V⁰ dev τ̄ + V P 1
//! and, with Dτ̄ = ∂τ̄/∂L, the derivative V⁰ dev∘Dτ̄∘dev + V P 1⊗1. In addition the cell couples all its nodes through
//! h: h⊗b + b⊗h + k h⊗h with b = Σ V⁰ dev(1:Dτ̄)·g/n and k = Σ V⁰ (1:Dτ̄:1/n² − π). All terms derive from the energy at
//! ΔF̄, so the stiffness is symmetric if the tangent of the law is (Simo, Taylor and Pister 1985; Moran, Ortiz and Shih
//! 1990).
//!
//! **F-bar.** θ = ΔJ₀, the volume ratio at the centre of the cell, where ΔF₀ = 1 + Σ Δu ⊗ ∂S/∂X̃ and g₀ = ∂S/∂X̃ ΔF₀⁻¹;
//! for a GIMP point, the mean over the cells of the domain. Forces are V σ̄·g with σ̄ = τ̄/(ΔJ₀ J_n), and the stiffness
//! gains g·(Dτ̄:1/n − τ̄) ⊗ (g₀ − g) times V/(ΔJ₀ J_n) (de Souza Neto et al. 1996; Coombs et al. 2018).
#![allow(non_snake_case)]

use super::current::along;
use super::{Current, Lane, Lanes, WeakForm};

/// Tensor conjugate to the gradients of the basis, `[j][i]`.
type Rows<const D: usize, const E: usize, T = f64> = [[T; D]; E];

/// The response, at `factor` ΔF, of a point that deforms by ΔF and takes the mean dilatation of its cell.
pub trait Averaging<const D: usize>: Copy {
    /// The weak form of such a point.
    type Averaged: Averaged<D>;

    /// The weak form under the pressure of the cell; `pressure` is V P.
    fn averaged(&self, factor: f64, pressure: f64) -> Self::Averaged;
}

/// The weak form of a point that takes the mean dilatation of its cell, without its contribution to the coupling of all
/// nodes.
pub trait Averaged<const D: usize>: WeakForm<D> {
    /// V⁰ 1:Dτ̄:1/n², [stress·volume].
    fn modulus(&self) -> f64;

    /// Divergence of the basis function times the unit vector of each axis, [1/length].
    fn divergence(gradient: &Self::Gradient<f64>) -> [f64; D];

    /// The contribution of a node to b as a column of the stiffness.
    fn column_of_coupling(&self, gradient: &Self::Gradient<f64>) -> [f64; D];

    /// The contribution of a node to b as a row of the stiffness; it differs from the column if the tangent of the law
    /// is unsymmetric.
    fn row_of_coupling(&self, gradient: &Self::Gradient<f64>) -> [f64; D];
}

/// The response, at `factor` ΔF, of a point that deforms by ΔF and takes the volume ratio at the centre of its cell.
pub trait Centring<const D: usize> {
    /// The weak form of such a point.
    type Centred: Centred<D>;

    /// The weak form; its stress is integrated over the volume `ratio` V⁰, with `ratio` = ΔJ/ΔJ₀.
    fn centred(self, factor: f64, ratio: f64) -> Self::Centred;
}

/// The weak form of a point that takes the volume ratio at the centre of its cell.
pub trait Centred<const D: usize>: WeakForm<D> {
    /// Divergence of the basis function times the unit vector of each axis, at the point, [1/length].
    fn divergence(gradient: &Self::Gradient<f64>) -> [f64; D];

    /// Adds the effect of `excess` to the column of a node: the divergence of the node at the centre minus its
    /// divergence at the point, [1/length].
    fn add_excess(&self, excess: &[f64; D], column: &mut Self::Column);
}

/// [`Averaged`] with all its moduli. `T` is a number for one point, or a vector with one SIMD lane per point.
#[derive(Debug, Clone, Copy)]
pub struct MeanDilatation<const D: usize, const E: usize, T = f64> {
    /// The point; [`Averaging::averaged`] adds the pressure of the cell.
    point: Current<D, E, T>,
    /// V⁰ 1:Dτ̄:1/n².
    modulus: T,
    /// V⁰ dev(Dτ̄:1)/n for the row of the coupling, and V⁰ dev(1:Dτ̄)/n for its column.
    coupling: [Rows<D, E, T>; 2],
}

/// [`Centred`] with all its moduli.
#[derive(Debug, Clone, Copy)]
pub struct FBar<const D: usize, const E: usize> {
    point: Current<D, E>,
    /// V⁰ ΔJ/ΔJ₀ (Dτ̄:1/n − τ̄), the derivative of the stress with respect to ln ΔJ₀. Its second part is due to the
    /// divisor ΔJ₀.
    with_ratio: Rows<D, E>,
}

/// Divergence of the basis function times the unit vector of each axis.
#[inline(always)]
fn divergence<const D: usize, const E: usize>(gradient: &[f64; E]) -> [f64; D] {
    let mut sum = [0.0; D];
    for j in 0..E {
        sum[along::<D>(j)] += gradient[j];
    }
    sum
}

/// 1:Dτ̄ and Dτ̄:1.
#[inline(always)]
fn volumetric<const D: usize, const E: usize, T: Lane>(point: &Current<D, E, T>) -> [Rows<D, E, T>; 2] {
    let Current { stress, tangent, .. } = point;
    let [mut trace_rate, mut with_volume] = [*stress; 2];
    for m in 0..E {
        for j in 0..E {
            for i in 0..D {
                trace_rate[j][i] += tangent[j][m][along::<D>(m)][i];
                with_volume[j][i] += tangent[m][j][i][along::<D>(m)];
            }
        }
    }
    [trace_rate, with_volume]
}

#[inline(always)]
fn trace<const D: usize, const E: usize, T: Lane>(rows: &Rows<D, E, T>) -> T {
    let mut sum = rows[0][0];
    for m in 1..E {
        sum += rows[m][along::<D>(m)];
    }
    sum
}

impl<const D: usize, const E: usize, T: Lane> MeanDilatation<D, E, T> {
    /// The moduli from the response at ΔF̄.
    #[inline(always)]
    pub(super) fn new(mut point: Current<D, E, T>) -> Self {
        let per_n = 1.0 / E as f64;
        let [mut trace_rate, mut with_volume] = volumetric(&point);
        let pi = trace(&point.stress) * per_n;
        let modulus = trace(&trace_rate) * (per_n * per_n);
        let minus = modulus * -1.0;
        for part in [&mut trace_rate, &mut with_volume] {
            for j in 0..E {
                for i in 0..D {
                    part[j][i] = part[j][i] * per_n;
                }
            }
            for m in 0..E {
                part[m][along::<D>(m)] += minus;
            }
        }
        // dev∘Dτ̄∘dev, and the transport of the deviator alone.
        for m in 0..E {
            let a = along::<D>(m);
            point.stress[m][a] += pi * -1.0;
            for j in 0..E {
                for i in 0..D {
                    point.tangent[j][m][a][i] += trace_rate[j][i] * -1.0;
                    point.tangent[m][j][i][a] += with_volume[j][i] * -1.0;
                }
                point.tangent[j][m][a][along::<D>(j)] += minus;
            }
        }
        add_transport(&mut point, pi);
        MeanDilatation { point, modulus, coupling: [with_volume, trace_rate] }
    }
}

impl MeanDilatation<2, 2, Lanes> {
    /// Extracts one point.
    #[inline(always)]
    pub(super) fn point(&self, lane: usize) -> MeanDilatation<2, 2> {
        let rows = |part: &Rows<2, 2, Lanes>| {
            let [[a, b], [c, d]] = part;
            [[a.0[lane], b.0[lane]], [c.0[lane], d.0[lane]]]
        };
        MeanDilatation {
            point: self.point.point(lane),
            modulus: self.modulus.0[lane],
            coupling: [rows(&self.coupling[0]), rows(&self.coupling[1])],
        }
    }
}

impl<const D: usize, const E: usize> Averaging<D> for MeanDilatation<D, E> {
    type Averaged = Self;

    #[inline(always)]
    fn averaged(&self, factor: f64, pressure: f64) -> Self {
        let mut averaged = MeanDilatation { point: self.point.shrunk(factor), ..*self };
        let point = &mut averaged.point;
        for m in 0..E {
            let a = along::<D>(m);
            point.stress[m][a] += pressure;
            for j in 0..E {
                point.tangent[j][m][a][along::<D>(j)] += pressure;
            }
        }
        add_transport(point, -pressure);
        averaged
    }
}

impl<const D: usize, const E: usize> Centring<D> for Current<D, E> {
    type Centred = FBar<D, E>;

    #[inline(always)]
    fn centred(self, factor: f64, ratio: f64) -> FBar<D, E> {
        let mut point = self.shrunk(factor);
        point.stress.as_flattened_mut().iter_mut().for_each(|x| *x *= ratio);
        let tangent = point.tangent.as_flattened_mut().as_flattened_mut().as_flattened_mut();
        tangent.iter_mut().for_each(|x| *x *= ratio);
        let [_, mut with_ratio] = volumetric(&point);
        for (x, stress) in with_ratio.as_flattened_mut().iter_mut().zip(point.stress.as_flattened()) {
            *x = *x / E as f64 - stress;
        }
        FBar { point, with_ratio }
    }
}

/// Adds `pressure` tr(L L′), the transport of a mean stress −`pressure`, to the tangent.
#[inline(always)]
fn add_transport<const D: usize, const E: usize, T: Lane>(point: &mut Current<D, E, T>, pressure: T) {
    for i in 0..D {
        for j in 0..D {
            point.tangent[i][j][i][j] += pressure;
        }
    }
    for m in D..E {
        point.tangent[m][m][0][0] += pressure;
    }
}

impl<const D: usize, const E: usize> WeakForm<D> for MeanDilatation<D, E> {
    type Gradient<T: Lane> = [T; E];
    type Column = <Current<D, E> as WeakForm<D>>::Column;

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; D]; D]> {
        self.point.inverse()
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; D], value: f64) -> [f64; E] {
        self.point.gradient(gradient, value)
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; E]]) -> [Lanes; E] {
        Current::<D, E>::pack(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; E], force: &mut [f64; D]) -> Self::Column {
        self.point.column(gradient, force)
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &Self::Column, gradient: &[T; E], block: &mut [[T; D]; D]) {
        Current::<D, E>::add_block(column, gradient, block);
    }
}

impl<const D: usize, const E: usize> Averaged<D> for MeanDilatation<D, E> {
    #[inline(always)]
    fn modulus(&self) -> f64 {
        self.modulus
    }

    #[inline(always)]
    fn divergence(gradient: &[f64; E]) -> [f64; D] {
        divergence(gradient)
    }

    #[inline(always)]
    fn column_of_coupling(&self, gradient: &[f64; E]) -> [f64; D] {
        product(&self.coupling[1], gradient)
    }

    #[inline(always)]
    fn row_of_coupling(&self, gradient: &[f64; E]) -> [f64; D] {
        product(&self.coupling[0], gradient)
    }
}

#[inline(always)]
fn product<const D: usize, const E: usize>(rows: &Rows<D, E>, gradient: &[f64; E]) -> [f64; D] {
    let mut sum = [0.0; D];
    for j in 0..E {
        for i in 0..D {
            sum[i] += rows[j][i] * gradient[j];
        }
    }
    sum
}

impl<const D: usize, const E: usize> WeakForm<D> for FBar<D, E> {
    type Gradient<T: Lane> = [T; E];
    type Column = <Current<D, E> as WeakForm<D>>::Column;

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; D]; D]> {
        self.point.inverse()
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; D], value: f64) -> [f64; E] {
        self.point.gradient(gradient, value)
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; E]]) -> [Lanes; E] {
        Current::<D, E>::pack(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; E], force: &mut [f64; D]) -> Self::Column {
        self.point.column(gradient, force)
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &Self::Column, gradient: &[T; E], block: &mut [[T; D]; D]) {
        Current::<D, E>::add_block(column, gradient, block);
    }
}

impl<const D: usize, const E: usize> Centred<D> for FBar<D, E> {
    #[inline(always)]
    fn add_excess(&self, excess: &[f64; D], column: &mut Self::Column) {
        for j in 0..E {
            for i in 0..D {
                for k in 0..D {
                    column[j][i][k] += self.with_ratio[j][i] * excess[k];
                }
            }
        }
    }

    #[inline(always)]
    fn divergence(gradient: &[f64; E]) -> [f64; D] {
        divergence(gradient)
    }
}
