//! The model: all data of an analysis. The data stay constant during a run, except for changes between stages and a
//! grid that moves between steps.

use crate::basis::{DomainKind, Method, domain_volume};
use crate::domain::DomainUpdate;
use crate::grid::Grid;
use crate::linear::Engines;
use crate::material::Material;
use crate::points::{PointVolume, Points};
use crate::region::vector::{dot, norm};
use crate::stress::{CellStrain, Formulation};
use crate::surface::Surface;

mod absorbed;
mod arrays;
mod body_contact;
mod boundary_condition;
mod builder;
mod dynamics;
mod filling;
mod fitting;
mod initial_state;
mod lift;
mod load;
mod moduli;
mod moving_grid;
mod newton;
mod released;
mod stabilisation;
mod stage;
mod stepping;
mod tool;
mod tool_part;
mod water;

pub use absorbed::Absorbed;
pub use arrays::HistoryVariable;
pub use body_contact::{BodyContact, BodyGroups, Glued};
pub use boundary_condition::{BoundaryCondition, NodeSet, OnSurface, displacement_at};
pub use builder::{BuildError, Builder, Fill};
pub use dynamics::{Dynamics, ForceOfInertia, Scheme};
pub use filling::{FillError, Fillable, FilledRegion, Filling, Fit, MAX_POINTS, Placement};
pub use initial_state::InitialImbalance;
pub use lift::Lift;
pub use load::{Action, Load, LoadCurve, Pressure, VectorFormula};
pub use moduli::ModuliAtRest;
pub use moving_grid::{FollowError, FollowingLines, GridMotionError, MovingGrid};
pub use newton::{Newton, Predictor, StiffnessUpdate};
pub use released::{Released, SavedRelease, SideForce};
pub use stabilisation::{Stabilisation, StabilisationMode};
pub use stage::{Course, Factors, Present, Stage};
pub use stepping::{AfterSlide, Control, Controlled, SAME_TIME, Stepping};
pub use tool::{ContactControl, Freedom, Interface, Shear, Tool, ToolLoad};
pub use tool_part::ToolPart;
pub use water::{PORE_PRESSURE, Water, WaterLevel, WetPart};

/// A named material.
#[derive(Debug)]
pub struct NamedMaterial {
    /// Name.
    pub name: String,
    /// The law.
    pub law: Box<dyn Material>,
}

/// A body: material, method and domain update of its points.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Name.
    pub name: String,
    /// Index of its material.
    pub material: usize,
    /// Material point method of its points.
    pub method: Method,
    /// Update rule of the domains of the points and, for standard points, of the boxes with which they touch tools.
    pub domain_update: DomainUpdate,
    /// Deformation that the law sees.
    pub strain: CellStrain,
    /// Length of a CPDI2 domain above which it is cut in two, in cells, [-]; `None` if domains stay whole.
    pub split_above: Option<f64>,
}

/// A probe: a set of points whose mean displacement is recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// Name.
    pub name: String,
    /// Permanent numbers of the points.
    pub points: Vec<u32>,
}

/// An analysis in `D` dimensions; constant during a load step.
#[derive(Debug)]
pub struct Model<const D: usize> {
    /// One-line description of the analysis.
    pub title: String,
    /// The background grid of the current step.
    pub grid: Box<dyn Grid<D>>,
    /// The lines of the grid that follow prescribed displacements; `None` if the grid does not move.
    pub moving_grid: Option<MovingGrid<D>>,
    /// True for bodies of revolution about the axis where the first coordinate is zero. Other two-dimensional bodies
    /// have unit thickness.
    pub revolved: bool,
    /// Configuration in which equilibrium is formulated.
    pub formulation: Formulation,
    /// Definition of the current volume of a point.
    pub point_volume: PointVolume,
    /// Ghost stabilisation of cells with little material.
    pub stabilisation: Stabilisation,
    /// Materials.
    pub materials: Vec<NamedMaterial>,
    /// Bodies.
    pub bodies: Vec<Body>,
    /// Surfaces of the bodies, on which loads and boundary conditions act.
    pub surfaces: Vec<Surface<D>>,
    /// Prescribed displacements.
    pub boundary_conditions: Vec<BoundaryCondition<D>>,
    /// External forces.
    pub loads: Vec<Load<D>>,
    /// Rigid tools that touch the bodies.
    pub tools: Vec<Tool<D>>,
    /// Pairs of bodies that may touch, slide and part.
    pub contacts: Vec<BodyContact>,
    /// The groups of bodies that share the unknowns of their nodes.
    pub body_groups: BodyGroups,
    /// Water at rest in the ground and above it; `None` without a water level.
    pub water: Option<Water>,
    /// Treatment of an initial state that is out of balance, if bodies are stressed at time 0; loads then act at time 0
    /// with the factors of their curves. `None` if no body is stressed at time 0; no load then acts at time 0, whatever
    /// its curve.
    pub initial_imbalance: Option<InitialImbalance>,
    /// Division of the loading into steps, and step control.
    pub stepping: Stepping,
    /// Control of the Newton iterations.
    pub newton: Newton,
    /// Probes.
    pub probes: Vec<Probe>,
    /// The stages; empty if the analysis is not divided. `stepping` and `newton` belong to the current stage.
    pub stages: Vec<Stage<D>>,
    /// The state of the current stage.
    pub present: Present<D>,
    /// The library that solves equations distributed over several ranks.
    pub engines: Engines<D>,
}

