//! The probable cause of a failed run: its kind, its location, and the circumstances on which remedies depend.
//!
//! Advice refers to the keys of the input and is therefore written in the crate that knows them.

pub(super) mod evidence;
pub(super) mod experiments;
mod kind;
pub(super) mod stiffness;

use serde::{Deserialize, Serialize};

use crate::material::MaterialError;
use crate::model::{Model, Newton, StabilisationMode, Stepping};
use crate::points::{Points, coordinates};
use crate::quality::oscillation;
use crate::stress::{CellStrain, PointError};

use super::attempt::FailedAttempt;
use super::error::{Obstacle, PointPlace, SolveError};
use evidence::{cut_to, emptiest_cell, points_that_flow};
pub use experiments::Finding;
pub use kind::Kind;

/// Filling ratio below which a cell is a small cut cell, [-].
const SMALL: f64 = 0.1;
/// Share of yielded points above which plastic flow is the cause, [-].
const FLOWS: f64 = 0.02;
/// Share of yielded points above which a point that inverts or leaves the grid is part of a mechanism, [-].
const MUCH: f64 = 0.2;
/// Share of yielded points above which collapse also makes pressures alternate, [-].
const COLLAPSE: f64 = 0.5;
/// Oscillation of pressures, relative to the deviatoric stress, above which cells count as locking although most points
/// have yielded, [-].
const OSCILLATES_IN_COLLAPSE: f64 = 5.0;
/// Oscillation of pressures, relative to the deviatoric stress, above which cells count as locking if fewer points have
/// yielded, [-].
const OSCILLATES: f64 = 1.0;
/// Displacements without strain at the points, relative to displacements with strain, above which there is an hourglass
/// mode, [-].
const HOURGLASS: f64 = 10.0;
/// Displacement of the nodes of a cut cell, relative to the displacement of the points, above which the nodes have run
/// away, [-].
const RUNS_AWAY: f64 = 100.0;
/// Mean number of points per cell below which bodies may yield at too small a load.
const FEW: f64 = 1.5;
/// Stiffness ratio of the stiffest to the softest material above which a sum of both stiffnesses retains at most
/// about four digits of the smaller one, [-].
const TOO_FAR_APART: f64 = 1e12;

/// The way in which a point or its domain was lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// The point left the grid.
    OffGrid,
    /// The motion tore the domain.
    Torn {
        /// True if torn domains would be replaced with damping switched on.
        is_replaceable: bool,
    },
    /// The domain update did not yield a valid domain.
    Collapsed,
}

/// The circumstances of a failure, beyond its kind, on which remedies depend.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Circumstances {
    /// True if small cut cells are stabilised.
    pub is_stabilised: bool,
    /// True if boundary conditions or tools have a prescribed motion, or if a prescribed displacement or arc length
    /// determines the load factor.
    pub is_driven: bool,
    /// True if no load on the bodies or the tools changes in the stage.
    #[serde(default, alias = "is_unloaded")]
    pub has_constant_loads: bool,
    /// True if there is a single material.
    pub has_one_material: bool,
    /// True if cells hold so few points on average that bodies may yield at too small a load.
    pub has_few_points: bool,
    /// True if most of the points have yielded.
    pub is_in_collapse: bool,
    /// True if a body uses the volume ratio of each point, [`CellStrain::Standard`].
    #[serde(default)]
    pub has_standard_dilatation: bool,
    /// Size of the step relative to a requested one, if the step has been cut, [-].
    #[serde(default)]
    pub cut_to: Option<f64>,
    /// True if a later stage reduces the strength.
    #[serde(default)]
    pub precedes_reduction: bool,
    /// Number of iterations that steps would need at the current rate of convergence, rounded up to a multiple of ten;
    /// `None` if residuals do not fall steadily.
    pub enough_iterations: Option<usize>,
    /// The way in which a point or its domain was lost.
    pub loss: Option<Loss>,
    /// The obstacle that no step size removes.
    pub obstacle: Option<Obstacle>,
}

