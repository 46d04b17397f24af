//! Fills bodies with material points.

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::per_axis::{array, per_axis};
use super::quoting::quote;
use super::region::Groups;
use super::{AXES, BodyDeck, PerAxis, Shape};
use mpm_core::basis::{DomainKind, Method};
use mpm_core::grid::element::ElementShape;
use mpm_core::grid::subdivide::{ElementPart, subdivide_box, subdivide_simplex};
use mpm_core::grid::{Axis, Grid, Structured};
use mpm_core::points::Seed;
use mpm_core::ranks::Ranks;
use mpm_core::region::{Accuracy, FilledCell, Region, Volume, brick_parts, contains_in_cell, fill};

/// Relative distance to a grid line within which a side of a box counts as on the line.
const ON_LINE: f64 = 1e-6;

/// Number of divisions of a cut cell along each axis in the plane, to measure the share of the cell in a region.
const FINE: usize = 32;
/// Number of divisions of a cut cell along each axis in space, to measure the share of the cell in a region.
const FINE_IN_SPACE: usize = 10;
/// Number of divisions of a cell along each axis, to find out whether the cell is cut.
const PROBED: usize = 8;

/// Largest number of points of a body that a rank creates.
const MOST_POINTS: f64 = 1e8;

/// A body that cannot be filled: code, the key of the body that causes it, message and remedy.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) code: &'static str,
    pub(super) key: String,
    pub(super) message: String,
    pub(super) help: String,
}

/// Points of a cell, created one by one.
type Parts<'a, const D: usize> = Box<dyn Iterator<Item = Seed<D>> + 'a>;

/// The points of a body.
pub(super) struct Filled<const D: usize> {
    /// The points that this rank creates; the shares of the ranks follow one another.
    pub(super) seeds: Vec<Seed<D>>,
    /// Number of points that ranks below this one create, and number of points that all ranks create.
    pub(super) before: usize,
    pub(super) all: usize,
    /// Volume (area) of the region, if it is known.
    pub(super) exact: Option<Volume>,
}

/// Data shared by all points of a body.
pub(super) struct Filling<'a, const D: usize> {
    pub(super) grid: &'a dyn Grid<D>,
    pub(super) region: &'a Region<D>,
    pub(super) groups: &'a Groups,
    pub(super) body: u16,
    pub(super) method: Method,
    pub(super) density: f64,
    pub(super) history: Vec<f64>,
    /// True if the model has tools, with which standard points make contact through a box.
    pub(super) touches_tools: bool,
    /// The ranks, each of which creates a share of the points.
    pub(super) ranks: &'a Ranks,
}

