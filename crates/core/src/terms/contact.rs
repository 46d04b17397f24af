//! Contact of bodies with rigid tools and with each other, with friction: an augmented Lagrangian on the corners of
//! domains. What follows speaks of tools; where a contact point touches a side of another body, the motion of that side
//! takes the place of the motion of the tool (see [`facet`] and [`pairs`]).
//!
//! # Equations
//!
//! A contact point (a candidate until it touches) is a corner or the centre x_c of the domain of a material point near
//! a tool, carried by the grid with the basis N_v of its cell, or S_vp at a centre (see [`candidates`]). It stands for
//! an area A, its part of the outer sides of domains (see [`sides`]). With the signed distance g from the tool, the
//! outward normal n = ∇g and the motion s of the contact point relative to the tool in the step,
//!
//! | Quantity | Equation |
//! |---|---|
//! | trial position | x = x_c + Σ N_v(x_c) Δd_v |
//! | motion relative to the tool | s = x − (c + u + exp(θ̂)(x_c − c)) |
//! | pressure | p = max(λ − ε g, −T), T = σ_t A; open if λ − ε g ≤ 0 and T = 0 |
//! | shear, trial | w_t = (I − n⊗n)(λ_t − ε s) |
//! | shear | t = w_t min(1, L/&#124;w_t&#124;), L = min(max(a A + μ p, 0), (1 + μ)(p + T)); rough: L = 10 (p + T) |
//! | force on node v | N_v(x_c)(p n + t) |
//! | force and moment on the tool | −Σ f, −Σ (x − c − u) × f |
//! | penalty | ε = p_f 4G A_ε/h, with the shear modulus G of the body at rest and the area A_ε (see [`candidates`]) |
//! | update | λ ← p, λ_t ← t |
//!
//! Derivatives are exact: with δy = δx − v(x) and δs = δx − v(x − s), where v is the velocity of the tool and φ its
//! rate of rotation, δg = n·δy, δn = ∂n/∂x δy + φ × n, δλ_t = φ × λ_t, and δw_t = (I − n⊗n) δw − (n·w) δn − n (w·δn).
//! Where a contact point slides, δt = (L/&#124;w_t&#124;)(I − e⊗e) δw_t + ∂L/∂p e δp with e = w_t/&#124;w_t&#124;.
//!
//! The free components of the motion of a tool are global unknowns; the equilibrium of the tool provides their
//! equations.
//!
//! Contact points that the last domain update has moved into a tool may at first stay at their depth; those that bear a
//! force and that it has moved away, at their distance. g is then measured from there (see [`candidates`]).
//!
//! # Augmentation
//!
//! Newton's method solves for displacements and free motions at fixed multipliers. Once it has converged, the forces
//! become the multipliers and the iterations go on, until an update would change gap and slip by less than the
//! tolerance. Each update divides the error by about p_f and costs one linear solve. In the end, gap and slip, averaged
//! over the contact points around each node, are within the tolerance, whatever the penalty. If more contact points
//! touch than the grid has degrees of freedom for, they hinder each other, and updates only shift forces between them.
//! Where an update leaves more than a quarter of the error, an error of 10⁻⁴ of a cell is therefore accepted, or of
//! 10⁻³ after six updates, and single contact points may keep 10⁻³ (see [`multipliers`]). The residual of Newton's
//! method is that of the final forces, and [`ToolState::overlap`] reports the overlap that is left.
//!
//! At the end of a step, the forces that the nodes cannot tell apart are distributed evenly (see [`distribution`]), so
//! that neighbours do not push and pull each other more and more.
//!
//! Friction has no potential, and iterations may run in cycles between states, above all at the edges of rough tools.
//! If they have not converged after 25 iterations in a step of a quarter of the requested size or less, L is therefore
//! held for the rest of the step: the problem of a given L has a potential. Updates of the multipliers renew L from the
//! pressures; after ten of them, L only falls. A step is refused if contact points then slide at less than their
//! friction, by more than 0.1 % of all friction together; rough surfaces may slide at less than their L, which is a
//! safeguard itself.
//!
//! Near the solution, the multipliers are updated along one increment of Newton's method per step, without a change of
//! state (see [`multipliers`]): most steps then need no further update, and no more solves than a step without contact.
//!
//! # Safeguards
//!
//! A step fails, and a smaller step is tried, if a contact point moves too far along a tool, emerges on another side of
//! the tool or passes through a part of it. The same happens if a part of a tool lies between the centre of a domain
//! and one of its corners. At the start of the iterations, when the tool has moved and the bodies have not, the surface
//! of the tool is extrapolated as a plane. Contact points that touch without force, such as those of a block on a slope
//! before its first step, then contribute their stiffness, which holds the body.

