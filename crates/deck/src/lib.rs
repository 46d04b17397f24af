//! The deck: serde types that mirror the YAML input one to one.
//!
//! A deck is declarative. Unknown keys are errors, every quantity documents its unit (any consistent system; the
//! examples use m, N, Pa, kg), and a number may be written as an expression of the deck's parameters, `${h/2}`. The doc
//! comments of these types, here and in other modules, become the descriptions in `schema/deck.schema.json` and in
//! `docs/deck.md`.

#![allow(rustdoc::broken_intra_doc_links, reason = "units stand in brackets")]

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use self::check as validate;
pub use boundary_conditions::{
    AlongSurface, Axis, BoundaryConditionDeck, FixDeck, MoveDeck, NodeSelector, NormalDeck,
};
pub use build::{first_step, holding, plan, ready, size};
pub(crate) use build::{placing, seeding, tool_shapes};
pub use contacts::{All, Between, BodyContactDeck};
pub use dynamic::{AbsorbDeck, DampingDeck, DynamicDeck, MotionDeck, MotionQuantity, SchemeDeck};
pub use grid::{AxisSpacing, FollowDeck, GridDeck, IntervalDeck, SpacingDeck, Unrefined};
pub use initial_stress::{InitialStressDeck, StressDeck, initial_factor};
pub use laws::{
    ALLOW_LIBRARIES, CohesionSofteningDeck, DruckerPragerDeck, FrictionSofteningDeck, HenckyDeck,
    LibraryDeck, MaterialDeck, ModifiedCamClayDeck, MohrCoulombDeck, NeoHookeanDeck, TrescaDeck,
    VonMisesDeck, is_field_of_points, may_run_libraries,
};
pub use loads::{
    BodyForceDeck, GravityDeck, HydrostaticDeck, LoadCurve, LoadDeck, Per, PointForceDeck, PointSelector,
    PressureDeck, TractionDeck,
};
pub use material::{CellSize, StatedLaw, Surroundings};
pub use mpm_core::basis::Method;
pub use mpm_core::domain::DomainUpdate;
use mpm_core::formula::Formula;
pub use mpm_core::linear::Choice as LinearChoice;
pub use mpm_core::model::InitialImbalance;
use mpm_core::model::Newton;
pub use mpm_core::model::Stabilisation;
pub use mpm_core::model::{Predictor, StiffnessUpdate};
pub use mpm_core::points::PointVolume;
pub use mpm_core::stress::{CellStrain, Formulation};
use mpm_core::terms::WATER;
use mpm_files::fields::PointField;
use mpm_files::results::Request;
use mpm_files::vtu::Precision;
pub use read::{changes, load, references, schema, source};
pub(crate) use read::{hash, parameters, shape, span, yaml};
pub use refined_place::{AlongAxes, RefineDeck, RefinedAt};
pub use region::{Direction, GroupDeck, GroupOfDimension, Shape};
pub use stages::{AddDeck, AtLimit, PlacedDeck, Reset, StageDeck, ThenDeck};
pub use steps::{ControlDeck, StepsDeck, Until};
pub use surfaces::{HalfSpaceDeck, PartDeck, SurfaceDeck};
pub use tools::{
    ContactDeck, FreeDeck, FrictionDeck, RotationDeck, ToolDeck, ToolLoadDeck, ToolPartDeck, ToolShape, Turn,
};
pub use units::UnitsDeck;
pub use water::{Drainage, LevelDeck, StageWaterDeck, WaterDeck};

mod account;
pub mod advice;
mod boundary_conditions;
pub mod build;
pub mod check;
mod contacts;
pub mod diagnostic;
mod dynamic;
pub mod formulas;
mod gates;
mod grid;
mod initial_stress;
mod laws;
mod loads;
mod material;
mod per_axis;
mod placed;
pub mod quoting;
pub mod read;
pub mod reference;
mod refined_axes;
mod refined_place;
pub mod refinement;
mod region;
mod stages;
mod steps;
mod surfaces;
mod tools;
mod units;
mod water;

