//! Footings of held nodes across few cells, whose capacity is too large by a known amount.

use mpm_core::basis::Connectivity;
use mpm_core::grid::Lines;
use mpm_core::model::{Action, BoundaryCondition, Model, NodeSet};
use mpm_core::points::Points;

use crate::diagnostic::Severity;
use crate::first_step::Check;
use crate::quoting::{quote, rounded};
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

/// A footing of held nodes.
struct Footing {
    /// Sum over its axes of its relative widening, if it acts half a cell beyond its free edges, [-].
    widening: f64,
    /// Smallest number of cells across it; across twice the held width if the other end does not lie in free ground.
    cells: f64,
    /// Axis and position of a free edge, [length], and the size of the cell inside it, [length].
    edge: (usize, f64, f64),
}

impl Check<'_> {
    /// Notes footings of nodes that are moved together on ground that flows plastically, with the error that the cells
    /// leave in their capacity; warns of those across few cells.
    pub(crate) fn footings_across_few_cells<const D: usize>(
        &mut self,
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
    ) {
        // On several ranks, each sees only the nodes near its own points.
        let Some(lines) = model.grid.lines().filter(|_| points.ranks.is_alone()) else { return };
        let flows = |body: usize| {
            let law = &model.materials[model.bodies[body].material].law;
            law.with_strength_divided(1.0).is_some()
        };
        let ground = (0..points.len()).filter(|&p| flows(usize::from(points.body[p])));
        let mut reach = [[f64::INFINITY; D], [f64::NEG_INFINITY; D]];
        for x in ground.map(|p| points.converged.position[p]) {
            for d in 0..D {
                reach[0][d] = reach[0][d].min(x[d]);
                reach[1][d] = reach[1][d].max(x[d]);
            }
        }
        for (number, condition) in model.boundary_conditions.iter().enumerate() {
            let held = |node: usize, axis: usize| {
                let fixes = |other: &BoundaryCondition<D>| {
                    let NodeSet::Fixed(nodes) = &other.nodes else { return false };
                    other.displacement[axis].is_some() && nodes.binary_search(&(node as u32)).is_ok()
                };
                model.boundary_conditions.iter().any(fixes)
            };
            let is_active = |node: usize| !links.copies(node).is_empty();
            if let Some(mut footing) = footing(lines, condition, &reach, held, is_active) {
                if self.loaded.deck.analysis.idealisation == Idealisation::Axisymmetric {
                    footing.widening *= 2.0;
                }
                self.footing(number, &footing, model);
            }
        }
    }

    fn footing<const D: usize>(&mut self, number: usize, footing: &Footing, model: &Model<D>) {
        let Footing { widening, cells, edge: (axis, edge, size) } = *footing;
        let [uniform, weight] = [0, 1].map(|k| BY_WIDENING[k] * widening + BY_CELLS[k] / cells);
        let deck = &self.loaded.deck;
        let has_friction = deck
            .materials
            .values()
            .any(|material| !material.is_associated() || material.dilation_angle() > 0.0);
        let weighs = model.loads.iter().any(|load| matches!(load.action, Action::Gravity(_))) && has_friction;
        let is_coarse = cells < FEW * (1.0 - 1e-6);
        if uniform < SMALL && !is_coarse {
            return;
        }
        let percent = |error: f64| format!("{:.0} %", 100.0 * error);
        let error = match weighs {
            true => format!(
                "{} where cohesion or a surcharge gives it, and by {} where the weight of the soil does",
                percent(uniform),
                percent(weight)
            ),
            false => percent(uniform),
        };
        let message = format!(
            "the footing of {} spans {:.0} cells, and its edge {} = {} lies on a node: held nodes act beyond their edge, so \
             that a capacity is too large by about {error}, or more where the cells lock",
            quote(&deck.boundary_conditions[number].name),
            cells,
            AXES[axis],
            rounded(edge),
        );
        let severity = if is_coarse { Severity::Warning } else { Severity::Note };
        let found = self.at("D075", &format!("/boundary_conditions/{number}"), message).severity(severity);
        self.found.push(found.help(format!(
            "state an error bar with `mpm converge`, use small cells at the edge, `grid: {{refine: [{{at: {{{}: {}}}, to: {}}}]}}`, \
             or let a uniform pressure act in place of the nodes",
            AXES[axis],
            rounded(edge),
            rounded(0.25 * size)
        )));
    }
}

/// The footing that a condition moves: nodes in a plane, along whose normal they move, with ground beyond them that
/// nothing moves; `None` if the condition moves no such nodes.
fn footing<const D: usize>(
    lines: &Lines<D>,
    condition: &BoundaryCondition<D>,
    reach: &[[f64; D]; 2],
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
    let mut found: Option<Footing> = None;
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
            (is_active(next) && !held(next, across)).then(|| (d, axis.line(end), axis.size(inside)))
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
        let free: Vec<_> = ends.into_iter().flatten().collect();
        let Some(&first) = free.first() else { continue };
        let widening = free.iter().map(|(.., size)| 0.5 * size).sum::<f64>() / width;
        let largest = (low..high).map(|cell| axis.size(cell)).fold(0.0, f64::max);
        let cells = width / largest * if free.len() == 1 { 2.0 } else { 1.0 };
        found = Some(match found {
            None => Footing { widening, cells, edge: first },
            Some(other) => Footing {
                widening: widening + other.widening,
                cells: cells.min(other.cells),
                edge: other.edge,
            },
        });
    }
    found
}
