//! Whether triangles fit together to closed shells.

use super::error::{EdgeReport, SHOWN, SurfaceError};
use super::facets::Facets;

/// The connected parts of a surface.
pub(super) struct Shells {
    pub(super) number: usize,
    /// The shell of each facet.
    pub(super) of_facet: Vec<u32>,
}

/// One side of a facet: its ends, lower number first; its facet; whether the facet goes round from the lower end.
type Side = ([u32; 2], u32, bool);

/// The sides of all facets, those with the same ends next to each other.
fn sides(corners: &[[u32; 3]]) -> Vec<Side> {
    let mut sides = Vec::with_capacity(3 * corners.len());
    for (facet, nodes) in corners.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (nodes[k], nodes[(k + 1) % 3]);
            sides.push(([a.min(b), a.max(b)], facet as u32, a < b));
        }
    }
    sides.sort_unstable();
    sides
}

fn edges(sides: &[Side]) -> impl Iterator<Item = &[Side]> {
    sides.chunk_by(|a, b| a.0 == b.0)
}

/// Whether there is an edge with one facet only.
pub(super) fn has_open_edges(corners: &[[u32; 3]]) -> bool {
    edges(&sides(corners)).any(|edge| edge.len() == 1)
}

/// Ends of the edges that have one facet only, ascending.
pub(super) fn corners_of_open_edges(corners: &[[u32; 3]]) -> Vec<u32> {
    let sides = sides(corners);
    let open = edges(&sides).filter(|edge| edge.len() == 1);
    let mut ends: Vec<u32> = open.flat_map(|edge| edge[0].0).collect();
    ends.sort_unstable();
    ends.dedup();
    ends
}

/// The shells, when every edge has two facets that go along it in opposite directions.
pub(super) fn shells(facets: &Facets) -> Result<Shells, SurfaceError> {
    let sides = sides(&facets.corners);
    let report = |edge: &[Side]| EdgeReport {
        facet: edge[0].1 as usize + 1,
        facets: edge.len(),
        ends: edge[0].0.map(|corner| facets.positions[corner as usize]),
    };
    let some = |of_interest: &dyn Fn(usize) -> bool| {
        let all = || edges(&sides).filter(|edge| of_interest(edge.len()));
        (all().count(), all().take(SHOWN).map(report).collect::<Vec<_>>())
    };
    let (n, first) = some(&|facets| facets == 1);
    if n > 0 {
        return Err(SurfaceError::Open { n, first });
    }
    let (n, first) = some(&|facets| facets > 2);
    if n > 0 {
        return Err(SurfaceError::Branched { n, first });
    }
    let mut disagreements = vec![0usize; facets.corners.len()];
    for edge in edges(&sides).filter(|edge| edge[0].2 == edge[1].2) {
        edge.iter().for_each(|side| disagreements[side.1 as usize] += 1);
    }
    let worst = (0..disagreements.len()).rev().max_by_key(|&facet| disagreements[facet]).unwrap_or(0);
    match disagreements.get(worst) {
        Some(&n) if n > 0 => Err(SurfaceError::Turned { n, at: facets.report(worst) }),
        _ => Ok(connected(facets.corners.len(), edges(&sides).map(|edge| [edge[0].1, edge[1].1]))),
    }
}

/// Connected parts of facets, numbered by their first facets.
fn connected(n: usize, pairs: impl Iterator<Item = [u32; 2]>) -> Shells {
    let mut parent: Vec<u32> = (0..n as u32).collect();
    for [a, b] in pairs {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut shells = Shells { number: 0, of_facet: vec![0; n] };
    for facet in 0..n {
        let first = root(&mut parent, facet as u32) as usize;
        if first == facet {
            shells.of_facet[facet] = shells.number as u32;
            shells.number += 1;
        } else {
            shells.of_facet[facet] = shells.of_facet[first];
        }
    }
    shells
}

/// The first facet of the part known so far; halves the way for the next search.
fn root(parent: &mut [u32], mut facet: u32) -> u32 {
    while parent[facet as usize] != facet {
        let above = parent[parent[facet as usize] as usize];
        parent[facet as usize] = above;
        facet = above;
    }
    facet
}
