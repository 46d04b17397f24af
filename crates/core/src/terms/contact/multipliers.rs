//! The multipliers of the augmented Lagrangian: the contact forces at which gaps and slips vanish.

use rustc_hash::FxHashMap;
use serde_json::{Value, json};

use crate::ranks::Reduction;
use crate::region::vector::{along, minus, norm};
use crate::tool::Pose;

use super::candidates::Candidate;
use super::evaluation::Trial;
use super::interface::{Added, Multiplier, Touch};
use super::key::{Kept, Key};
use super::motion::Moving;
use super::ranks::{NodalSum, Plain, add_at_nodes, gathered, plain_parts};

plain_parts!([] Worst, { tool, named, rank, size, place, mean, overlap, slip });
plain_parts!([const D: usize] Kept<D>, { multiplier, motion, excess });

/// Largest error of a single contact point, relative to the size of a cell, [-]. Contact points that touch may hinder
/// each other: along an edge, a cell has degrees of freedom for only two of them, and the domains of GIMP points leave
/// gaps of this order at the start of a step. In this case, only the mean error that the nodes see meets the tolerance.
pub(super) const MAX_CONTACT_ERROR: f64 = 1e-3;
/// Contact points hinder each other if an update leaves more than this fraction of the error, [-]: normally it leaves
/// about 1/p_f.
const SLOW: f64 = 0.25;
/// Largest error seen by the nodes that is accepted where contact points hinder each other, relative to the size of a
/// cell, [-]; after `MANY` updates, [`MAX_CONTACT_ERROR`] is accepted.
const MAX_SLOW_ERROR: f64 = 1e-4;
/// Number of updates after which further ones hardly help where contact points hinder each other.
pub(super) const MANY: usize = 6;

/// The multipliers of a contact point once its forces become multipliers.
pub(super) fn forces_of<const D: usize>(
    candidate: &Candidate<D>,
    trial: &Trial<D>,
    moving: &Moving<D>,
) -> Multiplier<D> {
    let touch = trial.touch.as_ref();
    touch.map_or_else(Multiplier::default, |touch| {
        let Multiplier { normal, shear } = multiplier_of(touch, &touch.force());
        Multiplier { normal, shear: trial.in_frame(candidate, moving, &shear) }
    })
}

/// The multipliers of a contact point that bears this force on the body, [force]; the shear in global axes.
pub(super) fn multiplier_of<const D: usize>(touch: &Touch<D>, force: &[f64; D]) -> Multiplier<D> {
    let (normal, shear) = touch.parts(force);
    Multiplier { normal, shear }
}

/// The largest differences between forces and multipliers, and where they occur.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Worst {
    /// The tool of the contact point with the largest mean error relative to its tolerance.
    pub(super) tool: usize,
    /// The contact point that an error names: its index among the candidates of its rank, this rank, and the size of
    /// its cell, [length].
    pub(super) named: usize,
    pub(super) rank: usize,
    pub(super) size: f64,
    /// Largest error of a contact point, and largest mean error seen by the nodes around a contact point, relative to
    /// the size of a cell, [-].
    pub(super) place: f64,
    pub(super) mean: f64,
    /// What an update changes at the contact point that an error names, divided by the penalty, [length]: the pressure
    /// as an overlap, and the shear as a slip, which is the actual slip if the contact point sticks.
    pub(super) overlap: f64,
    pub(super) slip: f64,
}

/// What an update would change at a contact point, divided by the penalty, [length].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Change<const D: usize> {
    overlap: f64,
    slip: f64,
    /// e = (overlap, slip), in global axes.
    vector: [f64; D],
}

impl<const D: usize> Change<D> {
    /// The changes of the pressure and the shear, both divided by the penalty, [length].
    pub(super) fn new(overlap: f64, shear: &[f64; D], normal: &[f64; D]) -> Self {
        Change { overlap, slip: norm(shear), vector: along(shear, overlap, normal) }
    }

