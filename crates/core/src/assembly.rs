//! Internal force and stiffness of the active grid: eqs. (19)-(23), (27), (28), or (2)-(6) in the updated Lagrangian
//! formulation.
//!
//! Each group of points accumulates one dense block on the few nodes it touches; the blocks are then merged in the
//! order of the groups. Points write only their own trial state and blocks, so threads never meet, and the order of
//! every sum is fixed: the result has the same bits for any number of threads.
#![allow(non_snake_case)]

mod evaluation;
mod group;
mod pattern;

use std::ops::Range;

use rayon::prelude::*;

use crate::basis::{Connectivity, Room};
use crate::dofs::DofMap;
use crate::linear::{Block, BlockMatrix, Division};
use crate::model::Model;
use crate::points::{PIECE, Points};
use crate::stress::{Mechanics, StartOfStep};
use crate::terms::ghost::Ghost;

pub use evaluation::PointFailure;
use evaluation::{Task, Trial, Wanted, Work};
pub use pattern::FreeEntries;
use pattern::{NodePairs, UNCOUPLED};

/// Groups are assembled in batches of about this many node-pair blocks, so that the dense blocks stay in cache.
const BATCH: usize = 1 << 14;

/// The discrete equilibrium of one load step: its pattern, and the values of the current iteration.
pub struct System<const D: usize> {
    pairs: NodePairs,
    ghost: Ghost,
    blocks: Vec<Block<D>>,
    division: Division<D>,
    f_int: Vec<[f64; D]>,
    /// What is fixed for each point at the start of the step.
    start: Vec<StartOfStep>,
    batches: Vec<Range<usize>>,
    /// The dense blocks of the batch in hand, and of the one before, which is merged meanwhile.
    dense: [DenseBatch<D>; 2],
    /// Room for the basis functions of one point of each group.
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
    /// Room for the gradients of one point of each group in the current configuration, eq. (8).
    mapped: Vec<[f64; D]>,
}

/// The dense blocks of the groups of a batch, one after the other, and their nodal forces.
#[derive(Default)]
struct DenseBatch<const D: usize> {
    blocks: Vec<Block<D>>,
    force: Vec<[f64; D]>,
}

impl<const D: usize> System<D> {
    /// Lays out the system of a load step.
    pub fn new<M: Mechanics<D>>(model: &Model<D>, points: &Points<D>, links: &Connectivity<D>) -> Self {
        let symmetric = model.materials.iter().all(|m| m.law.tangent_is_symmetric());
        let ghost = Ghost::new(model, points, links);
        let pairs = NodePairs::new(links, &ghost, symmetric);
        let mut batches = Vec::new();
        let mut first = 0;
        for group in 0..links.n_groups() {
            if pairs.dense_range(first..group + 1).len() > BATCH && group > first {
                batches.push(first..group);
                first = group;
            }
        }
        batches.push(first..links.n_groups());
        let largest = |len: &dyn Fn(&Range<usize>) -> usize| batches.iter().map(len).max().unwrap_or(0);
        let n_dense = largest(&|b| pairs.dense_range(b.clone()).len());
        let n_force = largest(&|b| b.clone().map(|g| links.nodes_of(g).len()).sum());
        let dense = || DenseBatch { blocks: vec![[[0.0; D]; D]; n_dense], force: vec![[0.0; D]; n_force] };
        let start = (0..points.len())
            .into_par_iter()
            .with_min_len(PIECE)
            .map(|p| {
                let J_n = points.converged.deformation_gradient[p].determinant();
                let measure = model.law(points, p).strain_measure();
                StartOfStep {
                    b_n: M::elastic_left_cauchy_green(measure, &points.converged.elastic_strain[p]),
                    J_n,
                    volume_n: model.volume(points, p),
                }
            })
            .collect();
        System {
            blocks: vec![[[0.0; D]; D]; pairs.n_pairs()],
            division: pairs.division(),
            f_int: vec![[0.0; D]; links.n_active()],
            start,
            dense: [dense(), dense()],
            value: vec![0.0; n_force],
            gradient: vec![[0.0; D]; n_force],
            mapped: vec![[0.0; D]; n_force],
            batches,
            pairs,
            ghost,
        }
    }

    /// Number of faces that are stabilised.
    pub fn stabilised_faces(&self) -> usize {
        self.ghost.n_faces()
    }

    /// Work of the stabilisation over a displacement increment of the active nodes, [energy].
    pub fn stabilisation_work(&self, delta_d: &[[f64; D]]) -> f64 {
        self.ghost.work(delta_d)
    }

