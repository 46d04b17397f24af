//! The state of the points that take the mean increment of their cell: the stress that resists their deviation from it,
//! and how much of this stress the flow of the soil takes away.
#![allow(non_snake_case)]

use crate::material::{Modulus, StrainMeasure};
use crate::model::{Model, ModuliAtRest};
use crate::points::Points;
use crate::step::StepContext;
use crate::stress::{CellStrain, Deviated, StartOfStep};
use crate::tensor::{Mat3, Sym3};
use crate::terms::Augmentation;
use crate::terms::ledger::{Ledger, NamedEnergy};

/// β, the modulus of the resistance to deviations, relative to twice the shear modulus of the material, [-]. The bending
/// of square cells with 2 × 2 points is exact for 8/(7 (1 − ν)).
const BETA: f64 = 1.0;

/// m, how many times as fast as the stress of the soil the resistance flows, [-]. Where the soil flows steadily, the
/// resistance stays below about β/m of its strength.
const FLOW: f64 = 20.0;

/// Part of the stress of flowing points that the resistance may carry too much, because it knows the flow of the step
/// before only, [-]; and number of times in a step that it takes note of the flow of the step itself.
const UNKNOWN_FLOW: f64 = 0.01;
const MOST_UPDATES: u32 = 8;

/// What a point holds against its deviation in a step, from the step before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Held {
    /// Cauchy stress, [stress].
    pub(super) stress: Sym3,
    /// 2βG, [stress].
    pub(super) modulus: f64,
    /// 1 − |s|/|s_trial| of the step before or, if it is larger, of this step when its iterations last converged, [-].
    pub(super) lost: f64,
}

impl Held {
    /// Share θ of the resistance that flow leaves, from the mean of `lost` over the cell, [-].
    pub(super) fn left(lost: f64) -> f64 {
        let ratio = 1.0 - lost;
        if ratio > 0.0 { ratio / (ratio + FLOW * lost) } else { 0.0 }
    }

    /// No resistance.
    pub(super) const NONE: Held = Held { stress: Sym3::ZERO, modulus: 0.0, lost: 0.0 };

    /// Energy that the resistance stores per volume at a stress, [energy/volume].
    fn stored(&self, stress: &Sym3) -> f64 {
        if self.modulus > 0.0 { 0.5 * stress.dot(stress) / self.modulus } else { 0.0 }
    }
}

/// The deviations of all points in a step; empty if no body takes mean increments.
#[derive(Debug, Clone, Default)]
pub(super) struct Deviations {
    pub(super) held: Vec<Held>,
    pub(super) trial: Vec<Deviated>,
    /// True if a body takes mean increments, on this rank or another one.
    pub(super) are_used: bool,
    /// Number of times that the resistance has been adapted to the flow of the step.
    updates: u32,
}

