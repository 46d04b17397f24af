//! An unknown load factor and the condition that determines it: a prescribed displacement or the arc length of the path
//! (Riks 1979, doi 10.1016/0020-7683(79)90081-7; Crisfield 1981, doi 10.1016/0045-7949(81)90108-5).
//!
//! All loads grow in proportion, f_ext = λ f̂. An iteration solves K δd_r = r and K δd_f = f̂ with one factorisation
//! and takes δd = δd_r + δλ δd_f, where δλ is such that δd meets the condition.
//!
//! The motion of the grid in the last step may serve the next step as the direction of the path or as a prediction.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::basis::{BodyGroup, Connectivity};
use crate::model::{Control, Controlled, Model};
use crate::points::Points;
use crate::ranks::Reduction;
use crate::step::Step;
use crate::terms::{GlobalMotion, Terms, motions};

/// Data on the path so far that the next step needs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Path {
    /// Load factor at the end of the last converged step, if the factor is an unknown, [-].
    pub factor: f64,
    /// Arc length of the path per unit of time, [length·volume^½/time]; `None` before the first step of the stage, and
    /// if the arc length does not determine the load factor.
    pub rate: Option<f64>,
    /// Motion in the last step, if the next step uses it.
    pub(crate) motion: Motion,
}

impl Path {
    /// The path over all ranks, joined from the paths of the ranks.
    pub fn joined(pieces: &[Path]) -> Path {
        let motions: Vec<Motion> = pieces.iter().map(|path| path.motion.clone()).collect();
        Path { motion: Motion::joined(&motions), ..pieces.first().cloned().unwrap_or_default() }
    }

    /// True if a run in `D` dimensions can have this path.
    pub(crate) fn fits<const D: usize>(&self) -> bool {
        self.motion.fits::<D>()
    }
}

/// A motion of the nodes, together with the change of the global unknowns.
#[derive(Clone, Copy)]
pub(crate) struct Field<'a, const N: usize> {
    pub(crate) nodes: &'a [[f64; N]],
    pub(crate) globals: &'a [f64],
}

/// The motions from which an iteration determines the change of the load factor.
#[derive(Clone, Copy)]
pub(crate) struct Responses<'a, const N: usize> {
    /// Δd, the motion in the step so far.
    pub(crate) so_far: Field<'a, N>,
    /// δd_r, the response to the out-of-balance force.
    pub(crate) to_residual: Field<'a, N>,
    /// δd_f, the response to a unit of the load factor.
    pub(crate) to_load: Field<'a, N>,
}

/// The condition that determines the load factor of a step.
pub(crate) enum Condition<const D: usize, const N: usize> {
    /// Σ w·Δd over the nodes, with the `weight` w of each node, equals the increment `by`.
    Displacement { weight: Vec<[f64; N]>, by: f64, reduction: Reduction },
    /// The increment of the global unknown `number` equals `by`; `number` is `None` if there is no such unknown.
    Global { number: Option<usize>, by: f64 },
    /// In the inner product weighted by the volume that each node carries, (Δd − c, Δd − c) equals the square of
    /// `length`. The centre c is the motion due to the forces left out of balance on a fresh grid, without the part
    /// that the loads would cause; if c were not subtracted, it would exceed the motion along the path when steps are
    /// small.
    ArcLength {
        volume: Vec<f64>,
        reduction: Reduction,
        length: Option<f64>,
        ahead: Vec<[f64; N]>,
        share: f64,
        centre: Option<Vec<[f64; N]>>,
        /// True if the last change of the load factor met the condition, false if it only came as close as it could.
        met: bool,
    },
}

/// A load has no influence on a probe if it moves the probe by less than this, relative to the largest possible
/// displacement, [-].
const NO_INFLUENCE: f64 = 1e-10;

/// The reason why no load factor meets the condition that determines it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoPath {
    /// The loads have no influence on the prescribed displacement.
    #[error("the loads do not move the probe or tool along its axis")]
    NoInfluence,
    /// No load factor gives the displacement or path length that the step prescribes.
    #[error("no load factor gives the displacement or path length that the step prescribes")]
    NoIntersection,
    /// The iterations found an equilibrium by turning back along the path.
    #[error("the step turned back along the path of the previous step")]
    Reversed,
}

/// Factor that converts the length of a path, [length], to a length weighted by volume, [length·volume^½]: the square
/// root of the original volume of all points.
fn weight_of_length<const D: usize>(points: &Points<D>) -> f64 {
    points.reduction().total(points.original_volume.iter().sum::<f64>()).sqrt()
}

