//! Footings across few cells, of held nodes or rigid tools, whose capacity is wrong by a known amount.

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
/// Error of a capacity below which nothing is said of a footing with enough cells across it, [-]: that of eight cells
/// whose edge lies on a line.
const SMALL: f64 = 0.06;
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
    /// Position, [length].
    at: f64,
    /// The grid line up to which the footing acts, [length].
    acts_to: f64,
    /// Size of the cell inside the edge, or of the cell in which it lies, [length].
    size: f64,
}

/// The points on all ranks: those that flow plastically are the ground.
struct Ground<'a, const D: usize> {
    lines: &'a Lines<D>,
    model: &'a Model<D>,
    points: &'a Points<D>,
    /// Lowest and highest coordinates of the points of the ground, [length].
    reach: [[f64; D]; 2],
    /// The cells that contain points, ascending.
    cells: Vec<usize>,
}

impl<'a, const D: usize> Ground<'a, D> {
    fn new(model: &'a Model<D>, points: &'a Points<D>, lines: &'a Lines<D>) -> Self {
        let mut ground = Ground {
            lines,
            model,
            points,
            reach: [[f64::INFINITY; D], [f64::NEG_INFINITY; D]],
            cells: Vec::new(),
        };
        let [mut low, mut high] = ground.reach;
        for x in ground.own().map(|p| points.converged.position[p]) {
            low = std::array::from_fn(|d| low[d].min(x[d]));
            high = std::array::from_fn(|d| high[d].max(x[d]));
        }
        ground.reach = [low.map(|x| points.ranks.smallest(x)), high.map(|x| points.ranks.largest(x))];
        let mut cells: Vec<usize> = points
            .converged
            .position
            .iter()
            .filter_map(|x| lines.locate_index(x))
            .map(|cell| lines.cell(cell))
            .collect();
        cells.sort_unstable();
        cells.dedup();
        ground.cells = points.ranks.join(cells);
        ground.cells.sort_unstable();
        ground.cells.dedup();
        ground
    }

    /// The points of the ground on this rank.
    fn own(&self) -> impl Iterator<Item = usize> + use<'a, D> {
        let (model, points) = (self.model, self.points);
        let flows = move |body: usize| {
            let law = &model.materials[model.bodies[body].material].law;
            law.with_strength_divided(1.0).is_some()
        };
        let flowing: Vec<bool> = (0..model.bodies.len()).map(flows).collect();
        (0..points.len()).filter(move |&p| flowing[usize::from(points.body[p])])
    }

    /// True if a cell around a node contains points.
    fn is_active(&self, node: usize) -> bool {
        let index = self.lines.node_index(node);
        (0..1usize << D).any(|corner| {
            let below =
                |d: usize| index[d].checked_sub(corner >> d & 1).filter(|cell| *cell < self.lines.cells()[d]);
            let cell: Option<Vec<usize>> = (0..D).map(below).collect();
            cell.is_some_and(|cell| {
                let number = self.lines.cell(std::array::from_fn(|d| cell[d]));
                self.cells.binary_search(&number).is_ok()
            })
        })
    }

    /// Distance from a grid line of the first place of contact in the cell between this line and another one, [length]:
    /// the end of the first side of a domain, or a point without a domain. A side that ends below a tool brings the
    /// whole cell into contact.
    fn first_contact(&self, d: usize, line: f64, end: f64) -> f64 {
        let (low, high) = (line.min(end), line.max(end));
        let has_domain = |p: usize| {
            self.model.bodies[usize::from(self.points.body[p])].method.domain() != DomainKind::None
        };
        let inside = self.own().map(|p| (p, self.points.converged.position[p][d]));
        let away = inside.filter(|(_, x)| (low..high).contains(x));
        let away = away.map(|(p, x)| (x - line).abs() * if has_domain(p) { 2.0 } else { 1.0 });
        self.points.ranks.smallest(away.fold(f64::INFINITY, f64::min))
    }
}

