//! The stiffness and the forces of the active grid, to which the terms of equilibrium contribute: eqs. (19)-(23),
//! (27)-(29).
//!
//! The pattern is laid out for each step. It couples the nodes that a point touches, all nodes of some groups, and
//! further nodes that terms or ties couple. Terms contribute in a fixed order, so that the result is the same to the
//! last bit for any number of threads.

mod border;
mod group;
mod pattern;
mod reduced;

use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::linear::{Block, BlockMatrix, Division, Stiffness};
use crate::ranks::Reduction;
use crate::step::Nodal;

pub use border::Border;
pub(crate) use group::{Cell, Coupling, Dense, Forces, Square, Triangle, Whole};
pub use pattern::Couples;
pub(crate) use pattern::{NodePairs, UNCOUPLED};
pub(crate) use reduced::with_ties;

/// The output requested from an evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wanted {
    /// Forces and stiffness.
    Stiffness,
    /// Only the forces, equal to the last bit to those computed with the stiffness; the stiffness remains that of the
    /// previous evaluation.
    Force,
}

/// The discrete equilibrium of one load step: its pattern, and the contributions of the terms in the latest evaluation.
pub struct System<const N: usize> {
    pub(crate) pairs: NodePairs,
    pub(crate) blocks: Vec<Block<N>>,
    division: Division<N>,
    /// Force of the bodies on the active nodes, eq. (23), plus the internal forces of other terms, [force].
    pub(crate) internal: Nodal<N>,
    /// External force on the active nodes, eq. (29), [force].
    pub(crate) external: Nodal<N>,
    /// The part of the external force that holds bodies as reactions do: the forces of tools and of conditions on
    /// surfaces, and the forces that a stage releases, [force]. `None` if there are no such forces.
    holding: Option<Nodal<N>>,
    /// Forces by whose norm the out-of-balance force of a field is measured if they are larger than its external forces
    /// and reactions; `None` if there are no such forces.
    scale: Option<Nodal<N>>,
    /// Round-off of the external force at each node in addition to the round-off of increments and stresses, [force];
    /// `None` if there is none.
    round_off: Option<Vec<f64>>,
    /// Rate of change of the external force with the load factor, if this factor follows from equilibrium, [force].
    pub(crate) per_factor: Option<Nodal<N>>,
    /// The equations for the global unknowns.
    pub border: Border<N>,
    /// The matrix blocks of the equations for the unknowns, if nodes are turned or tied.
    reduced: Vec<Block<N>>,
    /// Sums over the whole run. The blocks contain the contributions of this rank only.
    reduction: Reduction,
}

impl<const N: usize> System<N> {
    /// Lays out the system of a load step. `is_dense` is true for the groups of points whose nodes are all coupled with
    /// one another; `couples` lists the nodes that are coupled in addition to the groups; `globals` is the number of
    /// global unknowns.
    pub(crate) fn new<const D: usize>(
        links: &Connectivity<D>,
        symmetric: bool,
        is_dense: &dyn Fn(usize) -> bool,
        couples: &Couples,
        globals: usize,
    ) -> Self {
        let pairs = NodePairs::new(links, symmetric, is_dense, couples);
        let zero = vec![[0.0; N]; links.n_active()];
        System {
            blocks: vec![[[0.0; N]; N]; pairs.n_pairs()],
            division: pairs.division(),
            internal: zero.clone(),
            external: zero,
            holding: None,
            scale: None,
            round_off: None,
            per_factor: None,
            border: Border::new(globals, links.n_active()),
            reduced: Vec::new(),
            reduction: links.reduction().clone(),
            pairs,
        }
    }

    /// True if the stiffness is symmetric, so that only blocks with row ≥ column are stored.
    pub fn is_symmetric(&self) -> bool {
        self.pairs.symmetric()
    }

    /// The index, for [`System::add_block`], of the block of two coupled active nodes; `None` if the nodes are not
    /// coupled, or if row < column in a symmetric system.
    pub fn place(&self, row: usize, column: usize) -> Option<usize> {
        self.pairs.place_of(row as u32, column as u32)
    }

    /// Adds a block, `[i][k]`, to the block with index `place`, [force/length].
    pub fn add_block(&mut self, place: usize, block: &[[f64; N]; N]) {
        add(&mut self.blocks[place], block);
    }

