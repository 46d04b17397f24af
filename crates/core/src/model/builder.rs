//! A model and its points built in code, with defaults for everything that is not set.

use crate::basis::{DomainKind, Method};
use crate::domain::DomainUpdate;
use crate::formula::Formula;
use crate::grid::{Grid, Structured};
use crate::material::Material;
use crate::points::{Points, Seed};
use crate::stress::CellStrain;
use crate::tensor::padded;

use super::{
    Action, Body, BoundaryCondition, Load, LoadCurve, Model, NamedMaterial, NodeSet, Stepping, Tool,
};

/// Reason why a model cannot be built.
#[non_exhaustive]
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BuildError {
    /// Two materials, bodies, boundary conditions, loads or tools have the same name.
    #[error("there are two {kind} with the name `{name}`")]
    Repeated {
        /// Kind of the repeated entries: materials, bodies, boundary conditions, loads or tools.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A body refers to a material that was not added before the body.
    #[error("there is no material `{material}` for body `{body}`")]
    NoMaterial {
        /// The body.
        body: String,
        /// The material.
        material: String,
    },
    /// A body contains no points.
    #[error(
        "no point lies in body `{body}`: its region is outside the grid or smaller than the point spacing"
    )]
    Empty {
        /// The body.
        body: String,
    },
    /// A boundary condition contains no nodes.
    #[error("no node of the grid belongs to the boundary condition `{name}`")]
    NoNode {
        /// The condition.
        name: String,
    },
}

/// Points of a body in a [`Builder`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fill {
    /// Material point method.
    pub method: Method,
    /// Update rule of the domains.
    pub domain_update: DomainUpdate,
    /// Deformation that the law sees.
    pub strain: CellStrain,
    /// Length of a CPDI2 domain above which it is cut in two, in cells, [-]; `None` if domains stay whole.
    pub split_above: Option<f64>,
    /// Points per cell along each axis.
    pub points_per_cell: usize,
    /// Density, [mass/volume].
    pub density: f64,
}

impl Default for Fill {
    fn default() -> Self {
        Fill {
            method: Method::default(),
            domain_update: DomainUpdate::default(),
            strain: CellStrain::default(),
            split_above: None,
            points_per_cell: 2,
            density: 0.0,
        }
    }
}

/// Builds a model on a structured grid, and its points.
///
/// ```
/// use mpm_core::{grid::Structured, material::Hencky, model::{Builder, Fill}, solver::{self, Silent}};
/// let (model, mut points) = Builder::new(Structured::new([0.0; 2], [0.5; 2], [6, 6]))
///     .material("clay", Hencky::new(1e6, 0.3))
///     .body("block", "clay", Fill { density: 2000.0, ..Fill::default() }, |x| x[0] < 2.0 && x[1] < 2.0)
///     .fix("left", [true, false], |x| x[0] == 0.0)
///     .fix("floor", [false, true], |x| x[1] == 0.0)
///     .gravity("weight", [0.0, -9.81])
///     .steps(2)
///     .build()?;
/// let reached = solver::run(&model, &mut points, &mut Silent)?;
/// assert_eq!(reached.summary.steps, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// All loads and prescribed motions grow linearly to their final values at time 1. All other settings can be changed in
/// the resulting model. Errors are deferred to [`Builder::build`].
pub struct Builder<const D: usize> {
    grid: Structured<D>,
    model: Model<D>,
    seeds: Vec<Seed<D>>,
    fault: Option<BuildError>,
}

impl<const D: usize> Builder<D> {
    /// A builder with this grid and nothing else.
    pub fn new(grid: Structured<D>) -> Self {
        Builder { model: Model::new(Box::new(grid.clone())), grid, seeds: Vec::new(), fault: None }
    }

    /// Adds a material.
    pub fn material(mut self, name: &str, law: impl Material + 'static) -> Self {
        self.refuse_repeated("materials", name, |model| model.materials.iter().any(|m| m.name == name));
        self.model.materials.push(NamedMaterial { name: name.to_owned(), law: Box::new(law) });
        self
    }

