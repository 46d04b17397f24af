//! Separation: bodies that break into parts, and bodies that were connected and come apart.
//!
//! Points are connected if they share a node. Once a gap of about a cell has opened within a body, the grid no longer
//! joins the sides of the gap, and the body is broken although no material law describes fracture.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::warning::{Code, Location, Warning};
use crate::basis::Connectivity;
use crate::equilibrium::GridFields;
use crate::model::Model;
use crate::points::{Points, coordinates};
use crate::ranks::Reduction;

/// Marks a node that no cluster has touched.
const NOBODY: u16 = u16::MAX;

/// The connected parts of the bodies in the first step, or in the first step after a change between stages.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Cohesion {
    /// Number of connected parts of each body.
    parts: Vec<usize>,
    /// For each body, the representative of the bodies that it is connected to, directly or through others.
    together: Vec<usize>,
}

/// Consecutive points of one body in one cell that touch the same nodes.
pub(super) struct Cluster {
    pub(super) body: u16,
    first: usize,
    end: usize,
    /// Those active nodes that the points touch and that other ranks have, too.
    pub(super) shared: Vec<u32>,
}

/// The connected parts of every body, according to the links of a step.
pub(super) struct Parts {
    pub(super) clusters: Vec<Cluster>,
    /// For each cluster, the representative of its part.
    pub(super) root: Vec<u32>,
    /// For each body, the representative of the bodies that it is connected to.
    pub(super) together: Vec<usize>,
}

impl Parts {
    fn new<const D: usize>(model: &Model<D>, points: &Points<D>, links: &Connectivity<D>) -> Parts {
        let mut clusters: Vec<Cluster> = Vec::new();
        let mut root: Vec<u32> = Vec::new();
        let mut together: Vec<u32> = (0..model.bodies.len() as u32).collect();
        // The first body and cluster at each node, and the clusters of further bodies there.
        let mut first_at: Vec<(u16, u32)> = vec![(NOBODY, 0); links.n_active()];
        let mut further: HashMap<(u32, u16), u32> = HashMap::new();
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            let mut last: Option<(u16, &[u32])> = None;
            let in_group = links.points_of(group);
            // If all points belong to one body and touch all nodes, the first point stands for all of them.
            let alike = model.bodies.len() == 1 && links.is_whole(group);
            let examined =
                if alike { in_group.start..(in_group.start + 1).min(in_group.end) } else { in_group.clone() };
            for p in examined {
                let end = if alike { in_group.end } else { p + 1 };
                let (body, local) = (points.body[p], links.local_nodes(p));
                if last == Some((body, local)) {
                    if let Some(cluster) = clusters.last_mut() {
                        cluster.end = p + 1;
                    }
                    continue; // neighbours in a cell mostly touch the same nodes
                }
                last = Some((body, local));
                let number = clusters.len() as u32;
                let shared = local.iter().map(|place| nodes[*place as usize]);
                let shared = shared.filter(|node| links.halo().is_shared(*node as usize)).collect();
                clusters.push(Cluster { body, first: p, end, shared });
                root.push(number);
                for &place in local {
                    let node = nodes[place as usize];
                    let (owner, cluster) = &mut first_at[node as usize];
                    if *owner == NOBODY {
                        (*owner, *cluster) = (body, number);
                    } else if *owner == body {
                        unite(&mut root, *cluster, number);
                    } else {
                        unite(&mut together, u32::from(*owner), u32::from(body));
                        let cluster = *further.entry((node, body)).or_insert(number);
                        unite(&mut root, cluster, number);
                    }
                }
            }
        }
        let together = (0..together.len() as u32).map(|body| find(&mut together, body) as usize).collect();
        let root = (0..root.len() as u32).map(|cluster| find(&mut root, cluster)).collect();
        Parts { clusters, root, together }.joined(links)
    }

    /// The number of parts of each body.
    fn count(&self, bodies: usize, reduction: &Reduction) -> Vec<usize> {
        let mut parts: Vec<(u16, u32)> =
            self.clusters.iter().zip(&self.root).map(|(cluster, root)| (cluster.body, *root)).collect();
        parts.sort_unstable();
        parts.dedup();
        parts = reduction.join(parts);
        parts.sort_unstable();
        parts.dedup();
        let mut count = vec![0; bodies];
        parts.iter().for_each(|(body, _)| count[*body as usize] += 1);
        count
    }

    /// The points of the two largest parts of a body.
    fn largest_two(&self, body: usize) -> [Vec<usize>; 2] {
        let mut parts: HashMap<u32, Vec<usize>> = HashMap::new();
        for (cluster, root) in self.clusters.iter().zip(&self.root) {
            if cluster.body as usize == body {
                parts.entry(*root).or_default().extend(cluster.first..cluster.end);
            }
        }
        let mut parts: Vec<(u32, Vec<usize>)> = parts.into_iter().collect();
        parts.sort_by(|a, b| b.1.len().cmp(&a.1.len()).then(a.0.cmp(&b.0)));
        let mut parts = parts.into_iter().map(|(_, points)| points);
        [parts.next().unwrap_or_default(), parts.next().unwrap_or_default()]
    }
}