    /// Adds a block, `[i][k]`, to the displacement components of the block with index `place`, [force/length].
    pub(crate) fn add_displacement_block<const D: usize>(&mut self, place: usize, block: &[[f64; D]; D]) {
        for (row, values) in self.blocks[place].iter_mut().zip(block) {
            (0..D).for_each(|k| row[k] += values[k]);
        }
    }

    /// Clears the contributions of the terms; keeps the stiffness if only forces are wanted.
    pub(crate) fn clear(&mut self, wanted: Wanted) {
        if wanted == Wanted::Stiffness {
            self.blocks.fill([[0.0; N]; N]);
        }
        self.internal.fill([0.0; N]);
        self.external.fill([0.0; N]);
        (self.holding, self.per_factor, self.scale, self.round_off) = (None, None, None, None);
        self.border.clear();
    }

    /// Sums the forces over all ranks, once the terms of this rank have been added. The stiffness remains divided
    /// between ranks.
    pub(crate) fn complete(&mut self) {
        let reduction = &self.reduction;
        reduction.complete(&mut self.internal);
        reduction.complete(&mut self.external);
        let n = self.internal.len();
        for force in [&mut self.holding, &mut self.per_factor, &mut self.scale] {
            if reduction.any(force.is_some()) {
                reduction.complete(force.get_or_insert_with(|| vec![[0.0; N]; n]));
            }
        }
        if reduction.any(self.round_off.is_some()) {
            reduction.complete_numbers(self.round_off.get_or_insert_with(|| vec![0.0; n]));
        }
        self.border.complete(reduction);
    }

    /// Sums over the whole run.
    pub(crate) fn reduction(&self) -> &Reduction {
        &self.reduction
    }

    /// Transfers the forces on tied components to the components to which they are tied.
    pub(crate) fn condense(&mut self, dofs: &DofMap<N>) {
        dofs.condense(&mut self.internal);
        dofs.condense(&mut self.external);
        for force in [&mut self.holding, &mut self.per_factor, &mut self.scale].into_iter().flatten() {
            dofs.condense(force);
        }
    }

    /// Frees the memory that only further evaluations would need.
    pub(crate) fn conclude(&mut self) {
        self.blocks = Vec::new();
        self.reduced = Vec::new();
    }

    /// Internal force on the active nodes, [force].
    pub fn internal_force(&self) -> &[[f64; N]] {
        &self.internal
    }

    /// Internal force on the active nodes, [force], for terms to add their contributions.
    pub fn internal_force_mut(&mut self) -> &mut [[f64; N]] {
        &mut self.internal
    }

    /// External force on the active nodes, [force].
    pub fn external_force(&self) -> &Nodal<N> {
        &self.external
    }

    /// External force on the active nodes, [force], for terms to add their contributions.
    pub fn external_force_mut(&mut self) -> &mut [[f64; N]] {
        &mut self.external
    }

    /// Adds to the external force a force that holds a body, [force].
    pub fn add_holding<const D: usize>(&mut self, node: usize, force: &[f64; D]) {
        let n = self.external.len();
        let holding = &mut self.holding.get_or_insert_with(|| vec![[0.0; N]; n])[node];
        for (d, f) in force.iter().enumerate() {
            holding[d] += f;
            self.external[node][d] += f;
        }
    }

    /// Adds to the forces by which the out-of-balance force is measured, such as the inertia of a body on which neither
    /// loads nor reactions act, [force]; the components are those of all fields at a node. They do not act on the bodies.
    pub fn add_scale(&mut self, node: usize, force: &[f64; N]) {
        let n = self.external.len();
        let scale = &mut self.scale.get_or_insert_with(|| vec![[0.0; N]; n])[node];
        scale.iter_mut().zip(force).for_each(|(sum, f)| *sum += f);
    }

    /// The forces by which the out-of-balance force is measured if they are larger than external forces and reactions,
    /// [force]; `None` if there are none.
    pub fn scale_force(&self) -> Option<&Nodal<N>> {
        self.scale.as_ref()
    }

    /// Adds to the round-off of the external force at a node, [force].
    pub fn add_round_off(&mut self, node: usize, force: f64) {
        if force > 0.0 {
            let n = self.external.len();
            self.round_off.get_or_insert_with(|| vec![0.0; n])[node] += force;
        }
    }

    /// Round-off of the external force at each node in addition to the round-off of increments and stresses, [force];
    /// `None` if there is none.
    pub fn round_off(&self) -> Option<&[f64]> {
        self.round_off.as_deref()
    }

