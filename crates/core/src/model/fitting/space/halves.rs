//! Cells that one face divides along diagonals of their sides, of which one part is a single piece.

use super::lattice::Fitting;
use super::pieces::{Crossed, Piece, edges, sides};

impl Fitting<'_> {
    /// The only piece of a cell inside the region, a tetrahedron, pyramid or wedge, if the rest of the cell lies
    /// outside; with it, the corners of this rest.
    pub(super) fn only_piece(&self, cell: usize, crossed: &Crossed) -> Option<(Piece, Vec<usize>)> {
        let corners = self.corners_of(cell);
        let mixed = |face: &&u32| super::pieces::has_both_signs(&self.heights(&corners, **face));
        let mut mixed = self.near.get(&cell)?.iter().filter(mixed);
        let (face, None) = (*mixed.next()?, mixed.next()) else { return None };
        if edges(&corners).any(|edge| crossed.crosses(edge)) {
            return None;
        }
        let heights = self.heights(&corners, face);
        let part = |sign: f64| -> Vec<usize> { (0..8).filter(|&k| sign * heights[k] > 0.0).collect() };
        let is_inside = |part: &[usize]| {
            let mut all: Vec<usize> = part.to_vec();
            let is_next = |k: &usize| heights[*k] == 0.0 && (0..3).any(|d| part.contains(&(k ^ 1 << d)));
            all.extend((0..8).filter(is_next));
            let mean = std::array::from_fn(|d| {
                all.iter().map(|&k| self.place(corners[k])[d]).sum::<f64>() / all.len() as f64
            });
            self.region.contains(&mean)
        };
        let parts = [1.0, -1.0].map(part);
        let [inner, outer] = match parts.each_ref().map(|part| is_inside(part)) {
            [true, false] => parts,
            [false, true] => [parts[1].clone(), parts[0].clone()],
            _ => return None,
        };
        let local = match inner[..] {
            [k] => tip(k, &outer)?,
            [a, b] if (a ^ b).is_power_of_two() => wedge([a, b], &outer)?,
            _ => return None,
        };
        // Its sides must be those of its neighbours.
        let is_alike = |side: &[usize; 4]| {
            let of = |corner: usize| corners.iter().position(|k| *k == corner).unwrap_or(0);
            let local = side.map(of);
            if !local.iter().any(|k| inner.contains(k)) {
                return true;
            }
            let Some(cut) = local.iter().position(|k| outer.contains(k)) else {
                return !crossed.divides(side);
            };
            let kept = side[(cut + 2) % 4];
            let ends = [side[(cut + 1) % 4], side[(cut + 3) % 4]];
            self.triangles(side)
                .iter()
                .any(|triangle| triangle.contains(&kept) && ends.iter().all(|end| triangle.contains(end)))
        };
        if !sides(&corners).iter().all(is_alike) {
            return None;
        }
        let piece = Piece { cell, corners: local.iter().map(|&k| corners[k]).collect() };
        let rest = (0..8).filter(|k| !inner.contains(k)).map(|k| corners[k]).collect();
        (self.determinant(&piece) > super::pieces::FLATTEST).then_some((piece, rest))
    }

    /// The determinant of the Jacobian at the first corner of a piece, relative to that of its cell.
    fn determinant(&self, piece: &Piece) -> f64 {
        let size = self.size_of_cell(piece.cell);
        let corners = &piece.corners;
        let next = match corners.len() {
            4 => [1, 2, 3],
            5 => [1, 3, 4],
            _ => [2, 1, 3],
        };
        let arms = self.arms(corners[0], next.map(|k| corners[k]), &size);
        crate::tensor::Mat3::from_fn(|i, j| arms[j][i]).determinant()
    }
}

/// Axes in an order such that steps away from a corner along them are right-handed.
fn axes_from(corner: usize) -> [usize; 3] {
    if corner.count_ones().is_multiple_of(2) { [0, 1, 2] } else { [1, 0, 2] }
}

/// The tetrahedron or pyramid at a corner of a cell whose neighbours all lie on the face.
fn tip(corner: usize, outer: &[usize]) -> Option<Vec<usize>> {
    let [i, j, k] = axes_from(corner);
    let at = |axes: &[usize]| axes.iter().fold(corner, |corner, d| corner ^ 1 << d);
    let on_face: Vec<[usize; 3]> = [[i, j, k], [j, k, i], [k, i, j]]
        .into_iter()
        .filter(|[a, b, _]| !outer.contains(&at(&[*a, *b])))
        .collect();
    if !outer.contains(&(corner ^ 7)) {
        return None;
    }
    match on_face[..] {
        [] => Some(vec![corner, at(&[i]), at(&[j]), at(&[k])]),
        [[a, b, c]] => Some(vec![corner, at(&[a]), at(&[a, b]), at(&[b]), at(&[c])]),
        _ => None,
    }
}

/// The wedge at an edge of a cell whose opposite edge lies outside.
fn wedge([from, to]: [usize; 2], outer: &[usize]) -> Option<Vec<usize>> {
    let along = from ^ to;
    let [a, b] = match along {
        1 => [2, 4],
        2 => [1, 4],
        _ => [1, 2],
    };
    let is_opposite = |k: usize| outer.contains(&(k ^ a ^ b));
    if outer.len() != 2 || !is_opposite(from) || !is_opposite(to) {
        return None;
    }
    // The triangle at the first corner runs counterclockwise as seen from outside.
    let steps = [a, b, along].map(|bit| bit.trailing_zeros() as usize);
    let is_even = steps == [0, 1, 2] || steps == [1, 2, 0] || steps == [2, 0, 1];
    let is_right_handed = from.count_ones().is_multiple_of(2) == is_even;
    let [a, b] = if is_right_handed { [b, a] } else { [a, b] };
    Some(vec![from, from ^ a, from ^ b, to, to ^ a, to ^ b])
}
