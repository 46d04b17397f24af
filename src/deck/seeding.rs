//! Fills bodies with material points.

use std::collections::BTreeMap;

use super::build::{pair, per_axis};
use super::{BodyDeck, PerAxis, Shape, region};
use crate::basis::DomainKind;
use crate::grid::subdivide::subdivide_triangle;
use crate::grid::{Grid, Structured};
use crate::points::Seed;

/// Relative distance to a grid line within which a side of a box counts as lying on it.
const ON_LINE: f64 = 1e-6;

/// Why a body cannot be filled: a code, the key of the body that is to blame, and what to do.
pub(super) struct Fault {
    pub(super) code: &'static str,
    pub(super) key: &'static str,
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

/// Message and help for the name of a physical group that does not exist.
pub(super) fn unknown_group(grid: &dyn Grid<2>, name: &str) -> (String, String) {
    let names = grid.set_names();
    let help = if grid.structured().is_some() {
        "physical groups exist on grids of type `gmsh` only".to_owned()
    } else if names.is_empty() {
        "the mesh has no physical groups".to_owned()
    } else {
        let list: Vec<String> = names.iter().map(|n| format!("`{n}`")).collect();
        format!("the physical groups are {}", list.join(", "))
    };
    (format!("there is no physical group `{name}` of this kind"), help)
}

impl Filling<'_> {
    /// The points of a body, as its deck says.
    pub(super) fn fill(&self, deck: &BodyDeck) -> Result<Filled, Fault> {
        for group in region::groups(&deck.shape) {
            if self.grid.cell_set(group).is_none() {
                let (message, help) = unknown_group(self.grid, group);
                return Err(Fault { code: "D031", key: "/shape", message, help });
            }
        }
        let box_on_lines = match (&deck.shape, self.grid.structured(), &deck.points_per_cell) {
            (Shape::Box { min, max }, Some(grid), Some(counts)) => self.box_on_lines(grid, min, max, counts),
            _ => None,
        };
        let seeds = match (box_on_lines, &deck.point_spacing) {
            (Some(seeds), _) => seeds,
            (None, Some(spacing)) => self.lattice(&deck.shape, per_axis(spacing))?,
            (None, None) => self.cell_by_cell(deck)?,
        };
        if seeds.is_empty() {
            return Err(Fault {
                code: "D028",
                key: "",
                message: format!("the body `{}` holds no material point", deck.name),
                help: "its region must hold the centre of at least one part of a cell".to_owned(),
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
    fn lattice(&self, shape: &Shape, spacing: [f64; 2]) -> Result<Vec<Seed<2>>, Fault> {
        let Some([min, max]) = region::bounds(shape) else {
            return Err(Fault {
                code: "D023",
                key: "/point_spacing",
                message: "a region of whole cells cannot be filled at a spacing".to_owned(),
                help: "give `points_per_cell` or `points_per_triangle`".to_owned(),
            });
        };
        let n: [usize; 2] =
            std::array::from_fn(|d| (((max[d] - min[d]) / spacing[d] - ON_LINE).ceil() as usize).max(1));
        let high = std::array::from_fn(|d| min[d] + n[d] as f64 * spacing[d]);
        Ok(self.rows(min, high, n, &|x| region::contains(shape, x, &|_| false)))
    }

    /// The parts of every cell whose centres lie in the region.
    fn cell_by_cell(&self, deck: &BodyDeck) -> Result<Vec<Seed<2>>, Fault> {
        let mut in_group: BTreeMap<&str, Vec<bool>> = BTreeMap::new();
        for group in region::groups(&deck.shape) {
            let mut member = vec![false; self.grid.n_cells()];
            for &cell in self.grid.cell_set(group).unwrap_or_default() {
                member[cell as usize] = true;
            }
            in_group.insert(group, member);
        }
        let mut seeds = Vec::new();
        let mut cell_of = Vec::new();
        let mut full = vec![false; self.grid.n_cells()];
        for cell in 0..self.grid.n_cells() {
            let in_cells = |group: Option<&str>| match group {
                None => true,
                Some(name) => in_group.get(name).is_some_and(|member| member[cell]),
            };
            let parts = self.parts(cell, deck)?;
            let all = parts.len();
            let before = seeds.len();
            seeds.extend(parts.into_iter().filter(|s| region::contains(&deck.shape, s.position, &in_cells)));
            full[cell] = seeds.len() == before + all;
            cell_of.resize(seeds.len(), cell);
        }
        self.mark_outer_layer(&mut seeds, &cell_of, &full);
        Ok(seeds)
    }

    /// The points of cells that are not full, or share a node with the border of the full ones.
    fn mark_outer_layer(&self, seeds: &mut [Seed<2>], cell_of: &[usize], full: &[bool]) {
        let mut edges: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        for cell in (0..full.len()).filter(|&c| full[c]) {
            let corners = self.grid.corners(cell);
            let nodes = corners.nodes();
            for (k, &a) in nodes.iter().enumerate() {
                let b = nodes[(k + 1) % nodes.len()];
                *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
            }
        }
        let mut border = vec![false; self.grid.n_nodes()];
        for ([a, b], _) in edges.into_iter().filter(|(_, n)| *n == 1) {
            border[a as usize] = true;
            border[b as usize] = true;
        }
        for (seed, &cell) in seeds.iter_mut().zip(cell_of) {
            let corners = self.grid.corners(cell);
            seed.outer_layer = !full[cell] || corners.nodes().iter().any(|&node| border[node as usize]);
        }
    }

    /// The points of the even subdivision of a cell.
    fn parts(&self, cell: usize, deck: &BodyDeck) -> Result<Vec<Seed<2>>, Fault> {
        let corners = self.grid.corners(cell);
        let x: Vec<[f64; 2]> = corners.nodes().iter().map(|&n| self.grid.node_position(n as usize)).collect();
        let missing = |key: &str, kind: &str| Fault {
            code: "D023",
            key: "",
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
                key: "/method",
                message: "this method needs quadrilateral cells, and the grid has triangles".to_owned(),
                help: "use method `mpm` on triangles".to_owned(),
            });
        }
        let parts = subdivide_triangle(n as usize).ok_or_else(|| Fault {
            code: "D009",
            key: "/points_per_triangle",
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
