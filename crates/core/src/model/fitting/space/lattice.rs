//! The lattice around a region, whose corners move to its faces.

use rustc_hash::{FxHashMap, FxHashSet};

use super::domain::NotFitted;
use super::faces::{FaceAt, is_on_line};
use crate::grid::Lines;
use crate::region::Region;
use crate::region::vector::{dot, minus};

/// Height above a face within which a position lies on it, in cells, [-].
pub(super) const ON_FACE: f64 = 1e-9;
/// Size of the facets that show where a face is, in cells, [-].
const SPACING: f64 = 0.34;
/// Number of iterations that project a position onto curved faces.
const PROJECTIONS: usize = 20;

/// The lattice around a region whose corners have moved to its faces. Corners are numbered: first those of the lattice,
/// then others.
pub(super) struct Fitting<'a> {
    pub(super) region: &'a Region<3>,
    pub(super) lines: &'a Lines<3>,
    /// The lowest line of the part of the lattice around the region, along each axis.
    pub(super) first: [usize; 3],
    /// Number of cells in this part along each axis.
    pub(super) n: [usize; 3],
    pub(super) faces: Vec<FaceAt>,
    /// The faces near each cell that has any.
    pub(super) near: FxHashMap<usize, Vec<u32>>,
    /// The corners of the lattice that have moved, [length].
    pub(super) moved: FxHashMap<usize, [f64; 3]>,
    /// The other corners, [length].
    pub(super) more: Vec<[f64; 3]>,
    /// The corners of the lattice that must not move.
    pub(super) kept: FxHashSet<usize>,
    /// The faces on which corners lie that have been placed there.
    pub(super) on: FxHashMap<usize, Vec<u32>>,
}

impl<'a> Fitting<'a> {
    pub(super) fn new(region: &'a Region<3>, lines: &'a Lines<3>) -> Result<Self, NotFitted> {
        let [low, high] = region.bounds();
        let axes = lines.axes();
        let smallest = (0..3).map(|d| axes[d].smallest_within(low[d], high[d])).fold(f64::INFINITY, f64::min);
        let faces = region.faces(SPACING * smallest, smallest).ok_or(NotFitted::Unknown)?;
        if faces.is_empty() {
            return Err(NotFitted::Unknown);
        }
        if faces.iter().all(|face| is_on_line(&face.level, lines)) {
            return Err(NotFitted::OnLattice);
        }
        let ends = |d: usize| {
            let [low, high] = [low[d], high[d]].map(|x| axes[d].coordinate(x));
            let n = axes[d].n_cells() as f64;
            [(low.floor() - 1.0).clamp(0.0, n) as usize, (high.ceil() + 1.0).clamp(0.0, n) as usize]
        };
        let ends: [[usize; 2]; 3] = std::array::from_fn(ends);
        let mut fitting = Fitting {
            region,
            lines,
            first: ends.map(|[first, _]| first),
            n: ends.map(|[first, last]| last - first),
            faces: faces.into_iter().map(FaceAt::new).collect(),
            near: FxHashMap::default(),
            moved: FxHashMap::default(),
            more: Vec::new(),
            kept: FxHashSet::default(),
            on: FxHashMap::default(),
        };
        fitting.find_cells_at_faces();
        Ok(fitting)
    }

    /// Puts all corners of the lattice back.
    pub(super) fn put_back(&mut self) {
        self.moved.clear();
        self.more.clear();
        self.on.clear();
    }

    /// Puts the corners of cells back that cannot be divided because of these.
    ///
    /// # Errors
    /// [`NotFitted::At`] a cell without such corners.
    pub(super) fn keep_corners(&mut self, cells: &[usize]) -> Result<(), NotFitted> {
        for &cell in cells {
            let corners = self.corners_of(cell);
            if !corners.iter().any(|corner| self.moved.contains_key(corner)) {
                return Err(NotFitted::At(self.place(corners[0])));
            }
            self.kept.extend(corners);
        }
        self.put_back();
        Ok(())
    }

    /// Sides of a cell of the lattice, [length].
    pub(super) fn size_of_cell(&self, cell: usize) -> [f64; 3] {
        let index = self.cell_index(cell);
        self.lines.sides(std::array::from_fn(|d| self.first[d] + index[d]))
    }

    /// Cell coordinate along an axis in the part of the lattice around the region.
    pub(super) fn local(&self, d: usize, x: f64) -> f64 {
        self.lines.axes()[d].coordinate(x) - self.first[d] as f64
    }

    pub(super) fn cell(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.n[0] * (j + self.n[1] * k)
    }

    pub(super) fn cell_index(&self, cell: usize) -> [usize; 3] {
        [cell % self.n[0], cell / self.n[0] % self.n[1], cell / self.n[0] / self.n[1]]
    }