impl<const D: usize> Filling<'_, D> {
    /// Fills the body with points as its deck requests. All ranks fill it together.
    ///
    /// # Errors
    /// The fault that prevents it; `None` if only another rank has found one.
    pub(super) fn fill(&self, deck: &BodyDeck) -> Result<Filled<D>, Option<Fault>> {
        let seeds = self.seeds(deck);
        if self.ranks.any(seeds.is_err()) {
            return Err(seeds.err());
        }
        let (seeds, is_by_cells) = seeds.map_err(Some)?;
        let of_ranks = self.ranks.gather_all(seeds.len());
        let (before, all) = (of_ranks[..self.ranks.own()].iter().sum(), of_ranks.iter().sum());
        if all == 0 {
            return Err(Some(Fault {
                code: "D028",
                key: String::new(),
                message: format!("the body {} contains no material point", quote(&deck.name)),
                help: "its region must lie in the grid and contain the centre of at least one subdivision of a cell"
                    .to_owned(),
            }));
        }
        let exact = self.region.volume(Accuracy::default());
        let exact = exact.or_else(|| is_by_cells.then(|| self.measured()));
        Ok(Filled { seeds, before, all, exact })
    }

    /// The points that this rank creates, and whether they are parts of the cells that contain them.
    fn seeds(&self, deck: &BodyDeck) -> Result<(Vec<Seed<D>>, bool), Fault> {
        if matches!(deck.shape, Shape::Stl { .. }) {
            self.surface_in_grid(deck)?;
        }
        let box_on_lines = match (&deck.shape, self.grid.structured(), &deck.points_per_cell) {
            (Shape::Box { min, max }, Some(grid), Some(counts)) => self.box_on_lines(grid, min, max, counts),
            _ => None,
        };
        let is_by_cells = box_on_lines.is_none() && deck.point_spacing.is_none();
        let seeds = match (box_on_lines, &deck.point_spacing) {
            (Some(seeds), _) => seeds,
            (None, Some(spacing)) => self.lattice(deck, per_axis(spacing))?,
            (None, None) => self.cell_by_cell(deck)?,
        };
        Ok((seeds, is_by_cells))
    }

    /// Volume of a region of whole cells that other regions cut: the full cells, and those fine parts of the other
    /// cells whose centres lie inside.
    fn measured(&self) -> Volume {
        let fine = if D > 2 { FINE_IN_SPACE } else { FINE };
        let divide = |cell: usize| -> Result<Vec<(ElementPart<D>, bool)>, std::convert::Infallible> {
            let nodes = self.grid.corners(cell);
            let x: Vec<[f64; D]> =
                nodes.nodes().iter().map(|&n| self.grid.node_position(n as usize)).collect();
            let parts = |n: usize| match ElementShape::from_nodes::<D>(x.len()) {
                Some(ElementShape::Simplex) => subdivide_simplex(&x, n.pow(D as u32)).unwrap_or_default(),
                _ => subdivide_box(&x, [n; D]).unwrap_or_default(),
            };
            let holds = |key: usize, cell: usize| self.groups.holds(key, cell);
            let is_inside =
                |part: &ElementPart<D>| contains_in_cell(self.region, self.grid, &part.position, cell, holds);
            let is_full = parts(PROBED).iter().all(is_inside);
            Ok(parts(if is_full { 1 } else { fine }).into_iter().map(|part| (part, !is_full)).collect())
        };
        let in_group = |key: usize, cell: usize| self.groups.holds(key, cell);
        let Ok(parts) = fill(self.region, self.grid, in_group, divide, |(part, _)| part.position, self.ranks);
        let cut: f64 = parts.parts.iter().filter(|(_, is_cut)| *is_cut).map(|(part, _)| part.volume).sum();
        let mut sums = [parts.parts.iter().map(|(part, _)| part.volume).sum(), cut];
        self.ranks.sum(&mut sums);
        Volume { value: sums[0], error: 0.5 * sums[1] / fine as f64 }
    }

    fn domain(&self) -> DomainKind {
        self.method.domain()
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
        if self.domain() != DomainKind::None || self.touches_tools {
            seed.half_lengths = sides.map(|s| 0.5 * s);
        }
        if self.domain() == DomainKind::Corners {
            let corner = |c: usize| std::array::from_fn(|d| if c >> d & 1 == 1 { high[d] } else { low[d] });
            seed.corners = (0..1usize << D).map(corner).collect();
        }
        seed
    }

    /// Fills a box whose sides lie on grid lines; `None` for any other box.
    fn box_on_lines(
        &self,
        grid: &Structured<D>,
        min: &[f64],
        max: &[f64],
        counts: &PerAxis<u32>,
    ) -> Option<Vec<Seed<D>>> {
        let (min, max): ([f64; D], [f64; D]) = (array(min), array(max));
        let axes = grid.axes();
        let on_line = |d: usize, x: f64| {
            let xi = axes[d].coordinate(x);
            (xi - xi.round()).abs() <= ON_LINE
        };
        if !(0..D).all(|d| on_line(d, min[d]) && on_line(d, max[d])) {
            return None;
        }
        let per_cell = per_axis::<u32, D>(counts).map(|n| n as usize);
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
        // Neighbours of the points of this rank count as well.
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
    fn lattice(&self, deck: &BodyDeck, spacing: [f64; D]) -> Result<Vec<Seed<D>>, Fault> {
        if deck.shape.any(&|part| matches!(part, Shape::Cells { .. })) {
            return Err(Fault {
                code: "D023",
                key: "/point_spacing".to_owned(),
                message: "a region of type `cells` cannot be filled with `point_spacing`".to_owned(),
                help: format!("give {}", placed_in_cells(D)),
            });
        }
        let [min, max] = self.region.bounds();
        let along = |d: usize| ((max[d] - min[d]) / spacing[d] - ON_LINE).max(0.0);
        let count: f64 = (0..D).map(along).product();
        if count > MOST_POINTS * self.ranks.count() as f64 {
            return Err(Fault {
                code: "D028",
                key: "/point_spacing".to_owned(),
                message: format!(
                    "cutting the shape of the body {} would take {count:.1e} points; at most {:.0e} are possible",
                    quote(&deck.name),
                    MOST_POINTS * self.ranks.count() as f64,
                ),
                help: "give a larger spacing".to_owned(),
            });
        }
        if !(0..D).all(|d| min[d] < max[d]) {
            return Ok(Vec::new()); // an intersection of disjoint regions
        }
        let n: [usize; D] = std::array::from_fn(|d| (along(d).ceil() as usize).max(1));
        let axis = |d: usize| {
            let high = min[d] + n[d] as f64 * spacing[d];
            Axis::even(min[d], (high - min[d]) / n[d] as f64, n[d])
        };
        Ok(self.rows(Structured::with_axes(std::array::from_fn(axis)), |x| self.region.contains(x)))
    }

    /// Checks that a surface lies in the grid; this needs its file.
    fn surface_in_grid(&self, deck: &BodyDeck) -> Result<(), Fault> {
        let ([low, high], [from, to]) = (self.region.bounds(), self.grid.bounds());
        for d in 0..D {
            let slack = 1e-6 * (to[d] - from[d]);
            if low[d] < from[d] - slack || high[d] > to[d] + slack {
                return Err(Fault {
                    code: "D028",
                    key: "/shape".to_owned(),
                    message: format!(
                        "the surface of the body {} extends from {} to {} along {}, beyond the grid, which \
                         covers {} to {}",
                        quote(&deck.name),
                        low[d],
                        high[d],
                        AXES[d],
                        from[d],
                        to[d]
                    ),
                    help: "make the grid larger, or move the body; an `intersection` with a box keeps a part of \
                        it".to_owned(),
                });
            }
        }
        Ok(())
    }

    /// The points of those parts of every cell whose centres lie in the region.
    fn cell_by_cell(&self, deck: &BodyDeck) -> Result<Vec<Seed<D>>, Fault> {
        let cut = AtomicUsize::new(0);
        let divide = |cell: usize| {
            let (parts, n) = self.parts(cell, deck)?;
            if cut.fetch_add(n, Ordering::Relaxed) as f64 > MOST_POINTS {
                return Err(Fault {
                    code: "D028",
                    key: String::new(),
                    message: format!(
                        "cutting the shape of the body {} would take more than {MOST_POINTS:.0e} points",
                        quote(&deck.name)
                    ),
                    help: "use fewer points per cell".to_owned(),
                });
            }
            Ok(parts)
        };
        let in_group = |key: usize, cell: usize| self.groups.holds(key, cell);
        let filled = fill(self.region, self.grid, in_group, divide, |seed| seed.position, self.ranks);
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
        let of_one = sides.chunk_by(|a, b| a == b).filter(|same| same.len() == 1);
        let border: HashSet<u32> = of_one.flat_map(|side| side[0]).collect();
        for FilledCell { cell, parts, full } in filled {
            let corners = self.grid.corners(*cell as usize);
            let is_outer = !full || corners.nodes().iter().any(|node| border.contains(node));
            seeds[parts.clone()].iter_mut().for_each(|seed| seed.outer_layer = is_outer);
        }
    }

    /// The points of the even subdivision of a cell, and their number.
    fn parts(&self, cell: usize, deck: &BodyDeck) -> Result<(Parts<'_, D>, usize), Fault> {
        let corners = self.grid.corners(cell);
        let shape = ElementShape::from_nodes::<D>(corners.nodes().len()).unwrap_or(ElementShape::Box);
        let (key, of_simplex) = match D {
            3 => ("points_per_tetrahedron", deck.points_per_tetrahedron),
            _ => ("points_per_triangle", deck.points_per_triangle),
        };
        let missing = |key: &str| Fault {
            code: "D023",
            key: String::new(),
            message: format!(
                "the grid has {}, but the body does not state the number of points in each",
                shape.plural::<D>()
            ),
            help: format!("give `{key}`"),
        };
        let x: Vec<[f64; D]> = corners.nodes().iter().map(|&n| self.grid.node_position(n as usize)).collect();
        if shape == ElementShape::Simplex {
            let n = of_simplex.ok_or_else(|| missing(key))?;
            return self.simplex(&x, key, n);
        }
        let counts = deck.points_per_cell.as_ref().ok_or_else(|| missing("points_per_cell"))?;
        let n = per_axis::<u32, D>(counts).map(|n| n as usize);
        if let Some(grid) = self.grid.structured() {
            let whole = grid.sides(grid.cell_index(cell));
            let sides = std::array::from_fn(|d| whole[d] / n[d] as f64);
            let point = move |x: [f64; D]| {
                let end = |sign: f64| std::array::from_fn(|d| x[d] + sign * 0.5 * sides[d]);
                self.brick(x, [end(-1.0), end(1.0)], sides)
            };
            let parts = brick_parts(grid, n, cell).map(move |part| point(part.position));
            return Ok((Box::new(parts), n.iter().product()));
        }
        Ok(self.points(subdivide_box(&x, n).unwrap_or_default()))
    }

    fn points(&self, parts: Vec<ElementPart<D>>) -> (Parts<'_, D>, usize) {
        let n = parts.len();
        (Box::new(parts.into_iter().map(|part| self.point(part))), n)
    }

    fn simplex(&self, x: &[[f64; D]], key: &str, n: u32) -> Result<(Parts<'_, D>, usize), Fault> {
        let parts = subdivide_simplex(x, n as usize).ok_or_else(|| Fault {
            code: "D009",
            key: format!("/{key}"),
            message: match D {
                3 => format!("a tetrahedron cannot be divided evenly for {n} points"),
                _ => format!("a triangle cannot be divided evenly for {n} points"),
            },
            help: match D {
                3 => "use 1, 8, 27, … or 4".to_owned(),
                _ => "use 1, 4, 9, 16, … or 8".to_owned(),
            },
        })?;
        Ok(self.points(parts))
    }

    /// The point of a part of a cell of any shape.
    fn point(&self, part: ElementPart<D>) -> Seed<D> {
        let mut seed = self.seed(part.position, part.volume);
        if self.domain() == DomainKind::Corners {
            seed.corners = part.corners;
        }
        seed
    }
}

/// The keys that place points in cells.
pub(super) fn placed_in_cells(dimensions: usize) -> &'static str {
    match dimensions {
        3 => "`points_per_cell` or `points_per_tetrahedron`",
        _ => "`points_per_cell` or `points_per_triangle`",
    }
}
