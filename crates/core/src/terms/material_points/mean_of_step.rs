//! The mean force of the points over a step with inertia.

use crate::assembly::{System, Wanted};
use crate::model::{Model, Scheme};
use crate::points::Points;
use crate::step::{At, Nodal, StepContext};
use crate::stress::{CellStrain, StartOfStep};

/// The mean over a step with inertia.
#[derive(Debug)]
pub(super) enum MeanOfStep<const D: usize> {
    /// Each point adds the mean of its stress, such that its work is the growth of the stored energy.
    Stress {
        /// Stored energy V⁰ W of each point at the start of the step, [energy].
        stored: Vec<f64>,
        account: Account,
    },
    /// The forces at the start and at the end are averaged.
    Force {
        /// Force at the start, [force]; `None` before the first evaluation.
        start: Option<Nodal<D>>,
        account: Account,
    },
}

/// What the ledger needs to know.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Account {
    /// Stored energy and plastic work at the start of the step, [energy].
    energy_at_start: f64,
    /// Work of the mean force over the step, [energy].
    work: f64,
}

impl<const D: usize> MeanOfStep<D> {
    /// True if the points average their stress in the current stage of a model: with the midpoint rule, if all points
    /// respond to their own increments one by one.
    pub(super) fn is_of_stress(model: &Model<D>) -> bool {
        let is_midpoint = model.stepping.dynamics.is_some_and(|of| of.scheme == Scheme::Midpoint);
        is_midpoint
            && model.bodies.iter().all(|body| body.strain == CellStrain::Standard)
            && model.materials.iter().all(|material| material.law.batch().is_none())
    }

    /// The mean over a step; `None` in statics.
    pub(super) fn new(step: &StepContext<D>, points: &Points<D>, start: &[StartOfStep]) -> Option<Self> {
        step.dynamics()?;
        let model = step.model;
        let of_stress = MeanOfStep::is_of_stress(model);
        let (mut stored, mut energy_at_start) = (Vec::new(), 0.0);
        for p in 0..points.len() {
            let law = model.law(points, p);
            let history = &points.converged.history[p * points.history_len..][..law.state_fields().len()];
            let density = law.energy(&points.converged.elastic_strain[p], history);
            energy_at_start += (density + law.plastic_work(history)) * points.original_volume[p];
            if of_stress {
                stored.push(density * start[p].volume_n / start[p].J_n);
            }
        }
        let account = Account { energy_at_start, work: 0.0 };
        Some(match of_stress {
            true => MeanOfStep::Stress { stored, account },
            false => MeanOfStep::Force { start: None, account },
        })
    }

    /// True if the force at the start of the step is not yet known.
    pub(super) fn lacks_start(&self) -> bool {
        matches!(self, MeanOfStep::Force { start: None, .. })
    }

    /// Stored energy and plastic work at the start of the step, [energy].
    pub(super) fn energy_at_start(&self) -> f64 {
        self.account().energy_at_start
    }

    /// Work of the mean force over the step, [energy].
    pub(super) fn work(&self) -> f64 {
        self.account().work
    }

    fn account(&self) -> Account {
        match self {
            MeanOfStep::Stress { account, .. } | MeanOfStep::Force { account, .. } => *account,
        }
    }

    /// Averages the sums, which contain the force and the stiffness of the points alone; the first evaluation is that of
    /// the state at the start.
    pub(super) fn average<const N: usize>(
        &mut self,
        weight: f64,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) {
        if let MeanOfStep::Force { start, .. } = self {
            let first = || -> Nodal<D> {
                sum.internal.iter().map(|force| std::array::from_fn(|d| force[d])).collect()
            };
            let start = start.get_or_insert_with(first);
            for (force, start) in sum.internal.iter_mut().zip(start) {
                (0..D).for_each(|d| force[d] = weight * force[d] + (1.0 - weight) * start[d]);
            }
            if wanted == Wanted::Stiffness {
                sum.blocks.iter_mut().flatten().flatten().for_each(|entry| *entry *= weight);
            }
        }
        let forces = sum.internal.iter().zip(at.delta_d);
        let of_node = |(force, u): (&[f64; N], &[f64; N])| (0..D).map(|d| force[d] * u[d]).sum::<f64>();
        let work = forces.map(of_node).sum();
        match self {
            MeanOfStep::Stress { account, .. } | MeanOfStep::Force { account, .. } => account.work = work,
        }
    }
}
