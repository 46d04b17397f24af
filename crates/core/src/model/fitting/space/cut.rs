//! Cuts tetrahedra along faces.
//!
//! Every edge that a face crosses gets a corner there, and all tetrahedra around it are halved. Edges are halved in an
//! order of their own, so that the tetrahedra on both sides of a triangle divide it in the same way.

use rustc_hash::{FxHashMap, FxHashSet};

use super::lattice::Fitting;
use super::pieces::{Heights, Piece};
use crate::region::vector::{minus, norm};
use crate::tensor::Mat3;

/// Volume of a tetrahedron with corners moved onto a curved face below which they move back, relative to its cell, [-].
const FLATTEST: f64 = 1e-6;

/// A corner on an edge, with the position on the straight edge, [length].
struct Halved {
    corner: usize,
    straight: [f64; 3],
}

/// The edges of a tetrahedron.
const EDGES: [[usize; 2]; 6] = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]];

impl Fitting<'_> {
    /// Cuts the tetrahedra among some pieces along the faces near their cells; the others are crossed by none.
    pub(super) fn cut(&mut self, pieces: &mut Vec<Piece>) {
        let cells: FxHashSet<usize> = pieces.iter().map(|piece| piece.cell).collect();
        let mut faces: Vec<u32> =
            cells.iter().filter_map(|cell| self.near.get(cell)).flatten().copied().collect();
        faces.sort_unstable();
        faces.dedup();
        for face in faces {
            let halved = self.halved_edges(pieces, face);
            if halved.is_empty() {
                continue;
            }
            let mut all = Vec::with_capacity(pieces.len());
            for piece in pieces.drain(..) {
                self.halve(piece, &halved, &mut all);
            }
            *pieces = all;
            self.straighten(pieces, &halved);
        }
    }

    /// Places corners where a face crosses edges of tetrahedra in the cells near it.
    fn halved_edges(&mut self, pieces: &[Piece], face: u32) -> FxHashMap<[usize; 2], Halved> {
        let mut heights: Heights = FxHashMap::default();
        let mut halved = FxHashMap::default();
        for piece in pieces.iter().filter(|piece| piece.corners.len() == 4) {
            let is_near = self.near.get(&piece.cell).is_some_and(|faces| faces.contains(&face));
            if !is_near || !self.is_in(face, &piece.corners) {
                continue;
            }
            let heights: [f64; 4] = std::array::from_fn(|k| {
                let corner = piece.corners[k];
                *heights.entry(corner).or_insert_with(|| self.height(corner, face))
            });
            for [i, j] in EDGES {
                if heights[i] * heights[j] >= 0.0 {
                    continue;
                }
                let [a, b] = [i, j].map(|k| (piece.corners[k], heights[k]));
                let [(a, at_a), (b, at_b)] = if a.0 < b.0 { [a, b] } else { [b, a] };
                halved
                    .entry([a, b])
                    .or_insert_with(|| self.corner_between([a, b], at_a / (at_a - at_b), face));
            }
        }
        halved
    }

    /// A new corner on a face where it crosses an edge, given as a fraction of the edge.
    fn corner_between(&mut self, ends: [usize; 2], t: f64, face: u32) -> Halved {
        let [x, y] = ends.map(|corner| self.place(corner));
        let straight: [f64; 3] = std::array::from_fn(|d| x[d] + t * (y[d] - x[d]));
        let none = Vec::new();
        let [on_a, on_b] = ends.map(|corner| self.on.get(&corner).unwrap_or(&none));
        let mut faces: Vec<u32> = on_a.iter().filter(|face| on_b.contains(face)).copied().collect();
        faces.push(face);
        let mut place = straight;
        if faces.iter().any(|&face| !self.faces[face as usize].level.is_plane()) {
            let size = self.size(&straight);
            let axes = self.lines.axes();
            let fixed = std::array::from_fn(|d| {
                let is_end = [0, axes[d].n_cells()].iter().any(|&line| axes[d].line(line) == straight[d]);
                is_end && x[d] == y[d]
            });
            place = self.projected(&straight, &faces, &size, &fixed).unwrap_or(straight);
        }
        let corner = self.lattice_corners() + self.more.len();
        self.more.push(place);
        self.on.insert(corner, faces);
        Halved { corner, straight }
    }

    /// Adds the parts of a piece whose edges are halved.
    fn halve(&self, piece: Piece, halved: &FxHashMap<[usize; 2], Halved>, all: &mut Vec<Piece>) {
        if piece.corners.len() != 4 {
            all.push(piece);
            return;
        }
        let mut longest: Option<(f64, [usize; 2], [usize; 2])> = None;
        for pair in EDGES {
            let [a, b] = pair.map(|k| piece.corners[k]);
            let edge = [a.min(b), a.max(b)];
            if halved.contains_key(&edge) {
                let length = norm(&minus(&self.place(edge[1]), &self.place(edge[0])));
                let is_first =
                    longest.is_none_or(|(most, other, _)| length > most || (length == most && edge < other));
                if is_first {
                    longest = Some((length, edge, pair));
                }
            }
        }
        let Some((_, edge, pair)) = longest else {
            all.push(piece);
            return;
        };
        for k in pair {
            let mut half = piece.clone();
            half.corners[k] = halved[&edge].corner;
            self.halve(half, halved, all);
        }
    }

    /// Moves corners on a curved face back to their edges where a tetrahedron would be flat or inverted.
    fn straighten(&mut self, pieces: &[Piece], halved: &FxHashMap<[usize; 2], Halved>) {
        let first = self.lattice_corners();
        let straight: FxHashMap<usize, [f64; 3]> = (halved.values())
            .filter(|halved| self.place(halved.corner) != halved.straight)
            .map(|halved| (halved.corner, halved.straight))
            .collect();
        if straight.is_empty() {
            return;
        }
        let mut again = true;
        while again {
            again = false;
            for piece in pieces.iter().filter(|piece| piece.corners.len() == 4) {
                let bent: Vec<usize> = (piece.corners.iter())
                    .filter(|&k| straight.get(k).is_some_and(|x| *x != self.place(*k)))
                    .copied()
                    .collect();
                if !bent.is_empty() && self.volume(piece) < FLATTEST {
                    bent.into_iter().for_each(|k| self.more[k - first] = straight[&k]);
                    again = true;
                }
            }
        }
    }

    /// Six times the volume of a tetrahedron, relative to that of its cell, [-].
    fn volume(&self, piece: &Piece) -> f64 {
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| piece.corners[k]);
        let size = self.size_of_cell(piece.cell);
        let arms = self.arms(a, [b, c, d], &size);
        Mat3::from_fn(|i, j| arms[j][i]).determinant()
    }
}
