//! Estimates the size and the memory of an analysis before any body is filled.

use crate::diagnostic::{Diagnostic, Severity};
use crate::per_axis::per_axis;
use crate::source::Source;
use crate::{BodyDeck, Deck, GridDeck, LinearChoice, OutputDeck};
use mpm_core::basis::{DomainKind, Method};
use mpm_core::grid::Grid;
use mpm_core::linear::Extent;
use mpm_core::memory::{Bound, Memory, in_words};
use mpm_core::ranks::Ranks;
use mpm_core::region::{Accuracy, Region};
use mpm_files::fields::PointField;

/// Memory of the program itself, [byte]: the peak of an analysis of two points, about 24 MB in a release build.
const PROGRAM: f64 = 24e6;
/// Memory per grid node, [byte].
const PER_NODE: f64 = 10.0;
/// Memory of the stiffness and the preconditioner of an iterative solution per unknown, [byte]: first in the plane
/// (counted), then in space (measured). The first value of each pair is for points that reach only the nodes of their
/// cell, the second for domains that reach beyond it.
const ITERATIVE: [[f64; 2]; 2] = [[450.0, 850.0], [1200.0, 4500.0]];

/// Memory of an iterative solution on a mesh, on several ranks, relative to that on a structured grid: the algebraic
/// multigrid stores a second matrix and the coarser matrices. Measured for 24³ hexahedra: 3.6.
const ALGEBRAIC: f64 = 4.0;
/// Memory per point for the order of points, and for their volumes and numbers in files, [byte].
const MAKING: f64 = 50.0;
/// Required accuracy of the volume of a region.
const ROUGHLY: Accuracy = Accuracy { relative: 1e-2, lines: 20_000 };
/// Fraction of the memory limit above which the estimate causes a warning.
const MUCH: f64 = 0.8;
/// Address space that each thread reserves for products of dense matrices, [byte]; hardly any of it is used.
const PER_THREAD: f64 = 67_108_864.0;

/// Memory per point without output files, and memory of the stiffness and its factor relative to N log₂ N in the plane
/// and to N^(4/3) in space with N unknowns, [byte]. Measured, see `docs/performance.md`.
fn costs<const D: usize>(method: Method) -> (f64, f64) {
    if D > 2 {
        return match method {
            Method::Mpm => (550.0, 290.0),
            Method::Gimp => (950.0, 720.0),
            Method::Cpdi1 | Method::Cpdi2 => (2150.0, 720.0),
        };
    }
    match method {
        Method::Mpm => (900.0, 120.0),
        Method::Gimp => (1000.0, 290.0),
        Method::Cpdi1 | Method::Cpdi2 => (1200.0, 290.0),
    }
}

/// Memory per point for the files of a step until they are written, [byte]: the numbers in these files, and the working
/// memory to encode them.
fn cost_of_files<const D: usize>(method: Method, output: &OutputDeck) -> f64 {
    if output.every == 0 {
        return 0.0;
    }
    let is_written = |field: &&PointField| **field == PointField::Volume || output.fields.contains(field);
    let fields: usize = PointField::ALL.iter().filter(is_written).map(|field| field.components()).sum();
    let corners = match method.domain() {
        DomainKind::None => 0,
        DomainKind::Box | DomainKind::Corners => 1 << D,
    };
    let numbers = fields + 3 * (1 + corners);
    MAKING + numbers as f64 * output.precision.bytes() as f64
}

/// Estimated size of an analysis, with the memory of each part, [byte].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Size {
    pub points: f64,
    pub nodes: f64,
    pub unknowns: f64,
    pub(crate) memory_of_grid: f64,
    pub(crate) memory_of_points: f64,
    pub(crate) memory_of_stiffness: f64,
    /// True if the equations are solved iteratively.
    pub(crate) is_iterative: bool,
    /// Memory of the stiffness if several ranks solve the equations of a mesh iteratively, [byte]; `None` on a
    /// structured grid, or if the equations are factorised.
    memory_of_algebraic: Option<f64>,
    /// True if the grid is a mesh.
    pub(crate) is_mesh: bool,
    /// True if domains reach into the cells around their own.
    pub(crate) is_wide: bool,
    /// The body with the most points.
    largest_body: usize,
    /// Number of processes whose memory is estimated.
    processes: f64,
}

