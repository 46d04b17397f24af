//! The material points: internal force and stiffness of the bodies, eqs. (19)-(23), (27), (28), or (2)-(6) in the
//! updated Lagrangian formulation.
//!
//! Each group of points accumulates one dense block on the few nodes it touches; the blocks are then merged in the
//! order of the groups. Points write only their own trial state and blocks, so threads never write to the same memory,
//! and the order of every sum is fixed: the result has the same bits for any number of threads.
#![allow(non_snake_case)]

mod averaged;
mod batched;
mod cell_room;
mod deviation;
mod dilatation;
mod evaluation;
mod mean;
mod mean_of_step;
mod mean_room;
mod viscosity;

use std::marker::PhantomData;
use std::ops::Range;

use rayon::prelude::*;

use crate::assembly::{NodePairs, System, UNCOUPLED, Wanted};
use crate::basis::{Connectivity, LinkBuffer};
use crate::linear::Block;
use crate::material::{Material, Viscous, effective};
use crate::model::{Model, Scheme};
use crate::points::{PIECE, Points};
use crate::step::{At, Experiment, StepContext, displacement};
use crate::stress::{CellStrain, Mechanics, StartOfStep};
use crate::tensor::Sym3;

use super::failure::{BeginError, EvaluateError, PointFailure};
use super::layout::Layout;
use super::ledger::{Ledger, NamedEnergy};
use super::multipliers::{Augmentation, Multipliers};
use super::term::{Character, Coupled, Term};

use batched::{Batch, batches, laws_that_answer, laws_that_note};
use deviation::Deviations;
use evaluation::{Task, Trial, Work};
use mean_of_step::MeanOfStep;

/// Groups are evaluated in batches of about this many node-pair blocks, so that the dense blocks stay in cache.
const BATCH: usize = 1 << 14;

/// Point data that take no more memory than this, [bytes], are kept from step to step: in small analyses, freeing them
/// saves less than allocating them anew costs. Unit tests keep nothing.
const KEPT: usize = if cfg!(test) { 0 } else { 1 << 22 };

/// The material points, with the mechanics of an idealisation.
pub struct MaterialPoints<const D: usize, M> {
    /// Data of each point that are constant during the step.
    start: Vec<StartOfStep>,
    batches: Vec<Range<usize>>,
    /// The dense blocks of the current batch, and of the previous one, which is being merged.
    dense: [DenseBatch<D>; 2],
    /// Working space for the basis functions of one point of each group.
    value: Vec<f64>,
    gradient: Vec<[f64; D]>,
    /// Working space for the gradients of one point of each group in the current configuration, eq. (8).
    mapped: Vec<[f64; D]>,
    /// For each group, true if it has several points, at least one of which belongs to a body whose points share a mean;
    /// empty if there is no such body.
    averaged: Vec<bool>,
    deviations: Deviations,
    /// One batch of points for each law that is evaluated for all its points at once.
    batched: Vec<Batch>,
    /// The law of each material for the current step: with reduced strength, or for the duration of the step; `None` if
    /// it is the law itself. Empty if this holds for all materials.
    step_laws: Vec<Option<Box<dyn Material>>>,
    /// True if the strength is reduced in the current step.
    reduces_strength: bool,
    /// The mean over a step with inertia; `None` in statics.
    mean: Option<MeanOfStep<D>>,
    /// The stress at the start of the step, with the excess pressure of pore water, [stress]; empty if no law has such
    /// water.
    stress_at_start: Vec<Sym3>,
    mechanics: PhantomData<M>,
}

impl<const D: usize, M> Default for MaterialPoints<D, M> {
    fn default() -> Self {
        MaterialPoints {
            start: Vec::new(),
            batches: Vec::new(),
            dense: Default::default(),
            value: Vec::new(),
            gradient: Vec::new(),
            mapped: Vec::new(),
            averaged: Vec::new(),
            deviations: Deviations::default(),
            batched: Vec::new(),
            step_laws: Vec::new(),
            reduces_strength: false,
            mean: None,
            stress_at_start: Vec::new(),
            mechanics: PhantomData,
        }
    }
}

