//! Filling of regions with material points.

mod shaped;

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use crate::basis::DomainKind;
use crate::grid::element::ElementShape;
use crate::grid::subdivide::{ElementPart, subdivide_box, subdivide_simplex};
use crate::grid::{Axis, Grid, Lines, Structured};
use crate::points::Seed;
use crate::ranks::Ranks;
use crate::region::{Bounds, FilledCell, Region, Volume, brick_parts, contains_in_cell, fill};

/// Distance to a grid line within which a side of a box counts as on the line, in cells, [-].
const ON_LINE: f64 = 1e-6;

/// Number of divisions of a cut cell along each axis in the plane, to measure the share of the cell in a region.
const FINE: usize = 32;
/// Number of divisions of a cut cell along each axis in space, to measure the share of the cell in a region.
const FINE_IN_SPACE: usize = 10;
/// Number of divisions of a cell along each axis, to find out whether the cell is cut.
const PROBED: usize = 8;

/// Largest number of points of a body that a rank creates.
pub const MAX_POINTS: f64 = 1e8;

/// How the points of a body are placed.
#[derive(Debug, Clone, PartialEq)]
pub enum Placement<const D: usize> {
    /// Each cell is divided into parts, and a point is created for each part that has its centre in the region.
    PerCell {
        /// Number of parts of a quadrilateral or hexahedron along each axis; `None` if the grid must not have such
        /// cells.
        boxes: Option<[usize; D]>,
        /// Number of parts of a triangle or tetrahedron; `None` if the grid must not have such cells.
        simplices: Option<usize>,
        /// The corners of the region if it is a box with sides along the axes. If the sides lie on lines of a
        /// structured grid, the points are placed in rows along the box.
        brick: Option<Bounds<D>>,
    },
    /// A lattice of this spacing, [length], which is independent of the grid.
    Lattice([f64; D]),
}

/// A region that cannot be filled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FillError {
    /// The lattice has more points than [`MAX_POINTS`] for each rank.
    #[error("the lattice would have {count:.1e} points; at most {most:.0e} are possible")]
    TooFine {
        /// Number of points of the lattice.
        count: f64,
        /// Largest number of points.
        most: f64,
    },
    /// The cells are divided into more than [`MAX_POINTS`] parts on this rank.
    #[error("the cells would be divided into more than {MAX_POINTS:.0e} parts")]
    TooManyParts,
    /// The grid has cells of this shape, and the number of their parts is missing.
    #[error("the number of points in each {} is missing", match .0 {
        ElementShape::Simplex => "triangle or tetrahedron",
        ElementShape::Box => "quadrilateral or hexahedron",
    })]
    NoCount(ElementShape),
    /// A triangle or tetrahedron cannot be divided evenly into this number of parts.
    #[error("a triangle or tetrahedron cannot be divided evenly into {0} parts")]
    Uneven(usize),
}

/// How the domains of the points follow the boundary of their region.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fit {
    /// The domains are parts of cells: their centres lie in the region, and the boundary is a staircase unless it
    /// coincides with their sides.
    Parts,
    /// The same, because the domains of the method follow boundaries only among the lines of a grid or lattice.
    OnMesh,
    /// The same, because no domains of this size fill the region exactly.
    Unfitted,
    /// The domains follow the boundary.
    Fitted,
}

/// The points of a region.
#[derive(Debug, Clone, PartialEq)]
pub struct FilledRegion<const D: usize> {
    /// The points that this rank creates; the shares of the ranks follow one another.
    pub seeds: Vec<Seed<D>>,
    /// True if the region was filled cell by cell.
    pub is_by_cells: bool,
    /// How the domains follow the boundary.
    pub fit: Fit,
    /// A position on or near the boundary that the domains do not follow, if one is known, [length].
    pub apart: Option<[f64; D]>,
}

/// A region in `D` dimensions that can be filled with points. The core implements this for all regions.
pub trait Fillable<const D: usize> {
    /// Fills the region with points. All ranks must call this together. Numbers of parts must be at least 1, spacings
    /// positive.
    ///
    /// # Errors
    /// [`FillError`] of this rank. If only another rank fails, the result is empty here, so callers must find out with
    /// [`Ranks::any`] whether a rank has failed.
    fn fill(&self, filling: &Filling<D>, placement: &Placement<D>) -> Result<FilledRegion<D>, FillError>;

