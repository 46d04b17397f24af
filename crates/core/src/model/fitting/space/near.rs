//! The faces near the cells of the lattice.

use std::cell::Cell;

use rustc_hash::FxHashSet;

use super::lattice::{Fitting, ON_FACE};
use crate::region::vector::{dot, minus, norm};
use crate::region::{around, boxes_overlap};
use crate::surface::sides_of_domain;

/// Distance from a facet of a curved face within which a cell is at the face, in cells, [-].
const AT_FACE: f64 = 0.05;
/// Distance from its facets within which a position on the surface of a face belongs to the face, in cells, [-].
const ASIDE: f64 = 0.1;

impl Fitting<'_> {
    /// Records for each cell the faces that come near it.
    pub(super) fn find_cells_at_faces(&mut self) {
        let mut marked: FxHashSet<(usize, u32)> = FxHashSet::default();
        for (number, face) in self.faces.iter().enumerate() {
            for facet in &face.facets {
                let [low, high] = around(facet);
                let range = |d: usize| {
                    let [low, high] = [low[d], high[d]].map(|x| self.local(d, x));
                    let most = self.n[d] as f64;
                    let from = (low - AT_FACE).floor().clamp(0.0, most) as usize;
                    from..((high + AT_FACE).floor() + 1.0).clamp(0.0, most) as usize
                };
                for k in range(2) {
                    for j in range(1) {
                        for i in range(0) {
                            marked.insert((self.cell([i, j, k]), number as u32));
                        }
                    }
                }
            }
        }
        let mut marked: Vec<_> = marked.into_iter().collect();
        marked.sort_unstable();
        for (cell, number) in marked {
            self.near.entry(cell).or_default().push(number);
        }
    }

    /// Finds the faces in each cell anew, now that its corners have moved: those of the cells around it of which a
    /// facet lies on the inner side of all its sides.
    pub(super) fn find_faces_in_cells(&mut self) {
        let mut cells: Vec<usize> = (self.near.keys().copied())
            .flat_map(|cell| self.corners_of(cell))
            .flat_map(|corner| self.cells_around(corner))
            .collect();
        cells.sort_unstable();
        cells.dedup();
        let found = |&cell: &usize| {
            let around = self.corners_of(cell).into_iter().flat_map(|corner| self.cells_around(corner));
            let mut faces: Vec<u32> =
                around.filter_map(|cell| self.near.get(&cell)).flatten().copied().collect();
            faces.sort_unstable();
            faces.dedup();
            faces.retain(|&face| self.is_in(face, &self.corners_of(cell)));
            (cell, faces)
        };
        self.near = cells.iter().map(found).filter(|(_, faces)| !faces.is_empty()).collect();
    }

    /// True if a facet of a face may come into a piece between these corners.
    pub(super) fn is_in(&self, face: u32, corners: &[usize]) -> bool {
        let places: Vec<[f64; 3]> = corners.iter().map(|&corner| self.place(corner)).collect();
        let size = self.size(&places[0]).into_iter().fold(f64::INFINITY, f64::min);
        // Facets of curved faces are chords.
        let is_plane = self.faces[face as usize].level.is_plane();
        let slack = if is_plane { ON_FACE } else { AT_FACE } * size;
        let planes: Vec<([f64; 3], [f64; 3], f64)> = (sides_of_domain::<3>(places.len()))
            .map(|side| {
                let (centre, area) = (side.centre(&places), side.area(&places));
                let length = norm(&area);
                let normal = area.map(|a| a / length);
                // Sides of hexahedra bulge.
                let above = |&k: &usize| dot(&minus(&places[k], &centre), &normal);
                (centre, normal, side.corners().iter().map(above).fold(slack, f64::max))
            })
            .collect();
        let [low, high] = around(&places);
        let wide = [low.map(|x| x - slack), high.map(|x| x + slack)];
        let face = &self.faces[face as usize];
        let found = Cell::new(false);
        face.tree.visit(
            |bounds| !found.get() && boxes_overlap(bounds, &wide),
            |item| {
                let facet = &face.facets[item];
                let is_beyond = |(centre, normal, height): &([f64; 3], [f64; 3], f64)| {
                    facet.iter().all(|x| dot(&minus(x, centre), normal) >= *height)
                };
                if boxes_overlap(&around(facet), &wide) && !planes.iter().any(is_beyond) {
                    found.set(true);
                }
            },
        );
        found.get()
    }

    /// True if a position on the surfaces of faces belongs to all of them.
    pub(super) fn is_at(&self, x: &[f64; 3], faces: &[u32]) -> bool {
        let least = self.size(x).into_iter().fold(f64::INFINITY, f64::min);
        faces.iter().all(|&face| self.faces[face as usize].is_near(x, ASIDE * least))
    }
}
