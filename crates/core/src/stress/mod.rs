//! The finite-strain kernel around a law: maps the deformation increment of a material point to its contribution to
//! internal force and stiffness, eqs. (14)-(18) and (A.1)-(A.6).
//!
//! [`plane_strain`] has a closed form for motions that keep z a principal direction. [`solid`] is the general kernel in
//! three dimensions, and [`axisymmetric`] adapts it to bodies of revolution. The updated Lagrangian formulation is
//! [`Current`], which F-bar uses as well. Tests compare all kernels with each other and with transcriptions of the
//! equations. [`Midpoint`] averages the stress over a step with inertia.
#![allow(non_snake_case)]

mod averaged_solid;
mod axisymmetric;
mod cell_strain;
mod current;
mod deviation;
mod dilated;
mod in_plane;
mod isotropic;
mod midpoint;
mod plane_strain;
mod principal;
mod products;
mod solid;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

use crate::kinematics::Increment;
use crate::material::{Material, MaterialError, StrainMeasure};
use crate::tensor::lane::transposed;
use crate::tensor::{Lane, Lanes, Sym3};

pub use averaged_solid::{AveragedIsotropic, AveragedSpatial};
pub use axisymmetric::{Axisymmetric, Revolved};
pub use cell_strain::CellStrain;
pub use current::Current;
pub use deviation::{Deviated, Deviating, Deviation, Resistance, Slopes, Summable};
pub use dilated::{Averaged, Averaging, Centred, Centring, FBar, MeanDilatation};
pub use in_plane::InPlane;
pub use isotropic::Isotropic;
pub use midpoint::{Averageable, Midpoint, StressAtStart};
pub use plane_strain::PlaneStrain;
pub(crate) use principal::MAX_HISTORY;
pub use solid::{Solid, Spatial};

/// Configuration in which equilibrium is formulated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Formulation {
    /// The previously converged configuration, Coombs et al. (2020), section 5.
    #[default]
    PreviouslyConverged,
    /// The current configuration, Coombs et al. (2020), section 3. Slower; kept as a cross-check. Points that take the
    /// dilatation of their cell are formulated in this configuration in any case.
    UpdatedLagrangian,
}

impl<W> PointResponse<W> {
    /// The same response with another weak form.
    #[inline(always)]
    pub fn map<V>(self, weak: impl FnOnce(W) -> V) -> PointResponse<V> {
        PointResponse { weak: weak(self.weak), tau: self.tau, elastic_strain: self.elastic_strain }
    }
}

/// State of a material point at the start of a load step.
#[derive(Debug, Clone, Copy)]
pub struct StartOfStep {
    /// Elastic left Cauchy-Green strain b^e_n, [-].
    pub b_n: Sym3,
    /// Volume ratio J_n, [-].
    pub J_n: f64,
    /// Volume V_n at the start of the step, eq. (22), [volume].
    pub volume_n: f64,
}

/// Response of a point to a deformation increment.
#[derive(Debug, Clone, Copy)]
pub struct PointResponse<W> {
    /// Contribution to internal force and stiffness.
    pub weak: W,
    /// Kirchhoff stress τ, [stress].
    pub tau: Sym3,
    /// Elastic strain after the return mapping, in the measure of the law, [-].
    pub elastic_strain: Sym3,
}

/// Contribution of one point to internal force and stiffness, eqs. (21) and (23): V P̃·∇S_a at node a and V ∇S_a·Ã·∇S_b
/// between nodes a and b. Each implementation uses the form that is cheapest to evaluate.
pub trait WeakForm<const D: usize>: Copy {
    /// Data of the basis function of one node, or of several nodes in SIMD lanes.
    type Gradient<T: Lane>: Copy;
    /// Contribution of node b to all its pairs, V Ã·∇S_b.
    type Column;

    /// ΔF⁻¹ if gradients must refer to the current configuration, eq. (8): ∂S/∂x = ∂S/∂X̃ ΔF⁻¹.
    fn inverse(&self) -> Option<&[[f64; D]; D]>;

    /// Data of a basis function, from its value and its gradient in the configuration required by
    /// [`WeakForm::inverse`].
    fn gradient(&self, gradient: &[f64; D], value: f64) -> Self::Gradient<f64>;

    /// Packs the data of up to [`Lanes::WIDTH`] nodes into lanes; missing nodes are zero.
    fn pack(nodes: &[Self::Gradient<f64>]) -> Self::Gradient<Lanes>;

    /// Returns the column of a node and adds the force at the node to `force`.
    fn column(&self, gradient: &Self::Gradient<f64>, force: &mut [f64; D]) -> Self::Column;

    /// Adds the product of the gradient of a row and a `column` to the block of their pair, `[i][k]`. With several rows
    /// in lanes, the blocks are in lanes as well.
    fn add_block<T: Lane>(column: &Self::Column, gradient: &Self::Gradient<T>, block: &mut [[T; D]; D]);
}

