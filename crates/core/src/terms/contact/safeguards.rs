//! Checks of a step: how far contact points have moved, and whether a tool has come between the centre of a domain and
//! one of its corners.

use std::collections::BTreeSet;

use rustc_hash::FxHashMap;

use crate::basis::Method;
use crate::model::{Model, Tool};
use crate::points::Points;
use crate::region::vector::{along, dot, minus, norm};
use crate::step::{At, StepContext};
use crate::terms::failure::{ContactError, ContactPlace};
use crate::tool::{Closest, Shape};

use super::Contact;
use super::candidates::{self, Candidate, Search, allowance, missed, named};
use super::counterpart::Counterpart;
use super::evaluation::Trial;
use super::interface::{Law, Multiplier};
use super::key::{CENTRE, FACE, Kept, Key};
use super::motion::Moving;
use super::ranks::{Failure, agreed, any_of_each, complete, gathered};
use super::sides;

/// Gap at the start of a step, relative to the size of a cell, above which the straight path of a contact point tells
/// whether it has passed through a tool, [-]: the paths of closer contact points may cut a rounded surface of the tool.
const APART: f64 = 1e-3;
/// Depth below the surface, relative to the size of a cell, down to which a straight path may cut a corner of a tool,
/// [-]; anything thinner than twice this depth is no obstacle.
const GRAZING: f64 = 5e-3;

/// Positions of the contact points that coincide with material points, [length], by tool and permanent number of the
/// material point.
type Centres<const D: usize> = FxHashMap<(u32, u32), [f64; D]>;

fn is_centre<const D: usize>(candidate: &Candidate<D>) -> bool {
    candidate.key.corner % FACE == CENTRE
}

impl<const D: usize> Contact<D> {
    /// Checks how far contact points have moved relative to the tools in a step whose iterations have converged.
    pub(super) fn check_motion<const N: usize>(
        &self,
        step: &StepContext<D>,
        points: &Points<D>,
        at: At<N>,
    ) -> Result<(), Failure> {
        let centres = self.centres();
        agreed(&self.reduction, self.check_own_motion(step, points, at, &centres))
    }

    /// Checks how far the contact points of this rank have moved.
    fn check_own_motion<const N: usize>(
        &self,
        step: &StepContext<D>,
        points: &Points<D>,
        at: At<N>,
        centres: &Centres<D>,
    ) -> Result<(), ContactError> {
        let model = step.model;
        for (candidate, Trial { position, slip, touch, .. }) in self.candidates.iter().zip(&self.trials) {
            let number = candidate.key.tool as usize;
            let moving = &self.tools[number];
            let motion = norm(slip).max(moving.arc(&candidate.start));
            let counterpart = Counterpart::new(model, candidate.key.tool);
            let most = counterpart.control().largest_slide * candidate.size;
            if touch.is_some() && motion > most {
                return Err(ContactError::Slide { place: candidate.place(model), motion, most });
            }
            let Counterpart::Tool(tool) = counterpart else { continue };
            let gap = candidate.near.gap;
            let may_have_passed = || {
                if gap > APART * candidate.size {
                    motion > gap
                } else {
                    // The straight path of a contact point that leaves the tool may cut a rounded surface.
                    candidate.has_turned(tool.shape.as_ref(), moving, position)
                }
            };
            if touch.is_none() && may_have_passed() {
                // The path starts outside the tool, because round-off may put a touching contact point on either side
                // of the surface.
                let start = along(&candidate.start, APART * candidate.size, &candidate.near.normal);
                let path = [moving.start.to_tool(&start), moving.end.to_tool(position)];
                if depth_of_passage(tool.shape.as_ref(), path) > GRAZING * candidate.size {
                    return Err(ContactError::Through { place: candidate.place(model) });
                }
            }
        }
        if let Some(place) = self.between(model, centres) {
            return Err(ContactError::Between { place });
        }
        if let Some(place) = self.missed_between_bodies(step, points, at.delta_d) {
            return Err(ContactError::Through { place });
        }
        if let Some((number, p)) = missed(&self.search(step, points), at.delta_d) {
            let (tool, body) = (&model.tools[number], points.body[p] as usize);
            let position = &points.converged.position[p];
            return Err(ContactError::Through {
                place: named(model, &Counterpart::Tool(tool), body, points.id[p], position),
            });
        }
        Ok(())
    }