/// A vector as the schema describes it: two entries in the plane, three in space.
#[derive(JsonSchema)]
#[schemars(inline)]
#[expect(dead_code, reason = "only its schema is used")]
struct Vector(#[schemars(length(min = 2, max = 3))] Vec<f64>);

/// A pair of numbers.
type Pair = [f64; 2];

/// A vector of lengths above zero, [length].
#[derive(JsonSchema)]
#[schemars(inline)]
#[expect(dead_code, reason = "only its schema is used")]
struct Lengths(#[schemars(length(min = 2, max = 3))] Vec<Length>);

/// A vector of numbers or formulas.
#[derive(JsonSchema)]
#[schemars(inline)]
#[expect(dead_code, reason = "only its schema is used")]
struct Expressions(#[schemars(length(min = 2, max = 3))] Vec<Expression>);

/// A length above zero, [length].
#[derive(JsonSchema)]
#[schemars(inline)]
#[expect(dead_code, reason = "only its schema is used")]
struct Length(#[schemars(extend("exclusiveMinimum" = 0.0))] f64);

/// Points along one axis of a cell.
#[derive(JsonSchema)]
#[schemars(inline)]
#[expect(dead_code, reason = "only its schema is used")]
struct AlongAxis(#[schemars(range(min = 1, max = 1000))] u32);

/// An input deck of `mpm`, version 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deck {
    /// Version of the deck format. Always 1.
    #[schemars(range(min = 1, max = 1))]
    pub version: u32,
    /// Title of the analysis in one line; copied into the results.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = ["Elastic cantilever"]))]
    pub title: Option<String>,
    /// The units of all numbers, one consistent set; without them, results are labelled by kinds of quantities.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub units: Option<UnitsDeck>,
    /// Named numbers or words, inserted as `${name}` or `${h/2}` anywhere in the deck; `--set name=value` overrides
    /// them.
    #[serde(default)]
    #[schemars(extend("examples" = [{"h": 0.5, "method": "gimp"}]))]
    pub parameters: BTreeMap<String, Parameter>,
    /// Kind of analysis.
    #[serde(default)]
    pub analysis: Analysis,
    /// The background grid on which equilibrium is solved.
    pub grid: GridDeck,
    /// Materials by name.
    #[schemars(extend("minProperties" = 1))]
    pub materials: BTreeMap<String, MaterialDeck>,
    /// Bodies, each filled with material points.
    #[schemars(length(min = 1, max = 60_000))]
    pub bodies: Vec<BodyDeck>,
    /// Water at rest in the ground and above it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [{"unit_weight": 9.81e3, "level": 4}]))]
    pub water: Option<WaterDeck>,
    /// Surfaces of bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 60_000))]
    pub surfaces: Vec<SurfaceDeck>,
    /// Prescribed displacements of grid nodes and of surfaces.
    #[serde(default)]
    #[schemars(length(max = 60_000))]
    pub boundary_conditions: Vec<BoundaryConditionDeck>,
    /// External forces.
    #[serde(default)]
    pub loads: Vec<LoadDeck>,
    /// Rigid tools that touch the bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 60_000))]
    pub tools: Vec<ToolDeck>,
    /// Contact between bodies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 60_000))]
    pub contacts: Vec<BodyContactDeck>,
    /// Division of the loading into load steps; `stages` takes its place if the analysis consists of several stages.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<StepsDeck>,
    /// Motion with inertia in an analysis without stages; each of several stages has a key of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [{}]))]
    pub dynamic: Option<DynamicDeck>,
    /// Stages of the analysis, one after the other, in place of `steps`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(max = 1000))]
    pub stages: Vec<StageDeck>,
    /// Control of the Newton iterations.
    #[serde(default)]
    pub solver: SolverDeck,
    /// Checkpoints during the run; without this key, one is written only when the run ends early.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub checkpoint: Option<CheckpointDeck>,
    /// Files that the run writes, and how often.
    #[serde(default)]
    pub output: OutputDeck,
}

/// A parameter: a number, or a word such as the name of a method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Parameter {
    /// A number.
    Number(f64),
    /// A word.
    Word(String),
}

impl From<Parameter> for Value {
    fn from(parameter: Parameter) -> Value {
        match parameter {
            Parameter::Number(number) => number.into(),
            Parameter::Word(word) => word.into(),
        }
    }
}

/// Kind of analysis.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Analysis {
    /// How the geometry represents the three-dimensional body; this sets the number of axes, and thus the number of
    /// entries in every vector of the deck.
    pub idealisation: Idealisation,
    /// Configuration in which equilibrium is formulated; results do not depend on it.
    pub formulation: Formulation,
    /// How the current volume of a point is computed.
    pub point_volume: PointVolume,
    /// Stabilisation of cells that contain little material.
    pub stabilisation: Stabilisation,
    /// What happens if an initial stress and the loads at time 0 are out of balance by more than the tolerance of the
    /// solver.
    pub initial_imbalance: InitialImbalance,
}

/// How the geometry represents the three-dimensional body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Idealisation {
    /// Plane strain per unit thickness: no displacement and no strain in z.
    #[default]
    PlaneStrain,
    /// Body of revolution about the axis x = 0, without twist: x is the distance from the axis, y runs along it, and z
    /// is the circumferential direction. Volumes, masses and forces are those of the full circle.
    Axisymmetric,
    /// Three-dimensional body: three axes, and three entries in every vector of the deck.
    Solid,
}

impl Idealisation {
    /// Number of axes of the geometry.
    pub fn dimensions(self) -> usize {
        match self {
            Idealisation::PlaneStrain | Idealisation::Axisymmetric => 2,
            Idealisation::Solid => 3,
        }
    }

    /// Name in decks.
    pub fn name(self) -> &'static str {
        match self {
            Idealisation::PlaneStrain => "plane-strain",
            Idealisation::Axisymmetric => "axisymmetric",
            Idealisation::Solid => "solid",
        }
    }
}