/// The probable cause of a failed run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// The kind of the failure.
    pub kind: Kind,
    /// Number of the step that failed.
    pub step: usize,
    /// Time of the last converged step, [time].
    pub time: f64,
    /// Load factor of largest magnitude in equilibrium, [-]; `None` unless all loads and prescribed motions share one.
    pub largest_load_factor: Option<f64>,
    /// Name of the body concerned.
    pub body: Option<String>,
    /// Permanent number of the point concerned.
    pub point: Option<u32>,
    /// Number of the grid cell concerned.
    pub cell: Option<u32>,
    /// Position of the grid node concerned, [length].
    pub node: Option<Vec<f64>>,
    /// Filling ratio of the emptiest cell at the location of the failure, [-]; `None` unless that cell is the cause.
    pub filling: Option<f64>,
    /// Share of the points that have yielded, [-].
    pub flowing: f64,
    /// The reason why a law refuses a strain, if that is the cause.
    #[serde(default)]
    pub refusal: Option<String>,
    /// The outcomes of experiments with the failed step.
    #[serde(default)]
    pub experiments: Vec<Finding>,
    /// The circumstances on which remedies depend.
    #[serde(default)]
    pub circumstances: Circumstances,
}

impl std::fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Circumstances { is_driven, has_constant_loads, .. } = self.circumstances;
        match self.kind {
            Kind::PlasticCollapse if is_driven && has_constant_loads => {
                write!(f, "plastic collapse: the bodies flow under the prescribed motion")?;
            }
            kind => write!(f, "{}", kind.words())?,
        }
        match (self.kind, self.circumstances.cut_to) {
            (Kind::LargeSteps, None) => write!(f, "; smaller ones have not been tried")?,
            (Kind::LargeSteps, Some(size)) => write!(f, ", even at {size:.1e} times the requested size")?,
            _ => {}
        }
        if let Some(reason) = &self.refusal {
            write!(f, ": {reason}")?;
        }
        if let Some(node) = &self.node {
            write!(f, ", node {}", coordinates(node))?;
        }
        if let Some(cell) = self.cell {
            write!(f, ", cell {cell}")?;
        }
        if let Some(filling) = self.filling {
            write!(f, " with filling ratio {filling:.1e}")?;
        }
        if let Some(body) = &self.body {
            write!(f, ", body `{body}`")?;
        }
        if let Some(point) = self.point {
            write!(f, ", point {point}")?;
        }
        if self.flowing > 0.0 {
            let percent = 100.0 * self.flowing;
            let share = if percent < 1.0 { "less than 1".to_owned() } else { format!("{percent:.0}") };
            write!(f, ", {share} % of the points have yielded")?;
        }
        Ok(())
    }
}

