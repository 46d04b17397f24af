//! Deformation increment of a material point over a load step, eq. (7).
#![allow(non_snake_case)]

use crate::basis::Links;
use crate::tensor::Mat3;

/// Deformation increment of a material point over a load step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment<const D: usize> {
    /// ΔF = I + ∂Δu/∂X̃ along the axes of the grid, `[i][j]`, [-].
    pub dF: [[f64; D]; D],
    /// Circumferential increment 1 + Σ S_vp Δu_r / r̃ of a body of revolution, [-]; 1 for other bodies.
    pub hoop: f64,
    /// Distance r̃ from the axis of revolution at the start of the step, [length]; 0 for other bodies.
    pub radius: f64,
}

impl<const D: usize> Increment<D> {
    /// Evaluates eq. (7), ΔF = I + Σ_v Δu_v ⊗ ∂S_vp/∂X̃, at one point.
    ///
    /// `nodes` are the active nodes of the point's group, into which `links.local` indexes; `delta_d` are the
    /// displacement increments of all active nodes, [length]; `position` is the position of the point at the start of
    /// the step, [length]. `revolved` bodies are bodies of revolution about the axis where the first coordinate is
    /// zero.
    #[inline(always)]
    pub fn new(
        revolved: bool,
        nodes: &[u32],
        links: &Links<D>,
        delta_d: &[[f64; D]],
        position: &[f64; D],
    ) -> Self {
        let mut dF = [[0.0; D]; D];
        for i in 0..D {
            dF[i][i] = 1.0;
        }
        for (&local, gradient) in links.local.iter().zip(links.gradient) {
            let du = &delta_d[nodes[local as usize] as usize];
            for i in 0..D {
                for j in 0..D {
                    dF[i][j] += du[i] * gradient[j];
                }
            }
        }
        if !revolved {
            return Increment { dF, hoop: 1.0, radius: 0.0 };
        }
        let radius = position[0];
        let values = links.local.iter().zip(links.value);
        let outwards: f64 =
            values.map(|(&local, value)| value * delta_d[nodes[local as usize] as usize][0]).sum();
        Increment { dF, hoop: 1.0 + outwards / radius, radius }
    }

    /// det(ΔF), [-].
    #[inline(always)]
    pub fn determinant(&self) -> f64 {
        let F = |i: usize, j: usize| self.dF[i][j];
        let in_axes = match D {
            2 => F(0, 0) * F(1, 1) - F(0, 1) * F(1, 0),
            3 => {
                let minor = |j: usize| {
                    let (a, b) = ((j + 1) % 3, (j + 2) % 3);
                    F(1, a) * F(2, b) - F(1, b) * F(2, a)
                };
                F(0, 0) * minor(0) + F(0, 1) * minor(1) + F(0, 2) * minor(2)
            }
            _ => f64::NAN,
        };
        in_axes * self.hoop
    }

    /// ΔF⁻¹ along the axes of the grid, [-].
    pub fn inverse(&self) -> [[f64; D]; D] {
        let in_axes = self.determinant() / self.hoop;
        let F = |i: usize, j: usize| self.dF[i][j];
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let cofactor = match D {
                    2 => F(1 - j, 1 - i) * if i == j { 1.0 } else { -1.0 },
                    _ => {
                        let (a, b, c, d) = ((j + 1) % 3, (j + 2) % 3, (i + 1) % 3, (i + 2) % 3);
                        F(a, c) * F(b, d) - F(a, d) * F(b, c)
                    }
                };
                cofactor / in_axes
            })
        })
    }

    /// ΔF in three dimensions, [-]. Along an axis that the grid lacks, the component is the circumferential increment,
    /// or 1.
    #[inline(always)]
    pub fn in_space(&self) -> Mat3 {
        Mat3::from_fn(|i, j| match (i < D && j < D, i == j) {
            (true, _) => self.dF[i][j],
            (false, true) => self.hoop,
            (false, false) => 0.0,
        })
    }

    /// `factor` times ΔF; bodies that are not `revolved` keep their circumferential increment of 1.
    #[inline(always)]
    pub fn scaled(&self, factor: f64, revolved: bool) -> Self {
        let hoop = if revolved { self.hoop * factor } else { self.hoop };
        Increment { dF: self.dF.map(|row| row.map(|x| x * factor)), hoop, radius: self.radius }
    }

    /// An increment without circumferential stretch.
    pub fn flat(dF: [[f64; D]; D]) -> Self {
        Increment { dF, hoop: 1.0, radius: 0.0 }
    }
}