/// Names of the axes.
pub(crate) const AXES: [&str; 3] = ["x", "y", "z"];

impl Deck {
    /// Reads a deck from a document, such as the copy in a checkpoint.
    ///
    /// # Errors
    /// The first deviation from the format.
    pub fn from_value(document: &Value) -> Result<Deck, serde_json::Error> {
        Deck::deserialize(document)
    }

    /// Number of axes of the geometry.
    pub fn dimensions(&self) -> usize {
        self.analysis.idealisation.dimensions()
    }

    /// The results that the deck requests.
    pub fn request(&self) -> Request {
        let OutputDeck { every, fields, precision, .. } = &self.output;
        let mut fields = fields.clone();
        if self.has_pore_pressure() && fields == PointField::by_default() {
            fields.push(PointField::TotalStress);
        }
        Request {
            every: *every as usize,
            fields,
            precision: *precision,
            checkpoints: self.checkpoint.map(|checkpoint| checkpoint.every.max(1) as usize),
            forces: if self.has_level() { vec![WATER.to_owned()] } else { Vec::new() },
            nodal: Vec::new(),
            conditions: Vec::new(),
            energies: Vec::new(),
        }
    }
}

/// One value for all axes, or a list with one value per axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PerAxis<T> {
    /// The same value along every axis.
    Same(T),
    /// One value per axis.
    Each(#[schemars(length(min = 2, max = 3))] Vec<T>),
}

