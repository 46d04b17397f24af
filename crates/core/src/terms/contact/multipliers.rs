//! The multipliers of the augmented Lagrangian: the forces that hold when gaps and slips vanish.

use std::collections::BTreeMap;

use super::candidates::Candidate;
use super::evaluation::Trial;
use super::interface::Multiplier;
use super::motion::Moving;
use crate::region::vector::{along, norm};

/// Largest error of a single place, relative to the size of a cell, [-]. Places may touch that hinder each other: a cell has
/// freedom for two on an edge, and the domains of GIMP points leave gaps of this order at the start of a step. Only the mean
/// error around a node meets the tolerance then.
const MOST_OF_PLACE: f64 = 1e-3;
/// Places hinder each other if an update leaves more than this fraction of the error, [-]: it leaves about 1/p_f otherwise.
const SLOW: f64 = 0.25;
/// Largest mean error around a node, relative to the size of a cell, that is accepted where places hinder each other, [-].
const MOST_WHERE_SLOW: f64 = 1e-4;

/// The multipliers that a place has when its forces become multipliers.
pub(super) fn forces_of<const D: usize>(trial: &Trial<D>, moving: &Moving<D>) -> Multiplier<D> {
    trial.touch.map_or_else(Multiplier::default, |touch| Multiplier {
        normal: touch.pressure,
        shear: moving.end.vector_to_tool(&touch.shear),
    })
}

/// Where forces and multipliers differ most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Worst {
    /// Index of the candidate.
    pub(super) candidate: usize,
    /// Error of the place, and mean error around its nodes, relative to the size of a cell, [-].
    pub(super) place: f64,
    pub(super) mean: f64,
    /// The changes by an update, over the penalty, [length]: overlap, and slip of places that stick.
    pub(super) overlap: f64,
    pub(super) slip: f64,
}

/// The candidate with the largest error; `None` if no multiplier would change.
///
/// An update changes the force of a place by ε e, with e = (overlap, slip). Both |e| of each place and |Σ N_v ε e|/Σ N_v ε of
/// each node must be small.
pub(super) fn worst<const D: usize>(
    candidates: &[Candidate<D>],
    multipliers: &[Multiplier<D>],
    trials: &[Trial<D>],
    tools: &[Moving<D>],
    tolerances: &[f64],
) -> Option<Worst> {
    let mut of_nodes: BTreeMap<(u32, u32), ([f64; D], f64)> = BTreeMap::new();
    let mut errors = Vec::with_capacity(candidates.len());
    for ((candidate, multiplier), trial) in candidates.iter().zip(multipliers).zip(trials) {
        let moving = &tools[candidate.key.tool as usize];
        if trial.touch.is_none() && *multiplier == Multiplier::default() || candidate.penalty == 0.0 {
            errors.push([0.0; 2]);
            continue;
        }
        let now = forces_of(trial, moving);
        let overlap = (now.normal - multiplier.normal) / candidate.penalty;
        let shear = along(&now.shear, -1.0, &multiplier.shear).map(|t| t / candidate.penalty);
        // A place that has opened has no normal any more; that at the start serves as well.
        let normal = trial.touch.map_or(candidate.near.normal, |touch| touch.normal());
        let error = along(&moving.end.vector_to_space(&shear), overlap, &normal);
        for (&node, value) in candidate.basis.nodes().iter().zip(candidate.basis.value()) {
            let weight = value.abs() * candidate.penalty;
            let (sum, total) = of_nodes.entry((candidate.key.tool, node)).or_insert(([0.0; D], 0.0));
            *sum = along(sum, weight, &error);
            *total += weight;
        }
        errors.push([overlap, norm(&shear)]);
    }
    let of_candidate = |k: usize| {
        let (candidate, [overlap, slip]) = (&candidates[k], errors[k]);
        let nodes =
            candidate.basis.nodes().iter().filter_map(|node| of_nodes.get(&(candidate.key.tool, *node)));
        let means = nodes.filter(|(_, total)| *total > 0.0).map(|(sum, total)| norm(sum) / total);
        let mean = means.fold(0.0, f64::max) / candidate.size;
        Worst { candidate: k, place: overlap.abs().max(slip) / candidate.size, mean, overlap, slip }
    };
    let changes = (0..candidates.len()).filter(|k| errors[*k] != [0.0; 2]);
    let mut found: Option<Worst> = None;
    for now in changes.map(of_candidate) {
        let tolerance = |worst: &Worst| tolerances[candidates[worst.candidate].key.tool as usize];
        let is_worse = found.is_none_or(|worst| now.error(tolerance(&now)) > worst.error(tolerance(&worst)));
        if is_worse {
            found = Some(now);
        }
    }
    found
}

impl Worst {
    /// Error relative to what is tolerated, [-].
    fn error(&self, tolerance: f64) -> f64 {
        (self.place / MOST_OF_PLACE).max(self.mean / tolerance)
    }

    /// True if no further update is needed. `before` is the error before the last update; `is_last` is true if no further
    /// update is allowed.
    pub(super) fn is_settled(&self, tolerance: f64, before: Option<&Worst>, is_last: bool) -> bool {
        let helps_little = |before: &Worst| self.error(tolerance) > SLOW * before.error(tolerance);
        let is_slow = is_last || before.is_some_and(helps_little);
        let accepted = if is_slow { tolerance.max(MOST_WHERE_SLOW) } else { tolerance };
        self.error(accepted) <= 1.0
    }
}
