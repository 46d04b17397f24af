//! Footings across few cells, of held nodes or rigid tools, whose capacity is wrong by a known amount.

use std::collections::BTreeSet;

use mpm_core::basis::DomainKind;
use mpm_core::grid::Lines;
use mpm_core::model::{Action, BoundaryCondition, Model, NodeSet};
use mpm_core::points::Points;

use crate::diagnostic::Severity;
use crate::first_step::Check;
use crate::quoting::{quote, rounded};
use crate::tools::{ToolDeck, ToolShape};
use crate::{AXES, Idealisation};

/// Number of cells across a footing below which its capacity needs an error bar.
const FEW: f64 = 8.0;
/// Errors of capacities below which nothing is said, [-].
const SMALL: f64 = 0.03;
/// Error of a capacity from cohesion or a surcharge, and from the weight of the soil: per relative widening of the
/// footing by half a cell at its edges, and per cell across it; measured with 8 cells and edges in cells of full and of a
/// quarter of their size (`benches/capacity.py`).
const BY_WIDENING: [f64; 2] = [0.27, 1.9];
const BY_CELLS: [f64; 2] = [0.19, 0.4];

/// A footing of held nodes, or the flat side of a tool.
struct Footing {
    /// Sum over its axes of its relative widening, if it acts half a cell beyond its free edges, [-].
    widening: f64,
    /// Smallest number of cells across it; across twice the held width if the other end does not lie in free ground.
    cells: f64,
    /// Sum over its axes of the length by which it acts beyond its free edges, relative to its width, [-].
    beyond: f64,
    edge: Edge,
}

/// A free edge of a footing.
#[derive(Clone, Copy)]
struct Edge {
    axis: usize,
    /// Its position, the grid line up to which the footing acts, and the size of the cell inside that line, [length].
    at: f64,
    acts_to: f64,
    size: f64,
}

/// The span of the centres of the points that flow plastically, [length].
type Reach<const D: usize> = [[f64; D]; 2];

impl Check<'_> {
    /// Notes nodes that are moved together, and flat tools, on ground that flows plastically, with the error that the
    /// cells leave in their capacity; warns of those across few cells.
    pub(crate) fn footings_across_few_cells<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) {
        let Some(lines) = model.grid.lines() else { return };
        // Each rank judges all points, so that all of them find the same.
        let own = (0..points.len()).map(|p| (points.body[p], points.converged.position[p].to_vec()));
        let all: Vec<(u16, Vec<f64>)> = points.ranks.join(own.collect());
        let place = |x: &Vec<f64>| -> [f64; D] { std::array::from_fn(|d| x[d]) };
        let flows = |body: usize| {
            let law = &model.materials[model.bodies[body].material].law;
            law.with_strength_divided(1.0).is_some()
        };
        let ground: Vec<(usize, [f64; D])> = all
            .iter()
            .map(|(body, x)| (usize::from(*body), place(x)))
            .filter(|(body, _)| flows(*body))
            .collect();
        let mut reach: Reach<D> = [[f64::INFINITY; D], [f64::NEG_INFINITY; D]];
        for (_, x) in &ground {
            for d in 0..D {
                reach[0][d] = reach[0][d].min(x[d]);
                reach[1][d] = reach[1][d].max(x[d]);
            }
        }
        let cells = all.iter().filter_map(|(_, x)| lines.locate_index(&place(x)));
        let active: BTreeSet<usize> =
            cells.flat_map(|cell| (0..1 << D).map(move |corner| lines.corner(cell, corner))).collect();
        for (number, condition) in model.boundary_conditions.iter().enumerate() {
            let held = |node: usize, axis: usize| {
                let fixes = |other: &BoundaryCondition<D>| {
                    let NodeSet::Fixed(nodes) = &other.nodes else { return false };
                    other.displacement[axis].is_some() && nodes.binary_search(&(node as u32)).is_ok()
                };
                model.boundary_conditions.iter().any(fixes)
            };
            let is_active = |node: usize| active.contains(&node);
            if let Some(footing) = footing(lines, condition, &reach, held, is_active) {
                let name = format!("the footing of {}", quote(&condition.name));
                self.footing(&name, &format!("/boundary_conditions/{number}"), &footing, model);
            }
        }
        let corners = |d: usize, line: f64, end: f64| {
            let (low, high) = (line.min(end), line.max(end));
            let inside = ground.iter().filter(|(_, x)| (low..high).contains(&x[d]));
            let nearest = inside.min_by(|(_, a), (_, b)| (a[d] - line).abs().total_cmp(&(b[d] - line).abs()));
            let has_domain = |body: usize| model.bodies[body].method.domain() != DomainKind::None;
            nearest.map_or(f64::INFINITY, |(body, x)| {
                (x[d] - line).abs() * if has_domain(*body) { 2.0 } else { 1.0 }
            })
        };
        for (number, tool) in self.loaded.deck.tools.iter().enumerate() {
            if let Some(footing) = punch(lines, tool, &reach, corners) {
                let name = format!("the tool {}", quote(&tool.name));
                self.footing(&name, &format!("/tools/{number}/shape"), &footing, model);
            }
        }
    }

    fn footing<const D: usize>(&mut self, name: &str, at: &str, footing: &Footing, model: &Model<D>) {
        let Footing { widening, cells, beyond, edge } = *footing;
        let deck = &self.loaded.deck;
        let area = if deck.analysis.idealisation == Idealisation::Axisymmetric { 2.0 } else { 1.0 };
        let [uniform, weight] = [0, 1]
            .map(|k| area * (BY_WIDENING[k] * widening + (k + 1) as f64 * beyond) + BY_CELLS[k] / cells);
        let has_friction = deck
            .materials
            .values()
            .any(|material| !material.is_associated() || material.dilation_angle() > 0.0);
        let weighs = model.loads.iter().any(|load| matches!(load.action, Action::Gravity(_))) && has_friction;
        let is_coarse = cells < FEW * (1.0 - 1e-6);
        if uniform.abs() < SMALL && !is_coarse {
            return;
        }
        let shown = |error: f64| {
            let by = if error < 0.0 { "small" } else { "large" };
            format!("too {by} by about {:.0} %", 100.0 * error.abs())
        };
        let error = match weighs {
            true => format!(
                "{} where cohesion or a surcharge gives it, and {} where the weight of the soil does",
                shown(uniform),
                shown(weight)
            ),
            false => shown(uniform),
        };
        let Edge { axis, at: position, acts_to, size } = edge;
        let axis = AXES[axis];
        let place = if position == acts_to {
            format!("{axis} = {} lies on a grid line, beyond which it acts in part", rounded(position))
        } else {
            format!(
                "{axis} = {} lies within a cell, and it acts up to {axis} = {}",
                rounded(position),
                rounded(acts_to)
            )
        };
        let message = format!(
            "{name} spans {cells:.0} cells, and its edge {place}: a capacity is {error}, or larger where the cells lock"
        );
        let severity = if is_coarse { Severity::Warning } else { Severity::Note };
        let found = self.at("D075", at, message).severity(severity);
        self.found.push(found.help(format!(
            "state an error bar with `mpm converge`, use small cells at the edge, `grid: {{refine: [{{at: {{{axis}: {}}}, to: \
             {}}}]}}`, or let a uniform pressure act in place of the footing",
            rounded(position),
            rounded(0.25 * size)
        )));
    }
}