impl<const D: usize> Model<D> {
    /// A model with a grid only: no bodies, boundary conditions or loads, and one load step of unit time.
    pub fn new(grid: Box<dyn Grid<D>>) -> Model<D> {
        Model {
            title: String::new(),
            grid,
            moving_grid: None,
            revolved: false,
            formulation: Formulation::default(),
            point_volume: PointVolume::default(),
            stabilisation: Stabilisation::default(),
            materials: Vec::new(),
            bodies: Vec::new(),
            surfaces: Vec::new(),
            boundary_conditions: Vec::new(),
            loads: Vec::new(),
            tools: Vec::new(),
            contacts: Vec::new(),
            body_groups: BodyGroups::default(),
            water: None,
            initial_imbalance: None,
            stepping: Stepping::fixed(1, 1.0),
            newton: Newton::default(),
            probes: Vec::new(),
            stages: Vec::new(),
            present: Present::default(),
            engines: Engines::default(),
        }
    }

    /// The load curve shared by all loads and by all boundary conditions that move nodes; `None` if there are several
    /// curves or none. The curves of tools do not count.
    pub fn common_curve(&self) -> Option<&LoadCurve> {
        // The curve of a condition that only fixes nodes has no effect.
        let moving = self.boundary_conditions.iter().filter(|c| c.moves()).map(|condition| &condition.curve);
        let mut curves = self.loads.iter().map(|load| &load.curve).chain(moving);
        let first = curves.next()?;
        curves.all(|curve| curve == first).then_some(first)
    }

    /// True if one load factor governs all loads and boundary conditions that move nodes; never with stages.
    pub fn has_one_load_factor(&self) -> bool {
        self.stages.is_empty()
            && (self.stepping.control.has_unknown_factor() || self.common_curve().is_some())
    }

    /// True if boundary conditions, tools or the control of the load factor prescribe a motion.
    pub fn is_driven(&self) -> bool {
        self.stepping.control.has_unknown_factor()
            || self.boundary_conditions.iter().any(BoundaryCondition::moves)
            || self.tools.iter().any(|tool| Tool::<D>::components().any(|k| tool.is_driven(k)))
    }

    /// True if neither the bodies nor the tools bear a load.
    pub fn is_unloaded(&self) -> bool {
        self.loads.is_empty() && self.tools.iter().all(|tool| tool.loads.is_empty())
    }

    /// True if no load on the bodies or the tools changes in the current stage, so that only motions drive them.
    pub fn keeps_its_loads(&self) -> bool {
        let Stepping { start_time, end_time, .. } = self.stepping;
        let stands = |curve: &LoadCurve| {
            let within = curve.times().filter(|time| (start_time..=end_time).contains(time));
            let mut times = [end_time].into_iter().chain(within);
            times.all(|time| curve.factor(time) == curve.factor(start_time))
        };
        let mut of_tools = self.tools.iter().flat_map(|tool| &tool.loads);
        self.is_unloaded()
            || !self.stepping.control.has_unknown_factor()
                && self.present.released.is_empty()
                && self.loads.iter().all(|load| stands(&load.curve))
                && of_tools.all(|load| stands(&load.curve))
    }

