//! Removes flat tetrahedra: one of their edges collapses, so that a corner moves to another one on the same faces.

use rustc_hash::{FxHashMap, FxHashSet};

use super::lattice::Fitting;
use super::pieces::Piece;
use crate::tensor::Mat3;

/// Determinant of the Jacobian relative to the cell below which a tetrahedron is flat, [-].
const FLAT: f64 = 0.05;
/// Factor by which the flattest piece around a collapsed edge must become less flat, [-].
const BETTER: f64 = 1.5;
/// Number of times that all flat tetrahedra are visited.
const PASSES: usize = 4;
/// Largest relative change of the volume around an edge on plane faces, [-], and that on curved faces relative to the
/// cell, [-].
const SAME_VOLUME: f64 = 1e-9;
const NEARLY_SAME_VOLUME: f64 = 0.01;

/// The pieces inside a region with those around each of their corners.
struct Pieces<'a> {
    all: Vec<Option<Piece>>,
    around: FxHashMap<usize, Vec<usize>>,
    /// Corners of hexahedra, which stay.
    fixed: &'a FxHashSet<usize>,
}

impl Fitting<'_> {
    /// The pieces without those that are flat, as far as possible. The corners `fixed` stay. `moved` receives each
    /// corner that has moved with the one to which it has moved.
    pub(super) fn without_flat_pieces(
        &self,
        pieces: Vec<Piece>,
        fixed: &FxHashSet<usize>,
        moved: &mut Vec<[usize; 2]>,
    ) -> Vec<Piece> {
        let mut around: FxHashMap<usize, Vec<usize>> = FxHashMap::default();
        for (number, piece) in pieces.iter().enumerate() {
            piece.corners.iter().for_each(|&corner| around.entry(corner).or_default().push(number));
        }
        let mut pieces = Pieces { all: pieces.into_iter().map(Some).collect(), around, fixed };
        for _ in 0..PASSES {
            let mut flat: Vec<(f64, usize)> = (pieces.all.iter().enumerate())
                .filter_map(|(number, piece)| Some((number, piece.as_ref()?)))
                .filter(|(_, piece)| piece.corners.len() == 4)
                .map(|(number, piece)| (self.flatness(piece), number))
                .filter(|(flatness, _)| *flatness < FLAT)
                .collect();
            flat.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let mut has_changed = false;
            for (flatness, number) in flat {
                if let Some(edge) = self.best_edge(&pieces, number, flatness) {
                    pieces.collapse(edge);
                    moved.push(edge);
                    has_changed = true;
                }
            }
            if !has_changed {
                break;
            }
        }
        pieces.all.into_iter().flatten().collect()
    }

    /// The edge of a flat tetrahedron whose collapse makes the pieces around it least flat, if any may collapse: the
    /// corner that goes, and the one to which it moves.
    fn best_edge(&self, pieces: &Pieces, number: usize, flatness: f64) -> Option<[usize; 2]> {
        let piece = pieces.all[number].as_ref().filter(|piece| self.flatness(piece) == flatness)?;
        let mut best: Option<(f64, [usize; 2])> = None;
        for &from in &piece.corners {
            for &to in piece.corners.iter().filter(|to| **to != from) {
                let Some(least) = self.flattest_after(pieces, [from, to]) else { continue };
                if least > BETTER * flatness.max(0.0) && best.is_none_or(|(most, _)| least > most) {
                    best = Some((least, [from, to]));
                }
            }
        }
        best.map(|(_, edge)| edge)
    }

    /// How flat the flattest piece is after an edge has collapsed; `None` if it may not collapse.
    fn flattest_after(&self, pieces: &Pieces, [from, to]: [usize; 2]) -> Option<f64> {
        if pieces.fixed.contains(&from) || !self.lies_on_faces([from, to], pieces) {
            return None;
        }
        let neighbours = |corner: usize| -> FxHashSet<usize> {
            pieces.pieces_at(corner).flat_map(|piece| piece.corners.iter().copied()).collect()
        };
        let [near_from, near_to] = [from, to].map(neighbours);
        let (mut between, mut least) = (FxHashSet::default(), f64::INFINITY);
        let (mut before, mut after, mut is_curved) = (0.0, 0.0, false);
        for piece in pieces.pieces_at(from) {
            if piece.corners.len() > 4 && piece.corners.last() != Some(&from) {
                return None;
            }
            before += self.volume_of(&piece.corners);
            is_curved |= self
                .on
                .get(&from)
                .is_some_and(|faces| faces.iter().any(|&face| !self.faces[face as usize].level.is_plane()));
            if piece.corners.contains(&to) {
                if piece.corners.len() > 4 {
                    return None;
                }
                between.extend(piece.corners.iter().copied());
                continue;
            }
            let moved = piece.with(from, to);
            after += self.volume_of(&moved.corners);
            least = least.min(self.flatness(&moved));
        }
        // The edge is that of all corners next to both ends; otherwise parts of the body would touch.
        let is_simple = near_from.intersection(&near_to).all(|corner| between.contains(corner));
        let cell: f64 = self.size(&self.place(from)).iter().product();
        let slack = if is_curved { NEARLY_SAME_VOLUME * cell } else { SAME_VOLUME * before };
        (is_simple && (after - before).abs() <= slack).then_some(least)
    }

    /// True if the second corner lies on all faces, and ends of the lattice, on which the first one lies.
    fn lies_on_faces(&self, [from, to]: [usize; 2], pieces: &Pieces) -> bool {
        let cells = pieces.pieces_at(from).map(|piece| piece.cell);
        let mut faces: Vec<u32> = cells.filter_map(|cell| self.near.get(&cell)).flatten().copied().collect();
        faces.extend(self.on.get(&from).into_iter().flatten());
        faces.sort_unstable();
        faces.dedup();
        let [x, y] = [from, to].map(|corner| self.place(corner));
        let is_kept = |d: usize| {
            let axis = &self.lines.axes()[d];
            let is_end = [0, axis.n_cells()].iter().any(|&line| axis.line(line) == x[d]);
            !is_end || x[d] == y[d]
        };
        (0..3).all(is_kept)
            && faces.iter().all(|&face| self.height(from, face) != 0.0 || self.height(to, face) == 0.0)
    }

    /// The smallest determinant of the Jacobian at a corner of a tetrahedron, or at the base of a pyramid, relative to
    /// its cell, [-].
    fn flatness(&self, piece: &Piece) -> f64 {
        let size = self.size_of_cell(piece.cell);
        let corners = &piece.corners;
        let determinant = |from: usize, to: [usize; 3]| {
            let arms = self.arms(corners[from], to.map(|k| corners[k]), &size);
            Mat3::from_fn(|i, j| arms[j][i]).determinant()
        };
        if corners.len() == 4 {
            return determinant(0, [1, 2, 3]);
        }
        (0..4).map(|k| determinant(k, [(k + 1) % 4, (k + 3) % 4, 4])).fold(f64::INFINITY, f64::min)
    }

    fn volume_of(&self, corners: &[usize]) -> f64 {
        let places: Vec<[f64; 3]> = corners.iter().map(|&corner| self.place(corner)).collect();
        crate::basis::domain_volume(&places)
    }
}

impl Pieces<'_> {
    fn pieces_at(&self, corner: usize) -> impl Iterator<Item = &Piece> {
        self.around.get(&corner).into_iter().flatten().filter_map(|&number| self.all[number].as_ref())
    }

    /// Moves the first corner of an edge to the second one.
    fn collapse(&mut self, [from, to]: [usize; 2]) {
        for number in self.around.remove(&from).unwrap_or_default() {
            let Some(piece) = self.all[number].take() else { continue };
            if !piece.corners.contains(&to) {
                self.all[number] = Some(piece.with(from, to));
                self.around.entry(to).or_default().push(number);
            }
        }
    }
}

impl Piece {
    /// The same piece with a corner replaced by another one.
    fn with(&self, from: usize, to: usize) -> Piece {
        let corners = self.corners.iter().map(|&corner| if corner == from { to } else { corner }).collect();
        Piece { cell: self.cell, corners }
    }
}
