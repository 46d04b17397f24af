//! Gate three, feasibility, second half: sets up the first load step without solving it.
//!
//! Faults that prevent the first step are reported with their location in the deck; the solver finds the same faults in
//! later steps.

use super::advice::against;
use super::diagnostic::{Diagnostic, Gate, Severity, assign, sort};
use super::load::LoadedDeck;
use super::quoting::{list, quote};
use super::{AXES, Expression, LoadDeck, Parameter};
use mpm_core::basis::{Connectivity, Method, SupportFailure};
use mpm_core::dofs::rigid::{FreePart, free_parts};
use mpm_core::dofs::{ConstraintError, Covered, DofMap, covered, nodes_of};
use mpm_core::model::{Action, Model, NodeSet, Pressure};
use mpm_core::points::{Points, coordinates};
use mpm_core::solver::Obstacle;
use mpm_core::terms::LoadNotFinite;
use mpm_core::terms::external_force::external_force;

/// Most parts of the bodies that are reported.
const MOST_PARTS: usize = 20;

/// The size of the first load step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FirstStep {
    /// Nodes that the points touch.
    pub active_nodes: usize,
    /// Degrees of freedom that no boundary condition prescribes.
    pub unknowns: usize,
}

/// Sets up the first load step and checks it; returns its size, with warnings and notes.
///
/// # Errors
/// All faults that prevent the step from being solved, with warnings and notes.
pub fn first_step<const D: usize>(
    loaded: &LoadedDeck,
    model: &Model<D>,
    points: &mut Points<D>,
) -> Result<(FirstStep, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut check = Check { loaded, found: Vec::new() };
    let size = check.run(model, points);
    assign(Gate::Feasibility, &mut check.found);
    sort(&mut check.found);
    match size {
        Some(size) if !check.found.iter().any(Diagnostic::is_error) => Ok((size, check.found)),
        _ => Err(check.found),
    }
}

struct Check<'a> {
    loaded: &'a LoadedDeck,
    found: Vec<Diagnostic>,
}

