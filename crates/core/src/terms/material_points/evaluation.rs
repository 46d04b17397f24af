//! The evaluation of points, group by group: from the displacement increment to their trial state, and to the dense
//! stiffness and the nodal forces of each group.
#![allow(non_snake_case)]

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::assembly::{Cell, Dense, Forces, NodePairs, Square, Triangle, Wanted, Whole};
use crate::basis::{Connectivity, LinkBuffer, Links};
use crate::kinematics::Increment;
use crate::linear::Block;
use crate::material::Material;
use crate::model::Model;
use crate::stress::{
    Averageable, Deviated, Formulation, MAX_HISTORY, Mechanics, PointResponse, StartOfStep, StressAtStart,
    WeakForm, suits_lanes,
};
use crate::tensor::{Lanes, Sym3};
use crate::terms::failure::PointFailure;

use super::cell_room::CellRoom;
use super::deviation::Held;

/// A task of at most this many groups is not divided between threads.
const GRAIN: usize = 4;

/// The data shared by all points of an evaluation.
pub(super) struct Task<'a, const D: usize, M> {
    pub(super) model: &'a Model<D>,
    pub(super) body: &'a [u16],
    pub(super) cell: &'a [u32],
    pub(super) position: &'a [[f64; D]],
    /// Half lengths of the domains; empty if there are none.
    pub(super) half_lengths: &'a [[f64; D]],
    pub(super) history_len: usize,
    pub(super) old_history: &'a [f64],
    pub(super) start: &'a [StartOfStep],
    /// What the points hold against deviations from mean increments; empty if no body takes them.
    pub(super) held: &'a [Held],
    pub(super) links: &'a Connectivity<D>,
    pub(super) pairs: &'a NodePairs,
    pub(super) delta_d: &'a [[f64; D]],
    /// True if at least one body does not have [`CellStrain::Standard`](crate::stress::CellStrain::Standard).
    pub(super) dilated: bool,
    pub(super) wanted: Wanted,
    /// The law of each point, if some laws are stand-ins for laws that are evaluated in batches.
    pub(super) laws: Option<&'a [&'a dyn Material]>,
    /// The laws of the materials for the current step, where they are not the laws themselves.
    pub(super) step_laws: &'a [Option<Box<dyn Material>>],
    /// The stored energy V⁰ W of each point at the start of the step, [energy], if the points add the mean stress of the
    /// step; otherwise `None`.
    pub(super) stored: Option<&'a [f64]>,
    /// Kirchhoff stress at the start of the step.
    pub(super) old_stress: &'a [Sym3],
    pub(super) mechanics: std::marker::PhantomData<M>,
}

/// The output for the points of consecutive groups.
pub(super) struct Trial<'a, const D: usize> {
    /// Index of the first of these points.
    pub(super) first: usize,
    pub(super) elastic_strain: &'a mut [Sym3],
    pub(super) kirchhoff_stress: &'a mut [Sym3],
    pub(super) history: &'a mut [f64],
    /// Deviations from mean increments; empty if no body takes them.
    pub(super) deviated: &'a mut [Deviated],
    pub(super) mapped: &'a mut [[f64; D]],
}

impl<'a, const D: usize> Trial<'a, D> {
    /// The output before a point, and the output from that point on; the groups before that point touch `n_nodes` nodes
    /// in total.
    fn split(self, point: usize, n_nodes: usize, history_len: usize) -> (Trial<'a, D>, Trial<'a, D>) {
        let n = point - self.first;
        let (strain_l, strain_r) = self.elastic_strain.split_at_mut(n);
        let (stress_l, stress_r) = self.kirchhoff_stress.split_at_mut(n);
        let (history_l, history_r) = self.history.split_at_mut(n * history_len);
        let (deviated_l, deviated_r) = self.deviated.split_at_mut(n.min(self.deviated.len()));
        let (mapped_l, mapped_r) = self.mapped.split_at_mut(n_nodes);
        let left = Trial {
            first: self.first,
            elastic_strain: strain_l,
            kirchhoff_stress: stress_l,
            history: history_l,
            deviated: deviated_l,
            mapped: mapped_l,
        };
        let right = Trial {
            first: point,
            elastic_strain: strain_r,
            kirchhoff_stress: stress_r,
            history: history_r,
            deviated: deviated_r,
            mapped: mapped_r,
        };
        (left, right)
    }
}