/// A body: a region filled with material points of one material.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BodyDeck {
    /// Name, unique among the bodies.
    pub name: String,
    /// Name of the material.
    pub material: String,
    /// Region that the body fills at the start.
    pub shape: Shape,
    /// Material point method for the points of the body.
    #[serde(default)]
    pub method: Method,
    /// How the domains of GIMP points follow the deformation; `corners` by default. Points of the standard method have
    /// no domain.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub domain_update: Option<DomainUpdate>,
    /// Deformation that the law sees at the points of a cell; `standard` by default. `mean-dilatation` prevents locking
    /// of nearly incompressible material and of plastic flow at constant volume, `mean` also of flow that dilates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub strain: Option<CellStrain>,
    /// The former name of `strain`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("deprecated" = true))]
    pub volumetric: Option<CellStrain>,
    /// Length of the domain of a CPDI2 point, as a multiple of the cell size, [-], above which the point is split in
    /// two; without this key, domains are not split. Material that flows along a tool or in a shear band stretches
    /// domains without bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.25, max = 100.0), extend("examples" = [1]))]
    pub split_above: Option<f64>,
    /// Points along each axis of every filled rectangle, quadrilateral, brick or hexahedron, at the centres of an even
    /// subdivision: one number or one per axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<PerAxis<AlongAxis>>", extend("examples" = [4, [2, 3]]))]
    pub points_per_cell: Option<PerAxis<u32>>,
    /// Points in every filled triangle of a gmsh grid: 1, 4, 9, 16, … at the centroids of an even subdivision, or 8,
    /// which halves each of the 4 triangles of such a subdivision.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 10_000), extend("examples" = [4]))]
    pub points_per_triangle: Option<u32>,
    /// Points in every filled tetrahedron of a gmsh grid: 1, 8, 27, 64, … at the centroids of an even subdivision, or
    /// 4, from the four tetrahedra that join each face to the centroid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 10_000), extend("examples" = [8]))]
    pub points_per_tetrahedron: Option<u32>,
    /// Distance between points, [length], in place of `points_per_cell`, for a body that is not aligned with the grid:
    /// one number or one per axis. The sides of a box must be whole multiples of this distance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<PerAxis<Length>>", extend("examples" = [0.1, [0.1, 0.2]]))]
    pub point_spacing: Option<PerAxis<f64>>,
    /// Stress at time 0; without this key, the body is free of stress at time 0, and loads grow from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = [{"type": "geostatic", "surface": 10, "k0": 0.5}]))]
    pub initial_stress: Option<InitialStressDeck>,
    /// Velocity with which the body begins to move, [length/time], one number or formula of x, y and, in space, z (the
    /// position of the points) per axis. It needs a first stage with inertia, or a stage with inertia that adds the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<Expressions>", extend("examples" = [[1, 0], ["-5*y", "5*x"]]))]
    pub velocity: Option<Vec<Expression>>,
}

/// A box aligned with the axes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxDeck {
    /// Corner with the smallest coordinates, [length].
    #[schemars(with = "Vector", extend("examples" = [[0, 0]]))]
    pub min: Vec<f64>,
    /// Corner with the largest coordinates, [length].
    #[schemars(with = "Vector", extend("examples" = [[0, 10]]))]
    pub max: Vec<f64>,
}

/// A number, or a formula written as text.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Expression {
    /// A number.
    Number(f64),
    /// A formula, for example `gamma*y`.
    Formula(String),
}

impl Expression {
    /// The value of the expression, if it is a number.
    pub fn as_number(&self) -> Option<f64> {
        match self {
            Expression::Number(value) => Some(*value),
            Expression::Formula(_) => None,
        }
    }

    /// The text of the expression, if it is a formula.
    pub fn as_formula(&self) -> Option<&str> {
        match self {
            Expression::Number(_) => None,
            Expression::Formula(text) => Some(text),
        }
    }

    /// True if the expression is zero everywhere.
    pub fn is_zero(&self) -> bool {
        match self {
            Expression::Number(value) => *value == 0.0,
            Expression::Formula(text) => {
                Formula::parse(text, &[]).ok().and_then(|f| f.as_constant()) == Some(0.0)
            }
        }
    }
}

impl BodyDeck {
    /// The deformation that the law sees at the points of a cell.
    pub fn strain(&self) -> CellStrain {
        self.strain.or(self.volumetric).unwrap_or_default()
    }

    /// The key that states this deformation.
    pub(crate) fn strain_key(&self) -> &'static str {
        if self.strain.is_none() && self.volumetric.is_some() { "volumetric" } else { "strain" }
    }
}

