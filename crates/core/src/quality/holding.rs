//! The material at nodes with prescribed motion.
//!
//! Grid nodes return to their positions after every step. The material that they push moves on, and after some steps
//! the nodes hold little of it, or none.

use serde::{Deserialize, Serialize};

use super::warning::{Code, Location, Warning};
use crate::basis::Connectivity;
use crate::model::Model;
use crate::points::{Points, coordinates};

/// Material at the nodes, relative to the largest amount that they have ever held, below which a warning is raised,
/// [-]: reactions are then about 5 % too small.
const MIN_HELD: f64 = 0.7;

/// The material at the nodes of one boundary condition.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Held {
    /// Largest sum Σ S_vp V_p over the nodes and all points in any step so far, [volume].
    most: f64,
    /// Current value of the sum Σ S_vp V_p over the nodes and all points, [volume].
    now: f64,
    /// Length of the prescribed motion, averaged over the material at the nodes, [length].
    prescribed: f64,
    /// Motion of the material at the nodes along the prescribed motion, [length].
    followed: f64,
}

impl Held {
    /// Material at the nodes, relative to the largest amount that they have ever held, [-]; `None` if they have never
    /// held any.
    pub fn share(&self) -> Option<f64> {
        (self.most > 0.0).then(|| self.now / self.most)
    }
}

/// Records a step for all boundary conditions that move given nodes; returns the conditions whose nodes have lost too
/// much of their material, each with its warning.
pub fn watch<const D: usize>(
    held: &mut Vec<Held>,
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    delta_d: &[[f64; D]],
    step: usize,
) -> Vec<(usize, Warning)> {
    held.resize(model.boundary_conditions.len(), Held::default());
    let mut found = Vec::new();
    for (number, condition, nodes) in model.moved_nodes() {
        let at_nodes = AtNodes::new(points, links, nodes, &condition.directions(), delta_d);
        let held = &mut held[number];
        held.now = at_nodes.volume;
        held.most = held.most.max(held.now);
        if at_nodes.volume > 0.0 {
            held.prescribed += at_nodes.prescribed / at_nodes.volume;
            held.followed += at_nodes.followed / at_nodes.volume;
        }
        if let Some(share) = held.share()
            && share < MIN_HELD
        {
            let place = at_nodes.emptiest(model, links, nodes);
            found.push((number, warn(&condition.name, held, share, step, place)));
        }
    }
    found
}

fn warn<const D: usize>(
    condition: &str,
    held: &Held,
    share: f64,
    step: usize,
    place: Option<[f64; D]>,
) -> Warning {
    let Held { prescribed, followed, .. } = held;
    let whole = 100.0 * share;
    let place_text = place.map(|place| format!(" (least at {})", coordinates(&place))).unwrap_or_default();
    Warning {
        code: Code::LeftNodes,
        step,
        location: Location {
            boundary_condition: Some(condition.to_owned()),
            position: place.map(|place| place.to_vec()),
            ..Location::default()
        },
        value: Some(share),
        threshold: Some(MIN_HELD),
        message: format!(
            "the nodes of `{condition}` now hold {whole:.0} % of the largest amount of material that they ever \
             held{place_text}; the material has followed {followed:.4} of the prescribed motion of {prescribed:.4}, \
             and the reaction is too small"
        ),
        detail: None,
    }
}

/// The material at the nodes of a boundary condition in a step.
struct AtNodes {
    /// Volume at each active node, [volume].
    volume_of: Vec<f64>,
    /// Volume at all nodes of the condition, [volume].
    volume: f64,
    /// Mean prescribed motion times the volume, [length·volume].
    prescribed: f64,
    /// Mean motion of the material along the prescribed motion times the volume, [length·volume].
    followed: f64,
}

impl AtNodes {
    fn new<const D: usize>(
        points: &Points<D>,
        links: &Connectivity<D>,
        nodes: &[u32],
        directions: &[[f64; D]],
        delta_d: &[[f64; D]],
    ) -> AtNodes {
        let mut is_among = vec![false; links.n_active()];
        for active in nodes.iter().flat_map(|&node| links.copies(node as usize)) {
            is_among[active] = true;
        }
        let mut found =
            AtNodes { volume_of: vec![0.0; links.n_active()], volume: 0.0, prescribed: 0.0, followed: 0.0 };
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            if !nodes.iter().any(|&node| is_among[node as usize]) {
                continue;
            }
            for p in links.points_of(group) {
                let volume = points.volume(p);
                let (from, to) = (&points.converged.position[p], &points.trial.position[p]);
                links.for_each_value(p, |place, value| {
                    let node = nodes[place] as usize;
                    if !is_among[node] {
                        return;
                    }
                    let weight = value * volume;
                    let (mut length, mut along) = (0.0, 0.0);
                    for direction in directions {
                        let part = |vector: [f64; D]| (0..D).map(|d| vector[d] * direction[d]).sum::<f64>();
                        let prescribed = part(delta_d[node]);
                        length += prescribed.powi(2);
                        along += prescribed * part(std::array::from_fn(|d| to[d] - from[d]));
                    }
                    let length = length.sqrt();
                    found.volume_of[node] += weight;
                    found.volume += weight;
                    if length > 0.0 {
                        found.prescribed += weight * length;
                        found.followed += weight * along / length;
                    }
                });
            }
        }
        links.reduction().complete_numbers(&mut found.volume_of);
        let mut sums = [found.volume, found.prescribed, found.followed];
        links.reduction().sum(&mut sums);
        [found.volume, found.prescribed, found.followed] = sums;
        found
    }

    /// Position of the node that holds the least material; of the first one if several do.
    fn emptiest<const D: usize>(
        &self,
        model: &Model<D>,
        links: &Connectivity<D>,
        nodes: &[u32],
    ) -> Option<[f64; D]> {
        let volume =
            |node: u32| links.copies(node as usize).fold(0.0, |sum, active| sum + self.volume_of[active]);
        let reduction = links.reduction();
        let mut volumes: Vec<f64> = nodes.iter().map(|node| volume(*node)).collect();
        reduction.maximum(&mut volumes);
        let least = (0..nodes.len()).min_by(|&a, &b| volumes[a].total_cmp(&volumes[b]))?;
        Some(model.grid.node_position(nodes[least] as usize))
    }
}
