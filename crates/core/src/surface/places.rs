//! Positions that are the same up to round-off.

use std::collections::BTreeMap;

/// Distance within which positions coincide, relative to the size of a cell, [-].
const SAME: f64 = 1e-9;

/// Positions with numbers from 0 on, one for all that coincide.
pub(crate) struct Places<const D: usize> {
    /// Distance within which positions coincide, [length].
    width: f64,
    by_lattice: BTreeMap<[i64; D], u32>,
    positions: Vec<[f64; D]>,
}

impl<const D: usize> Places<D> {
    /// No places; `cell` is the size of a grid cell, [length].
    pub(crate) fn new(cell: f64) -> Self {
        Places { width: SAME * cell, by_lattice: BTreeMap::new(), positions: Vec::new() }
    }

    /// The number of a position, if one that coincides with it has a number.
    pub(crate) fn known(&self, x: &[f64; D]) -> Option<u32> {
        neighbours(self.key(x)).find_map(|key| self.by_lattice.get(&key).copied())
    }

    /// The number of a position, which gets one if it is new.
    pub(crate) fn number(&mut self, x: &[f64; D]) -> u32 {
        self.known(x).unwrap_or_else(|| {
            let number = self.positions.len() as u32;
            self.by_lattice.insert(self.key(x), number);
            self.positions.push(*x);
            number
        })
    }

    /// The first position of each number, [length].
    pub(crate) fn into_positions(self) -> Vec<[f64; D]> {
        self.positions
    }

    fn key(&self, x: &[f64; D]) -> [i64; D] {
        x.map(|x| (x / self.width).round() as i64)
    }
}

/// The lattice cell of a position, then the cells around it.
fn neighbours<const D: usize>(key: [i64; D]) -> impl Iterator<Item = [i64; D]> {
    let around = (0..3usize.pow(D as u32)).map(move |number| {
        std::array::from_fn(|d| key[d].saturating_add((number / 3usize.pow(d as u32) % 3) as i64 - 1))
    });
    std::iter::once(key).chain(around)
}
