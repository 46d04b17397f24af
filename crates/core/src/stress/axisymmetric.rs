//! The kernel for bodies of revolution.
//!
//! x is the distance r from the axis, y runs along the axis, and the third direction of every tensor is
//! circumferential, θ. This direction stays principal. A node represents a ring: an outward displacement u_r stretches
//! the ring, ΔF_θθ = 1 + Σ S_vp Δu_r/r̃. Forces, masses and volumes refer to the full circle.

use super::products::MANDEL_INDEX;
use super::{
    Averaging, Current, Deviation, Lane, Lanes, MeanDilatation, Mechanics, PointError, PointResponse, Solid,
    Spatial, StartOfStep, WeakForm, transposed,
};
use crate::kinematics::Increment;
use crate::material::Material;

/// Axisymmetry about x = 0, without twist.
#[derive(Debug, Clone, Copy)]
pub struct Axisymmetric;

/// A point of a body of revolution in the previously converged formulation: the general kernel, extended by the stretch
/// of the rings.
#[derive(Debug, Clone, Copy)]
pub struct Revolved {
    pub(super) point: Spatial,
    pub(super) inverse: [[f64; 2]; 2],
    /// 1/r in the current configuration, r = r̃ ΔF_θθ.
    pub(super) per_radius: f64,
}

/// Index of the circumferential direction.
const AROUND: usize = 2;

impl WeakForm<2> for Revolved {
    /// ∂S/∂x, ∂S/∂y and S/r in the current configuration.
    type Gradient<T: Lane> = [T; 3];
    /// Entries `[m][i][k]`, where m is the component of the gradient.
    type Column = [[[f64; 2]; 2]; 3];

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; 2]; 2]> {
        Some(&self.inverse)
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; 2], value: f64) -> [f64; 3] {
        [gradient[0], gradient[1], value * self.per_radius]
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; 3]]) -> [Lanes; 3] {
        transposed(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; 3], force: &mut [f64; 2]) -> [[[f64; 2]; 2]; 3] {
        let Spatial { b, stress, moduli, .. } = &self.point;
        let [r, z, hoop] = *gradient;
        let traction: [f64; 2] = std::array::from_fn(|i| stress[i][0] * r + stress[i][1] * z);
        let around = stress[AROUND][AROUND] * hoop;
        force[0] += traction[0] + around;
        force[1] += traction[1];
        let alpha: [f64; 2] = std::array::from_fn(|i| b[i][0] * r + b[i][1] * z);
        let stretch = b[AROUND][AROUND] * hoop;
        let change = |component: usize, k: usize| {
            let entry = |q: usize| moduli[MANDEL_INDEX[k][q]][component];
            let in_plane = entry(0) * alpha[0] + entry(1) * alpha[1];
            if k == 0 { in_plane + moduli[AROUND][component] * stretch } else { in_plane }
        };
        let mut column = [[[0.0; 2]; 2]; 3];
        for k in 0..2 {
            for i in 0..2 {
                for m in 0..2 {
                    column[m][i][k] = change(MANDEL_INDEX[i][m], k);
                }
                column[k][i][k] -= traction[i];
            }
            // The hoop stress is conjugate to the radial displacement only.
            column[AROUND][0][k] = change(AROUND, k);
        }
        column[AROUND][0][0] -= around;
        column
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &[[[f64; 2]; 2]; 3], gradient: &[T; 3], block: &mut [[T; 2]; 2]) {
        for (i, row) in block.iter_mut().enumerate() {
            for (k, entry) in row.iter_mut().enumerate() {
                *entry += gradient[0] * column[0][i][k]
                    + gradient[1] * column[1][i][k]
                    + gradient[2] * column[2][i][k];
            }
        }
    }
}

impl From<&Revolved> for Current<2, 3> {
    #[inline(always)]
    fn from(point: &Revolved) -> Self {
        let full = Current::from(&point.point);
        // Component (i, j) in three dimensions. The hoop stress does no work on the axial displacement.
        let component = |i: usize, j: usize| match (i, j) {
            (1, 2) => None,
            (_, 2) => Some((2, 2)),
            pair => Some(pair),
        };
        let mut stress = [[0.0; 2]; 3];
        for j in 0..3 {
            for i in 0..2 {
                stress[j][i] = component(i, j).map_or(0.0, |(i, j)| full.stress[j][i]);
            }
        }
        let entry = |i, j, k, l| match (component(i, j), component(k, l)) {
            (Some((i, j)), Some((k, l))) => full.tangent[l][j][i][k],
            _ => 0.0,
        };
        Current::with_tangent(stress, point.inverse, point.per_radius, entry)
    }
}

impl Averaging<2> for Revolved {
    type Averaged = MeanDilatation<2, 3>;

    #[inline(always)]
    fn averaged(&self, factor: f64, pressure: f64) -> MeanDilatation<2, 3> {
        MeanDilatation::new(Current::from(self)).averaged(factor, pressure)
    }
}

/// The increment in three dimensions.
#[inline]
fn solid(increment: &Increment<2>) -> Result<Increment<3>, PointError> {
    let [[rr, rz], [zr, zz]] = increment.dF;
    if increment.hoop.is_nan() || increment.hoop <= 0.0 {
        // The point has crossed the axis; det(ΔF) may still be positive.
        let determinant = (rr * zz - rz * zr).abs() * increment.hoop;
        return Err(PointError::Inverted { determinant });
    }
    Ok(Increment::flat([[rr, rz, 0.0], [zr, zz, 0.0], [0.0, 0.0, increment.hoop]]))
}

fn in_plane<T: Copy>(full: &[[T; 3]; 3]) -> [[T; 2]; 2] {
    [[full[0][0], full[0][1]], [full[1][0], full[1][1]]]
}

impl Mechanics<2> for Axisymmetric {
    const REVOLVED: bool = true;
    type Previous = Revolved;
    type Isotropic = Revolved;
    type Current = Current<2, 3>;
    type Averaging = Revolved;
    type AveragingIsotropic = Revolved;
    type Deviation = Deviation<2, 3>;

    #[inline]
    fn respond(
        start: &StartOfStep,
        increment: &Increment<2>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Revolved>, PointError> {
        let PointResponse { weak: point, tau, elastic_strain } =
            Solid::respond(start, &solid(increment)?, material, old, new)?;
        let inverse = in_plane(&point.inverse);
        let weak = Revolved { point, inverse, per_radius: 1.0 / (increment.radius * increment.hoop) };
        Ok(PointResponse { weak, tau, elastic_strain })
    }

    #[inline]
    fn respond_current(
        start: &StartOfStep,
        increment: &Increment<2>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Current<2, 3>>, PointError> {
        Ok(Self::respond(start, increment, material, old, new)?.map(|weak| Current::from(&weak)))
    }

    #[inline]
    fn respond_averaging(
        start: &StartOfStep,
        increment: &Increment<2>,
        material: &dyn Material,
        old: &[f64],
        new: &mut [f64],
    ) -> Result<PointResponse<Revolved>, PointError> {
        Self::respond(start, increment, material, old, new)
    }
}
