//! Moves corners of the lattice onto faces.

use super::lattice::Fitting;
use crate::grid::element::corner_side;
use crate::region::vector::norm;
use crate::tensor::Mat3;

/// Distance from a face within which a corner moves onto it, along the axis that crosses it most directly, in cells,
/// [-].
const NEAR: f64 = 0.5;
/// Largest distance by which a corner moves onto a face, an edge, and a corner of the region, in cells, [-].
const FARTHEST: [f64; 3] = [0.51, 0.75, 0.9];
/// Smallest determinant of the Jacobian at a corner of a cell with moved corners, relative to that of the cell, [-].
const FLATTEST: f64 = 0.15;
/// Largest number of faces at a corner that are tried together.
const MOST_FACES: usize = 6;

/// A corner and the faces onto which it may move.
struct Candidate {
    corner: usize,
    faces: Vec<u32>,
    place: [f64; 3],
    /// By how much it would move, in cells.
    distance: f64,
}

impl Fitting<'_> {
    /// Moves corners of the lattice onto corners, edges and faces of the region, in this order, the nearest first.
    pub(super) fn warp(&mut self) {
        let mut corners: Vec<usize> = self.near.keys().flat_map(|&cell| self.corners_of(cell)).collect();
        corners.sort_unstable();
        corners.dedup();
        let mut candidates: Vec<Candidate> =
            corners.into_iter().flat_map(|corner| self.candidates(corner)).collect();
        candidates.sort_by(|a, b| {
            let by_size = b.faces.len().cmp(&a.faces.len());
            by_size.then(a.distance.total_cmp(&b.distance)).then(a.corner.cmp(&b.corner))
        });
        for Candidate { corner, faces, place, .. } in candidates {
            if self.on.contains_key(&corner) || self.kept.contains(&corner) {
                continue;
            }
            let before = self.moved.insert(corner, place);
            if self.cells_around(corner).all(|cell| self.is_valid(cell)) {
                self.on.insert(corner, faces);
            } else if let Some(before) = before {
                self.moved.insert(corner, before);
            } else {
                self.moved.remove(&corner);
            }
        }
    }

    /// The faces near a corner of the lattice, in groups of three, two and one, with its place on them.
    fn candidates(&self, corner: usize) -> Vec<Candidate> {
        let x = self.place(corner);
        let index = self.corner_index(corner);
        let size = self.lines.sides_around(std::array::from_fn(|d| self.first[d] + index[d]));
        let fixed = self.is_at_end(corner);
        let mut faces: Vec<u32> =
            self.cells_around(corner).filter_map(|cell| self.near.get(&cell)).flatten().copied().collect();
        faces.sort_unstable();
        faces.dedup();
        let mut close: Vec<(f64, u32)> = (faces.into_iter())
            .filter_map(|face| {
                let (height, gradient) = self.faces[face as usize].height(&x);
                let steepest = (0..3).map(|d| (gradient[d] * size[d]).abs()).fold(0.0, f64::max);
                let t = height.abs() / steepest;
                (t <= NEAR + 1e-9).then_some((t, face))
            })
            .collect();
        close.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        close.truncate(MOST_FACES);
        let close: Vec<u32> = close.into_iter().map(|(_, face)| face).collect();
        let mut found = Vec::new();
        for faces in groups(&close) {
            let Some(place) = self.projected(&x, &faces, &size, &fixed) else { continue };
            let distance = norm::<3>(&std::array::from_fn(|d| (place[d] - x[d]) / size[d]));
            if distance <= FARTHEST[faces.len() - 1] && self.is_at(&place, &faces) {
                found.push(Candidate { corner, faces, place, distance });
            }
        }
        found
    }

    /// For each axis, true if a corner lies at an end of the lattice, which it must not leave.
    fn is_at_end(&self, corner: usize) -> [bool; 3] {
        let index = self.corner_index(corner);
        std::array::from_fn(|d| {
            let line = self.first[d] + index[d];
            line == 0 || line == self.lines.axes()[d].n_cells()
        })
    }

    /// True if no corner of a cell is too flat.
    fn is_valid(&self, cell: usize) -> bool {
        let corners = self.corners_of(cell);
        let size = self.size_of_cell(cell);
        (0..8).all(|k| {
            let arms = self.arms(corners[k], [0, 1, 2].map(|d| corners[k ^ 1 << d]), &size);
            let sign: f64 = corner_side::<3>(k).iter().product();
            let matrix = Mat3::from_fn(|i, j| arms[j][i]);
            -sign * matrix.determinant() >= FLATTEST
        })
    }
}

/// All groups of three, two and one of some faces.
pub(super) fn groups(faces: &[u32]) -> Vec<Vec<u32>> {
    let mut groups = Vec::new();
    for (i, &a) in faces.iter().enumerate() {
        groups.push(vec![a]);
        for (j, &b) in faces.iter().enumerate().skip(i + 1) {
            groups.push(vec![a, b]);
            groups.extend(faces[j + 1..].iter().map(|&c| vec![a, b, c]));
        }
    }
    groups.sort_by_key(|group| std::cmp::Reverse(group.len()));
    groups
}
