//! Bodies that act on each other across a gap.
//!
//! The grid joins bodies that share nodes; bodies can share nodes across gaps of up to one or two cells.

use std::collections::{BTreeMap, HashMap};

use super::warning::{Code, Location, Warning};
use crate::basis::{Connectivity, DomainKind, MIN_SHARE, TouchedBy};
use crate::model::Model;
use crate::points::{Points, coordinates};

/// Largest gap at which bodies count as touching, relative to the spacing of their points, [-].
const TOUCHING: f64 = 0.5;

/// The box around the points of a body at a node, and the largest extent of these points.
#[derive(Clone, Copy)]
struct Reach<const D: usize> {
    low: [f64; D],
    high: [f64; D],
    spacing: f64,
}

impl<const D: usize> Reach<D> {
    /// Distance between two boxes, the largest over the axes; negative if they overlap, [length].
    fn distance(&self, other: &Reach<D>) -> f64 {
        let apart = |d: usize| (other.low[d] - self.high[d]).max(self.low[d] - other.high[d]);
        (0..D).map(apart).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Extends this reach to include another.
    fn extend(&mut self, other: &Reach<D>) {
        for d in 0..D {
            self.low[d] = self.low[d].min(other.low[d]);
            self.high[d] = self.high[d].max(other.high[d]);
        }
        self.spacing = self.spacing.max(other.spacing);
    }

    fn touches(&self, other: &Reach<D>) -> bool {
        self.distance(other) <= TOUCHING * self.spacing.max(other.spacing)
    }
}

/// For each body at a node, an index that is the same for all bodies that touch each other there, directly or through
/// others.
fn joined<const D: usize>(at_node: &[((u32, u16), Reach<D>)]) -> Vec<usize> {
    let mut group: Vec<usize> = (0..at_node.len()).collect();
    for a in 0..at_node.len() {
        for b in 0..a {
            let (from, to) = (group[a], group[b]);
            if from != to && at_node[a].1.touches(&at_node[b].1) {
                group.iter_mut().filter(|member| **member == from).for_each(|member| *member = to);
            }
        }
    }
    group
}

/// The smallest gap between two bodies, its node, and the spacing of the points there.
#[derive(Clone, Copy)]
struct Narrowest {
    width: f64,
    node: u32,
    spacing: f64,
}

/// A gap across which two bodies share a grid node and therefore act on each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Gap<const D: usize> {
    /// Indices of the bodies.
    pub bodies: [u16; 2],
    /// Width of the gap where it is narrowest, [length].
    pub width: f64,
    /// Width up to which bodies count as touching, [length].
    pub touching: f64,
    /// Position of the node, [length].
    pub position: [f64; D],
}

/// The gaps between bodies that share nodes but touch at none of them, either directly or through other bodies. All
/// ranks must call this together.
pub fn gaps<const D: usize>(model: &Model<D>, points: &Points<D>, links: &Connectivity<D>) -> Vec<Gap<D>> {
    if model.bodies.len() < 2 {
        return Vec::new();
    }
    let is_shared = shared_nodes(points, links);
    let mut gaps: BTreeMap<[u16; 2], Narrowest> = BTreeMap::new();
    let reaches = reaches_everywhere(links, reaches(model, points, links, &is_shared));
    for at_node in reaches.chunk_by(|((a, _), _), ((b, _), _)| a == b) {
        let joined = joined(at_node);
        for (place, &((node, a), reach_a)) in at_node.iter().enumerate() {
            for (other, &((_, b), reach_b)) in at_node.iter().enumerate().skip(place + 1) {
                // Bodies in between may fill the gap.
                let is_filled = joined[place] == joined[other];
                let width = if is_filled { f64::NEG_INFINITY } else { reach_a.distance(&reach_b) };
                let gap = Narrowest { width, node, spacing: reach_a.spacing.max(reach_b.spacing) };
                let kept = gaps.entry([a, b]).or_insert(gap);
                if width < kept.width {
                    *kept = gap;
                }
            }
        }
    }
    let gap = |(bodies, Narrowest { width, node, spacing })| Gap {
        bodies,
        width,
        touching: TOUCHING * spacing,
        position: model.grid.node_position(node as usize),
    };
    gaps.into_iter().map(gap).filter(|gap| gap.width > gap.touching).collect()
}

/// The gaps of a step, each with the number of its pair of bodies, as warnings.
pub fn watch<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    step: usize,
) -> Vec<(usize, Warning)> {
    let numbered = |gap: Gap<D>| {
        let [a, b] = gap.bodies.map(usize::from);
        (a * model.bodies.len() + b, warn(model, &gap, step))
    };
    gaps(model, points, links).into_iter().map(numbered).collect()
}

