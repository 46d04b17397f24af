//! How large an analysis will be and how much memory it will need, known before any of it is taken.

use super::build::per_axis;
use super::diagnostic::{Diagnostic, Severity};
use super::source::Source;
use super::{BodyDeck, Deck, GridDeck, Shape, region};
use crate::basis::{DomainKind, Method};
use crate::grid::Grid;
use crate::memory::{Bound, Memory, in_words};

/// Memory of the program itself, [byte].
const PROGRAM: f64 = 10e6;
/// Memory per grid node, [byte].
const PER_NODE: f64 = 10.0;
/// Places at which a region without a formula for its area is tried, along each axis.
const SAMPLES: usize = 200;
/// Part of the memory from which on there is a warning.
const MUCH: f64 = 0.8;

/// The memory that an analysis on a grid will need at most, estimated from its deck, [byte].
pub fn predicted_memory(deck: &Deck, grid: &dyn Grid<2>) -> f64 {
    Size::of(deck, grid).memory()
}

/// Memory per point without output files and what writing them adds, and memory of the stiffness and its factor
/// relative to N log₂ N with N unknowns, [byte]. Measured, see `docs/performance.md`.
fn costs(method: Method) -> (f64, f64, f64) {
    match method {
        Method::Mpm => (950.0, 750.0, 120.0),
        Method::Gimp => (950.0, 1000.0, 290.0),
        Method::Cpdi1 | Method::Cpdi2 => (1160.0, 1250.0, 290.0),
    }
}

/// The size of an analysis, estimated; the memory is that of each part, [byte].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    pub points: f64,
    pub nodes: f64,
    pub unknowns: f64,
    memory_of_grid: f64,
    memory_of_points: f64,
    memory_of_stiffness: f64,
    /// The body with the most points.
    largest_body: usize,
}

impl Size {
    /// Of a deck on a grid, which may be described but must not be filled yet.
    pub(super) fn of(deck: &Deck, grid: &dyn Grid<2>) -> Size {
        let nodes = grid.n_nodes() as f64;
        let [low, high] = grid.bounds();
        let area_of_cell = (high[0] - low[0]) * (high[1] - low[1]) / grid.n_cells().max(1) as f64;
        let (mut points, mut memory_of_points, mut cells, mut factor) = (0.0, 0.0, 0.0, 0.0_f64);
        let mut largest = (0.0, 0);
        for (number, body) in deck.bodies.iter().enumerate() {
            let area = area_within(&body.shape, grid);
            let n = area * density(body, deck, area_of_cell);
            if n > largest.0 {
                largest = (n, number);
            }
            let (per_point, of_output, per_unknown) = costs(body.method);
            points += n;
            memory_of_points += n * (per_point + if deck.output.every > 0 { of_output } else { 0.0 });
            cells += area / area_of_cell;
            factor = factor.max(per_unknown);
        }
        // Domains reach into the cells around a body; a body thinner than a cell still touches its nodes.
        let border =
            if deck.bodies.iter().any(|b| b.method.domain() != DomainKind::None) { 3.0 } else { 1.0 };
        let active = (cells.sqrt() + border).powi(2).min(nodes);
        let unknowns = 2.0 * active;
        Size {
            points,
            nodes,
            unknowns,
            memory_of_grid: PER_NODE * nodes,
            memory_of_points,
            memory_of_stiffness: factor * unknowns * unknowns.max(2.0).log2(),
            largest_body: largest.1,
        }
    }

    /// The memory that the analysis will need at most, [byte].
    pub(super) fn memory(&self) -> f64 {
        PROGRAM + self.memory_of_grid + self.memory_of_points + self.memory_of_stiffness
    }

    /// What is to be said about it where this memory can be had: an error when it is not enough, a warning when it
    /// hardly is.
    pub(super) fn judge(&self, deck: &Deck, source: &Source, memory: &Memory) -> Option<Diagnostic> {
        let needed = self.memory();
        let (limit, available) = (memory.limit as f64, memory.available as f64);
        let has = match memory.bound {
            Bound::Machine => "this machine has",
            Bound::ControlGroup => "the control group of this program may use",
            Bound::AddressSpace => "`ulimit -v` allows",
        };
        let needs = format!("the analysis needs about {} of memory", in_words(needed));
        let (severity, message) = if needed > limit {
            (Severity::Error, format!("{needs}, {has} {}", in_words(limit)))
        } else if needed > available {
            let free = in_words(available);
            (Severity::Warning, format!("{needs}, {has} {}, of which {free} are free now", in_words(limit)))
        } else if needed > MUCH * limit {
            (Severity::Warning, format!("{needs}, {has} {}", in_words(limit)))
        } else {
            return None;
        };
        let (pointer, help) = self.largest_part(deck);
        let parts = format!(
            "about {} points take {}, {} grid nodes {}, {} unknowns {}",
            count(self.points),
            in_words(self.memory_of_points),
            count(self.nodes),
            in_words(self.memory_of_grid),
            count(self.unknowns),
            in_words(self.memory_of_stiffness)
        );
        let found = Diagnostic::at(source, "D036", &pointer, message).note(parts).help(help);
        Some(found.severity(severity))
    }

    /// The place in the deck that takes the most memory, and what to do about it.
    fn largest_part(&self, deck: &Deck) -> (String, &'static str) {
        let grid = match deck.grid {
            GridDeck::Structured { .. } => "/grid/spacing",
            GridDeck::Gmsh { .. } => "/grid/file",
        };
        if self.memory_of_points < self.memory_of_grid.max(self.memory_of_stiffness) {
            return (
                grid.to_owned(),
                "use larger cells, or a grid that reaches no farther than the bodies move",
            );
        }
        let body = &deck.bodies[self.largest_body];
        let key = if body.point_spacing.is_some() {
            "point_spacing"
        } else if body.points_per_cell.is_some() {
            "points_per_cell"
        } else {
            "points_per_triangle"
        };
        (format!("/bodies/{}/{key}", self.largest_body), "use fewer points, or larger cells")
    }
}

