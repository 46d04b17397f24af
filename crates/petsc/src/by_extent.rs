//! The direct backend of a run on several ranks: the core's own for most systems, MUMPS for large systems on many
//! ranks.

use mpm_core::linear::{Backend, BlockMatrix, Divided, Layout, LinearError, Solved, Stiffness};

use crate::direct::Direct;

/// Number of unknowns above which MUMPS factorises the systems of three-dimensional problems on more than
/// [`MAX_RANKS`] ranks; prescribed components are counted, too. In the core's factorisation, a single rank eliminates
/// the last separator, which takes a growing share of the time. MUMPS takes longer on few ranks, and its results are
/// not bitwise reproducible.
pub const MAX_UNKNOWNS: f64 = 2e5;

/// Largest number of ranks that factorise such systems without MUMPS.
pub const MAX_RANKS: usize = 4;

/// Factorises with the divided backend of the core, or with MUMPS for large problems in three dimensions on many ranks.
pub struct ByExtent<const D: usize, const N: usize = D> {
    divided: Divided<D, N>,
    /// `None` while the core factorises.
    mumps: Option<Direct<N>>,
    uses_mumps: bool,
}

impl<const D: usize, const N: usize> ByExtent<D, N> {
    /// A backend; if PETSc has no MUMPS, the core factorises all systems.
    pub fn new() -> Self {
        ByExtent { divided: Divided::default(), mumps: None, uses_mumps: false }
    }

    fn backend(&mut self) -> &mut dyn Backend<D, N> {
        match &mut self.mumps {
            Some(mumps) if self.uses_mumps => mumps,
            _ => &mut self.divided,
        }
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
        let unknowns = N as f64 * halo.sum_over_nodes(n, |_| 1.0);
        let is_large = D > 2 && unknowns > MAX_UNKNOWNS && halo.ranks().count() > MAX_RANKS;
        if is_large && self.mumps.is_none() {
            self.mumps = Direct::new().ok();
        }
        self.uses_mumps = is_large && self.mumps.is_some();
        if self.uses_mumps {
            self.divided = Divided::default();
        } else {
            self.mumps = None;
        }
        self.backend().prepare(layout, matrix)
    }

    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        self.backend().factorise(layout, matrix)
    }

    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        self.backend().solve(layout, stiffness, b, x, tolerance)
    }

    fn release(&mut self) {
        self.divided = Divided::default();
        self.mumps = None;
    }

    fn is_iterative(&self) -> bool {
        false
    }
}
