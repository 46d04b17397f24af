//! Divides the cells that faces cross into pyramids and tetrahedra around a position inside.

use rustc_hash::{FxHashMap, FxHashSet};

use super::lattice::Fitting;
use super::warp::groups;
use crate::grid::element::ElementShape;
use crate::grid::vtk_corner;
use crate::region::vector::along;
use crate::tensor::Mat3;

/// Smallest determinant of the Jacobian of a tetrahedron around the position in a cell, and at a corner of the base of
/// a pyramid, relative to that of the cell, [-].
pub(super) const FLATTEST: f64 = 0.02;
/// Largest number of faces in a cell that are tried together.
const MOST_FACES: usize = 5;

/// A piece of a cell: a tetrahedron, pyramid, wedge or hexahedron between these corners.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub cell: usize,
    pub corners: Vec<usize>,
}

/// The cells that are divided, and their pieces.
#[derive(Debug, Default)]
pub(super) struct Divided {
    pub cells: FxHashSet<usize>,
    pub pieces: Vec<Piece>,
    /// Corners of parts of cells that lie outside the region and are no pieces.
    pub outside: FxHashSet<usize>,
}

/// Edges and sides of cells that faces cross.
#[derive(Default)]
pub(super) struct Crossed {
    edges: FxHashSet<[usize; 2]>,
    quadrilaterals: FxHashSet<[usize; 4]>,
    cells: FxHashSet<usize>,
}

/// The position around which a cell is divided.
struct Centre {
    place: [f64; 3],
    faces: Vec<u32>,
    /// The sides to whose corners no pyramid fits, because faces would cross it.
    crossed: Vec<[usize; 4]>,
}

fn sorted<const N: usize>(mut corners: [usize; N]) -> [usize; N] {
    corners.sort_unstable();
    corners
}

impl Crossed {
    /// True if a face crosses an edge between two corners.
    pub(super) fn crosses(&self, edge: [usize; 2]) -> bool {
        self.edges.contains(&sorted(edge))
    }

    /// True if a side, given by its corners in cyclic order, is divided into triangles.
    pub(super) fn divides(&self, side: &[usize; 4]) -> bool {
        self.quadrilaterals.contains(&sorted(*side))
            || (0..4).any(|k| self.crosses([side[k], side[(k + 1) % 4]]))
    }
}

/// The sides of a hexahedron with these corners, each clockwise as seen from outside.
pub(super) fn sides(corners: &[usize; 8]) -> [[usize; 4]; 6] {
    let sides = ElementShape::Box.sides::<3>();
    std::array::from_fn(|k| std::array::from_fn(|j| corners[vtk_corner(sides[k][3 - j])]))
}

/// The edges of a hexahedron with these corners.
pub(super) fn edges(corners: &[usize; 8]) -> impl Iterator<Item = [usize; 2]> {
    let pairs = (0..3).flat_map(|d| (0..8).filter(move |k| k >> d & 1 == 0).map(move |k| [k, k | 1 << d]));
    pairs.map(|pair| pair.map(|k| corners[k]))
}

/// True if values lie on both sides of zero.
pub(super) fn has_both_signs(heights: &[f64]) -> bool {
    heights.iter().any(|h| *h > 0.0) && heights.iter().any(|h| *h < 0.0)
}

