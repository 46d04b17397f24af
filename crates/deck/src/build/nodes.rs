//! The grid nodes that boundary conditions select.

use super::Builder;
use crate::diagnostic::{Diagnostic, Severity};
use crate::grid::line_at;
use crate::per_axis::array;
use crate::placing;
use crate::quoting::{quote, rounded};
use crate::references::{Noun, existing};
use crate::region::DeckRegion;
use crate::{AXES, BoundaryConditionDeck, GroupDeck, NodeSelector};
use mpm_core::grid::{Grid, Lines};
use mpm_core::model::NodeSet;
use mpm_core::points::Points;
use mpm_core::region::Region;

/// Largest distance of a node from a box, or from a stated coordinate, at which it counts as lying there, relative to
/// the size of the cells around it, [-].
const IN_BOX: f64 = 1e-6;
/// A box that ends farther than this beyond the last grid line in it is probably meant to reach the next line; relative
/// to the size of a cell, [-].
const BETWEEN_LINES: f64 = 0.1;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// The nodes of a physical group; reports an error if there is no such group, or several.
    pub(super) fn nodes_of_group(
        &mut self,
        grid: &dyn Grid<D>,
        group: &GroupDeck,
        pointer: &str,
    ) -> Option<Vec<u32>> {
        let (name, all) = (group.name(), grid.node_sets_named(group.name()));
        let wanted = |dimension: u8| group.dimension().is_none_or(|stated| stated == dimension);
        let found: Vec<&(u8, &[u32])> = all.iter().filter(|(dimension, _)| wanted(*dimension)).collect();
        let (message, help) = match (found.as_slice(), all.as_slice()) {
            ([(_, nodes)], _) => return Some(nodes.to_vec()),
            ([], [(exists, _), ..]) => (
                format!("the physical group {} has the dimension {exists}", quote(name)),
                format!("give `dimension: {exists}`, or the name alone"),
            ),
            ([], []) => placing::unknown_group(grid, name, false),
            (several, _) => {
                let candidates: Vec<String> = several
                    .iter()
                    .map(|(dimension, nodes)| {
                        format!("`{{dimension: {dimension}, name: {name}}}` ({} nodes)", nodes.len())
                    })
                    .collect();
                (
                    format!("{} physical groups are called {}", several.len(), quote(name)),
                    format!("say which one is meant: {}", candidates.join(" or ")),
                )
            }
        };
        self.error("D031", pointer, message, help);
        None
    }

    /// The nodes that a boundary condition selects; reports an error if there are none.
    pub(super) fn nodes(
        &mut self,
        grid: &dyn Grid<D>,
        points: &Points<D>,
        selected: &NodeSelector,
        condition: &BoundaryConditionDeck,
        pointer: &str,
    ) -> NodeSet {
        let NodeSelector { within, group, outer_layer, .. } = selected;
        let name = &condition.name;
        let coordinates = selected.coordinates();
        if let Some(body) = outer_layer {
            return NodeSet::OuterLayer(self.body_number(body) as u16);
        }
        if let Some(group) = group {
            let pointer = format!("{pointer}/nodes/group");
            return NodeSet::Fixed(self.nodes_of_group(grid, group, &pointer).unwrap_or_default());
        }
        let mut off_line = false;
        for (axis, coordinate) in coordinates.iter().enumerate().take(D) {
            if let (Some(c), Some(lines)) = (coordinate, grid.lines()) {
                let at = format!("{pointer}/nodes/{}", AXES[axis]);
                off_line |= self.line("D029", lines, axis, *c, &at).is_none();
            }
        }
        // The cells around a node define what counts as near.
        let slack = |node: usize| grid.spacing_around(node).map(|h| IN_BOX * h);
        let all = grid.bounds();
        let bounds: [[f64; D]; 2] = match within {
            Some(region) => [array(&region.min), array(&region.max)],
            None => [0, 1].map(|side| std::array::from_fn(|d| coordinates[d].unwrap_or(all[side][d]))),
        };
        // Round-off must not exclude nodes along an axis that no coordinate restricts.
        let restricts = |d: usize| within.is_some() || coordinates[d].is_some();
        let inside = |node: usize| {
            let (x, slack) = (grid.node_position(node), slack(node));
            let between = |d: usize| bounds[0][d] - slack[d] <= x[d] && x[d] <= bounds[1][d] + slack[d];
            (0..D).all(|d| !restricts(d) || between(d))
        };
        let nodes: Vec<u32> =
            grid.nodes_near(&bounds).filter(|&node| inside(node)).map(|node| node as u32).collect();
        if nodes.is_empty() && !off_line {
            let message = format!("the boundary condition {} selects no grid node", quote(name));
            let help = grid.lines().map_or_else(
                || match grid.set_names().unwrap_or_default().as_slice() {
                    [] => "give coordinates of nodes of the mesh; it has no physical groups".to_owned(),
                    names => {
                        let known = existing(Noun::new("group", "groups"), names);
                        format!("select a physical group of the mesh with `group`; {known}")
                    }
                },
                |lines| {
                    let along: Vec<String> = (0..D).map(|d| lines_in_words(lines, d, &bounds)).collect();
                    let (last, first) = along.split_last().unwrap_or((&along[0], &[]));
                    format!("grid nodes lie at {} and {last}", first.join(", "))
                },
            );
            self.error("D029", &format!("{pointer}/nodes"), message, help);
        }
        if let (Some(lines), true, true) = (grid.lines(), within.is_some(), condition.moves()) {
            self.ends_between_lines(lines, points, &bounds, name, pointer);
        }
        NodeSet::Fixed(nodes)
    }

    /// Warns of a box of moving nodes that ends between grid lines, if there is material up to the line beyond. An axis
    /// along which the box contains a single line is exempt, because the box then only needs to surround this line.
    fn ends_between_lines(
        &mut self,
        grid: &Lines<D>,
        points: &Points<D>,
        [low, high]: &[[f64; D]; 2],
        condition: &str,
        pointer: &str,
    ) {
        for (axis, lines) in grid.axes().iter().enumerate() {
            let [from, to] = [low[axis], high[axis]].map(|end| lines.coordinate(end));
            let first = (from - IN_BOX).ceil().max(0.0);
            let last = (to + IN_BOX).floor().min(lines.n_cells() as f64);
            if first >= last {
                continue;
            }
            for (corner, end, line, beyond) in
                [("min", low[axis], first, first - 1.0), ("max", high[axis], last, last + 1.0)]
            {
                let left = (lines.coordinate(end) - line).abs();
                if left <= BETWEEN_LINES || !(0.0..=lines.n_cells() as f64).contains(&beyond) {
                    continue;
                }
                let is_between = |x: f64| line.min(beyond) < x && x < line.max(beyond);
                // Along the other axes, material in the box or in the cells next to it counts.
                let is_near = |x: &[f64; D], d: usize| {
                    let [from, to, x] = [low[d], high[d], x[d]].map(|x| grid.axes()[d].coordinate(x));
                    d == axis || (from - 1.0 < x && x < to + 1.0)
                };
                let is_left_out =
                    |x: &[f64; D]| is_between(lines.coordinate(x[axis])) && (0..D).all(|d| is_near(x, d));
                if !self.ranks.any(points.converged.position.iter().any(is_left_out)) {
                    continue;
                }
                let (name, [line, beyond]) =
                    (AXES[axis], [line, beyond].map(|line| rounded(lines.position(line))));
                let message = format!(
                    "the box of the boundary condition {} ends at {name} = {end}, between grid lines: it moves nodes only up \
                     to {name} = {line}",
                    quote(condition)
                );
                let help = format!(
                    "let the box end at {line} or {beyond}, or choose a spacing for which a grid line lies at {end}"
                );
                let at = format!("{pointer}/nodes/box/{corner}/{axis}");
                let found = Diagnostic::at(&self.loaded.source, "D029", &at, message);
                self.found.push(found.severity(Severity::Warning).help(help));
            }
        }
    }

    /// The index of the grid line at a coordinate along an axis; reports an error if there is none.
    pub(super) fn line(
        &mut self,
        code: &'static str,
        lines: &Lines<D>,
        axis: usize,
        coordinate: f64,
        pointer: &str,
    ) -> Option<usize> {
        let found = line_at(&lines.axes()[axis], coordinate);
        if let Err(nearest) = found {
            let name = AXES[axis];
            let message = format!("no grid line lies at {name} = {coordinate}");
            self.error(code, pointer, message, format!("the nearest one is {name} = {nearest}"));
        }
        found.ok()
    }
}

/// Describes the grid lines along an axis: all lines of an evenly spaced axis as a formula, or the lines of a graded
/// axis next to the middle of a selection.
fn lines_in_words<const D: usize>(grid: &Lines<D>, axis: usize, selected: &[[f64; D]; 2]) -> String {
    let (lines, name) = (&grid.axes()[axis], AXES[axis]);
    if lines.is_even() {
        return format!("{} + {} {} in {name}", lines.line(0), ["i", "j", "k"][axis], lines.size(0));
    }
    let middle = 0.5 * (selected[0][axis] + selected[1][axis]);
    let below = lines.cell_of(lines.coordinate(middle));
    format!("{} or {} in {name}", lines.line(below), lines.line(below + 1))
}
