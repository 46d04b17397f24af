//! Numbers the corners of triangles: which of them are the same.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::closed;
use super::facets::Facets;
use super::triangle::Triangle;
use crate::region::vector::{minus, norm};
use crate::region::{hull, nothing};

/// Distance within which corners at open edges are the same, relative to the diagonal of the bounds. Ten times the
/// round-off of single precision.
const SAME: f64 = 1e-6;

/// Corners with equal coordinates are one.
pub(super) fn by_equality(triangles: &[Triangle]) -> Facets {
    let mut numbers: HashMap<[u64; 3], u32> = HashMap::new();
    let mut facets = Facets { positions: Vec::new(), corners: Vec::with_capacity(triangles.len()) };
    for triangle in triangles {
        facets.corners.push(triangle.map(|x| {
            // Zero has two signs; the sum has none.
            let x = x.map(|x| x + 0.0);
            *numbers.entry(x.map(f64::to_bits)).or_insert_with(|| {
                facets.positions.push(x);
                (facets.positions.len() - 1) as u32
            })
        }));
    }
    facets
}

/// Merges corners at open edges that are close to each other, each into the first of its neighbourhood. Returns how
/// many vanish.
pub(super) fn by_distance(facets: &mut Facets) -> usize {
    let [low, high] = facets.positions.iter().map(|x| [*x, *x]).fold(nothing(), hull);
    let reach = SAME * norm(&minus(&high, &low));
    let mut same: Vec<u32> = (0..facets.positions.len() as u32).collect();
    // The first corner in every box of a lattice that is as wide as the reach.
    let mut first: HashMap<[i64; 3], u32> = HashMap::new();
    for corner in closed::corners_of_open_edges(&facets.corners) {
        let x = facets.positions[corner as usize];
        let place: [i64; 3] = std::array::from_fn(|d| ((x[d] - low[d]) / reach).floor() as i64);
        let near = neighbours(place)
            .filter_map(|place| first.get(&place))
            .filter(|other| norm(&minus(&facets.positions[**other as usize], &x)) <= reach)
            .min();
        match near {
            Some(&other) => same[corner as usize] = other,
            None => {
                if let Entry::Vacant(place) = first.entry(place) {
                    place.insert(corner);
                }
            }
        }
    }
    for corner in facets.corners.as_flattened_mut() {
        *corner = same[*corner as usize];
    }
    same.iter().enumerate().filter(|(corner, other)| *corner != **other as usize).count()
}

/// A box of a lattice and those around it.
fn neighbours(place: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |k| [place[0] + k % 3 - 1, place[1] + k / 3 % 3 - 1, place[2] + k / 9 - 1])
}
