//! The gate `feasibility`, second half: sets up the first load step without solving it.
//!
//! Faults that prevent the first step are reported with their location in the deck; the solver finds such faults in
//! later steps.

use crate::advice::against;
use crate::diagnostic::{Diagnostic, Gate, Severity, assign, gathered, sort};
use crate::load::LoadedDeck;
use crate::quoting::{list, quote};
use crate::{AXES, Expression, LoadDeck, Parameter};
use mpm_core::basis::{Connectivity, SupportError, SupportFailure};
use mpm_core::dofs::{ConstraintError, Covered, DofMap, covered, nodes_of};
use mpm_core::model::{Model, NodeSet};
use mpm_core::points::{Points, coordinates};
use mpm_core::ranks::Ranks;
use mpm_core::solver::Obstacle;
use mpm_core::terms::LoadNotFinite;
use mpm_core::terms::external_force::external_force;

/// The size of the first load step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FirstStep {
    /// Number of nodes that the points touch.
    pub active_nodes: usize,
    /// Number of degrees of freedom that no boundary condition prescribes.
    pub unknowns: usize,
}

/// Sets up the first load step and checks it; also checks that the boundary conditions of later stages hold the bodies.
/// Returns the size of the step, with warnings and notes. The model is left unchanged.
///
/// # Errors
/// All faults that prevent the step from being solved, with warnings and notes.
pub fn first_step<const D: usize>(
    loaded: &LoadedDeck,
    model: &mut Model<D>,
    points: &mut Points<D>,
) -> Result<(FirstStep, Vec<Diagnostic>), Vec<Diagnostic>> {
    let mut check = Check { loaded, found: Vec::new() };
    let size = check.run(model, points);
    assign(Gate::Feasibility, &mut check.found);
    check.found = gathered(&points.ranks, check.found);
    sort(&mut check.found);
    match size {
        Some(size) if !check.found.iter().any(Diagnostic::is_error) => Ok((size, check.found)),
        _ => Err(check.found),
    }
}

/// Keeps an error only on the rank whose point has the lowest number, so that the reported point does not depend on the
/// number of ranks.
fn lowest_point_error(ranks: &Ranks, error: Option<LoadNotFinite>) -> Option<LoadNotFinite> {
    let own = error.as_ref().map_or(f64::INFINITY, |error| error.point.map_or(-1.0, f64::from));
    let lowest = ranks.smallest(own);
    error.filter(|_| own == lowest)
}

pub(crate) struct Check<'a> {
    pub(crate) loaded: &'a LoadedDeck,
    pub(crate) found: Vec<Diagnostic>,
}

