//! Bodies that are thinner than two cells.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::Builder;
use crate::diagnostic::{Diagnostic, Severity};
use crate::quoting::quote;
use crate::region::{DeckRegion, Regions};
use mpm_core::grid::Grid;
use mpm_core::model::{BoundaryCondition, NodeSet};
use mpm_core::points::Points;
use mpm_core::region::Region;
use mpm_core::surface::Surface;

/// Thickness below which a body is thin, in cells, [-]; round-off does not make a body thin.
const CELLS: f64 = 2.0 * (1.0 - 1e-6);
/// Largest number of points of a body at which its thickness is measured.
const PLACES: usize = 200;
/// Share of these points at which a thin body is at most as thick as stated, [-].
const SHARE: f64 = 0.9;
/// Smallest length of a layer or plate relative to its thickness, [-]; a compact body of few cells is not thin.
const SLENDER: f64 = 3.0;
/// Step at which a body is examined along a line, in cells, [-].
const STEP: f64 = 1.0 / 16.0;
/// Number of bisections that locate the end of a body on a line.
const BISECTIONS: usize = 30;
/// Distance from the end of a body within which nodes hold it, in cells, [-].
const AT_END: f64 = 0.51;

/// How an end of a body is held against motion along an axis.
#[derive(Clone, Copy, PartialEq)]
enum Hold {
    None,
    /// Along this axis only, as on a plane of symmetry.
    Roller,
    /// Along other axes as well.
    Fixed,
}

/// What conditions hold along each axis: grid nodes, bodies by their outer layer, and positions on surfaces of bodies.
struct Held<const D: usize> {
    nodes: [BTreeSet<u32>; D],
    bodies: [BTreeSet<usize>; D],
    places: [Vec<(usize, [f64; D])>; D],
}

/// The thickness of a body at a position.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Thickness {
    /// In cells, [-].
    cells: f64,
    /// True if other bodies lie on both of its sides.
    is_between: bool,
}

impl Thickness {
    /// The thickness where no end is within reach.
    const LARGE: Thickness = Thickness { cells: f64::INFINITY, is_between: false };
}

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Warns of bodies that are thinner than two cells along a direction in which they can deform. Bodies of the same
    /// material that are present together count as one.
    pub(super) fn thin_bodies(
        &mut self,
        grid: &dyn Grid<D>,
        regions: &Regions<D>,
        points: &Points<D>,
        conditions: &[BoundaryCondition<D>],
        surfaces: &[Surface<D>],
    ) {
        let held = Held::new(conditions, surfaces);
        let mut of_body: Vec<Vec<usize>> = vec![Vec::new(); self.deck.bodies.len()];
        (0..points.len()).for_each(|p| of_body[usize::from(points.body[p])].push(p));
        for (body, own) in of_body.into_iter().enumerate() {
            let every = points.ranks.count_all(own.len()).div_ceil(PLACES).max(1);
            let places = own.into_iter().filter(|&p| (points.id[p] as usize).is_multiple_of(every));
            let places: Vec<[f64; D]> = places.map(|p| points.converged.position[p]).collect();
            let near = bodies_near(grid, regions, body, &places);
            let (alike, others) = near.into_iter().partition(|&other| self.are_alike(body, other));
            let gauge =
                Gauge { grid, regions, held: &held, body, alike, others, is_revolved: self.is_revolved() };
            let measured = places.iter().map(|x| gauge.thickness(x)).collect();
            let mut all: Vec<Thickness> = points.ranks.join(measured);
            all.sort_by(|a, b| a.cells.total_cmp(&b.cells));
            let most = (SHARE * all.len() as f64) as usize;
            let Some(found) = all.get(most.min(all.len().saturating_sub(1))) else { continue };
            let thickness = found.cells;
            if thickness < CELLS && gauge.length() >= SLENDER * thickness {
                let between = all.iter().filter(|thickness| thickness.is_between).count();
                self.thin(body, thickness, 2 * between > all.len());
            }
        }
    }

    /// True for bodies of one material that are present together, and for a body and itself.
    fn are_alike(&self, body: usize, other: usize) -> bool {
        let [own, other] = [body, other].map(|body| &self.deck.bodies[body]);
        own.material == other.material && self.deck.meet([&own.name, &other.name])
    }

    fn thin(&mut self, body: usize, thickness: f64, is_between: bool) {
        let name = quote(&self.deck.bodies[body].name);
        let error = if is_between {
            "strains in it spread into the cells beside it: a weak layer of 1 to 2 cells carries up to 30 % too much (a \
             factor of safety of 1.38 for 1.05)"
        } else {
            "with 1 to 2 cells across, a body deflects 10 to 30 % too little in bending"
        };
        let message = format!("the body {name} is only about {thickness:.1} cells thick; {error}");
        let found = Diagnostic::at(&self.loaded.source, "D073", &format!("/bodies/{body}/shape"), message);
        let help = format!(
            "use cells at most {:.2} times as large here, so that at least 3 lie across the body (`spacing` can be graded)",
            thickness / 3.0
        );
        self.found.push(found.severity(Severity::Warning).help(help));
    }
}

