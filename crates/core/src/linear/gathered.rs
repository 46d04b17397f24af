//! The direct backend for several ranks without a distributed solver: rank 0 gathers and factorises the equations of
//! all ranks.
//!
//! Rank 0 needs memory for the equations of all ranks, but no parallel library is needed.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::backend::{Backend, Layout, Solved, Stiffness};
use super::blocks::{Block, BlockMatrix};
use super::{DirectBackend, LinearError, Numbering};
use crate::ranks::{Halo, Ranks};

/// Solves the equations by a factorisation on rank 0; with a single rank, it works like the direct backend.
pub struct Gathered<const D: usize, const N: usize = D> {
    direct: DirectBackend,
    whole: Whole<D, N>,
}

impl<const D: usize, const N: usize> Default for Gathered<D, N> {
    fn default() -> Self {
        Gathered { direct: DirectBackend::default(), whole: Whole::nothing() }
    }
}

/// The equations of all ranks; empty on every rank except rank 0.
struct Whole<const D: usize, const N: usize> {
    /// Grid nodes, ascending.
    nodes: Vec<u32>,
    lattice: Vec<[u32; D]>,
    numbering: Numbering<N>,
    column_start: Vec<usize>,
    row: Vec<u32>,
    blocks: Vec<Block<N>>,
    symmetric: bool,
    shares: Vec<Share>,
}

/// The indices of the nodes and blocks of a rank among those of all ranks.
#[derive(Default)]
struct Share {
    nodes: Vec<u32>,
    blocks: Vec<usize>,
}

/// The failures of the direct backend, as rank 0 reports them to the other ranks.
#[derive(Serialize, Deserialize)]
enum RootFailure {
    /// Grid node and component of the unknown, if it can be identified.
    Singular(Option<(u32, usize)>),
    Other(LinearError),
}

/// The nodes and couplings of one rank.
#[derive(Serialize, Deserialize)]
struct Part {
    nodes: Vec<u32>,
    lattice: Vec<u32>,
    is_unknown: Vec<bool>,
    column_start: Vec<usize>,
    row: Vec<u32>,
}

impl<const D: usize, const N: usize> Whole<D, N> {
    fn nothing() -> Self {
        Whole {
            nodes: Vec::new(),
            lattice: Vec::new(),
            numbering: Numbering::default(),
            column_start: vec![0],
            row: Vec::new(),
            blocks: Vec::new(),
            symmetric: true,
            shares: Vec::new(),
        }
    }

    fn new(parts: &[Part], symmetric: bool) -> Self {
        let mut nodes: Vec<u32> = parts.iter().flat_map(|part| &part.nodes).copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut lattice = vec![[0; D]; nodes.len()];
        let mut is_unknown = vec![[false; N]; nodes.len()];
        let place = |node: &u32| nodes.partition_point(|other| other < node) as u32;
        let mut shares: Vec<Share> = (parts.iter())
            .map(|part| Share { nodes: part.nodes.iter().map(place).collect(), blocks: Vec::new() })
            .collect();
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for (part, share) in parts.iter().zip(&shares) {
            for (k, &node) in share.nodes.iter().enumerate() {
                lattice[node as usize].copy_from_slice(&part.lattice[k * D..][..D]);
                is_unknown[node as usize].copy_from_slice(&part.is_unknown[k * N..][..N]);
            }
            pairs.extend(part.pairs(&share.nodes));
        }
        pairs.sort_unstable();
        pairs.dedup();
        for (part, share) in parts.iter().zip(&mut shares) {
            let find = |pair| pairs.partition_point(|other| *other < pair);
            share.blocks = part.pairs(&share.nodes).map(find).collect();
        }
        let mut column_start = vec![0; nodes.len() + 1];
        pairs.iter().for_each(|(column, _)| column_start[*column as usize + 1] += 1);
        (0..nodes.len()).for_each(|column| column_start[column + 1] += column_start[column]);
        Whole {
            numbering: Numbering::new(nodes.len(), |node, component| is_unknown[node][component]),
            lattice,
            column_start,
            blocks: vec![[[0.0; N]; N]; pairs.len()],
            row: pairs.into_iter().map(|(_, row)| row).collect(),
            symmetric,
            shares,
            nodes,
        }
    }