mod augmentation;
mod body_side;
mod candidates;
mod carriers;
mod counterpart;
mod distribution;
mod edges;
mod evaluation;
mod facet;
mod facing_in_space;
mod interface;
mod key;
mod motion;
mod multipliers;
mod neighbours;
mod on_sides;
mod outer;
mod pair_state;
mod pairs;
mod ranks;
mod safeguards;
mod search;
mod sides;
mod start;
mod state;
mod support;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use rustc_hash::FxHashMap;
use serde_json::Value;

use crate::assembly::{System, Wanted};
use crate::model::{Model, Tool};
use crate::points::Points;
use crate::ranks::Reduction;
use crate::region::vector::{along, dot, minus, norm};
use crate::step::{At, Experiment, Nodal, StepContext};
use crate::surface::OuterSides;

use super::attached::{Attached, Obstacle};
use super::failure::{BeginError, EvaluateError};
use super::global_unknowns::{GlobalMotion, GlobalUnknowns};
use super::layout::Layout;
use super::ledger::{Ledger, NamedEnergy};
use super::multipliers::Multipliers;
use super::report::TermReport;
use super::saved::Saved;
use super::term::{Character, Coupled, Term};
use candidates::Candidate;
use counterpart::Counterpart;
use distribution::{Bearing, distributed};
use edges::Edges;
use evaluation::{Trial, Trials};
use interface::Multiplier;
use key::{Kept, Key};
use motion::Moving;
use multipliers::{Change, Worst, multiplier_of};
use ranks::{Failure, agreed, gathered};
use search::Found;
use support::support_sliding;

pub use interface::Mode;
pub use pair_state::{FacetPoint, PairState};
pub use start::{StartOverlap, boxes_on_the_way, overlaps_at_start};
pub use state::{ContactPoint, PartState, ToolState};

/// The rigid tools of a model and their contact with the bodies.
#[derive(Debug, Clone)]
pub struct Contact<const D: usize> {
    tools: Vec<Moving<D>>,
    /// The nodes that this rank shares with others in the current step.
    reduction: Reduction,
    /// The state kept for the contact points that touched at the end of the last converged step.
    converged: FxHashMap<Key, Kept<D>>,
    /// For each body, true if it took part in the last converged step.
    has_begun: Vec<bool>,
    /// The outer sides of domains, which share their areas among the contact points.
    outer: OuterSides,
    /// Positions on the edges of each tool.
    edges: Vec<Edges<D>>,
    /// For each body, true if it has points in the current step.
    is_there: Vec<bool>,
    /// The contact points on this rank that may touch a tool in the current step; their multipliers at its start, and
    /// whether they touched then; their current multipliers; and their state at the last evaluation.
    candidates: Vec<Candidate<D>>,
    start: Vec<Multiplier<D>>,
    has_touched: Vec<bool>,
    multipliers: Vec<Multiplier<D>>,
    trials: Vec<Trial<D>>,
    /// For each tool, the distance beyond which contact points under a flat part of its surface sleep, [length]; and
    /// whether they have woken since the system was laid out.
    awake: Vec<f64>,
    has_woken: bool,
    /// Working space for the search.
    pieces: Vec<Found<D>>,
    /// Size of the smallest cell that holds a point, [length].
    smallest: f64,
    /// The multipliers before the updates along an increment, and the largest error at the last of these updates.
    before_increment: Vec<Multiplier<D>>,
    worst_along: Option<Worst>,
    /// The tolerance for each tool, relative to the size of a cell, [-].
    tolerances: Vec<f64>,
    /// True if the last evaluation was at the start of the iterations.
    at_rest: bool,
    /// True as long as contact points with friction have only stuck to flat surfaces in the current step.
    is_symmetric: bool,
    /// Number of updates of the multipliers in the current step, without those along an increment.
    updates: usize,
    /// True if the largest shear of each contact point is held for the rest of the step, see [`augmentation`].
    is_held: bool,
    /// Number of updates of the largest shears that are held.
    held_updates: usize,
    /// The experiment that is made in the current step.
    experiment: Option<Experiment>,
    /// The changes made by the last update, and the largest error among them.
    changes: Vec<Option<Change<D>>>,
    before: Option<Worst>,
    /// Time at the end of the current step, and the load factor at the last evaluation if it is an unknown.
    time: f64,
    factor: f64,
}

