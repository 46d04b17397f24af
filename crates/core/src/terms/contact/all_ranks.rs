//! Contact of bodies whose points are divided between ranks.
//!
//! Each rank treats the contact points of its own material points. A corner shared by domains on several ranks belongs
//! to the rank whose domain comes first in the order of the grid: the ranks send each other the corners near shared
//! nodes, and all join them in the same way. All ranks know the data that contact points keep from step to step,
//! because material points migrate. All ranks decide together about errors and multipliers.

use super::candidates::{CENTRE, Key, Near, Search};
use super::plain::{Plain, exchange};
use super::search::Found;
use crate::ranks::Reduction;
use crate::tool::Closest;

/// The index of an active node among those that this rank shares with another rank; the same on both.
pub(super) fn place_of(shared: &[u32], node: usize) -> Option<usize> {
    shared.binary_search(&(node as u32)).ok()
}

/// The corner of a domain near a tool, as one rank sends it to others.
#[derive(Debug, Clone, Copy)]
struct Corner<const D: usize> {
    /// Position of the cell of its material point in the order of the grid.
    order: u32,
    key: Key,
    body: usize,
    start: [f64; D],
    size: f64,
    closest: Closest<D>,
    is_flat: bool,
    area: f64,
    area_of_corner: f64,
}

impl<const D: usize> Plain for Corner<D> {
    fn encode(&self, numbers: &mut Vec<f64>) {
        ((self.order, self.key, self.body), (self.start, self.size, self.closest)).encode(numbers);
        (self.is_flat, self.area, self.area_of_corner).encode(numbers);
    }

    fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let ((order, key, body), (start, size, closest)) = Plain::decode(numbers)?;
        let (is_flat, area, area_of_corner) = Plain::decode(numbers)?;
        Some(Corner { order, key, body, start, size, closest, is_flat, area, area_of_corner })
    }
}

impl<const D: usize> Search<'_, D> {
    /// Position of the cell of a material point in the order of the grid.
    fn order(&self, p: usize) -> u32 {
        let cell = self.points.cell[p];
        self.model.grid.patches().map_or(cell, |patches| patches.rank_of[cell as usize])
    }

    /// Adds the corners on other ranks that domains of this rank may share, and moves all contact points into the first
    /// piece, in the order of the grid. `is_shared` tells whether the domains of a body share corners.
    pub(super) fn add_others(&self, pieces: &mut Vec<Found<D>>, is_shared: impl Fn(usize) -> bool) {
        let mut places: Vec<(u32, Near<D>)> = Vec::new();
        for place in pieces.iter_mut().flat_map(|found| found.places.drain(..)) {
            places.push((place.p.map_or(0, |p| self.order(p)), place));
        }
        let halo = self.links.halo();
        let mut messages: Vec<(usize, Vec<Corner<D>>)> = Vec::new();
        let corners = places.iter().filter(|(_, place)| is_shared(place.body) && place.key.corner != CENTRE);
        for (rank, shared) in halo.neighbours() {
            let is_near = |(_, place): &&(u32, Near<D>)| self.touches_one_of(place, shared);
            let near: Vec<Corner<D>> = corners.clone().filter(is_near).map(to_send).collect();
            if !near.is_empty() {
                messages.push((rank, near));
            }
        }
        let received = exchange(halo.ranks(), messages).into_iter().flat_map(|(_, corners)| corners);
        places.extend(received.map(|corner| (corner.order, remote(corner))));
        // All points of a cell are on one rank, and the stable sort keeps their order.
        places.sort_by_key(|(order, _)| *order);
        if pieces.is_empty() {
            pieces.push(Found::default());
        }
        pieces[0].places.extend(places.into_iter().map(|(_, place)| place));
    }

    /// True if the cell that holds a contact point has one of these active nodes, given in ascending order. Domains
    /// that share a corner touch the same nodes of its cell.
    fn touches_one_of(&self, place: &Near<D>, shared: &[u32]) -> bool {
        let grid = self.model.grid.as_ref();
        let hint = place.p.map(|p| self.points.cell[p]);
        let Some(cell) = grid.locate(&place.start, hint) else { return false };
        let corners = grid.corners(cell as usize);
        let mut active = corners.nodes().iter().flat_map(|node| self.links.copies(*node as usize));
        active.any(|node| place_of(shared, node).is_some())
    }
}

/// A corner as it is sent to other ranks.
fn to_send<const D: usize>((order, place): &(u32, Near<D>)) -> Corner<D> {
    let Near { body, key, start, size, closest, is_flat, area, area_of_corner, .. } = *place;
    Corner { order: *order, key, body, start, size, closest, is_flat, area, area_of_corner }
}

/// A corner received from another rank.
fn remote<const D: usize>(corner: Corner<D>) -> Near<D> {
    let Corner { order: _, key, body, start, size, closest, is_flat, area, area_of_corner } = corner;
    Near { p: None, body, key, start, size, closest, is_flat, area, area_of_corner, shared_by: Vec::new() }
}

/// A tool and a node, with a sum of vectors and a sum of weights there.
type AtNode<const D: usize> = ((u32, usize), ([f64; D], f64));

/// Adds the contributions of other ranks to sums at nodes of this rank. A sum belongs to a tool and an active node, for
/// which `place` returns the index of the sum if this rank has it.
pub(super) fn add_others<const D: usize>(
    reduction: &Reduction,
    sums: &mut [([f64; D], f64)],
    pairs: &[(u32, usize)],
    place: impl Fn(u32, usize) -> Option<usize>,
) {
    let halo = reduction.halo();
    let mut messages = Vec::new();
    for (rank, shared) in halo.neighbours() {
        let shares: Vec<AtNode<D>> = (pairs.iter().zip(&*sums))
            .filter_map(|((tool, node), sum)| Some(((*tool, place_of(shared, *node)?), *sum)))
            .collect();
        if !shares.is_empty() {
            messages.push((rank, shares));
        }
    }
    for (rank, shares) in exchange(halo.ranks(), messages) {
        let Some((_, shared)) = halo.neighbours().find(|(neighbour, _)| *neighbour == rank) else { continue };
        for ((tool, k), (vector, weight)) in shares {
            let node = shared.get(k).map(|node| *node as usize);
            if let Some(place) = node.and_then(|node| place(tool, node)) {
                let (sum, total) = &mut sums[place];
                (0..D).for_each(|d| sum[d] += vector[d]);
                *total += weight;
            }
        }
    }
}
