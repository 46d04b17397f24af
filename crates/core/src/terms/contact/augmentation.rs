//! The updates of the multipliers of contact, in equilibrium and along an increment.

use crate::assembly::System;
use crate::model::Model;
use crate::points::Points;
use crate::region::vector::norm;
use crate::step::{At, StepContext};
use crate::terms::failure::{ContactError, EvaluateError};
use crate::terms::multipliers::{Augmentation, Multipliers, Response};

use super::Contact;
use super::counterpart::Counterpart;
use super::evaluation::{self, first_unknowns};
use super::interface::{Law, SLIDES};
use super::motion::farthest;
use super::multipliers::{self, Change, Followed, Worst, followed, forces_of, worst};
use super::ranks::{Failure, any_of_each};

/// Round-off of the largest shear, relative to its size, [-].
const ROUND_OFF: f64 = 1e-9;
/// Number of updates after which the largest shears that are held are relaxed, and after which they only fall.
const RELAXES: usize = 3;
const RISES: usize = 10;
/// Share of the friction that held shears may miss, [-].
const MISSING: f64 = 1e-3;
/// Factor applied to the penalty of contact points whose gaps close slowly over many updates.
const MORE_PENALTY: f64 = 10.0;

impl<const D: usize> Contact<D> {
    /// All contact points at the linearised end of an increment; `None` if one changes its state on the way, or if the
    /// equations do not belong to the state in which the increment begins.
    fn followed<const N: usize>(&self, increment: At<N>) -> Option<Vec<Followed<D>>> {
        if self.at_rest {
            return None;
        }
        let first = first_unknowns(&self.tools);
        let followed_at = |k: usize| {
            let (candidate, trial) = (&self.candidates[k], &self.trials[k]);
            let number = candidate.key.tool as usize;
            let motions = increment.globals.get(first[number]..).unwrap_or_default();
            let moving = &self.tools[number];
            followed(candidate, &self.multipliers[k], trial, moving, increment.delta_d, motions)
        };
        let followed: Option<Vec<Followed<D>>> = (0..self.trials.len()).map(followed_at).collect();
        if self.reduction.all(followed.is_some()) { followed } else { None }
    }
}

impl<const D: usize, const N: usize> Multipliers<D, N> for Contact<D> {
    fn augment(
        &mut self,
        step: &StepContext<D>,
        points: &Points<D>,
        at: At<N>,
    ) -> Result<Augmentation, EvaluateError> {
        self.check_motion(step, points, at)?;
        let Contact {
            updates,
            before,
            changes,
            candidates,
            multipliers,
            trials,
            tools,
            tolerances,
            reduction,
            ..
        } = self;
        let now = Change::by_update(candidates, multipliers, trials, tools);
        let Some(worst) = worst(candidates, &now, tolerances, reduction) else {
            return Ok(Augmentation::Satisfied);
        };
        let tool = worst.tool;
        let is_last = *updates >= Counterpart::new(step.model, tool as u32).control().augmentations;
        if worst.is_settled(tolerances[tool], before.as_ref(), *updates, is_last) {
            if !is_last && self.renew_held() {
                self.updates += 1;
                return Ok(Augmentation::Updated);
            }
            if !self.misses_friction() {
                return Ok(Augmentation::Satisfied);
            }
            return Err(self.not_settled(step, &worst).into());
        }
        if is_last {
            return Err(self.not_settled(step, &worst).into());
        }
        for ((candidate, multiplier), trial) in candidates.iter().zip(multipliers).zip(trials) {
            *multiplier = forces_of(candidate, trial, &tools[candidate.key.tool as usize]);
        }
        for ((candidate, now), before) in candidates.iter_mut().zip(&now).zip(changes.iter()) {
            if let (Some(now), Some(before)) = (now, before)
                && now.is_slow(before)
            {
                let more = if *updates < multipliers::MANY { 1.0 } else { MORE_PENALTY };
                candidate.penalty = candidate.penalty.max(more * candidate.penalty_if_slow);
            }
        }
        *changes = now;
        *before = Some(worst);
        *updates += 1;
        Ok(Augmentation::Updated)
    }

    fn augment_along(&mut self, increment: At<N>, update: usize, added: &mut Response<N>) -> Augmentation {
        let Some(followed) = self.followed(increment) else { return Augmentation::Satisfied };
        let changes: Vec<Option<Change<D>>> = followed.iter().map(|followed| followed.change).collect();
        let worst = worst(&self.candidates, &changes, &self.tolerances, &self.reduction);
        let before = if update == 0 { None } else { self.worst_along };
        let helps = |worst: &Worst| worst.is_worth_it(self.tolerances[worst.tool], before.as_ref());
        if !worst.as_ref().is_some_and(helps) {
            return Augmentation::Satisfied;
        }
        self.worst_along = worst;
        let first = first_unknowns(&self.tools);
        for ((candidate, trial), Followed { force, .. }) in
            self.candidates.iter().zip(&self.trials).zip(&followed)
        {
            if *force == [0.0; D] {
                continue;
            }
            let nodal = added.force_mut();
            for (node, value) in trial.carriers(candidate) {
                (0..D).for_each(|d| nodal[node][d] += value * force[d]);
            }
            let number = candidate.key.tool as usize;
            let moving = &self.tools[number];
            for (j, &k) in moving.free.iter().enumerate().filter(|(j, _)| !moving.follows[*j]) {
                added.add_residual(first[number] + j, moving.component(k, &trial.position, force));
            }
        }
        let now = followed.into_iter().map(|followed| followed.multiplier).collect();
        let before = std::mem::replace(&mut self.multipliers, now);
        if update == 0 {
            self.before_increment = before;
        }
        Augmentation::Updated
    }