    /// A contact point that has passed into a side of another body which was too far away at the start of the step to be
    /// a candidate.
    fn missed_between_bodies<const N: usize>(
        &self,
        step: &StepContext<D>,
        points: &Points<D>,
        delta_d: &[[f64; N]],
    ) -> Option<ContactPlace> {
        let model = step.model;
        if model.contacts.is_empty() {
            return None;
        }
        let controls = model.contacts.iter().map(|pair| pair.control.largest_slide);
        let seen = controls.fold(f64::INFINITY, f64::min) * self.smallest;
        // No relative motion is larger than the diagonal of the box around the motions of all nodes.
        let bounds = |d: usize| {
            let all = delta_d.iter().map(|u| u[d]);
            all.fold([0.0, 0.0], |[low, high]: [f64; 2], u| [low.min(u), high.max(u)])
        };
        let range = (0..D).map(bounds).map(|[low, high]| (high - low).powi(2)).sum::<f64>().sqrt();
        if range <= seen {
            return None;
        }
        let search = Search { within: range, ..self.search(step, points) };
        let mut found = Vec::new();
        search.between_bodies(&mut found).ok()?;
        let has_passed = |candidate: &&Candidate<D>| {
            let slide = Counterpart::new(model, candidate.key.tool).control().largest_slide;
            let slip = candidate.displacement(delta_d);
            let facing = candidate
                .facet
                .as_ref()
                .and_then(|facet| facet.facing(&candidate.basis, &candidate.near, delta_d, &slip));
            let deep = -candidates::TOUCHING * candidate.size;
            candidate.near.gap > slide * candidate.size && facing.is_some_and(|facing| facing.gap < deep)
        };
        found.iter().find(has_passed).map(|candidate| candidate.place(model))
    }

    /// Positions, at the last evaluation, of the contact points that coincide with material points and that the checks
    /// here need, [length].
    fn centres(&self) -> Centres<D> {
        let centres = (self.candidates.iter().zip(&self.trials))
            .filter(|(candidate, _)| is_centre(candidate))
            .map(|(candidate, trial)| ((candidate.key.tool, candidate.key.point), trial.position));
        let mut centres: Centres<D> = centres.collect();
        // Corners shared with domains of other ranks need the centres of those domains.
        let shared = self.candidates.iter().filter(|candidate| !candidate.shared_by.is_empty());
        let wanted = shared.flat_map(|candidate| {
            let points = candidate.shared_by.iter().chain([&candidate.key.point]);
            points.map(|point| (candidate.key.tool, *point))
        });
        complete(&self.reduction, &mut centres, wanted);
        centres
    }

    /// A corner of a domain that a part of a tool separates from the centre of the domain at the last evaluation.
    fn between(&self, model: &Model<D>, centres: &Centres<D>) -> Option<ContactPlace> {
        let mut places = self.candidates.iter().zip(&self.trials);
        let parts = |candidate: &Candidate<D>, corner: &[f64; D], point: u32| {
            let number = candidate.key.tool;
            let Some(centre) = centres.get(&(number, point)) else { return false };
            let (shape, moving) = (model.tools[number as usize].shape.as_ref(), &self.tools[number as usize]);
            let [from, to] = [centre, corner].map(|x| moving.end.to_tool(x));
            let is_outside = |found: &Closest<D>| found.gap > -GRAZING * candidate.size;
            let ends = [from, to].map(|x| shape.closest(x).filter(is_outside));
            matches!(ends, [Some(a), Some(b)] if dot(&a.normal, &b.normal) < candidates::OTHER_SIDE)
                && shape.first_contact(from, to).is_some()
        };
        let parted = |(candidate, trial): &(&Candidate<D>, &Trial<D>)| {
            let mut points = candidate.shared_by.iter().chain([&candidate.key.point]);
            !is_centre(candidate) && points.any(|point| parts(candidate, &trial.position, *point))
        };
        places.find(parted).map(|(candidate, _)| candidate.place(model))
    }

