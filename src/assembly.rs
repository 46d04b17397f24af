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
use crate::kinematics::Increment;
use crate::linear::Pattern;
use crate::material::Material;
use crate::model::Model;
use crate::points::Points;
use crate::stress::{Formulation, Mechanics, PointError, PointResponse, StartOfStep, WeakForm};
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
    /// Room for the gradients of one point of each group in the current configuration, eq. (8).
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
        let start = (0..points.len())
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
            f_int: vec![[0.0; D]; links.n_active()],
            start,
            dense: vec![[[0.0; D]; D]; n_dense],
            dense_force: vec![[0.0; D]; n_force],
            mapped: vec![[0.0; D]; n_force],
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
                position: &points.converged.position,
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
            let work = Work {
                elastic_strain: &mut points.trial.elastic_strain[first..last],
                kirchhoff_stress: &mut points.trial.kirchhoff_stress[first..last],
                history: &mut points.trial.history[first * n..last * n],
                mapped: &mut self.mapped,
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
    position: &'a [[f64; D]],
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
            return match self.model.formulation {
                Formulation::PreviouslyConverged => self.run_groups(groups, work, M::respond),
                Formulation::UpdatedLagrangian => self.run_groups(groups, work, M::respond_updated),
            };
        }
        let middle = groups.start + groups.len() / 2;
        let (left, right) = (groups.start..middle, middle..groups.end);
        let first = self.links.points_of(left.start).start;
        let cut = self.links.points_of(right.start).start;
        let n_points = cut - first;
        let n_nodes = left.clone().map(|g| self.links.nodes_of(g).len()).sum();
        let (strain_l, strain_r) = work.elastic_strain.split_at_mut(n_points);
        let (stress_l, stress_r) = work.kirchhoff_stress.split_at_mut(n_points);
        let (history_l, history_r) = work.history.split_at_mut(n_points * self.history_len);
        let (mapped_l, mapped_r) = work.mapped.split_at_mut(n_nodes);
        let (dense_l, dense_r) = work.dense.split_at_mut(self.pairs.dense_range(left.clone()).len());
        let (force_l, force_r) = work.force.split_at_mut(n_nodes);
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

    /// Evaluates the points of some groups one after the other by `respond`, one of the two of [`Mechanics`].
    fn run_groups<W: WeakForm<D>>(
        &self,
        groups: Range<usize>,
        work: Work<D>,
        respond: impl Fn(
            &StartOfStep,
            &Increment<D>,
            &dyn Material,
            &[f64],
            &mut [f64],
        ) -> Result<PointResponse<W>, PointError>,
    ) -> Result<(), PointFailure> {
        let (mut dense, mut force) = (work.dense, work.force);
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
                let increment = Increment::new::<M>(nodes, &links, self.delta_d, &self.position[p]);
                let law = self.law(p);
                let kept = law.state_fields().len();
                let old = &self.old_history[p * n..][..kept];
                let new = &mut work.history[here * n..][..kept];
                let response = respond(&self.start[p], &increment, law, old, new)
                    .map_err(|error| PointFailure { point: p, error })?;
                work.elastic_strain[here] = response.elastic_strain;
                work.kirchhoff_stress[here] = response.tau;
                let weak = &response.weak;
                let gradients = match weak.inverse() {
                    None => links.gradient,
                    Some(inverse) => map_gradients(inverse, links.gradient, work.mapped),
                };
                if self.pairs.symmetric() {
                    accumulate_symmetric(weak, &links, gradients, f, k);
                } else {
                    accumulate(weak, &links, gradients, nodes.len(), f, k);
                }
            }
        }
        Ok(())
    }

    #[inline]
    fn law(&self, p: usize) -> &dyn Material {
        let body = &self.model.bodies[self.body[p] as usize];
        self.model.materials[body.material].law.as_ref()
    }
}

/// ∂S/∂x = ∂S/∂X̃ ΔF⁻¹, eq. (8), for one point.
#[inline(always)]
fn map_gradients<'a, const D: usize>(
    inverse: &Block<D>,
    gradient: &[[f64; D]],
    room: &'a mut [[f64; D]],
) -> &'a [[f64; D]] {
    let out = &mut room[..gradient.len()];
    for (mapped, g) in out.iter_mut().zip(gradient) {
        *mapped = std::array::from_fn(|j| (0..D).map(|i| g[i] * inverse[i][j]).sum());
    }
    out
}

/// Adds eqs. (21) and (23) of one point to the dense lower triangle of its group.
#[inline]
fn accumulate_symmetric<const D: usize, W: WeakForm<D>>(
    weak: &W,
    links: &Links<D>,
    gradients: &[[f64; D]],
    f: &mut [[f64; D]],
    k: &mut [Block<D>],
) {
    let n = links.local.len();
    let (local, value, gradients) = (&links.local[..n], &links.value[..n], &gradients[..n]);
    for b in 0..n {
        let column_node = local[b] as usize;
        let column = weak.column(&weak.gradient(&gradients[b], value[b]), &mut f[column_node]);
        for a in b..n {
            let row = local[a] as usize;
            let gradient = weak.gradient(&gradients[a], value[a]);
            W::add_block(&column, &gradient, &mut k[row * (row + 1) / 2 + column_node]);
        }
    }
}

/// The same for an unsymmetric tangent: the full dense block.
fn accumulate<const D: usize, W: WeakForm<D>>(
    weak: &W,
    links: &Links<D>,
    gradients: &[[f64; D]],
    n: usize,
    f: &mut [[f64; D]],
    k: &mut [Block<D>],
) {
    let nodes = || links.local.iter().zip(gradients).zip(links.value);
    for ((&b, gradient), value) in nodes() {
        let column = weak.column(&weak.gradient(gradient, *value), &mut f[b as usize]);
        for ((&a, gradient), value) in nodes() {
            let gradient = weak.gradient(gradient, *value);
            W::add_block(&column, &gradient, &mut k[a as usize * n + b as usize]);
        }
    }
}
