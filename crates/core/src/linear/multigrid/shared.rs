//! Levels that several ranks share: each rank has the rows of its own nodes, and copies of the data that it needs from
//! other ranks.

use pulp::Arch;
use rayon::prelude::*;

use crate::linear::LinearError;
use crate::linear::blocks::{Block, BlockMatrix};
use crate::linear::lattice::{Lattice, LatticeLines, Transfer};
use crate::linear::reduction::agree;
use crate::ranks::{Halo, Ranks};

use super::coarse_owners::{Claim, coarse_owners};
use super::contributions::{Contributions, RowColumns};
use super::ghosts::{Ghosts, Register};
use super::level::{Level, block_of, diagonal_of, own_entries, whole_rows};
use super::rows::Rows;
use super::shared_level::Shared;
use super::stencil::Stencil;

/// The input of an analysis; the analysis need not be repeated for the same input.
#[derive(PartialEq)]
pub(super) struct Input<const D: usize, const N: usize> {
    places: Vec<[u32; D]>,
    lines: [LatticeLines; D],
    held: Vec<[bool; N]>,
    column_start: Vec<usize>,
    row: Vec<u32>,
    owner: Vec<u32>,
}

impl<const D: usize, const N: usize> Input<D, N> {
    pub(super) fn new(
        matrix: &BlockMatrix<N>,
        places: Vec<[u32; D]>,
        lines: [LatticeLines; D],
        held: Vec<[bool; N]>,
        halo: &Halo,
    ) -> Self {
        Input {
            column_start: matrix.column_start.to_vec(),
            row: matrix.row.to_vec(),
            owner: (0..places.len()).map(|node| halo.owner(node) as u32).collect(),
            places,
            lines,
            held,
        }
    }
}

impl<const D: usize, const N: usize> Level<D, N> {
    /// The finest level, whose matrix is the sum of the matrices of all ranks on their active nodes.
    pub(super) fn finest_shared(ranks: &Ranks, matrix: &BlockMatrix<N>, input: &Input<D, N>) -> Self {
        let places = input.places.clone();
        let reach = matrix.reach(|node| places[node]);
        let mut lattice = Lattice::shared(ranks, places, reach, input.lines.clone());
        let own_rank = ranks.own() as u32;
        let key = |node: usize| lattice.key(lattice.place[node]);
        let (own, mut others): (Vec<usize>, Vec<usize>) =
            (0..lattice.len()).partition(|node| input.owner[*node] == own_rank);
        others.sort_unstable_by_key(|node| key(*node));
        let nodes: Vec<(u64, u32)> =
            own.iter().chain(&others).map(|node| (key(*node), input.owner[*node])).collect();
        let register = Register::new(ranks.own(), &nodes);
        let held = own.iter().map(|node| input.held[*node]).collect();
        let active: Vec<u32> = own.iter().chain(&others).map(|node| *node as u32).collect();
        let mut place = vec![0; active.len()];
        active.iter().zip(0..).for_each(|(node, k)| place[*node as usize] = k);
        let RowColumns { start, column } = whole_rows(matrix);
        let mut rows = RowColumns { start: vec![0], column: Vec::with_capacity(column.len()) };
        for &node in &active {
            let columns = &column[start[node as usize]..start[node as usize + 1]];
            rows.column.extend(columns.iter().map(|other| place[*other as usize]));
            rows.start.push(rows.column.len());
        }
        lattice.place = active.iter().map(|node| lattice.place[*node as usize]).collect();
        Level::shared(ranks, lattice, held, register, &rows, active)
    }

    /// A level of which this rank knows some nodes; `rows` lists the columns that this rank contributes to the rows of
    /// these nodes.
    fn shared(
        ranks: &Ranks,
        mut lattice: Lattice<D>,
        held: Vec<[bool; N]>,
        mut register: Register,
        rows: &RowColumns,
        active: Vec<u32>,
    ) -> Self {
        let (contributions, RowColumns { start, column }) = Contributions::new(ranks, &mut register, rows);
        let more: Vec<[u32; D]> =
            register.known.key[lattice.len()..].iter().map(|key| lattice.place_of(*key)).collect();
        lattice.place.extend(more);
        let colour = |node: usize| lattice.colour(lattice.place[node]);
        let ghosts = Ghosts::new(ranks, &register, lattice.n_colours(), colour);
        let shared = Shared { known: register.known, ghosts, contributions, active };
        Level::new(lattice, Rows::new(start, column), held, Some(shared))
    }

    /// The next coarser level.
    pub(super) fn coarser_shared(&self, shared: &Shared) -> (Level<D, N>, Transfer) {
        let ranks = &shared.ghosts.ranks;
        let mut lattice = self.lattice.above();
        let own = self.rows.len();
        let mut claims = Vec::new();
        for (n, place) in self.lattice.place.iter().enumerate() {
            self.lattice.for_each_parent(place, |parent, _| {
                let claim = match (n < own, parent.map(|p| 2 * p) == *place) {
                    (false, _) => Claim::Ghost,
                    (true, false) => Claim::Child,
                    (true, true) => Claim::Same,
                };
                claims.push((lattice.key(parent), claim));
            });
        }
        // Only the strongest claim on each node counts.
        claims.sort_unstable_by_key(|(key, claim)| (*key, std::cmp::Reverse(*claim)));
        claims.dedup_by_key(|(key, _)| *key);
        let owners = coarse_owners(ranks, &claims, lattice.places());
        let nodes: Vec<(u64, u32)> = claims.iter().map(|(key, _)| *key).zip(owners).collect();
        let register = Register::new(ranks.own(), &nodes);
        let Register { known, find } = &register;
        lattice.place = known.key.iter().map(|key| lattice.place_of(*key)).collect();
        let mut transfer = Transfer::new(&self.lattice, own, known.len(), |place| find[&lattice.key(place)]);
        let mut held = vec![[false; N]; known.own];
        for (n, held) in held.iter_mut().enumerate() {
            // A node at the position of a held fine node is held in the same way.
            for &(child, _) in transfer.children(n).iter().filter(|(_, weight)| *weight == 1.0) {
                *held = self.held[child as usize];
            }
        }
        let rows = self.columns_above(&lattice, &transfer);
        let level = Level::shared(ranks, lattice, held, register, &rows, Vec::new());
        transfer.extend(level.lattice.len());
        (level, transfer)
    }