    /// Checks that every tool with free components touches a body. `touches` tells which tools do.
    pub(super) fn check_that_free_tools_touch(
        &self,
        model: &Model<D>,
        touches: &[bool],
    ) -> Result<(), ContactError> {
        for ((moving, touches), tool) in self.tools.iter().zip(touches).zip(&model.tools) {
            if let (Some(k), false) = (moving.first_free(), *touches) {
                let component = Tool::<D>::component_name(k);
                return Err(ContactError::Loose { tool: tool.name.clone(), component });
            }
        }
        Ok(())
    }
}

/// True if the corners of the domains that meet at a contact point stay where the step has put them.
fn keeps_corners<const D: usize>(model: &Model<D>, candidate: &Candidate<D>) -> bool {
    let keeps = |body: usize| model.bodies[body].method == Method::Cpdi2;
    match Counterpart::new(model, candidate.key.tool) {
        Counterpart::Tool(_) => keeps(candidate.body),
        Counterpart::Bodies(pair) => pair.bodies.into_iter().all(keeps),
    }
}

/// Distance from the surface, [length], halfway along the part of a straight path that lies inside a tool, in the frame
/// of the tool; 0 if the path does not meet the tool.
fn depth_of_passage<const D: usize>(shape: &dyn Shape<D>, [from, to]: [[f64; D]; 2]) -> f64 {
    let (Some(first), Some(last)) = (shape.first_contact(from, to), shape.first_contact(to, from)) else {
        return 0.0;
    };
    let middle = along(&from, 0.5 * (first + 1.0 - last), &minus(&to, &from));
    shape.closest(middle).map_or(0.0, |found| found.gap.abs())
}

/// The multipliers of a contact point that was awake, now and before the updates along an increment, its penalty,
/// [force/length], and the largest shear, [force], if it is held; −1 otherwise.
type Awake<const D: usize> = ([Multiplier<D>; 2], f64, f64);

/// Contact points sleep, that is, they are left out, if their distance from a flat surface exceeds `AWAKE` times the
/// size of the smallest cell and `AWAKE_AFTER` times the motion of the tool in the step.
const AWAKE: f64 = 0.1;
const AWAKE_AFTER: f64 = 10.0;

/// Overlap of two bodies beyond which no step has left it, relative to the size of a cell, [-].
const INHERITED: f64 = 2e-3;

