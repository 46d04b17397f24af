//! The stiffness and the forces of the active grid, to which the terms of equilibrium add: eqs. (19)-(23), (27)-(29).
//!
//! The pattern is laid out once per step: nodes that share a group of points, and those that terms couple beyond that. Terms
//! add in a fixed order, so that the result has the same bits for any number of threads.

mod group;
mod pattern;

use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::linear::{Block, BlockMatrix, Division};
use crate::step::Nodal;

pub(crate) use group::{Cell, Dense, Forces, Square, Triangle, Whole};
pub use pattern::FreeEntries;
pub(crate) use pattern::{Couples, NodePairs, UNCOUPLED};

/// What an evaluation is to form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// Forces and stiffness.
    Stiffness,
    /// The forces, with the same bits; the stiffness stays that of the evaluation before.
    Force,
}

/// The discrete equilibrium of one load step: its pattern, and what the terms have added in the last evaluation.
pub struct System<const D: usize> {
    pub(crate) pairs: NodePairs,
    pub(crate) blocks: Vec<Block<D>>,
    division: Division<D>,
    /// Force of the bodies on the active nodes, eq. (23), and of what is added to them, [force].
    pub(crate) internal: Nodal<D>,
    /// External force on the active nodes, eq. (29), [force].
    pub(crate) external: Nodal<D>,
    /// The change of the external force with the load factor, where that follows from equilibrium, [force].
    pub(crate) per_factor: Option<Nodal<D>>,
}

impl<const D: usize> System<D> {
    /// Lays out the system of a load step. `couples` gives the nodes that are coupled beside those of groups of
    /// points.
    pub(crate) fn new(links: &Connectivity<D>, symmetric: bool, couples: &Couples) -> Self {
        let pairs = NodePairs::new(links, symmetric, couples);
        let zero = vec![[0.0; D]; links.n_active()];
        System {
            blocks: vec![[[0.0; D]; D]; pairs.n_pairs()],
            division: pairs.division(),
            internal: zero.clone(),
            external: zero,
            per_factor: None,
            pairs,
        }
    }

    /// Whether the stiffness is symmetric, so that only blocks with row ≥ column are kept.
    pub fn is_symmetric(&self) -> bool {
        self.pairs.symmetric()
    }

    /// The place of the block of two coupled active nodes, by which [`System::add_block`] takes it; `None` where they are not
    /// coupled, and for row < column of a symmetric system.
    pub fn place(&self, row: usize, column: usize) -> Option<usize> {
        self.pairs.place_of(row as u32, column as u32)
    }

    /// Adds to the block of a place, `[i][k]`, [force/length].
    pub fn add_block(&mut self, place: usize, block: &[[f64; D]; D]) {
        add(&mut self.blocks[place], block);
    }

    /// Forgets what the terms have added.
    pub(crate) fn clear(&mut self, wanted: Wanted) {
        if wanted == Wanted::Stiffness {
            self.blocks.fill([[0.0; D]; D]);
        }
        self.internal.fill([0.0; D]);
        self.external.fill([0.0; D]);
        self.per_factor = None;
    }

    /// Frees what only further evaluations would need.
    pub(crate) fn conclude(&mut self) {
        self.blocks = Vec::new();
    }

    /// Internal force on the active nodes, [force].
    pub fn internal_force(&self) -> &[[f64; D]] {
        &self.internal
    }

    /// The same, to add to.
    pub fn internal_force_mut(&mut self) -> &mut [[f64; D]] {
        &mut self.internal
    }

    /// External force on the active nodes, [force].
    pub fn external_force(&self) -> &Nodal<D> {
        &self.external
    }

    /// The same, to add to.
    pub fn external_force_mut(&mut self) -> &mut [[f64; D]] {
        &mut self.external
    }

    /// Adds to the change of the external force with the load factor, which follows from equilibrium, [force].
    pub fn add_per_factor(&mut self, force: &[[f64; D]]) {
        add(self.per_factor.get_or_insert_with(|| vec![[0.0; D]; force.len()]), force);
    }

    /// The change of the external force with the load factor, where that follows from equilibrium, [force].
    pub fn per_factor(&self) -> Option<&Nodal<D>> {
        self.per_factor.as_ref()
    }

    /// The entries of K on the free degrees of freedom: the pattern for the linear solver.
    pub fn free_entries(&self, dofs: &DofMap<D>) -> FreeEntries {
        self.pairs.free_entries(dofs)
    }

    /// The values of these entries, in their order.
    pub fn free_values(&self, entries: &FreeEntries, values: &mut Vec<f64>) {
        let flat = self.blocks.as_flattened().as_flattened();
        values.clear();
        values.extend(entries.source.iter().map(|&s| flat[s as usize]));
    }

    /// Largest distance along each axis of the lattice of the grid between two nodes that are coupled.
    pub fn reach(&self, lattice: impl Fn(usize) -> [u32; D]) -> [u32; D] {
        let mut reach = [0; D];
        self.pairs.for_each(|row, column, _| {
            let (a, b) = (lattice(row), lattice(column));
            for d in 0..D {
                reach[d] = reach[d].max(a[d].abs_diff(b[d]));
            }
        });
        reach
    }

    /// K over all active nodes, constrained ones included.
    pub fn matrix(&self) -> BlockMatrix<'_, D> {
        self.pairs.matrix(&self.blocks)
    }

    /// `out = K x` over all active nodes, constrained ones included.
    pub fn multiply(&mut self, x: &[[f64; D]], out: &mut [[f64; D]]) {
        self.pairs.matrix(&self.blocks).multiply(&mut self.division, x, out);
    }

    /// The largest magnitude of an entry of K.
    pub fn largest_entry(&self) -> f64 {
        self.blocks.iter().flatten().flatten().fold(0.0, |largest, entry| f64::max(largest, entry.abs()))
    }

    /// Σ |K_vw| |x_w| over all active nodes: the size of the terms that K x adds up, per node.
    pub fn magnitudes(&self, x: &[[f64; D]]) -> Vec<[f64; D]> {
        let mut sums = vec![[0.0; D]; x.len()];
        let symmetric = self.pairs.symmetric();
        self.pairs.for_each(|row, column, place| {
            let block = &self.blocks[place];
            for i in 0..D {
                for k in 0..D {
                    sums[row][i] += (block[i][k] * x[column][k]).abs();
                    if symmetric && row != column {
                        sums[column][k] += (block[i][k] * x[row][i]).abs();
                    }
                }
            }
        });
        sums
    }

    /// Adds a multiple of a diagonal matrix, given per node, to K until the next evaluation.
    pub fn add_to_diagonal(&mut self, factor: f64, diagonal: &[[f64; D]]) {
        let blocks = &mut self.blocks;
        self.pairs.for_each(|row, column, place| {
            if row == column {
                for d in 0..D {
                    blocks[place][d][d] += factor * diagonal[row][d];
                }
            }
        });
    }

    /// Diagonal of K, per node.
    pub fn diagonal(&self) -> Vec<[f64; D]> {
        let mut diagonal = vec![[0.0; D]; self.internal.len()];
        self.pairs.for_each(|row, column, place| {
            if row == column {
                diagonal[row] = std::array::from_fn(|d| self.blocks[place][d][d]);
            }
        });
        diagonal
    }
}

/// Adds forces to others, entry by entry.
pub(crate) fn add<const D: usize>(sum: &mut [[f64; D]], force: &[[f64; D]]) {
    for (sum, force) in sum.as_flattened_mut().iter_mut().zip(force.as_flattened()) {
        *sum += force;
    }
}
