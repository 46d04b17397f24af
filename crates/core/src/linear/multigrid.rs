//! Geometric multigrid on the active nodes of a structured grid: one symmetric cycle as an approximate inverse.
//!
//! Each coarser level is the lattice of every other line of the finer level, with only those nodes from which finer
//! nodes are interpolated. Its matrix is the Galerkin product of the finer matrix, so that a cell that a body hardly
//! fills has its true stiffness on every level. Block Gauss–Seidel sweeps over the colours smooth the error, forwards
//! before and backwards after the coarser levels; the coarsest level is solved directly.
//!
//! Ranks share each level. The nodes of a rank, whose rows it stores, come first, followed by its ghosts: the nodes of
//! other ranks to which its rows or its finer nodes refer. The operations are the same as on one rank.

mod coarse_owners;
mod coarsest;
mod contributions;
mod ghosts;
mod level;
mod rows;
mod shared;
mod shared_level;
mod smoother;
mod stencil;

use crate::ranks::Halo;

use super::LinearError;
use super::blocks::BlockMatrix;
use super::lattice::{Lattice, LatticeLines, Transfer};

use coarsest::Coarsest;
use level::Level;
use shared::Input;

/// A level of at most this number of nodes is solved directly.
const COARSEST: usize = 300;

/// A coarser level with more than this fraction of the nodes of the finer level is not worthwhile, [-].
const WORTH: f64 = 0.7;

/// The hierarchy for one pattern, with the values of one matrix.
#[derive(Default)]
pub(super) struct Multigrid<const D: usize, const N: usize> {
    levels: Vec<Level<D, N>>,
    /// Transfers from each level to the next.
    transfers: Vec<Transfer>,
    /// Number of nodes of each level, over all ranks.
    counts: Vec<usize>,
    coarsest: Coarsest,
    /// The input for which the levels are laid out, if there are several ranks.
    input: Option<Input<D, N>>,
}

impl<const D: usize, const N: usize> Multigrid<D, N> {
    /// Lays out the levels for a matrix on nodes at these lattice positions, some of whose degrees of freedom are held;
    /// returns true if there was anything to do.
    pub(super) fn analyse(
        &mut self,
        matrix: &BlockMatrix<N>,
        places: Vec<[u32; D]>,
        lines: [LatticeLines; D],
        held: Vec<[bool; N]>,
        halo: &Halo,
    ) -> Result<bool, LinearError> {
        let ranks = halo.ranks();
        let mut input = None;
        let mut level = if ranks.is_alone() {
            let reach = matrix.reach(|node| places[node]);
            let lattice = Lattice::new(places, reach, lines);
            if self.levels.first().is_some_and(|finest| finest.is_of(&lattice, matrix, &held)) {
                return Ok(false);
            }
            *self = Multigrid::default(); // frees the memory before more is allocated
            Level::finest(lattice, matrix, held)
        } else {
            let given = Input::new(matrix, places, lines, held, halo);
            if ranks.all(self.input.as_ref() == Some(&given)) {
                return Ok(false);
            }
            *self = Multigrid::default();
            Level::finest_shared(ranks, matrix, input.insert(given))
        };
        let mut count = level.count();
        while count > COARSEST {
            let (coarser, transfer) = level.coarser();
            let fewer = coarser.count();
            if fewer as f64 > WORTH * count as f64 {
                break;
            }
            self.levels.push(std::mem::replace(&mut level, coarser));
            self.transfers.push(transfer);
            self.counts.push(std::mem::replace(&mut count, fewer));
        }
        if let Err(error) = self.coarsest.analyse(&level) {
            *self = Multigrid::default();
            return Err(error);
        }
        self.levels.push(level);
        self.counts.push(count);
        self.input = input;
        Ok(true)
    }

    /// Uses the values of a matrix; returns false if the matrix is found not to be positive definite.
    ///
    /// # Errors
    /// [`LinearError::Singular`] if a free degree of freedom has no stiffness; errors of the factorisation on the
    /// coarsest level.
    pub(super) fn factorise(&mut self, matrix: &BlockMatrix<N>) -> Result<bool, LinearError> {
        let Multigrid { levels, transfers, coarsest, .. } = self;
        let Some(finest) = levels.first_mut() else { return Ok(true) };
        let positive = finest.take(matrix)?;
        for (k, transfer) in transfers.iter().enumerate() {
            let (fine, coarse) = levels.split_at_mut(k + 1);
            coarse[0].take_product(&fine[k], transfer);
        }
        let Some(last) = levels.last() else { return Ok(positive) };
        Ok(coarsest.factorise(last)? && positive)
    }

    /// Replaces `z` by an approximation of A⁻¹ r; both are complete fields on the active nodes.
    pub(super) fn precondition(&mut self, r: &[[f64; N]], z: &mut [[f64; N]]) -> Result<(), LinearError> {
        let Some(finest) = self.levels.first_mut() else { return Ok(()) };
        let Level { scale, b, shared, rows, .. } = finest;
        if let Some(shared) = shared {
            for (n, b) in b[..rows.len()].iter_mut().enumerate() {
                let active = shared.active[n] as usize;
                *b = std::array::from_fn(|d| scale[n][d] * r[active][d]);
            }
        } else {
            for (n, b) in b.iter_mut().enumerate() {
                *b = std::array::from_fn(|d| scale[n][d] * r[n][d]);
            }
        }
        cycle(&mut self.levels, &self.transfers, &mut self.coarsest)?;
        let Level { scale, x, shared, .. } = &self.levels[0];
        if let Some(shared) = shared {
            for (n, active) in shared.active.iter().enumerate() {
                z[*active as usize] = std::array::from_fn(|d| scale[n][d] * x[n][d]);
            }
        } else {
            for (n, z) in z.iter_mut().enumerate() {
                *z = std::array::from_fn(|d| scale[n][d] * x[n][d]);
            }
        }
        Ok(())
    }

    /// Number of nodes of each level, over all ranks.
    pub(super) fn sizes(&self) -> &[usize] {
        &self.counts
    }

    /// Numbers of own nodes and of ghosts that this rank stores on each level.
    pub(super) fn sizes_here(&self) -> Vec<[usize; 2]> {
        let rows_and_ghosts =
            |level: &Level<D, N>| [level.rows.len(), level.lattice.len() - level.rows.len()];
        self.levels.iter().map(rows_and_ghosts).collect()
    }
}

/// One V-cycle from the first of the levels on, for the right-hand side stored in that level.
fn cycle<const D: usize, const N: usize>(
    levels: &mut [Level<D, N>],
    transfers: &[Transfer],
    coarsest: &mut Coarsest,
) -> Result<(), LinearError> {
    let Some((fine, coarser)) = levels.split_first_mut() else { return Ok(()) };
    let (Some((transfer, above)), Some(_)) = (transfers.split_first(), coarser.first()) else {
        return coarsest.solve(fine);
    };
    fine.sweep(true, true);
    fine.restrict(transfer, &mut coarser[0]);
    cycle(coarser, above, coarsest)?;
    fine.prolong(transfer, &coarser[0]);
    fine.sweep(false, false);
    Ok(())
}
