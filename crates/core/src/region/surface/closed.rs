//! Check that triangles form closed shells.

use super::error::{EdgeReport, SHOWN, SurfaceError};
use super::facets::{FacetEdge, Facets, facet_edges};

/// The connected parts of a surface.
pub(super) struct Shells {
    pub(super) number: usize,
    /// Index of the shell of each facet.
    pub(super) by_facet: Vec<u32>,
}

pub(super) fn edges(facet_edges: &[FacetEdge]) -> impl Iterator<Item = &[FacetEdge]> {
    facet_edges.chunk_by(|a, b| a.0 == b.0)
}

/// True if any edge belongs to one facet only.
pub(super) fn has_open_edges(corners: &[[u32; 3]]) -> bool {
    edges(&facet_edges(corners)).any(|edge| edge.len() == 1)
}

/// Corners of all edges that belong to one facet only, ascending.
pub(super) fn corners_of_open_edges(corners: &[[u32; 3]]) -> Vec<u32> {
    let facet_edges = facet_edges(corners);
    let open = edges(&facet_edges).filter(|edge| edge.len() == 1);
    let mut ends: Vec<u32> = open.flat_map(|edge| edge[0].0).collect();
    ends.sort_unstable();
    ends.dedup();
    ends
}

/// Finds the shells. Returns an error unless every edge has two facets, which run along it in opposite directions.
pub(super) fn shells(facets: &Facets) -> Result<Shells, SurfaceError> {
    let facet_edges = facet_edges(&facets.corners);
    let report = |edge: &[FacetEdge]| EdgeReport {
        facet: facets.number(edge[0].1 as usize),
        facets: edge.len(),
        ends: edge[0].0.map(|corner| facets.positions[corner as usize]),
    };
    let some = |is_wanted: &dyn Fn(usize) -> bool| {
        let all = || edges(&facet_edges).filter(|edge| is_wanted(edge.len()));
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
    for edge in edges(&facet_edges).filter(|edge| edge[0].2 == edge[1].2) {
        edge.iter().for_each(|side| disagreements[side.1 as usize] += 1);
    }
    let worst = (0..disagreements.len()).rev().max_by_key(|&facet| disagreements[facet]).unwrap_or(0);
    match disagreements.get(worst) {
        Some(&n) if n > 0 => Err(SurfaceError::Turned { n, at: facets.report(worst) }),
        _ => Ok(connected(facets.corners.len(), edges(&facet_edges).map(|edge| [edge[0].1, edge[1].1]))),
    }
}

/// Connected parts of the facets, numbered in the order of their first facets.
fn connected(n: usize, pairs: impl Iterator<Item = [u32; 2]>) -> Shells {
    let mut parent: Vec<u32> = (0..n as u32).collect();
    for [a, b] in pairs {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut shells = Shells { number: 0, by_facet: vec![0; n] };
    for facet in 0..n {
        let first = root(&mut parent, facet as u32) as usize;
        if first == facet {
            shells.by_facet[facet] = shells.number as u32;
            shells.number += 1;
        } else {
            shells.by_facet[facet] = shells.by_facet[first];
        }
    }
    shells
}

/// First facet of the connected part that contains `facet`, as far as this part is known (union-find); halves the path
/// for later searches.
fn root(parent: &mut [u32], mut facet: u32) -> u32 {
    while parent[facet as usize] != facet {
        let above = parent[parent[facet as usize] as usize];
        parent[facet as usize] = above;
        facet = above;
    }
    facet
}