    /// The columns that the rows of this level on this rank contribute to each row of Tᵀ A T.
    fn columns_above(&self, lattice: &Lattice<D>, transfer: &Transfer) -> RowColumns {
        let stencil = Stencil::new(lattice);
        let columns = |is_seen: &mut Vec<bool>, row: usize| {
            let mut columns = Vec::new();
            for &(child, _) in transfer.children(row) {
                for &column in self.rows.columns(child as usize) {
                    for &(parent, _) in transfer.parents(column as usize) {
                        if !std::mem::replace(&mut is_seen[stencil.place(row, parent as usize)], true) {
                            columns.push(parent);
                        }
                    }
                }
            }
            columns.iter().for_each(|parent| is_seen[stencil.place(row, *parent as usize)] = false);
            columns
        };
        let by_row: Vec<Vec<u32>> =
            (0..lattice.len()).into_par_iter().map_init(|| vec![false; stencil.len], columns).collect();
        let mut start = vec![0];
        by_row.iter().for_each(|columns| start.push(start[start.len() - 1] + columns.len()));
        RowColumns { start, column: by_row.into_iter().flatten().collect() }
    }

    /// Copies the values of the matrix, which is distributed over the ranks.
    ///
    /// # Errors
    /// [`LinearError::Singular`] on all ranks if a free degree of freedom on any rank has no stiffness.
    pub(super) fn take_shared(
        &mut self,
        shared: &Shared,
        matrix: &BlockMatrix<N>,
    ) -> Result<bool, LinearError> {
        let ranks = &shared.ghosts.ranks;
        let active = &shared.active;
        let mut diagonal = vec![[0.0; N]; self.lattice.len()];
        for (diagonal, node) in diagonal.iter_mut().zip(active) {
            *diagonal = diagonal_of(matrix, *node as usize);
        }
        shared.contributions.rows.add(ranks, &mut diagonal);
        let positive = self.scale_by(|n| diagonal[n]);
        let positive = agree(ranks, positive)?;
        self.fill_shared(shared, &|row, columns, blocks| {
            for (block, &column) in blocks.iter_mut().zip(columns) {
                let Some(&column) = active.get(column as usize) else { continue };
                *block = block_of(matrix, active[row], column).unwrap_or(*block);
            }
        });
        Ok(ranks.all(positive))
    }

    /// Computes the values of the Galerkin product, to which each rank contributes the part of its finer nodes.
    pub(super) fn take_shared_product(&mut self, shared: &Shared, fine: &Level<D, N>, transfer: &Transfer) {
        let stencil = Stencil::new(&self.lattice);
        self.fill_shared(shared, &|row, columns, blocks| {
            let mut sum = vec![[[0.0; N]; N]; stencil.len];
            Arch::new().dispatch(
                #[inline(always)]
                || stencil.product(&fine.rows, &fine.unscale, transfer, row, &mut sum),
            );
            for (block, &column) in blocks.iter_mut().zip(columns) {
                *block = sum[stencil.place(row, column as usize)];
            }
        });
    }

    /// Fills the rows with the sum of the parts of all ranks, scaled; `part(row, columns, blocks)` writes the part of
    /// this rank into blocks initialised to zero.
    fn fill_shared(&mut self, shared: &Shared, part: &(impl Fn(usize, &[u32], &mut [Block<N>]) + Sync)) {
        let Shared { ghosts, contributions, .. } = shared;
        ghosts.renew(&mut self.scale);
        ghosts.renew(&mut self.unscale);
        let received = contributions.pass(&ghosts.ranks, part);
        let scale = &self.scale;
        self.rows.fill(&|piece| {
            let mut blocks = Vec::new();
            piece.for_each(|row, columns, values| {
                blocks.clear();
                blocks.resize(columns.len(), [[0.0; N]; N]);
                part(row, columns, &mut blocks);
                contributions.add(&received, row, &mut blocks);
                let width = values.len() / N;
                for (k, (block, &column)) in blocks.iter().zip(columns).enumerate() {
                    for i in 0..N {
                        for j in 0..N {
                            let scaled = block[i][j] * scale[row][i] * scale[column as usize][j];
                            values[i * width + k * N + j] = scaled as f32;
                        }
                    }
                }
                own_entries(row, columns, &scale[row], values);
            });
        });
        self.invert();
    }

    /// Number of nodes of the level on all ranks together.
    pub(super) fn count(&self) -> usize {
        match &self.shared {
            None => self.lattice.len(),
            Some(shared) => shared.ghosts.ranks.count_all(self.rows.len()),
        }
    }
}
