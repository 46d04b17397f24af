//! Gate three, feasibility: from a deck to the model and its points. What needs the mesh is checked here.

mod nearest;

use std::collections::HashMap;

use super::diagnostic::{Diagnostic, Gate, Severity, assign, list, quote};
use super::formulas::at_points;
use super::load::LoadedDeck;
use super::seeding::{Filled, Filling};
use super::size::Size;
use super::{
    BoundaryConditionDeck, Deck, Expression, GridDeck, Idealisation, LoadCurve as CurveDeck, LoadDeck,
    MaterialDeck, NodeSelector, PerAxis,
};
use super::{axisymmetry, placing};
use crate::constraints::{BoundaryCondition, NodeSet};
use crate::formula::Formula;
use crate::grid::gmsh::{self, GmshError};
use crate::grid::{Grid, Mesh, Structured};
use crate::loads::{Action, Load, LoadCurve};
use crate::material::{Hencky, Material, NeoHookean, VonMises};
use crate::memory::Memory;
use crate::model::{Body, Model, NamedMaterial, Newton, Probe};
use crate::points::{Points, Seed};

/// Relative distance to a grid line within which a selected coordinate counts as lying on it.
const ON_LINE: f64 = 1e-6;

/// Part of the area of a region that is probably not missed on purpose.
const MUCH: f64 = 0.05;

/// Builds the two-dimensional model of a deck that passed the earlier gates, and its points.
///
/// # Errors
/// Everything that cannot be done with this mesh, each with its place in the deck.
pub fn build(loaded: &LoadedDeck) -> Result<(Model<2>, Points<2>), Vec<Diagnostic>> {
    build_with_notes(loaded).map(|(model, points, _)| (model, points))
}

/// As [`build`], with the warnings and notes that are no errors. A model that does not fit into the memory of the
/// machine is refused.
///
/// # Errors
/// As [`build`].
pub fn build_with_notes(
    loaded: &LoadedDeck,
) -> Result<(Model<2>, Points<2>, Vec<Diagnostic>), Vec<Diagnostic>> {
    build_within(loaded, Memory::of_this_machine())
}

/// As [`build_with_notes`], for a machine with this memory.
///
/// # Errors
/// As [`build`].
pub fn build_within(
    loaded: &LoadedDeck,
    memory: Option<Memory>,
) -> Result<(Model<2>, Points<2>, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut builder = Builder { loaded, deck: &loaded.deck, found: Vec::new(), body_numbers: HashMap::new() };
    let built = builder.build(memory);
    let mut found = builder.found;
    assign(Gate::Feasibility, &mut found);
    match built {
        Some((model, points)) if !found.iter().any(Diagnostic::is_error) => Ok((model, points, found)),
        _ => Err(found),
    }
}
/// The law of a material.
fn law(material: &MaterialDeck) -> Box<dyn Material> {
    match *material {
        MaterialDeck::Hencky { young, poisson, .. } => Box::new(Hencky::new(young, poisson)),
        MaterialDeck::NeoHookean { young, poisson, .. } => Box::new(NeoHookean::new(young, poisson)),
        MaterialDeck::VonMises { young, poisson, deviatoric_yield_stress, hardening_modulus, .. } => {
            Box::new(VonMises::new(young, poisson, deviatoric_yield_stress).hardening(hardening_modulus))
        }
    }
}

pub(super) fn pair(values: &[f64]) -> [f64; 2] {
    [values.first().copied().unwrap_or(0.0), values.get(1).copied().unwrap_or(0.0)]
}

pub(super) fn per_axis<T: Copy + Default>(value: &PerAxis<T>) -> [T; 2] {
    match value {
        PerAxis::Same(value) => [*value; 2],
        PerAxis::Each(values) => {
            [values.first().copied().unwrap_or_default(), values.get(1).copied().unwrap_or_default()]
        }
    }
}

struct Builder<'a> {
    loaded: &'a LoadedDeck,
    deck: &'a Deck,
    found: Vec<Diagnostic>,
    body_numbers: HashMap<&'a str, usize>,
}

