//! Fills bodies with material points.

use std::collections::HashSet;

use super::build::{pair, per_axis};
use super::diagnostic::quote;
use super::{BodyDeck, PerAxis, Shape, placing, region};
use crate::basis::DomainKind;
use crate::grid::subdivide::subdivide_triangle;
use crate::grid::{Grid, Structured};
use crate::points::Seed;

/// Relative distance to a grid line within which a side of a box counts as lying on it.
const ON_LINE: f64 = 1e-6;

/// Most points of a body.
const MOST_POINTS: f64 = 1e8;

/// Why a body cannot be filled: a code, the key of the body that is to blame, and what to do.
pub(super) struct Fault {
    pub(super) code: &'static str,
    pub(super) key: String,
    pub(super) message: String,
    pub(super) help: String,
}

/// The points of a body.
pub(super) struct Filled {
    pub(super) seeds: Vec<Seed<2>>,
    /// Area of the region, where it is known.
    pub(super) exact_area: Option<f64>,
}

/// What all points of a body share.
pub(super) struct Filling<'a> {
    pub(super) grid: &'a dyn Grid<2>,
    pub(super) body: u16,
    pub(super) domain: DomainKind,
    pub(super) density: f64,
    pub(super) history: Vec<f64>,
}

impl Filling<'_> {
    /// The points of a body, as its deck says.
    pub(super) fn fill(&self, deck: &BodyDeck) -> Result<Filled, Fault> {
        for (place, group) in region::groups(&deck.shape, "/shape") {
            if self.grid.cell_set(group).is_none() {
                let (message, help) = placing::unknown_group(self.grid, group, true);
                return Err(Fault { code: "D031", key: place, message, help });
            }
        }
        let box_on_lines = match (&deck.shape, self.grid.structured(), &deck.points_per_cell) {
            (Shape::Box { min, max }, Some(grid), Some(counts)) => self.box_on_lines(grid, min, max, counts),
            _ => None,
        };
        let seeds = match (box_on_lines, &deck.point_spacing) {
            (Some(seeds), _) => seeds,
            (None, Some(spacing)) => self.lattice(deck, per_axis(spacing))?,
            (None, None) => self.cell_by_cell(deck)?,
        };
        if seeds.is_empty() {
            return Err(Fault {
                code: "D028",
                key: String::new(),
                message: format!("the body {} holds no material point", quote(&deck.name)),
                help: "its region must be inside the grid and hold the centre of at least one part of a cell"
                    .to_owned(),
            });
        }
        Ok(Filled { seeds, exact_area: region::area(&deck.shape) })
    }

    fn seed(&self, position: [f64; 2], volume: f64) -> Seed<2> {
        Seed {
            body: self.body,
            position,
            half_lengths: [0.0; 2],
            corners: Vec::new(),
            volume,
            mass: self.density * volume,
            outer_layer: false,
            history: self.history.clone(),
        }
    }

    /// The point of a rectangle given by its lowest and highest corner.
    fn rectangle(&self, low: [f64; 2], high: [f64; 2], spacing: [f64; 2]) -> Seed<2> {
        let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        let mut seed = self.seed(middle, spacing[0] * spacing[1]);
        if self.domain != DomainKind::None {
            seed.half_lengths = spacing.map(|s| 0.5 * s);
        }
        if self.domain == DomainKind::Corners {
            seed.corners = vec![low, [high[0], low[1]], [low[0], high[1]], high];
        }
        seed
    }

    /// A box whose sides lie on grid lines, filled as a whole; `None` when they do not.
    fn box_on_lines(
        &self,
        grid: &Structured<2>,
        min: &[f64],
        max: &[f64],
        counts: &PerAxis<u32>,
    ) -> Option<Vec<Seed<2>>> {
        let (min, max) = (pair(min), pair(max));
        let h = grid.spacing();
        let on_line = |d: usize, x: f64| {
            let xi = (x - grid.origin()[d]) / h[d];
            (xi - xi.round()).abs() <= ON_LINE
        };
        if !(0..2).all(|d| on_line(d, min[d]) && on_line(d, max[d])) {
            return None;
        }
        let per_cell = per_axis(counts);
        let n = std::array::from_fn(|d| ((max[d] - min[d]) / h[d]).round() as usize * per_cell[d] as usize);
        Some(self.rows(min, max, n, &|_| true))
    }

    /// A lattice of `n` points along the sides of a box, of which those inside the region stay.
    fn rows(
        &self,
        min: [f64; 2],
        max: [f64; 2],
        n: [usize; 2],
        inside: &dyn Fn([f64; 2]) -> bool,
    ) -> Vec<Seed<2>> {
        let spacing: [f64; 2] = std::array::from_fn(|d| (max[d] - min[d]) / n[d] as f64);
        let at = |d: usize, k: f64| min[d] + k * spacing[d];
        let mut seeds = Vec::new();
        let mut kept = vec![false; n[0] * n[1]];
        for j in 0..n[1] {
            for i in 0..n[0] {
                let (x, y) = (i as f64, j as f64);
                let mut seed =
                    self.rectangle([at(0, x), at(1, y)], [at(0, x + 1.0), at(1, y + 1.0)], spacing);
                seed.position = [at(0, x + 0.5), at(1, y + 0.5)];
                if inside(seed.position) {
                    kept[j * n[0] + i] = true;
                    seeds.push(seed);
                }
            }
        }
        let full = |i: usize, j: usize| i < n[0] && j < n[1] && kept[j * n[0] + i];
        let mut next = seeds.iter_mut();
        for j in 0..n[1] {
            for i in (0..n[0]).filter(|&i| full(i, j)) {
                // Subtraction below zero wraps round to a number that is beyond the lattice.
                let around = [i.wrapping_sub(1), i, i + 1];
                let inner = [j.wrapping_sub(1), j, j + 1].iter().all(|&l| around.iter().all(|&k| full(k, l)));
                if let Some(seed) = next.next() {
                    seed.outer_layer = !inner;
                }
            }
        }
        seeds
    }

    /// Points at a stated spacing, whatever the grid.
    fn lattice(&self, deck: &BodyDeck, spacing: [f64; 2]) -> Result<Vec<Seed<2>>, Fault> {
        let shape = &deck.shape;
        let Some([min, max]) = region::bounds(shape) else {
            return Err(Fault {
                code: "D023",
                key: "/point_spacing".to_owned(),
                message: "a region of whole cells cannot be filled at a spacing".to_owned(),
                help: "give `points_per_cell` or `points_per_triangle`".to_owned(),
            });
        };
        let along = |d: usize| (max[d] - min[d]) / spacing[d] - ON_LINE;
        if along(0) * along(1) > MOST_POINTS {
            return Err(Fault {
                code: "D028",
                key: "/point_spacing".to_owned(),
                message: format!(
                    "the body {} would be cut from {:.1e} points; at most {MOST_POINTS:.0e} are possible",
                    quote(&deck.name),
                    along(0) * along(1)
                ),
                help: "give a larger spacing".to_owned(),
            });
        }
        let n: [usize; 2] = std::array::from_fn(|d| (along(d).ceil() as usize).max(1));
        let high = std::array::from_fn(|d| min[d] + n[d] as f64 * spacing[d]);
        Ok(self.rows(min, high, n, &|x| region::contains(shape, x, &|_| false)))
    }

    /// The parts of every cell whose centres lie in the region.
    fn cell_by_cell(&self, deck: &BodyDeck) -> Result<Vec<Seed<2>>, Fault> {
        let in_group = placing::members(self.grid, &deck.shape);
        let mut seeds = Vec::new();
        let mut cell_of = Vec::new();
        // The cells that hold points, and whether the region fills them.
        let mut filled: Vec<(u32, bool)> = Vec::new();
        for cell in placing::cells_near(self.grid, region::bounds(&deck.shape)) {
            let in_cells = |group: Option<&str>| match group {
                None => true,
                Some(name) => in_group.get(name).is_some_and(|member| member[cell]),
            };
            // What the deck says must suit those kinds of cells that the body may fill, not all of the grid.
            if !region::may_meet(&deck.shape, self.bounds(cell), &in_cells) {
                continue;
            }
            let parts = self.parts(cell, deck)?;
            let all = parts.len();
            let before = seeds.len();
            if seeds.len() as f64 > MOST_POINTS {
                return Err(Fault {
                    code: "D028",
                    key: String::new(),
                    message: format!("the body {} has more than {MOST_POINTS:.0e} points", quote(&deck.name)),
                    help: "use fewer points per cell".to_owned(),
                });
            }
            seeds.extend(parts.into_iter().filter(|s| region::contains(&deck.shape, s.position, &in_cells)));
            if seeds.len() > before {
                cell_of.resize(seeds.len(), filled.len() as u32);
                filled.push((cell as u32, seeds.len() == before + all));
            }
        }
        self.mark_outer_layer(&mut seeds, &cell_of, &filled);
        Ok(seeds)
    }

    /// Lowest and highest coordinates of a cell.
    fn bounds(&self, cell: usize) -> region::Bounds {
        let mut bounds = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
        for &node in self.grid.corners(cell).nodes() {
            let x = self.grid.node_position(node as usize);
            for d in 0..2 {
                bounds[0][d] = bounds[0][d].min(x[d]);
                bounds[1][d] = bounds[1][d].max(x[d]);
            }
        }
        bounds
    }

    /// The points of cells that are not full, or share a node with the border of the full ones. `cell_of` gives for
    /// each point its place in `filled`, the cells that hold points and whether the region fills them.
    fn mark_outer_layer(&self, seeds: &mut [Seed<2>], cell_of: &[u32], filled: &[(u32, bool)]) {
        let mut edges: Vec<[u32; 2]> = Vec::new();
        for &(cell, _) in filled.iter().filter(|(_, is_full)| *is_full) {
            let corners = self.grid.corners(cell as usize);
            let nodes = corners.nodes();
            for (k, &a) in nodes.iter().enumerate() {
                let b = nodes[(k + 1) % nodes.len()];
                edges.push([a.min(b), a.max(b)]);
            }
        }
        edges.sort_unstable();
        // An edge of one full cell only is part of the border.
        let of_one = edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1);
        let border: HashSet<u32> = of_one.flat_map(|edge| edge[0]).collect();
        let is_outer = |&(cell, is_full): &(u32, bool)| {
            !is_full || self.grid.corners(cell as usize).nodes().iter().any(|node| border.contains(node))
        };
        let outer: Vec<bool> = filled.iter().map(is_outer).collect();
        for (seed, &cell) in seeds.iter_mut().zip(cell_of) {
            seed.outer_layer = outer[cell as usize];
        }
    }

    /// The points of the even subdivision of a cell.
    fn parts(&self, cell: usize, deck: &BodyDeck) -> Result<Vec<Seed<2>>, Fault> {
        let corners = self.grid.corners(cell);
        let x: Vec<[f64; 2]> = corners.nodes().iter().map(|&n| self.grid.node_position(n as usize)).collect();
        let missing = |key: &str, kind: &str| Fault {
            code: "D023",
            key: String::new(),
            message: format!("the grid has {kind}, and the body does not say how many points they get"),
            help: format!("give `{key}`"),
        };
        match x.as_slice() {
            [a, b, c] => {
                let n =
                    deck.points_per_triangle.ok_or_else(|| missing("points_per_triangle", "triangles"))?;
                self.triangle([*a, *b, *c], n)
            }
            [a, b, c, d] => {
                let n = deck
                    .points_per_cell
                    .as_ref()
                    .ok_or_else(|| missing("points_per_cell", "quadrilaterals"))?;
                Ok(self.quadrilateral([*a, *b, *c, *d], per_axis(n)))
            }
            _ => Ok(Vec::new()),
        }
    }

    fn triangle(&self, x: [[f64; 2]; 3], n: u32) -> Result<Vec<Seed<2>>, Fault> {
        if self.domain != DomainKind::None {
            return Err(Fault {
                code: "D034",
                key: "/method".to_owned(),
                message: "this method needs quadrilateral cells, and the grid has triangles".to_owned(),
                help: "use method `mpm` on triangles".to_owned(),
            });
        }
        let parts = subdivide_triangle(n as usize).ok_or_else(|| Fault {
            code: "D009",
            key: "/points_per_triangle".to_owned(),
            message: format!("a triangle cannot be divided evenly for {n} points"),
            help: "use 1, 4, 9, 16, … or 8".to_owned(),
        })?;
        let area =
            0.5 * ((x[1][0] - x[0][0]) * (x[2][1] - x[0][1]) - (x[2][0] - x[0][0]) * (x[1][1] - x[0][1]));
        let place = |l: [f64; 3]| [0, 1].map(|d| l[0] * x[0][d] + l[1] * x[1][d] + l[2] * x[2][d]);
        Ok(parts.into_iter().map(|(l, weight)| self.seed(place(l), weight * area)).collect())
    }

    /// Lines of constant local coordinates divide the cell; the points are the images of the middles of the parts.
    fn quadrilateral(&self, x: [[f64; 2]; 4], n: [u32; 2]) -> Vec<Seed<2>> {
        let place = |s: f64, t: f64| {
            let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t];
            [0, 1].map(|d| (0..4).map(|k| weights[k] * x[k][d]).sum::<f64>())
        };
        let line = |k: u32, n: u32| f64::from(k) / f64::from(n);
        let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
        let mut seeds = Vec::new();
        for j in 0..n[1] {
            for i in 0..n[0] {
                let (s0, s1, t0, t1) = (line(i, n[0]), line(i + 1, n[0]), line(j, n[1]), line(j + 1, n[1]));
                let part = [place(s0, t0), place(s1, t0), place(s0, t1), place(s1, t1)];
                let diagonal = |a: usize, b: usize| [part[b][0] - part[a][0], part[b][1] - part[a][1]];
                let area = 0.5 * cross(diagonal(0, 3), diagonal(1, 2));
                let mut seed = self.seed(place(0.5 * (s0 + s1), 0.5 * (t0 + t1)), area);
                if self.domain != DomainKind::None {
                    seed.half_lengths =
                        [0, 1].map(|d| 0.25 * (diagonal(0, 3)[d].abs() + diagonal(1, 2)[d].abs()));
                }
                if self.domain == DomainKind::Corners {
                    seed.corners = part.to_vec();
                }
                seeds.push(seed);
            }
        }
        seeds
    }
}