/// The footing that a condition moves: nodes in a plane, along whose normal they move, with ground beyond them that
/// nothing moves; `None` if the condition moves no such nodes.
fn footing<const D: usize>(
    lines: &Lines<D>,
    condition: &BoundaryCondition<D>,
    reach: &Reach<D>,
    held: impl Fn(usize, usize) -> bool,
    is_active: impl Fn(usize) -> bool,
) -> Option<Footing> {
    let NodeSet::Fixed(nodes) = &condition.nodes else { return None };
    if condition.axes.is_some() {
        return None;
    }
    let moves = |d: &usize| {
        condition.displacement[*d].as_ref().is_some_and(|formula| formula.as_constant() != Some(0.0))
    };
    let across = (0..D).find(moves)?;
    let mut indices: Vec<[usize; D]> = nodes.iter().map(|&node| lines.node_index(node as usize)).collect();
    indices.retain(|index| is_active(lines.node(*index)));
    let level = indices.first()?[across];
    if indices.iter().any(|index| index[across] != level) {
        return None;
    }
    let mut found = None;
    for d in (0..D).filter(|d| *d != across) {
        let axis = &lines.axes()[d];
        let low = indices.iter().map(|index| index[d]).min()?;
        let high = indices.iter().map(|index| index[d]).max()?;
        let width = axis.line(high) - axis.line(low);
        // The cell inside an end, if the ground goes on beyond it and is free to move there.
        let edge = |end: usize, beyond: Option<usize>, inside: usize, has_ground: bool| {
            let beyond = beyond.filter(|line| *line <= axis.n_cells() && has_ground)?;
            let index = *indices.iter().find(|index| index[d] == end)?;
            let mut next = index;
            next[d] = beyond;
            let next = lines.node(next);
            let (at, size) = (axis.line(end), axis.size(inside));
            (is_active(next) && !held(next, across)).then_some(Edge { axis: d, at, acts_to: at, size })
        };
        let ends = if high > low {
            let [from, to] = [axis.line(low), axis.line(high)];
            [
                edge(low, low.checked_sub(1), low, reach[0][d] < from),
                edge(high, Some(high + 1), high - 1, reach[1][d] > to),
            ]
        } else {
            [None, None]
        };
        let largest = (low..high).map(|cell| axis.size(cell)).fold(0.0, f64::max);
        found = Footing::along(found, ends, width, largest);
    }
    found
}