impl Diagnosis {
    /// Diagnoses the attempt that ended a run. `lost_points` is the failure of an earlier attempt at the same
    /// step: with a larger step size, it met the tolerance but lost a point or a domain.
    pub(super) fn new<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        failed: &FailedAttempt<D>,
        lost_points: Option<&SolveError>,
        largest_load_factor: Option<f64>,
    ) -> Diagnosis {
        let (node, place) = named_place(&failed.error);
        let links = failed.iterate.as_ref().map(|iterate| &iterate.links);
        let at = node.clone().or_else(|| place.map(|place| place.position.clone()));
        let cell_at = |at: &Vec<f64>| emptiest_cell(model, points, links?, at);
        let filling = at.as_ref().and_then(cell_at).map(|(_, filling)| filling);
        let flowing =
            links.map_or(0.0, |_| points_that_flow(model, points) as f64 / points.len().max(1) as f64);
        let found = Found::new(model, points, failed, at.as_deref(), filling, flowing);
        let kind = kind_of(failed, &found);
        // An earlier attempt has converged, so lack of convergence is not the cause.
        let (kind, error) = match lost_points {
            Some(error) if kind.is_about_iterations() => (Kind::LostDomain, error),
            _ => (kind, &failed.error),
        };
        let (node, place) = named_place(error);
        let at = node.clone().or_else(|| place.map(|place| place.position.clone()));
        let around = at.as_ref().and_then(cell_at);
        let circumstances = Circumstances {
            is_stabilised: model.stabilisation.mode != StabilisationMode::Off,
            is_driven: model.is_driven(),
            has_constant_loads: model.keeps_its_loads(),
            has_one_material: model.materials.len() == 1,
            has_few_points: evidence::mean_points_per_cell(points) < FEW,
            is_in_collapse: flowing > COLLAPSE,
            has_standard_dilatation: has_standard_dilatation(model, points),
            cut_to: cut_to(&model.stepping, failed.step),
            precedes_reduction: model.reduces_strength_later(),
            enough_iterations: (found.missing)
                .map(|missing| (model.newton.max_iterations + missing).next_multiple_of(10)),
            loss: loss_of(error, &model.stepping),
            obstacle: error.obstacle(),
        };
        let is_cell = matches!(kind, Kind::SmallCutCell);
        let refusal = match error {
            SolveError::Point { error: PointError::Material(reason), .. } if kind == Kind::RefusedByLaw => {
                Some(reason.to_string())
            }
            _ => None,
        };
        Diagnosis {
            kind,
            step: failed.step.index,
            time: failed.step.start,
            largest_load_factor,
            body: place.map(|place| place.body.clone()),
            point: place.map(|place| place.point),
            cell: around.map(|(cell, _)| cell),
            filling: around.map(|(_, filling)| filling).filter(|_| is_cell),
            node,
            flowing,
            refusal,
            experiments: Vec::new(),
            circumstances,
        }
    }

    /// The diagnosis in the light of experiments.
    pub(super) fn after(self, experiments: Vec<Finding>) -> Diagnosis {
        let kind = experiments::judged(self.kind, &experiments);
        let filling = self.filling.filter(|_| kind == Kind::SmallCutCell);
        Diagnosis { kind, filling, experiments, ..self }
    }

    /// What experiments with the failed step have shown, as a sentence; `None` without experiments.
    pub fn evidence(&self) -> Option<String> {
        experiments::evidence(&self.experiments)
    }
}

/// True if a point uses its own volume ratio.
fn has_standard_dilatation<const D: usize>(model: &Model<D>, points: &Points<D>) -> bool {
    points.body.iter().any(|body| model.bodies[*body as usize].strain == CellStrain::Standard)
}

/// The loss of a point or its domain, if that is the error.
fn loss_of(error: &SolveError, stepping: &Stepping) -> Option<Loss> {
    match error {
        SolveError::OffGrid { .. } => Some(Loss::OffGrid),
        SolveError::Domain { .. } => {
            let with_damping = Stepping { damping: true, ..stepping.clone() };
            Some(Loss::Torn { is_replaceable: !stepping.damping && with_damping.may_damp() })
        }
        SolveError::Collapsed { .. } => Some(Loss::Collapsed),
        _ => None,
    }
}

/// The evidence at the location of the failure and in the state of the bodies.
struct Found {
    /// True if a cell at the location of the failure holds hardly any material.
    is_cut: bool,
    /// Displacement of the nodes of the cells at the location of the failure, relative to the displacement of the
    /// points, [-].
    runaway: f64,
    /// Share of the points that have yielded, [-].
    flowing: f64,
    /// Displacements without strain at the points, relative to displacements with strain, [-].
    hourglass: f64,
    /// True if the fullest cell at the location of the failure holds one point, and no part of the bodies can move as a
    /// rigid body.
    is_single: bool,
    /// True if no boundary condition holds some part of the bodies, so that only tools do.
    rests_on_tools: bool,
    /// True if the step is so small that smaller ones would not help.
    is_small_step: bool,
    /// True if the residual meets the tolerance, and only the update of points and domains failed.
    is_balanced: bool,
    /// Number of further iterations needed to meet the tolerance, if residuals fall steadily.
    missing: Option<usize>,
    /// True if pressures alternate in isochoric deformation.
    is_locked: bool,
    /// Ratio of the shear moduli of the stiffest and the softest material, [-].
    spread: f64,
}