/// The dense blocks of the groups of a batch, one after the other, and their nodal forces.
#[derive(Default)]
struct DenseBatch<const D: usize> {
    blocks: Vec<Block<D>>,
    force: Vec<[f64; D]>,
}

impl<const D: usize, M: Mechanics<D>> MaterialPoints<D, M> {
    /// Divides the groups into batches, and makes room for the largest.
    fn make_room(&mut self, links: &Connectivity<D>, pairs: &NodePairs) {
        let mut first = 0;
        for group in 0..links.n_groups() {
            if pairs.dense_range(first..group + 1).len() > BATCH && group > first {
                self.batches.push(first..group);
                first = group;
            }
        }
        if first < links.n_groups() {
            self.batches.push(first..links.n_groups());
        }
        let largest = |len: &dyn Fn(&Range<usize>) -> usize| self.batches.iter().map(len).max().unwrap_or(0);
        let n_dense = largest(&|b| pairs.dense_range(b.clone()).len());
        let n_force = largest(&|b| b.clone().map(|g| links.nodes_of(g).len()).sum());
        for dense in &mut self.dense {
            dense.blocks.resize(n_dense, [[0.0; D]; D]);
            dense.force.resize(n_force, [0.0; D]);
        }
        self.value.resize(n_force, 0.0);
        self.gradient.resize(n_force, [0.0; D]);
        self.mapped.resize(n_force, [0.0; D]);
    }
}

impl<const D: usize, M: Mechanics<D>> MaterialPoints<D, M> {
    /// Evaluates the points at the end of the step or, where these average the stress itself, in the mean over it.
    fn evaluate_end<const N: usize>(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        if self.batched.is_empty() {
            self.pass(step, points, at, Pass { laws: None, adds: true, wanted }, sum)?;
        } else {
            let mut batched = std::mem::take(&mut self.batched);
            let outcome = self.evaluate_batched(step, points, at, wanted, sum, &mut batched);
            self.batched = batched;
            outcome?;
        }
        if !self.stress_at_start.is_empty() {
            keep_effective_stress(step.model, points);
        }
        Ok(())
    }

    /// Replaces force and stiffness at the end of a step with inertia by those of the mean over the step. As the points
    /// are the first term, the sums contain nothing else.
    fn average<const N: usize>(&mut self, weight: f64, at: At<N>, wanted: Wanted, sum: &mut System<N>) {
        if let Some(mean) = &mut self.mean {
            mean.average(weight, at, wanted, sum);
        }
    }
}

/// J times the excess pore pressure of a point with the history variables `history` of all points, [stress].
fn pore_stress<const D: usize>(model: &Model<D>, points: &Points<D>, history: &[f64], p: usize) -> f64 {
    let law = model.law(points, p);
    law.pore_stress(&history[p * points.history_len..][..law.state_fields().len()])
}

/// Takes the excess pressure of pore water out of the stress that the laws have returned.
fn keep_effective_stress<const D: usize>(model: &Model<D>, points: &mut Points<D>) {
    let mut stress = std::mem::take(&mut points.trial.kirchhoff_stress);
    let (shared, n) = (&*points, points.history_len);
    stress.par_iter_mut().with_min_len(PIECE).enumerate().for_each(|(p, tau)| {
        let law = model.law(shared, p);
        let history = &shared.trial.history[p * n..][..law.state_fields().len()];
        *tau = effective(law, *tau, history);
    });
    points.trial.kirchhoff_stress = stress;
}

/// One evaluation of all points.
struct Pass<'a> {
    /// The law of each point, if some laws are stand-ins for laws that are evaluated in batches.
    laws: Option<&'a [&'a dyn Material]>,
    /// True if the points add force and stiffness to the system.
    adds: bool,
    wanted: Wanted,
}