/// Arc length of the path, [length], if the arc length determines the load factor: the sum over the steps of
/// √(Σ V |Δu|² / V₀). Σ is over the nodes, V is the volume that a node carries, V₀ the original volume of all points,
/// and Δu the displacement of the node in the step, less that due to the out-of-balance forces of a fresh grid. `time`
/// counts from the start of the stage. `None` before the first step has set the rate.
pub fn path_length<const D: usize>(points: &Points<D>, path: &Path, time: f64) -> Option<f64> {
    path.rate.map(|rate| rate * time / weight_of_length(points))
}

/// Σ V (a·b) over the nodes.
fn weighted<const D: usize, const N: usize>(
    reduction: &Reduction,
    volume: &[f64],
    a: &[[f64; N]],
    b: &[[f64; N]],
) -> f64 {
    reduction.sum_over_nodes(a.len(), |n| volume[n] * (0..D).map(|d| a[n][d] * b[n][d]).sum::<f64>())
}

fn difference<const N: usize>(a: &[[f64; N]], b: &[[f64; N]]) -> Vec<[f64; N]> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|d| a[d] - b[d])).collect()
}

impl<const D: usize, const N: usize> Condition<D, N> {
    /// The condition of a step; `None` if the loads are prescribed.
    pub(crate) fn new(
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        step: Step,
        path: &Path,
        terms: &Terms<D, N>,
    ) -> Option<Self> {
        let share = (step.end - step.start) / model.stepping.duration();
        match model.stepping.control {
            Control::Load | Control::StrengthReduction { .. } => None,
            Control::Displacement { controlled: Controlled::Tool(tool), axis, to } => {
                let name = model.tools.get(tool).map(|tool| &tool.name);
                let is_it = |motion: &GlobalMotion| Some(&motion.name) == name && motion.component == axis;
                let number = motions(terms, model).into_iter().find(is_it).map(|motion| motion.number);
                Some(Condition::Global { number, by: to * share })
            }
            Control::Displacement { controlled: Controlled::Probe(probe), axis, to } => {
                let axis = axis.min(D - 1); // decks with any other axis are refused
                let mut weight = vec![[0.0; N]; links.n_active()];
                let chosen = model.probes.get(probe).map_or(&[][..], |probe| &probe.points);
                let mut is_chosen = vec![false; points.len()];
                points.places_of(chosen).into_iter().flatten().for_each(|p| is_chosen[p] = true);
                for group in 0..links.n_groups() {
                    let nodes = links.nodes_of(group);
                    for p in links.points_of(group).filter(|&p| is_chosen[p]) {
                        links.for_each_value(p, |local, value| {
                            weight[nodes[local] as usize][axis] += value / chosen.len() as f64;
                        });
                    }
                }
                links.reduction().complete(&mut weight);
                Some(Condition::Displacement { weight, by: to * share, reduction: links.reduction().clone() })
            }
            Control::ArcLength { length: total } => {
                let mut volume = vec![0.0; links.n_active()];
                for group in 0..links.n_groups() {
                    let nodes = links.nodes_of(group);
                    for p in links.points_of(group) {
                        let volume_n = model.volume(points, p);
                        links.for_each_value(p, |local, value| {
                            volume[nodes[local] as usize] += value * volume_n;
                        });
                    }
                }
                links.reduction().complete_numbers(&mut volume);
                let given = total.map(|total| total * weight_of_length(points) / model.stepping.duration());
                let length = given.or(path.rate).map(|rate| rate * (step.end - step.start));
                Some(Condition::ArcLength {
                    volume,
                    reduction: links.reduction().clone(),
                    length,
                    ahead: path.motion.direction(links),
                    share,
                    centre: None,
                    met: true,
                })
            }
        }
    }

