//! Checks of the points of bodies against the grid, and the groups of cells that regions are made of.

use std::collections::BTreeMap;

use super::diagnostic::{list, quote};
use super::seeding::Fault;
use super::{BodyDeck, Shape, region};
use crate::formula::closest;
use crate::grid::{Grid, Structured};
use crate::points::{Seed, coordinates};

/// Message and help for the name of a physical group that does not exist, or has no cells where it needs some.
pub(super) fn unknown_group(grid: &dyn Grid<2>, name: &str, of_cells: bool) -> (String, String) {
    if grid.structured().is_some() {
        let help = "physical groups exist on grids of type `gmsh` only".to_owned();
        return ("a structured grid has no physical groups".to_owned(), help);
    }
    let kind = if of_cells { " of cells" } else { "" };
    let names: Vec<&str> =
        grid.set_names().into_iter().filter(|name| !of_cells || grid.cell_set(name).is_some()).collect();
    let help = match closest(name, names.iter().copied()) {
        _ if names.is_empty() => format!("the mesh has no physical groups{kind}"),
        Some(best) => {
            format!("did you mean {}? the physical groups{kind} are {}", quote(best), list(names))
        }
        None => format!("the physical groups{kind} are {}", list(names)),
    };
    let message = if of_cells && grid.node_set(name).is_some() {
        format!("the physical group {} has no cells", quote(name))
    } else {
        format!("the mesh has no physical group {}", quote(name))
    };
    (message, help)
}

/// For every group that a region names, which cells belong to it.
pub(super) fn members<'a>(grid: &dyn Grid<2>, shape: &'a Shape) -> BTreeMap<&'a str, Vec<bool>> {
    let mut members = BTreeMap::new();
    for (_, group) in region::groups(shape, "") {
        let mut member = vec![false; grid.n_cells()];
        for &cell in grid.cell_set(group).unwrap_or_default() {
            member[cell as usize] = true;
        }
        members.insert(group, member);
    }
    members
}

/// The indices along one axis of the grid lines within a range, and some that are just outside.
fn lines_near(grid: &Structured<2>, axis: usize, low: f64, high: f64) -> std::ops::Range<usize> {
    let (origin, spacing) = (grid.origin()[axis], grid.spacing()[axis]);
    let line = |x: f64| ((x - origin) / spacing).clamp(-2.0, grid.cells()[axis] as f64 + 2.0);
    let first = (line(low).floor() - 1.0).max(0.0) as usize;
    let last = (line(high).ceil() + 1.0).max(0.0) as usize;
    first..(last + 1).min(grid.cells()[axis] + 1)
}

/// All nodes within bounds, ascending, and some that are outside: those just beside the bounds, or all of the grid
/// where it has no lines.
pub(super) fn nodes_near(
    grid: &dyn Grid<2>,
    [low, high]: region::Bounds,
) -> Box<dyn Iterator<Item = usize> + '_> {
    let Some(lines) = grid.structured() else { return Box::new(0..grid.n_nodes()) };
    let [columns, rows] = [0, 1].map(|d| lines_near(lines, d, low[d], high[d]));
    Box::new(rows.flat_map(move |j| columns.clone().map(move |i| lines.node([i, j]))))
}

/// All cells that may meet bounds, ascending, and some more, as [`nodes_near`].
pub(super) fn cells_near(
    grid: &dyn Grid<2>,
    bounds: Option<region::Bounds>,
) -> Box<dyn Iterator<Item = usize> + '_> {
    let (Some(lines), Some([low, high])) = (grid.structured(), bounds) else {
        return Box::new(0..grid.n_cells());
    };
    let [columns, rows] = [0, 1].map(|d| {
        let lines_near = lines_near(lines, d, low[d], high[d]);
        lines_near.start..lines_near.end.min(lines.cells()[d])
    });
    Box::new(rows.flat_map(move |j| columns.clone().map(move |i| lines.cell([i, j]))))
}

/// All points of a body, and the corners of their domains, must lie in cells.
pub(super) fn inside_grid(grid: &dyn Grid<2>, body: &str, seeds: &[Seed<2>]) -> Result<(), Fault> {
    let outside = |x: &[f64; 2]| grid.locate(x, None).is_none();
    let mut lost = seeds.iter().filter(|s| outside(&s.position) || s.corners.iter().any(outside));
    let Some(first) = lost.next() else { return Ok(()) };
    let part = if outside(&first.position) { "" } else { " (a corner of its domain)" };
    let message = format!(
        "{} of the {} points of the body {} lie outside the grid, the first at {}{part}",
        lost.count() + 1,
        seeds.len(),
        quote(body),
        coordinates(&first.position)
    );
    let help =
        "move the body, make the grid larger, or take away what is outside by a `difference`".to_owned();
    Err(Fault { code: "D028", key: "/shape".to_owned(), message, help })
}

/// Bodies whose points lie in the region of an earlier body: the number of the body, and a message.
pub(super) fn overlaps(grid: &dyn Grid<2>, bodies: &[BodyDeck], seeds: &[Seed<2>]) -> Vec<(usize, String)> {
    if bodies.len() < 2 {
        return Vec::new();
    }
    let mut in_cell: BTreeMap<u32, Vec<&Seed<2>>> = BTreeMap::new();
    for seed in seeds {
        if let Some(cell) = grid.locate(&seed.position, None) {
            in_cell.entry(cell).or_default().push(seed);
        }
    }
    // Points inside the region of another body, by the later and the earlier body: how many, and the first.
    let mut found: BTreeMap<(u16, u16), (usize, [f64; 2])> = BTreeMap::new();
    let mut groups: BTreeMap<u16, BTreeMap<&str, Vec<bool>>> = BTreeMap::new();
    for (cell, seeds) in &in_cell {
        let mut present: Vec<u16> = seeds.iter().map(|s| s.body).collect();
        present.sort_unstable();
        present.dedup();
        if present.len() < 2 {
            continue;
        }
        for &other in &present {
            let shape = &bodies[other as usize].shape;
            let members = groups.entry(other).or_insert_with(|| members(grid, shape));
            let in_cells = |group: Option<&str>| {
                group.is_none_or(|name| members.get(name).is_some_and(|member| member[*cell as usize]))
            };
            for seed in seeds.iter().filter(|s| s.body != other) {
                if region::contains(shape, seed.position, &in_cells) {
                    let pair = (seed.body.max(other), seed.body.min(other));
                    found.entry(pair).or_insert((0, seed.position)).0 += 1;
                }
            }
        }
    }
    let name = |body: u16| quote(&bodies[body as usize].name);
    let message = |((later, earlier), (count, place)): ((u16, u16), (usize, [f64; 2]))| {
        let text = format!(
            "the body {} overlaps the body {}: {count} points of either lie in the region of the other, the first at {}",
            name(later),
            name(earlier),
            coordinates(&place)
        );
        (later as usize, text)
    };
    found.into_iter().map(message).collect()
}
