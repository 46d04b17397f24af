//! The smoother of a level, and the transfer of residuals and corrections between levels.

use pulp::Arch;

use super::super::lattice::Transfer;
use super::level::Level;
use super::rows::{Rows, in_parts};

/// Number of row entries that fit in the working space without allocation.
const NEAR: usize = 3 * 343 + 4;

impl<const D: usize, const N: usize> Level<D, N> {
    /// One block Gauss–Seidel sweep over the colours, forwards or backwards; it starts from zero if `afresh`.
    pub(super) fn sweep(&mut self, forwards: bool, afresh: bool) {
        if afresh {
            self.x.fill([0.0; N]);
        }
        let count = self.colours.len();
        for number in 0..count {
            let colour = if forwards { number } else { count - 1 - number };
            let nodes = &self.colours[colour];
            let (rows, inverse, b, x) = (&self.rows, &self.inverse, &self.b, &self.x);
            let fresh = &mut self.work[..nodes.len()];
            let still_zero = afresh && number == 0;
            in_parts(0, fresh, &|first, part: &mut [[f64; N]]| {
                with_room(
                    rows,
                    #[inline(always)]
                    |room| {
                        for (fresh, &n) in part.iter_mut().zip(&nodes[first..]) {
                            let n = n as usize;
                            let ax = if still_zero { [0.0; N] } else { rows.times(n, x, room) };
                            for i in 0..N {
                                fresh[i] = x[n][i];
                                for k in 0..N {
                                    fresh[i] += inverse[n][i][k] * (b[n][k] - ax[k]);
                                }
                            }
                        }
                    },
                );
            });
            for (fresh, &n) in fresh.iter().zip(nodes) {
                self.x[n as usize] = *fresh;
            }
            if let Some(shared) = &self.shared {
                shared.ghosts.renew_colour(colour, &mut self.x);
            }
        }
    }

    /// Passes the residual b − Â x to the coarser level as its right-hand side.
    pub(super) fn restrict(&mut self, transfer: &Transfer, coarse: &mut Level<D, N>) {
        let (rows, b, x) = (&self.rows, &self.b, &self.x);
        in_parts(0, &mut self.work, &|first, part: &mut [[f64; N]]| {
            with_room(
                rows,
                #[inline(always)]
                |room| {
                    for (k, residual) in part.iter_mut().enumerate() {
                        let ax = rows.times(first + k, x, room);
                        for d in 0..N {
                            residual[d] = b[first + k][d] - ax[d];
                        }
                    }
                },
            );
        });
        let (residual, unscale) = (&self.work, &self.unscale);
        let Level { scale, b, shared, .. } = coarse;
        let is_whole = shared.is_none();
        in_parts(0, b, &|first, part: &mut [[f64; N]]| {
            for (k, b) in part.iter_mut().enumerate() {
                let mut sum = [0.0; N];
                for &(child, weight) in transfer.children(first + k) {
                    let child = child as usize;
                    for d in 0..N {
                        sum[d] += f64::from(weight) * unscale[child][d] * residual[child][d];
                    }
                }
                *b = if is_whole { std::array::from_fn(|d| sum[d] * scale[first + k][d]) } else { sum };
            }
        });
        if let Some(shared) = shared {
            shared.contributions.rows.add(&shared.ghosts.ranks, b);
            for (b, scale) in b.iter_mut().zip(scale) {
                *b = std::array::from_fn(|d| b[d] * scale[d]);
            }
        }
    }

    /// Adds the correction computed on the coarser level, at ghost nodes too.
    pub(super) fn prolong(&mut self, transfer: &Transfer, coarse: &Level<D, N>) {
        let unscale = &self.unscale;
        in_parts(0, &mut self.x, &|first, part: &mut [[f64; N]]| {
            for (k, x) in part.iter_mut().enumerate() {
                for &(parent, weight) in transfer.parents(first + k) {
                    let parent = parent as usize;
                    for d in 0..N {
                        let correction = coarse.scale[parent][d] * coarse.x[parent][d];
                        x[d] += unscale[first + k][d] * f64::from(weight) * correction;
                    }
                }
            }
        });
    }
}

/// Calls `work` with working space for the vector entries of any row.
fn with_room<const N: usize>(rows: &Rows<N>, work: impl FnOnce(&mut [f64])) {
    let width = rows.width();
    let mut near = [0.0; NEAR];
    let mut far = Vec::new();
    let room = if width <= NEAR {
        &mut near[..width]
    } else {
        far.resize(width, 0.0);
        &mut far[..]
    };
    Arch::new().dispatch(
        #[inline(always)]
        || work(room),
    );
}