/// The output for consecutive groups, with their working space.
pub(super) struct Work<'a, const D: usize> {
    pub(super) trial: Trial<'a, D>,
    pub(super) dense: &'a mut [Block<D>],
    pub(super) force: &'a mut [[f64; D]],
    pub(super) room: LinkBuffer<'a, D>,
}

impl<const D: usize, M: Mechanics<D>> Task<'_, D, M> {
    /// Divides the groups between threads; the division does not affect the result.
    pub(super) fn run(&self, groups: Range<usize>, work: Work<D>) -> Result<(), PointFailure> {
        if groups.len() <= GRAIN {
            let arch = Arch::new();
            return match self.model.formulation {
                Formulation::PreviouslyConverged => {
                    arch.dispatch(Groups::<D, M, false> { task: self, groups, work })
                }
                Formulation::UpdatedLagrangian => {
                    arch.dispatch(Groups::<D, M, true> { task: self, groups, work })
                }
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
        let (room_l, room_r) = (
            LinkBuffer { value: value_l, gradient: gradient_l },
            LinkBuffer { value: value_r, gradient: gradient_r },
        );
        let work_l = Work { trial: trial_l, dense: dense_l, force: force_l, room: room_l };
        let work_r = Work { trial: trial_r, dense: dense_r, force: force_r, room: room_r };
        let (a, b) = rayon::join(|| self.run(left, work_l), || self.run(right, work_r));
        a.and(b)
    }

    /// The increment of a point of a group; `room` receives its basis functions.
    #[inline(always)]
    pub(super) fn increment(&self, group: usize, p: usize, room: &mut LinkBuffer<D>) -> Increment<D> {
        let (nodes, links) = (self.links.nodes_of(group), self.links.links(p, room));
        Increment::new(M::REVOLVED, nodes, &links, self.delta_d, &self.position[p])
    }

    /// History variables of a point at the start and at the end of the step.
    #[inline(always)]
    pub(super) fn histories<'t>(&self, p: usize, trial: &'t mut Trial<D>) -> (&[f64], &'t mut [f64]) {
        let (n, here) = (self.history_len, p - trial.first);
        let kept = self.law(p).state_fields().len();
        (&self.old_history[p * n..][..kept], &mut trial.history[here * n..][..kept])
    }

    #[inline(always)]
    pub(super) fn law(&self, p: usize) -> &dyn Material {
        if let Some(laws) = self.laws {
            return laws[p];
        }
        let body = &self.model.bodies[self.body[p] as usize];
        if let Some(Some(law)) = self.step_laws.get(body.material) {
            return law.as_ref();
        }
        self.model.materials[body.material].law.as_ref()
    }
}

/// Groups that are evaluated one after the other with the vector instructions of the processor, in one of the two
/// formulations.
struct Groups<'t, 'a, 'w, const D: usize, M, const UPDATED: bool> {
    task: &'t Task<'a, D, M>,
    groups: Range<usize>,
    work: Work<'w, D>,
}