impl Check<'_> {
    fn run<const D: usize>(&mut self, model: &Model<D>, points: &mut Points<D>) -> Option<FirstStep> {
        let methods: Vec<Method> = model.bodies.iter().map(|body| body.method).collect();
        let links = match Connectivity::new(model.grid.as_ref(), points, &methods) {
            Ok(links) => links,
            Err(failure) => {
                self.unsupported(model, points, failure);
                return None;
            }
        };
        let end = model.stepping.end_time * (1.0 / model.stepping.count as f64);
        if let Err(error) = external_force(model, points, &links, end) {
            self.load_without_value(&error);
        }
        let dofs = match DofMap::new(model, points, &links, 0.0, end) {
            Ok(dofs) => dofs,
            Err(error) => {
                self.constraint(&error);
                return None;
            }
        };
        for (number, condition) in model.boundary_conditions.iter().enumerate() {
            let is_list = matches!(condition.nodes, NodeSet::Fixed(_));
            if is_list && nodes_of(condition, points, &links).is_empty() {
                self.touches_nothing(number, &condition.name);
            }
        }
        self.held_already(model);
        // Only the stiffness shows whether a condition on a surface, or water around it, holds its body.
        let held = |body: &u16| {
            model.boundary_conditions.iter().any(|condition| match condition.nodes {
                NodeSet::Surface(on) => model.surfaces[on.surface].body == *body as usize,
                _ => false,
            })
        };
        let floats = |body: &u16| {
            model.loads.iter().any(|load| match &load.action {
                Action::Pressure { surface, pressure: Pressure::Hydrostatic { .. } } => {
                    model.surfaces[*surface].body == *body as usize
                }
                _ => false,
            })
        };
        let mut parts = free_parts(model, points, &links, &dofs);
        parts.retain(|part| !part.bodies.iter().any(|body| held(body) || floats(body)));
        for part in parts.iter().take(MOST_PARTS) {
            self.free_part(model, part);
        }
        Some(FirstStep { active_nodes: links.n_active(), unknowns: dofs.n_free() })
    }

    fn at(&self, code: &'static str, pointer: &str, message: String) -> Diagnostic {
        Diagnostic::at(&self.loaded.source, code, pointer, message)
    }

    fn unsupported<const D: usize>(&mut self, model: &Model<D>, points: &Points<D>, failure: SupportFailure) {
        let (p, body) = (failure.point, points.body[failure.point] as usize);
        let message = format!(
            "point {} of the body {} at {}: {}",
            points.id[p],
            quote(&model.bodies[body].name),
            coordinates(&points.converged.position[p]),
            failure.error
        );
        let found = self.at("D028", &format!("/bodies/{body}/shape"), message);
        self.found.push(found.help("make the grid larger, or use another method"));
    }

    fn load_without_value(&mut self, error: &LoadNotFinite) {
        let loads = &self.loaded.deck.loads;
        let number = loads.iter().position(|load| load.name() == error.load).unwrap_or(0);
        let key = loads.get(number).and_then(|load| key_of(load, &error.formula)).unwrap_or_default();
        let found = self.at("D043", &format!("/loads/{number}{key}"), error.to_string());
        self.found.push(found.help(against(Obstacle::NotFinite)));
    }

    fn constraint(&mut self, error: &ConstraintError) {
        let number = |name: &str| {
            let conditions = &self.loaded.deck.boundary_conditions;
            conditions.iter().position(|condition| condition.name == name).unwrap_or(0)
        };
        let found = match error {
            ConstraintError::Conflict { first, second, node, axis, a, b } => {
                let pointer = format!("/boundary_conditions/{}", number(second));
                let message = format!(
                    "the boundary conditions {} and {} contradict each other: they move the grid node {} by {} \
                     and {} along {axis} in the first load step",
                    quote(first),
                    quote(second),
                    coordinates(node),
                    Parameter::Number(*a),
                    Parameter::Number(*b),
                );
                self.at("D042", &pointer, message)
            }
            ConstraintError::NotFinite { name, axis, .. } => {
                let pointer = format!("/boundary_conditions/{}/u{axis}", number(name));
                self.at("D043", &pointer, error.to_string())
            }
            ConstraintError::LooseAxis { .. } => self.at("D046", "/boundary_conditions", error.to_string()),
            // No deck has ties.
            _ => self.at("D042", "/boundary_conditions", error.to_string()),
        };
        self.found.push(found.help(against(Obstacle::from(error))));
    }

    /// Notes a boundary condition on nodes that no point touches: perhaps a wall that a body will reach.
    fn touches_nothing(&mut self, number: usize, name: &str) {
        let message =
            format!("the boundary condition {} acts on no node of a cell that contains points", quote(name));
        let found = self.at("D037", &format!("/boundary_conditions/{number}/nodes"), message);
        let help = "check that it lies at the bodies; a wall that a body will reach later needs no change";
        self.found.push(found.severity(Severity::Note).help(help));
    }

    /// Warns of boundary conditions that fix along an axis only nodes that others already fix.
    fn held_already<const D: usize>(&mut self, model: &Model<D>) {
        for Covered { condition, axis, by } in covered(&model.boundary_conditions) {
            let name = |number: usize| model.boundary_conditions[number].name.as_str();
            let others = list(by.iter().map(|&number| name(number)));
            let message = format!(
                "the boundary condition {} has no effect along {}: all of its nodes are already fixed by {others}, which \
                 receives the reaction",
                quote(name(condition)),
                AXES[axis]
            );
            let at = format!("/boundary_conditions/{condition}");
            let help = format!("fix {} in one of them only, or select other nodes", AXES[axis]);
            let found = self.at("D037", &at, message).severity(Severity::Warning);
            self.found.push(found.help(help));
        }
    }

    fn free_part<const D: usize>(&mut self, model: &Model<D>, part: &FreePart<D>) {
        let names = part.bodies.iter().map(|&body| model.bodies[body as usize].name.as_str());
        let bodies = match (part.bodies.len(), part.whole) {
            (1, true) => format!("the body {}", list(names)),
            (1, false) => format!("a part of the body {}", list(names)),
            (_, true) => format!("the bodies {}, which share cells of the grid,", list(names)),
            (_, false) => format!("a part of the bodies {}, which share cells of the grid,", list(names)),
        };
        let first = part.bodies.first().copied().unwrap_or(0);
        let pointer = format!("/bodies/{first}");
        let place = coordinates(&part.node);
        let found = if part.axes.is_empty() {
            let about = match &part.centre {
                Some(centre) => format!(" about {}", coordinates(centre)),
                None if D > 2 => String::new(),
                None => " about a point".to_owned(),
            };
            let message =
                format!("no boundary condition prevents {bodies} at the node {place} from rotating{about}");
            let help = if D > 2 {
                "fix it at three nodes that are not on one line, along more than one axis"
            } else {
                "fix it along one axis at two nodes that are apart along the other"
            };
            self.at("D035", &pointer, message).severity(Severity::Warning).help(help)
        } else {
            let axes: Vec<&str> = part.axes.iter().map(|&axis| AXES[axis % 3]).collect();
            let turning = if part.rotations > 0 { ", or against rotation" } else { "" };
            let axes = axes.join(" and ");
            let message =
                format!("no boundary condition holds {bodies} at the node {place} along {axes}{turning}");
            let help = "fix or prescribe the displacement along that axis at one or more nodes of each separate part";
            self.at("D035", &pointer, message).help(help)
        };
        self.found.push(found);
    }
}

/// The key, relative to a body force, of the formula with this text.
fn key_of(load: &LoadDeck, formula: &str) -> Option<String> {
    let is_it = |expression: &Expression| matches!(expression, Expression::Formula(text) if text == formula);
    let found = load.expressions().into_iter().find(|(_, expression)| is_it(expression));
    found.map(|(key, _)| format!("/{key}"))
}
