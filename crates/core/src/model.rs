//! The model: everything about an analysis that does not change while it runs.

use crate::basis::{DomainKind, Method, domain_volume};
use crate::domain::DomainUpdate;
use crate::grid::Grid;
use crate::material::Material;
use crate::points::{PointVolume, Points};
use crate::stress::Formulation;

mod arrays;
mod boundary_condition;
mod load;
mod newton;
mod stabilisation;
mod stepping;

pub use arrays::HistoryVariable;
pub use boundary_condition::{BoundaryCondition, NodeSet};
pub use load::{Action, Load, LoadCurve, VectorFormula};
pub use newton::{Newton, Patterns, Predictor, Tangent};
pub use stabilisation::{Stabilisation, Where};
pub use stepping::{Control, SAME, Stepping};

/// A material under its name.
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
    /// Number of its material.
    pub material: usize,
    /// Method of its points.
    pub method: Method,
    /// How their domains follow the deformation; without effect for methods without domain.
    pub domain_update: DomainUpdate,
}

/// A place whose displacement is recorded: the mean over some points.
#[derive(Debug, Clone, PartialEq)]
pub struct Probe {
    /// Name.
    pub name: String,
    /// Permanent numbers of the points.
    pub points: Vec<u32>,
}

/// An analysis in `D` dimensions; immutable after construction.
#[derive(Debug)]
pub struct Model<const D: usize> {
    /// One line that says what is analysed.
    pub title: String,
    /// The background grid.
    pub grid: Box<dyn Grid<D>>,
    /// Whether the bodies are of revolution about the axis where the first coordinate vanishes; otherwise those of two
    /// dimensions have unit thickness.
    pub revolved: bool,
    /// Configuration in which equilibrium is written.
    pub formulation: Formulation,
    /// Where the current volume of a point comes from.
    pub point_volume: PointVolume,
    /// Where cells that hold hardly any material are stabilised.
    pub stabilisation: Stabilisation,
    /// Materials.
    pub materials: Vec<NamedMaterial>,
    /// Bodies.
    pub bodies: Vec<Body>,
    /// Prescribed displacements.
    pub boundary_conditions: Vec<BoundaryCondition<D>>,
    /// External forces.
    pub loads: Vec<Load<D>>,
    /// How the loading is divided into steps.
    pub stepping: Stepping,
    /// Control of the Newton iterations.
    pub newton: Newton,
    /// Places whose displacement is recorded.
    pub probes: Vec<Probe>,
}

impl<const D: usize> Model<D> {
    /// A model on a grid, without bodies, conditions and loads; it takes one load step of unit time.
    pub fn new(grid: Box<dyn Grid<D>>) -> Model<D> {
        Model {
            title: String::new(),
            grid,
            revolved: false,
            formulation: Formulation::default(),
            point_volume: PointVolume::default(),
            stabilisation: Stabilisation::default(),
            materials: Vec::new(),
            bodies: Vec::new(),
            boundary_conditions: Vec::new(),
            loads: Vec::new(),
            stepping: Stepping::fixed(1, 1.0),
            newton: Newton::default(),
            probes: Vec::new(),
        }
    }

    /// The curve that all loads and prescribed motions follow; `None` where they follow several, or where there are
    /// none.
    pub fn common_curve(&self) -> Option<&LoadCurve> {
        // Conditions that only hold their nodes have a curve without effect.
        let moving = self.boundary_conditions.iter().filter(|c| c.moves()).map(|condition| &condition.curve);
        let mut curves = self.loads.iter().map(|load| &load.curve).chain(moving);
        let first = curves.next()?;
        curves.all(|curve| curve == first).then_some(first)
    }

    /// Whether there is one load factor for all loads and prescribed motions.
    pub fn has_one_load_factor(&self) -> bool {
        self.stepping.control != Control::Load || self.common_curve().is_some()
    }

    /// The law of a point.
    pub fn law(&self, points: &Points<D>, p: usize) -> &dyn Material {
        self.materials[self.bodies[points.body[p] as usize].material].law.as_ref()
    }

    /// Extent of the bodies out of the plane at a place: the length of the full circle about the axis, or 1; [length].
    pub fn depth(&self, position: &[f64; D]) -> f64 {
        if self.revolved { std::f64::consts::TAU * position[0] } else { 1.0 }
    }

    /// Volume that a point represents in its converged state, V_p^n of eq. (22) or that of its domain, [volume].
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