/// The reaches at all nodes of the run, by grid node.
fn reaches_everywhere<const D: usize>(
    links: &Connectivity<D>,
    mut own: Vec<((u32, u16), Reach<D>)>,
) -> Vec<((u32, u16), Reach<D>)> {
    own.iter_mut().for_each(|((node, _), _)| *node = links.active_nodes()[*node as usize]);
    let packed = |((node, body), reach): ((u32, u16), Reach<D>)| {
        let Reach { low, high, spacing } = reach;
        (node, body, [low.to_vec(), high.to_vec(), vec![spacing]].concat())
    };
    let mut merged: BTreeMap<(u32, u16), Reach<D>> = BTreeMap::new();
    for (node, body, numbers) in links.reduction().join(own.into_iter().map(packed).collect()) {
        let at = |k: usize| numbers.get(k).copied().unwrap_or(0.0);
        let (low, high) = (std::array::from_fn(at), std::array::from_fn(|d| at(D + d)));
        let found = Reach { low, high, spacing: at(2 * D) };
        merged.entry((node, body)).and_modify(|reach| reach.extend(&found)).or_insert(found);
    }
    merged.into_iter().collect()
}

fn warn<const D: usize>(model: &Model<D>, gap: &Gap<D>, step: usize) -> Warning {
    let Gap { bodies, width, touching, position } = gap;
    let names = bodies.map(|body| model.bodies[body as usize].name.clone());
    let [a, b] = &names;
    Warning {
        code: Code::AcrossGap,
        step,
        message: format!(
            "bodies `{a}` and `{b}` act on each other through node {}, although a gap of {width:.4} separates them \
             (bodies up to {touching:.4} apart count as touching)",
            coordinates(position)
        ),
        location: Location {
            bodies: names.to_vec(),
            position: Some(position.to_vec()),
            ..Location::default()
        },
        value: Some(*width),
        threshold: Some(*touching),
        detail: None,
    }
}

/// True for each active node that several bodies touch.
pub(super) fn shared_nodes<const D: usize>(points: &Points<D>, links: &Connectivity<D>) -> Vec<bool> {
    links.bodies_at_nodes(points).into_iter().map(|bodies| bodies == TouchedBy::Several).collect()
}

/// The reach of every body at the shared nodes, in the order of nodes and bodies.
fn reaches<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    is_shared: &[bool],
) -> Vec<((u32, u16), Reach<D>)> {
    let mut reaches: HashMap<(u32, u16), Reach<D>> = HashMap::new();
    for group in 0..links.n_groups() {
        let nodes = links.nodes_of(group);
        if !nodes.iter().any(|&node| is_shared[node as usize]) {
            continue;
        }
        for p in links.points_of(group) {
            let reach = reach_of(model, points, p);
            links.for_each_value(p, |place, value| {
                let node = nodes[place];
                if is_shared[node as usize] && value > MIN_SHARE {
                    reaches.entry((node, points.body[p])).or_insert(reach).extend(&reach);
                }
            });
        }
    }
    let mut reaches: Vec<_> = reaches.into_iter().collect();
    reaches.sort_unstable_by_key(|(key, _)| *key);
    reaches
}

/// The box around the domain of a point and around the square (cube) of its original volume, deformed with the point.
fn reach_of<const D: usize>(model: &Model<D>, points: &Points<D>, p: usize) -> Reach<D> {
    let x = points.converged.position[p];
    let size = points.original_volume[p] / model.depth(&points.original_position[p]);
    let half = 0.5 * size.powf(1.0 / D as f64);
    let gradient = &points.converged.deformation_gradient[p];
    let half: [f64; D] = std::array::from_fn(|d| half * (0..D).map(|k| gradient[(d, k)].abs()).sum::<f64>());
    let (mut low, mut high): ([f64; D], [f64; D]) =
        (std::array::from_fn(|d| x[d] - half[d]), std::array::from_fn(|d| x[d] + half[d]));
    match model.bodies[points.body[p] as usize].method.domain() {
        DomainKind::None => {}
        DomainKind::Box => {
            let l = points.half_lengths(p);
            for d in 0..D {
                low[d] = low[d].min(x[d] - l[d]);
                high[d] = high[d].max(x[d] + l[d]);
            }
        }
        DomainKind::Corners => {
            for corner in points.corners(p) {
                for d in 0..D {
                    low[d] = low[d].min(corner[d]);
                    high[d] = high[d].max(corner[d]);
                }
            }
        }
    }
    let spacing = 2.0 * half.into_iter().fold(0.0, f64::max);
    Reach { low, high, spacing }
}
