//! The deformation increment of a point over a load step, eq. (7).
#![allow(non_snake_case)]

use crate::basis::Links;

/// How the surroundings of a point deform over the load step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Increment<const D: usize> {
    /// ΔF along the axes of the grid, [-].
    pub dF: [[f64; D]; D],
    /// ΔF around the axis of revolution, 1 + Σ S_vp Δu_r / r̃, [-]; 1 where there is none.
    pub hoop: f64,
    /// Distance from that axis at the start of the step, r̃, [length]; 0 where there is none.
    pub radius: f64,
}

impl<const D: usize> Increment<D> {
    /// Eq. (7) at a point whose group touches `nodes`: ΔF = I + Σ_v Δu_v ⊗ ∂S_vp/∂X̃, with `delta_d` the displacement
    /// increments of the active nodes and `position` that of the point at the start of the step; `revolved` bodies turn about
    /// the axis where the first coordinate vanishes.
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

    /// An increment without revolution.
    pub fn of(dF: [[f64; D]; D]) -> Self {
        Increment { dF, hoop: 1.0, radius: 0.0 }
    }
}
