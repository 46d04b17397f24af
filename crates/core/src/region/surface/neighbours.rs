//! Facets that share edges and corners.

use std::collections::HashMap;

use super::Surface;
use super::closed::edges;
use super::facets::facet_edges;
use super::weld;

/// Which facets of a surface share edges and corners; facets are in tree order.
pub(crate) struct Neighbours {
    /// Number of each corner of each facet. A corner at which several sheets of the surface touch has one number for
    /// each sheet.
    pub(crate) corners: Vec<[u32; 3]>,
    /// How many corners there are.
    pub(crate) number: usize,
    /// For each facet, its neighbour across the edge from corner k to corner k + 1.
    pub(crate) beyond: Vec<[u32; 3]>,
    /// True for the corners at which several sheets touch.
    pub(crate) touching: Vec<bool>,
}

impl Surface {
    /// Finds the neighbours of all facets.
    pub(crate) fn neighbours(&self) -> Neighbours {
        let places = weld::by_equality(&self.triangles).corners;
        let edge_of = |facet: u32, ends: [u32; 2]| {
            let at = |k: usize| places[facet as usize][k % 3];
            (0..3).find(|&k| [at(k).min(at(k + 1)), at(k).max(at(k + 1))] == ends).unwrap_or(0)
        };
        let mut beyond = vec![[0; 3]; places.len()];
        for edge in edges(&facet_edges(&places)) {
            if let [(ends, a, _), (_, b, _)] = *edge {
                beyond[a as usize][edge_of(a, ends)] = b;
                beyond[b as usize][edge_of(b, ends)] = a;
            }
        }
        let mut found = Neighbours {
            corners: vec![[u32::MAX; 3]; places.len()],
            number: 0,
            beyond,
            touching: Vec::new(),
        };
        let mut first_at: HashMap<u32, u32> = HashMap::new();
        for (facet, k) in (0..places.len()).flat_map(|facet| (0..3).map(move |k| (facet, k))) {
            if found.corners[facet][k] == u32::MAX {
                found.number_sheet(&places, facet, k);
                let number = (found.number - 1) as u32;
                let first = *first_at.entry(places[facet][k]).or_insert(number);
                found.touching.push(first != number);
                found.touching[first as usize] |= first != number;
            }
        }
        found
    }
}

impl Neighbours {
    /// Numbers a corner in all facets of its sheet, walking around it from facet to facet.
    fn number_sheet(&mut self, places: &[[u32; 3]], start: usize, k: usize) {
        let place = places[start][k];
        let mut facet = start;
        let unnumbered = |corners: &[[u32; 3]], facet: usize| {
            (0..3).find(|&k| places[facet][k] == place && corners[facet][k] == u32::MAX)
        };
        while let Some(k) = unnumbered(&self.corners, facet) {
            self.corners[facet][k] = self.number as u32;
            // Leave by the edge that ends at the corner.
            facet = self.beyond[facet][(k + 2) % 3] as usize;
        }
        self.number += 1;
    }
}