impl Check<'_> {
    /// Notes nodes that are moved together, and flat tools, on ground that flows plastically, with the error that the
    /// cells leave in their capacity; warns of those across few cells.
    pub(crate) fn footings_across_few_cells<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>) {
        let Some(lines) = model.grid.lines() else { return };
        if self.loaded.deck.tools.is_empty()
            && !model.boundary_conditions.iter().any(BoundaryCondition::moves)
        {
            return;
        }
        let ground = Ground::new(model, points, lines);
        for (number, condition) in model.boundary_conditions.iter().enumerate() {
            let held = |node: usize, axis: usize| {
                let fixes = |other: &BoundaryCondition<D>| {
                    let NodeSet::Fixed(nodes) = &other.nodes else { return false };
                    other.displacement[axis].is_some() && nodes.binary_search(&(node as u32)).is_ok()
                };
                model.boundary_conditions.iter().any(fixes)
            };
            if let Some(footing) = footing(&ground, condition, held) {
                let name = format!("the footing of {}", quote(&condition.name));
                self.footing(&name, &format!("/boundary_conditions/{number}"), &footing, model);
            }
        }
        for (number, tool) in self.loaded.deck.tools.iter().enumerate() {
            if let Some(footing) = punch(&ground, tool) {
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
/// nothing moves; `None` if the condition moves no such nodes. `held` tells whether a condition prescribes the
/// displacement of a node along an axis.
fn footing<const D: usize>(
    ground: &Ground<D>,
    condition: &BoundaryCondition<D>,
    held: impl Fn(usize, usize) -> bool,
) -> Option<Footing> {
    let Ground { lines, reach, .. } = ground;
    let NodeSet::Fixed(nodes) = &condition.nodes else { return None };
    if condition.axes.is_some() {
        return None;
    }
    let moves = |d: &usize| {
        condition.displacement[*d].as_ref().is_some_and(|formula| formula.as_constant() != Some(0.0))
    };
    let across = (0..D).find(moves)?;
    let mut indices: Vec<[usize; D]> = nodes.iter().map(|&node| lines.node_index(node as usize)).collect();
    indices.retain(|index| ground.is_active(lines.node(*index)));
    let level = indices.first()?[across];
    if indices.iter().any(|index| index[across] != level) {
        return None;
    }
    let mut found = None;
    for d in (0..D).filter(|d| *d != across) {
        let axis = &lines.axes()[d];
        let low = indices.iter().map(|index| index[d]).min()?;
        let high = indices.iter().map(|index| index[d]).max()?;
        if low == high {
            continue;
        }
        // The end, if the ground goes on beyond it and is free to move there.
        let edge = |end: usize, beyond: Option<usize>, inside: usize, has_ground: bool| {
            let beyond = beyond.filter(|line| *line <= axis.n_cells() && has_ground)?;
            let mut next = *indices.iter().find(|index| index[d] == end)?;
            next[d] = beyond;
            let next = lines.node(next);
            let at = axis.line(end);
            let edge = Edge { axis: d, at, acts_to: at, size: axis.size(inside) };
            (ground.is_active(next) && !held(next, across)).then_some(edge)
        };
        let [from, to] = [axis.line(low), axis.line(high)];
        let ends = [
            edge(low, low.checked_sub(1), low, reach[0][d] < from),
            edge(high, Some(high + 1), high - 1, reach[1][d] > to),
        ];
        let largest = (low..high).map(|cell| axis.size(cell)).fold(0.0, f64::max);
        found = Footing::along(found, ends, to - from, largest);
    }
    found
}

/// The footing of a box or polygon that is moved towards the ground, with ground beyond its flat side; `None` for other
/// tools.
fn punch<const D: usize>(ground: &Ground<D>, tool: &ToolDeck) -> Option<Footing> {
    let Ground { lines, reach, .. } = ground;
    let motions = [&tool.ux, &tool.uy, &tool.uz];
    let across = (0..D).find(|d| motions[*d].is_some())?;
    let side = side_at_ground(ground, tool, across)?;
    let mut found = None;
    for d in (0..D).filter(|d| *d != across) {
        let axis = &lines.axes()[d];
        let [low, high] = span(&side, d);
        let cell_at = |x: f64| axis.cell_of(axis.coordinate(x)).min(axis.n_cells() - 1);
        let ends = [
            (reach[0][d] < low).then(|| edge_of_tool(ground, d, low, false)),
            (reach[1][d] > high).then(|| edge_of_tool(ground, d, high, true)),
        ];
        let from = low.max(axis.line(cell_at(reach[0][d])));
        let to = high.min(axis.line(cell_at(reach[1][d]) + 1));
        if to <= from {
            return None;
        }
        let largest = (cell_at(from)..=cell_at(to)).map(|cell| axis.size(cell)).fold(0.0, f64::max);
        found = Footing::along(found, ends, to - from, largest);
    }
    found
}

/// The corners of the side of a tool that lies next to the ground, across an axis; `None` if it has no flat one.
fn side_at_ground<const D: usize>(
    ground: &Ground<D>,
    tool: &ToolDeck,
    across: usize,
) -> Option<Vec<Vec<f64>>> {
    let Ground { lines, reach, .. } = ground;
    let corners = match &tool.shape {
        _ if tool.turned.is_some() => return None,
        ToolShape::Box { min, max } => vec![min.clone(), max.clone()],
        ToolShape::Polygon { vertices, .. } if D == 2 => vertices.clone(),
        _ => return None,
    };
    let axis = &lines.axes()[across];
    let [low, high] = span(&corners, across);
    let is_near = |level: f64, end: f64| (level - end).abs() <= axis.size_at(end);
    let level = if is_near(low, reach[1][across]) && low > reach[0][across] {
        low
    } else if is_near(high, reach[0][across]) && high < reach[1][across] {
        high
    } else {
        return None;
    };
    let is_box = matches!(tool.shape, ToolShape::Box { .. });
    Some(corners.into_iter().filter(|corner| is_box || corner.get(across) == Some(&level)).collect())
}

/// The lowest and the highest coordinate of these positions along an axis, [length].
fn span(positions: &[Vec<f64>], d: usize) -> [f64; 2] {
    let along = || positions.iter().filter_map(|x| x.get(d)).copied();
    [along().fold(f64::INFINITY, f64::min), along().fold(f64::NEG_INFINITY, f64::max)]
}

/// The end of a tool along an axis, at its lower or its upper end.
fn edge_of_tool<const D: usize>(ground: &Ground<D>, d: usize, at: f64, is_upper: bool) -> Edge {
    let axis = &ground.lines.axes()[d];
    let line = axis.nearest_line(at);
    if (axis.line(line) - at).abs() <= 1e-6 * axis.size_around(line) {
        let inside = if is_upper { line.saturating_sub(1) } else { line };
        return Edge { axis: d, at, acts_to: at, size: axis.size(inside.min(axis.n_cells() - 1)) };
    }
    let cell = axis.cell_of(axis.coordinate(at));
    let ends = [axis.line(cell), axis.line(cell + 1)];
    let [inner, outer] = if is_upper { ends } else { [ends[1], ends[0]] };
    let touches = (at - inner).abs() >= ground.first_contact(d, inner, outer) * (1.0 - 1e-6);
    Edge { axis: d, at, acts_to: if touches { outer } else { inner }, size: axis.size(cell) }
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
