//! Triangles with indexed corners.

use super::error::FacetReport;
use super::triangle::{Triangle, plane_axis};
use crate::region::vector::{minus, norm};

/// How often facets without area are looked for: each pass may leave some whose neighbours it changed.
const PASSES: usize = 100;

/// Triangles with indexed corners.
pub(super) struct Facets {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) corners: Vec<[u32; 3]>,
    /// For each facet, the index of the given triangle of which it is a part.
    pub(super) given: Vec<u32>,
}

impl Facets {
    pub(super) fn triangle(&self, facet: usize) -> Triangle {
        self.corners[facet].map(|corner| self.positions[corner as usize])
    }

    pub(super) fn triangles(&self) -> Vec<Triangle> {
        (0..self.corners.len()).map(|facet| self.triangle(facet)).collect()
    }

    pub(super) fn report(&self, facet: usize) -> FacetReport {
        FacetReport { facet: self.number(facet), corners: self.triangle(facet) }
    }

    /// Number of the given triangle of a facet, from 1.
    pub(super) fn number(&self, facet: usize) -> usize {
        self.given[facet] as usize + 1
    }

    /// The facets whose corners are exactly collinear.
    pub(super) fn flat(&self) -> Vec<usize> {
        (0..self.corners.len()).filter(|&facet| plane_axis(&self.triangle(facet)).is_none()).collect()
    }

    /// Removes the facets without area; returns their number. The facet beyond the longest side of a removed one is
    /// divided at the corner that lies on this side, so that the surface stays closed and keeps its shape exactly.
    pub(super) fn drop_flat(&mut self) -> usize {
        let mut dropped = 0;
        for _ in 0..PASSES {
            let flat = self.flat();
            if flat.is_empty() {
                break;
            }
            let mut is_kept = vec![true; self.corners.len()];
            let mut is_whole = vec![true; self.corners.len()];
            let edges = facet_edges(&self.corners);
            let mut removed = 0;
            for facet in flat {
                let corners = self.corners[facet];
                if !is_whole[facet] {
                    continue;
                }
                if let Some((middle, ends)) = self.longest_side(corners) {
                    let first = edges.partition_point(|edge| edge.0 < ends);
                    let beyond = edges[first..].iter().take_while(|edge| edge.0 == ends);
                    let other = beyond.map(|edge| edge.1 as usize).find(|other| {
                        *other != facet && is_whole[*other] && !self.corners[*other].contains(&middle)
                    });
                    let Some(other) = other else { continue };
                    let [a, b, c] = from_edge(self.corners[other], ends);
                    self.corners[other] = [a, middle, c];
                    self.corners.push([middle, b, c]);
                    self.given.push(self.given[other]);
                    is_whole[other] = false;
                    is_kept.push(true);
                }
                (is_kept[facet], is_whole[facet]) = (false, false);
                removed += 1;
            }
            if removed == 0 {
                break;
            }
            dropped += removed;
            let mut kept = is_kept.iter();
            self.corners.retain(|_| kept.next() == Some(&true));
            let mut kept = is_kept.iter();
            self.given.retain(|_| kept.next() == Some(&true));
        }
        dropped
    }

    /// The corner between the ends of the longest side of a facet without area, and these ends, ascending; `None` if
    /// two corners are equal.
    fn longest_side(&self, corners: [u32; 3]) -> Option<(u32, [u32; 2])> {
        let [a, b, c] = corners;
        if a == b || b == c || a == c {
            return None;
        }
        let length = |k: usize| {
            let [from, to] = [(k + 1) % 3, (k + 2) % 3].map(|k| self.positions[corners[k] as usize]);
            norm(&minus(&to, &from))
        };
        let middle = (0..3).max_by(|a, b| length(*a).total_cmp(&length(*b)))?;
        let (from, to) = (corners[(middle + 1) % 3], corners[(middle + 2) % 3]);
        Some((corners[middle], [from.min(to), from.max(to)]))
    }
}

/// The corners of a facet in their order, the two at the ends of an edge first.
fn from_edge(corners: [u32; 3], ends: [u32; 2]) -> [u32; 3] {
    let apart = (0..3).find(|&k| !ends.contains(&corners[k])).unwrap_or(2);
    [corners[(apart + 1) % 3], corners[(apart + 2) % 3], corners[apart]]
}

/// An edge of a facet: its ends, lower number first; the facet; true if the facet runs along the edge from the lower
/// end to the higher.
pub(super) type FacetEdge = ([u32; 2], u32, bool);

/// The edges of all facets, sorted so that edges with the same ends follow one another.
pub(super) fn facet_edges(corners: &[[u32; 3]]) -> Vec<FacetEdge> {
    let mut facet_edges = Vec::with_capacity(3 * corners.len());
    for (facet, nodes) in corners.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (nodes[k], nodes[(k + 1) % 3]);
            facet_edges.push(([a.min(b), a.max(b)], facet as u32, a < b));
        }
    }
    facet_edges.sort_unstable();
    facet_edges
}
