//! Geometric multigrid on the active nodes of a structured grid: one symmetric cycle as an approximate inverse.
//!
//! Coarser levels are lattices of every other line, with the nodes from which active ones are interpolated. Their
//! matrices are the Galerkin products of the finer ones, so a cell that a body hardly fills has its true stiffness on
//! every level. Block Gauss–Seidel sweeps over colours, forwards before and backwards after the coarser levels, smooth
//! the error; the coarsest level is solved directly.

mod level;
mod rows;

use super::blocks::BlockMatrix;
use super::lattice::{Lattice, LatticeLines, Transfer};
use super::{Direct, LinearError, LinearSolver, Pattern, ordering};

use level::Level;

/// A level of at most this number of nodes is solved directly.
const COARSEST: usize = 300;

/// A coarser level with more than this fraction of the nodes does not pay off, [-].
const WORTH: f64 = 0.7;

/// The hierarchy for one pattern, with the values of one matrix.
#[derive(Default)]
pub(super) struct Multigrid<const D: usize, const N: usize> {
    levels: Vec<Level<D, N>>,
    /// From each level to the next.
    transfers: Vec<Transfer>,
    coarsest: Direct,
    values: Vec<f64>,
}

impl<const D: usize, const N: usize> Multigrid<D, N> {
    /// Lays out the levels for a matrix on nodes at these places between the lines of a lattice, some of whose degrees of
    /// freedom are held; returns whether there was anything to do.
    pub(super) fn analyse(
        &mut self,
        matrix: &BlockMatrix<N>,
        (places, lines): (Vec<[u32; D]>, [LatticeLines; D]),
        held: Vec<[bool; N]>,
    ) -> Result<bool, LinearError> {
        let reach = matrix.reach(|node| places[node]);
        let lattice = Lattice::new(places, reach, lines);
        if self.levels.first().is_some_and(|finest| finest.is_of(&lattice, matrix, &held)) {
            return Ok(false);
        }
        *self = Multigrid::default(); // frees the memory before more is allocated
        let mut level = Level::finest(lattice, matrix, held);
        while level.lattice.len() > COARSEST {
            let (coarser, transfer) = level.coarser();
            if coarser.lattice.len() as f64 > WORTH * level.lattice.len() as f64 {
                break;
            }
            self.levels.push(std::mem::replace(&mut level, coarser));
            self.transfers.push(transfer);
        }
        let order = || {
            let nodes = ordering::nested_dissection(&level.lattice.place, level.lattice.reach);
            nodes.iter().flat_map(|&node| (0..N).map(move |d| N * node + d)).collect()
        };
        self.coarsest.analyse(lower_triangle(&level), &order)?;
        self.levels.push(level);
        Ok(true)
    }

    /// Takes the values of a matrix; returns whether nothing here shows that it is not positive definite.
    ///
    /// # Errors
    /// [`LinearError::Singular`] where a free degree of freedom, or the coarsest level, has no stiffness.
    pub(super) fn factorise(&mut self, matrix: &BlockMatrix<N>) -> Result<bool, LinearError> {
        let Multigrid { levels, transfers, coarsest, values } = self;
        let positive = levels[0].take(matrix)?;
        for (k, transfer) in transfers.iter().enumerate() {
            let (fine, coarse) = levels.split_at_mut(k + 1);
            coarse[0].take_product(&fine[k], transfer);
        }
        let Some(last) = levels.last() else { return Ok(positive) };
        values.clear();
        for_each_entry(last, |row, place, i, k| {
            values.push(f64::from(last.rows.component(row, i)[place * N + k]));
        });
        Ok(coarsest.factorise(values)?.is_definite() && positive)
    }

    /// Replaces `z` by an approximation of A⁻¹ r.
    pub(super) fn precondition(&mut self, r: &[[f64; N]], z: &mut [[f64; N]]) -> Result<(), LinearError> {
        let Some(finest) = self.levels.first_mut() else { return Ok(()) };
        let Level { scale, b, .. } = finest;
        for (n, b) in b.iter_mut().enumerate() {
            *b = std::array::from_fn(|d| scale[n][d] * r[n][d]);
        }
        cycle(&mut self.levels, &self.transfers, &mut self.coarsest)?;
        let Level { scale, x, .. } = &self.levels[0];
        for (n, z) in z.iter_mut().enumerate() {
            *z = std::array::from_fn(|d| scale[n][d] * x[n][d]);
        }
        Ok(())
    }

    /// Number of nodes of each level.
    pub(super) fn sizes(&self) -> Vec<usize> {
        self.levels.iter().map(|level| level.lattice.len()).collect()
    }
}

/// One V-cycle from the first of the levels on, with the right-hand side there.
fn cycle<const D: usize, const N: usize>(
    levels: &mut [Level<D, N>],
    transfers: &[Transfer],
    coarsest: &mut Direct,
) -> Result<(), LinearError> {
    let Some((fine, coarser)) = levels.split_first_mut() else { return Ok(()) };
    let (Some((transfer, above)), Some(_)) = (transfers.split_first(), coarser.first()) else {
        fine.x.copy_from_slice(&fine.b);
        return coarsest.solve(fine.x.as_flattened_mut());
    };
    fine.sweep(true, true);
    fine.restrict(transfer, &mut coarser[0]);
    cycle(coarser, above, coarsest)?;
    fine.prolong(transfer, &coarser[0]);
    fine.sweep(false, false);
    Ok(())
}

/// Calls `visit(row, place of the column in it, i, k)` for the entries of the lower triangle of a level, by columns;
/// as the matrix is symmetric, row and column have changed places.
fn for_each_entry<const D: usize, const N: usize>(
    level: &Level<D, N>,
    mut visit: impl FnMut(usize, usize, usize, usize),
) {
    for node in 0..level.rows.len() {
        for i in 0..N {
            for (place, &other) in level.rows.columns(node).iter().enumerate() {
                let first = match (other as usize).cmp(&node) {
                    std::cmp::Ordering::Less => continue,
                    std::cmp::Ordering::Equal => i,
                    std::cmp::Ordering::Greater => 0,
                };
                for k in first..N {
                    visit(node, place, i, k);
                }
            }
        }
    }
}

fn lower_triangle<const D: usize, const N: usize>(level: &Level<D, N>) -> Pattern {
    let n = N * level.rows.len();
    let mut pattern = Pattern { n, column_start: vec![0; n + 1], row: Vec::new(), symmetric: true };
    for_each_entry(level, |node, place, i, k| {
        pattern.row.push(N * level.rows.columns(node)[place] as usize + k);
        pattern.column_start[N * node + i + 1] = pattern.row.len();
    });
    pattern
}
