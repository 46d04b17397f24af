//! Internal force and stiffness of the active grid: eqs. (19)-(23), (27), (28), or (2)-(6) in the updated Lagrangian
//! formulation.
//!
//! Each group of points accumulates one dense block on the few nodes it touches; the blocks are then merged in the
//! order of the groups. Points write only their own trial state and blocks, so threads never meet, and the order of
//! every sum is fixed: the result has the same bits for any number of threads.
#![allow(non_snake_case)]

mod group;
mod pattern;

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::basis::{Connectivity, Links, Room};
use crate::constraints::DofMap;
use crate::kinematics::Increment;
use crate::linear::{Block, BlockMatrix, Division};
use crate::material::Material;
use crate::model::Model;
use crate::points::{PIECE, Points};
use crate::stabilisation::Ghost;
use crate::stress::{Formulation, Mechanics, PointError, PointResponse, StartOfStep, WeakForm};
use crate::tensor::{Lanes, Sym3};

use group::{Cell, Dense, Forces, Square, Triangle, Whole};
pub use pattern::FreeEntries;
use pattern::{NodePairs, UNCOUPLED};

/// Groups are assembled in batches of about this many node-pair blocks, so that the dense blocks stay in cache.
const BATCH: usize = 1 << 14;

/// A task of this many groups or fewer is not split between threads.
const GRAIN: usize = 4;

/// Most history variables of points that are evaluated side by side.
const MOST_HISTORY: usize = 4;

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

/// What an evaluation is to assemble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wanted {
    /// Internal force and stiffness.
    Stiffness,
    /// The internal force, with the same bits.
    Force,
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
    wanted: Wanted,
    mechanics: std::marker::PhantomData<M>,
}

/// What the points of some consecutive groups write of their own.
struct Trial<'a, const D: usize> {
    /// The first of the points.
    first: usize,
    elastic_strain: &'a mut [Sym3],
    kirchhoff_stress: &'a mut [Sym3],
    history: &'a mut [f64],
    mapped: &'a mut [[f64; D]],
}

impl<'a, const D: usize> Trial<'a, D> {
    /// The parts before and from a point, whose groups touch `n_nodes` nodes before.
    fn split(self, point: usize, n_nodes: usize, history_len: usize) -> (Trial<'a, D>, Trial<'a, D>) {
        let n = point - self.first;
        let (strain_l, strain_r) = self.elastic_strain.split_at_mut(n);
        let (stress_l, stress_r) = self.kirchhoff_stress.split_at_mut(n);
        let (history_l, history_r) = self.history.split_at_mut(n * history_len);
        let (mapped_l, mapped_r) = self.mapped.split_at_mut(n_nodes);
        let left = Trial {
            first: self.first,
            elastic_strain: strain_l,
            kirchhoff_stress: stress_l,
            history: history_l,
            mapped: mapped_l,
        };
        let right = Trial {
            first: point,
            elastic_strain: strain_r,
            kirchhoff_stress: stress_r,
            history: history_r,
            mapped: mapped_r,
        };
        (left, right)
    }
}

/// What the points of some consecutive groups write.
struct Work<'a, const D: usize> {
    trial: Trial<'a, D>,
    dense: &'a mut [Block<D>],
    force: &'a mut [[f64; D]],
    room: Room<'a, D>,
}