    /// Holds the largest shear of each contact point: the one that its multiplier allows, or its present pressure if that
    /// allows more.
    fn hold(&mut self, step: &StepContext<D>) -> bool {
        let resists_sliding = Counterpart::all(step.model).any(|other| other.resists_sliding());
        let may_hold = !self.is_held && resists_sliding;
        if !may_hold {
            return false;
        }
        (self.is_held, self.held_updates) = (true, 0);
        let all = self.candidates.iter_mut().zip(&self.multipliers).zip(&self.trials).zip(&self.has_touched);
        for (((candidate, multiplier), trial), has_touched) in all {
            let counterpart = Counterpart::new(step.model, candidate.key.tool);
            let Some(interface) = counterpart.interface_with(candidate.body) else { continue };
            let law = Law::new(&interface, candidate.area, candidate.penalty, *has_touched);
            let before = if multiplier.normal > 0.0 { law.most_shear(multiplier.normal).0 } else { 0.0 };
            let now = trial.touch.as_ref().map_or(0.0, |touch| touch.most_shear());
            candidate.held = Some(before.max(now));
        }
        true
    }

    /// Adds stiffness to contact points that slide, because friction does not resist their further motion.
    fn support(&self, sum: &mut System<N>) -> bool {
        let sliding = || self.touching().filter(|(.., touch)| touch.slides_with_friction());
        sliding().for_each(|(_, candidate, _, touch)| evaluation::support(candidate, &touch.normal(), sum));
        sliding().next().is_some()
    }

    fn withdraw(&mut self) {
        self.multipliers.clone_from(&self.before_increment);
    }
}

impl<const D: usize> Contact<D> {
    /// The failure of multipliers that further updates do not settle.
    fn not_settled(&self, step: &StepContext<D>, worst: &Worst) -> Failure {
        if worst.rank != self.reduction.own() {
            return Failure::OnRank;
        }
        Failure::Own(ContactError::NotSettled {
            place: self.candidates[worst.named].place(step.model),
            augmentations: self.updates,
            overlap: worst.overlap,
            slip: worst.slip,
            most: self.tolerances[worst.tool] * worst.size,
        })
    }

    /// Holds the largest shear of each contact point at its value at the start of the step, throughout the step.
    pub(super) fn freeze_friction(&mut self, model: &Model<D>) {
        self.is_held = true;
        for (k, candidate) in self.candidates.iter_mut().enumerate() {
            let counterpart = Counterpart::new(model, candidate.key.tool);
            let Some(interface) = counterpart.interface_with(candidate.body) else { continue };
            let law = Law::new(&interface, candidate.area, candidate.penalty, self.has_touched[k]);
            let pressure = self.multipliers[k].normal;
            candidate.held = Some(if pressure > 0.0 { law.most_shear(pressure).0 } else { 0.0 });
        }
    }

    /// Renews the largest shears that are held, where the pressures now allow others; false if this changes none. After
    /// some updates, they only fall, so that the updates come to an end.
    fn renew_held(&mut self) -> bool {
        if self.experiment.is_some() {
            return false;
        }
        let may_rise = self.held_updates < RISES;
        let share = if self.held_updates < RELAXES { 1.0 } else { 0.5 };
        let mut is_changed = false;
        for (candidate, trial) in self.candidates.iter_mut().zip(&self.trials) {
            let (Some(held), Some(touch)) = (candidate.held, &trial.touch) else { continue };
            let most = touch.most_shear();
            if norm(&touch.shear) > (1.0 + SLIDES) * most + ROUND_OFF * held {
                candidate.held = Some(most);
                is_changed = true;
            } else if touch.is_limited() && may_rise && held < (1.0 - SLIDES) * most {
                candidate.held = Some(held + share * (most - held));
                is_changed = true;
            }
        }
        self.held_updates += 1;
        self.reduction.any(is_changed)
    }

    /// True if contact points slide at less than the shear that the pressures allow, by more than `MISSING` of the sum
    /// over all contact points. Rough surfaces have no such shear.
    fn misses_friction(&self) -> bool {
        if self.experiment.is_some() {
            return false;
        }
        let mut sums = [0.0; 2];
        for (_, candidate, _, touch) in self.touching().filter(|(.., touch)| !touch.is_rough()) {
            let most = touch.most_shear();
            sums[0] +=
                if candidate.held.is_some() && touch.is_limited() { most - norm(&touch.shear) } else { 0.0 };
            sums[1] += most;
        }
        self.reduction.sum(&mut sums);
        sums[0] > MISSING * sums[1]
    }

    /// The largest displacement of a node, [length], and whether this is the start of the iterations.
    pub(super) fn motion<const N: usize>(&self, at: At<N>) -> (f64, bool) {
        let moves = at.delta_d.iter().flatten().chain(at.globals).any(|u| *u != 0.0);
        let mut numbers = [farthest::<D, N>(at.delta_d), f64::from(u8::from(moves))];
        self.reduction.maximum(&mut numbers);
        (numbers[0], numbers[1] == 0.0)
    }

    /// For each tool, true if contact points touch it, and true if one of them does not slide with friction.
    pub(super) fn touched(&self) -> [Vec<bool>; 2] {
        let n = self.tools.len();
        let mut flags = vec![false; 2 * n];
        for (_, candidate, _, touch) in self.touching() {
            let tool = candidate.key.tool as usize;
            flags[tool] = true;
            flags[n + tool] |= !touch.slides_with_friction();
        }
        any_of_each(&self.reduction, &mut flags);
        let holds = flags.split_off(n);
        [flags, holds]
    }
}
