//! Internal force and stiffness of the active grid: eqs. (19)-(23), (27), (28), or (2)-(6) in the updated Lagrangian
//! formulation.
//!
//! Each group of points accumulates one dense block on the few nodes it touches; the blocks are then merged in the
//! order of the groups. Points write only their own trial state and blocks, so threads never meet, and the order of
//! every sum is fixed: the result has the same bits for any number of threads.
#![allow(non_snake_case)]

mod pattern;

use std::ops::Range;

use crate::basis::{Connectivity, Links};
use crate::constraints::DofMap;
use crate::linear::Pattern;
use crate::model::Model;
use crate::points::Points;
use crate::stress::{Contribution, Formulation, Mechanics, PointError, StartOfStep};
use crate::tensor::Sym3;

pub use pattern::FreeEntries;
use pattern::{NodePairs, UNCOUPLED};

/// Groups are assembled in batches of about this many node-pair blocks, so that the dense blocks stay in cache.
const BATCH: usize = 1 << 15;

/// A task of this many groups or fewer is not split between threads.
const GRAIN: usize = 4;

/// A node-pair block of K, `[i][k]`: row component i, column component k.
type Block<const D: usize> = [[f64; D]; D];

/// The discrete equilibrium of one load step: its pattern, and the values of the current iteration.
pub struct System<const D: usize> {
    pairs: NodePairs,
    blocks: Vec<Block<D>>,
    f_int: Vec<[f64; D]>,
    /// What is fixed for each point at the start of the step.
    start: Vec<StartOfStep>,
    batches: Vec<Range<usize>>,
    dense: Vec<Block<D>>,
    dense_force: Vec<[f64; D]>,
    /// Gradients mapped to the current configuration, eq. (8); empty in the previously converged formulation.
    mapped: Vec<[f64; D]>,
}

/// A point failed during assembly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointFailure {
    /// Index of the point.
    pub point: usize,
    /// What failed.
    pub error: PointError,
}

impl<const D: usize> System<D> {
    /// Lays out the system of a load step.
    pub fn new<M: Mechanics<D>>(model: &Model<D>, points: &Points<D>, links: &Connectivity<D>) -> Self {
        let symmetric = model.materials.iter().all(|m| m.law.tangent_is_symmetric());
        let pairs = NodePairs::new(links, symmetric);
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
        let updated = model.formulation == Formulation::UpdatedLagrangian;
        let start = (0..points.len())
            .map(|p| {
                let J_n = points.converged.deformation_gradient[p].determinant();
                StartOfStep {
                    b_n: M::elastic_left_cauchy_green(&points.converged.elastic_strain[p]),
                    J_n,
                    volume_n: model.volume(points, p),
                }
            })
            .collect();
        System {
            blocks: vec![[[0.0; D]; D]; pairs.n_pairs()],
            f_int: vec![[0.0; D]; links.n_active()],
            start,
            dense: vec![[[0.0; D]; D]; n_dense],
            dense_force: vec![[0.0; D]; n_force],
            mapped: vec![[0.0; D]; if updated { links.n_links() } else { 0 }],
            batches,
            pairs,
        }
    }

