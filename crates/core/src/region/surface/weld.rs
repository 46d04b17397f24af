//! Merging of equal and nearly equal corners.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::closed;
use super::facets::Facets;
use super::triangle::Triangle;
use crate::region::boundary::indexed;
use crate::region::vector::{minus, norm};
use crate::region::{hull, nothing};

/// Distance within which corners at open edges are merged, relative to the diagonal of the bounds: ten times the
/// round-off of single precision.
pub(super) const SAME: f64 = 1e-6;

/// Indexes the corners; corners with equal coordinates count as one corner.
pub(super) fn by_equality(triangles: &[Triangle]) -> Facets {
    let (positions, corners) = indexed(triangles);
    Facets { positions, given: (0..corners.len() as u32).collect(), corners }
}

/// Merges corners that lie at open edges and are close to each other, each into the first corner in its neighbourhood.
/// Returns the number of corners removed.
pub(super) fn by_distance(facets: &mut Facets) -> usize {
    let [low, high] = facets.positions.iter().map(|x| [*x, *x]).fold(nothing(), hull);
    let reach = SAME * norm(&minus(&high, &low));
    let mut same: Vec<u32> = (0..facets.positions.len() as u32).collect();
    // The first corner in each cell of a lattice whose cell size is the merging distance.
    let mut first: HashMap<[i64; 3], u32> = HashMap::new();
    for corner in closed::corners_of_open_edges(&facets.corners) {
        let x = facets.positions[corner as usize];
        let cell: [i64; 3] = std::array::from_fn(|d| ((x[d] - low[d]) / reach).floor() as i64);
        let near = neighbours(cell)
            .filter_map(|cell| first.get(&cell))
            .filter(|other| norm(&minus(&facets.positions[**other as usize], &x)) <= reach)
            .min();
        match near {
            Some(&other) => same[corner as usize] = other,
            None => {
                if let Entry::Vacant(entry) = first.entry(cell) {
                    entry.insert(corner);
                }
            }
        }
    }
    for corner in facets.corners.as_flattened_mut() {
        *corner = same[*corner as usize];
    }
    same.iter().enumerate().filter(|(corner, other)| *corner != **other as usize).count()
}

/// A cell of a lattice and its neighbours.
fn neighbours(cell: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |k| [cell[0] + k % 3 - 1, cell[1] + k / 3 % 3 - 1, cell[2] + k / 9 - 1])
}
