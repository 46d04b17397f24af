//! The gate `feasibility`: from a deck to the model and its points. Checks that need the mesh are made here.

mod initial_stress;
mod magnitudes;
mod materials;
mod moving_grid;
mod nearest;
mod nodes;
mod stages;
mod surfaces;
mod tools;
mod typical;

use std::collections::HashMap;

use super::diagnostic::{Diagnostic, Gate, Severity, assign, of_all_ranks};
use super::formulas::{self, at_nodes};
use super::gates::Ties;
use super::initial_stress::{curve_of, is_stressed};
use super::load::LoadedDeck;
use super::loads::load_curve;
use super::per_axis::array;
use super::quoting::quote;
use super::region::{FromFiles, Groups, OfDeck, Refusal, region};
use super::seeding::{Filled, fill};
use super::size::Size;
use super::{Deck, Expression, GridDeck, Idealisation};
use super::{axisymmetry, placing};
use crate::material::MaterialOfPoints;
use mpm_core::formula::Formula;
use mpm_core::grid::gmsh::{self, GmshError};
use mpm_core::grid::{Axis, CoincidentLines, Grid, Mesh, Structured};
use mpm_core::linear::Engines;
use mpm_core::memory::Memory;
use mpm_core::model::{
    Body, BoundaryCondition, Filling, Load, LoadCurve, Model, NamedMaterial, NodeSet, OnSurface, Present,
    Probe, Stepping,
};
use mpm_core::points::{Points, Seed};
use mpm_core::ranks::Ranks;
use mpm_core::region::Region;
use mpm_core::stress::Volumetric;

/// Penalty stiffness of conditions on surfaces, relative to the axial modulus divided by the cell size, [-].
const PENALTY: f64 = 10.0;

/// Difference between the area of the points and that of their region, relative to the latter, above which the
/// difference is probably unintended, [-].
const MUCH: f64 = 0.05;

/// Builds the model of a deck that passed the earlier gates, and its points; `D` must be the number of axes of the
/// deck.
///
/// # Errors
/// All faults found with this mesh, each with its location in the deck.
#[expect(private_bounds, reason = "there are two numbers of dimensions, and no other can be added")]
pub fn build<const D: usize>(loaded: &LoadedDeck) -> Result<(Model<D>, Points<D>), Vec<Diagnostic>>
where
    Region<D>: OfDeck<D>,
{
    built(loaded, Memory::this_machine(), &Ranks::default()).map(|built| (built.model, built.points))
}

/// The result of building a deck.
pub(super) struct Built<const D: usize> {
    pub(super) model: Model<D>,
    pub(super) points: Points<D>,
    /// Warnings and notes.
    pub(super) notes: Vec<Diagnostic>,
    /// Estimated peak memory of the analysis, [byte].
    pub(super) memory: f64,
}

/// Like [`build`], but with the memory limits in `memory` instead of those of this machine; `None` sets no limit. Each
/// rank gets the points in its part of the grid; all ranks get the same messages.
pub(super) fn built<const D: usize>(
    loaded: &LoadedDeck,
    memory: Option<Memory>,
    ranks: &Ranks,
) -> Result<Built<D>, Vec<Diagnostic>>
where
    Region<D>: OfDeck<D>,
{
    let mut builder = Builder::new(loaded, ranks);
    let built = builder.build(memory);
    let Builder { mut found, memory_needed, .. } = builder;
    assign(Gate::Feasibility, &mut found);
    let found = of_all_ranks(ranks, found);
    match built {
        Some((model, points)) if !found.iter().any(Diagnostic::is_error) => {
            Ok(Built { model, points, notes: found, memory: memory_needed })
        }
        _ => Err(found),
    }
}

/// The parts of a model that exist before bodies are filled.
struct Outline<const D: usize> {
    grid: Box<dyn Grid<D>>,
    regions: Vec<Region<D>>,
    groups: Groups,
    laws: Vec<MaterialOfPoints>,
    size: Size,
}

