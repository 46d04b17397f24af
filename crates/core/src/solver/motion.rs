//! The motion of the grid in the last step, which the next step may use as the direction of a path or as a prediction.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::basis::Connectivity;

use crate::step::Step;

/// The displacement increment of a step on the nodes of the grid.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Motion {
    /// Grid nodes that were active, ascending.
    nodes: Vec<u32>,
    /// Their displacement increments, one number per node and component, [length].
    increment: Vec<f64>,
    /// Duration of the step, [time].
    duration: f64,
}

impl Motion {
    /// The motion of a step.
    pub(super) fn new<const D: usize, const N: usize>(
        links: &Connectivity<D>,
        step: Step,
        delta_d: &[[f64; N]],
    ) -> Self {
        Motion {
            nodes: links.active_nodes().to_vec(),
            increment: delta_d.as_flattened().to_vec(),
            duration: step.end - step.start,
        }
    }

    /// The motion over all ranks, assembled from the motions of the active nodes of each rank; a shared node has the
    /// same motion on all ranks.
    pub(super) fn joined(pieces: &[Motion]) -> Motion {
        let mut nodes: BTreeMap<u32, &[f64]> = BTreeMap::new();
        for motion in pieces.iter().filter(|motion| !motion.nodes.is_empty()) {
            let per_node = motion.increment.len() / motion.nodes.len();
            nodes.extend(motion.nodes.iter().copied().zip(motion.increment.chunks_exact(per_node.max(1))));
        }
        Motion {
            increment: nodes.values().copied().flatten().copied().collect(),
            nodes: nodes.into_keys().collect(),
            duration: pieces.iter().map(|motion| motion.duration).fold(0.0, f64::max),
        }
    }

    /// True if a run in `D` dimensions can have this motion.
    pub(super) fn fits<const D: usize>(&self) -> bool {
        self.increment.len() >= D * self.nodes.len()
            && self.increment.len().is_multiple_of(self.nodes.len().max(1))
            && self.nodes.is_sorted()
    }

    /// The increment at each node of another step; `None` if the node was not active.
    fn known<const D: usize, const N: usize>(&self, links: &Connectivity<D>) -> Vec<Option<[f64; N]>> {
        let (increments, _) = self.increment.as_chunks::<N>();
        let at = |node: &u32| {
            let place = self.nodes.binary_search(node).ok();
            place.and_then(|place| increments.get(place)).copied()
        };
        let mut known: Vec<Option<[f64; N]>> = links.active_nodes().iter().map(at).collect();
        links.reduction().fill(&mut known);
        known
    }

    /// The increment on the nodes of another step; zero where they were not active.
    pub(super) fn direction<const D: usize, const N: usize>(&self, links: &Connectivity<D>) -> Vec<[f64; N]> {
        self.known(links).into_iter().map(|known| known.unwrap_or([0.0; N])).collect()
    }

    /// The increment on the nodes of the next step, as if the motion continued; nodes that were not active move as the
    /// nodes around them do on average. `None` before the first step.
    pub(super) fn extrapolate<const D: usize, const N: usize>(
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
            increment: nodes.iter().flat_map(|node| [f64::from(*node), 0.5]).collect(),
            duration: 0.25,
        };
        let joined = Motion::joined(&[motion(&[1, 4, 7]), Motion::default(), motion(&[0, 4, 9])]);
        assert_eq!(joined, motion(&[0, 1, 4, 7, 9]));
        assert_eq!(Motion::joined(&[Motion::default(), Motion::default()]), Motion::default());
    }
}
