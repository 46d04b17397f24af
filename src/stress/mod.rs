//! The finite-strain kernel around a small-strain law: from the displacement-gradient increment of one material
//! point to the stress and tangent that enter equilibrium, eqs. (14)-(18), (A.1)-(A.6).
//!
//! [`solid`] is the literal transcription in three dimensions; [`plane_strain`] is the same in closed form for
//! motions that keep z a principal direction. A test holds them together.
#![allow(non_snake_case)]

mod plane_strain;
mod solid;

use serde::{Deserialize, Serialize};

use crate::material::{Material, MaterialError};
use crate::tensor::{Mat3, Sym3, Tensor4};

pub use plane_strain::PlaneStrain;
pub use solid::Solid;

/// Configuration in which equilibrium is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, schemars::JsonSchema)]
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
    /// Elastic left Cauchy-Green strain b^e_n = exp(2 ε^e_n), [-].
    pub b_n: Sym3,
    /// Volume ratio J_n, [-].
    pub J_n: f64,
    /// Volume at the start of the step V_n, eq. (22), [volume].
    pub volume_n: f64,
}

/// The contribution of one material point to internal force and stiffness.
///
/// With the previously converged formulation `stress` is P̃, `tangent` is Ã and `volume` is V_n; with the updated
/// Lagrangian one they are σ, a and V, and gradients must be mapped to the current configuration by eq. (8).
#[derive(Debug, Clone, Copy)]
pub struct Contribution<const D: usize> {
    /// Stress that works with the gradient of the basis, `[i][j]`, j the direction of the gradient.
    pub stress: [[f64; D]; D],
    /// Its derivative, `[i][j][k][l]`.
    pub tangent: Tensor4<D>,
    /// Volume that the point represents in this configuration.
    pub volume: f64,
    /// Kirchhoff stress τ.
    pub tau: Sym3,
    /// Elastic strain after the return mapping.
    pub elastic_strain: Sym3,
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
    /// Evaluates one point at the deformation gradient increment `dF`, whose in-plane block is given.
    ///
    /// # Errors
    /// [`PointError`] when det(ΔF) is not positive or the law fails.
    fn respond(
        formulation: Formulation,
        start: &StartOfStep,
        dF: &[[f64; D]; D],
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<Contribution<D>, PointError>;

    /// The increment as a three-dimensional tensor.
    fn embed(dF: &[[f64; D]; D]) -> Mat3;

    /// b^e = exp(2 ε^e).
    fn elastic_left_cauchy_green(elastic_strain: &Sym3) -> Sym3;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Hencky, VonMises};
    use proptest::prelude::*;

    fn laws() -> [Box<dyn Material>; 2] {
        [Box::new(Hencky::new(12e6, 0.2)), Box::new(VonMises::new(1e6, 0.3, 20e3))]
    }

    /// A random start-of-step state and increment, in plane strain.
    fn states() -> impl Strategy<Value = (StartOfStep, [[f64; 2]; 2])> {
        let strain = (-0.3..0.3f64, -0.3..0.3f64, -0.3..0.3f64, -0.3..0.3f64);
        let increment = prop::array::uniform2(prop::array::uniform2(-0.6..0.6f64));
        (strain, 0.5..2.0f64, increment).prop_filter_map("inverted", |((xx, yy, zz, xy), J_n, h)| {
            let dF = [[1.0 + h[0][0], h[0][1]], [h[1][0], 1.0 + h[1][1]]];
            let b_n = PlaneStrain::elastic_left_cauchy_green(&Sym3([xx, yy, zz, 0.0, 0.0, xy]));
            (dF[0][0] * dF[1][1] - dF[0][1] * dF[1][0] > 0.1)
                .then_some((StartOfStep { b_n, J_n, volume_n: 0.7 }, dF))
        })
    }

    fn embed(dF: &[[f64; 2]; 2]) -> [[f64; 3]; 3] {
        [[dF[0][0], dF[0][1], 0.0], [dF[1][0], dF[1][1], 0.0], [0.0, 0.0, 1.0]]
    }

    fn history(law: &dyn Material) -> Vec<f64> {
        law.state_fields().iter().map(|f| f.initial).collect()
    }

    proptest! {
        #[test]
        fn closed_form_plane_strain_equals_the_general_kernel((start, dF) in states()) {
            for law in laws() {
                let old = history(law.as_ref());
                for formulation in [Formulation::PreviouslyConverged, Formulation::UpdatedLagrangian] {
                    let p = PlaneStrain::respond(formulation, &start, &dF, law.as_ref(), &old, &mut old.clone()).unwrap();
                    let s = Solid::respond(formulation, &start, &embed(&dF), law.as_ref(), &old, &mut old.clone()).unwrap();
                    prop_assert!((p.tau - s.tau).norm() <= 1e-12 * s.tau.norm().max(1e3));
                    prop_assert!((p.elastic_strain - s.elastic_strain).norm() < 1e-13);
                    prop_assert!((p.volume - s.volume).abs() < 1e-14);
                    for i in 0..2 {
                        for j in 0..2 {
                            prop_assert!((p.stress[i][j] - s.stress[i][j]).abs() <= 1e-9 * 12e6 * 1e-3);
                            for k in 0..2 {
                                for l in 0..2 {
                                    let (a, b) = (p.tangent[i][j][k][l], s.tangent[i][j][k][l]);
                                    prop_assert!((a - b).abs() <= 1e-12 * 1e8, "{a} {b}");
                                }
                            }
                        }
                    }
                }
            }
        }

        #[test]
        fn previously_converged_tangent_is_the_derivative_and_symmetric((start, dF) in states()) {
            for law in laws() {
                let old = history(law.as_ref());
                let at = |dF: &[[f64; 2]; 2]| {
                    PlaneStrain::respond(Formulation::PreviouslyConverged, &start, dF, law.as_ref(), &old, &mut old.clone()).unwrap()
                };
                let here = at(&dF);
                let scale = here.tangent.iter().flatten().flatten().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
                for k in 0..2 {
                    for l in 0..2 {
                        let h = 1e-6;
                        let (mut plus, mut minus) = (dF, dF);
                        plus[k][l] += h;
                        minus[k][l] -= h;
                        let (plus, minus) = (at(&plus), at(&minus));
                        for i in 0..2 {
                            for j in 0..2 {
                                let numeric = (plus.stress[i][j] - minus.stress[i][j]) / (2.0 * h);
                                prop_assert!((numeric - here.tangent[i][j][k][l]).abs() < 1e-6 * scale);
                                let transposed = here.tangent[k][l][i][j];
                                prop_assert!((here.tangent[i][j][k][l] - transposed).abs() < 1e-13 * scale);
                            }
                        }
                    }
                }
            }
        }
    }
}