    /// Marks a force, already part of the external force, as one that holds bodies, [force].
    pub fn count_as_holding<const D: usize>(&mut self, force: &[[f64; D]]) {
        add(self.holding.get_or_insert_with(|| vec![[0.0; N]; force.len()]), force);
    }

    /// The part of the external force that holds bodies as reactions do: the forces of tools and of conditions on
    /// surfaces, and the forces that a stage releases, [force]; `None` if there are no such forces. It can cancel the
    /// loads at the same nodes.
    pub fn holding_force(&self) -> Option<&Nodal<N>> {
        self.holding.as_ref()
    }

    /// Adds to the rate of change of the external force with the load factor, an unknown that follows from equilibrium,
    /// [force].
    pub fn add_per_factor<const D: usize>(&mut self, force: &[[f64; D]]) {
        add(self.per_factor.get_or_insert_with(|| vec![[0.0; N]; force.len()]), force);
    }

    /// Rate of change of the external force with the load factor, if this factor follows from equilibrium, [force].
    pub fn per_factor(&self) -> Option<&Nodal<N>> {
        self.per_factor.as_ref()
    }

    /// K over all active nodes, including constrained ones.
    pub fn matrix(&self) -> BlockMatrix<'_, N> {
        self.pairs.matrix(&self.blocks)
    }

    /// The matrix of the equations for the unknowns, Cᵀ K C; [`System::reduce`] must have formed it.
    pub fn reduced(&mut self, dofs: &DofMap<N>) -> Stiffness<'_, N> {
        let blocks = if dofs.is_plain() { &self.blocks } else { &self.reduced };
        Stiffness { matrix: self.pairs.matrix(blocks), division: &mut self.division }
    }

    /// `out = K x` over all active nodes, including constrained ones.
    pub fn multiply(&mut self, x: &[[f64; N]], out: &mut [[f64; N]]) {
        self.pairs.matrix(&self.blocks).multiply(&mut self.division, x, out);
        self.reduction.complete(out);
    }

    /// The largest magnitude of an entry of K, or an upper bound if several ranks share K.
    pub fn largest_entry(&self) -> f64 {
        let entries = self.blocks.iter().flatten().flatten();
        let own = entries.fold(0.0, |largest, entry| f64::max(largest, entry.abs()));
        // An entry that ranks share is at most the sum of their largest entries.
        self.reduction.total(own)
    }

    /// Σ |K_vw| |x_w| over all active nodes: for each node, the magnitude of the terms in the sum K x.
    pub fn magnitudes(&self, x: &[[f64; N]]) -> Vec<[f64; N]> {
        let mut sums = vec![[0.0; N]; x.len()];
        let symmetric = self.pairs.symmetric();
        self.pairs.for_each(|row, column, place| {
            let block = &self.blocks[place];
            for i in 0..N {
                for k in 0..N {
                    sums[row][i] += (block[i][k] * x[column][k]).abs();
                    if symmetric && row != column {
                        sums[column][k] += (block[i][k] * x[row][i]).abs();
                    }
                }
            }
        });
        self.reduction.complete(&mut sums);
        sums
    }

    /// Adds a multiple of a diagonal matrix, given per node, to K; the next evaluation of K discards it.
    pub fn add_to_diagonal(&mut self, factor: f64, diagonal: &[[f64; N]]) {
        let (blocks, reduction) = (&mut self.blocks, &self.reduction);
        self.pairs.for_each(|row, column, place| {
            if row == column && reduction.counts(row) {
                for d in 0..N {
                    blocks[place][d][d] += factor * diagonal[row][d];
                }
            }
        });
    }

    /// Diagonal of K, per node.
    pub fn diagonal(&self) -> Vec<[f64; N]> {
        let mut diagonal = vec![[0.0; N]; self.internal.len()];
        self.pairs.for_each(|row, column, place| {
            if row == column {
                diagonal[row] = std::array::from_fn(|d| self.blocks[place][d][d]);
            }
        });
        self.reduction.complete(&mut diagonal);
        diagonal
    }
}

/// Adds forces to the first `D` components of other forces.
pub(crate) fn add<const D: usize, const N: usize>(sum: &mut [[f64; N]], force: &[[f64; D]]) {
    for (sum, force) in sum.iter_mut().zip(force) {
        for d in 0..D {
            sum[d] += force[d];
        }
    }
}