impl<const D: usize, M: Mechanics<D>> Task<'_, D, M> {
    /// Divides the groups between threads; the division has no influence on the result.
    fn run(&self, groups: Range<usize>, work: Work<D>) -> Result<(), PointFailure> {
        if groups.len() <= GRAIN {
            return match self.model.formulation {
                Formulation::PreviouslyConverged => self.run_groups::<false>(groups, work),
                Formulation::UpdatedLagrangian => self.run_groups::<true>(groups, work),
            };
        }
        let middle = groups.start + groups.len() / 2;
        let (left, right) = (groups.start..middle, middle..groups.end);
        let n_nodes = left.clone().map(|g| self.links.nodes_of(g).len()).sum();
        let cut = self.links.points_of(right.start).start;
        let (trial_l, trial_r) = work.trial.split(cut, n_nodes, self.history_len);
        let (dense_l, dense_r) = work.dense.split_at_mut(self.pairs.dense_range(left.clone()).len());
        let (force_l, force_r) = work.force.split_at_mut(n_nodes);
        let (value_l, value_r) = work.room.value.split_at_mut(n_nodes);
        let (gradient_l, gradient_r) = work.room.gradient.split_at_mut(n_nodes);
        let (room_l, room_r) =
            (Room { value: value_l, gradient: gradient_l }, Room { value: value_r, gradient: gradient_r });
        let work_l = Work { trial: trial_l, dense: dense_l, force: force_l, room: room_l };
        let work_r = Work { trial: trial_r, dense: dense_r, force: force_r, room: room_r };
        let (a, b) = rayon::join(|| self.run(left, work_l), || self.run(right, work_r));
        a.and(b)
    }

    /// Evaluates the points of some groups one after the other, in one of the two formulations.
    fn run_groups<const UPDATED: bool>(
        &self,
        groups: Range<usize>,
        work: Work<D>,
    ) -> Result<(), PointFailure> {
        let Work { mut trial, mut dense, mut force, mut room } = work;
        let room = &mut room;
        let symmetric = self.pairs.symmetric();
        for group in groups {
            let n = self.links.nodes_of(group).len();
            let (k, rest) = dense.split_at_mut(self.pairs.dense_range(group..group + 1).len());
            dense = rest;
            let (f, rest) = force.split_at_mut(n);
            force = rest;
            match (D, n) {
                _ if self.wanted == Wanted::Force => {
                    self.run_group::<UPDATED>(group, &mut trial, room, f, &mut Forces)?;
                }
                (3, 8) if self.links.is_whole(group) => {
                    let cell = &mut Cell::<D, 8, 2>::zero(symmetric);
                    self.run_group::<UPDATED>(group, &mut trial, room, f, cell)?;
                    cell.store(k);
                }
                (3, 4) if self.links.is_whole(group) => {
                    let cell = &mut Cell::<D, 4, 1>::zero(symmetric);
                    self.run_group::<UPDATED>(group, &mut trial, room, f, cell)?;
                    cell.store(k);
                }
                (2, 4) if symmetric && self.links.is_whole(group) => {
                    let whole = &mut Whole::<D, 4>::zero();
                    self.run_group::<UPDATED>(group, &mut trial, room, f, whole)?;
                    whole.store(k);
                }
                (2, 3) if symmetric && self.links.is_whole(group) => {
                    let whole = &mut Whole::<D, 3>::zero();
                    self.run_group::<UPDATED>(group, &mut trial, room, f, whole)?;
                    whole.store(k);
                }
                _ => {
                    k.fill([[0.0; D]; D]);
                    if symmetric {
                        self.run_group::<UPDATED>(group, &mut trial, room, f, &mut Triangle(k))?;
                    } else {
                        let square = &mut Square { blocks: k, nodes: n };
                        self.run_group::<UPDATED>(group, &mut trial, room, f, square)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Evaluates the points of a group with the vector instructions that the machine has.
    fn run_group<const UPDATED: bool>(
        &self,
        group: usize,
        trial: &mut Trial<D>,
        room: &mut Room<D>,
        force: &mut [[f64; D]],
        dense: &mut impl Dense<D>,
    ) -> Result<(), PointFailure> {
        force.fill([0.0; D]);
        Arch::new().dispatch(Vectorised::<D, M, _, UPDATED> { task: self, group, trial, room, force, dense })
    }

    #[inline]
    fn law(&self, p: usize) -> &dyn Material {
        let body = &self.model.bodies[self.body[p] as usize];
        self.model.materials[body.material].law.as_ref()
    }
}

/// The points of one group, to be compiled for several sets of instructions. None of them changes the result: products
/// and sums are rounded one by one.
struct Vectorised<'t, 'a, 's, 'r, const D: usize, M, K, const UPDATED: bool> {
    task: &'t Task<'a, D, M>,
    group: usize,
    trial: &'t mut Trial<'s, D>,
    room: &'t mut Room<'r, D>,
    force: &'t mut [[f64; D]],
    dense: &'t mut K,
}

impl<const D: usize, M: Mechanics<D>, K: Dense<D>, const UPDATED: bool> WithSimd
    for Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>
{
    type Output = Result<(), PointFailure>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Self::Output {
        let points = self.task.links.points_of(self.group);
        let mut p = points.start;
        while p < points.end {
            p += match self.add_side_by_side(p..points.end)? {
                Some(count) => count,
                None => {
                    self.add_one(p)?;
                    1
                }
            };
        }
        Ok(())
    }
}

impl<const D: usize, M: Mechanics<D>, K: Dense<D>, const UPDATED: bool>
    Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>
{
    #[inline(always)]
    fn increment(&mut self, p: usize) -> Increment<D> {
        let task = self.task;
        let nodes = task.links.nodes_of(self.group);
        Increment::new::<M>(nodes, &task.links.links(p, self.room), task.delta_d, &task.position[p])
    }

    /// Adds the first points of a range side by side, where they have one law that can be evaluated so; returns how many.
    #[inline(always)]
    fn add_side_by_side(&mut self, points: Range<usize>) -> Result<Option<usize>, PointFailure> {
        let task = self.task;
        let p = points.start;
        let law = task.law(p);
        let kept = law.state_fields().len();
        if UPDATED || !M::SIDE_BY_SIDE || law.side_by_side().is_none() || kept > MOST_HISTORY {
            return Ok(None);
        }
        let alike = task.body[points].iter().take_while(|&&body| body == task.body[p]);
        let count = alike.take(Lanes::WIDTH).count();
        // Lanes that are left over repeat the last point.
        let last = p + count - 1;
        let of_lane = [p, last.min(p + 1), last.min(p + 2), last.min(p + 3)];
        let [a, b, c, d] = of_lane;
        let starts = [&task.start[a], &task.start[b], &task.start[c], &task.start[d]];
        // Not by a closure, which might not be inlined and compiled for vector instructions.
        let increments = [self.increment(a), self.increment(b), self.increment(c), self.increment(d)];
        let n = task.history_len;
        let mut history = [Lanes::ZERO; MOST_HISTORY];
        for (h, lanes) in history[..kept].iter_mut().enumerate() {
            *lanes = Lanes::gather(|l| task.old_history[of_lane[l] * n + h]);
        }
        let Some(responses) = M::respond_side_by_side(starts, &increments, law, &mut history[..kept]) else {
            return Ok(None);
        };
        for (l, response) in responses[..count].iter().enumerate() {
            let here = p + l - self.trial.first;
            for (h, lanes) in history[..kept].iter().enumerate() {
                self.trial.history[here * n + h] = lanes.0[l];
            }
            let links = task.links.links(p + l, self.room);
            keep(p + l, response, &links, self.trial, self.dense, self.force);
        }
        Ok(Some(count))
    }

    #[inline(always)]
    fn add_one(&mut self, p: usize) -> Result<(), PointFailure> {
        let Vectorised { task, group, trial, room, force, dense } = self;
        let failure = |error| PointFailure { point: p, error };
        let (start, law) = (&task.start[p], task.law(p));
        let links = task.links.links(p, room);
        let nodes = task.links.nodes_of(*group);
        let increment = Increment::new::<M>(nodes, &links, task.delta_d, &task.position[p]);
        let isotropic = if UPDATED { None } else { M::respond_isotropic(start, &increment, law) };
        if let Some(response) = isotropic {
            keep(p, response.as_ref().map_err(|e| failure(*e))?, &links, trial, *dense, force);
            return Ok(());
        }
        let (n, here) = (task.history_len, p - trial.first);
        let kept = law.state_fields().len();
        let old = &task.old_history[p * n..][..kept];
        let new = &mut trial.history[here * n..][..kept];
        if UPDATED {
            let response = M::respond_updated(start, &increment, law, old, new);
            keep(p, response.as_ref().map_err(|e| failure(*e))?, &links, trial, *dense, force);
        } else {
            let response = M::respond(start, &increment, law, old, new);
            keep(p, response.as_ref().map_err(|e| failure(*e))?, &links, trial, *dense, force);
        }
        Ok(())
    }
}

/// Keeps the response of a point and adds its part.
#[inline(always)]
fn keep<const D: usize, W: WeakForm<D>>(
    p: usize,
    response: &PointResponse<W>,
    links: &Links<D>,
    trial: &mut Trial<D>,
    dense: &mut impl Dense<D>,
    force: &mut [[f64; D]],
) {
    let PointResponse { weak, tau, elastic_strain } = response;
    let here = p - trial.first;
    trial.elastic_strain[here] = *elastic_strain;
    trial.kirchhoff_stress[here] = *tau;
    let gradients = match weak.inverse() {
        None => links.gradient,
        Some(inverse) => map_gradients(inverse, links.gradient, trial.mapped),
    };
    dense.add(weak, links, gradients, force);
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
        let mut sum = [0.0; D];
        for i in 0..D {
            for j in 0..D {
                sum[j] += g[i] * inverse[i][j];
            }
        }
        *mapped = sum;
    }
    out
}