/// Measures the thickness of a body.
struct Gauge<'a, const D: usize> {
    grid: &'a dyn Grid<D>,
    regions: &'a Regions<D>,
    held: &'a Held<D>,
    body: usize,
    /// The bodies near this one that count as one with it, and the other ones near it.
    alike: Vec<usize>,
    others: Vec<usize>,
    is_revolved: bool,
}

impl<const D: usize> Gauge<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// The longest side of the box around the body, in cells, [-].
    fn length(&self) -> f64 {
        let [low, high] = self.regions.bodies[self.body].bounds();
        let middle = std::array::from_fn(|d| 0.5 * (low[d] + high[d]));
        let sides = self.grid.spacing(self.grid.nearest_cell(&middle) as usize);
        (0..D).map(|d| (high[d] - low[d]) / sides[d]).fold(0.0, f64::max)
    }

    fn contains(&self, bodies: &[usize], x: &[f64; D]) -> bool {
        let in_group = |key: usize, x: &[f64; D]| {
            self.grid.locate(x, None).is_some_and(|cell| self.regions.groups.holds(key, cell as usize))
        };
        bodies.iter().any(|&body| self.regions.bodies[body].contains_with(x, &in_group))
    }

    /// The smallest thickness at a position over the axes and, in the planes of two axes along which no end is held,
    /// the diagonals.
    fn thickness(&self, x: &[f64; D]) -> Thickness {
        let sides = self.grid.spacing(self.grid.nearest_cell(x) as usize);
        let mut least = Thickness::LARGE;
        let mut is_free = [false; D];
        for d in 0..D {
            let along = std::array::from_fn(|k| if k == d { sides[d] } else { 0.0 });
            let ends = self.ends(x, &along);
            let [low, high] =
                ends.map(|end| end.map_or(Hold::None, |end| self.hold(d, &at(x, &along, end), sides[d])));
            is_free[d] = low == Hold::None && high == Hold::None;
            if low != Hold::None && high != Hold::None {
                continue;
            }
            let is_symmetric = low == Hold::Roller || high == Hold::Roller;
            let found = self.chord(x, &along, ends);
            let cells = found.cells * if is_symmetric { 2.0 } else { 1.0 };
            least = smaller(least, Thickness { cells, ..found });
        }
        for (a, b) in
            (0..D).flat_map(|a| (0..a).map(move |b| (a, b))).filter(|&(a, b)| is_free[a] && is_free[b])
        {
            for sign in [-1.0, 1.0] {
                // A step of the length of a cell.
                let part = std::f64::consts::FRAC_1_SQRT_2;
                let along = std::array::from_fn(|k| match k {
                    k if k == a => part * sides[a],
                    k if k == b => sign * part * sides[b],
                    _ => 0.0,
                });
                least = smaller(least, self.chord(x, &along, self.ends(x, &along)));
            }
        }
        least
    }

    /// The thickness along a chord.
    fn chord(&self, x: &[f64; D], along: &[f64; D], ends: [Option<f64>; 2]) -> Thickness {
        let [Some(low), Some(high)] = ends else { return Thickness::LARGE };
        let is_between =
            [low - STEP, high + STEP].into_iter().all(|t| self.contains(&self.others, &at(x, along, t)));
        Thickness { cells: high - low, is_between }
    }

    /// Where the body ends on both sides of a position, in cells along a direction; `None` if this is two cells or more
    /// away.
    fn ends(&self, x: &[f64; D], along: &[f64; D]) -> [Option<f64>; 2] {
        [-1.0, 1.0].map(|sign| {
            let is_in = |t: f64| self.contains(&self.alike, &at(x, along, sign * t));
            let steps = (CELLS / STEP).ceil() as usize;
            let outside = (1..=steps).map(|k| k as f64 * STEP).find(|t| !is_in(*t))?;
            let (mut inside, mut outside) = (outside - STEP, outside);
            for _ in 0..BISECTIONS {
                let middle = 0.5 * (inside + outside);
                if is_in(middle) { inside = middle } else { outside = middle }
            }
            Some(sign * outside)
        })
    }

    /// How the body is held along an axis at one of its ends.
    fn hold(&self, axis: usize, end: &[f64; D], side: f64) -> Hold {
        if self.is_revolved && axis == 0 && end[0].abs() < AT_END * side {
            return Hold::Roller;
        }
        let near =
            |node: &u32| (self.grid.node_position(*node as usize)[axis] - end[axis]).abs() < AT_END * side;
        let corners = self.grid.corners(self.grid.nearest_cell(end) as usize);
        let nodes: Vec<u32> = corners.nodes().iter().copied().filter(near).collect();
        let is_held = |d: usize| {
            let by_nodes = !nodes.is_empty() && nodes.iter().all(|node| self.held.nodes[d].contains(node));
            let is_near = |(body, x): &(usize, [f64; D])| {
                let reach = |k: usize| if k == axis { AT_END * side } else { side };
                *body == self.body && (0..D).all(|k| (x[k] - end[k]).abs() < reach(k))
            };
            by_nodes || self.held.bodies[d].contains(&self.body) || self.held.places[d].iter().any(is_near)
        };
        if !is_held(axis) {
            Hold::None
        } else if (0..D).all(|d| d == axis || !is_held(d)) {
            Hold::Roller
        } else {
            Hold::Fixed
        }
    }
}