impl Size {
    /// Estimates the size of a deck from its grid and regions, before any body is filled. An unsymmetric stiffness and
    /// its factors have twice the entries of a symmetric one.
    pub(crate) fn new<const D: usize>(
        deck: &Deck,
        grid: &dyn Grid<D>,
        regions: &[Region<D>],
        is_symmetric: bool,
    ) -> Size {
        let nodes = grid.n_nodes() as f64;
        let whole = grid.total_volume();
        let (mut points, mut memory_of_points, mut cells, mut factor) = (0.0, 0.0, 0.0, 0.0_f64);
        let mut largest = (0.0, 0);
        for (number, (body, region)) in deck.bodies.iter().zip(regions).enumerate() {
            let cell = cell_volume(grid, region, whole);
            let all = volume_of(region);
            let volume = all.min(whole);
            // With `point_spacing`, points outside the grid exist until they are detected.
            let seeded = if body.point_spacing.is_some() { all } else { volume };
            let n = match region.as_mesh() {
                Some((_, cells, _)) => cells.len() as f64 * in_each_cell::<D>(body, true).max(1.0),
                None => seeded * density::<D>(body, deck, cell),
            };
            if n > largest.0 {
                largest = (n, number);
            }
            let (per_point, per_unknown) = costs::<D>(body.method);
            points += n;
            memory_of_points += n * (per_point + cost_of_files::<D>(body.method, &deck.output));
            cells += volume / cell;
            factor = factor.max(per_unknown);
        }
        // Domains reach into the cells around a body; a body thinner than a cell still touches the nodes of this cell.
        let border =
            if deck.bodies.iter().any(|b| b.method.domain() != DomainKind::None) { 3.0 } else { 1.0 };
        let active = (cells.powf(1.0 / D as f64) + border).powi(D as i32).min(nodes);
        let unknowns = D as f64 * active;
        // Fill-in of nested dissection, with lines as separators of a square and faces as separators of a cube.
        let fill = if D > 2 { unknowns.powf(4.0 / 3.0) } else { unknowns * unknowns.max(2.0).log2() };
        let reach = if border > 1.0 { 2.0 } else { 1.0 };
        let is_mesh = !grid.coarsens();
        let iterates = match deck.solver.linear {
            LinearChoice::Direct => false,
            LinearChoice::Iterative => true,
            LinearChoice::Auto => {
                let near = (2.0_f64 * reach + 1.0).powi(D as i32);
                Extent { nodes: active, reach, pairs: 0.5 * (near + 1.0) * active }.is_large::<D>(!is_mesh)
            }
        };
        let is_iterative = iterates && !is_mesh;
        let triangles = if is_symmetric { 1.0 } else { 2.0 };
        let iterative = triangles * ITERATIVE[usize::from(D > 2)][usize::from(reach > 1.0)] * unknowns;
        Size {
            points,
            nodes,
            unknowns,
            is_iterative,
            is_mesh,
            is_wide: reach > 1.0,
            memory_of_grid: PER_NODE * nodes,
            memory_of_points,
            memory_of_stiffness: if is_iterative { iterative } else { triangles * factor * fill },
            memory_of_algebraic: (iterates && is_mesh).then_some(ALGEBRAIC * iterative),
            largest_body: largest.1,
            processes: 1.0,
        }
    }

    /// The size, with memory counted only for the parts that the ranks on this machine hold. Collective: every rank
    /// must call this.
    pub(crate) fn local(self, ranks: &Ranks) -> Size {
        if ranks.is_alone() {
            return self;
        }
        let mut size = self.on_several_ranks();
        size.processes = ranks.on_this_machine() as f64;
        let part = size.processes / ranks.count() as f64;
        size.memory_of_grid *= size.processes;
        size.memory_of_points *= part;
        size.memory_of_stiffness *= part;
        size
    }

    /// The size if several ranks solve the equations.
    pub(crate) fn on_several_ranks(mut self) -> Size {
        if let Some(memory) = self.memory_of_algebraic {
            (self.is_iterative, self.memory_of_stiffness) = (true, memory);
        }
        self
    }

    /// Estimated peak memory of the analysis, [byte].
    pub(crate) fn memory(&self) -> f64 {
        PROGRAM * self.processes + self.memory_of_grid + self.memory_of_points + self.memory_of_stiffness
    }