/// The flat side of a box or polygon that is moved towards the ground, with ground beyond it; `None` for other tools.
/// `corners` gives the distance from a grid line of the first place of contact in the cell between this line and another
/// one, [length]: a side of a domain that ends below the tool brings the whole cell into contact.
fn punch<const D: usize>(
    lines: &Lines<D>,
    tool: &ToolDeck,
    reach: &Reach<D>,
    corners: impl Fn(usize, f64, f64) -> f64,
) -> Option<Footing> {
    let motions = [&tool.ux, &tool.uy, &tool.uz];
    let across = (0..D).find(|d| motions[*d].is_some())?;
    if tool.turned.is_some() {
        return None;
    }
    // The corners of the side next to the ground.
    let vertices: Vec<Vec<f64>> = match &tool.shape {
        ToolShape::Box { min, max } => vec![min.clone(), max.clone()],
        ToolShape::Polygon { vertices, .. } if D == 2 => vertices.clone(),
        _ => return None,
    };
    let bound = |d: usize, pick: fn(f64, f64) -> f64, start: f64, of: &[&Vec<f64>]| {
        of.iter().filter_map(|v| v.get(d)).copied().fold(start, pick)
    };
    let all: Vec<&Vec<f64>> = vertices.iter().collect();
    let [low, high] =
        [bound(across, f64::min, f64::INFINITY, &all), bound(across, f64::max, f64::NEG_INFINITY, &all)];
    let axis = &lines.axes()[across];
    let is_near = |level: f64, ground: f64| (level - ground).abs() <= axis.size_at(ground);
    let level = if is_near(low, reach[1][across]) && low > reach[0][across] {
        low
    } else if is_near(high, reach[0][across]) && high < reach[1][across] {
        high
    } else {
        return None;
    };
    let of_side: Vec<&Vec<f64>> = match &tool.shape {
        ToolShape::Box { .. } => all,
        _ => all.into_iter().filter(|v| v.get(across) == Some(&level)).collect(),
    };
    let mut found = None;
    for d in (0..D).filter(|d| *d != across) {
        let axis = &lines.axes()[d];
        let [low, high] =
            [bound(d, f64::min, f64::INFINITY, &of_side), bound(d, f64::max, f64::NEG_INFINITY, &of_side)];
        let edge = |at: f64, outward: bool| {
            let line = axis.nearest_line(at);
            if (axis.line(line) - at).abs() <= 1e-6 * axis.size_around(line) {
                let inside = if outward { line.checked_sub(1)? } else { line };
                return Some(Edge {
                    axis: d,
                    at,
                    acts_to: at,
                    size: axis.size(inside.min(axis.n_cells() - 1)),
                });
            }
            let cell = axis.cell_of(axis.coordinate(at));
            let ends = [axis.line(cell), axis.line(cell + 1)];
            let [inner, outer] = if outward { ends } else { [ends[1], ends[0]] };
            let touches = (at - inner).abs() >= corners(d, inner, outer) * (1.0 - 1e-6);
            Some(Edge { axis: d, at, acts_to: if touches { outer } else { inner }, size: axis.size(cell) })
        };
        let first = axis.line(axis.cell_of(axis.coordinate(reach[0][d])));
        let last = axis.line(axis.cell_of(axis.coordinate(reach[1][d])) + 1);
        let ends = [
            (reach[0][d] < low).then(|| edge(low, false)).flatten(),
            (reach[1][d] > high).then(|| edge(high, true)).flatten(),
        ];
        let width = high.min(last) - low.max(first);
        if width <= 0.0 {
            return None;
        }
        let [from, to] = [low.max(first), high.min(last)].map(|x| axis.cell_of(axis.coordinate(x)));
        let largest = (from..=to.min(axis.n_cells() - 1)).map(|cell| axis.size(cell)).fold(0.0, f64::max);
        found = Footing::along(found, ends, width, largest);
    }
    found
}

impl Footing {
    /// The footing with what one more axis adds, along which it has this width and these free ends, on cells of up to
    /// this size, [length]; unchanged if no end is free.
    fn along(known: Option<Footing>, ends: [Option<Edge>; 2], width: f64, largest: f64) -> Option<Footing> {
        let free: Vec<Edge> = ends.into_iter().flatten().collect();
        let Some(&edge) = free.first() else { return known };
        let sign = |end: usize| if end == 0 { -1.0 } else { 1.0 };
        let over = |(end, edge): (usize, Option<Edge>)| {
            edge.map_or(0.0, |edge| sign(end) * (edge.acts_to - edge.at))
        };
        let beyond = ends.into_iter().enumerate().map(over).sum::<f64>() / width;
        let widening = free.iter().map(|edge| 0.5 * edge.size).sum::<f64>() / width;
        let cells = width / largest * if free.len() == 1 { 2.0 } else { 1.0 };
        Some(match known {
            None => Footing { widening, cells, beyond, edge },
            Some(other) => Footing {
                widening: widening + other.widening,
                cells: cells.min(other.cells),
                beyond: beyond + other.beyond,
                edge: other.edge,
            },
        })
    }
}
