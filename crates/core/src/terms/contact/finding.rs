//! The contact points of a step: those that are awake at its start, and all of them once the nodes have moved far.

use rustc_hash::FxHashMap;

use super::Contact;
use super::agreement::{Failure, any_of_each};
use super::allowance::allowance;
use super::candidates::{self, Candidate, Key, Search};
use super::interface::{Law, Multiplier};
use super::motion::Moving;
use super::multipliers::Kept;
use super::plain::gathered;
use crate::basis::Method;
use crate::model::Model;
use crate::points::Points;
use crate::step::StepContext;

/// The multipliers of a contact point that was awake, now and before the updates along an increment, and its penalty,
/// [force/length].
type Awake<const D: usize> = ([Multiplier<D>; 2], f64);

/// Contact points sleep, that is, they are left out, if their distance from a flat surface exceeds `AWAKE` times the
/// size of the smallest cell and `AWAKE_AFTER` times the motion of the tool in the step.
const AWAKE: f64 = 0.1;
const AWAKE_AFTER: f64 = 10.0;

impl<const D: usize> Contact<D> {
    /// The search for the contact points of a step.
    pub(super) fn search<'a>(&'a self, step: &StepContext<'a, D>, points: &'a Points<D>) -> Search<'a, D> {
        let StepContext { model, links, .. } = *step;
        let Contact { tools, has_begun, awake, smallest, .. } = self;
        Search { model, points, links, tools, has_begun, awake, smallest: *smallest }
    }

    /// Finds the contact points of a step and their multipliers.
    pub(super) fn find(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), Failure> {
        self.reduction = step.links.reduction().clone();
        for (moving, tool) in self.tools.iter_mut().zip(&step.model.tools) {
            moving.begin(tool, step.model, step.step, step.factor)?;
        }
        self.is_there.fill(false);
        points.body.iter().for_each(|&body| self.is_there[body as usize] = true);
        any_of_each(&self.reduction, &mut self.is_there);
        let sizes = points.cell.iter().map(|&cell| step.model.grid.size(cell as usize));
        self.smallest = self.reduction.smallest(sizes.fold(f64::INFINITY, f64::min));
        let nearest = AWAKE * self.smallest;
        let awake = |moving: &Moving<D>| moving.translation().map(|u| nearest.max(AWAKE_AFTER * u));
        self.awake = self.tools.iter().map(|moving| awake(moving).unwrap_or(f64::INFINITY)).collect();
        self.has_woken = false;
        self.find_places(step, points)?;
        self.is_symmetric = self.begins_symmetric(step.model);
        self.multipliers.clone_from(&self.start);
        self.trials.clear();
        self.changes.clear();
        (self.updates, self.before) = (0, None);
        (self.time, self.factor) = (step.step.end, step.factor);
        Ok(())
    }

    /// Finds the contact points that are awake, with the state they have kept.
    fn find_places(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), Failure> {
        let (mut pieces, mut candidates) =
            (std::mem::take(&mut self.pieces), std::mem::take(&mut self.candidates));
        let found = self.search(step, points).run(&mut pieces, &mut candidates);
        (self.pieces, self.candidates) = (pieces, candidates);
        found?;
        let kept_by = |candidate: &Candidate<D>| {
            self.converged.get(&candidate.key).filter(|_| self.has_begun[candidate.body]).copied()
        };
        let kept: Vec<Option<Kept<D>>> = self.candidates.iter().map(kept_by).collect();
        self.start =
            kept.iter().map(|kept| kept.map_or_else(Multiplier::default, |kept| kept.multiplier)).collect();
        let touches = |candidate: &Candidate<D>| candidate.near.gap <= candidates::TOUCHING * candidate.size;
        self.has_touched = (self.candidates.iter().zip(&kept))
            .map(|(candidate, kept)| kept.is_some() || touches(candidate))
            .collect();
        for (candidate, kept) in self.candidates.iter_mut().zip(&kept) {
            // Corners of CPDI2 domains stay where contact has put them, so they need no allowance.
            if step.model.bodies[candidate.body].method != Method::Cpdi2 {
                let (motion, excess) = kept.map_or((0.0, 0.0), |kept| (kept.motion, kept.excess));
                candidate.allowance = allowance(candidate.near.gap, candidate.size, motion, excess);
            }
        }
        Ok(())
    }

    /// Wakes the sleeping contact points if one of them may touch its tool after the motion of the nodes, of which none
    /// has moved farther than `farthest`, [length].
    pub(super) fn wake(
        &mut self,
        step: &StepContext<D>,
        points: &Points<D>,
        farthest: f64,
    ) -> Result<(), Failure> {
        // A basis extrapolated beyond its cell by up to half of the cell width magnifies the motion by at most this
        // factor.
        let most = (1 << D) as f64 * farthest;
        let sleeps_on = |(moving, awake): (&Moving<D>, &f64)| {
            *awake == f64::INFINITY || moving.translation().is_some_and(|moved| most + moved <= *awake)
        };
        if self.tools.iter().zip(&self.awake).all(sleeps_on) {
            return Ok(());
        }
        self.awake.fill(f64::INFINITY);
        let awake = |(k, candidate): (usize, &Candidate<D>)| {
            let kept = |all: &[Multiplier<D>]| all.get(k).copied().unwrap_or_default();
            (candidate.key, [kept(&self.multipliers), kept(&self.before_increment)], candidate.penalty)
        };
        let awake = self.candidates.iter().enumerate().map(awake).collect();
        // A contact point joined by the corner of a sleeping domain may pass to another rank.
        let known: FxHashMap<Key, Awake<D>> = (gathered(&self.reduction, awake).into_iter())
            .map(|(key, multipliers, penalty)| (key, (multipliers, penalty)))
            .collect();
        self.find_places(step, points)?;
        let (mut multipliers, mut before) = (Vec::new(), Vec::new());
        for candidate in &mut self.candidates {
            let ([now, then], penalty) = known.get(&candidate.key).copied().unwrap_or_default();
            candidate.penalty = candidate.penalty.max(penalty);
            multipliers.push(now);
            before.push(then);
        }
        (self.multipliers, self.before_increment) = (multipliers, before);
        self.changes.clear();
        self.has_woken = true;
        Ok(())
    }

    /// True if, at the start of a step, every contact point with friction sticks to a flat surface or transfers no
    /// force.
    fn begins_symmetric(&self, model: &Model<D>) -> bool {
        let is_known = |k: usize| {
            let candidate = &self.candidates[k];
            let Some(interface) = model.tools[candidate.key.tool as usize].interface_with(candidate.body)
            else {
                return true;
            };
            let law = Law::new(&interface, candidate.area, candidate.penalty, self.has_touched[k]);
            let is_flat = candidate.near.normal_derivative == [[0.0; D]; D];
            let is_free = self.start[k] == Multiplier::default();
            law.is_smooth() || is_free || is_flat && law.has_stuck(&self.start[k])
        };
        (0..self.candidates.len()).all(is_known)
    }
}
