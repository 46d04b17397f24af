//! The direct backend of a run on several ranks: that of the core for most systems, MUMPS for large ones.

use mpm_core::linear::{Backend, BlockMatrix, Divided, Layout, LinearError, Solved, Stiffness};

use crate::direct::Direct;

/// Most unknowns whose equations rank 0 factorises alone. Its factorisation takes less time than that of MUMPS on two ranks, and
/// repeats its bits.
pub const MOST_GATHERED: f64 = 2e5;

/// Factorises on rank 0 or, if there are many unknowns, by MUMPS on all ranks.
pub struct ByExtent<const D: usize, const N: usize = D> {
    divided: Divided<D, N>,
    /// `None` where PETSc has no MUMPS.
    mumps: Option<Direct<N>>,
    is_large: bool,
}

impl<const D: usize, const N: usize> ByExtent<D, N> {
    /// A backend; without MUMPS, all systems are factorised on rank 0.
    pub fn new() -> Self {
        ByExtent { divided: Divided::default(), mumps: None, is_large: false }
    }
}

impl<const D: usize, const N: usize> Default for ByExtent<D, N> {
    fn default() -> Self {
        ByExtent::new()
    }
}

impl<const D: usize, const N: usize> Backend<D, N> for ByExtent<D, N> {
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let (halo, n) = (layout.halo, layout.numbering.n_nodes());
        self.is_large = N as f64 * halo.sum_over_nodes(n, |_| 1.0) > MOST_GATHERED;
        if self.is_large && self.mumps.is_none() {
            self.mumps = Direct::new().ok();
        }
        match &mut self.mumps {
            Some(mumps) if self.is_large => {
                self.divided = Divided::default();
                mumps.prepare(layout, matrix)
            }
            _ => self.divided.prepare(layout, matrix),
        }
    }

    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        match &mut self.mumps {
            Some(mumps) if self.is_large => mumps.factorise(layout, matrix),
            _ => self.divided.factorise(layout, matrix),
        }
    }

    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        match &mut self.mumps {
            Some(mumps) if self.is_large => mumps.solve(layout, stiffness, b, x, tolerance),
            _ => self.divided.solve(layout, stiffness, b, x, tolerance),
        }
    }

    fn is_iterative(&self) -> bool {
        false
    }
}