impl Deviations {
    /// Begins a step from the converged state of the points.
    pub(super) fn begin<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) {
        self.held.clear();
        self.trial.clear();
        (self.are_used, self.updates) = (model.takes_means(), 0);
        if !self.are_used {
            return;
        }
        let moduli = ModuliAtRest::new(model, Modulus::Shear);
        let stored = points.deviation();
        self.held.extend((0..points.len()).map(|p| {
            if !takes_mean(model, points, p) {
                return Held::NONE;
            }
            let (stress, lost) = stored.as_ref().map_or((Sym3::ZERO, 0.0), |stored| stored.at(p));
            Held { stress, lost, modulus: 2.0 * BETA * moduli.at(points, p) }
        }));
        self.trial.resize(points.len(), Deviated::NONE);
    }

    /// Adapts the resistance to the flow of the step, in equilibrium, where soil flows faster than in the step before:
    /// otherwise, soil that begins to flow could carry more than its strength to the end of the step.
    pub(super) fn follow_flow<const D: usize>(
        &mut self,
        step: &StepContext<D>,
        points: &Points<D>,
        start: &[StartOfStep],
    ) -> Augmentation {
        if self.updates == MOST_UPDATES {
            return Augmentation::Satisfied;
        }
        let StepContext { model, links, .. } = *step;
        let lost: Vec<f64> = (self.trial.iter().enumerate())
            .map(|(p, deviated)| lost_at(model, points, start, p, deviated).max(self.held[p].lost))
            .collect();
        let (mut excess, mut carried) = (0.0, 0.0);
        for group in 0..links.n_groups() {
            let own = || links.points_of(group).filter(|&p| takes_mean(model, points, p));
            let sum = |value: &dyn Fn(usize) -> f64| own().map(value).sum::<f64>();
            let n = sum(&|_| 1.0);
            let [before, after] =
                [sum(&|p| self.held[p].lost), sum(&|p| lost[p])].map(|lost| Held::left(lost / n));
            if before > after {
                let resists = |p: usize| start[p].volume_n * self.trial[p].stress_at_end().norm();
                excess += (1.0 - after / before) * sum(&resists);
            }
            let flows = |p: usize| if lost[p] > 0.0 { start[p].volume_n } else { 0.0 };
            carried += sum(&|p| flows(p) * points.trial.kirchhoff_stress[p].deviator().norm());
        }
        let [excess, carried] = [excess, carried].map(|sum| links.reduction().total(sum));
        if excess <= UNKNOWN_FLOW * carried {
            return Augmentation::Satisfied;
        }
        self.held.iter_mut().zip(lost).for_each(|(held, lost)| held.lost = lost);
        self.updates += 1;
        Augmentation::Updated
    }

    /// Writes the stresses at the end of the step, and what flow took away in it, into the trial state of the points.
    pub(super) fn commit<const D: usize>(
        &self,
        model: &Model<D>,
        points: &mut Points<D>,
        start: &[StartOfStep],
    ) {
        let end: Vec<(Sym3, f64)> = (self.trial.iter().enumerate())
            .map(|(p, deviated)| {
                if !takes_mean(model, points, p) {
                    return (Sym3::ZERO, 0.0);
                }
                (deviated.stress_at_end(), lost_at(model, points, start, p, deviated))
            })
            .collect();
        points.set_deviation(&end);
    }

    /// The energy stored in the resistance, and what it dissipates.
    pub(super) fn ledger<const D: usize>(
        &self,
        model: &Model<D>,
        start: &[StartOfStep],
        ledger: &mut Ledger,
    ) {
        if !model.takes_means() {
            return;
        }
        let [mut before, mut after, mut work] = [0.0; 3];
        for ((held, deviated), start) in self.held.iter().zip(&self.trial).zip(start) {
            before += start.volume_n * held.stored(&held.stress);
            after += start.volume_n * held.stored(&deviated.stress);
            work += start.volume_n * deviated.work;
        }
        ledger.add(NamedEnergy::stored(Ledger::DEVIATION, [before, after]));
        ledger.add(NamedEnergy::dissipated(Ledger::DEVIATION, work - (after - before)));
    }
}

/// True if a point takes the mean increment of its cell.
fn takes_mean<const D: usize>(model: &Model<D>, points: &Points<D>, p: usize) -> bool {
    model.bodies[points.body[p] as usize].strain == CellStrain::Mean
}

/// 1 − |s|/|s_trial| of a point in the step, [-]; 0 if it does not take the mean increment of its cell.
fn lost_at<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    start: &[StartOfStep],
    p: usize,
    deviated: &Deviated,
) -> f64 {
    if !takes_mean(model, points, p) {
        return 0.0;
    }
    let measure = model.law(points, p).strain_measure();
    lost(&trial_strain(measure, &deviated.mean, &start[p].b_n), &points.trial.elastic_strain[p])
}

/// The trial elastic strain at an increment, in the measure of a law.
fn trial_strain(measure: StrainMeasure, dF: &Mat3, b_n: &Sym3) -> Sym3 {
    let b = Sym3::symmetric_part(&(dF * b_n.to_matrix() * dF.transpose()));
    match measure {
        StrainMeasure::Logarithmic => b.map_eigenvalues(f64::ln) * 0.5,
        StrainMeasure::LeftCauchyGreen => (b - Sym3::IDENTITY) * 0.5,
    }
}

/// 1 − |s|/|s_trial|, with the ratio of the elastic deviators in place of that of their stresses; 0 while elastic.
fn lost(trial: &Sym3, elastic: &Sym3) -> f64 {
    /// Smaller shares are round-off.
    const LEAST: f64 = 1e-10;
    let [trial, elastic] = [trial, elastic].map(|strain| strain.deviator().norm());
    let lost = if trial > 0.0 { 1.0 - elastic / trial } else { 0.0 };
    if lost > LEAST { lost } else { 0.0 }
}
