//! The corners that domains of this rank may share with those of other ranks.

use super::candidates::{Near, Search};
use super::key::{CENTRE, FACE};
use super::ranks::{Plain, exchange_at_nodes, place_of};
use super::search::Found;

/// The corner of a domain near a tool, as one rank sends it to others, with the position of the cell of its material
/// point in the order of the grid.
struct Corner<const D: usize> {
    order: u32,
    near: Near<D>,
}

impl<const D: usize> Plain for Corner<D> {
    /// The material point and those that share the corner mean nothing on another rank.
    fn encode(&self, numbers: &mut Vec<f64>) {
        let Near {
            p: _,
            body,
            key,
            start,
            size,
            closest,
            is_flat,
            keeps_face,
            area,
            area_of_corner,
            outer,
            ..
        } = &self.near;
        (self.order, *body, *key).encode(numbers);
        (*start, *size, *closest).encode(numbers);
        (*is_flat, *keeps_face, *outer).encode(numbers);
        (*area, *area_of_corner).encode(numbers);
    }

    fn decode(numbers: &mut impl Iterator<Item = f64>) -> Option<Self> {
        let (order, body, key) = Plain::decode(numbers)?;
        let (start, size, closest) = Plain::decode(numbers)?;
        let (is_flat, keeps_face, outer) = Plain::decode(numbers)?;
        let (area, area_of_corner) = Plain::decode(numbers)?;
        let shared_by = Vec::new();
        let near = Near {
            p: None,
            body,
            key,
            start,
            size,
            closest,
            is_flat,
            keeps_face,
            area,
            area_of_corner,
            outer,
            shared_by,
        };
        Some(Corner { order, near })
    }
}

impl<const D: usize> Search<'_, D> {
    /// Position of the cell of a material point in the order of the grid.
    fn order(&self, p: usize) -> u32 {
        let cell = self.points.cell[p];
        self.model.grid.patches().map_or(cell, |patches| patches.rank_of[cell as usize])
    }

    /// Adds the corners on other ranks that domains of this rank may share, and moves all contact points into the first
    /// piece, in the order of the grid; without other ranks, changes nothing. `is_shared` tells whether the domains of a
    /// body share corners.
    pub(super) fn add_neighbours(&self, pieces: &mut Vec<Found<D>>, is_shared: impl Fn(usize) -> bool) {
        let reduction = self.links.reduction();
        if reduction.is_alone() {
            return;
        }
        let mut places: Vec<(u32, Near<D>)> = Vec::new();
        for place in pieces.iter_mut().flat_map(|found| found.places.drain(..)) {
            places.push((place.p.map_or(0, |p| self.order(p)), place));
        }
        let corners =
            places.iter().filter(|(_, place)| is_shared(place.body) && place.key.corner % FACE < CENTRE);
        let near = |shared: &[u32]| -> Vec<Corner<D>> {
            let is_near = |(_, place): &&(u32, Near<D>)| self.touches_one_of(place, shared);
            let near = corners.clone().filter(is_near);
            near.map(|(order, near)| Corner { order: *order, near: near.clone() }).collect()
        };
        let received = exchange_at_nodes(reduction, near).into_iter().flat_map(|(_, corners)| corners);
        places.extend(received.map(|corner| (corner.order, corner.near)));
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