    /// Adds a body of a material that has already been added. Cells are divided into equal boxes; a point is created
    /// for each box whose centre lies in the region.
    pub fn body(
        mut self,
        name: &str,
        material: &str,
        fill: Fill,
        region: impl Fn(&[f64; D]) -> bool,
    ) -> Self {
        self.refuse_repeated("bodies", name, |model| model.bodies.iter().any(|b| b.name == name));
        let Some(number) = self.model.materials.iter().position(|m| m.name == material) else {
            let (body, material) = (name.to_owned(), material.to_owned());
            self.fault.get_or_insert(BuildError::NoMaterial { body, material });
            return self;
        };
        let body = self.model.bodies.len() as u16;
        let Fill { method, domain_update, strain, split_above, .. } = fill;
        self.model.bodies.push(Body {
            name: name.to_owned(),
            material: number,
            method,
            domain_update,
            strain,
            split_above,
        });
        let before = self.seeds.len();
        for cell in 0..self.grid.n_cells() {
            self.fill_cell(cell, body, number, &fill, &region);
        }
        if self.seeds.len() == before {
            self.fault.get_or_insert(BuildError::Empty { body: name.to_owned() });
        }
        self
    }

    fn fill_cell(
        &mut self,
        cell: usize,
        body: u16,
        material: usize,
        fill: &Fill,
        region: &impl Fn(&[f64; D]) -> bool,
    ) {
        let n = fill.points_per_cell;
        let first = self.grid.node_position(self.grid.corners(cell).nodes()[0] as usize);
        let half = self.grid.sides(self.grid.cell_index(cell)).map(|side| 0.5 * side / n as f64);
        let law = &self.model.materials[material].law;
        for number in 0..n.pow(D as u32) {
            let index = |d: usize| (number / n.pow(d as u32) % n) as f64;
            let position: [f64; D] = std::array::from_fn(|d| first[d] + (2.0 * index(d) + 1.0) * half[d]);
            if !region(&position) {
                continue;
            }
            let corner = |k: usize| -> [f64; D] {
                std::array::from_fn(|d| position[d] + if k >> d & 1 == 1 { half[d] } else { -half[d] })
            };
            let domain = fill.method.domain();
            let volume = half.iter().map(|l| 2.0 * l).product::<f64>() * self.model.depth(&position);
            self.seeds.push(Seed {
                body,
                position,
                half_lengths: if domain == DomainKind::Corners { [0.0; D] } else { half },
                corners: if domain == DomainKind::Corners {
                    (0..1 << D).map(corner).collect()
                } else {
                    Vec::new()
                },
                volume,
                mass: fill.density * volume,
                outer_layer: false,
                history: law.initial_history_at(&padded(&position)),
            });
        }
    }

    /// Turns all bodies into bodies of revolution about the axis where the first coordinate is zero. Call this before
    /// adding bodies.
    pub fn revolved(mut self) -> Self {
        self.model.revolved = true;
        self
    }

    /// Fixes, along some axes, the nodes for which `on` holds.
    pub fn fix(self, name: &str, axes: [bool; D], on: impl Fn(&[f64; D]) -> bool) -> Self {
        self.prescribe(name, axes.map(|axis| axis.then_some(0.0)), on)
    }

    /// Prescribes the final displacement, [length], of the nodes for which `on` holds, along the axes for which a value
    /// is given.
    pub fn prescribe(
        mut self,
        name: &str,
        displacement: [Option<f64>; D],
        on: impl Fn(&[f64; D]) -> bool,
    ) -> Self {
        let is_known = |model: &Model<D>| model.boundary_conditions.iter().any(|c| c.name == name);
        self.refuse_repeated("boundary conditions", name, is_known);
        let is_on = |node: &u32| on(&self.grid.node_position(*node as usize));
        let nodes: Vec<u32> = (0..self.grid.n_nodes() as u32).filter(is_on).collect();
        if nodes.is_empty() {
            self.fault.get_or_insert(BuildError::NoNode { name: name.to_owned() });
        }
        let displacement = displacement.map(|value| value.map(Formula::constant));
        let condition =
            BoundaryCondition::new(name, NodeSet::Fixed(nodes), displacement, LoadCurve::ramp(1.0));
        self.model.boundary_conditions.push(condition);
        self
    }