    /// Sums the blocks of all ranks, in rank order.
    fn take(&mut self, blocks: &[Vec<u8>]) {
        self.blocks.fill([[0.0; N]; N]);
        for (share, bytes) in self.shares.iter().zip(blocks) {
            let mut values = numbers(bytes);
            for &place in &share.blocks {
                for sum in self.blocks[place].as_flattened_mut() {
                    *sum += values.next().unwrap_or(0.0);
                }
            }
        }
    }

    /// Calls `work` with the equations in the form that the direct backend requires.
    fn with<T>(
        &self,
        lines: [Option<&[f64]>; D],
        work: impl FnOnce(&Layout<D, N>, BlockMatrix<N>) -> T,
    ) -> T {
        let layout = Layout {
            numbering: &self.numbering,
            nodes: &self.nodes,
            lattice: &|node| self.lattice[node],
            // The direct backend needs no positions.
            position: &|node| self.lattice[node].map(f64::from),
            lines,
            halo: &Halo::default(),
        };
        let Whole { symmetric, column_start, row, blocks, .. } = self;
        work(&layout, BlockMatrix { symmetric: *symmetric, column_start, row, blocks })
    }
}

impl Part {
    /// Column and row of each block, given the numbers of the nodes.
    fn pairs<'a>(&'a self, nodes: &'a [u32]) -> impl Iterator<Item = (u32, u32)> + 'a {
        (0..nodes.len()).flat_map(move |column| {
            let rows = &self.row[self.column_start[column]..self.column_start[column + 1]];
            rows.iter().map(move |row| (nodes[column], nodes[*row as usize]))
        })
    }
}

fn bytes<'a>(numbers: impl Iterator<Item = &'a f64>) -> Vec<u8> {
    numbers.flat_map(|number| number.to_ne_bytes()).collect()
}

fn numbers(bytes: &[u8]) -> impl Iterator<Item = f64> {
    let number = |bytes: &[u8]| f64::from_ne_bytes(bytes.try_into().unwrap_or_default());
    bytes.chunks_exact(size_of::<f64>()).map(number)
}

impl<const D: usize, const N: usize> Gathered<D, N> {
    /// Passes the outcome of rank 0 to all ranks; an unknown in an error is converted to its index on the receiving
    /// rank.
    fn share<T: Serialize + DeserializeOwned>(
        &self,
        layout: &Layout<D, N>,
        outcome: Option<Result<T, LinearError>>,
    ) -> Result<T, LinearError> {
        let shared = outcome.map(|outcome| {
            outcome.map_err(|error| match error {
                LinearError::Singular { unknown } => {
                    RootFailure::Singular(unknown.and_then(|u| self.place_of(u)))
                }
                other => RootFailure::Other(other),
            })
        });
        let outcome = layout.halo.ranks().first(shared).unwrap_or(Err(RootFailure::Singular(None)));
        outcome.map_err(|failure| match failure {
            RootFailure::Singular(place) => {
                let own = place.and_then(|(node, component)| {
                    let node = layout.nodes.binary_search(&node).ok()?;
                    layout.numbering.unknown(node, component)
                });
                LinearError::Singular { unknown: own }
            }
            RootFailure::Other(error) => error,
        })
    }

    /// Grid node and component of an unknown of the gathered equations.
    fn place_of(&self, unknown: usize) -> Option<(u32, usize)> {
        let mut place = None;
        self.whole.numbering.for_each(|node, component, number| {
            if number == Some(unknown) {
                place = Some((self.whole.nodes[node], component));
            }
        });
        place
    }