impl<const D: usize, M: Mechanics<D>, const UPDATED: bool> WithSimd for Groups<'_, '_, '_, D, M, UPDATED> {
    type Output = Result<(), PointFailure>;

    /// Chooses the form of the stiffness of each group. On processors without vector instructions, and in the updated
    /// Lagrangian formulation, which is a cross-check, only the general forms are used; they add the same numbers in
    /// the same order.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Groups { task, groups, work: Work { mut trial, mut dense, mut force, mut room } } = self;
        let symmetric = task.pairs.symmetric();
        let cell = &mut CellRoom::default();
        for group in groups {
            let (blocks, rest) = dense.split_at_mut(task.pairs.dense_range(group..group + 1).len());
            dense = rest;
            let (force_of_group, rest) = force.split_at_mut(task.links.nodes_of(group).len());
            force = rest;
            force_of_group.fill([0.0; D]);
            let (n, whole) = (force_of_group.len(), task.links.is_whole(group));
            let (trial, room) = (&mut trial, &mut room);
            let group = Group::<D, M, UPDATED> { task, group, trial, room, cell, force: force_of_group };
            match n {
                _ if task.wanted == Wanted::Force => {
                    group.add(simd, &mut Forces)?;
                }
                8 if const { D == 3 && !S::IS_SCALAR && !UPDATED } && whole => {
                    group.add(simd, &mut Cell::<D, 8, 2>::zero(symmetric))?.store(blocks);
                }
                4 if const { D == 3 && !S::IS_SCALAR && !UPDATED } && whole => {
                    group.add(simd, &mut Cell::<D, 4, 1>::zero(symmetric))?.store(blocks);
                }
                4 if const { D == 2 && !S::IS_SCALAR && !UPDATED } && whole && symmetric => {
                    group.add(simd, &mut Whole::<D, 4>::zero())?.store(blocks);
                }
                3 if const { D == 2 && !S::IS_SCALAR && !UPDATED } && whole && symmetric => {
                    group.add(simd, &mut Whole::<D, 3>::zero())?.store(blocks);
                }
                4 if const { D == 2 && !S::IS_SCALAR && !UPDATED } && whole => {
                    group.add(simd, &mut Cell::<D, 4, 1>::zero(symmetric))?.store(blocks);
                }
                3 if const { D == 2 && !S::IS_SCALAR && !UPDATED } && whole => {
                    group.add(simd, &mut Cell::<D, 3, 1>::zero(symmetric))?.store(blocks);
                }
                _ => {
                    blocks.fill([[0.0; D]; D]);
                    if symmetric {
                        group.add(simd, &mut Triangle(blocks))?;
                    } else {
                        group.add(simd, &mut Square { blocks, nodes: n })?;
                    }
                }
            }
        }
        Ok(())
    }
}

/// The points of one group.
struct Group<'t, 'a, 's, 'r, const D: usize, M: Mechanics<D>, const UPDATED: bool> {
    task: &'t Task<'a, D, M>,
    group: usize,
    trial: &'t mut Trial<'s, D>,
    room: &'t mut LinkBuffer<'r, D>,
    cell: &'t mut CellRoom<D, M>,
    force: &'t mut [[f64; D]],
}

impl<const D: usize, M: Mechanics<D>, const UPDATED: bool> Group<'_, '_, '_, '_, D, M, UPDATED> {
    /// Adds the points, compiled for one set of instructions and one form of the stiffness; returns the stiffness.
    #[inline(always)]
    fn add<S: Simd, K: Dense<D>>(self, simd: S, dense: &mut K) -> Result<&mut K, PointFailure> {
        let Group { task, group, trial, room, cell, force } = self;
        simd.vectorize(Vectorised::<D, M, K, UPDATED> { task, group, trial, room, force, dense, cell })?;
        Ok(dense)
    }
}

/// The evaluation of the points of one group, to be compiled for several instruction sets. The choice of
/// instruction set does not change the result: products and sums are rounded one by one.
pub(super) struct Vectorised<'t, 'a, 's, 'r, const D: usize, M: Mechanics<D>, K, const UPDATED: bool> {
    pub(super) task: &'t Task<'a, D, M>,
    pub(super) group: usize,
    pub(super) trial: &'t mut Trial<'s, D>,
    pub(super) room: &'t mut LinkBuffer<'r, D>,
    pub(super) force: &'t mut [[f64; D]],
    pub(super) dense: &'t mut K,
    /// Working space for the points of a material in a cell.
    pub(super) cell: &'t mut CellRoom<D, M>,
}

impl<const D: usize, M: Mechanics<D>, K: Dense<D>, const UPDATED: bool> WithSimd
    for Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>
{
    type Output = Result<(), PointFailure>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Self::Output {
        let points = self.task.links.points_of(self.group);
        if self.task.dilated { self.add_dilated(points) } else { self.add(points) }
    }
}

