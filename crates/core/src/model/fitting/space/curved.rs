//! Curved faces: domains whose corners lie on them have too small a volume on the outer side, and too large a one on
//! the inner side, so their corners lie a little above or below.

use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::inside::Inside;
use super::lattice::Fitting;
use crate::region::vector::{along, norm};
use crate::region::{BoxTree, around, facet_distance};
use crate::surface::sides_of_domain;

/// Distance from a curved face beyond which domains do not follow it, in cells, [-].
const APART: f64 = 0.25;

impl Fitting<'_> {
    /// Shifts curved faces so that the mean height of the sides of domains on them becomes zero, up to terms of higher
    /// order; false if there are no such faces.
    pub(super) fn shift_curved_faces(&mut self, inside: &Inside) -> bool {
        let mut sums = vec![[0.0; 2]; self.faces.len()];
        for side in self.outer_sides(inside) {
            let places: Vec<[f64; 3]> = side.iter().map(|&corner| self.place(corner)).collect();
            let curved = self.on.get(&side[0]).into_iter().flatten().copied();
            for face in curved.filter(|&face| !self.faces[face as usize].level.is_plane()) {
                if side.iter().all(|&corner| self.height(corner, face) == 0.0) {
                    let (area, height) = self.mean_height(&places, face);
                    sums[face as usize][0] += area * height;
                    sums[face as usize][1] += area;
                }
            }
        }
        let mut has_any = false;
        for (face, [moment, area]) in self.faces.iter_mut().zip(sums) {
            if area > 0.0 {
                face.shift -= moment / area;
                has_any = true;
            }
        }
        has_any
    }

    /// The position on a curved face that is farthest from the outer sides, in cells, if these do not follow it there.
    pub(super) fn farthest(&self, inside: &Inside) -> Option<[f64; 3]> {
        let curved = || self.faces.iter().filter(|face| !face.level.is_plane());
        curved().next()?;
        let place = |&corner: &usize| self.place(corner);
        let facets: Vec<[[f64; 3]; 3]> = (self.outer_sides(inside).iter())
            .map(|side| side.iter().map(place).collect::<Vec<_>>())
            .flat_map(|x| (1..x.len() - 1).map(move |k| [x[0], x[k], x[k + 1]]).collect::<Vec<_>>())
            .collect();
        let boxes: Vec<_> = facets.iter().map(|facet| around(facet)).collect();
        let tree = BoxTree::new(&boxes);
        let distance = |x: &[f64; 3]| {
            let mut least = f64::INFINITY;
            tree.approach(x, f64::INFINITY, |item| {
                least = least.min(facet_distance(&facets[tree.order[item] as usize], x));
                least * least
            });
            least / self.size(x).into_iter().fold(f64::INFINITY, f64::min)
        };
        let middle = |facet: &[[f64; 3]; 3]| -> [f64; 3] {
            std::array::from_fn(|d| facet.iter().map(|x| x[d]).sum::<f64>() / 3.0)
        };
        let places: Vec<[f64; 3]> = curved().flat_map(|face| face.facets.iter().map(middle)).collect();
        let far = places.into_par_iter().map(|x| (distance(&x), x)).filter(|(distance, _)| *distance > APART);
        far.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, x)| x)
    }

    /// The sides of pieces that no other piece shares, as corners in cyclic order.
    fn outer_sides(&self, inside: &Inside) -> Vec<Vec<usize>> {
        let mut found: FxHashMap<Vec<usize>, (usize, Vec<usize>)> = FxHashMap::default();
        for piece in &inside.pieces {
            if !piece.corners.iter().any(|corner| inside.outer.contains(corner)) {
                continue;
            }
            for side in sides_of_domain::<3>(piece.corners.len()) {
                let corners: Vec<usize> = side.corners().iter().map(|&k| piece.corners[k]).collect();
                let mut key = corners.clone();
                key.sort_unstable();
                found.entry(key).or_insert((0, corners)).0 += 1;
            }
        }
        let mut sides: Vec<Vec<usize>> = (found.into_values())
            .filter(|(count, corners)| {
                *count == 1 && corners.iter().all(|corner| inside.outer.contains(corner))
            })
            .map(|(_, corners)| corners)
            .collect();
        sides.sort_unstable();
        sides
    }

    /// The area of a side, [length²], and its mean height above a face that contains its corners, [length], by rules
    /// that are exact for quadratic heights on a triangle and a bilinear quadrilateral.
    fn mean_height(&self, corners: &[[f64; 3]], face: u32) -> (f64, f64) {
        let n = corners.len();
        let height = |x: &[f64; 3]| self.faces[face as usize].height(x).0;
        let area = |a: usize, b: usize| crate::region::area_vector(&[corners[0], corners[a], corners[b]]);
        let middle = |k: usize| -> [f64; 3] {
            let (a, b) = (&corners[k], &corners[(k + 1) % n]);
            std::array::from_fn(|d| 0.5 * (a[d] + b[d]))
        };
        let edges: f64 = (0..n).map(|k| height(&middle(k))).sum();
        if n == 3 {
            return (norm(&area(1, 2)), edges / 3.0);
        }
        let centre = std::array::from_fn(|d| 0.25 * corners.iter().map(|x| x[d]).sum::<f64>());
        (norm(&along(&area(1, 2), 1.0, &area(2, 3))), (4.0 * edges + 16.0 * height(&centre)) / 36.0)
    }
}
