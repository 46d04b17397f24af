//! Checks the points of bodies against the grid and against other bodies; finds nodes near a box.

use std::collections::BTreeMap;

use crate::Deck;
use crate::quoting::quote;
use crate::references::{Noun, known_names};
use crate::region::Regions;
use crate::seeding::{Fault, Filled};
use mpm_core::grid::Grid;
use mpm_core::points::{Points, coordinates};
use mpm_core::ranks::Ranks;
use mpm_core::region::contains_in_cell;

/// Message and help for a physical group that does not exist, or has no cells although cells are required.
pub(crate) fn unknown_group<const D: usize>(
    grid: &dyn Grid<D>,
    name: &str,
    cells_only: bool,
) -> (String, String) {
    let Some(names) = grid.set_names() else {
        let help = "physical groups exist on grids of type `gmsh` only".to_owned();
        return ("a structured grid has no physical groups".to_owned(), help);
    };
    let kind = if cells_only { " of cells" } else { "" };
    let names: Vec<&str> =
        names.into_iter().filter(|name| !cells_only || grid.cell_set(name).is_some()).collect();
    let (one, several) = (format!("physical group{kind}"), format!("physical groups{kind}"));
    let help = if names.is_empty() {
        format!("the mesh has no {several}")
    } else {
        known_names(Noun::new(&one, &several), name, &names)
    };
    let message = if cells_only && grid.node_set(name).is_some() {
        format!("the physical group {} has no cells", quote(name))
    } else {
        format!("the mesh has no physical group {}", quote(name))
    };
    (message, help)
}

/// Checks that all points of a body, and the corners of their domains, lie in cells. Collective: every rank must call
/// this.
pub(crate) fn inside_grid<const D: usize>(
    grid: &dyn Grid<D>,
    body: &str,
    filled: &Filled<D>,
    ranks: &Ranks,
) -> Result<(), Fault> {
    let outside = |x: &[f64; D]| grid.locate(x, None).is_none();
    let mut lost = filled.seeds.iter().filter(|s| outside(&s.position) || s.corners.iter().any(outside));
    let first = lost.next().map(|first| (first.position.to_vec(), outside(&first.position)));
    let count = ranks.count_all(usize::from(first.is_some()) + lost.count());
    let Some((first, is_outside)) = ranks.first(first) else { return Ok(()) };
    let (body, place) = (quote(body), coordinates(&first));
    let all = filled.all;
    let message = match (count, is_outside) {
        (1, true) if all == 1 => {
            format!("the only point of the body {body} lies outside the grid, at {place}")
        }
        (1, true) => format!("1 of the {all} points of the body {body} lies outside the grid, at {place}"),
        (1, false) => {
            format!("the domain of the point of the body {body} at {place} reaches outside the grid")
        }
        (_, true) => format!(
            "{count} of the {all} points of the body {body} lie outside the grid, or their domains reach outside it; \
             the first is the point at {place}"
        ),
        (_, false) => format!(
            "{count} of the {all} points of the body {body} lie outside the grid, or their domains reach outside it; \
             the first is the domain of the point at {place}"
        ),
    };
    let help =
        "move the body, make the grid larger, or cut off the part outside with a `difference`".to_owned();
    Err(Fault { code: "D028", key: "/shape".to_owned(), message, help })
}

/// Finds pairs of bodies that exist at the same time, one of which has points in the region of the other; returns the
/// index of the later body of each pair and a message. All points of a cell must be on one rank. Collective: every rank
/// must call this.
pub(crate) fn overlaps<const D: usize>(
    grid: &dyn Grid<D>,
    deck: &Deck,
    regions: &Regions<D>,
    points: &Points<D>,
) -> Vec<(usize, String)> {
    let bodies = &deck.bodies;
    if bodies.len() < 2 {
        return Vec::new();
    }
    let mut in_cell: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for p in points.by_id() {
        if let Some(cell) = grid.locate(&points.converged.position[p], None) {
            in_cell.entry(cell).or_default().push(p);
        }
    }
    // For each pair of a later and an earlier body that overlap: the number of points of either body in the region of
    // the other, and the cell and position of the first such point.
    let mut found: BTreeMap<(u16, u16), (usize, u32, Vec<f64>)> = BTreeMap::new();
    let in_group = |key: usize, cell: usize| regions.groups.holds(key, cell);
    for (cell, inside) in &in_cell {
        let mut present: Vec<u16> = inside.iter().map(|p| points.body[*p]).collect();
        present.sort_unstable();
        present.dedup();
        if present.len() < 2 {
            continue;
        }
        for &other in &present {
            let region = &regions.bodies[other as usize];
            for &p in inside.iter().filter(|p| points.body[**p] != other) {
                let (body, position) = (points.body[p], &points.converged.position[p]);
                if contains_in_cell(region, grid, position, *cell as usize, in_group) {
                    let pair = (body.max(other), body.min(other));
                    found.entry(pair).or_insert((0, *cell, position.to_vec())).0 += 1;
                }
            }
        }
    }
    let mut gathered = points.ranks.gather_all(found).into_iter();
    let mut found = gathered.next().unwrap_or_default();
    for (pair, (count, cell, place)) in gathered.flatten() {
        let entry = found.entry(pair).or_insert((0, cell, place.clone()));
        entry.0 += count;
        if cell < entry.1 {
            (entry.1, entry.2) = (cell, place);
        }
    }
    let name = |body: u16| quote(&bodies[body as usize].name);
    let message = |((later, earlier), (count, _, place)): ((u16, u16), (usize, u32, Vec<f64>))| {
        let points = match count {
            1 => "1 point of one body lies in the region of the other, at".to_owned(),
            _ => format!("{count} of their points lie in the region of the other body, the first at"),
        };
        let text = format!(
            "the body {} overlaps the body {}: {points} {}",
            name(later),
            name(earlier),
            coordinates(&place)
        );
        (later as usize, text)
    };
    let body = |number: u16| bodies[number as usize].name.as_str();
    found.retain(|(later, earlier), _| deck.meet([body(*later), body(*earlier)]));
    found.into_iter().map(message).collect()
}
