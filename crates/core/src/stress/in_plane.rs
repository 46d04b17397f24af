//! The weak form of a point in the plane, in the previously converged formulation.

use super::{Lane, Lanes, WeakForm, transposed};

/// V P̃ and V Ã of a point, with indices in the order in which they are contracted. `T` is a number for one point, or a
/// vector with one SIMD lane per point.
#[derive(Debug, Clone, Copy)]
pub struct InPlane<T = f64> {
    /// V P̃_ij, `[j][i]`.
    pub stress: [[T; 2]; 2],
    /// V Ã_ijkl, `[l][j][i][k]`: contraction with both gradients leaves the block of a pair contiguous in memory.
    pub tangent: [[[[T; 2]; 2]; 2]; 2],
}

impl InPlane<Lanes> {
    /// Extracts one point.
    #[inline(always)]
    pub(super) fn point(&self, lane: usize) -> InPlane {
        let mut point = InPlane { stress: [[0.0; 2]; 2], tangent: [[[[0.0; 2]; 2]; 2]; 2] };
        for (x, lanes) in point.stress.as_flattened_mut().iter_mut().zip(self.stress.as_flattened()) {
            *x = lanes.0[lane];
        }
        let tangent = point.tangent.as_flattened_mut().as_flattened_mut().as_flattened_mut();
        let all = self.tangent.as_flattened().as_flattened().as_flattened();
        for (x, lanes) in tangent.iter_mut().zip(all) {
            *x = lanes.0[lane];
        }
        point
    }
}

impl WeakForm<2> for InPlane {
    type Gradient<T: Lane> = [T; 2];
    /// The contraction of V Ã with one gradient, `[j][i][k]`.
    type Column = [[[f64; 2]; 2]; 2];

    #[inline(always)]
    fn inverse(&self) -> Option<&[[f64; 2]; 2]> {
        None
    }

    #[inline(always)]
    fn gradient(&self, gradient: &[f64; 2], _value: f64) -> [f64; 2] {
        *gradient
    }

    #[inline(always)]
    fn pack(nodes: &[[f64; 2]]) -> [Lanes; 2] {
        transposed(nodes)
    }

    #[inline(always)]
    fn column(&self, gradient: &[f64; 2], force: &mut [f64; 2]) -> [[[f64; 2]; 2]; 2] {
        let [x, y] = *gradient;
        let [along_x, along_y] = &self.stress;
        for i in 0..2 {
            force[i] += along_x[i] * x + along_y[i] * y; // (23)
        }
        let [along_x, along_y] = &self.tangent;
        let (along_x, along_y) =
            (along_x.as_flattened().as_flattened(), along_y.as_flattened().as_flattened());
        let mut column = [[[0.0; 2]; 2]; 2];
        for (e, entry) in column.as_flattened_mut().as_flattened_mut().iter_mut().enumerate() {
            *entry = along_x[e] * x + along_y[e] * y;
        }
        column
    }

    #[inline(always)]
    fn add_block<T: Lane>(column: &[[[f64; 2]; 2]; 2], gradient: &[T; 2], block: &mut [[T; 2]; 2]) {
        let [x, y] = column;
        let (x, y) = (x.as_flattened(), y.as_flattened());
        for (e, entry) in block.as_flattened_mut().iter_mut().enumerate() {
            *entry += gradient[0] * x[e] + gradient[1] * y[e]; // (21)
        }
    }
}