fn one() -> u32 {
    1
}

fn yes() -> bool {
    true
}

/// Values of the retired key `pattern`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RetiredPattern {
    /// Without effect: this is what happens.
    Same,
    /// Without effect: patterns contained in an earlier one are analysed as well.
    Contained,
}

/// Default of `max_iterations` if the deck has tools.
const MAX_ITERATIONS_WITH_TOOLS: usize = 60;

/// Control of the Newton iterations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SolverDeck {
    /// Largest relative out-of-balance force of a converged step, [-].
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0, "examples" = [1e-9]))]
    pub tolerance: f64,
    /// Largest number of linear solves in a step; by default 20, and 60 with tools, whose contact points open, close,
    /// stick and slide during the iterations. A quarter more are made while each leaves a tenth of the residual or less.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = 1000), extend("examples" = [40]))]
    pub max_iterations: Option<u32>,
    /// Solver for the linear equations of the iterations.
    pub linear: LinearChoice,
    /// Starting point of the iterations of a step under prescribed loads.
    pub predictor: Predictor,
    /// When the stiffness is factorised within a step.
    pub tangent: StiffnessUpdate,
    /// Retired, without effect: the elimination order and the layout of the factor are reused while the sparsity
    /// pattern stays the same.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("deprecated" = true))]
    pub pattern: Option<RetiredPattern>,
}

impl Default for SolverDeck {
    fn default() -> Self {
        let Newton { tolerance, linear, predictor, tangent, .. } = Newton::default();
        SolverDeck { tolerance, max_iterations: None, linear, predictor, tangent, pattern: None }
    }
}

impl SolverDeck {
    /// The control of the iterations of a model.
    pub(crate) fn newton(&self, has_tools: bool) -> Newton {
        let SolverDeck { tolerance, max_iterations, linear, predictor, tangent, pattern: _ } = *self;
        let usual = if has_tools { MAX_ITERATIONS_WITH_TOOLS } else { Newton::default().max_iterations };
        let max_iterations = max_iterations.map_or(usual, |most| most as usize);
        Newton { tolerance, max_iterations, linear, predictor, tangent }
    }
}

/// Checkpoints, from which `mpm run --resume` continues a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CheckpointDeck {
    /// Number of load steps from one checkpoint to the next.
    #[schemars(range(min = 1, max = 10_000_000), extend("examples" = [10]))]
    pub every: u32,
}

/// Files that the run writes, and how often.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct OutputDeck {
    /// Number of load steps from one set of VTU files to the next; the last step is always written. 0 writes no VTU
    /// files.
    #[schemars(range(max = 10_000_000))]
    pub every: u32,
    /// Fields of the points in VTU files; all but `pressure_smoothed`, `principal_stress` and `maximum_shear_stress` by
    /// default. Every file also contains the volume of each point and the numbers of the point, its body and its
    /// material.
    pub fields: Vec<PointField>,
    /// Precision of floating-point numbers in VTU files; files of a failed step always have `double`.
    pub precision: Precision,
    /// Locations whose displacement is recorded in `history.csv`.
    pub probes: Vec<ProbeDeck>,
}

impl Default for OutputDeck {
    fn default() -> Self {
        let (fields, precision) = (PointField::by_default(), Precision::default());
        OutputDeck { every: 1, fields, precision, probes: Vec::new() }
    }
}

/// Records the mean displacement of the points of a body that are nearest to a location at the start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProbeDeck {
    /// Name, unique among the probes; the columns of `history.csv` are `name_ux`, `name_uy`, in space
    /// also `name_uz`.
    pub name: String,
    /// Name of the body.
    pub body: String,
    /// The location, [length].
    #[schemars(with = "Vector", extend("examples" = [[10, 9.5]]))]
    pub nearest: Vec<f64>,
    /// Number of points; further points that are as near as the last one, to within round-off, are included.
    #[serde(default = "one")]
    #[schemars(range(min = 1))]
    pub count: u32,
}