impl<const D: usize> Contact<D> {
    /// Contact with the tools of a model, at the start of the analysis.
    pub fn new(model: &Model<D>) -> Self {
        Contact {
            tools: (model.tools.iter().map(Moving::new))
                .chain(model.contacts.iter().map(|_| Moving::at_rest()))
                .collect(),
            reduction: Reduction::default(),
            converged: FxHashMap::default(),
            has_begun: vec![false; model.bodies.len()],
            outer: OuterSides::default(),
            edges: vec![Edges::default(); model.tools.len()],
            is_there: vec![false; model.bodies.len()],
            candidates: Vec::new(),
            awake: Vec::new(),
            has_woken: false,
            pieces: Vec::new(),
            smallest: f64::INFINITY,
            start: Vec::new(),
            has_touched: Vec::new(),
            multipliers: Vec::new(),
            trials: Vec::new(),
            before_increment: Vec::new(),
            worst_along: None,
            tolerances: Counterpart::all(model).map(|other| other.control().tolerance).collect(),
            at_rest: true,
            is_symmetric: true,
            updates: 0,
            is_held: false,
            held_updates: 0,
            experiment: None,
            changes: Vec::new(),
            before: None,
            time: 0.0,
            factor: 0.0,
        }
    }

    /// The tools of a model at the start, without forces.
    pub fn at_start(model: &Model<D>) -> Vec<ToolState<D>> {
        Contact::new(model).states(model)
    }

    /// The pairs of bodies of a model at the start, without forces.
    pub fn pairs_at_start(model: &Model<D>) -> Vec<PairState<D>> {
        Contact::new(model).pair_states(model)
    }

    /// Evaluates all contact points; `farthest` is the largest displacement of a node, [length], and `kept` tells for
    /// each tool whether contact points that carried force hold it at the start of the iterations.
    fn try_all<const N: usize>(
        &mut self,
        model: &Model<D>,
        at: At<N>,
        farthest: f64,
        kept: &[bool],
    ) -> Result<(), Failure> {
        let (at_rest, is_frozen) = (self.at_rest, self.experiment == Some(Experiment::FrozenContact));
        let trials =
            Trials { model, tools: &self.tools, delta_d: at.delta_d, farthest, at_rest, kept, is_frozen };
        let found = trials.all(&self.candidates, &self.multipliers, &self.has_touched, &mut self.trials);
        agreed(&self.reduction, found)
    }

    /// The forces of the contact points that touch a tool at the last evaluation, [force], distributed evenly.
    fn distributed(&self) -> Vec<[f64; D]> {
        let bearing = self.touching().map(|(_, candidate, trial, touch)| Bearing { candidate, trial, touch });
        distributed(&bearing.collect::<Vec<_>>(), &self.reduction)
    }

    /// The contact points on this rank that touch a tool at the last evaluation.
    fn touching(&self) -> impl Iterator<Item = (usize, &Candidate<D>, &Trial<D>, &interface::Touch<D>)> {
        let pairs = self.candidates.iter().zip(&self.trials).enumerate();
        pairs.filter_map(|(k, (candidate, trial))| Some((k, candidate, trial, trial.touch.as_deref()?)))
    }
}