impl<const D: usize, M: Mechanics<D>> MaterialPoints<D, M> {
    /// Evaluates all points in the order of their groups, and writes their trial state.
    fn pass<const N: usize>(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        Pass { laws, adds, wanted }: Pass,
        sum: &mut System<N>,
    ) -> Result<(), PointFailure> {
        let StepContext { model, links, .. } = *step;
        let System { pairs, blocks, internal, .. } = sum;
        let MaterialPoints {
            start,
            batches,
            dense,
            value,
            gradient,
            mapped,
            deviations,
            step_laws,
            mean,
            stress_at_start,
            ..
        } = self;
        let stored = match mean {
            Some(MeanOfStep::Stress { stored, .. }) => Some(stored.as_slice()),
            _ => None,
        };
        let Deviations { held, trial: deviated, .. } = deviations;
        let [mut current, mut before] = dense.each_mut();
        let mut merged = 0..0;
        let delta_d = displacement(at.delta_d);
        let dilated = model.bodies.iter().any(|body| body.strain != CellStrain::Standard);
        for batch in batches.iter().cloned() {
            let task = Task::<D, M> {
                model,
                body: &points.body,
                cell: &points.cell,
                position: &points.converged.position,
                half_lengths: &points.converged.half_lengths,
                history_len: points.history_len,
                old_history: &points.converged.history,
                start,
                held,
                links,
                pairs,
                delta_d: &delta_d,
                dilated,
                wanted,
                laws,
                step_laws,
                stored,
                old_stress: if stress_at_start.is_empty() {
                    &points.converged.kirchhoff_stress
                } else {
                    stress_at_start
                },
                mechanics: PhantomData,
            };
            let first = links.points_of(batch.start).start;
            let last = links.points_of(batch.end - 1).end;
            let n = points.history_len;
            let trial = Trial {
                first,
                elastic_strain: &mut points.trial.elastic_strain[first..last],
                kirchhoff_stress: &mut points.trial.kirchhoff_stress[first..last],
                history: &mut points.trial.history[first * n..last * n],
                deviated: deviated.get_mut(first..last).unwrap_or_default(),
                mapped,
            };
            let room = LinkBuffer { value, gradient };
            let work = Work { trial, dense: &mut current.blocks, force: &mut current.force, room };
            let (outcome, ()) = rayon::join(
                || task.run(batch.clone(), work),
                || merge(pairs, links, merged.clone(), before, blocks, internal, wanted),
            );
            outcome?;
            if adds {
                merged = batch;
            }
            std::mem::swap(&mut current, &mut before);
        }
        merge(pairs, links, merged, before, blocks, internal, wanted);
        Ok(())
    }

    /// Evaluates the points of a model that has laws evaluated for all their points at once; each of these laws is
    /// called once, in the order of the materials.
    fn evaluate_batched<const N: usize>(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
        batched: &mut [Batch],
    ) -> Result<(), EvaluateError> {
        let model = step.model;
        let noting: Vec<_> = batched.iter().map(|batch| batch.noting(model)).collect();
        let laws = laws_that_note(batched, &noting, points.len());
        self.pass(step, points, at, Pass { laws: Some(&laws), adds: false, wanted: Wanted::Force }, sum)?;
        for (batch, noted) in batched.iter_mut().zip(&noting) {
            batch.evaluate(model, noted)?;
        }
        let answering: Vec<_> = batched.iter().map(|batch| batch.answering(model)).collect();
        let step_laws = std::mem::take(&mut self.step_laws);
        let laws = laws_that_answer(model, points, &step_laws, batched, &answering);
        let outcome = self.pass(step, points, at, Pass { laws: Some(&laws), adds: true, wanted }, sum);
        drop(laws);
        self.step_laws = step_laws;
        Ok(outcome?)
    }
}