impl Cohesion {
    /// True if these can be the parts of this number of bodies.
    pub fn fits(&self, bodies: usize) -> bool {
        self.parts.len() == bodies
            && self.together.len() == bodies
            && self.together.iter().all(|&body| body < bodies)
    }

    /// Remembers the connected parts found in the first step; in later steps, returns a warning for each body, or pair
    /// of bodies, that has come apart since, with the number of the body or of the first one of the pair.
    pub fn watch<const D: usize>(
        known: &mut Option<Cohesion>,
        model: &Model<D>,
        points: &Points<D>,
        grid: &GridFields<D>,
        step: usize,
    ) -> Vec<(usize, Warning)> {
        if let Some(Cohesion { parts, .. }) = known
            && parts.len() == 1
            && grid.parts <= parts[0]
        {
            return Vec::new(); // the parts of a single body are those of the active nodes
        }
        let now = Parts::new(model, points, &grid.links);
        let count = now.count(model.bodies.len(), &points.reduction());
        let Some(start) = known else {
            *known = Some(Cohesion { parts: count, together: now.together });
            return Vec::new();
        };
        let mut found = Vec::new();
        for (body, (&is, &was)) in count.iter().zip(&start.parts).enumerate() {
            if is > was {
                let message = |sides: &str| {
                    let name = &model.bodies[body].name;
                    format!(
                        "body `{name}` has come apart: it now has {is} parts that the grid does not connect ({was} at the start){sides}"
                    )
                };
                let sides = now.largest_two(body);
                found.push((body, warn(model, points, step, sides, &[body], [is, was], message)));
            }
        }
        for (body, (&is, &was)) in now.together.iter().zip(&start.together).enumerate() {
            if is == body && was != body {
                let other = was;
                let message = |sides: &str| {
                    let [a, b] = [body, other].map(|body| &model.bodies[body].name);
                    format!("bodies `{a}` and `{b}` were connected at the start and have come apart{sides}")
                };
                let points_of =
                    |body: usize| (0..points.len()).filter(|&p| points.body[p] as usize == body).collect();
                let sides = [points_of(body), points_of(other)];
                found.push((body, warn(model, points, step, sides, &[body, other], [2, 1], message)));
            }
        }
        found
    }
}

/// The warning about two sides of a gap, which is measured at the end of the step.
fn warn<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    step: usize,
    sides: [Vec<usize>; 2],
    bodies: &[usize],
    [is, was]: [usize; 2],
    message: impl Fn(&str) -> String,
) -> Warning {
    let gap = gap_between(points, &sides);
    let (text, position) = match gap {
        Some((width, middle)) => {
            let cell = model.grid.size(model.grid.nearest_cell(&middle) as usize);
            let cells = width / cell;
            (
                format!("; the gap at {} is {width:.4} wide, or {cells:.1} cells", coordinates(&middle)),
                Some(middle.to_vec()),
            )
        }
        None => (String::new(), None),
    };
    Warning {
        code: Code::Apart,
        step,
        location: Location {
            bodies: bodies.iter().map(|&body| model.bodies[body].name.clone()).collect(),
            position,
            ..Location::default()
        },
        value: Some(is as f64),
        threshold: Some(was as f64),
        message: message(&text),
        detail: None,
    }
}

/// Distance between two sets of points at the end of the step, and the position midway between them, found by
/// alternating between the sides.
fn gap_between<const D: usize>(points: &Points<D>, sides: &[Vec<usize>; 2]) -> Option<(f64, [f64; D])> {
    let x = |p: usize| points.trial.position[p];
    let squared = |a: &[f64; D], b: &[f64; D]| (0..D).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>();
    let nearest = |side: &[usize], to: &[f64; D]| {
        side.iter().copied().min_by(|&a, &b| squared(&x(a), to).total_cmp(&squared(&x(b), to)))
    };
    let mut here = x(*sides[1].first()?);
    let mut there = here;
    for _ in 0..4 {
        there = x(nearest(&sides[0], &here)?);
        here = x(nearest(&sides[1], &there)?);
    }
    let middle = std::array::from_fn(|d| 0.5 * (here[d] + there[d]));
    Some((squared(&here, &there).sqrt(), middle))
}

pub(super) fn find(root: &mut [u32], mut member: u32) -> u32 {
    while root[member as usize] != member {
        root[member as usize] = root[root[member as usize] as usize];
        member = root[member as usize];
    }
    member
}

pub(super) fn unite(root: &mut [u32], a: u32, b: u32) {
    let [a, b] = [a, b].map(|member| find(root, member));
    root[a.max(b) as usize] = a.min(b);
}
