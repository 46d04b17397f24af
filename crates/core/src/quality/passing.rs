//! Material that passes nodes with prescribed motion.
//!
//! Grid nodes return to their positions after every step. Where they pull material along, domains soon reach beyond
//! them into cells without points. Nothing holds the nodes of these cells: the points whose domains reach there lose
//! their stress, and the reaction of the prescribed nodes is too small, however little material has passed.

use super::warning::{Code, Location, Warning};
use crate::basis::Connectivity;
use crate::model::{BoundaryCondition, Model};
use crate::points::{Points, coordinates};
use crate::region::vector::{along, dot, minus, norm};

/// Smallest amount of material that counts at a node of a cell without points, relative to the volume of the cell, [-].
/// A domain that reaches 0.2 % of a cell beyond the prescribed nodes contributes more.
const LEAST: f64 = 1e-6;
/// Cosine of the largest angle between the prescribed motion and the direction to a node that counts as ahead, both
/// scaled by the sides of the cell, [-]. Nodes diagonally ahead do not count: bodies that bulge beside a plate reach
/// them as well.
const AHEAD: f64 = 0.9;

/// The boundary conditions whose nodes pull material past themselves in a step, each with its warning.
pub fn watch<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    delta_d: &[[f64; D]],
    step: usize,
) -> Vec<(usize, Warning)> {
    let mut moving = model.moved_nodes().peekable();
    if moving.peek().is_none() {
        return Vec::new();
    }
    let material = Material::new(model, points, links);
    let mut found = Vec::new();
    for (number, condition, nodes) in moving {
        if let Some(place) = material.ahead_of(model, points, links, condition, nodes, delta_d) {
            found.push((number, warn(&condition.name, place, step)));
        }
    }
    found
}

fn warn<const D: usize>(condition: &str, place: [f64; D], step: usize) -> Warning {
    Warning {
        code: Code::PassedNodes,
        step,
        location: Location {
            boundary_condition: Some(condition.to_owned()),
            position: Some(place.to_vec()),
            ..Location::default()
        },
        value: None,
        threshold: None,
        message: format!(
            "the nodes of `{condition}` pull material past themselves, for example to node {}: nothing holds the \
             material there, and the reaction is too small",
            coordinates(&place)
        ),
        detail: None,
    }
}

/// The material at the active nodes.
struct Material {
    /// For each node, the number of points in the cells around it.
    points_around: Vec<f64>,
    /// For each node without points around it, Σ S_vp V_p, [volume].
    beyond: Vec<f64>,
}

impl Material {
    fn new<const D: usize>(model: &Model<D>, points: &Points<D>, links: &Connectivity<D>) -> Material {
        let mut points_around = vec![0.0; links.n_active()];
        for p in 0..points.len() {
            for &node in model.grid.corners(points.cell[p] as usize).nodes() {
                if let Some(active) = links.seen_by(points.body[p], node as usize) {
                    points_around[active] += 1.0;
                }
            }
        }
        links.reduction().complete_numbers(&mut points_around);
        let mut beyond = vec![0.0; links.n_active()];
        for group in 0..links.n_groups() {
            let nodes = links.nodes_of(group);
            if nodes.iter().all(|&node| points_around[node as usize] > 0.0) {
                continue;
            }
            for p in links.points_of(group) {
                let volume = points.volume(p);
                links.for_each_value(p, |place, value| beyond[nodes[place] as usize] += value * volume);
            }
        }
        links.reduction().complete_numbers(&mut beyond);
        Material { points_around, beyond }
    }

    /// True if a node holds material although no point is around it; a cell there has this volume.
    fn is_beyond(&self, node: usize, volume: f64) -> bool {
        self.points_around[node] == 0.0 && self.beyond[node] > LEAST * volume
    }

    /// Position of a node that lies ahead of a moving node of the condition in the same cell, is free to move in that
    /// direction, and holds material although no point is around it: the first such node on this rank, in the order of
    /// the grid. `None` if there is none.
    fn ahead_of<const D: usize>(
        &self,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        condition: &BoundaryCondition<D>,
        nodes: &[u32],
        delta_d: &[[f64; D]],
    ) -> Option<[f64; D]> {
        let position = |active: usize| model.grid.node_position(links.active_nodes()[active] as usize);
        // The prescribed part of the motion of the condition's nodes; `None` for all other nodes.
        let mut motion = vec![None; links.n_active()];
        for active in nodes.iter().flat_map(|&node| links.copies(node as usize)) {
            let along_all = condition.directions().iter().fold([0.0; D], |motion, direction| {
                along(&motion, dot(&delta_d[active], direction), direction)
            });
            motion[active] = Some(along_all);
        }
        let grid = model.grid.as_ref();
        let share_a_cell = |a: usize, b: usize| {
            let middle = std::array::from_fn(|d| 0.5 * (position(a)[d] + position(b)[d]));
            let corners = grid.corners(grid.nearest_cell(&middle) as usize);
            [a, b].iter().all(|&node| corners.nodes().contains(&links.active_nodes()[node]))
        };
        let is_ahead = |node: usize, behind: usize, sides: &[f64; D]| {
            let Some(motion) = motion[behind].filter(|_| self.points_around[behind] > 0.0) else {
                return false;
            };
            let in_cells = |way: [f64; D]| -> [f64; D] { std::array::from_fn(|d| way[d] / sides[d]) };
            let from_there = minus(&position(node), &position(behind));
            let (way, ahead) = (in_cells(from_there), in_cells(motion));
            dot(&way, &ahead) > AHEAD * norm(&way) * norm(&ahead)
                && share_a_cell(node, behind)
                && !model.holds_node(links.active_nodes()[node], &from_there)
        };
        let first_of_group = |group: usize| {
            let first = links.points_of(group).start;
            let cell = points.cell[first] as usize;
            let volume = grid.volume(cell) * model.depth(&points.converged.position[first]);
            let sides = grid.spacing(cell);
            let nodes = || links.nodes_of(group).iter().map(|&node| node as usize);
            let beyond = nodes().filter(|&node| motion[node].is_none() && self.is_beyond(node, volume));
            beyond.filter(|&node| nodes().any(|behind| is_ahead(node, behind, &sides))).min()
        };
        let first = (0..links.n_groups()).filter_map(first_of_group).min()?;
        Some(position(first))
    }
}