impl<const D: usize, M: Mechanics<D>, K: Dense<D>, const UPDATED: bool>
    Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>
{
    /// Adds points one after the other, or several at once.
    #[inline(always)]
    pub(super) fn add(&mut self, points: Range<usize>) -> Result<(), PointFailure> {
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

    /// Adds the first points of a range at once, if they share a law that supports this; returns the number of points
    /// added.
    #[inline(always)]
    fn add_side_by_side(&mut self, points: Range<usize>) -> Result<Option<usize>, PointFailure> {
        let task = self.task;
        let p = points.start;
        let law = task.law(p);
        if UPDATED || task.stored.is_some() || !M::VECTORISED || !suits_lanes(law) {
            return Ok(None);
        }
        let kept = law.state_fields().len();
        let alike = task.body[points].iter().take_while(|&&body| body == task.body[p]);
        let count = alike.take(Lanes::WIDTH).count();
        // Unused lanes repeat the last point.
        let last = p + count - 1;
        let lanes_of = [p, last.min(p + 1), last.min(p + 2), last.min(p + 3)];
        let [a, b, c, d] = lanes_of;
        let starts = [&task.start[a], &task.start[b], &task.start[c], &task.start[d]];
        let (group, room) = (self.group, &mut *self.room);
        // A closure might not be inlined, and would then be compiled without vector instructions.
        let increments = [
            task.increment(group, a, room),
            task.increment(group, b, room),
            task.increment(group, c, room),
            task.increment(group, d, room),
        ];
        let n = task.history_len;
        let mut history = [Lanes::ZERO; MAX_HISTORY];
        for (h, lanes) in history[..kept].iter_mut().enumerate() {
            *lanes = Lanes::gather(|l| task.old_history[lanes_of[l] * n + h]);
        }
        let Some(responses) = M::respond_vectorised(starts, &increments, law, &mut history[..kept]) else {
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
        let Vectorised { task, group, trial, room, force, dense, .. } = self;
        let failure = |error| PointFailure { point: p, error };
        let (start, law) = (&task.start[p], task.law(p));
        let links = task.links.links(p, room);
        let nodes = task.links.nodes_of(*group);
        let increment = Increment::new(M::REVOLVED, nodes, &links, task.delta_d, &task.position[p]);
        if let Some(stored) = task.stored {
            let (old, new) = task.histories(p, trial);
            let response = M::respond_current(start, &increment, law, old, new).map_err(failure)?;
            let volume = start.volume_n / start.J_n;
            let growth =
                (*old == *new).then(|| volume * law.energy(&response.elastic_strain, new) - stored[p]);
            let at_start = StressAtStart { tau: task.old_stress[p], volume };
            let mean = |end: M::Current| {
                end.averaged(&at_start, &increment, growth, task.wanted == Wanted::Stiffness)
            };
            keep(p, &response.map(mean), &links, trial, *dense, force);
            return Ok(());
        }
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
            let response = M::respond_current(start, &increment, law, old, new);
            keep(p, response.as_ref().map_err(|e| failure(*e))?, &links, trial, *dense, force);
        } else {
            let response = M::respond(start, &increment, law, old, new);
            keep(p, response.as_ref().map_err(|e| failure(*e))?, &links, trial, *dense, force);
        }
        Ok(())
    }
}

impl<const D: usize> Trial<'_, D> {
    /// Stores the stress and strain of a point.
    #[inline(always)]
    pub(super) fn keep<W>(&mut self, p: usize, response: &PointResponse<W>) {
        let here = p - self.first;
        self.elastic_strain[here] = response.elastic_strain;
        self.kirchhoff_stress[here] = response.tau;
    }

    /// Stores the deviation of a point from the mean increment of its cell.
    #[inline(always)]
    pub(super) fn keep_deviation(&mut self, p: usize, deviated: Deviated) {
        if let Some(kept) = self.deviated.get_mut(p - self.first) {
            *kept = deviated;
        }
    }
}

/// Stores the response of a point and adds its contribution.
#[inline(always)]
fn keep<const D: usize, W: WeakForm<D>>(
    p: usize,
    response: &PointResponse<W>,
    links: &Links<D>,
    trial: &mut Trial<D>,
    dense: &mut impl Dense<D>,
    force: &mut [[f64; D]],
) {
    trial.keep(p, response);
    let gradients = match response.weak.inverse() {
        None => links.gradient,
        Some(inverse) => map_gradients(inverse, links.gradient, trial.mapped),
    };
    dense.add(&response.weak, links, gradients, force, &|_, _| ());
}

/// ∂S/∂x = ∂S/∂X̃ ΔF⁻¹, eq. (8), for one point.
#[inline(always)]
pub(super) fn map_gradients<'a, const D: usize>(
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