impl<'a> Builder<'a> {
    /// The model and its points; nothing where what is missing keeps the rest from being looked at.
    fn build(&mut self, memory: Option<Memory>) -> Option<(Model<2>, Points<2>)> {
        let deck = self.deck;
        self.body_numbers = deck.bodies.iter().enumerate().map(|(k, body)| (body.name.as_str(), k)).collect();
        let grid = self.grid()?;
        if let Some(memory) = memory {
            let size = Size::of(deck, grid.as_ref());
            let found = size.judge(deck, &self.loaded.source, &memory);
            let is_too_large = found.as_ref().is_some_and(Diagnostic::is_error);
            self.found.extend(found);
            if is_too_large {
                return None;
            }
        }
        let materials: Vec<NamedMaterial> = deck
            .materials
            .iter()
            .map(|(name, m)| NamedMaterial { name: name.clone(), law: law(m) })
            .collect();
        let bodies = self.bodies();
        let revolved = deck.analysis.idealisation == Idealisation::Axisymmetric;
        let mut seeds = self.seeds(grid.as_ref(), &materials, &bodies);
        if revolved {
            axisymmetry::revolve(&mut seeds);
        }
        let points = Points::new(&seeds);
        drop(seeds);
        let boundary_conditions = self.boundary_conditions(grid.as_ref());
        let loads = self.loads(grid.as_ref(), &points);
        if revolved {
            self.found.extend(axisymmetry::faults(self.loaded, grid.as_ref(), &boundary_conditions));
        }
        let probes = self.probes(grid.as_ref(), &points);
        let model = Model {
            title: deck.title.clone().unwrap_or_default(),
            grid,
            revolved,
            formulation: deck.analysis.formulation,
            point_volume: deck.analysis.point_volume,
            materials,
            bodies,
            boundary_conditions,
            loads,
            n_steps: deck.steps.count as usize,
            end_time: deck.steps.end_time,
            newton: Newton {
                tolerance: deck.solver.tolerance,
                max_iterations: deck.solver.max_iterations as usize,
            },
            probes,
        };
        Some((model, points))
    }

    fn error(&mut self, code: &'static str, pointer: &str, message: String, help: String) {
        self.found.push(Diagnostic::at(&self.loaded.source, code, pointer, message).help(help));
    }

    fn grid(&mut self) -> Option<Box<dyn Grid<2>>> {
        match &self.deck.grid {
            GridDeck::Structured { origin, size, spacing } => {
                let (size, spacing) = (pair(size), per_axis(spacing));
                let cells = std::array::from_fn(|d| ((size[d] / spacing[d]).round() as usize).max(1));
                let spacing = std::array::from_fn(|d| size[d] / cells[d] as f64);
                Some(Box::new(Structured::new(pair(origin), spacing, cells)))
            }
            GridDeck::Gmsh { file } => self.mesh(file).map(|mesh| Box::new(mesh) as Box<dyn Grid<2>>),
        }
    }