impl Check<'_> {
    fn run<const D: usize>(&mut self, model: &mut Model<D>, points: &mut Points<D>) -> Option<FirstStep> {
        let methods = model.methods();
        let groups = Connectivity::default().with_body_groups(&model.body_groups.of_body);
        let links = match groups.renew(model.grid.as_ref(), points, &methods) {
            Ok(links) => links,
            Err(failure) => {
                if failure.error != SupportError::OnRank {
                    self.unsupported(model, points, failure);
                }
                return None;
            }
        };
        let end = model.stepping.end_time * (1.0 / model.stepping.count as f64);
        let fault = external_force(model, points, &links, end).err();
        if let Some(error) = lowest_point_error(&points.ranks, fault) {
            self.load_without_value(&error);
        }
        let dofs = DofMap::new(model, points, &links, 0.0, end);
        if points.ranks.any(dofs.is_err()) {
            dofs.err().iter().for_each(|error| self.constraint(error));
            return None;
        }
        let dofs = dofs.ok()?;
        for (number, condition) in model.boundary_conditions.iter().enumerate() {
            let is_list = matches!(condition.nodes, NodeSet::Fixed(_));
            if is_list && points.ranks.all(nodes_of(condition, points, &links).is_empty()) {
                self.touches_nothing(number, &condition.name);
            }
        }
        self.glued(model, points, &links);
        self.narrow_gaps(model, points, &links);
        self.footings_across_few_cells(model, points);
        self.tools_at_start(model, points);
        self.held_already(model);
        let reported = self.free_parts(model, points, &links, &dofs, None);
        if !model.stages.is_empty() {
            self.held_in_stages(model, points, reported);
        }
        let (ranks, halo) = (&points.ranks, links.halo());
        let own_nodes = (0..links.n_active()).filter(|node| halo.is_own(*node)).count();
        Some(FirstStep {
            active_nodes: ranks.count_all(own_nodes),
            unknowns: ranks.count_all(dofs.n_free_at(|node| halo.is_own(node))),
        })
    }

    pub(crate) fn at(&self, code: &'static str, pointer: &str, message: String) -> Diagnostic {
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
            ConstraintError::Conflict { first, second, node, unknown, a, b, .. } => {
                let pointer = format!("/boundary_conditions/{}", number(second));
                let message = format!(
                    "the boundary conditions {} and {} contradict each other: in the first load step, they \
                     prescribe increments of {} and {} of {unknown} at the grid node {}",
                    quote(first),
                    quote(second),
                    Parameter::Number(*a),
                    Parameter::Number(*b),
                    coordinates(node),
                );
                self.at("D042", &pointer, message)
            }
            ConstraintError::NotFinite { name, axis, node, factor, formula, value } => {
                let number = number(name);
                let condition = self.loaded.deck.boundary_conditions.get(number);
                if condition.is_some_and(|condition| condition.along.is_some()) {
                    let (name, node) = (quote(name), coordinates(node));
                    let message = format!(
                        "the displacement of boundary condition {name} along its direction is not finite at {node}: the \
                         formula `{formula}` gives {value} at load factor {factor}"
                    );
                    self.at("D043", &format!("/boundary_conditions/{number}/move/by"), message)
                } else {
                    self.at("D043", &format!("/boundary_conditions/{number}/u{axis}"), error.to_string())
                }
            }
            ConstraintError::LooseAxis { .. } => self.at("D046", "/boundary_conditions", error.to_string()),
            // A deck cannot state ties.
            _ => self.at("D042", "/boundary_conditions", error.to_string()),
        };
        self.found.push(found.help(against(Obstacle::from(error))));
    }

    /// Adds a note about a boundary condition on nodes that no point touches: perhaps a wall that a body reaches later.
    fn touches_nothing(&mut self, number: usize, name: &str) {
        let message =
            format!("the boundary condition {} acts on no node of a cell that contains points", quote(name));
        let found = self.at("D037", &format!("/boundary_conditions/{number}/nodes"), message);
        let help =
            "check that its nodes are next to a body; a wall that a body will reach later needs no change";
        self.found.push(found.severity(Severity::Note).help(help));
    }

    /// Warns of each boundary condition whose nodes, in every stage, all have their displacement along an axis
    /// prescribed by earlier conditions.
    fn held_already<const D: usize>(&mut self, model: &Model<D>) {
        let n = model.boundary_conditions.len();
        let mut present = model.present.clone();
        let mut stages = vec![(0..n).map(|number| model.is_set(number)).collect()];
        for stage in model.stages.iter().skip(1) {
            present.change_conditions(n, stage);
            stages.push(present.is_released.iter().map(|released| !released).collect::<Vec<bool>>());
        }
        for Covered { condition, axis, by } in covered(&model.boundary_conditions, &stages) {
            let name = |number: usize| model.boundary_conditions[number].name.as_str();
            let others = list(by.iter().map(|&number| name(number)));
            let message = format!(
                "the boundary condition {} has no effect along {}: the displacement of all of its nodes is already \
                 prescribed by {others}",
                quote(name(condition)),
                AXES[axis]
            );
            let at = format!("/boundary_conditions/{condition}");
            let help = format!(
                "fix or prescribe {} in only one of these conditions, or select other nodes",
                AXES[axis]
            );
            let found = self.at("D037", &at, message).severity(Severity::Warning);
            self.found.push(found.help(help));
        }
    }
}

/// The key of the formula with this text, relative to the load that contains it.
fn key_of(load: &LoadDeck, formula: &str) -> Option<String> {
    let is_it = |expression: &Expression| matches!(expression, Expression::Formula(text) if text == formula);
    let found = load.expressions().into_iter().find(|(_, expression)| is_it(expression));
    found.map(|(key, _)| format!("/{key}"))
}
