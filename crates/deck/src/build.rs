//! The gate `feasibility`: from a deck to the model and its points. Checks that need the mesh are made here.

mod axisymmetry;
mod bodies;
mod contact_outlines;
mod contacts;
pub mod first_step;
mod footing_cells;
mod formed_surfaces;
mod glued;
mod grid;
pub mod holding;
mod initial_stress;
mod lifts;
mod loading;
mod magnitudes;
mod materials;
mod motions;
mod moving_grid;
mod nearest;
mod nodes;
pub(crate) mod placing;
pub mod plan;
pub mod ready;
pub(crate) mod seeding;
pub mod size;
mod stages;
mod surfaces;
mod thin;
pub(crate) mod tool_shapes;
mod tools;
mod tools_at_start;
mod typical;
mod velocities;
mod water;

use std::collections::HashMap;

use super::diagnostic::{Diagnostic, Gate, assign, gathered};
use super::initial_stress::is_stressed;
use super::load::LoadedDeck;
use super::region::{DeckRegion, Regions};
use super::size::Size;
use super::{Deck, Idealisation};
use crate::material::MaterialOfPoints;
use mpm_core::grid::Grid;
use mpm_core::linear::Engines;
use mpm_core::memory::Memory;
use mpm_core::model::{Body, BodyGroups, LoadCurve, Model, NamedMaterial, Present, Stepping};
use mpm_core::points::Points;
use mpm_core::ranks::Ranks;
use mpm_core::region::Region;
use mpm_core::stress::CellStrain;

/// Builds the model of a deck that passed the earlier gates, and its points; `D` must be the number of axes of the
/// deck.
///
/// # Errors
/// All faults found with this mesh, each with its location in the deck.
#[expect(private_bounds, reason = "there are two numbers of dimensions, and no other can be added")]
pub fn build<const D: usize>(loaded: &LoadedDeck) -> Result<(Model<D>, Points<D>), Vec<Diagnostic>>
where
    Region<D>: DeckRegion<D>,
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
    Region<D>: DeckRegion<D>,
{
    let mut builder = Builder::new(loaded, ranks);
    let built = builder.build(memory);
    let Builder { mut found, memory_needed, .. } = builder;
    assign(Gate::Feasibility, &mut found);
    let found = gathered(ranks, found);
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
    regions: Regions<D>,
    laws: Vec<MaterialOfPoints>,
    size: Size,
}