impl Found {
    /// True if the nodes of a cut cell have run away. The full cells next to it then seem to have an hourglass mode,
    /// too.
    fn runs_away(&self) -> bool {
        self.is_cut && self.runaway > RUNS_AWAY.max(self.hourglass)
    }

    /// The circumstances of a failure at a place, given the filling ratio of the emptiest cell there, if known, and the
    /// share of the points that have yielded.
    fn new<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        failed: &FailedAttempt<D>,
        at: Option<&[f64]>,
        filling: Option<f64>,
        flowing: f64,
    ) -> Found {
        let iterate = failed.iterate.as_ref();
        let at_place = iterate.zip(at);
        let Newton { tolerance, max_iterations, .. } = model.newton;
        Found {
            spread: stiffness::spread(model),
            is_cut: filling.is_some_and(|filling| filling < SMALL),
            runaway: at_place.map_or(0.0, |(iterate, at)| evidence::runaway(model, iterate, at)),
            flowing,
            hourglass: iterate.map_or(0.0, |iterate| evidence::hourglass(model, points, iterate)),
            is_single: at_place.is_some_and(|(iterate, at)| {
                evidence::most_points(model, points, &iterate.links, at) == 1
                    && !evidence::can_move_freely(model, points, &iterate.links, failed.step)
            }),
            rests_on_tools: !model.tools.is_empty()
                && iterate.is_some_and(|iterate| {
                    evidence::can_move_freely(model, points, &iterate.links, failed.step)
                }),
            is_small_step: evidence::is_small_step(model, failed),
            is_balanced: failed.is_balanced(tolerance),
            missing: evidence::iterations_missing(&failed.residuals, tolerance, max_iterations),
            is_locked: evidence::is_isochoric(points)
                && iterate
                    .map_or(0.0, |iterate| oscillation(&points.converged.kirchhoff_stress, &iterate.links))
                    > if flowing > COLLAPSE { OSCILLATES_IN_COLLAPSE } else { OSCILLATES },
        }
    }
}