    /// The mesh of a gmsh file; a message if it cannot be used.
    fn mesh(&mut self, file: &str) -> Option<Mesh<2>> {
        let path = self.loaded.directory.join(file);
        let source = &self.loaded.source;
        let read = gmsh::read_file(&path);
        // What is in the file can only be mended in gmsh.
        let help = match &read {
            Err(GmshError::Io(_) | GmshError::NotAFile | GmshError::TooLarge { .. }) => {
                format!("the path is relative to the deck; this is `{}`", path.display())
            }
            Err(GmshError::NotGmsh) => "save the mesh from gmsh as `.msh`, format 4.1 or 2.2".to_owned(),
            _ => "mend the mesh in gmsh and save it again".to_owned(),
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
                    self.found.push(found.severity(Severity::Warning));
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

    fn bodies(&self) -> Vec<Body> {
        let body = |b: &super::BodyDeck| Body {
            name: b.name.clone(),
            material: self.deck.materials.keys().position(|name| *name == b.material).unwrap_or(0),
            method: b.method,
            domain_update: b.domain_update.unwrap_or_default(),
        };
        self.deck.bodies.iter().map(body).collect()
    }

    /// Fills every body with points.
    fn seeds(&mut self, grid: &dyn Grid<2>, materials: &[NamedMaterial], bodies: &[Body]) -> Vec<Seed<2>> {
        let mut seeds = Vec::new();
        for (number, deck) in self.deck.bodies.iter().enumerate() {
            let body = &bodies[number];
            let fields = materials[body.material].law.state_fields();
            let filling = Filling {
                grid,
                body: number as u16,
                domain: body.method.domain(),
                density: self.deck.materials[&deck.material].density().unwrap_or(0.0),
                history: fields.iter().map(|f| f.initial).collect(),
            };
            let filled = filling.fill(deck).and_then(|filled| {
                placing::inside_grid(grid, &deck.name, &filled.seeds)?;
                Ok(filled)
            });
            match filled {
                Ok(filled) => {
                    self.report_area(number, deck, &filled);
                    seeds.extend(filled.seeds);
                }
                Err(fault) => {
                    let pointer = format!("/bodies/{number}{}", fault.key);
                    self.error(fault.code, &pointer, fault.message, fault.help);
                }
            }
        }
        for (number, message) in placing::overlaps(grid, &self.deck.bodies, &seeds) {
            let found =
                Diagnostic::at(&self.loaded.source, "D025", &format!("/bodies/{number}/shape"), message);
            let help = "take the one from the other by a `difference`, if this is not meant";
            self.found.push(found.severity(Severity::Warning).help(help));
        }
        seeds
    }

    /// Says how far the points of a body miss the area of its region.
    fn report_area(&mut self, number: usize, deck: &super::BodyDeck, filled: &Filled) {
        let Some(exact) = filled.exact_area.filter(|area| *area > 0.0) else { return };
        let area: f64 = filled.seeds.iter().map(|s| s.volume).sum();
        let part = (area - exact) / exact;
        if part.abs() > 1e-9 {
            let word = if part > 0.0 { "more" } else { "less" };
            let message = format!(
                "the points of the body {} stand for an area of {area:.6}, {:.3} % {word} than its region",
                quote(&deck.name),
                100.0 * part.abs()
            );
            let found =
                Diagnostic::at(&self.loaded.source, "D033", &format!("/bodies/{number}/shape"), message);
            self.found.push(if part.abs() > MUCH {
                let help = "use more points or smaller cells, and see that the region lies in the grid";
                found.severity(Severity::Warning).help(help)
            } else {
                found.severity(Severity::Note)
            });
        }
    }

    fn curve(&self, curve: &Option<CurveDeck>) -> LoadCurve {
        match curve {
            Some(CurveDeck(pairs)) => LoadCurve::table(pairs.clone()),
            None => LoadCurve::ramp(self.deck.steps.end_time),
        }
    }

    fn formula(&mut self, expression: &Expression, pointer: &str) -> Formula {
        expression.at_nodes(&self.loaded.parameters).unwrap_or_else(|error| {
            let message = format!("the formula cannot be understood: {}", error.message);
            self.error("D021", pointer, message, "see the reference of formulas".to_owned());
            Formula::constant(0.0)
        })
    }

    fn boundary_conditions(&mut self, grid: &dyn Grid<2>) -> Vec<BoundaryCondition<2>> {
        let deck = self.deck;
        let mut conditions = Vec::new();
        for (number, condition) in deck.boundary_conditions.iter().enumerate() {
            let pointer = format!("/boundary_conditions/{number}");
            let nodes = self.nodes(grid, condition, &pointer);
            let mut displacement = [None, None];
            for (axis, (key, given)) in [("ux", &condition.ux), ("uy", &condition.uy)].into_iter().enumerate()
            {
                if let Some(expression) = given {
                    displacement[axis] = Some(self.formula(expression, &format!("{pointer}/{key}")));
                }
            }
            for axis in &condition.fix {
                displacement[*axis as usize] = Some(Formula::constant(0.0));
            }
            conditions.push(BoundaryCondition {
                name: condition.name.clone(),
                nodes,
                displacement,
                curve: self.curve(&condition.curve),
            });
        }
        conditions
    }

    fn nodes(&mut self, grid: &dyn Grid<2>, condition: &BoundaryConditionDeck, pointer: &str) -> NodeSet {
        let NodeSelector { x, y, within, group, outer_layer } = &condition.nodes;
        if let Some(body) = outer_layer {
            return NodeSet::OuterLayer(self.body_number(body) as u16);
        }
        if let Some(name) = group {
            let pointer = format!("{pointer}/nodes/group");
            return NodeSet::Fixed(match grid.node_set(name) {
                Some(nodes) => nodes.to_vec(),
                None => {
                    let (message, help) = placing::unknown_group(grid, name, false);
                    self.error("D031", &pointer, message, help);
                    Vec::new()
                }
            });
        }
        let mut off_line = false;
        let slack = grid.structured().map_or([0.0; 2], |g| g.spacing());
        for (axis, (key, coordinate)) in [("x", x), ("y", y)].into_iter().enumerate() {
            if let (Some(c), Some(grid)) = (coordinate, grid.structured()) {
                off_line |= self.check_line(grid, axis, *c, &format!("{pointer}/nodes/{key}"));
            }
        }
        // On an imported grid the size of the first cell says what counts as near.
        let slack = slack.map(|h| ON_LINE * if h > 0.0 { h } else { grid.size(0) });
        let near = |axis: usize, a: f64, b: f64| (a - b).abs() <= slack[axis];
        let inside = |p: [f64; 2]| match within {
            Some(region) => (0..2)
                .all(|d| pair(&region.min)[d] - slack[d] <= p[d] && p[d] <= pair(&region.max)[d] + slack[d]),
            None => x.is_none_or(|x| near(0, p[0], x)) && y.is_none_or(|y| near(1, p[1], y)),
        };
        let bounds = match within {
            Some(region) => [pair(&region.min), pair(&region.max)],
            None => {
                let all = grid.bounds();
                [
                    [x.unwrap_or(all[0][0]), y.unwrap_or(all[0][1])],
                    [x.unwrap_or(all[1][0]), y.unwrap_or(all[1][1])],
                ]
            }
        };
        let nodes: Vec<u32> = placing::nodes_near(grid, bounds)
            .filter(|&node| inside(grid.node_position(node)))
            .map(|node| node as u32)
            .collect();
        if nodes.is_empty() && !off_line {
            let message = format!("the boundary condition {} selects no grid node", quote(&condition.name));
            let help = grid.structured().map_or_else(
                || {
                    let names = grid.set_names();
                    format!("name a physical group of the mesh by `group`; there are {}", list(names))
                },
                |grid| {
                    let ([x, y], [hx, hy]) = (grid.origin(), grid.spacing());
                    format!("grid nodes lie at {x} + i {hx} in x and {y} + j {hy} in y")
                },
            );
            self.error("D029", &format!("{pointer}/nodes"), message, help);
        }
        NodeSet::Fixed(nodes)
    }

    /// Reports a coordinate that is on no grid line; returns whether it did.
    fn check_line(&mut self, grid: &Structured<2>, axis: usize, c: f64, pointer: &str) -> bool {
        let (origin, spacing) = (grid.origin()[axis], grid.spacing()[axis]);
        let line = ((c - origin) / spacing).round().clamp(0.0, grid.cells()[axis] as f64);
        let nearest = origin + line * spacing;
        if (c - nearest).abs() <= ON_LINE * spacing {
            return false;
        }
        let name = ["x", "y"][axis];
        let message = format!("no grid line lies at {name} = {c}");
        self.error("D029", pointer, message, format!("the nearest one is {name} = {nearest}"));
        true
    }

    /// For each body whether a load acts on it.
    fn acts_on(&self, chosen: Option<&[String]>) -> Vec<bool> {
        let Some(chosen) = chosen else { return vec![true; self.deck.bodies.len()] };
        let mut acts_on = vec![false; self.deck.bodies.len()];
        for name in chosen {
            acts_on[self.body_number(name)] = true;
        }
        acts_on
    }

    fn loads(&mut self, grid: &dyn Grid<2>, points: &Points<2>) -> Vec<Load<2>> {
        let deck = self.deck;
        let mut loads = Vec::new();
        for (number, load) in deck.loads.iter().enumerate() {
            let pointer = format!("/loads/{number}");
            loads.push(match load {
                LoadDeck::Gravity { name, acceleration, bodies, curve } => Load {
                    name: name.clone(),
                    action: Action::Gravity(pair(acceleration)),
                    acts_on: self.acts_on(bodies.as_deref()),
                    curve: self.curve(curve),
                },
                LoadDeck::BodyForce { name, force, intermediate, bodies, curve } => {
                    match at_points(force, intermediate, &self.loaded.parameters) {
                        Ok(formula) => Load {
                            name: name.clone(),
                            action: Action::BodyForce(formula),
                            acts_on: self.acts_on(bodies.as_deref()),
                            curve: self.curve(curve),
                        },
                        Err(faults) => {
                            for fault in faults {
                                let help = "see the reference of formulas".to_owned();
                                let place = format!("{pointer}/{}", fault.key);
                                self.error("D021", &place, fault.error.message, help);
                            }
                            continue;
                        }
                    }
                }
                LoadDeck::PointForce { name, body, points: selector, total, curve } => {
                    let place = format!("{pointer}/points");
                    let chosen =
                        self.nearest((grid, points), body, &selector.nearest, selector.count, &place);
                    let share = 1.0 / chosen.len().max(1) as f64;
                    Load {
                        name: name.clone(),
                        action: Action::PointForce { points: chosen, force: pair(total).map(|f| f * share) },
                        acts_on: self.acts_on(Some(std::slice::from_ref(body))),
                        curve: self.curve(curve),
                    }
                }
            });
        }
        loads
    }

    fn probes(&mut self, grid: &dyn Grid<2>, points: &Points<2>) -> Vec<Probe> {
        let deck = self.deck;
        let mut probes = Vec::new();
        for (number, probe) in deck.output.probes.iter().enumerate() {
            let pointer = format!("/output/probes/{number}");
            let points = self.nearest((grid, points), &probe.body, &probe.nearest, probe.count, &pointer);
            probes.push(Probe { name: probe.name.clone(), points });
        }
        probes
    }
}