/// Estimates the size of an analysis without filling its bodies.
pub(super) fn size_of<const D: usize>(loaded: &LoadedDeck) -> Result<Size, Vec<Diagnostic>>
where
    Region<D>: DeckRegion<D>,
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
    Region<D>: DeckRegion<D>,
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
        let regions = self.regions(grid.as_ref())?;
        let laws = self.laws(grid.as_ref(), &regions.bodies);
        self.strengths(&laws);
        let is_symmetric = laws.iter().all(|material| material.law.tangent_is_symmetric())
            && deck.bodies.iter().all(|body| body.strain() != CellStrain::FBar);
        let size = Size::new(deck, grid.as_ref(), &regions.bodies, is_symmetric);
        Some(Outline { grid, regions, laws, size })
    }

    /// The outline, on every rank; `None`, on all ranks alike, if a fault prevents further checks.
    fn common_outline(&mut self) -> Option<Outline<D>> {
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
        if self.ranks.any(outline.is_none()) { None } else { outline }
    }

    /// True, on all ranks alike, if the points can be numbered and the analysis fits the memory.
    fn fits(&mut self, size: Size, memory: Option<Memory>) -> bool {
        self.memory_needed = size.memory();
        if size.points > f64::from(u32::MAX) {
            let message = format!(
                "there would be {:.1e} points; at most {:.1e} can be numbered",
                size.points,
                u32::MAX
            );
            let (pointer, help) = size.largest_part(self.deck);
            self.error("D036", &pointer, message, help.to_owned());
            return false;
        }
        let local_size = size.local(self.ranks);
        let found = memory.and_then(|memory| local_size.judge(self.deck, &self.loaded.source, &memory));
        let is_too_large = found.as_ref().is_some_and(Diagnostic::is_error);
        self.found.extend(found);
        !self.ranks.any(is_too_large)
    }

    /// The points of the bodies; gives the laws the properties of a typical point.
    fn points(
        &mut self,
        grid: &dyn Grid<D>,
        regions: &Regions<D>,
        bodies: &[Body],
        laws: &mut [MaterialOfPoints],
    ) -> Points<D> {
        let (mut seeds, numbers) = self.seeds(grid, laws, bodies, regions);
        self.take_typical_points(laws, &seeds, &numbers);
        self.magnitudes(grid, laws);
        if self.is_revolved() {
            axisymmetry::revolve(&mut seeds);
        }
        let mut points = Points::numbered(&seeds, numbers, self.ranks);
        drop(seeds);
        points.divide_by_cell(grid);
        self.overlaps(grid, regions, &points);
        self.centres(grid, &points);
        points
    }

    fn is_revolved(&self) -> bool {
        self.deck.analysis.idealisation == Idealisation::Axisymmetric
    }

    /// The model and its points; `None`, on all ranks alike, if a fault prevents further checks.
    fn build(&mut self, memory: Option<Memory>) -> Option<(Model<D>, Points<D>)> {
        let deck = self.deck;
        let Outline { grid, regions, mut laws, size } = self.common_outline()?;
        let fits = self.fits(size, memory);
        if !fits || self.ranks.any(laws.len() < deck.materials.len()) {
            return None;
        }
        let bodies = self.bodies();
        let mut points = self.points(grid.as_ref(), &regions, &bodies, &mut laws);
        let surfaces = self.surfaces(grid.as_ref(), &regions, &points);
        self.formed_surfaces(grid.as_ref(), &regions, &points, &bodies, &surfaces);
        let tools = self.tools(grid.as_ref());
        let boundary_conditions = self.boundary_conditions(grid.as_ref(), &points);
        self.thin_bodies(grid.as_ref(), &regions, &points, &boundary_conditions, &surfaces);
        let loads = self.loads(grid.as_ref(), &points);
        if self.is_revolved() {
            self.found.extend(axisymmetry::faults(self.loaded, grid.as_ref()));
        }
        let probes = self.probes(grid.as_ref(), &points);
        let curves: Vec<&LoadCurve> = (loads.iter().map(|l| &l.curve))
            .chain(boundary_conditions.iter().map(|c| &c.curve))
            .chain(tools.iter().flat_map(|tool| tool.curves()))
            .collect();
        let stepping = match &deck.steps {
            Some(steps) => self.stepping((steps, deck.dynamic.as_ref()), 0.0, deck.output.every, &curves),
            None => Stepping::fixed(1, deck.end_time()),
        };
        let mut model = Model {
            engines: Engines::default(),
            title: deck.title.clone().unwrap_or_default(),
            grid,
            moving_grid: None,
            revolved: self.is_revolved(),
            formulation: deck.analysis.formulation,
            point_volume: deck.analysis.point_volume,
            stabilisation: deck.analysis.stabilisation,
            materials: laws.into_iter().map(|m| NamedMaterial { name: m.name, law: m.law }).collect(),
            bodies,
            surfaces,
            boundary_conditions,
            loads,
            tools,
            contacts: self.contacts(),
            body_groups: BodyGroups::default(),
            water: self.water(&regions),
            initial_imbalance: is_stressed(deck).then_some(deck.analysis.initial_imbalance),
            stepping,
            newton: deck.solver.newton(deck.has_contact()),
            probes,
            stages: Vec::new(),
            present: Present::default(),
        };
        if (model.water.is_some() || model.has_pore_water())
            && let Err(error) = model.declare_pore_pressure(&mut points)
        {
            self.error("D091", "/water", error.to_string(), "rename the field of the law".to_owned());
        }
        self.initial_stresses(&model, &mut points, &regions);
        if model.takes_means() {
            points.prepare_deviations();
        }
        if deck.has_inertia() {
            self.velocities(&mut points);
        }
        self.divide(&mut model, &mut points, &regions);
        self.group_bodies(&mut model, &points);
        self.contact_outlines(&model, &points, &regions);
        self.follow(&mut model);
        Some((model, points))
    }

    fn error(&mut self, code: &'static str, pointer: &str, message: String, help: String) {
        self.found.push(Diagnostic::at(&self.loaded.source, code, pointer, message).help(help));
    }

    fn body_number(&self, name: &str) -> usize {
        self.body_numbers.get(name).copied().unwrap_or(0)
    }
}