    /// True if a boundary condition acts in the current stage.
    pub fn is_set(&self, condition: usize) -> bool {
        !self.present.is_released.get(condition).is_some_and(|released| *released)
    }

    /// The boundary conditions that move given nodes in the current stage, each with its number and its nodes.
    pub fn moved_nodes(&self) -> impl Iterator<Item = (usize, &BoundaryCondition<D>, &[u32])> {
        self.boundary_conditions.iter().enumerate().filter_map(|(number, condition)| match &condition.nodes {
            NodeSet::Fixed(nodes) if condition.moves() && self.is_set(number) => {
                Some((number, condition, nodes.as_slice()))
            }
            _ => None,
        })
    }

    /// True if, in the current stage, a boundary condition on given nodes prescribes the displacement of the grid node
    /// `node` along a direction within 60° of `direction` or of its opposite.
    pub fn holds_node(&self, node: u32, direction: &[f64; D]) -> bool {
        self.boundary_conditions.iter().enumerate().any(|(number, condition)| match &condition.nodes {
            NodeSet::Fixed(nodes) if self.is_set(number) && nodes.binary_search(&node).is_ok() => {
                let resists = |along: &[f64; D]| dot(along, direction).abs() > 0.5 * norm(direction);
                condition.directions().iter().any(resists)
            }
            _ => false,
        })
    }

    /// Share of the released forces that still acts at a time, [-].
    pub fn share_not_released(&self, time: f64) -> f64 {
        if self.stepping.dynamics.is_some() {
            // With inertia, what goes ceases to act at once, and absorbing boundaries go on to carry what they carried.
            return if self.present.absorbed.is_empty() { 0.0 } else { 1.0 };
        }
        ((self.stepping.end_time - time) / self.stepping.duration()).clamp(0.0, 1.0)
    }

    /// True if the bodies move with inertia in any stage.
    pub fn has_inertia(&self) -> bool {
        let in_stages = self.stages.iter().map(|stage| &stage.stepping);
        in_stages.chain([&self.stepping]).any(|stepping| stepping.dynamics.is_some())
    }

    /// The method of each body.
    pub fn methods(&self) -> Vec<Method> {
        self.bodies.iter().map(|body| body.method).collect()
    }

    /// True if a body takes the mean increments of cells.
    pub fn takes_means(&self) -> bool {
        self.bodies.iter().any(|body| body.strain == CellStrain::Mean)
    }

    /// Material law of a point.
    pub fn law(&self, points: &Points<D>, p: usize) -> &dyn Material {
        self.materials[self.bodies[points.body[p] as usize].material].law.as_ref()
    }

    /// Out-of-plane extent of the bodies at a position, [length]: 2πr for bodies of revolution, otherwise 1.
    pub fn depth(&self, position: &[f64; D]) -> f64 {
        if self.revolved { std::f64::consts::TAU * position[0] } else { 1.0 }
    }

    /// Mean out-of-plane extent of a facet with these corners, [length]. Its product with the length of the facet is
    /// the area; for bodies of revolution, this is the area of a truncated cone.
    pub fn mean_depth(&self, corners: &[[f64; D]; D]) -> f64 {
        corners.iter().map(|corner| self.depth(corner)).sum::<f64>() / D as f64
    }

    /// The original area of a sample of a surface, [length²]: per unit thickness in plane strain, on the full circle
    /// for bodies of revolution.
    pub fn original_area(&self, surface: &Surface<D>, sample: usize) -> f64 {
        let area = surface.original_area(sample).iter().map(|a| a * a).sum::<f64>().sqrt();
        area * self.mean_depth(&surface.facet(sample))
    }

    /// Volume of a point in its converged state, [volume]: V_p^n of eq. (22), or the volume of its domain.
    pub fn volume(&self, points: &Points<D>, p: usize) -> f64 {
        let domain = match self.point_volume {
            PointVolume::Deformation => DomainKind::None,
            PointVolume::Domain => self.bodies[points.body[p] as usize].method.domain(),
        };
        let area = match domain {
            DomainKind::None => return points.volume(p),
            DomainKind::Box => points.converged.half_lengths[p].iter().map(|l| 2.0 * l).product(),
            DomainKind::Corners => domain_volume(points.corners(p)),
        };
        self.depth(&points.converged.position[p]) * area
    }
}