impl<const D: usize, const N: usize> Term<D, N> for Contact<D> {
    fn name(&self) -> &'static str {
        "contact"
    }

    fn character(&self, model: &Model<D>) -> Character {
        Character {
            is_symmetric: self.is_symmetric,
            has_kinks: true,
            has_potential: !Counterpart::all(model).any(|other| other.resists_sliding()),
            may_slump: false,
            may_hold: true,
        }
    }

    fn begin(&mut self, step: &StepContext<D>, points: &Points<D>) -> Result<(), BeginError> {
        let found = self.find(step, points);
        self.experiment = step.experiment;
        if step.experiment == Some(Experiment::FrozenFriction) {
            self.freeze_friction(step.model);
        }
        match found {
            Err(Failure::Own(error)) => Err(BeginError::Contact(Box::new(error))),
            // The solver passes an error on another rank to this rank.
            Err(Failure::OnRank) | Ok(()) => Ok(()),
        }
    }

    fn couples(&self, couple: &mut dyn FnMut(Coupled)) {
        let mut lists = BTreeSet::new();
        let mut last: Option<&Candidate<D>> = None;
        for candidate in &self.candidates {
            let nodes = candidate.basis.iter().map(|(node, _)| node as u32);
            if last.is_some_and(|last| last.basis.iter().map(|(node, _)| node as u32).eq(nodes.clone())) {
                continue;
            }
            let mut list: Vec<u32> = nodes.collect();
            list.sort_unstable();
            list.dedup();
            lists.insert(list);
            last = Some(candidate);
        }
        lists.iter().for_each(|nodes| couple(Coupled::Nodes(nodes)));
    }

    fn evaluate(
        &mut self,
        step: &StepContext<D>,
        points: &mut Points<D>,
        at: At<N>,
        wanted: Wanted,
        sum: &mut System<N>,
    ) -> Result<(), EvaluateError> {
        let mut free = at.globals;
        for moving in &mut self.tools {
            let (own, rest) = free.split_at(moving.free.len().min(free.len()));
            moving.place(own);
            free = rest;
        }
        let (farthest, at_rest) = self.motion(at);
        self.wake(step, points, farthest)?;
        let model = step.model;
        self.at_rest = at_rest;
        let mut kept = vec![false; self.tools.len()];
        self.try_all(model, at, farthest, &kept)?;
        let [mut touches, mut holds] = self.touched();
        if at_rest {
            for (kept, (moving, touches)) in kept.iter_mut().zip(self.tools.iter().zip(&touches)) {
                *kept = moving.first_free().is_some() && !touches;
            }
            if kept.contains(&true) {
                self.try_all(model, at, farthest, &kept)?;
                [touches, holds] = self.touched();
            }
            self.check_that_free_tools_touch(model, &touches)?;
        }
        let keeps_symmetry = |candidate: &Candidate<D>, touch: &interface::Touch<D>| {
            touch.is_symmetric() && (candidate.facet.is_none() || touch.is_smooth())
        };
        let is_symmetric = self.touching().all(|(_, candidate, _, touch)| keeps_symmetry(candidate, touch));
        self.is_symmetric &= is_symmetric;
        let pairs: Vec<_> = self.candidates.iter().zip(&self.trials).collect();
        if wanted == Wanted::Stiffness {
            support_sliding(&self.tools, &pairs, &holds, &self.reduction, sum);
        }
        evaluation::add(&self.tools, &pairs, wanted, sum);
        self.factor = at.factor;
        let counts = self.reduction.counts_globals();
        evaluation::add_loads(model, &self.tools, step.step.end, at, counts, sum);
        Ok(())
    }

    fn force_at_start(&self, force: &mut Nodal<N>) {
        for (candidate, multiplier) in self.candidates.iter().zip(&self.start) {
            let shear = self.tools[candidate.key.tool as usize].start.vector_to_space(&multiplier.shear);
            let turned = along(&shear, multiplier.normal, &candidate.near.normal);
            for (node, value) in candidate.basis.iter() {
                (0..D).for_each(|d| force[node][d] += value * turned[d]);
            }
        }
    }

    /// The work of friction by the trapezoidal rule.
    fn ledger(&self, _: &StepContext<D>, _: &Points<D>, _: At<N>) -> Ledger {
        let friction =
            |(k, candidate, trial, touch): (usize, &Candidate<D>, &Trial<D>, &interface::Touch<D>)| {
                let moving = &self.tools[candidate.key.tool as usize];
                let before = trial.in_global_axes(candidate, moving, &self.start[k].shear);
                -0.5 * dot(&along(&before, 1.0, &touch.shear), &touch.slip())
            };
        [NamedEnergy::dissipated(Ledger::FRICTION, self.touching().map(friction).sum())].into()
    }

    fn report(&self, model: &Model<D>, report: &mut TermReport<D>) {
        let states = self.states(model);
        for (moving, state) in self.tools.iter().zip(&states) {
            report.add_driven(moving.against(&state.force, &state.moment));
        }
        report.add_list(states);
        report.add_list(self.pair_states(model));
    }

    fn commit(&mut self, _: &StepContext<D>, _: &mut Points<D>) {
        // Surfaces that have parted no longer transfer tension.
        let forces = self.distributed();
        let touching = self.touching().zip(&forces).filter(|((.., touch), _)| touch.mode != Mode::Parting);
        let touching = touching.map(|((_, candidate, trial, touch), force)| {
            let mut multiplier = multiplier_of(touch, force);
            let is_between_bodies = candidate.facet.is_some();
            if !is_between_bodies {
                let moving = &self.tools[candidate.key.tool as usize];
                multiplier.shear = moving.end.vector_to_tool(&multiplier.shear);
            }
            let in_space = minus(&trial.position, &candidate.start);
            let motion = norm(&trial.slip).max(norm(&in_space));
            let key = if is_between_bodies { candidate.key.of_corner() } else { candidate.key };
            (key, Kept { multiplier, motion, excess: (-touch.gap()).max(0.0) })
        });
        // Material points may move to other ranks.
        let touching = gathered(&self.reduction, touching.collect());
        self.converged.clear();
        for (key, kept) in touching {
            self.converged.entry(key).and_modify(|other| *other = other.joined(kept)).or_insert(kept);
        }
        self.tools.iter_mut().for_each(Moving::commit);
        self.has_begun.iter_mut().zip(&self.is_there).for_each(|(begun, there)| *begun = *there);
    }

    fn save(&self) -> Option<Saved> {
        let poses: Vec<_> = self.tools.iter().map(|moving| moving.start).collect();
        let (converged, has_begun) = (self.converged.clone(), self.has_begun.clone());
        Some(Saved::new(move || multipliers::save(&poses, &converged, &has_begun)))
    }

    fn restore(&mut self, saved: &Value) -> Result<(), String> {
        let (poses, converged, has_begun) =
            multipliers::restore(saved, self.tools.len(), self.has_begun.len())?;
        for (moving, pose) in self.tools.iter_mut().zip(poses) {
            (moving.start, moving.end) = (pose, pose);
        }
        (self.converged, self.has_begun) = (converged, has_begun);
        Ok(())
    }

    fn multipliers(&mut self) -> Option<&mut dyn Multipliers<D, N>> {
        Some(self)
    }

    fn global_unknowns(&self) -> Option<&dyn GlobalUnknowns<D>> {
        Some(self)
    }

    fn attached(&mut self) -> Option<&mut dyn Attached<D>> {
        Some(self)
    }

    fn obstacle(&self) -> Option<&dyn Obstacle<D>> {
        Some(self)
    }

    fn layout(&mut self) -> Option<&mut dyn Layout> {
        Some(self)
    }
}