impl<const D: usize, const N: usize, M: Mechanics<D>> Term<D, N> for MaterialPoints<D, M> {
    fn name(&self) -> &'static str {
        "material points"
    }

    fn character(&self, model: &Model<D>) -> Character {
        let has_f_bar = model.bodies.iter().any(|body| body.strain == CellStrain::FBar);
        let step_laws = self.step_laws.iter().flatten().map(|law| law.as_ref());
        let mut laws = model.materials.iter().map(|material| material.law.as_ref()).chain(step_laws);
        let is_symmetric = !has_f_bar && laws.all(|law| law.tangent_is_symmetric());
        let is_symmetric = is_symmetric && !MeanOfStep::<D>::is_of_stress(model);
        Character { is_symmetric, may_slump: true, ..Character::SMOOTH }
    }

    fn couples(&self, couple: &mut dyn FnMut(Coupled)) {
        let averaged = self.averaged.iter().enumerate().filter(|(_, averaged)| **averaged);
        averaged.for_each(|(group, _)| couple(Coupled::Group(group)));
    }

    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError> {
        let model = step.model;
        self.batches.clear();
        let start = (0..points.len()).into_par_iter().with_min_len(PIECE).map(|p| {
            let J_n = points.converged.deformation_gradient[p].determinant();
            let measure = model.law(points, p).strain_measure();
            StartOfStep {
                b_n: M::elastic_left_cauchy_green(measure, &points.converged.elastic_strain[p]),
                J_n,
                volume_n: model.volume(points, p),
            }
        });
        start.collect_into_vec(&mut self.start);
        self.stress_at_start.clear();
        if model.has_pore_water() {
            self.stress_at_start.extend((0..points.len()).map(|p| {
                let water = pore_stress(model, points, &points.converged.history, p);
                points.converged.kirchhoff_stress[p] - Sym3::IDENTITY * water
            }));
        }
        self.batched = batches(model, points);
        let factor = model.stepping.strength_at(step.step.end);
        self.reduces_strength = factor.is_some();
        let laws = model.materials.iter().map(|material| {
            let reduced = factor.and_then(|factor| material.law.with_strength_divided(factor));
            let law = reduced.as_deref().unwrap_or(material.law.as_ref());
            let law = law.for_duration(step.step.duration()).or(reduced);
            let present = law.as_deref().unwrap_or(material.law.as_ref());
            let regularised = if step.experiment == Some(Experiment::ElasticMaterials) {
                Viscous::elastic(present)
            } else if step.viscosity > 0.0 {
                Viscous::new(present, step.viscosity)
            } else {
                None
            };
            regularised.map(|law| Box::new(law) as Box<dyn Material>).or(law)
        });
        self.step_laws = laws.collect();
        if self.step_laws.iter().all(Option::is_none) {
            self.step_laws.clear();
        }
        self.averaged.clear();
        if model.bodies.iter().any(|body| body.strain.is_mean()) {
            let takes_mean = |body: u16| model.bodies[body as usize].strain.is_mean();
            self.averaged.extend((0..step.links.n_groups()).map(|group| {
                let bodies = &points.body[step.links.points_of(group)];
                bodies.len() > 1 && bodies.iter().any(|&body| takes_mean(body))
            }));
        }
        self.deviations.begin(model, points);
        self.mean = MeanOfStep::new(step, points, &self.start);
        Ok(())
    }

    fn evaluate(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        if self.batches.is_empty() {
            self.make_room(step.links, &sum.pairs);
        }
        if self.mean.as_ref().is_some_and(|mean| mean.lacks_start())
            && at.delta_d.as_flattened().iter().any(|u| *u != 0.0)
        {
            let zero = vec![[0.0; N]; at.delta_d.len()];
            let at_start = At { delta_d: &zero, ..at };
            self.evaluate_end(step, points, at_start, Wanted::Force, sum)?;
            self.average(step.weight(), at_start, Wanted::Force, sum);
            sum.internal_force_mut().fill([0.0; N]);
        }
        self.evaluate_end(step, points, at, wanted, sum)?;
        self.average(step.weight(), at, wanted, sum);
        Ok(())
    }

    /// The elastic energy counts from the undeformed state.
    fn ledger(&self, step: &StepContext<D>, points: &Points<D>, _: At<N>) -> Ledger {
        let [mut elastic, mut plastic_work, mut undone] = [0.0; 3];
        for batch in batches(step.model, points) {
            let [stored, plastic] = batch.energies(step.model, points);
            elastic += stored;
            plastic_work += plastic;
        }
        for p in 0..points.len() {
            let law = step.model.law(points, p);
            if law.batch().is_some() {
                continue;
            }
            let own = p * points.history_len..p * points.history_len + law.state_fields().len();
            let (old, new) = (&points.converged.history[own.clone()], &points.trial.history[own]);
            let volume = points.original_volume[p];
            elastic += law.energy(&points.trial.elastic_strain[p], new) * volume;
            plastic_work += law.plastic_work(new) * volume;
            let material = step.model.bodies[points.body[p] as usize].material;
            if self.reduces_strength
                && let Some(Some(reduced)) = self.step_laws.get(material)
            {
                let growth = |law: &dyn Material| law.plastic_work(new) - law.plastic_work(old);
                undone += (growth(law) - growth(reduced.as_ref())) * volume;
            }
        }
        let mut ledger = Ledger::from([
            NamedEnergy::stored(Ledger::ELASTIC, [0.0, elastic]),
            NamedEnergy::dissipated_so_far(Ledger::PLASTIC, plastic_work),
            NamedEnergy::supplied(Ledger::UNDONE, undone),
        ]);
        if step.viscosity > 0.0 {
            ledger.add(NamedEnergy::dissipated(Ledger::VISCOUS, viscosity::dissipation(step, points)));
        }
        self.deviations.ledger(step.model, &self.start, &mut ledger);
        if let (Some(mean), Some(dynamics)) = (&self.mean, step.dynamics()) {
            let grown = elastic + plastic_work - undone - mean.energy_at_start();
            let name = if dynamics.scheme == Scheme::Midpoint { Ledger::DEFECT } else { Ledger::ALGORITHMIC };
            ledger.add(NamedEnergy::dissipated(name, mean.work() - grown));
        }
        ledger
    }

    fn commit(&mut self, step: &StepContext<D>, points: &mut Points<D>) {
        self.deviations.commit(step.model, points, &self.start);
    }

    fn layout(&mut self) -> Option<&mut dyn Layout> {
        Some(self)
    }

    fn multipliers(&mut self) -> Option<&mut dyn Multipliers<D, N>> {
        // Only deviations from mean increments hold something constant during the iterations.
        if self.deviations.are_used { Some(self) } else { None }
    }
}