    pub(super) fn corner(&self, [i, j, k]: [usize; 3]) -> usize {
        i + (self.n[0] + 1) * (j + (self.n[1] + 1) * k)
    }

    pub(super) fn corner_index(&self, corner: usize) -> [usize; 3] {
        let [n, m] = [self.n[0] + 1, self.n[1] + 1];
        [corner % n, corner / n % m, corner / n / m]
    }

    pub(super) fn lattice_corners(&self) -> usize {
        self.n.iter().map(|n| n + 1).product()
    }

    /// The corners of a cell; bit d of the number of a corner is its side along axis d.
    pub(super) fn corners_of(&self, cell: usize) -> [usize; 8] {
        let index = self.cell_index(cell);
        std::array::from_fn(|k| self.corner(std::array::from_fn(|d| index[d] + (k >> d & 1))))
    }

    /// The cells around a corner of the lattice.
    pub(super) fn cells_around(&self, corner: usize) -> impl Iterator<Item = usize> {
        let index = self.corner_index(corner);
        (0..8usize).filter_map(move |k| {
            let below = std::array::from_fn(|d| (index[d] + (k >> d & 1)).checked_sub(1));
            let [Some(i), Some(j), Some(k)] = below else { return None };
            (i < self.n[0] && j < self.n[1] && k < self.n[2]).then(|| self.cell([i, j, k]))
        })
    }

    /// Position of a corner, [length].
    pub(super) fn place(&self, corner: usize) -> [f64; 3] {
        if let Some(extra) = corner.checked_sub(self.lattice_corners()) {
            return self.more[extra];
        }
        self.moved.get(&corner).copied().unwrap_or_else(|| {
            let index = self.corner_index(corner);
            std::array::from_fn(|d| self.lines.axes()[d].line(self.first[d] + index[d]))
        })
    }

    /// Sides of the cell at a position, [length].
    pub(super) fn size(&self, x: &[f64; 3]) -> [f64; 3] {
        std::array::from_fn(|d| self.lines.axes()[d].size_at(x[d]))
    }

    /// The side of a face on which a corner lies: its height, or exactly zero on the face, [length].
    pub(super) fn height(&self, corner: usize, face: u32) -> f64 {
        if self.on.get(&corner).is_some_and(|faces| faces.contains(&face)) {
            return 0.0;
        }
        let x = self.place(corner);
        let (height, _) = self.faces[face as usize].height(&x);
        let least = self.size(&x).into_iter().fold(f64::INFINITY, f64::min);
        if height.abs() <= ON_FACE * least { 0.0 } else { height }
    }

    /// The position on all these faces nearest to another one, in cells of this size; coordinates along `fixed` axes
    /// stay. `None` if there is none.
    pub(super) fn projected(
        &self,
        x: &[f64; 3],
        faces: &[u32],
        size: &[f64; 3],
        fixed: &[bool; 3],
    ) -> Option<[f64; 3]> {
        let least = size.iter().copied().fold(f64::INFINITY, f64::min);
        let mut place = *x;
        for _ in 0..PROJECTIONS {
            let mut step = [0.0; 3];
            // Directions along which the step may not change the heights that it has corrected.
            let mut basis: Vec<[f64; 3]> = Vec::new();
            let mut is_there = true;
            for &face in faces {
                let (height, gradient) = self.faces[face as usize].height(&place);
                let scaled: [f64; 3] =
                    std::array::from_fn(|d| if fixed[d] { 0.0 } else { gradient[d] * size[d] });
                is_there &= height.abs() <= 1e-14 * least;
                let remaining = height + dot(&scaled, &step);
                let mut across = scaled;
                for e in &basis {
                    let share = dot(&across, e);
                    across = std::array::from_fn(|d| across[d] - share * e[d]);
                }
                let squared = dot(&across, &across);
                if squared <= 1e-4 * dot(&scaled, &scaled) || squared == 0.0 {
                    if remaining.abs() > ON_FACE * least {
                        return None;
                    }
                    continue;
                }
                let share = remaining / squared;
                step = std::array::from_fn(|d| step[d] - share * across[d]);
                basis.push(across.map(|a| a / squared.sqrt()));
            }
            if is_there {
                break;
            }
            place = std::array::from_fn(|d| place[d] + size[d] * step[d]);
        }
        let is_on = |&face: &u32| self.faces[face as usize].height(&place).0.abs() <= ON_FACE * least;
        faces.iter().all(is_on).then_some(place)
    }

    /// The vectors from a corner to others, in cells of a size.
    pub(super) fn arms<const N: usize>(&self, from: usize, to: [usize; N], size: &[f64; 3]) -> [[f64; 3]; N] {
        let x = self.place(from);
        to.map(|k| {
            let arm = minus(&self.place(k), &x);
            std::array::from_fn(|d| arm[d] / size[d])
        })
    }
}