/// Why a point cannot be evaluated for a displacement increment.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PointError {
    /// The increment inverts the material.
    #[error("det(ΔF) = {determinant:e} is not positive")]
    Inverted {
        /// det(ΔF).
        determinant: f64,
    },
    /// The law failed.
    #[error(transparent)]
    Material(#[from] MaterialError),
}

/// True if a law allows the evaluation of several points at a time, provided that the idealisation supports it.
pub(crate) fn suits_lanes(law: &dyn Material) -> bool {
    let has_form = law.vectorised().is_some() || law.principal().is_some();
    has_form && law.state_fields().len() <= MAX_HISTORY
}

/// An idealisation: maps a `D`-dimensional displacement increment to the deformation of a three-dimensional material.
pub trait Mechanics<const D: usize>: Copy + Send + Sync + 'static {
    /// True for bodies of revolution about the axis where the first coordinate is zero.
    const REVOLVED: bool = false;
    /// True if [`Mechanics::respond_vectorised`] is implemented.
    const VECTORISED: bool = false;

    /// A point in the previously converged formulation.
    type Previous: WeakForm<D>;
    /// As [`Mechanics::Previous`], for laws with isotropic spatial moduli.
    type Isotropic: WeakForm<D>;
    /// A point in the updated Lagrangian formulation, whose volume ratio may be the value at the centre of its cell, or
    /// which may take the mean increment of its cell.
    type Current: WeakForm<D> + Centring<D> + Summable + Averageable<D>;
    /// A point whose volume ratio may be the mean over its cell.
    type Averaging: Averaging<D>;
    /// As [`Mechanics::Averaging`], for laws with isotropic spatial moduli.
    type AveragingIsotropic: Averaging<D>;
    /// The stress that resists the deviation of a point from the mean increment of its cell.
    type Deviation: Deviating<D>;
    /// Number n of principal directions that a change of volume stretches.
    const DILATED: usize = 3;

    /// Evaluates a point in the previously converged formulation.
    ///
    /// # Errors
    /// [`PointError`] if det(ΔF) is not positive or the law fails.
    fn respond(
        start: &StartOfStep,
        increment: &Increment<D>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Self::Previous>, PointError>;

    /// As [`Mechanics::respond`] for several points of one law at once; replaces `history` by its new values. `None` if
    /// the idealisation or the law has no such form, or if a point fails. The points must then be evaluated one
    /// by one.
    #[inline(always)]
    fn respond_vectorised(
        _starts: [&StartOfStep; Lanes::WIDTH],
        _increments: &[Increment<D>; Lanes::WIDTH],
        _material: &dyn Material,
        _history: &mut [Lanes],
    ) -> Option<[PointResponse<Self::Previous>; Lanes::WIDTH]> {
        None
    }

    /// As [`Mechanics::respond`] without fourth-order tensors, for a law with isotropic spatial moduli. `None` for
    /// other laws, and if the idealisation gains nothing from this form.
    #[inline(always)]
    fn respond_isotropic(
        _start: &StartOfStep,
        _increment: &Increment<D>,
        _material: &dyn Material,
    ) -> Option<Result<PointResponse<Self::Isotropic>, PointError>> {
        None
    }

    /// Evaluates a point in the updated Lagrangian formulation, with all moduli in the current configuration.
    ///
    /// # Errors
    /// As [`Mechanics::respond`].
    fn respond_current(
        start: &StartOfStep,
        increment: &Increment<D>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Self::Current>, PointError>;

    /// Evaluates a point whose volume ratio may be the mean over its cell.
    ///
    /// # Errors
    /// As [`Mechanics::respond`].
    fn respond_averaging(
        start: &StartOfStep,
        increment: &Increment<D>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Self::Averaging>, PointError>;

    /// As [`Mechanics::respond_averaging`] for several points of one law at once; see
    /// [`Mechanics::respond_vectorised`].
    #[inline(always)]
    fn respond_averaging_vectorised(
        _starts: [&StartOfStep; Lanes::WIDTH],
        _increments: &[Increment<D>; Lanes::WIDTH],
        _material: &dyn Material,
        _history: &mut [Lanes],
    ) -> Option<[PointResponse<Self::Averaging>; Lanes::WIDTH]> {
        None
    }

    /// As [`Mechanics::respond_averaging`], in the form of [`Mechanics::respond_isotropic`].
    #[inline(always)]
    fn respond_averaging_isotropic(
        _start: &StartOfStep,
        _increment: &Increment<D>,
        _material: &dyn Material,
    ) -> Option<Result<PointResponse<Self::AveragingIsotropic>, PointError>> {
        None
    }

    /// b^e from an elastic strain in this measure.
    fn elastic_left_cauchy_green(measure: StrainMeasure, elastic_strain: &Sym3) -> Sym3 {
        measure.left_cauchy_green(elastic_strain)
    }
}