    /// The change δλ of the load factor for which Δd + δd_r + δλ δd_f meets the condition.
    ///
    /// # Errors
    /// [`NoPath`].
    pub(crate) fn change(&mut self, responses: Responses<N>) -> Result<f64, NoPath> {
        let Responses { so_far, to_residual: by_residual, to_load: by_load } = responses;
        let finite = |x: f64| if x.is_finite() { Ok(x) } else { Err(NoPath::NoIntersection) };
        if let Condition::Global { number, by } = self {
            let along = |field: &Field<N>| number.and_then(|n| field.globals.get(n)).copied().unwrap_or(0.0);
            let influence = along(&by_load);
            if influence == 0.0 {
                return Err(NoPath::NoInfluence);
            }
            return finite((*by - along(&so_far) - along(&by_residual)) / influence);
        }
        let (delta_d, by_residual, by_load) = (so_far.nodes, by_residual.nodes, by_load.nodes);
        match self {
            Condition::Global { .. } => Err(NoPath::NoInfluence),
            Condition::Displacement { weight, by, reduction } => {
                let along = |field: &[[f64; N]]| -> f64 {
                    if reduction.is_alone() {
                        return weight.iter().zip(field).flat_map(|(w, u)| (0..D).map(|d| w[d] * u[d])).sum();
                    }
                    reduction
                        .sum_over_nodes(field.len(), |n| (0..D).map(|d| weight[n][d] * field[n][d]).sum())
                };
                let influence = along(by_load);
                let far = |field: &[[f64; N]]| reduction.norm(field);
                if influence.abs() <= NO_INFLUENCE * far(weight) * far(by_load) {
                    return Err(NoPath::NoInfluence);
                }
                finite((*by - along(delta_d) - along(by_residual)) / influence)
            }
            Condition::ArcLength { volume, reduction, length, ahead, share, centre, met } => {
                let product = |a: &[[f64; N]], b: &[[f64; N]]| weighted::<D, N>(reduction, volume, a, b);
                let a = product(by_load, by_load);
                if a == 0.0 {
                    return Err(NoPath::NoInfluence);
                }
                let is_first = centre.is_none();
                let centre = centre.get_or_insert_with(|| {
                    let along = product(by_residual, by_load) / a;
                    let aside = |(r, f): (&[f64; N], &[f64; N])| std::array::from_fn(|d| r[d] - along * f[d]);
                    by_residual.iter().zip(by_load).map(aside).collect()
                });
                let so_far = difference(delta_d, centre);
                let base: Vec<[f64; N]> = so_far
                    .iter()
                    .zip(by_residual)
                    .map(|(u, r)| std::array::from_fn(|d| u[d] + r[d]))
                    .collect();
                let (b, c) = (product(&base, by_load), product(&base, &base));
                let Some(length) = *length else {
                    // The first step of the stage takes its share of the load; the linear response sets the length.
                    let change = *share;
                    *length = Some((c + 2.0 * change * b + change * change * a).sqrt());
                    return finite(change);
                };
                // The root of a δλ² + 2 b δλ + c = length² that continues along the path; without real roots, the δλ
                // that comes closest, from which the next iteration continues.
                let root = (b * b - a * (c - length * length)).sqrt();
                *met = !root.is_nan();
                if !*met {
                    return finite(-b / a);
                }
                let far = -(b + root.copysign(b));
                let roots = [far / a, (c - length * length) / far];
                if is_first {
                    let change = length / a.sqrt();
                    return finite(change.copysign(product(ahead, by_load)) - b / a);
                }
                let onwards = |change: f64| product(&so_far, &base) + change * product(&so_far, by_load);
                let [first, second] = roots.map(onwards);
                finite(if first >= second { roots[0] } else { roots[1] })
            }
        }
    }

    /// True if the condition is met; otherwise another iteration is needed, whatever the residual.
    pub(crate) fn is_met(&self) -> bool {
        !matches!(self, Condition::ArcLength { met: false, .. })
    }

    /// True if a step with this displacement increment continues along the path instead of turning back towards the
    /// previous step.
    pub(crate) fn goes_on(&self, delta_d: &[[f64; N]]) -> bool {
        match self {
            Condition::ArcLength { volume, reduction, ahead, centre: Some(centre), .. } => {
                let step = difference(delta_d, centre);
                let along = weighted::<D, N>(reduction, volume, ahead, &step);
                along >= 0.0
            }
            _ => true,
        }
    }

    /// The path after a step that has reached this load factor.
    pub(crate) fn advance(
        &self,
        links: &Connectivity<D>,
        step: Step,
        delta_d: &[[f64; N]],
        factor: f64,
    ) -> Path {
        match self {
            Condition::Displacement { .. } | Condition::Global { .. } => Path { factor, ..Path::default() },
            Condition::ArcLength { length, centre, .. } => Path {
                factor,
                rate: length.map(|length| length / (step.end - step.start)),
                motion: match centre {
                    Some(centre) => Motion::new(links, step, &difference(delta_d, centre)),
                    None => Motion::new(links, step, delta_d),
                },
            },
        }
    }
}

/// The displacement increment of a step on the nodes of the grid.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Grid nodes that were active, ascending; a node has one entry for each group of bodies that touched it.
    nodes: Vec<u32>,
    /// The group of bodies of each entry; empty if all bodies are in one group.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    groups: Vec<BodyGroup>,
    /// Their displacement increments, one number per node and component, [length].
    increment: Vec<f64>,
    /// Duration of the step, [time].
    duration: f64,
}

impl Motion {
    /// The motion of a step.
    pub(crate) fn new<const D: usize, const N: usize>(
        links: &Connectivity<D>,
        step: Step,
        delta_d: &[[f64; N]],
    ) -> Self {
        Motion {
            nodes: links.active_nodes().to_vec(),
            groups: links.groups_of_active_nodes().to_vec(),
            increment: delta_d.as_flattened().to_vec(),
            duration: step.end - step.start,
        }
    }