    /// The changes made by an update of all multipliers; `None` for contact points that are open and stay so.
    pub(super) fn by_update(
        candidates: &[Candidate<D>],
        multipliers: &[Multiplier<D>],
        trials: &[Trial<D>],
        tools: &[Moving<D>],
    ) -> Vec<Option<Self>> {
        let change = |((candidate, multiplier), trial): ((&Candidate<D>, &Multiplier<D>), &Trial<D>)| {
            let moving = &tools[candidate.key.tool as usize];
            if trial.touch.is_none() && *multiplier == Multiplier::default() || candidate.penalty == 0.0 {
                return None;
            }
            let now = forces_of(candidate, trial, moving);
            let overlap = (now.normal - multiplier.normal) / candidate.penalty;
            let shear = along(&now.shear, -1.0, &multiplier.shear).map(|t| t / candidate.penalty);
            // A contact point that has opened no longer has a normal; the normal at the start of the step serves
            // instead.
            let normal = trial.touch.as_ref().map_or(candidate.near.normal, |touch| touch.normal());
            Some(Change::new(overlap, &trial.in_global_axes(candidate, moving, &shear), &normal))
        };
        candidates.iter().zip(multipliers).zip(trials).map(change).collect()
    }

    fn size(&self) -> f64 {
        self.overlap.abs().max(self.slip)
    }

    /// True if the previous update has left much of the error of a contact point.
    pub(super) fn is_slow(&self, before: &Self) -> bool {
        self.size() > SLOW * before.size()
    }
}

/// Numbers for the pairs of a tool and a node that carries contact points of this tool.
pub(super) struct NodeNumbers {
    /// For each contact point, the index in `numbers` at which its numbers begin; consecutive contact points with the
    /// same nodes share their numbers.
    first: Vec<usize>,
    numbers: Vec<usize>,
    known: FxHashMap<(u32, usize), usize>,
}

impl NodeNumbers {
    /// The numbers for these contact points, each with the number of its tool, or of its group of contact points.
    pub(super) fn new<'a, const D: usize>(places: impl Iterator<Item = (u32, &'a Candidate<D>)>) -> Self {
        let (mut first, mut numbers) = (Vec::new(), Vec::new());
        let mut known: FxHashMap<(u32, usize), usize> = FxHashMap::default();
        let mut last: Option<(u32, &Candidate<D>, usize)> = None;
        for (group, place) in places {
            let same = last.filter(|(of, last, _)| *of == group && last.basis.has_same_nodes(&place.basis));
            let begin = same.map_or(numbers.len(), |(.., begin)| begin);
            if same.is_none() {
                let nodes = place.basis.iter().map(|(node, _)| (group, node));
                let next = |key| {
                    let n = known.len();
                    *known.entry(key).or_insert(n)
                };
                numbers.extend(nodes.map(next));
            }
            first.push(begin);
            last = Some((group, place, begin));
        }
        NodeNumbers { first, numbers, known }
    }

    /// The pairs, in the order of their numbers.
    pub(super) fn pairs(&self) -> Vec<(u32, usize)> {
        let mut pairs = vec![(0, 0); self.known.len()];
        self.known.iter().for_each(|(pair, number)| pairs[*number] = *pair);
        pairs
    }

    /// The numbers of the nodes of a contact point, in the order of these nodes, followed by the numbers of later
    /// contact points.
    pub(super) fn numbers_at(&self, place: usize) -> &[usize] {
        &self.numbers[self.first[place]..]
    }

    /// The number of a pair of a tool or group and a node; `None` if no contact point has it.
    pub(super) fn number_of(&self, tool: u32, node: usize) -> Option<usize> {
        self.known.get(&(tool, node)).copied()
    }
}