    /// Adds the weight of all bodies under a gravitational acceleration, [length/time²].
    pub fn gravity(self, name: &str, acceleration: [f64; D]) -> Self {
        self.load(name, Action::Gravity(acceleration))
    }

    /// Adds a load on all bodies.
    pub fn load(mut self, name: &str, action: Action<D>) -> Self {
        self.refuse_repeated("loads", name, |model| model.loads.iter().any(|load| load.name == name));
        let (name, curve) = (name.to_owned(), LoadCurve::ramp(1.0));
        self.model.loads.push(Load { name, action, acts_on: Vec::new(), curve });
        self
    }

    /// Adds a rigid tool.
    pub fn tool(mut self, tool: Tool<D>) -> Self {
        self.refuse_repeated("tools", &tool.name, |model| model.tools.iter().any(|t| t.name == tool.name));
        self.model.tools.push(tool);
        self
    }

    /// Divides the loading into `count` equal steps.
    pub fn steps(mut self, count: usize) -> Self {
        self.model.stepping = Stepping::fixed(count.max(1), 1.0);
        self
    }

    /// The model and its points, whose permanent numbers follow the order of bodies and cells.
    ///
    /// # Errors
    /// The first error in the calls that set up the builder.
    pub fn build(mut self) -> Result<(Model<D>, Points<D>), BuildError> {
        let bodies = self.model.bodies.len();
        if self.model.tools.is_empty() {
            let has_box =
                |seed: &Seed<D>| self.model.bodies[seed.body as usize].method.domain() == DomainKind::Box;
            let seeds = self.seeds.iter_mut().filter(|seed| !has_box(seed));
            seeds.for_each(|seed| seed.half_lengths = [0.0; D]);
        }
        self.model.loads.iter_mut().for_each(|load| load.acts_on = vec![true; bodies]);
        match self.fault {
            Some(fault) => Err(fault),
            None => Ok((self.model, Points::new(&self.seeds))),
        }
    }

    fn refuse_repeated(&mut self, kind: &'static str, name: &str, is_known: impl Fn(&Model<D>) -> bool) {
        if is_known(&self.model) {
            self.fault.get_or_insert(BuildError::Repeated { kind, name: name.to_owned() });
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;
    use crate::material::{Hencky, VonMises};

    fn grid() -> Structured<2> {
        Structured::new([0.0; 2], [0.5; 2], [4, 4])
    }

    #[test]
    fn points_fill_the_region_whatever_the_method() {
        for method in [Method::Mpm, Method::Gimp, Method::Cpdi1, Method::Cpdi2] {
            let fill = Fill { method, points_per_cell: 3, density: 2.0, ..Fill::default() };
            let (model, points) = Builder::new(grid())
                .material("clay", VonMises::new(1e6, 0.3, 1e4))
                .body("block", "clay", fill, |x| x[0] < 1.0)
                .build()
                .unwrap();
            assert_eq!((points.len(), model.bodies.len(), points.history_len), (8 * 9, 1, 1));
            let sum = |values: &[f64]| values.iter().sum::<f64>();
            assert!((sum(&points.original_volume) - 2.0).abs() < 1e-12);
            assert!((sum(&points.mass) - 4.0).abs() < 1e-12);
        }
    }

    #[test]
    fn faults_are_named() {
        let fill = Fill::default();
        let clay = || Builder::new(grid()).material("clay", Hencky::new(1e6, 0.3));
        let refused = |builder: Builder<2>| builder.build().map(|_| ()).unwrap_err().to_string();
        assert!(refused(clay().body("a", "sand", fill, |_| true)).contains("no material `sand`"));
        assert!(refused(clay().body("a", "clay", fill, |_| false)).contains("no point lies in body `a`"));
        let two = clay().body("a", "clay", fill, |_| true).body("a", "clay", fill, |_| true);
        assert!(refused(two).contains("two bodies with the name `a`"));
        assert!(refused(clay().fix("top", [true; 2], |x| x[1] > 9.0)).contains("no node"));
    }
}
