//! The finite-strain kernel around a law: from the deformation increment of one material point to the force and
//! stiffness that enter equilibrium, eqs. (14)-(18), (A.1)-(A.6).
//!
//! [`plane_strain`] is in closed form for motions that keep z a principal direction, [`solid`] is the general kernel in
//! three dimensions and [`axisymmetric`] the same for bodies of revolution. Each also has the updated Lagrangian
//! formulation, which in three dimensions is transcribed equation by equation. Tests hold all of them together, and to
//! a transcription of eqs. (18) and (A.3)-(A.6).
#![allow(non_snake_case)]

mod axisymmetric;
mod contribution;
mod in_plane;
mod isotropic;
mod plane_strain;
mod products;
mod solid;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

use crate::kinematics::Increment;
use crate::material::{Material, MaterialError, StrainMeasure};
use crate::tensor::lane::transposed;
use crate::tensor::{Lane, Lanes, Mat3, Sym3};

pub use axisymmetric::{Axisymmetric, Revolved};
pub use contribution::Contribution;
pub use in_plane::InPlane;
pub use isotropic::Isotropic;
pub use plane_strain::PlaneStrain;
pub use solid::{Solid, Spatial};

/// Configuration in which equilibrium is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Formulation {
    /// The previously converged configuration, Coombs et al. (2020), section 5.
    #[default]
    PreviouslyConverged,
    /// The current configuration, Coombs et al. (2020), section 3; slower, kept as a cross-check.
    UpdatedLagrangian,
}

/// What the equilibrium of one load step needs to know of a material point, fixed at the start of the step.
#[derive(Debug, Clone, Copy)]
pub struct StartOfStep {
    /// Elastic left Cauchy-Green strain b^e_n, [-].
    pub b_n: Sym3,
    /// Volume ratio J_n, [-].
    pub J_n: f64,
    /// Volume at the start of the step V_n, eq. (22), [volume].
    pub volume_n: f64,
}

/// The answer of a point to a deformation increment.
#[derive(Debug, Clone, Copy)]
pub struct PointResponse<W> {
    /// Its part in internal force and stiffness.
    pub weak: W,
    /// Kirchhoff stress τ.
    pub tau: Sym3,
    /// Elastic strain after the return mapping, in the measure of the law.
    pub elastic_strain: Sym3,
}

/// The part of one point in internal force and stiffness: V P̃·∇S_a on node a and V ∇S_a·Ã·∇S_b between nodes a and b,
/// eqs. (21) and (23), in whatever form is the cheapest to evaluate.
pub trait WeakForm<const D: usize>: Copy {
    /// What is needed of the basis function of a node, or of those of several nodes side by side.
    type Gradient<T: Lane>: Copy;
    /// What node b contributes to its pairs, V Ã·∇S_b.
    type Column;

    /// ΔF⁻¹ where gradients must be given in the current configuration, eq. (8): ∂S/∂x = ∂S/∂X̃ ΔF⁻¹.
    fn inverse(&self) -> Option<&[[f64; D]; D]>;

    /// From the gradient of a basis function, mapped if need be, and its value.
    fn gradient(&self, gradient: &[f64; D], value: f64) -> Self::Gradient<f64>;

    /// Puts up to as many nodes side by side as there are lanes; those that are missing are zero.
    fn side_by_side(nodes: &[Self::Gradient<f64>]) -> Self::Gradient<Lanes>;

    /// The column of a node; adds the force on it.
    fn column(&self, gradient: &Self::Gradient<f64>, force: &mut [f64; D]) -> Self::Column;

    /// Adds to the block of a pair, `[i][k]`, the part of the node of `gradient` (row) with that of a column; for
    /// several rows side by side, to their blocks side by side.
    fn add_block<T: Lane>(column: &Self::Column, gradient: &Self::Gradient<T>, block: &mut [[T; D]; D]);
}

/// A point could not follow the displacement increment.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PointError {
    /// The increment turns the material inside out.
    #[error("det(ΔF) = {determinant:e} is not positive")]
    Inverted {
        /// det(ΔF).
        determinant: f64,
    },
    /// The law failed.
    #[error(transparent)]
    Material(#[from] MaterialError),
}

/// How a `D`-dimensional displacement increment deforms the three-dimensional material: the idealisation.
pub trait Mechanics<const D: usize>: Copy + Send + Sync + 'static {
    /// Whether the body is one of revolution about the axis where the first coordinate vanishes.
    const REVOLVED: bool = false;
    /// Whether [`Mechanics::respond_side_by_side`] has something to say.
    const SIDE_BY_SIDE: bool = false;

    /// A point in the previously converged formulation.
    type Previous: WeakForm<D>;
    /// The same for a law with isotropic spatial moduli.
    type Isotropic: WeakForm<D>;
    /// A point in the updated Lagrangian formulation.
    type Updated: WeakForm<D>;

    /// Evaluates one point in the previously converged formulation.
    ///
    /// # Errors
    /// [`PointError`] when det(ΔF) is not positive or the law fails.
    fn respond(
        start: &StartOfStep,
        increment: &Increment<D>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Self::Previous>, PointError>;

    /// The same for several points of one law side by side; `history` holds their variables and receives the new ones.
    /// `None` where mechanics or law have no such form, and where a point fails: then they are evaluated one by one.
    #[inline(always)]
    fn respond_side_by_side(
        _starts: [&StartOfStep; Lanes::WIDTH],
        _increments: &[Increment<D>; Lanes::WIDTH],
        _material: &dyn Material,
        _history: &mut [Lanes],
    ) -> Option<[PointResponse<Self::Previous>; Lanes::WIDTH]> {
        None
    }

    /// The same for a law with isotropic spatial moduli, of which nothing of fourth order is formed; `None` for all
    /// others, and where nothing is gained.
    #[inline(always)]
    fn respond_isotropic(
        _start: &StartOfStep,
        _increment: &Increment<D>,
        _material: &dyn Material,
    ) -> Option<Result<PointResponse<Self::Isotropic>, PointError>> {
        None
    }

    /// Evaluates one point in the updated Lagrangian formulation.
    ///
    /// # Errors
    /// As [`Mechanics::respond`].
    fn respond_updated(
        start: &StartOfStep,
        increment: &Increment<D>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Self::Updated>, PointError>;

    /// The increment as a three-dimensional tensor.
    fn embed(increment: &Increment<D>) -> Mat3;

    /// b^e of an elastic strain in the measure of its law.
    fn elastic_left_cauchy_green(measure: StrainMeasure, elastic_strain: &Sym3) -> Sym3 {
        measure.left_cauchy_green(elastic_strain)
    }
}
