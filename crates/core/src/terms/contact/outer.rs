//! The outer sides of domains at the corners that may touch a tool.

use crate::region::vector::norm;

/// The outer sides of a domain that meet at a corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Outer<const D: usize> {
    /// A bit for each of them.
    pub(super) sides: u32,
    /// A bit for each of them that faces the tool.
    pub(super) facing: u32,
    /// Their number, and their outward unit normals.
    pub(super) count: usize,
    pub(super) normals: [[f64; D]; D],
}

impl<const D: usize> Default for Outer<D> {
    fn default() -> Self {
        Outer { sides: 0, facing: 0, count: 0, normals: [[0.0; D]; D] }
    }
}

impl<const D: usize> Outer<D> {
    /// The outward unit normals of these sides.
    pub(super) fn normals(&self) -> &[[f64; D]] {
        &self.normals[..self.count.min(D)]
    }

    /// Adds the side with this number and this area vector, [length^(D−1)]; `faces` tells whether it faces the tool.
    pub(super) fn add(&mut self, side: usize, faces: bool, area: &[f64; D]) {
        self.sides |= 1 << side;
        self.facing |= u32::from(faces) << side;
        let size = norm(area);
        if self.count < D && size > 0.0 {
            self.normals[self.count] = area.map(|a| a / size);
            self.count += 1;
        }
    }

    /// True if the corner belongs to an outer side.
    pub(super) fn has_any(&self) -> bool {
        self.sides != 0
    }

    /// Joins this corner with the same corner of another domain.
    pub(super) fn join(&mut self, other: &Self) {
        self.sides |= other.sides;
        self.facing |= other.facing;
    }

    /// True if the outer side with this number has this corner and faces the tool.
    pub(super) fn faces(&self, side: usize) -> bool {
        self.facing >> side & 1 == 1
    }
}
