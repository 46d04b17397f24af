//! Gate three, feasibility: from a deck to the model and its points. What needs the mesh is checked here.

use super::diagnostic::{Diagnostic, quote};
use super::load::LoadedDeck;
use super::{
    BoundaryConditionDeck, Deck, Expression, GridDeck, LoadCurve as CurveDeck, LoadDeck, MaterialDeck,
    NodeSelector, PerAxis, Shape,
};
use crate::basis::DomainKind;
use crate::constraints::{BoundaryCondition, NodeSet};
use crate::formula::Formula;
use crate::grid::{Grid, Structured};
use crate::loads::{Action, Load, LoadCurve};
use crate::material::{Hencky, Material, VonMises};
use crate::model::{Body, Model, NamedMaterial, Newton, Probe};
use crate::points::{Points, Seed};

/// Relative distance to a grid line within which a selected coordinate counts as lying on it.
const ON_LINE: f64 = 1e-6;

/// Builds the two-dimensional model of a deck that passed the earlier gates, and its points.
///
/// # Errors
/// Everything that cannot be done with this mesh, each with its place in the deck.
pub fn build(loaded: &LoadedDeck) -> Result<(Model<2>, Points<2>), Vec<Diagnostic>> {
    let deck = &loaded.deck;
    let mut builder = Builder { loaded, deck, found: Vec::new() };
    let grid = builder.grid();
    let materials: Vec<NamedMaterial> =
        deck.materials.iter().map(|(name, m)| NamedMaterial { name: name.clone(), law: law(m) }).collect();
    let bodies = builder.bodies();
    let seeds = builder.seeds(&grid, &materials, &bodies);
    let points = Points::new(&seeds);
    let boundary_conditions = builder.boundary_conditions(&grid);
    let loads = builder.loads(&points);
    let probes = builder.probes(&points);
    if builder.found.iter().any(Diagnostic::is_error) {
        return Err(builder.found);
    }
    let model = Model {
        title: deck.title.clone().unwrap_or_default(),
        grid: Box::new(grid),
        formulation: deck.analysis.formulation,
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
    Ok((model, points))
}

/// The law of a material.
fn law(material: &MaterialDeck) -> Box<dyn Material> {
    match *material {
        MaterialDeck::Hencky { young, poisson, .. } => Box::new(Hencky::new(young, poisson)),
        MaterialDeck::VonMises { young, poisson, deviatoric_yield_stress, .. } => {
            Box::new(VonMises::new(young, poisson, deviatoric_yield_stress))
        }
    }
}

fn density(material: &MaterialDeck) -> f64 {
    match material {
        MaterialDeck::Hencky { density, .. } | MaterialDeck::VonMises { density, .. } => {
            density.unwrap_or(0.0)
        }
    }
}

fn pair(values: &[f64]) -> [f64; 2] {
    [values.first().copied().unwrap_or(0.0), values.get(1).copied().unwrap_or(0.0)]
}

fn per_axis<T: Copy + Default>(value: &PerAxis<T>) -> [T; 2] {
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
}

impl Builder<'_> {
    fn error(&mut self, code: &'static str, pointer: &str, message: String, help: String) {
        self.found.push(Diagnostic::at(&self.loaded.source, code, pointer, message).help(help));
    }

    fn grid(&self) -> Structured<2> {
        let GridDeck::Structured { origin, size, spacing } = &self.deck.grid;
        let (size, spacing) = (pair(size), per_axis(spacing));
        let cells = std::array::from_fn(|d| ((size[d] / spacing[d]).round() as usize).max(1));
        Structured::new(pair(origin), std::array::from_fn(|d| size[d] / cells[d] as f64), cells)
    }

    fn body_number(&self, name: &str) -> usize {
        self.deck.bodies.iter().position(|b| b.name == name).unwrap_or(0)
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

    /// Fills every body with a lattice of points at the centres of an even subdivision.
    fn seeds(&mut self, grid: &Structured<2>, materials: &[NamedMaterial], bodies: &[Body]) -> Vec<Seed<2>> {
        let mut seeds = Vec::new();
        for (number, deck) in self.deck.bodies.iter().enumerate() {
            let Shape::Box { min, max } = &deck.shape;
            let (min, max) = (pair(min), pair(max));
            let side: [f64; 2] = std::array::from_fn(|d| max[d] - min[d]);
            let counts: [usize; 2] = match (&deck.points_per_cell, &deck.point_spacing) {
                (Some(n), _) => {
                    let n = per_axis(n);
                    std::array::from_fn(|d| (side[d] / grid.spacing()[d]).round() as usize * n[d] as usize)
                }
                (None, Some(spacing)) => {
                    let spacing = per_axis(spacing);
                    std::array::from_fn(|d| (side[d] / spacing[d]).round() as usize)
                }
                (None, None) => [0; 2],
            };
            if counts.contains(&0) {
                let message = format!("the body {} holds no material point", quote(&deck.name));
                let help = "state `points_per_cell`, or a `point_spacing` below its sides".to_owned();
                self.error("D028", &format!("/bodies/{number}"), message, help);
                continue;
            }
            let spacing: [f64; 2] = std::array::from_fn(|d| side[d] / counts[d] as f64);
            let body = &bodies[number];
            let volume = spacing[0] * spacing[1];
            let fields = materials[body.material].law.state_fields();
            let seed = Seed {
                body: number as u16,
                position: [0.0; 2],
                half_lengths: [0.0; 2],
                corners: Vec::new(),
                volume,
                mass: density(&self.deck.materials[&deck.material]) * volume,
                outer_layer: false,
                history: fields.iter().map(|f| f.initial).collect(),
            };
            for j in 0..counts[1] {
                for i in 0..counts[0] {
                    let edge = |k: usize, n: usize| k == 0 || k == n - 1;
                    let at = |a: f64, b: f64| {
                        [min[0] + (i as f64 + a) * spacing[0], min[1] + (j as f64 + b) * spacing[1]]
                    };
                    let (half_lengths, corners) = match body.method.domain() {
                        DomainKind::None => ([0.0; 2], vec![]),
                        DomainKind::Box => (spacing.map(|s| 0.5 * s), vec![]),
                        DomainKind::Corners => (
                            spacing.map(|s| 0.5 * s),
                            vec![at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)],
                        ),
                    };
                    seeds.push(Seed {
                        position: at(0.5, 0.5),
                        half_lengths,
                        corners,
                        outer_layer: edge(i, counts[0]) || edge(j, counts[1]),
                        ..seed.clone()
                    });
                }
            }
        }
        seeds
    }

    fn curve(&self, curve: &Option<CurveDeck>) -> LoadCurve {
        match curve {
            Some(CurveDeck(pairs)) => LoadCurve::table(pairs.clone()),
            None => LoadCurve::ramp(self.deck.steps.end_time),
        }
    }

    fn formula(&mut self, expression: &Expression, pointer: &str) -> Formula {
        expression.formula(&self.loaded.parameters).unwrap_or_else(|error| {
            let message = format!("the formula cannot be understood: {}", error.message);
            self.error("D021", pointer, message, "see the reference of formulas".to_owned());
            Formula::constant(0.0)
        })
    }

    fn boundary_conditions(&mut self, grid: &Structured<2>) -> Vec<BoundaryCondition<2>> {
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

    fn nodes(&mut self, grid: &Structured<2>, condition: &BoundaryConditionDeck, pointer: &str) -> NodeSet {
        let NodeSelector { x, y, within, outer_layer } = &condition.nodes;
        if let Some(body) = outer_layer {
            return NodeSet::OuterLayer(self.body_number(body) as u16);
        }
        let mut off_line = false;
        for (axis, (key, coordinate)) in [("x", x), ("y", y)].into_iter().enumerate() {
            if let Some(c) = coordinate {
                off_line |= self.check_line(grid, axis, *c, &format!("{pointer}/nodes/{key}"));
            }
        }
        let near = |axis: usize, a: f64, b: f64| (a - b).abs() <= ON_LINE * grid.spacing()[axis];
        let inside = |p: [f64; 2]| match within {
            Some(region) => (0..2).all(|d| {
                let slack = ON_LINE * grid.spacing()[d];
                pair(&region.min)[d] - slack <= p[d] && p[d] <= pair(&region.max)[d] + slack
            }),
            None => x.is_none_or(|x| near(0, p[0], x)) && y.is_none_or(|y| near(1, p[1], y)),
        };
        let nodes: Vec<u32> = (0..grid.n_nodes())
            .filter(|&node| inside(grid.node_position(node)))
            .map(|node| node as u32)
            .collect();
        if nodes.is_empty() && !off_line {
            let message = format!("the boundary condition {} selects no grid node", quote(&condition.name));
            let help = format!(
                "grid nodes lie at {} + i {} in x and {} + j {} in y",
                grid.origin()[0],
                grid.spacing()[0],
                grid.origin()[1],
                grid.spacing()[1]
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

    /// Permanent numbers of the points of a body nearest to a place.
    fn nearest(
        &mut self,
        points: &Points<2>,
        body: &str,
        place: &[f64],
        count: u32,
        pointer: &str,
    ) -> Vec<u32> {
        let number = self.body_number(body) as u16;
        let (found, clear) = points.nearest(number, &pair(place), count as usize);
        if found.len() < count as usize {
            let message = format!("the body {} has only {} points", quote(body), found.len());
            self.error("D030", &format!("{pointer}/count"), message, "lower `count`".to_owned());
        } else if !clear {
            let message = format!("more than {count} points are equally near to {place:?}");
            let help = "change `count`, or move the place so that the choice is clear".to_owned();
            self.error("D030", &format!("{pointer}/nearest"), message, help);
        }
        found
    }

    fn loads(&mut self, points: &Points<2>) -> Vec<Load<2>> {
        let deck = self.deck;
        let names: Vec<&str> = deck.bodies.iter().map(|b| b.name.as_str()).collect();
        let acts_on = |bodies: &Option<Vec<String>>| match bodies {
            Some(chosen) => names.iter().map(|n| chosen.iter().any(|c| c == n)).collect(),
            None => vec![true; names.len()],
        };
        let mut loads = Vec::new();
        for (number, load) in deck.loads.iter().enumerate() {
            let pointer = format!("/loads/{number}");
            loads.push(match load {
                LoadDeck::Gravity { name, acceleration, bodies, curve } => Load {
                    name: name.clone(),
                    action: Action::Gravity(pair(acceleration)),
                    acts_on: acts_on(bodies),
                    curve: self.curve(curve),
                },
                LoadDeck::BodyForce { name, force, bodies, curve } => {
                    let mut along = |d: usize| match force.get(d) {
                        Some(expression) => self.formula(expression, &format!("{pointer}/force/{d}")),
                        None => Formula::constant(0.0),
                    };
                    let action = Action::BodyForce([along(0), along(1)]);
                    Load { name: name.clone(), action, acts_on: acts_on(bodies), curve: self.curve(curve) }
                }
                LoadDeck::PointForce { name, body, points: selector, total, curve } => {
                    let place = format!("{pointer}/points");
                    let chosen = self.nearest(points, body, &selector.nearest, selector.count, &place);
                    let share = 1.0 / chosen.len().max(1) as f64;
                    Load {
                        name: name.clone(),
                        action: Action::PointForce { points: chosen, force: pair(total).map(|f| f * share) },
                        acts_on: names.iter().map(|n| n == body).collect(),
                        curve: self.curve(curve),
                    }
                }
            });
        }
        loads
    }

    fn probes(&mut self, points: &Points<2>) -> Vec<Probe> {
        let deck = self.deck;
        let mut probes = Vec::new();
        for (number, probe) in deck.output.probes.iter().enumerate() {
            let pointer = format!("/output/probes/{number}");
            let points = self.nearest(points, &probe.body, &probe.nearest, probe.count, &pointer);
            probes.push(Probe { name: probe.name.clone(), points });
        }
        probes
    }
}