    /// Volume of a region that consists of cells and may be cut by other regions: the full cells, and those small parts
    /// of the cut cells whose centres lie inside. All ranks must call this together.
    fn volume_in_grid(&self, filling: &Filling<D>) -> Volume;
}

// Crates that inlined the functions of these implementations would compile them again.
macro_rules! fillable {
    ($($D:literal)*) => {$(
        impl Fillable<$D> for Region<$D> {
            #[inline(never)]
            fn fill(&self, filling: &Filling<$D>, placement: &Placement<$D>) -> Result<FilledRegion<$D>, FillError> {
                filling.fill(self, placement)
            }

            #[inline(never)]
            fn volume_in_grid(&self, filling: &Filling<$D>) -> Volume {
                filling.volume_in_grid(self)
            }
        }
    )*};
}

fillable!(2 3);

/// Points of a cell, created one by one.
type Parts<'a, const D: usize> = Box<dyn Iterator<Item = Seed<D>> + 'a>;

/// Data shared by all points of a body.
pub struct Filling<'a, const D: usize> {
    /// The grid.
    pub grid: &'a dyn Grid<D>,
    /// `in_group(key, cell)` is true if a cell belongs to the group `key` of the region.
    pub in_group: &'a (dyn Fn(usize, usize) -> bool + Sync),
    /// Body number.
    pub body: u16,
    /// Kind of the domains of the points.
    pub domain: DomainKind,
    /// Density, [mass/volume].
    pub density: f64,
    /// Initial history variables.
    pub history: Vec<f64>,
    /// True if standard points need a box: they touch tools with it, and the level of water cuts it.
    pub needs_boxes: bool,
    /// The ranks, each of which creates a share of the points.
    pub ranks: &'a Ranks,
}