impl Fitting<'_> {
    /// Divides the cells that faces cross, and cuts their pieces along the faces.
    ///
    /// # Errors
    /// The cells that cannot be divided.
    pub(super) fn divided(&mut self) -> Result<Divided, Vec<usize>> {
        let mut crossed = self.crossed();
        loop {
            let cells = self.cells_to_divide(&crossed);
            let mut centres: Vec<(usize, Centre)> = Vec::with_capacity(cells.len());
            let mut divided = Divided::default();
            let (mut has_more, mut failed) = (false, Vec::new());
            for cell in cells {
                if let Some((piece, outside)) = self.only_piece(cell, &crossed) {
                    divided.cells.insert(cell);
                    divided.pieces.push(piece);
                    divided.outside.extend(outside);
                    continue;
                }
                let Some(centre) = self.centre_of(cell, &crossed) else {
                    failed.push(cell);
                    continue;
                };
                has_more |= !centre.crossed.is_empty();
                crossed.quadrilaterals.extend(centre.crossed.iter().map(|side| sorted(*side)));
                centres.push((cell, centre));
            }
            if !failed.is_empty() {
                return Err(failed);
            }
            if !has_more {
                for (cell, centre) in centres {
                    self.divide(cell, centre, &crossed, &mut divided);
                }
                self.cut(&mut divided.pieces);
                return Ok(divided);
            }
        }
    }

    /// The heights of the corners of a cell above a face.
    pub(super) fn heights(&self, corners: &[usize; 8], face: u32) -> [f64; 8] {
        corners.map(|corner| self.height(corner, face))
    }

    fn crossed(&self) -> Crossed {
        let mut crossed = Crossed::default();
        for (&cell, faces) in &self.near {
            let corners = self.corners_of(cell);
            for &face in faces {
                let heights = self.heights(&corners, face);
                if !has_both_signs(&heights) {
                    continue;
                }
                crossed.cells.insert(cell);
                let of =
                    |corner: usize| corners.iter().position(|k| *k == corner).map_or(0.0, |k| heights[k]);
                crossed
                    .edges
                    .extend(edges(&corners).filter(|edge| has_both_signs(&edge.map(of))).map(sorted));
                let all = sides(&corners).into_iter();
                crossed.quadrilaterals.extend(all.filter(|side| has_both_signs(&side.map(of))).map(sorted));
            }
        }
        crossed
    }

    /// The cells with an edge or side that is crossed, ascending.
    fn cells_to_divide(&self, crossed: &Crossed) -> Vec<usize> {
        let corners = crossed.edges.iter().map(|edge| edge[0]);
        let corners = corners.chain(crossed.quadrilaterals.iter().map(|side| side[0]));
        let touched = corners.flat_map(|corner| self.cells_around(corner));
        let mut cells: Vec<usize> = touched.chain(crossed.cells.iter().copied()).collect();
        cells.sort_unstable();
        cells.dedup();
        cells.retain(|cell| {
            crossed.cells.contains(cell)
                || sides(&self.corners_of(*cell)).iter().any(|side| crossed.divides(side))
        });
        cells
    }

    /// The position around which a cell is divided: on as many of its faces as possible, otherwise its centre.
    fn centre_of(&self, cell: usize, crossed: &Crossed) -> Option<Centre> {
        let corners = self.corners_of(cell);
        let size = self.size_of_cell(cell);
        let places = corners.map(|corner| self.place(corner));
        let mean: [f64; 3] = std::array::from_fn(|d| places.iter().map(|x| x[d]).sum::<f64>() / 8.0);
        let near = self.near.get(&cell).map_or(&[][..], Vec::as_slice);
        let heights: Vec<(u32, [f64; 8])> =
            near.iter().map(|&face| (face, self.heights(&corners, face))).collect();
        let mixed: Vec<u32> =
            heights.iter().filter(|(_, heights)| has_both_signs(heights)).map(|(face, _)| *face).collect();
        let mut best: Option<Centre> = None;
        let mut candidates = groups(&mixed[..mixed.len().min(MOST_FACES)]);
        candidates.push(Vec::new());
        for faces in candidates {
            let place = if faces.is_empty() {
                mean
            } else {
                let start = self.middle(&corners, &faces, &mean);
                let Some(place) = self.projected(&start, &faces, &size, &[false; 3]) else { continue };
                if !self.is_at(&place, &faces) {
                    continue;
                }
                place
            };
            if !self.fits(&place, &corners, crossed, &size) {
                continue;
            }
            let crossed = self.crossed_from(&place, &faces, &corners, &heights, crossed);
            if crossed.is_empty() {
                return Some(Centre { place, faces, crossed });
            }
            best = best.or(Some(Centre { place, faces, crossed }));
        }
        best
    }

    /// The mean of the places where faces cross the edges of a cell; `otherwise` if there are none.
    fn middle(&self, corners: &[usize; 8], faces: &[u32], otherwise: &[f64; 3]) -> [f64; 3] {
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for &face in faces {
            for [a, b] in edges(corners) {
                let [h, g] = [a, b].map(|corner| self.height(corner, face));
                if h * g > 0.0 || h == g {
                    continue;
                }
                let [x, y] = [a, b].map(|corner| self.place(corner));
                let t = h / (h - g);
                let place: [f64; 3] = std::array::from_fn(|d| x[d] + t * (y[d] - x[d]));
                sum = along(&sum, 1.0, &place);
                count += 1.0;
            }
        }
        if count > 0.0 { sum.map(|s| s / count) } else { *otherwise }
    }

    /// True if no piece of a cell around a position is too flat.
    fn fits(&self, place: &[f64; 3], corners: &[usize; 8], crossed: &Crossed, size: &[f64; 3]) -> bool {
        let determinant = |[a, b, c]: [usize; 3]| {
            let arm = |k: usize| -> [f64; 3] {
                let x = self.place(k);
                std::array::from_fn(|d| (x[d] - place[d]) / size[d])
            };
            let arms = [a, b, c].map(arm);
            // The corners run counterclockwise as seen from the position.
            -Mat3::from_fn(|i, j| arms[j][i]).determinant()
        };
        sides(corners).iter().all(|side| {
            if crossed.divides(side) {
                self.triangles(side).into_iter().all(|triangle| determinant(triangle) >= FLATTEST)
            } else {
                (0..4).all(|k| determinant([side[k], side[(k + 1) % 4], side[(k + 2) % 4]]) >= FLATTEST)
            }
        })
    }

    /// The sides of a cell whose corners lie beyond a face as seen from a position; `heights` are those of the corners
    /// above each face.
    fn crossed_from(
        &self,
        place: &[f64; 3],
        on: &[u32],
        corners: &[usize; 8],
        heights: &[(u32, [f64; 8])],
        crossed: &Crossed,
    ) -> Vec<[usize; 4]> {
        let mut beyond = [false; 8];
        for (face, heights) in heights.iter().filter(|(face, _)| !on.contains(face)) {
            let (height, _) = self.faces[*face as usize].height(place);
            (0..8).for_each(|k| beyond[k] |= height * heights[k] < 0.0);
        }
        let is_beyond = |corner: &usize| corners.iter().position(|k| k == corner).is_some_and(|k| beyond[k]);
        let all = sides(corners).into_iter();
        all.filter(|side| !crossed.divides(side) && side.iter().any(is_beyond)).collect()
    }

    /// The two triangles of a side, in its orientation: divided so that few faces cross the diagonal; the choice is the
    /// same for both of its cells.
    pub(super) fn triangles(&self, side: &[usize; 4]) -> [[usize; 3]; 2] {
        let [a, b, c, d] = *side;
        let mut faces: Vec<u32> = (self.cells_around(a))
            .filter(|cell| self.corners_of(*cell).contains(&c))
            .filter_map(|cell| self.near.get(&cell))
            .flatten()
            .copied()
            .collect();
        faces.sort_unstable();
        faces.dedup();
        let crossings = |a: usize, b: usize| {
            faces.iter().filter(|&&face| self.height(a, face) * self.height(b, face) < 0.0).count()
        };
        let first = (crossings(a, c), a.min(c)) < (crossings(b, d), b.min(d));
        if first { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    }

    /// Adds the pieces of a cell around a position.
    fn divide(&mut self, cell: usize, centre: Centre, crossed: &Crossed, divided: &mut Divided) {
        let tip = self.lattice_corners() + self.more.len();
        self.more.push(centre.place);
        if !centre.faces.is_empty() {
            self.on.insert(tip, centre.faces);
        }
        divided.cells.insert(cell);
        for side in sides(&self.corners_of(cell)) {
            if crossed.divides(&side) {
                for [a, b, c] in self.triangles(&side) {
                    divided.pieces.push(Piece { cell, corners: vec![a, b, c, tip] });
                }
            } else {
                let corners = side.into_iter().chain([tip]).collect();
                divided.pieces.push(Piece { cell, corners });
            }
        }
    }
}

/// Heights of corners above a face that have been computed.
pub(super) type Heights = FxHashMap<usize, f64>;