/// A number of things, with as many digits as an estimate has.
fn count(n: f64) -> String {
    if n < 1e4 { format!("{n:.0}") } else { format!("{n:.1e}") }
}

/// Points of a body per area.
fn density(body: &BodyDeck, deck: &Deck, area_of_cell: f64) -> f64 {
    if let Some(spacing) = &body.point_spacing {
        let [x, y] = per_axis(spacing);
        return 1.0 / (x * y);
    }
    let in_quadrilateral = body.points_per_cell.as_ref().map_or(0.0, |counts| {
        let [x, y] = per_axis(counts);
        f64::from(x) * f64::from(y)
    });
    // Of a mesh with both kinds of cells it is not known which of them the body fills.
    let in_triangle = match deck.grid {
        GridDeck::Gmsh { .. } => f64::from(body.points_per_triangle.unwrap_or(0)),
        GridDeck::Structured { .. } => 0.0,
    };
    in_quadrilateral.max(in_triangle) / area_of_cell
}

/// Area of a region, as far as it can lie in a grid. What is cut out of a region of whole cells is not counted.
fn area_within(shape: &Shape, grid: &dyn Grid<2>) -> f64 {
    let [low, high] = grid.bounds();
    let whole = (high[0] - low[0]) * (high[1] - low[1]);
    let area = match (region::area(shape), region::bounds(shape), shape) {
        (Some(area), ..) => area,
        (None, Some(bounds), _) => sampled(shape, bounds),
        (.., Shape::Cells { group: Some(name) }) => {
            let cells = grid.cell_set(name).unwrap_or_default();
            cells.iter().map(|&cell| grid.volume(cell as usize)).sum()
        }
        (.., Shape::Union { of }) => of.iter().map(|part| area_within(part, grid)).sum(),
        (.., Shape::Difference { from, .. }) => area_within(from, grid),
        _ => whole,
    };
    area.min(whole)
}

/// Area of a region inside bounds, by trying.
fn sampled(shape: &Shape, [low, high]: region::Bounds) -> f64 {
    let at = |d: usize, k: usize| low[d] + (high[d] - low[d]) * (k as f64 + 0.5) / SAMPLES as f64;
    let inside = (0..SAMPLES * SAMPLES)
        .filter(|k| region::contains(shape, [at(0, k % SAMPLES), at(1, k / SAMPLES)], &|_| true))
        .count();
    (high[0] - low[0]) * (high[1] - low[1]) * inside as f64 / (SAMPLES * SAMPLES) as f64
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::deck::load::load_text;
    use crate::grid::Structured;

    const DECK: &str = "
version: 1
grid: {type: structured, origin: [0, 0], size: [20, 10], spacing: 0.5}
materials: {m: {model: hencky, young: 1, poisson: 0}}
bodies: [{name: a, material: m, shape: SHAPE, METHOD}]
steps: {count: 1}
";

    fn size(shape: &str, method: &str) -> Size {
        let text = DECK.replace("SHAPE", shape).replace("METHOD", method);
        let loaded = load_text("deck", text.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"));
        Size::of(&loaded.deck, &Structured::new([0.0; 2], [0.5; 2], [40, 20]))
    }

    #[test]
    fn sizes_are_those_of_the_model() {
        let of_box = size("{type: box, min: [0, 0], max: [10, 10]}", "points_per_cell: [2, 3], method: mpm");
        assert_eq!((of_box.points, of_box.nodes, of_box.unknowns), (2400.0, 861.0, 882.0));
        let ring = "{type: difference, from: {type: circle, center: [5, 5], radius: 4},
            minus: [{type: circle, center: [5, 5], radius: 2}]}";
        let of_ring = size(ring, "point_spacing: 0.1, method: mpm");
        let exact = 100.0 * std::f64::consts::PI * 12.0;
        assert!((of_ring.points / exact - 1.0).abs() < 0.01, "{of_ring:?}");
        assert_eq!(size("{type: cells}", "points_per_cell: 2").points, 3200.0);
    }

    #[test]
    fn more_than_there_is_is_refused_and_nearly_all_is_warned_of() {
        let text = DECK
            .replace("SHAPE", "{type: box, min: [0, 0], max: [10, 10]}")
            .replace("METHOD", "points_per_cell: 350");
        let loaded = load_text("deck", text.as_bytes(), &[]).unwrap();
        let size = Size::of(&loaded.deck, &Structured::new([0.0; 2], [0.5; 2], [40, 20]));
        assert_eq!(size.points, 49e6);
        let needed = size.memory();
        assert!((8e10..2e11).contains(&needed), "{needed:e}");
        let judge = |limit: f64, available: f64| {
            let memory = Memory { limit: limit as u64, available: available as u64, bound: Bound::Machine };
            size.judge(&loaded.deck, &loaded.source, &memory).map(|found| (found.severity, found.message))
        };
        assert_eq!(judge(2.0 * needed, 2.0 * needed), None);
        let (severity, message) = judge(0.99 * needed, 0.99 * needed).unwrap();
        assert_eq!(severity, Severity::Error);
        assert!(message.contains(&in_words(needed)) && message.contains("this machine has"), "{message}");
        assert_eq!(judge(1.1 * needed, 1.1 * needed).unwrap().0, Severity::Warning);
        assert_eq!(judge(2.0 * needed, 0.5 * needed).unwrap().0, Severity::Warning);
    }
}