fn kind_of<const D: usize>(failed: &FailedAttempt<D>, found: &Found) -> Kind {
    let &Found { is_cut, flowing, is_small_step, .. } = found;
    let runs_away = found.runs_away();
    let is_hourglass = found.hourglass > HOURGLASS && !runs_away;
    let collapse = if is_small_step { Kind::PlasticCollapse } else { Kind::LargeSteps };
    match &failed.error {
        SolveError::Unheld { .. } => Kind::RigidBodyMode,
        SolveError::Singular { free, .. } if !free.is_empty() => Kind::FreeTool,
        SolveError::NotConverged { .. } | SolveError::Singular { .. } if found.spread > TOO_FAR_APART => {
            Kind::BadScaling
        }
        SolveError::Singular { .. } if found.rests_on_tools && flowing <= FLOWS && failed.step.index > 1 => {
            Kind::Sliding
        }
        SolveError::Singular { .. } if is_cut => Kind::SmallCutCell,
        SolveError::Singular { .. } if is_hourglass => Kind::Hourglass,
        SolveError::Singular { .. } if flowing > FLOWS => collapse,
        SolveError::Singular { .. } if failed.step.index > 1 && failed.indefinite => Kind::Instability,
        SolveError::Singular { .. } if found.is_single => Kind::Hourglass,
        SolveError::Singular { .. } => Kind::RigidBodyMode,
        SolveError::Point { .. } if is_hourglass => Kind::Hourglass,
        SolveError::OffGrid { .. } if is_hourglass && !found.is_balanced => Kind::Hourglass,
        SolveError::Point { error: PointError::Material(reason), .. }
            if *reason != MaterialError::NotFinite && !runs_away =>
        {
            Kind::RefusedByLaw
        }
        SolveError::Point { .. } if runs_away || is_cut && (is_small_step || flowing <= MUCH) => {
            Kind::SmallCutCell
        }
        SolveError::Point { .. } if flowing > MUCH => collapse,
        SolveError::Point { .. } if failed.indefinite && failed.step.index > 1 && flowing <= FLOWS => {
            Kind::Instability
        }
        SolveError::Point { .. } => Kind::ElementInversion,
        // The iterations have converged.
        SolveError::OffGrid { .. } if found.is_balanced => Kind::LostDomain,
        // Points leave the grid even in a small step.
        SolveError::OffGrid { .. } if flowing > MUCH && is_small_step => Kind::PlasticCollapse,
        SolveError::OffGrid { .. } | SolveError::Domain { .. } | SolveError::Collapsed { .. } => {
            Kind::LostDomain
        }
        SolveError::NoPath { .. } => Kind::LostPath,
        SolveError::RoundOff { .. } => Kind::BadScaling,
        SolveError::NotConverged { .. } | SolveError::Iterative { .. } => {
            kind_without_convergence(failed, found)
        }
        SolveError::Constraint { .. }
        | SolveError::Load { .. }
        | SolveError::Surface { .. }
        | SolveError::Contact { .. }
        | SolveError::OutOfMemory { .. }
        | SolveError::Interrupted { .. }
        | SolveError::Term { .. }
        | SolveError::OwnTerm { .. }
        | SolveError::Law { .. }
        | SolveError::InitialState { .. }
        | SolveError::OnRank(_)
        | SolveError::GridMotion { .. }
        | SolveError::Output(_) => Kind::Setting,
    }
}

/// The kind of a failure to converge: first the displacements are examined, then the residuals, and then, if steps are
/// small, the strength of the bodies.
fn kind_without_convergence<const D: usize>(failed: &FailedAttempt<D>, found: &Found) -> Kind {
    let flows = found.flowing > FLOWS;
    if found.runs_away() {
        Kind::SmallCutCell
    } else if found.hourglass > HOURGLASS {
        Kind::Hourglass
    } else if found.missing.is_some() {
        Kind::Creeping
    } else if !found.is_small_step && (flows || failed.indefinite) {
        Kind::LargeSteps
    } else if found.is_locked {
        Kind::Locking
    } else if flows {
        Kind::PlasticCollapse
    } else if failed.indefinite {
        Kind::Instability
    } else if found.rests_on_tools && found.is_small_step {
        Kind::Sliding
    } else if found.is_cut {
        Kind::SmallCutCell
    } else if found.is_small_step {
        Kind::Unknown
    } else {
        Kind::LargeSteps
    }
}

/// The node or the point that an error names.
fn named_place(error: &SolveError) -> (Option<Vec<f64>>, Option<&PointPlace>) {
    match error {
        SolveError::NotConverged { worst, .. }
        | SolveError::RoundOff { worst, .. }
        | SolveError::InitialState { worst, .. } => {
            (worst.as_ref().map(|worst| worst.position.clone()), None)
        }
        SolveError::Singular { node, .. } => (node.as_ref().map(|node| node.position.clone()), None),
        SolveError::Unheld { node, .. } => (Some(node.clone()), None),
        SolveError::Point { place, .. }
        | SolveError::OffGrid { place, .. }
        | SolveError::Domain { place, .. }
        | SolveError::Collapsed { place, .. } => (None, Some(place)),
        SolveError::Law { place, .. } => (None, place.as_ref()),
        _ => (None, None),
    }
}
