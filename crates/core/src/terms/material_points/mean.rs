//! The evaluation of points that take the mean increment of their cell; see [`crate::stress::Deviation`].
//!
//! The points of a material in a group are those of one cell, or of one patch of triangles or tetrahedra. They respond
//! to their mean increment, and add their force and stiffness as one point. Then each adds the stress that resists its
//! deviation from this increment.
#![allow(non_snake_case)]

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use crate::assembly::Dense;
use crate::basis::LinkBuffer;
use crate::kinematics::Increment;
use crate::stress::{Deviated, Deviating, Mechanics, Resistance, Summable, WeakForm};
use crate::terms::failure::PointFailure;

use super::averaged::Kind;
use super::cell_room::{CellRoom, Motion};
use super::deviation::Held;
use super::evaluation::{Task, Trial, Vectorised, map_gradients};
use super::mean_room::MeanRoom;

/// The points of one material in a group, which respond to their mean increment.
struct Mean<'t, 'a, 's, 'r, const D: usize, M: Mechanics<D>> {
    task: &'t Task<'a, D, M>,
    group: usize,
    /// The points of the group that may be of this material; the first one is.
    points: Range<usize>,
    kind: Kind,
    trial: &'t mut Trial<'s, D>,
    room: &'t mut LinkBuffer<'r, D>,
    cell: &'t mut CellRoom<D, M>,
}

impl<const D: usize, M: Mechanics<D>, K: Dense<D>, const UPDATED: bool>
    Vectorised<'_, '_, '_, '_, D, M, K, UPDATED>
{
    /// Adds the points of one material with their mean increment.
    #[inline(always)]
    pub(super) fn add_mean(&mut self, points: Range<usize>, kind: Kind) -> Result<(), PointFailure> {
        let Vectorised { task, group, trial, room, force, dense, cell, .. } = self;
        let mean = Mean { task, group: *group, points, kind, trial, room, cell };
        let weak = mean.find()?;
        let MeanRoom { mean, own, together, deviating, deviations, .. } = &mut cell.mean;
        dense.add_on_all(&weak, together, force);
        for ((p, motion), weak) in cell.moved.iter().zip(deviations) {
            own.clear(mean.gradient.len());
            own.add(&task.links.links(*p, room), 1.0, radius(&motion.increment));
            deviating.clear();
            deviating.extend(
                own.slopes().zip(mean.slopes()).map(|(own, mean)| M::Deviation::gradients(own, mean)),
            );
            dense.add_on_all(weak, deviating, force);
        }
        Ok(())
    }
}

/// Distance of a point from the axis of revolution; 1 for other bodies.
#[inline(always)]
fn radius<const D: usize>(increment: &Increment<D>) -> f64 {
    if increment.radius > 0.0 { increment.radius } else { 1.0 }
}

impl<const D: usize, M: Mechanics<D>> Mean<'_, '_, '_, '_, D, M> {
    /// Evaluates the points and stores their stress and strain; returns the sum of their weak forms.
    // Inlined, this function would be compiled once for each form of the stiffness.
    #[inline(never)]
    fn find(self) -> Result<M::Current, PointFailure> {
        Arch::new().dispatch(self)
    }
}

impl<const D: usize, M: Mechanics<D>> WithSimd for Mean<'_, '_, '_, '_, D, M> {
    type Output = Result<M::Current, PointFailure>;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> Self::Output {
        let mean = self.mean_increment()?;
        self.deviate(&mean);
        let weak = self.respond(&mean)?;
        self.map_mean_gradients(&weak);
        Ok(weak)
    }
}