    /// Internal force on the active nodes, [force].
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
        self.blocks.fill([[0.0; D]; D]);
        self.f_int.fill([0.0; D]);
        for number in 0..self.batches.len() {
            let batch = self.batches[number].clone();
            let task = Task::<D, M> {
                model,
                body: &points.body,
                history_len: points.history_len,
                old_history: &points.converged.history,
                start: &self.start,
                links,
                pairs: &self.pairs,
                delta_d,
                mechanics: std::marker::PhantomData,
            };
            let first = links.points_of(batch.start).start;
            let last = links.points_of(batch.end - 1).end;
            let n = points.history_len;
            let updated = !self.mapped.is_empty();
            let links_before = |p: usize| if updated { links.link_start(p) } else { 0 };
            let work = Work {
                elastic_strain: &mut points.trial.elastic_strain[first..last],
                kirchhoff_stress: &mut points.trial.kirchhoff_stress[first..last],
                history: &mut points.trial.history[first * n..last * n],
                mapped: &mut self.mapped[links_before(first)..links_before(last)],
                dense: &mut self.dense,
                force: &mut self.dense_force,
            };
            task.run(batch.clone(), work)?;
            self.merge(links, batch);
        }
        Ok(())
    }

    /// Adds the dense blocks of a batch to the system, in the order of its groups.
    fn merge(&mut self, links: &Connectivity<D>, batch: Range<usize>) {
        let (mut k, mut f) = (0, 0);
        for group in batch {
            for &node in links.nodes_of(group) {
                add(&mut self.f_int[node as usize], &self.dense_force[f]);
                f += 1;
            }
            for &position in self.pairs.positions(group) {
                if position != UNCOUPLED {
                    let block = &mut self.blocks[position as usize];
                    for (row, dense) in block.iter_mut().zip(&self.dense[k]) {
                        add(row, dense);
                    }
                }
                k += 1;
            }
        }
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

    /// `out = K x` over all active nodes, constrained ones included.
    pub fn multiply(&self, x: &[[f64; D]], out: &mut [[f64; D]]) {
        out.fill([0.0; D]);
        let symmetric = self.pairs.symmetric();
        self.pairs.for_each(|row, column, place| {
            let block = &self.blocks[place];
            for i in 0..D {
                for k in 0..D {
                    out[row][i] += block[i][k] * x[column][k];
                    if symmetric && row != column {
                        out[column][k] += block[i][k] * x[row][i];
                    }
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

    /// The pattern handed to the linear solver, see [`System::free_entries`].
    pub fn pattern(entries: &FreeEntries) -> &Pattern {
        &entries.pattern
    }
}

fn add<const D: usize>(sum: &mut [f64; D], x: &[f64; D]) {
    for d in 0..D {
        sum[d] += x[d];
    }
}

/// What all points of an evaluation share.
struct Task<'a, const D: usize, M> {
    model: &'a Model<D>,
    body: &'a [u16],
    history_len: usize,
    old_history: &'a [f64],
    start: &'a [StartOfStep],
    links: &'a Connectivity<D>,
    pairs: &'a NodePairs,
    delta_d: &'a [[f64; D]],
    mechanics: std::marker::PhantomData<M>,
}

/// What the points of some consecutive groups write.
struct Work<'a, const D: usize> {
    elastic_strain: &'a mut [Sym3],
    kirchhoff_stress: &'a mut [Sym3],
    history: &'a mut [f64],
    mapped: &'a mut [[f64; D]],
    dense: &'a mut [Block<D>],
    force: &'a mut [[f64; D]],
}

impl<const D: usize, M: Mechanics<D>> Task<'_, D, M> {
    /// Divides the groups between threads; the division has no influence on the result.
    fn run(&self, groups: Range<usize>, work: Work<D>) -> Result<(), PointFailure> {
        if groups.len() <= GRAIN {
            return self.run_groups(groups, work);
        }
        let middle = groups.start + groups.len() / 2;
        let (left, right) = (groups.start..middle, middle..groups.end);
        let first = self.links.points_of(left.start).start;
        let cut = self.links.points_of(right.start).start;
        let n_links = self.links.link_start(cut) - self.links.link_start(first);
        let n_points = cut - first;
        let n_force = left.clone().map(|g| self.links.nodes_of(g).len()).sum();
        let (strain_l, strain_r) = work.elastic_strain.split_at_mut(n_points);
        let (stress_l, stress_r) = work.kirchhoff_stress.split_at_mut(n_points);
        let (history_l, history_r) = work.history.split_at_mut(n_points * self.history_len);
        let (mapped_l, mapped_r) = work.mapped.split_at_mut(if work.mapped.is_empty() { 0 } else { n_links });
        let (dense_l, dense_r) = work.dense.split_at_mut(self.pairs.dense_range(left.clone()).len());
        let (force_l, force_r) = work.force.split_at_mut(n_force);
        let work_l = Work {
            elastic_strain: strain_l,
            kirchhoff_stress: stress_l,
            history: history_l,
            mapped: mapped_l,
            dense: dense_l,
            force: force_l,
        };
        let work_r = Work {
            elastic_strain: strain_r,
            kirchhoff_stress: stress_r,
            history: history_r,
            mapped: mapped_r,
            dense: dense_r,
            force: force_r,
        };
        let (a, b) = rayon::join(|| self.run(left, work_l), || self.run(right, work_r));
        a.and(b)
    }

    /// Evaluates the points of some groups one after the other.
    fn run_groups(&self, groups: Range<usize>, work: Work<D>) -> Result<(), PointFailure> {
        let (mut dense, mut force, mut mapped) = (work.dense, work.force, work.mapped);
        let first = self.links.points_of(groups.start).start;
        let n = self.history_len;
        for group in groups {
            let nodes = self.links.nodes_of(group);
            let (k, rest) = dense.split_at_mut(self.pairs.dense_range(group..group + 1).len());
            dense = rest;
            let (f, rest) = force.split_at_mut(nodes.len());
            force = rest;
            k.fill([[0.0; D]; D]);
            f.fill([0.0; D]);
            for p in self.links.points_of(group) {
                let links = self.links.links(p);
                let here = p - first;
                let new_history = &mut work.history[here * n..(here + 1) * n];
                let (contribution, dF) = self
                    .evaluate(p, nodes, &links, new_history)
                    .map_err(|error| PointFailure { point: p, error })?;
                work.elastic_strain[here] = contribution.elastic_strain;
                work.kirchhoff_stress[here] = contribution.tau;
                let gradient = if mapped.is_empty() {
                    links.gradient
                } else {
                    let (own, rest) = mapped.split_at_mut(links.gradient.len());
                    mapped = rest;
                    map_gradients::<D, M>(&dF, links.gradient, own);
                    own
                };
                if self.pairs.symmetric() {
                    accumulate_symmetric(&contribution, links.local, gradient, f, k);
                } else {
                    accumulate(&contribution, links.local, gradient, nodes.len(), f, k);
                }
            }
        }
        Ok(())
    }

    /// The response of one point; also its ΔF, eq. (7).
    #[inline]
    fn evaluate(
        &self,
        p: usize,
        nodes: &[u32],
        links: &Links<D>,
        new_history: &mut [f64],
    ) -> Result<(Contribution<D>, Block<D>), PointError> {
        let body = &self.model.bodies[self.body[p] as usize];
        let law = self.model.materials[body.material].law.as_ref();
        let kept = law.state_fields().len();
        let old = &self.old_history[p * self.history_len..][..kept];
        let dF = deformation_increment(nodes, links, self.delta_d);
        let new = &mut new_history[..kept];
        M::respond(self.model.formulation, &self.start[p], &dF, law, old, new).map(|c| (c, dF))
    }
}

/// ΔF of eq. (7) at a point whose group touches `nodes`.
#[inline]
pub fn deformation_increment<const D: usize>(
    nodes: &[u32],
    links: &Links<D>,
    delta_d: &[[f64; D]],
) -> [[f64; D]; D] {
    let mut dF: [[f64; D]; D] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j)));
    for (&local, gradient) in links.local.iter().zip(links.gradient) {
        let du = &delta_d[nodes[local as usize] as usize];
        for i in 0..D {
            for j in 0..D {
                dF[i][j] += du[i] * gradient[j];
            }
        }
    }
    dF
}