impl<const D: usize> Held<D> {
    fn new(conditions: &[BoundaryCondition<D>], surfaces: &[Surface<D>]) -> Self {
        let mut held = Held {
            nodes: std::array::from_fn(|_| BTreeSet::new()),
            bodies: std::array::from_fn(|_| BTreeSet::new()),
            places: std::array::from_fn(|_| Vec::new()),
        };
        for condition in conditions {
            for d in 0..D {
                let is_along = |direction: [f64; D]| direction[d].abs() > 0.99;
                let holds = |normal: [f64; D]| {
                    let prescribed = (0..D).filter(|&k| condition.displacement[k].is_some());
                    prescribed.into_iter().any(|k| is_along(condition.direction(k, normal)))
                };
                match &condition.nodes {
                    NodeSet::Fixed(nodes) if holds([0.0; D]) => held.nodes[d].extend(nodes),
                    NodeSet::OuterLayer(body) if holds([0.0; D]) => {
                        held.bodies[d].insert(usize::from(*body));
                    }
                    NodeSet::Surface(on) => {
                        // A surface that cannot be sampled has been reported.
                        let Some(surface) = surfaces.get(on.surface) else { continue };
                        let samples = (0..surface.len()).filter(|&sample| holds(surface.normal(sample)));
                        held.places[d].extend(samples.map(|sample| (surface.body, surface.samples[sample])));
                    }
                    _ => {}
                }
            }
        }
        held
    }
}

/// The bodies whose boxes come within reach of a measurement at these positions in a body, itself included.
fn bodies_near<const D: usize>(
    grid: &dyn Grid<D>,
    regions: &Regions<D>,
    body: usize,
    places: &[[f64; D]],
) -> Vec<usize> {
    let sides = places.iter().map(|x| grid.spacing(grid.nearest_cell(x) as usize));
    let side = sides.flatten().fold(0.0, f64::max);
    let [low, high] = regions.bodies[body].bounds();
    let reach = (CELLS + 2.0 * STEP) * side;
    let is_near = |other: &usize| {
        let [from, to] = regions.bodies[*other].bounds();
        (0..D).all(|d| from[d] <= high[d] + reach && low[d] - reach <= to[d])
    };
    (0..regions.bodies.len()).filter(is_near).collect()
}

/// The position `t` cells along a direction.
fn at<const D: usize>(x: &[f64; D], along: &[f64; D], t: f64) -> [f64; D] {
    std::array::from_fn(|d| x[d] + t * along[d])
}

fn smaller(a: Thickness, b: Thickness) -> Thickness {
    if b.cells < a.cells { b } else { a }
}