    /// Compares the estimate with the memory: an error if it exceeds the limit or the free address space, a warning if
    /// it exceeds the memory that is free now or comes close to the limit.
    pub(crate) fn judge(&self, deck: &Deck, source: &Source, memory: &Memory) -> Option<Diagnostic> {
        let needed = self.memory();
        let (limit, available) = (memory.limit as f64, memory.available as f64);
        let has = match memory.bound {
            Bound::Machine => "this machine has",
            Bound::ControlGroup => "the control group of this program may use",
            Bound::AddressSpace => "`ulimit -v` allows",
        };
        let needs = format!("the analysis needs about {} of memory", in_words(needed));
        let is_of_addresses = memory.bound == Bound::AddressSpace;
        let reserved = if is_of_addresses { PER_THREAD * rayon::current_num_threads() as f64 } else { 0.0 };
        let memory_in_words = |word: &str| {
            format!("{needs}; {has} {}, of which {} {word}", in_words(limit), in_words(available))
        };
        // The program does not return address space that it has taken.
        let (severity, message) = if is_of_addresses && needed <= limit && needed - PROGRAM > available {
            (Severity::Error, memory_in_words("is left"))
        } else if needed <= limit && is_of_addresses && needed - PROGRAM + reserved > available {
            let more = format!("; its threads reserve another {} of address space", in_words(reserved));
            (Severity::Warning, memory_in_words("is left") + &more)
        } else if needed > limit {
            (Severity::Error, format!("{needs}; {has} {}", in_words(limit)))
        } else if needed > available {
            (Severity::Warning, memory_in_words("is free now"))
        } else if needed > MUCH * limit {
            (Severity::Warning, format!("{needs}; {has} {}", in_words(limit)))
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

    /// The key in the deck that causes most of the memory demand, and the remedy.
    pub(crate) fn largest_part(&self, deck: &Deck) -> (String, &'static str) {
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
            return (
                format!("/bodies/{}/point_spacing", self.largest_body),
                "use a larger spacing of the points",
            );
        } else if body.points_per_cell.is_some() {
            "points_per_cell"
        } else if deck.dimensions() > 2 {
            "points_per_tetrahedron"
        } else {
            "points_per_triangle"
        };
        (format!("/bodies/{}/{key}", self.largest_body), "use fewer points, or larger cells")
    }
}

/// Formats a count with as many digits as an estimate deserves.
fn count(n: f64) -> String {
    if n < 1e4 { format!("{n:.0}") } else { format!("{n:.1e}") }
}

/// Mean volume (area) of the cells in the bounds of a region if the grid is graded, otherwise of all cells.
fn cell_volume<const D: usize>(grid: &dyn Grid<D>, region: &Region<D>, whole: f64) -> f64 {
    let mean = whole / grid.n_cells().max(1) as f64;
    let Some(lines) = grid.lines().filter(|lines| !lines.is_even()) else { return mean };
    let ([low, high], [first, last]) = (region.bounds(), grid.bounds());
    let along = |d: usize| {
        let (from, to) = (low[d].max(first[d]), high[d].min(last[d]));
        let axis = &lines.axes()[d];
        (to - from) / (axis.coordinate(to) - axis.coordinate(from))
    };
    let volume: f64 = (0..D).map(along).product();
    if volume > 0.0 && volume.is_finite() { volume } else { mean }
}

/// Number of points of a body per volume (area).
fn density<const D: usize>(body: &BodyDeck, deck: &Deck, cell: f64) -> f64 {
    if let Some(spacing) = &body.point_spacing {
        return 1.0 / per_axis::<f64, D>(spacing).iter().product::<f64>();
    }
    // Which cells of a mixed mesh the body fills is not known yet.
    in_each_cell::<D>(body, matches!(deck.grid, GridDeck::Gmsh { .. })) / cell
}

/// Largest number of points of a body in a cell; of a mesh, if `is_mesh` is true.
fn in_each_cell<const D: usize>(body: &BodyDeck, is_mesh: bool) -> f64 {
    let in_box = body
        .points_per_cell
        .as_ref()
        .map_or(0.0, |counts| per_axis::<u32, D>(counts).iter().map(|n| f64::from(*n)).product());
    let in_simplex = if D > 2 { body.points_per_tetrahedron } else { body.points_per_triangle };
    f64::max(in_box, f64::from(in_simplex.filter(|_| is_mesh).unwrap_or(0)))
}

/// Approximate volume (area) of a region; the volume of its bounds where groups of cells meet other regions.
fn volume_of<const D: usize>(region: &Region<D>) -> f64 {
    let [low, high] = region.bounds();
    let around = (0..D).map(|d| (high[d] - low[d]).max(0.0)).product();
    region.volume(ROUGHLY).map_or(around, |volume| volume.value)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::load::load_text;
    use crate::region::{WithoutFiles, region};
    use mpm_core::grid::Structured;

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
        size_of(&loaded.deck)
    }