/// The largest errors on all ranks; `None` if all contact points are open and stay so.
///
/// An update changes the force at a contact point by ε e. The nodes see ē = Σ |N_v| ē_v at the contact point, with the
/// nodal means ē_v = Σ |N_v| ε e/Σ |N_v| ε over the contact points around node v. Both |e| and |ē| must be small.
pub(super) fn worst<const D: usize>(
    candidates: &[Candidate<D>],
    changes: &[Option<Change<D>>],
    tolerances: &[f64],
    reduction: &Reduction,
) -> Option<Worst> {
    let changing = || {
        let all = candidates.iter().zip(changes).enumerate();
        all.filter_map(|(k, (candidate, change))| Some((k, candidate, change.as_ref()?)))
    };
    let numbers = NodeNumbers::new(changing().map(|(_, candidate, _)| (candidate.group(), candidate)));
    let mut nodal = vec![NodalSum::<D>::NONE; numbers.known.len()];
    for (i, (_, candidate, change)) in changing().enumerate() {
        for ((_, value), &node) in candidate.basis.iter().zip(numbers.numbers_at(i)) {
            let weight = value.abs() * candidate.penalty;
            let sum = &mut nodal[node];
            sum.vector = along(&sum.vector, weight, &change.vector);
            sum.weight += weight;
        }
    }
    add_at_nodes(reduction, &mut nodal, &numbers.pairs(), |tool, node| numbers.number_of(tool, node));
    let seen_by_nodes = |i: usize, candidate: &Candidate<D>| {
        let nodes = candidate.basis.iter().zip(numbers.numbers_at(i));
        nodes.fold([0.0; D], |seen, ((_, value), &node)| match &nodal[node] {
            NodalSum { vector, weight } if *weight > 0.0 => along(&seen, value.abs() / weight, vector),
            _ => seen,
        })
    };
    let mut largest = Largest { tolerances, means: None, places: None };
    for (i, (k, candidate, change)) in changing().enumerate() {
        largest.include(
            [Worst {
                tool: candidate.key.tool as usize,
                named: k,
                rank: reduction.own(),
                size: candidate.size,
                place: change.size() / candidate.size,
                mean: norm(&seen_by_nodes(i, candidate)) / candidate.size,
                overlap: change.overlap,
                slip: change.slip,
            }; 2],
        );
    }
    let own: Vec<[Worst; 2]> = largest.both().into_iter().collect();
    let mut largest = Largest { tolerances, means: None, places: None };
    gathered(reduction, own).into_iter().for_each(|pair| largest.include(pair));
    let [means, places] = largest.both()?;
    let named = if places.place > MAX_CONTACT_ERROR { places } else { means };
    Some(Worst { tool: means.tool, place: places.place, mean: means.mean, ..named })
}

/// The contact point with the largest mean error relative to its tolerance, and the contact point with the largest
/// individual error.
struct Largest<'a> {
    tolerances: &'a [f64],
    means: Option<Worst>,
    places: Option<Worst>,
}

impl Largest<'_> {
    /// Includes two further contact points: one for the mean error and one for the individual error.
    fn include(&mut self, [means, places]: [Worst; 2]) {
        let relative = |worst: &Worst| worst.mean / self.tolerances[worst.tool];
        if self.means.is_none_or(|other| relative(&means) > relative(&other)) {
            self.means = Some(means);
        }
        if self.places.is_none_or(|other| places.place > other.place) {
            self.places = Some(places);
        }
    }

    fn both(&self) -> Option<[Worst; 2]> {
        Some([self.means?, self.places?])
    }
}

impl Worst {
    /// True if an update is worthwhile; `before` is the error at the previous update.
    pub(super) fn is_worth_it(&self, tolerance: f64, before: Option<&Worst>) -> bool {
        let falls = |before: &Worst| self.place <= SLOW * before.place;
        self.mean > tolerance && before.is_none_or(falls)
    }

    /// Error relative to the tolerated error, [-].
    fn error(&self, tolerance: f64) -> f64 {
        (self.place / MAX_CONTACT_ERROR).max(self.mean / tolerance)
    }

    /// True if no further update is needed after a number of `updates`. `before` is the error before the last update;
    /// `is_last` is true if no further update is allowed.
    pub(super) fn is_settled(
        &self,
        tolerance: f64,
        before: Option<&Worst>,
        updates: usize,
        is_last: bool,
    ) -> bool {
        let helps_little = |before: &Worst| self.error(tolerance) > SLOW * before.error(tolerance);
        let is_slow = is_last || before.is_some_and(helps_little);
        let most = if updates < MANY { MAX_SLOW_ERROR } else { MAX_CONTACT_ERROR };
        let accepted = if is_slow { tolerance.max(most) } else { tolerance };
        self.error(accepted) <= 1.0
    }
}

/// A contact point at the linearised end of an increment.
pub(super) struct Followed<const D: usize> {
    /// Its multipliers after an update.
    pub(super) multiplier: Multiplier<D>,
    /// The force on the body that the update adds, [force].
    pub(super) force: [f64; D],
    /// What the update changes.
    pub(super) change: Option<Change<D>>,
}

