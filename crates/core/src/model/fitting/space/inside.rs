//! The pieces of cells inside the region, which become its domains.

use rustc_hash::FxHashSet;

use super::domain::{NotFitted, SolidDomain, SolidDomains};
use super::lattice::Fitting;
use super::pieces::{Divided, Piece};
use crate::basis::domain_volume;

/// The pieces inside a region, and the corners on its boundary.
pub(super) struct Inside {
    pub pieces: Vec<Piece>,
    pub outer: FxHashSet<usize>,
}

impl Fitting<'_> {
    /// The pieces inside the region, in the order of cells.
    pub(super) fn inside(&self, divided: Divided) -> Inside {
        let is_inside = |corners: &[usize]| {
            let n = corners.len() as f64;
            let places: Vec<[f64; 3]> = corners.iter().map(|&k| self.place(k)).collect();
            self.region.contains(&std::array::from_fn(|d| places.iter().map(|x| x[d]).sum::<f64>() / n))
        };
        let whole = (0..self.n.iter().product()).filter(|cell| !divided.cells.contains(cell));
        let whole = whole.map(|cell| Piece { cell, corners: self.corners_of(cell).to_vec() });
        let (whole, without): (Vec<Piece>, Vec<Piece>) = whole.partition(|piece| is_inside(&piece.corners));
        let (pieces, cut_off): (Vec<Piece>, Vec<Piece>) =
            divided.pieces.into_iter().partition(|piece| is_inside(&piece.corners));
        let mut outer = divided.outside;
        outer.extend(without.into_iter().chain(cut_off).flat_map(|piece| piece.corners));
        let fixed: FxHashSet<usize> = whole.iter().flat_map(|piece| piece.corners.iter().copied()).collect();
        let mut moved = Vec::new();
        let pieces = self.without_flat_pieces(pieces, &fixed, &mut moved);
        for [from, to] in moved {
            if outer.contains(&from) {
                outer.insert(to);
            }
        }
        let mut pieces: Vec<Piece> = whole.into_iter().chain(pieces).collect();
        pieces.sort_by_key(|piece| piece.cell);
        Inside { pieces, outer }
    }

    /// The domains of the pieces inside the region.
    pub(super) fn domains(&self, inside: &Inside) -> Result<SolidDomains, NotFitted> {
        let outer = &inside.outer;
        let is_at_end = |corner: usize| {
            corner < self.lattice_corners() && {
                let index = self.corner_index(corner);
                (0..3).any(|d| index[d] == 0 || index[d] == self.n[d])
            }
        };
        let domain = |piece: &Piece| {
            let is_outer = piece.corners.iter().any(|&k| outer.contains(&k) || is_at_end(k));
            let corners: Vec<[f64; 3]> = piece.corners.iter().map(|&k| self.place(k)).collect();
            if domain_volume(&corners) > 0.0 {
                Ok(SolidDomain { corners, is_outer })
            } else {
                Err(NotFitted::At(corners[0]))
            }
        };
        let domains = inside.pieces.iter().map(domain).collect::<Result<_, _>>()?;
        Ok(SolidDomains { domains, apart: self.farthest(inside) })
    }
}