impl<const D: usize> Contact<D> {
    /// The search for the contact points of a step.
    pub(super) fn search<'a>(&'a self, step: &StepContext<'a, D>, points: &'a Points<D>) -> Search<'a, D> {
        let StepContext { model, links, .. } = *step;
        let Contact { tools, has_begun, outer, edges, converged: kept, awake, smallest, .. } = self;
        let smallest = *smallest;
        Search { model, points, links, tools, has_begun, outer, edges, kept, awake, smallest, within: 0.0 }
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
        let n = step.model.tools.len();
        let of_tools = self.tools[..n].iter().map(|moving| awake(moving).unwrap_or(f64::INFINITY));
        self.awake = of_tools.chain(step.model.contacts.iter().map(|_| f64::INFINITY)).collect();
        self.has_woken = false;
        self.outer.find(points, &self.reduction);
        for (tool, (edges, moving)) in self.edges.iter_mut().zip(&self.tools).enumerate() {
            edges.follow(step.model, tool, moving, self.smallest);
        }
        self.find_places(step, points)?;
        self.is_symmetric = self.begins_symmetric(step.model);
        self.multipliers.clone_from(&self.start);
        self.trials.clear();
        self.changes.clear();
        (self.updates, self.before, self.is_held) = (0, None, false);
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
            let key = if candidate.facet.is_some() { candidate.key.of_corner() } else { candidate.key };
            let kept = self.converged.get(&key).filter(|_| self.has_begun[candidate.body]).copied();
            kept.map(|kept| kept.with_share(candidate.share))
        };
        let kept: Vec<Option<Kept<D>>> = self.candidates.iter().map(kept_by).collect();
        // Between bodies under stress, contact begins with the stress that acts across it.
        let in_contact: BTreeSet<u32> = self.converged.keys().map(|key| key.tool).collect();
        let begins = |candidate: &Candidate<D>| {
            !in_contact.contains(&candidate.key.tool)
                && candidate.near.gap.abs() <= candidates::TOUCHING * candidate.size
        };
        let at_start = |(candidate, kept): (&Candidate<D>, &Option<Kept<D>>)| match kept {
            Some(kept) => kept.multiplier,
            None if begins(candidate) => candidate.at_rest,
            None => Multiplier::default(),
        };
        self.start = self.candidates.iter().zip(&kept).map(at_start).collect();
        let touches = |candidate: &Candidate<D>| candidate.near.gap <= candidates::TOUCHING * candidate.size;
        self.has_touched = (self.candidates.iter().zip(&kept))
            .map(|(candidate, kept)| kept.is_some() || touches(candidate))
            .collect();
        for (candidate, kept) in self.candidates.iter_mut().zip(&kept) {
            // Corners of CPDI2 domains stay where contact has put them, so they need no allowance, unless two bodies
            // have begun with an overlap.
            let is_from_start = candidate.facet.is_some() && candidate.near.gap < -INHERITED * candidate.size;
            if is_from_start || !keeps_corners(step.model, candidate) {
                let (motion, excess) = kept.map_or((0.0, 0.0), |kept| (kept.motion, kept.excess));
                let bears = kept.is_some_and(|kept| kept.multiplier.normal > 0.0);
                candidate.allowance = allowance(candidate.near.gap, candidate.size, motion, excess, bears);
            }
        }
        let sides = self.pieces.iter_mut().flat_map(|found| found.sides.drain(..)).collect();
        sides::share_out(&self.reduction, sides, &mut self.candidates, &self.start);
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
            let held = candidate.held.unwrap_or(-1.0);
            let multipliers = [kept(&self.multipliers), kept(&self.before_increment)];
            (candidate.key, multipliers, (candidate.penalty, held))
        };
        let awake = self.candidates.iter().enumerate().map(awake).collect();
        // A contact point joined by the corner of a sleeping domain may pass to another rank.
        let known: FxHashMap<Key, Awake<D>> = (gathered(&self.reduction, awake).into_iter())
            .map(|(key, multipliers, (penalty, held))| (key, (multipliers, penalty, held)))
            .collect();
        let is_held = self.is_held;
        self.find_places(step, points)?;
        let (mut multipliers, mut before) = (Vec::new(), Vec::new());
        for candidate in &mut self.candidates {
            let unknown = (<[Multiplier<D>; 2]>::default(), 0.0, if is_held { 0.0 } else { -1.0 });
            let ([now, then], penalty, held) = known.get(&candidate.key).copied().unwrap_or(unknown);
            candidate.held = (held >= 0.0).then_some(held);
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
            let counterpart = Counterpart::new(model, candidate.key.tool);
            let Some(interface) = counterpart.interface_with(candidate.body) else {
                return true;
            };
            let law = Law::new(&interface, candidate.area, candidate.penalty, self.has_touched[k]);
            let is_flat = candidate.near.normal_derivative == [[0.0; D]; D];
            let is_free = self.start[k] == Multiplier::default();
            law.is_smooth()
                || is_free
                || is_flat && candidate.facet.is_none() && law.has_stuck(&self.start[k])
        };
        (0..self.candidates.len()).all(is_known)
    }
}