    /// The motion over all ranks, assembled from the motions of the active nodes of each rank; a shared node has the
    /// same motion on all ranks.
    pub(crate) fn joined(pieces: &[Motion]) -> Motion {
        // On several ranks, all bodies are in one group.
        if let [motion] = pieces {
            return motion.clone();
        }
        let mut nodes: BTreeMap<u32, &[f64]> = BTreeMap::new();
        for motion in pieces.iter().filter(|motion| !motion.nodes.is_empty()) {
            let per_node = motion.increment.len() / motion.nodes.len();
            nodes.extend(motion.nodes.iter().copied().zip(motion.increment.chunks_exact(per_node.max(1))));
        }
        Motion {
            increment: nodes.values().copied().flatten().copied().collect(),
            nodes: nodes.into_keys().collect(),
            groups: Vec::new(),
            duration: pieces.iter().map(|motion| motion.duration).fold(0.0, f64::max),
        }
    }

    /// True if a run in `D` dimensions can have this motion.
    pub(crate) fn fits<const D: usize>(&self) -> bool {
        self.increment.len() >= D * self.nodes.len()
            && self.increment.len().is_multiple_of(self.nodes.len().max(1))
            && self.nodes.is_sorted()
            && (self.groups.is_empty() || self.groups.len() == self.nodes.len())
    }

    /// The increment at each node of another step; `None` if the node was not active.
    fn known<const D: usize, const N: usize>(&self, links: &Connectivity<D>) -> Vec<Option<[f64; N]>> {
        let (increments, _) = self.increment.as_chunks::<N>();
        let groups = links.groups_of_active_nodes();
        let is_same = |place: usize, group: Option<&BodyGroup>| {
            self.groups.is_empty() || self.groups.get(place) == group
        };
        let at = |(number, node): (usize, &u32)| {
            let first = self.nodes.partition_point(|other| other < node);
            let copies = self.nodes[first..].iter().take_while(|other| *other == node).count();
            let place = (first..first + copies).find(|place| is_same(*place, groups.get(number)));
            place.and_then(|place| increments.get(place)).copied()
        };
        let mut known: Vec<Option<[f64; N]>> = links.active_nodes().iter().enumerate().map(at).collect();
        links.reduction().fill(&mut known);
        known
    }

    /// The increment on the nodes of another step; zero where they were not active.
    pub(crate) fn direction<const D: usize, const N: usize>(&self, links: &Connectivity<D>) -> Vec<[f64; N]> {
        self.known(links).into_iter().map(|known| known.unwrap_or([0.0; N])).collect()
    }

    /// The increment on the nodes of the next step, as if the motion continued; nodes that were not active move as the
    /// nodes around them do on average. `None` before the first step.
    pub(crate) fn extrapolate<const D: usize, const N: usize>(
        &self,
        links: &Connectivity<D>,
        step: Step,
    ) -> Option<Vec<[f64; N]>> {
        let factor = (step.end - step.start) / self.duration;
        if self.nodes.is_empty() || !factor.is_finite() {
            return None;
        }
        let known = self.known(links);
        let mut sum = vec![[0.0; N]; known.len()];
        let mut count = vec![0.0; known.len()];
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            let around = || nodes.iter().filter_map(|&node| known[node as usize]);
            for &node in nodes.iter().filter(|&&node| known[node as usize].is_none()) {
                for increment in around() {
                    count[node as usize] += 1.0;
                    for d in 0..N {
                        sum[node as usize][d] += increment[d];
                    }
                }
            }
        }
        links.reduction().complete(&mut sum);
        links.reduction().complete_numbers(&mut count);
        let nodal = |n: usize| match known[n] {
            Some(increment) => increment,
            None if count[n] > 0.0 => sum[n].map(|sum| sum / count[n]),
            None => [0.0; N],
        };
        Some((0..known.len()).map(|n| nodal(n).map(|u| factor * u)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_join_their_motions_at_shared_nodes() {
        let motion = |nodes: &[u32]| Motion {
            nodes: nodes.to_vec(),
            groups: Vec::new(),
            increment: nodes.iter().flat_map(|node| [f64::from(*node), 0.5]).collect(),
            duration: 0.25,
        };
        let joined = Motion::joined(&[motion(&[1, 4, 7]), Motion::default(), motion(&[0, 4, 9])]);
        assert_eq!(joined, motion(&[0, 1, 4, 7, 9]));
        assert_eq!(Motion::joined(&[Motion::default(), Motion::default()]), Motion::default());
    }
}