/// A contact point at the linearised end of an increment of the nodes, `delta`, and of the unknown motions of its tool,
/// `motions`; `None` if the contact point changes its state on the way.
pub(super) fn followed<const D: usize, const N: usize>(
    candidate: &Candidate<D>,
    multiplier: &Multiplier<D>,
    trial: &Trial<D>,
    moving: &Moving<D>,
    delta: &[[f64; N]],
    motions: &[f64],
) -> Option<Followed<D>> {
    let slipped = candidate.displacement(delta);
    let (mut relative, mut slipping) = (slipped, slipped);
    if trial.facing.is_some() {
        relative = trial
            .carriers(candidate)
            .fold([0.0; D], |sum, (node, value)| std::array::from_fn(|d| sum[d] + value * delta[node][d]));
    }
    let carried = minus(&trial.position, &trial.slip);
    for (&k, motion) in moving.free.iter().zip(motions) {
        relative = along(&relative, -motion, &moving.velocity(k, &trial.position).0);
        slipping = along(&slipping, -motion, &moving.velocity(k, &carried).0);
    }
    let Some(touch) = &trial.touch else {
        // The contact point stays open: its multipliers vanish and add no force.
        return (*multiplier == Multiplier::default()).then_some(Followed {
            multiplier: *multiplier,
            force: [0.0; D],
            change: None,
        });
    };
    let now = Multiplier { shear: trial.in_global_axes(candidate, moving, &multiplier.shear), ..*multiplier };
    let Added { multiplier: next, force, overlap, slip } = touch.update_along(&now, &relative, &slipping)?;
    let next = Multiplier { shear: trial.in_frame(candidate, moving, &next.shear), ..next };
    let change = Change::new(overlap, &slip, &touch.normal());
    Some(Followed { multiplier: next, force, change: Some(change) })
}

/// The poses of the tools, the state kept for the contact points, and whether each body has begun.
type State<const D: usize> = (Vec<Pose<D>>, FxHashMap<Key, Kept<D>>, Vec<bool>);

/// The state at the end of the last converged step.
pub(super) fn save<const D: usize>(
    poses: &[Pose<D>],
    converged: &FxHashMap<Key, Kept<D>>,
    has_begun: &[bool],
) -> Value {
    let poses: Vec<Vec<f64>> = poses.iter().map(Pose::to_numbers).collect();
    let mut places: Vec<(&Key, &Kept<D>)> = converged.iter().collect();
    places.sort_by_key(|(key, _)| **key);
    let keys: Vec<u32> = places.iter().flat_map(|(key, _)| [key.tool, key.point, key.corner]).collect();
    let kept = || places.iter().map(|(_, kept)| *kept);
    let forces: Vec<f64> =
        kept().flat_map(|kept| [kept.multiplier.normal].into_iter().chain(kept.multiplier.shear)).collect();
    let motions: Vec<f64> = kept().flat_map(|kept| [kept.motion, kept.excess]).collect();
    json!({"poses": poses, "places": keys, "forces": forces, "motions": motions, "bodies": has_begun})
}

/// Restores the state that [`save`] returned, for these numbers of tools and bodies.
pub(super) fn restore<const D: usize>(
    saved: &Value,
    tools: usize,
    bodies: usize,
) -> Result<State<D>, String> {
    fn part<T: serde::de::DeserializeOwned>(saved: &Value, key: &str) -> Result<T, String> {
        serde_json::from_value(saved[key].clone()).map_err(|error| error.to_string())
    }
    let poses: Vec<Vec<f64>> = part(saved, "poses")?;
    let keys: Vec<u32> = part(saved, "places")?;
    let forces: Vec<f64> = part(saved, "forces")?;
    let motions: Vec<f64> = part(saved, "motions")?;
    let has_begun: Vec<bool> = part(saved, "bodies")?;
    let poses: Option<Vec<Pose<D>>> = poses.iter().map(|numbers| Pose::from_numbers(numbers)).collect();
    let poses = poses.filter(|poses| poses.len() == tools).ok_or("its poses are not those of the tools")?;
    let (motions, rest) = motions.as_chunks::<2>();
    let n = motions.len();
    let fits = rest.is_empty() && keys.len() == 3 * n && forces.len() == (1 + D) * n;
    if !fits || has_begun.len() != bodies {
        return Err("its contact points are not those of the bodies".to_owned());
    }
    let mut converged = FxHashMap::default();
    for ((key, force), motion) in keys.chunks_exact(3).zip(forces.chunks_exact(1 + D)).zip(motions) {
        let [motion, excess] = *motion;
        let key = Key { tool: key[0], point: key[1], corner: key[2] };
        let multiplier = Multiplier { normal: force[0], shear: std::array::from_fn(|d| force[1 + d]) };
        let is_known = (key.tool as usize) < tools && motion >= 0.0 && excess >= 0.0;
        if !is_known || !force.iter().all(|f| f.is_finite()) {
            return Err("a force on its contact points is invalid".to_owned());
        }
        converged.insert(key, Kept { multiplier, motion, excess });
    }
    Ok((poses, converged, has_begun))
}