impl<const D: usize, M: Mechanics<D>> Mean<'_, '_, '_, '_, D, M> {
    /// ΔF̄, and the mean gradients. The distance of the increment from the axis of revolution is 1, because S/r̃ is
    /// already divided by it.
    #[inline(always)]
    fn mean_increment(&mut self) -> Result<Increment<D>, PointFailure> {
        let Mean { task, group, points, kind, room, cell, .. } = self;
        let CellRoom { moved, mean: MeanRoom { mean, .. }, .. } = &mut **cell;
        moved.clear();
        let mut volume = 0.0;
        for p in points.clone().filter(|p| task.kind(*p) == *kind) {
            moved.push((p, Motion::new(p, task.increment(*group, p, room))?));
            volume += task.start[p].volume_n;
        }
        mean.clear(task.links.nodes_of(*group).len());
        let mut increment = Increment { dF: [[0.0; D]; D], hoop: 0.0, radius: 1.0 };
        for (p, motion) in moved.iter() {
            let share = task.start[*p].volume_n / volume;
            let Increment { dF, hoop, .. } = &motion.increment;
            for i in 0..D {
                for j in 0..D {
                    increment.dF[i][j] += share * dF[i][j];
                }
            }
            increment.hoop += share * hoop;
            mean.add(&task.links.links(*p, room), share, radius(&motion.increment));
        }
        if !M::REVOLVED {
            increment.hoop = 1.0;
        }
        Motion::new(points.start, increment)?;
        Ok(increment)
    }

    /// The stresses that resist the deviations from the mean increment.
    #[inline(always)]
    fn deviate(&mut self, mean: &Increment<D>) {
        let Mean { task, trial, cell, .. } = self;
        let CellRoom { moved, mean: MeanRoom { deviations, .. }, .. } = &mut **cell;
        let sum = |value: &dyn Fn(usize) -> f64| -> f64 {
            moved.iter().map(|(p, _)| task.start[*p].volume_n * value(*p)).sum()
        };
        let held = |p: usize| task.held.get(p).copied().unwrap_or(Held::NONE);
        let left = Held::left(sum(&|p| held(p).lost) / sum(&|_| 1.0));
        let in_space = mean.in_space();
        deviations.clear();
        for (p, motion) in moved.iter() {
            let Held { stress, modulus, .. } = held(*p);
            let resistance = Resistance { stress, modulus, left };
            let own = &motion.increment;
            let deviated = Deviated::new(&in_space, &own.in_space(), &resistance);
            let volume = task.start[*p].volume_n;
            deviations.push(M::Deviation::new(mean, own, &deviated, &resistance, volume));
            trial.keep_deviation(*p, deviated);
        }
    }

    /// The sum of the weak forms of the points at their mean increment.
    #[inline(always)]
    fn respond(&mut self, mean: &Increment<D>) -> Result<M::Current, PointFailure> {
        let mut sum = self.response(self.points.start, mean)?;
        for n in 1..self.cell.moved.len() {
            sum.add(&self.response(self.cell.moved[n].0, mean)?);
        }
        Ok(sum)
    }

    /// The weak form of a point at the mean increment.
    #[inline(always)]
    fn response(&mut self, p: usize, mean: &Increment<D>) -> Result<M::Current, PointFailure> {
        let Mean { task, trial, .. } = self;
        let (old, new) = task.histories(p, trial);
        let response = M::respond_current(&task.start[p], mean, task.law(p), old, new);
        let response = response.map_err(|error| PointFailure { point: p, error })?;
        trial.keep(p, &response);
        Ok(response.weak)
    }

    /// The mean gradients in the configuration of the mean increment.
    #[inline(always)]
    fn map_mean_gradients(&mut self, weak: &M::Current) {
        let MeanRoom { mean, mapped, together, .. } = &mut self.cell.mean;
        mapped.clear();
        mapped.resize(mean.gradient.len(), [0.0; D]);
        let gradients: &[[f64; D]] = match weak.inverse() {
            None => &mean.gradient,
            Some(inverse) => map_gradients(inverse, &mean.gradient, mapped),
        };
        together.clear();
        let nodes = gradients.iter().zip(&mean.per_radius);
        together.extend(nodes.map(|(gradient, per_radius)| weak.gradient(gradient, *per_radius)));
    }
}