    /// Internal force on the active nodes, that of stabilised faces included, [force].
    pub fn internal_force(&self) -> &[[f64; D]] {
        &self.f_int
    }

    /// Evaluates every point at the displacement increment `delta_d` of the active nodes, writes its trial state and
    /// assembles internal force and stiffness.
    ///
    /// # Errors
    /// The first point that could not follow the increment.
    pub fn assemble<M: Mechanics<D>>(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        links: &Connectivity<D>,
        delta_d: &[[f64; D]],
    ) -> Result<(), PointFailure> {
        self.evaluate::<M>(model, points, links, delta_d, Wanted::Stiffness)
    }

    /// As [`System::assemble`], without the stiffness, which stays that of the evaluation before.
    ///
    /// # Errors
    /// As [`System::assemble`].
    pub fn assemble_force<M: Mechanics<D>>(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        links: &Connectivity<D>,
        delta_d: &[[f64; D]],
    ) -> Result<(), PointFailure> {
        self.evaluate::<M>(model, points, links, delta_d, Wanted::Force)
    }

    fn evaluate<M: Mechanics<D>>(
        &mut self,
        model: &Model<D>,
        points: &mut Points<D>,
        links: &Connectivity<D>,
        delta_d: &[[f64; D]],
        wanted: Wanted,
    ) -> Result<(), PointFailure> {
        let System { pairs, ghost, blocks, f_int, start, batches, dense, value, gradient, mapped, .. } = self;
        if wanted == Wanted::Stiffness {
            blocks.fill([[0.0; D]; D]);
        }
        f_int.fill([0.0; D]);
        let [mut in_hand, mut before] = dense.each_mut();
        let mut merged = 0..0;
        for batch in batches.iter().cloned() {
            let task = Task::<D, M> {
                model,
                body: &points.body,
                position: &points.converged.position,
                history_len: points.history_len,
                old_history: &points.converged.history,
                start,
                links,
                pairs,
                delta_d,
                wanted,
                mechanics: std::marker::PhantomData,
            };
            let first = links.points_of(batch.start).start;
            let last = links.points_of(batch.end - 1).end;
            let n = points.history_len;
            let trial = Trial {
                first,
                elastic_strain: &mut points.trial.elastic_strain[first..last],
                kirchhoff_stress: &mut points.trial.kirchhoff_stress[first..last],
                history: &mut points.trial.history[first * n..last * n],
                mapped,
            };
            let room = Room { value, gradient };
            let work = Work { trial, dense: &mut in_hand.blocks, force: &mut in_hand.force, room };
            let (outcome, ()) = rayon::join(
                || task.run(batch.clone(), work),
                || merge(pairs, links, merged.clone(), before, blocks, f_int, wanted),
            );
            outcome?;
            merged = batch;
            std::mem::swap(&mut in_hand, &mut before);
        }
        merge(pairs, links, merged, before, blocks, f_int, wanted);
        if wanted == Wanted::Stiffness {
            pairs.add_ghost(ghost, blocks);
        }
        ghost.add_force(delta_d, f_int);
        Ok(())
    }

    /// Frees what only further evaluations would need.
    pub fn conclude(&mut self) {
        self.start = Vec::new();
        self.blocks = Vec::new();
        self.dense = Default::default();
        (self.value, self.gradient, self.mapped) = Default::default();
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
        let mut diagonal = vec![[0.0; D]; self.f_int.len()];
        self.pairs.for_each(|row, column, place| {
            if row == column {
                diagonal[row] = std::array::from_fn(|d| self.blocks[place][d][d]);
            }
        });
        diagonal
    }
}

/// Adds the dense blocks of a batch to the system, in the order of its groups.
fn merge<const D: usize>(
    pairs: &NodePairs,
    links: &Connectivity<D>,
    batch: Range<usize>,
    dense: &DenseBatch<D>,
    blocks: &mut [Block<D>],
    f_int: &mut [[f64; D]],
    wanted: Wanted,
) {
    let (mut k, mut f) = (0, 0);
    for group in batch {
        for &node in links.nodes_of(group) {
            add(&mut f_int[node as usize], &dense.force[f]);
            f += 1;
        }
        if wanted == Wanted::Force {
            continue;
        }
        for &position in pairs.positions(group) {
            if position != UNCOUPLED {
                let block = &mut blocks[position as usize];
                for (row, dense) in block.iter_mut().zip(&dense.blocks[k]) {
                    add(row, dense);
                }
            }
            k += 1;
        }
    }
}

fn add<const D: usize>(sum: &mut [f64; D], x: &[f64; D]) {
    for d in 0..D {
        sum[d] += x[d];
    }
}