/// Estimates the size of an analysis without filling its bodies.
pub(super) fn size_of<const D: usize>(loaded: &LoadedDeck) -> Result<Size, Vec<Diagnostic>>
where
    Region<D>: OfDeck<D>,
{
    let alone = Ranks::default();
    let mut builder: Builder<D> = Builder::new(loaded, &alone);
    let outline = builder.outline();
    let mut found = builder.found;
    assign(Gate::Feasibility, &mut found);
    outline.filter(|_| !found.iter().any(Diagnostic::is_error)).map(|outline| outline.size).ok_or(found)
}

struct Builder<'a, const D: usize> {
    loaded: &'a LoadedDeck,
    deck: &'a Deck,
    found: Vec<Diagnostic>,
    body_numbers: HashMap<&'a str, usize>,
    memory_needed: f64,
    ranks: &'a Ranks,
}

/// The builder while it places loads on the points.
struct Placing<'a, 'b, const D: usize> {
    builder: &'a mut Builder<'b, D>,
    grid: &'a dyn Grid<D>,
    points: &'a Points<D>,
}

impl<'a, const D: usize> Builder<'a, D>
where
    Region<D>: OfDeck<D>,
{
    fn new(loaded: &'a LoadedDeck, ranks: &'a Ranks) -> Self {
        Builder {
            loaded,
            deck: &loaded.deck,
            found: Vec::new(),
            body_numbers: HashMap::new(),
            memory_needed: 0.0,
            ranks,
        }
    }

    /// The grid, regions and laws of the deck, and its estimated size; `None` if a fault prevents that.
    fn outline(&mut self) -> Option<Outline<D>> {
        let deck = self.deck;
        let grid = self.grid()?;
        let (regions, groups) = self.regions(grid.as_ref())?;
        let laws = self.laws(grid.as_ref(), &regions);
        self.strengths(&laws);
        let is_symmetric = laws.iter().all(|material| material.law.tangent_is_symmetric())
            && deck.bodies.iter().all(|body| body.volumetric != Volumetric::FBar);
        let size = Size::of(deck, grid.as_ref(), &regions, is_symmetric);
        Some(Outline { grid, regions, groups, laws, size })
    }

    /// The model and its points; `None`, on all ranks alike, if a fault prevents further checks.
    fn build(&mut self, memory: Option<Memory>) -> Option<(Model<D>, Points<D>)> {
        let deck = self.deck;
        if deck.dimensions() != D {
            let message = format!("the deck has {} dimensions, and {D} are needed here", deck.dimensions());
            let help = "change the idealisation".to_owned();
            self.error("D048", "/analysis/idealisation", message, help);
            return None;
        }
        self.body_numbers = deck.bodies.iter().enumerate().map(|(k, body)| (body.name.as_str(), k)).collect();
        let outline = self.outline();
        // Files may be missing on the machine of a single rank.
        if self.ranks.any(outline.is_none()) {
            return None;
        }
        let Outline { grid, regions, groups, mut laws, size } = outline?;
        self.memory_needed = size.memory();
        if size.points > f64::from(u32::MAX) {
            let message = format!(
                "there would be {:.1e} points; at most {:.1e} can be numbered",
                size.points,
                u32::MAX
            );
            let (pointer, help) = size.largest_part(deck);
            self.error("D036", &pointer, message, help.to_owned());
            return None;
        }
        let size_of_part = size.of_part(self.ranks);
        let found = memory.and_then(|memory| size_of_part.judge(deck, &self.loaded.source, &memory));
        let is_too_large = found.as_ref().is_some_and(Diagnostic::is_error);
        self.found.extend(found);
        if self.ranks.any(is_too_large || laws.len() < deck.materials.len()) {
            return None;
        }
        let bodies = self.bodies();
        let revolved = deck.analysis.idealisation == Idealisation::Axisymmetric;
        let (mut seeds, numbers) = self.seeds(grid.as_ref(), &laws, &bodies, (&regions, &groups));
        self.take_typical_points(&mut laws, &seeds, &numbers);
        self.magnitudes(grid.as_ref(), &laws);
        if revolved {
            axisymmetry::revolve(&mut seeds);
        }
        let mut points = Points::numbered(&seeds, numbers, self.ranks);
        drop(seeds);
        points.divide_by_cell(grid.as_ref());
        self.overlaps(grid.as_ref(), (&regions, &groups), &points);
        self.centres(grid.as_ref(), &points);
        let surfaces = self.surfaces(grid.as_ref(), (&regions, &groups));
        let tools = self.tools(grid.as_ref());
        let boundary_conditions = self.boundary_conditions(grid.as_ref(), &points);
        let loads = self.loads(grid.as_ref(), &points);
        if revolved {
            self.found.extend(axisymmetry::faults(self.loaded, grid.as_ref()));
        }
        let probes = self.probes(grid.as_ref(), &points);
        let curves: Vec<&LoadCurve> = (loads.iter().map(|l| &l.curve))
            .chain(boundary_conditions.iter().map(|c| &c.curve))
            .chain(tools.iter().flat_map(|tool| tool.curves()))
            .collect();
        let stepping = match &deck.steps {
            Some(steps) => self.stepping(steps, 0.0, deck.output.every, &curves),
            None => Stepping::fixed(1, deck.end_time()),
        };
        let mut model = Model {
            engines: Engines::default(),
            title: deck.title.clone().unwrap_or_default(),
            grid,
            moving_grid: None,
            revolved,
            formulation: deck.analysis.formulation,
            point_volume: deck.analysis.point_volume,
            stabilisation: deck.analysis.stabilisation,
            materials: laws.into_iter().map(|m| NamedMaterial { name: m.name, law: m.law }).collect(),
            bodies,
            surfaces,
            boundary_conditions,
            loads,
            tools,
            initial_imbalance: is_stressed(deck).then_some(deck.analysis.initial_imbalance),
            stepping,
            newton: deck.solver.newton(!deck.tools.is_empty()),
            probes,
            stages: Vec::new(),
            present: Present::default(),
        };
        self.initial_stresses(&model, &mut points, (&regions, &groups));
        self.divide(&mut model, &mut points);
        self.follow(&mut model);
        Some((model, points))
    }

    fn error(&mut self, code: &'static str, pointer: &str, message: String, help: String) {
        self.found.push(Diagnostic::at(&self.loaded.source, code, pointer, message).help(help));
    }

    fn grid(&mut self) -> Option<Box<dyn Grid<D>>> {
        match &self.deck.grid {
            GridDeck::Structured { origin, size, spacing, .. } => {
                let (origin, size): ([f64; D], [f64; D]) = (array(origin), array(size));
                let axes: Result<Vec<Axis>, CoincidentLines> =
                    (spacing.entries(D).iter().enumerate().take(D))
                        .map(|(d, entry)| entry.axis(origin[d], size[d]))
                        .collect();
                match axes.map(<[Axis; D]>::try_from) {
                    Ok(Ok(axes)) => Some(Region::boxed_lines(Structured::with_axes(axes))),
                    Ok(Err(axes)) => {
                        let message = format!("the spacing has {} entries for {D} axes", axes.len());
                        self.error("D015", "/grid/spacing", message, "give one entry per axis".to_owned());
                        None
                    }
                    Err(error) => {
                        let help = "use fewer cells, or a ratio closer to 1".to_owned();
                        self.error("D027", "/grid/spacing", error.to_string(), help);
                        None
                    }
                }
            }
            GridDeck::Gmsh { file } => {
                let averages = |body: &super::BodyDeck| body.volumetric == Volumetric::MeanDilatation;
                let needs_patches = self.deck.bodies.iter().any(averages);
                let mesh = self.mesh(file)?;
                Some(Region::boxed_mesh(if needs_patches { mesh.with_patches() } else { mesh }))
            }
        }
    }

    /// The mesh of a gmsh file; reports an error if it cannot be used.
    fn mesh(&mut self, file: &str) -> Option<Mesh<D>> {
        let path = self.loaded.directory.join(file);
        let source = &self.loaded.source;
        let read = gmsh::read_file(&path);
        // Faults in the file can only be repaired in gmsh.
        let help = match &read {
            Err(GmshError::Io(_) | GmshError::NotAFile | GmshError::TooLarge { .. }) => {
                format!("the path is relative to the deck; here it means `{}`", path.display())
            }
            Err(GmshError::NotGmsh | GmshError::Version { .. }) => {
                "save the mesh from gmsh as `.msh`, format 4.1 or 2.2".to_owned()
            }
            _ => "repair the mesh in gmsh and save it again".to_owned(),
        };
        let mesh = read
            .map_err(|error| format!("the mesh {} cannot be read: {error}", quote(file)))
            .and_then(|read| {
                Mesh::from_gmsh(&read)
                    .map_err(|error| format!("the mesh {} cannot be used: {error}", quote(file)))
            });
        match mesh {
            Ok(mesh) => {
                for warning in mesh.warnings() {
                    let message = format!("the mesh {}: {warning}", quote(file));
                    let found = Diagnostic::at(source, "D032", "/grid/file", message);
                    let help = "if this is not intended, repair the mesh in gmsh and save it again";
                    self.found.push(found.severity(Severity::Warning).help(help));
                }
                Some(mesh)
            }
            Err(message) => {
                self.error("D032", "/grid/file", message, help);
                None
            }
        }
    }

    fn body_number(&self, name: &str) -> usize {
        self.body_numbers.get(name).copied().unwrap_or(0)
    }

    /// The regions of all bodies, and the groups of cells of which they consist; `None` if any region cannot be
    /// determined.
    fn regions(&mut self, grid: &dyn Grid<D>) -> Option<(Vec<Region<D>>, Groups)> {
        let (directory, source) = (self.loaded.directory.as_path(), &self.loaded.source);
        let mut given = FromFiles { grid, directory, source, groups: Groups::default(), found: Vec::new() };
        let mut regions = Vec::new();
        for (number, body) in self.deck.bodies.iter().enumerate() {
            let place = format!("/bodies/{number}/shape");
            match region(&body.shape, &place, &mut given) {
                Ok(region) => regions.push(region),
                Err(Refusal::Numbers(place, error)) => {
                    let fault = Diagnostic::at(source, "D016", &place, error.to_string());
                    given.found.push(fault.help("change the numbers so that they enclose a region"));
                }
                Err(Refusal::Unknown) => {}
            }
        }
        let FromFiles { groups, found, .. } = given;
        self.found.extend(found);
        (regions.len() == self.deck.bodies.len()).then_some((regions, groups))
    }

    fn bodies(&self) -> Vec<Body> {
        let body = |b: &super::BodyDeck| Body {
            name: b.name.clone(),
            material: self.deck.materials.keys().position(|name| *name == b.material).unwrap_or(0),
            method: b.method,
            domain_update: b.domain_update.unwrap_or_default(),
            volumetric: b.volumetric,
            split_above: b.split_above,
        };
        self.deck.bodies.iter().map(body).collect()
    }

    /// Reports F-bar in triangles and tetrahedra, where it changes nothing because gradients are constant.
    fn centres(&mut self, grid: &dyn Grid<D>, points: &Points<D>) {
        for (number, body) in self.deck.bodies.iter().enumerate() {
            if body.volumetric != Volumetric::FBar || !grid.has_simplices() {
                continue;
            }
            let corners = |cell: u32| grid.corners(cell as usize).nodes().len();
            let in_simplex = |p: usize| {
                let cell = grid.locate(&points.converged.position[p], Some(points.cell[p]));
                points.body[p] as usize == number && cell.is_some_and(|cell| corners(cell) == D + 1)
            };
            if self.ranks.any((0..points.len()).any(in_simplex)) {
                let cells = if D == 3 { "tetrahedra" } else { "triangles" };
                let message = format!("`f-bar` changes nothing in {cells}, whose gradients are constant");
                let help = format!("use `mean-dilatation`, which averages over patches of {cells}");
                self.error("D055", &format!("/bodies/{number}/volumetric"), message, help);
            }
        }
    }

    /// Fills every body with points; returns the points that this rank creates, with their permanent numbers.
    fn seeds(
        &mut self,
        grid: &dyn Grid<D>,
        materials: &[MaterialOfPoints],
        bodies: &[Body],
        (regions, groups): (&[Region<D>], &Groups),
    ) -> (Vec<Seed<D>>, Vec<u32>) {
        let (mut seeds, mut numbers, mut count) = (Vec::new(), Vec::new(), 0);
        for (number, deck) in self.deck.bodies.iter().enumerate() {
            let body = &bodies[number];
            let density = self.deck.materials[&deck.material].density().and_then(Expression::as_number);
            let mut history = materials[body.material].law.initial_history();
            // Points need room for the history variables of materials that stages assign to the body.
            let later = self.deck.stages.iter().filter_map(|stage| stage.material.get(&deck.name));
            let later = materials.iter().filter(|material| later.clone().any(|name| *name == material.name));
            let most = later.map(|material| material.law.state_fields().len()).max().unwrap_or(0);
            let room = history.len().max(most);
            history.resize(room, 0.0);
            let filling = Filling {
                grid,
                in_group: &|key, cell| groups.holds(key, cell),
                body: number as u16,
                domain: body.method.domain(),
                density: density.unwrap_or(0.0),
                history,
                touches_tools: !self.deck.tools.is_empty(),
                ranks: self.ranks,
            };
            let filled = fill(&regions[number], &filling, deck).and_then(|filled| {
                placing::inside_grid(grid, &deck.name, &filled, self.ranks).map_err(Some)?;
                Ok(filled)
            });
            match filled {
                Ok(mut filled) => {
                    self.furnish(&deck.name, &materials[body.material], room, &mut filled.seeds);
                    // Materials that stages assign to the body must suit its points as well.
                    for stage in &self.deck.stages {
                        let given = stage.material.get(&deck.name);
                        let given = given.and_then(|name| materials.iter().find(|m| m.name == *name));
                        if let Some(given) = given.filter(|given| !given.stated.varying.is_empty()) {
                            self.furnish(&deck.name, given, room, &mut filled.seeds.clone());
                        }
                    }
                    self.report_volume(number, deck, &filled);
                    let first = count + filled.before;
                    numbers.extend((first..first + filled.seeds.len()).map(|number| number as u32));
                    count += filled.all;
                    if seeds.is_empty() {
                        seeds = filled.seeds;
                    } else {
                        seeds.extend(filled.seeds);
                    }
                }
                Err(Some(fault)) => {
                    let pointer = format!("/bodies/{number}{}", fault.key);
                    self.error(fault.code, &pointer, fault.message, fault.help);
                }
                // Another rank reports the fault.
                Err(None) => {}
            }
        }
        (seeds, numbers)
    }

    /// Warns of bodies that overlap.
    fn overlaps(
        &mut self,
        grid: &dyn Grid<D>,
        (regions, groups): (&[Region<D>], &Groups),
        points: &Points<D>,
    ) {
        for (number, message) in placing::overlaps(grid, self.deck, (regions, groups), points) {
            let found =
                Diagnostic::at(&self.loaded.source, "D025", &format!("/bodies/{number}/shape"), message);
            let help = "if this is not intended, subtract one from the other with a `difference`";
            self.found.push(found.severity(Severity::Warning).help(help));
        }
    }

    /// Reports how much the area (volume) of the points of a body differs from the area (volume) of its region.
    fn report_volume(&mut self, number: usize, deck: &super::BodyDeck, filled: &Filled<D>) {
        let Some(exact) = filled.exact.filter(|exact| exact.value > 0.0) else { return };
        let volume = self.ranks.total(filled.seeds.iter().map(|s| s.volume).sum());
        let part = (volume - exact.value) / exact.value;
        if part.abs() > 1e-9 + exact.error / exact.value {
            let what = if D > 2 { "a volume" } else { "an area" };
            let word = if part > 0.0 { "more" } else { "less" };
            let message = format!(
                "the points of the body {} represent {what} of {volume:.6}, {:.3} % {word} than that of its region",
                quote(&deck.name),
                100.0 * part.abs()
            );
            let found =
                Diagnostic::at(&self.loaded.source, "D033", &format!("/bodies/{number}/shape"), message);
            self.found.push(if part.abs() > MUCH {
                let help = "use more points or smaller cells, and check that the region lies in the grid";
                found.severity(Severity::Warning).help(help)
            } else {
                let help = "use more points, or smaller cells, where this matters";
                found.severity(Severity::Note).help(help)
            });
        }
    }

    fn faulty_formulas(&mut self, pointer: &str, faults: Vec<formulas::Fault>) {
        for fault in faults {
            let help = "see the deck reference for what formulas may contain".to_owned();
            self.error("D021", &format!("{pointer}/{}", fault.key), fault.error.message, help);
        }
    }

    fn boundary_conditions(&mut self, grid: &dyn Grid<D>, points: &Points<D>) -> Vec<BoundaryCondition<D>> {
        let deck = self.deck;
        let mut conditions = Vec::new();
        for (number, condition) in deck.boundary_conditions.iter().enumerate() {
            let pointer = format!("/boundary_conditions/{number}");
            let nodes = match (&condition.nodes, &condition.surface) {
                (_, Some(surface)) => NodeSet::Surface(OnSurface {
                    surface: self.surface_number(surface),
                    along_normal: condition.holds_along_surface_normal(),
                    penalty: condition.penalty.unwrap_or(PENALTY),
                }),
                (Some(nodes), None) => self.nodes(grid, points, (nodes, condition), &pointer),
                (None, None) => NodeSet::Fixed(Vec::new()),
            };
            let mut prescribed = match at_nodes(
                condition.displacements(),
                &condition.intermediate,
                &self.loaded.parameters,
                D,
            ) {
                Ok(formulas) => formulas,
                Err(faults) => {
                    self.faulty_formulas(&pointer, faults);
                    continue;
                }
            };
            let mut displacement: [Option<Formula>; D] = std::array::from_fn(|axis| prescribed[axis].take());
            for direction in condition.held().into_iter().filter(|direction| *direction < D) {
                displacement[direction] = Some(Formula::constant(0.0));
            }
            conditions.push(BoundaryCondition {
                name: condition.name.clone(),
                nodes,
                displacement,
                axes: condition.frame(),
                curve: load_curve(condition.curve.as_ref(), self.deck.end_time()),
            });
        }
        conditions
    }

    /// For each body, true if a load on the chosen bodies acts on it; without a choice, the load acts on all bodies.
    fn acts_on(&self, chosen: Option<&[String]>) -> Vec<bool> {
        let Some(chosen) = chosen else { return vec![true; self.deck.bodies.len()] };
        let mut acts_on = vec![false; self.deck.bodies.len()];
        for name in chosen {
            acts_on[self.body_number(name)] = true;
        }
        acts_on
    }

    fn loads(&mut self, grid: &dyn Grid<D>, points: &Points<D>) -> Vec<Load<D>> {
        let deck = self.deck;
        let mut loads = Vec::new();
        for (number, load) in deck.loads.iter().enumerate() {
            let pointer = format!("/loads/{number}");
            let Some(action) = load.action(&mut Placing { builder: self, grid, points }, &pointer) else {
                continue;
            };
            loads.push(Load {
                name: load.name().to_owned(),
                action,
                acts_on: self.acts_on(load.bodies()),
                curve: curve_of(deck, load),
            });
        }
        loads
    }

    fn probes(&mut self, grid: &dyn Grid<D>, points: &Points<D>) -> Vec<Probe> {
        let deck = self.deck;
        let mut probes = Vec::new();
        for (number, probe) in deck.output.probes.iter().enumerate() {
            let pointer = format!("/output/probes/{number}");
            let ties = Ties::All;
            let wanted = (probe.nearest.as_slice(), probe.count, ties);
            let points = self.nearest((grid, points), &probe.body, wanted, &pointer);
            probes.push(Probe { name: probe.name.clone(), points });
        }
        probes
    }
}