impl<const D: usize> Filling<'_, D> {
    fn fill(&self, region: &Region<D>, placement: &Placement<D>) -> Result<FilledRegion<D>, FillError> {
        if let (Placement::PerCell { boxes, simplices, .. }, Some(_)) = (placement, region.as_mesh()) {
            let seeds = self.meshed(region, boxes.unwrap_or([1; D]), simplices.unwrap_or(1))?;
            return Ok(FilledRegion { seeds, is_by_cells: false, fit: Fit::Fitted, apart: None });
        }
        if let Placement::PerCell { brick: Some(brick), boxes: Some(counts), .. } = placement
            && let Some(seeds) = self.grid.lines().and_then(|lines| self.box_on_lines(lines, brick, counts))
        {
            return Ok(FilledRegion { seeds, is_by_cells: false, fit: Fit::Parts, apart: None });
        }
        let found = self.fitted(region, placement)?;
        let (fit, apart) = (found.fit, found.apart);
        if fit == Fit::Fitted {
            return Ok(FilledRegion { seeds: found.seeds, is_by_cells: false, fit, apart });
        }
        let (seeds, is_by_cells) = match placement {
            Placement::Lattice(spacing) => (self.lattice(region, spacing)?, false),
            Placement::PerCell { boxes, simplices, .. } => {
                (self.cell_by_cell(region, *boxes, *simplices)?, true)
            }
        };
        Ok(FilledRegion { seeds, is_by_cells, fit, apart })
    }

    fn volume_in_grid(&self, region: &Region<D>) -> Volume {
        let fine = if D > 2 { FINE_IN_SPACE } else { FINE };
        let divide = |cell: usize| -> Result<Vec<(ElementPart<D>, bool)>, std::convert::Infallible> {
            let nodes = self.grid.corners(cell);
            let x: Vec<[f64; D]> =
                nodes.nodes().iter().map(|&n| self.grid.node_position(n as usize)).collect();
            let parts = |n: usize| match ElementShape::from_nodes::<D>(x.len()) {
                Some(ElementShape::Simplex) => subdivide_simplex(&x, n.pow(D as u32)).unwrap_or_default(),
                _ => subdivide_box(&x, [n; D]).unwrap_or_default(),
            };
            let is_inside = |part: &ElementPart<D>| {
                contains_in_cell(region, self.grid, &part.position, cell, self.in_group)
            };
            let is_full = parts(PROBED).iter().all(is_inside);
            Ok(parts(if is_full { 1 } else { fine }).into_iter().map(|part| (part, !is_full)).collect())
        };
        let Ok(parts) = fill(region, self.grid, self.in_group, divide, |(part, _)| part.position, self.ranks);
        let cut: f64 = parts.parts.iter().filter(|(_, is_cut)| *is_cut).map(|(part, _)| part.volume).sum();
        let mut sums = [parts.parts.iter().map(|(part, _)| part.volume).sum(), cut];
        self.ranks.sum(&mut sums);
        Volume { value: sums[0], error: 0.5 * sums[1] / fine as f64 }
    }

    fn seed(&self, position: [f64; D], volume: f64) -> Seed<D> {
        Seed {
            body: self.body,
            position,
            half_lengths: [0.0; D],
            corners: Vec::new(),
            volume,
            mass: self.density * volume,
            outer_layer: false,
            history: self.history.clone(),
        }
    }

    /// The point of a box with sides along the axes, given by its lowest and highest corner.
    fn brick(&self, position: [f64; D], [low, high]: [[f64; D]; 2], sides: [f64; D]) -> Seed<D> {
        let mut seed = self.seed(position, sides.iter().product());
        if self.domain != DomainKind::None || self.needs_boxes {
            seed.half_lengths = sides.map(|s| 0.5 * s);
        }
        if self.domain == DomainKind::Corners {
            let corner = |c: usize| std::array::from_fn(|d| if c >> d & 1 == 1 { high[d] } else { low[d] });
            seed.corners = (0..1usize << D).map(corner).collect();
        }
        seed
    }

    /// Fills a box whose sides lie on grid lines; `None` for any other box.
    fn box_on_lines(
        &self,
        lines: &Lines<D>,
        [min, max]: &Bounds<D>,
        per_cell: &[usize; D],
    ) -> Option<Vec<Seed<D>>> {
        let axes = lines.axes();
        let on_line = |d: usize, x: f64| {
            let xi = axes[d].coordinate(x);
            (xi - xi.round()).abs() <= ON_LINE
        };
        if !(0..D).all(|d| on_line(d, min[d]) && on_line(d, max[d])) {
            return None;
        }
        let along = |d: usize| {
            let [first, last] = [min[d], max[d]].map(|x| axes[d].coordinate(x).round());
            let n = (last - first) as usize * per_cell[d];
            if axes[d].is_even() {
                // Measured from the ends of the box, not from its cells, so that both ends of a row get the same
                // round-off.
                return Axis::even(min[d], (max[d] - min[d]) / n as f64, n);
            }
            let [first, last] = [first, last].map(|line| (line.max(0.0) as usize).min(axes[d].n_cells()));
            axes[d].between(first, last).subdivided(per_cell[d])
        };
        Some(self.rows(Structured::with_axes(std::array::from_fn(along)), |_| true))
    }

    /// The points at the cell centres of a lattice that lie inside the region.
    fn rows(&self, lattice: Structured<D>, inside: impl Fn(&[f64; D]) -> bool + Sync) -> Vec<Seed<D>> {
        let n = lattice.cells();
        // Whether a point is in the outer layer depends on its neighbours, some of which belong to other ranks.
        let own = self.ranks.share(lattice.n_cells());
        let margin = 1 + (1..D).map(|d| n[..d].iter().product::<usize>()).sum::<usize>();
        let looked_at =
            own.start.saturating_sub(margin)..own.end.saturating_add(margin).min(lattice.n_cells());
        let table = |shift: f64| -> [Vec<f64>; D] {
            let position = |d: usize, i: usize| lattice.axes()[d].position(i as f64 + shift);
            std::array::from_fn(|d| (0..=n[d]).map(|i| position(d, i)).collect())
        };
        let (lines, middles) = (table(0.0), table(0.5));
        let at = |table: &[Vec<f64>; D], index: &[usize; D]| -> [f64; D] {
            std::array::from_fn(|d| table[d][index[d]])
        };
        let kept: Vec<bool> = (looked_at.clone())
            .into_par_iter()
            .map(|place| inside(&at(&middles, &lattice.cell_index(place))))
            .collect();
        // Offsets from the lowest neighbour of a lattice cell to all its neighbours, and to the cell itself.
        let ways: Vec<usize> = (0..3usize.pow(D as u32))
            .map(|k| lattice.cell(std::array::from_fn(|d| k / 3usize.pow(d as u32) % 3)))
            .collect();
        let is_outer = |index: &[usize; D]| {
            if (0..D).any(|d| index[d] == 0 || index[d] + 1 == n[d]) {
                return true;
            }
            let lowest = lattice.cell(index.map(|i| i - 1)) - looked_at.start;
            !ways.iter().all(|way| kept[lowest + way])
        };
        let one = |place: usize| {
            let index = lattice.cell_index(place);
            let ends = [at(&lines, &index), at(&lines, &index.map(|i| i + 1))];
            let mut seed = self.brick(at(&middles, &index), ends, lattice.sides(index));
            seed.outer_layer = is_outer(&index);
            seed
        };
        own.into_par_iter().filter(|&place| kept[place - looked_at.start]).map(one).collect()
    }

    /// Points at a stated spacing, independent of the grid.
    fn lattice(&self, region: &Region<D>, spacing: &[f64; D]) -> Result<Vec<Seed<D>>, FillError> {
        let lattice = self.lattice_around(region, spacing)?;
        Ok(lattice.map_or_else(Vec::new, |lattice| self.rows(lattice, |x| region.contains(x))))
    }

    /// The lattice with a stated spacing from the lowest corner of a region; `None` if the region is empty.
    ///
    /// # Errors
    /// [`FillError::TooFine`].
    fn lattice_around(
        &self,
        region: &Region<D>,
        spacing: &[f64; D],
    ) -> Result<Option<Structured<D>>, FillError> {
        let [min, max] = region.bounds();
        let along = |d: usize| ((max[d] - min[d]) / spacing[d] - ON_LINE).max(0.0);
        let (count, most): (f64, _) = ((0..D).map(along).product(), MAX_POINTS * self.ranks.count() as f64);
        if count > most {
            return Err(FillError::TooFine { count, most });
        }
        if !(0..D).all(|d| min[d] < max[d]) {
            return Ok(None); // an intersection of disjoint regions
        }
        let n: [usize; D] = std::array::from_fn(|d| (along(d).ceil() as usize).max(1));
        let axis = |d: usize| {
            let high = min[d] + n[d] as f64 * spacing[d];
            Axis::even(min[d], (high - min[d]) / n[d] as f64, n[d])
        };
        Ok(Some(Structured::with_axes(std::array::from_fn(axis))))
    }

    /// The points of those parts of every cell whose centres lie in the region.
    fn cell_by_cell(
        &self,
        region: &Region<D>,
        boxes: Option<[usize; D]>,
        simplices: Option<usize>,
    ) -> Result<Vec<Seed<D>>, FillError> {
        let cut = AtomicUsize::new(0);
        let divide = |cell: usize| {
            let (parts, n) = self.parts(cell, boxes, simplices)?;
            if cut.fetch_add(n, Ordering::Relaxed) as f64 > MAX_POINTS {
                return Err(FillError::TooManyParts);
            }
            Ok(parts)
        };
        let filled = fill(region, self.grid, self.in_group, divide, |seed| seed.position, self.ranks);
        if self.ranks.any(filled.is_err()) {
            return filled.map(|_| Vec::new());
        }
        let filled = filled?;
        let mut seeds = filled.parts;
        self.mark_outer_layer(&mut seeds, &filled.cells);
        Ok(seeds)
    }

    /// Marks the points of cells that are not full, or share a node with the boundary of the full cells.
    fn mark_outer_layer(&self, seeds: &mut [Seed<D>], filled: &[FilledCell]) {
        let own_full = || filled.iter().filter(|filled| filled.full).map(|filled| filled.cell);
        let full: Vec<u32> = if self.ranks.is_alone() {
            own_full().collect()
        } else {
            // Full cells of other ranks matter only next to the cells of this rank.
            let corners = |cell: u32| self.grid.corners(cell as usize);
            let touched: HashSet<u32> =
                filled.iter().flat_map(|filled| corners(filled.cell).nodes().to_vec()).collect();
            let mut full = self.ranks.gather_all(own_full().collect::<Vec<u32>>()).concat();
            full.retain(|cell| corners(*cell).nodes().iter().any(|node| touched.contains(node)));
            full
        };
        let mut sides: Vec<[u32; 4]> = Vec::new();
        for cell in full {
            let corners = self.grid.corners(cell as usize);
            let nodes = corners.nodes();
            let shape = ElementShape::from_nodes::<D>(nodes.len());
            for places in shape.map(|shape| shape.sides::<D>()).unwrap_or_default() {
                let mut side = [u32::MAX; 4];
                side.iter_mut().zip(*places).for_each(|(node, &k)| *node = nodes[k]);
                side.sort_unstable();
                sides.push(side);
            }
        }
        sides.sort_unstable();
        // A side that belongs to only one full cell is part of the boundary.
        let alone = sides.chunk_by(|a, b| a == b).filter(|same| same.len() == 1);
        let border: HashSet<u32> = alone.flat_map(|side| side[0]).collect();
        for FilledCell { cell, parts, full } in filled {
            let corners = self.grid.corners(*cell as usize);
            let is_outer = !full || corners.nodes().iter().any(|node| border.contains(node));
            seeds[parts.clone()].iter_mut().for_each(|seed| seed.outer_layer = is_outer);
        }
    }

    /// The points of the even subdivision of a cell, and their number.
    fn parts(
        &self,
        cell: usize,
        boxes: Option<[usize; D]>,
        simplices: Option<usize>,
    ) -> Result<(Parts<'_, D>, usize), FillError> {
        let corners = self.grid.corners(cell);
        let shape = ElementShape::from_nodes::<D>(corners.nodes().len()).unwrap_or(ElementShape::Box);
        let x: Vec<[f64; D]> = corners.nodes().iter().map(|&n| self.grid.node_position(n as usize)).collect();
        if shape == ElementShape::Simplex {
            let n = simplices.ok_or(FillError::NoCount(shape))?;
            return Ok(self.points(subdivide_simplex(&x, n).ok_or(FillError::Uneven(n))?));
        }
        let n = boxes.ok_or(FillError::NoCount(shape))?;
        if let Some(lines) = self.grid.lines() {
            let whole = self.grid.spacing(cell);
            let sides = std::array::from_fn(|d| whole[d] / n[d] as f64);
            let point = move |x: [f64; D]| {
                let end = |sign: f64| std::array::from_fn(|d| x[d] + sign * 0.5 * sides[d]);
                self.brick(x, [end(-1.0), end(1.0)], sides)
            };
            let parts = brick_parts(lines, n, cell).map(move |part| point(part.position));
            return Ok((Box::new(parts), n.iter().product()));
        }
        Ok(self.points(subdivide_box(&x, n).unwrap_or_default()))
    }

    fn points(&self, parts: Vec<ElementPart<D>>) -> (Parts<'_, D>, usize) {
        let n = parts.len();
        (Box::new(parts.into_iter().map(|part| self.point(part))), n)
    }

    /// The point that stands for a part of a cell of any shape.
    fn point(&self, part: ElementPart<D>) -> Seed<D> {
        let mut seed = self.seed(part.position, part.volume);
        match self.domain {
            DomainKind::Corners => seed.corners = part.corners,
            DomainKind::None if self.needs_boxes => seed.half_lengths = box_of(&part),
            DomainKind::None | DomainKind::Box => (),
        }
        seed
    }
}

/// Half lengths of the box with which a standard point in a part of a cell touches tools, [length]: those of the part
/// if its sides lie along the axes, otherwise those of a square (cube) of the same volume.
fn box_of<const D: usize>(part: &ElementPart<D>) -> [f64; D] {
    let ends = |d: usize| {
        let along = part.corners.iter().map(|corner| corner[d]);
        along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [x.min(low), x.max(high)])
    };
    let sides: [f64; D] = std::array::from_fn(|d| ends(d)[1] - ends(d)[0]);
    let is_filled = (sides.iter().product::<f64>() - part.volume).abs() <= 1e-9 * part.volume;
    if is_filled { sides.map(|side| 0.5 * side) } else { [0.5 * part.volume.powf(1.0 / D as f64); D] }
}