impl<const D: usize> GlobalUnknowns<D> for Contact<D> {
    fn count(&self) -> usize {
        self.tools.iter().map(|moving| moving.free.len()).sum()
    }

    fn motions(&self, model: &Model<D>) -> Vec<GlobalMotion> {
        let components = |(tool, moving): (&Tool<D>, &Moving<D>)| -> Vec<(String, usize, bool)> {
            let named = |&k: &usize| (tool.name.clone(), k, tool.freedom(k).is_free());
            moving.free.iter().map(named).collect()
        };
        let all = model.tools.iter().zip(&self.tools).flat_map(components).enumerate();
        all.map(|(number, (name, component, is_free))| GlobalMotion { number, name, component, is_free })
            .collect()
    }
}

impl<const D: usize> Attached<D> for Contact<D> {
    /// The multipliers of bodies that have not begun are ignored.
    fn forget_bodies(&mut self, _: &Model<D>, removed: &[usize]) {
        for (body, begun) in self.has_begun.iter_mut().enumerate() {
            *begun &= !removed.contains(&body);
        }
    }
}

impl<const D: usize> Obstacle<D> for Contact<D> {
    fn nearest_allowed(&self, model: &Model<D>, body: usize, place: [f64; D]) -> [f64; D] {
        let out_of = |place: [f64; D], (moving, tool): (&Moving<D>, &Tool<D>)| {
            if tool.interface_with(body).is_none() {
                return place;
            }
            match moving.start.closest(tool.shape.as_ref(), place, f64::INFINITY) {
                Some(found) if found.gap < 0.0 => found.point,
                _ => place,
            }
        };
        self.tools.iter().zip(&model.tools).fold(place, out_of)
    }
}

impl<const D: usize> Layout for Contact<D> {
    fn outgrows(&self) -> bool {
        self.has_woken
    }

    fn forget_layout(&mut self) {
        self.has_woken = false;
    }
}