/// ∂S/∂x = ∂S/∂X̃ ΔF⁻¹, eq. (8).
fn map_gradients<const D: usize, M: Mechanics<D>>(
    dF: &Block<D>,
    gradient: &[[f64; D]],
    out: &mut [[f64; D]],
) {
    // det(ΔF) > 0 was checked when the point was evaluated.
    let inverse = M::embed(dF).try_inverse().unwrap_or_else(crate::tensor::Mat3::zeros);
    for (mapped, g) in out.iter_mut().zip(gradient) {
        *mapped = std::array::from_fn(|j| (0..D).map(|i| g[i] * inverse[(i, j)]).sum());
    }
}

/// V g_b·Ã as `[i][j][k]`, and the force V P̃ g_b.
#[inline(always)]
fn column<const D: usize>(c: &Contribution<D>, g: &[f64; D]) -> [[[f64; D]; D]; D] {
    let vg = g.map(|x| x * c.volume);
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            std::array::from_fn(|k| c.tangent[i][j][k].iter().zip(&vg).map(|(a, g)| a * g).sum())
        })
    })
}

#[inline(always)]
fn add_force<const D: usize>(c: &Contribution<D>, g: &[f64; D], f: &mut [f64; D]) {
    for (f, row) in f.iter_mut().zip(&c.stress) {
        let traction: f64 = row.iter().zip(g).map(|(stress, g)| stress * g).sum();
        *f += c.volume * traction;
    }
}

#[inline(always)]
fn add_block<const D: usize>(t: &[[[f64; D]; D]; D], g: &[f64; D], block: &mut Block<D>) {
    for i in 0..D {
        for j in 0..D {
            for k in 0..D {
                block[i][k] += g[j] * t[i][j][k];
            }
        }
    }
}

/// Adds eqs. (21) and (23) of one point to the dense lower triangle of its group.
#[inline]
fn accumulate_symmetric<const D: usize>(
    c: &Contribution<D>,
    local: &[u32],
    gradient: &[[f64; D]],
    f: &mut [[f64; D]],
    k: &mut [Block<D>],
) {
    for (b, gb) in gradient.iter().enumerate() {
        let column_node = local[b] as usize;
        add_force(c, gb, &mut f[column_node]);
        let t = column(c, gb);
        for (&row, ga) in local[b..].iter().zip(&gradient[b..]) {
            let row = row as usize;
            add_block(&t, ga, &mut k[row * (row + 1) / 2 + column_node]);
        }
    }
}

/// The same for an unsymmetric tangent: the full dense block.
fn accumulate<const D: usize>(
    c: &Contribution<D>,
    local: &[u32],
    gradient: &[[f64; D]],
    n: usize,
    f: &mut [[f64; D]],
    k: &mut [Block<D>],
) {
    for (&b, gb) in local.iter().zip(gradient) {
        add_force(c, gb, &mut f[b as usize]);
        let t = column(c, gb);
        for (&a, ga) in local.iter().zip(gradient) {
            add_block(&t, ga, &mut k[a as usize * n + b as usize]);
        }
    }
}