    /// The nodes and couplings of this rank.
    fn part(layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Part {
        let n = layout.numbering.n_nodes();
        let mut is_unknown = Vec::with_capacity(N * n);
        layout.numbering.for_each(|_, _, unknown| is_unknown.push(unknown.is_some()));
        Part {
            nodes: layout.nodes.to_vec(),
            lattice: (0..n).flat_map(|node| (layout.lattice)(node)).collect(),
            is_unknown,
            column_start: matrix.column_start.to_vec(),
            row: matrix.row.to_vec(),
        }
    }

    /// Sends each rank its part of the solution.
    fn scatter(&self, ranks: &Ranks, x: Option<&[[f64; N]]>, own: &mut [[f64; N]]) {
        let Some(communicator) = ranks.communicator() else { return };
        let messages = x.map_or_else(Vec::new, |x| {
            let values = |share: &Share| bytes(share.nodes.iter().flat_map(|node| &x[*node as usize]));
            self.whole.shares.iter().map(values).enumerate().collect()
        });
        for (_, message) in communicator.exchange(messages) {
            for (value, number) in own.as_flattened_mut().iter_mut().zip(numbers(&message)) {
                *value = number;
            }
        }
    }
}

impl<const D: usize, const N: usize> Backend<D, N> for Gathered<D, N> {
    fn prepare(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let ranks = layout.halo.ranks();
        if ranks.is_alone() {
            return self.direct.prepare(layout, matrix);
        }
        let parts = ranks.gather(Self::part(layout, matrix));
        self.whole = Whole::nothing();
        let outcome = ranks.is_root().then(|| {
            self.whole = Whole::new(&parts, matrix.symmetric);
            let Gathered { direct, whole } = self;
            whole.with(layout.lines, |layout, matrix| direct.prepare(layout, &matrix))
        });
        self.share(layout, outcome)
    }

    fn factorise(&mut self, layout: &Layout<D, N>, matrix: &BlockMatrix<N>) -> Result<(), LinearError> {
        let ranks = layout.halo.ranks();
        let Some(communicator) = ranks.communicator() else {
            return self.direct.factorise(layout, matrix);
        };
        let blocks = communicator.gather(&bytes(matrix.blocks.as_flattened().as_flattened().iter()));
        let outcome = ranks.is_root().then(|| {
            let Gathered { direct, whole } = self;
            whole.take(&blocks);
            whole.with(layout.lines, |layout, matrix| direct.factorise(layout, &matrix))
        });
        self.share(layout, outcome)
    }

    fn solve(
        &mut self,
        layout: &Layout<D, N>,
        stiffness: &mut Stiffness<N>,
        b: &[[f64; N]],
        x: &mut [[f64; N]],
        tolerance: f64,
    ) -> Result<Solved, LinearError> {
        let ranks = layout.halo.ranks();
        let Some(communicator) = ranks.communicator() else {
            return self.direct.solve(layout, stiffness, b, x, tolerance);
        };
        let sides = communicator.gather(&bytes(b.as_flattened().iter()));
        let mut solution = vec![[0.0; N]; self.whole.nodes.len()];
        let outcome = ranks.is_root().then(|| {
            let Gathered { direct, whole } = self;
            let mut rhs = vec![[0.0; N]; whole.nodes.len()];
            for (share, bytes) in whole.shares.iter().zip(&sides) {
                let mut values = numbers(bytes);
                for &node in &share.nodes {
                    rhs[node as usize].fill_with(|| values.next().unwrap_or(0.0));
                }
            }
            whole.with(layout.lines, |layout, matrix| {
                let division = &mut super::Division::new(matrix.column_start, matrix.row);
                let mut stiffness = Stiffness { matrix, division };
                direct.solve(layout, &mut stiffness, &rhs, &mut solution, tolerance)
            })
        });
        let solved = self.share(layout, outcome)?;
        self.scatter(ranks, ranks.is_root().then_some(&solution[..]), x);
        Ok(solved)
    }

    fn is_iterative(&self) -> bool {
        false
    }
}