impl<const D: usize, const N: usize, M: Mechanics<D>> Multipliers<D, N> for MaterialPoints<D, M> {
    fn augment(
        &mut self,
        step: &StepContext<D>,
        points: &Points<D>,
        _: At<N>,
    ) -> Result<Augmentation, EvaluateError> {
        Ok(self.deviations.follow_flow(step, points, &self.start))
    }
}

impl<const D: usize, M: Mechanics<D>> Layout for MaterialPoints<D, M> {
    fn forget_layout(&mut self) {
        self.batches.clear();
    }

    fn conclude(&mut self) {
        self.batched = Vec::new();
        // Deviations still need it when the step is committed.
        if self.deviations.trial.is_empty() && size_of_val(self.start.as_slice()) > KEPT {
            self.start = Vec::new();
        }
    }
}

/// Adds the dense blocks of a batch to the system, in the order of its groups.
fn merge<const D: usize, const N: usize>(
    pairs: &NodePairs,
    links: &Connectivity<D>,
    batch: Range<usize>,
    dense: &DenseBatch<D>,
    blocks: &mut [Block<N>],
    internal: &mut [[f64; N]],
    wanted: Wanted,
) {
    let (mut k, mut f) = (0, 0);
    for group in batch {
        for &node in links.nodes_of(group) {
            add(&mut internal[node as usize], &dense.force[f]);
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

/// Adds `x` to the first components of `sum`.
fn add<const D: usize, const N: usize>(sum: &mut [f64; N], x: &[f64; D]) {
    for d in 0..D {
        sum[d] += x[d];
    }
}