    fn size_of(deck: &Deck) -> Size {
        let grid = Structured::<2>::new([0.0; 2], [0.5; 2], [40, 20]);
        let mut given = WithoutFiles { grid: Some(grid.bounds()) };
        let region = region(&deck.bodies[0].shape, "", &mut given).ok().unwrap();
        Size::new(deck, &grid, &[region], true)
    }

    #[test]
    fn sizes_are_those_of_the_model() {
        let boxed = size("{type: box, min: [0, 0], max: [10, 10]}", "points_per_cell: [2, 3], method: mpm");
        assert_eq!((boxed.points, boxed.nodes, boxed.unknowns), (2400.0, 861.0, 882.0));
        let ring = "{type: difference, from: {type: circle, center: [5, 5], radius: 4},
            minus: [{type: circle, center: [5, 5], radius: 2}]}";
        let ring_size = size(ring, "point_spacing: 0.1, method: mpm");
        let exact = 100.0 * std::f64::consts::PI * 12.0;
        assert!((ring_size.points / exact - 1.0).abs() < 0.01, "{ring_size:?}");
        assert_eq!(size("{type: cells}", "points_per_cell: 2").points, 3200.0);
    }

    /// The estimate for a body on a graded grid counts the cells in which the body lies.
    #[test]
    fn sizes_on_a_graded_grid_are_those_of_the_cells_at_hand() {
        let spacing = "spacing: [[{to: 2, cells: 20}, {to: 20, cells: 6, ratio: 1.5}], 0.5]";
        let text = DECK.replace("spacing: 0.5", spacing).replace("METHOD", "points_per_cell: 3, method: mpm");
        for (to, cells) in [("2, 10", 20.0 * 20.0), ("20, 10", 26.0 * 20.0)] {
            let text = text.replace("SHAPE", &format!("{{type: box, min: [0, 0], max: [{to}]}}"));
            let loaded =
                load_text("deck", text.as_bytes(), &[]).unwrap_or_else(|failure| panic!("{failure}"));
            let (model, points) = crate::build::build::<2>(&loaded).unwrap();
            let mut given = WithoutFiles { grid: Some(model.grid.bounds()) };
            let region = region(&loaded.deck.bodies[0].shape, "", &mut given).ok().unwrap();
            let size = Size::new(&loaded.deck, model.grid.as_ref(), &[region], true);
            assert_eq!(points.len() as f64, 9.0 * cells);
            assert!((size.points / (9.0 * cells) - 1.0).abs() < 1e-12, "{size:?}");
        }
    }

    #[test]
    fn too_much_memory_is_refused_and_nearly_all_is_warned_of() {
        let text = DECK
            .replace("SHAPE", "{type: box, min: [0, 0], max: [10, 10]}")
            .replace("METHOD", "points_per_cell: 350");
        let loaded = load_text("deck", text.as_bytes(), &[]).unwrap();
        let size = size_of(&loaded.deck);
        assert_eq!(size.points, 49e6);
        let needed = size.memory();
        assert!((4e10..1e11).contains(&needed), "{needed:e}");
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
        let process_message = |available: f64| {
            let (limit, available) = (2.0 * needed, available);
            let memory =
                Memory { limit: limit as u64, available: available as u64, bound: Bound::AddressSpace };
            size.judge(&loaded.deck, &loaded.source, &memory).map(|found| (found.severity, found.message))
        };
        let threads = rayon::current_num_threads() as f64;
        assert_eq!(process_message(needed + PER_THREAD * threads), None);
        let (severity, message) = process_message(needed).unwrap();
        assert_eq!(severity, Severity::Warning);
        assert!(message.contains("its threads reserve another"), "{message}");
        let (severity, message) = process_message(0.9 * needed).unwrap();
        assert!(severity == Severity::Error && message.ends_with("is left"), "{message}");
    }
}
