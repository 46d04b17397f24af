//! What a run that could not go on probably suffers from: where, what kind, and what to try.

use serde::{Deserialize, Serialize};

use crate::model::{Control, Model, Newton, Stepping, Where};
use crate::points::{Points, coordinates};
use crate::quality::oscillation;

use super::attempt::FailedAttempt;
use super::error::{PointPlace, SolveError, stiffness_spread};
use super::evidence::{self, emptiest_cell, share_that_flows};

/// A cell whose weakest node carries less than this of its share of a full cell is a small cut cell.
const SMALL: f64 = 0.1;
/// Where more than this share of the points has yielded, plastic flow is what fails.
const FLOWS: f64 = 0.02;
/// Where more than this share has flowed, a point that turns inside out in a step however small is a part of a mechanism.
const MUCH: f64 = 0.2;
/// Where more than this share has flowed, pressures alternate in collapse, too …
const MOST: f64 = 0.5;
/// … and only those that vary by more than this multiple are those of locking.
const OSCILLATES_IN_COLLAPSE: f64 = 5.0;
/// Displacements that points do not notice, larger than this multiple of those that they do, are those of an hourglass mode.
const HOURGLASS: f64 = 10.0;
/// Nodes of a cut cell that move farther than points by this factor have run away.
const RUNS_AWAY: f64 = 100.0;
/// Pressures that vary within cells by more than this multiple of the deviatoric stress are those of locking.
const OSCILLATES: f64 = 1.0;
/// Bodies with fewer points than this per cell on the average may yield before their load.
const FEW: f64 = 1.5;
/// Where the stiffest material is that much stiffer than the softest, a sum of both keeps hardly a digit of the softer one.
const TOO_FAR_APART: f64 = 1e12;

/// What kind of failure it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// A part of the bodies can move or turn freely.
    RigidBodyMode,
    /// A cell that holds hardly any material decides.
    SmallCutCell,
    /// The load is beyond what the bodies can carry.
    PlasticCollapse,
    /// The bodies buckle or snap through without yielding.
    Instability,
    /// Volume-preserving deformation that the grid cannot represent.
    Locking,
    /// Nodes alternate in a way that the points do not resist.
    Hourglass,
    /// Residuals fall steadily; more iterations would meet the tolerance.
    Creeping,
    /// Smaller steps have not been tried.
    LargeSteps,
    /// A point turns inside out.
    ElementInversion,
    /// A point or its domain leaves the grid or loses its shape.
    LostDomain,
    /// The path of the displacements cannot be followed.
    LostPath,
    /// Stiffnesses so far apart, or so far above the loads, that round-off hides the forces.
    BadScaling,
    /// What the deck asks for cannot be done, whatever the size of the step.
    Setting,
    /// None of these is in sight; perhaps loads and conditions contradict each other.
    Unknown,
}

impl Kind {
    /// Whether it says why iterations do not come to an end.
    fn is_about_iterations(self) -> bool {
        matches!(
            self,
            Kind::PlasticCollapse | Kind::Instability | Kind::LargeSteps | Kind::Creeping | Kind::Unknown
        )
    }

    /// What it is, in words.
    pub fn words(self) -> &'static str {
        match self {
            Kind::RigidBodyMode => "a rigid-body mode is free",
            Kind::SmallCutCell => "a cell that holds hardly any material",
            Kind::PlasticCollapse => {
                "plastic collapse: the load is probably beyond what the bodies can carry"
            }
            Kind::Instability => "instability: the stiffness is not positive definite, though nothing yields",
            Kind::Locking => "volumetric locking: pressures alternate while volumes hardly change",
            Kind::Hourglass => "hourglass mode: nodes move to and fro in a way that too few points resist",
            Kind::Creeping => "the residual falls steadily, and the iterations end too soon",
            Kind::LargeSteps => "the steps are too large; whether smaller ones would do has not been tried",
            Kind::ElementInversion => "a point turns inside out",
            Kind::LostDomain => "a point or its domain leaves the grid or loses its shape",
            Kind::LostPath => "the path cannot be followed",
            Kind::BadScaling => "a badly scaled stiffness: its round-off is larger than the forces",
            Kind::Setting => "what is asked for cannot be done",
            Kind::Unknown => "none of the known causes is in sight",
        }
    }

    /// What to try.
    pub fn advice(self) -> &'static str {
        match self {
            Kind::RigidBodyMode => "hold every part of the bodies along every axis and against turning",
            Kind::SmallCutCell => {
                "stabilise such cells, `analysis: {stabilisation: {mode: auto}}`; or use more points per cell, or another grid"
            }
            Kind::PlasticCollapse => {
                "the bodies yield at about the largest load factor in equilibrium; see how it changes with more points per \
                 cell and a finer grid. To go on beyond it, prescribe displacements or use \
                 `steps: {control: {type: arc-length}}`"
            }
            Kind::Instability => {
                "follow the path with `steps: {control: {type: arc-length}}`, or prescribe displacements"
            }
            Kind::Locking => {
                "use a finer grid with fewer points per cell, or a law that is less incompressible"
            }
            Kind::Hourglass => {
                "use more points per cell (4 in the plane, 8 in space), or `analysis: {stabilisation: {mode: on}}`"
            }
            Kind::Creeping => "allow more iterations, `solver: {max_iterations}`, or use smaller steps",
            Kind::LargeSteps => {
                "use smaller steps: a larger `steps: {count}`, and a small `smallest` such as 1e-3, so that steps that fail \
                 are cut"
            }
            Kind::ElementInversion => "use smaller steps (`steps: {count, smallest}`) or a coarser grid",
            Kind::LostDomain => "make the grid larger, or use another method or domain update",
            Kind::LostPath => {
                "use another number of steps, or prescribe what follows (`type: displacement` with another probe, or `arc-length`)"
            }
            Kind::BadScaling => {
                "give the stiffest material a modulus that is at most about 1e6 times that of the softest, or move a part that is to \
                 be rigid by a boundary condition"
            }
            Kind::Setting => "see the message",
            Kind::Unknown => {
                "use smaller steps (`steps: {count, smallest}`), and see that the loads and conditions fit together"
            }
        }
    }
}

/// Why a run could not go on, as far as it can be told.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// What kind of failure it is.
    pub kind: Kind,
    /// Number of the step that could not be solved.
    pub step: usize,
    /// Time up to which there is equilibrium, [time].
    pub time: f64,
    /// Largest load factor in equilibrium, where there is one for all loads and prescribed motions, [-].
    pub largest_load_factor: Option<f64>,
    /// Name of the body that is concerned.
    pub body: Option<String>,
    /// Permanent number of the point.
    pub point: Option<u32>,
    /// Number of the grid cell.
    pub cell: Option<u32>,
    /// Position of the grid node, [length].
    pub node: Option<Vec<f64>>,
    /// Filling ratio of the emptiest cell around that place, [-].
    pub filling: Option<f64>,
    /// Share of the points that have yielded, [-].
    pub flowing: f64,
    /// What to try.
    pub advice: String,
}

impl std::fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.kind.words())?;
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
            write!(f, ", {:.0} % of the points have yielded", 100.0 * self.flowing)?;
        }
        Ok(())
    }
}

impl Diagnosis {
    /// Diagnoses the attempt that ended a run. `lost_points` says why a larger attempt at the same step failed although it met the
    /// tolerance.
    pub(super) fn new<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        failed: &FailedAttempt<D>,
        lost_points: Option<&SolveError>,
        largest_load_factor: Option<f64>,
    ) -> Diagnosis {
        let (node, place) = whereabouts(&failed.error);
        let links = failed.iterate.as_ref().map(|iterate| &iterate.links);
        let at = node.clone().or_else(|| place.map(|place| place.position.clone()));
        let cell_at = |at: &Vec<f64>| emptiest_cell(model, points, links?, at);
        let around = at.as_ref().and_then(cell_at);
        let flowing = links.map_or(0.0, |_| share_that_flows(model, points));
        let found = Found::new(model, points, failed, at.as_deref(), (around, flowing));
        let kind = kind_of(failed, &found);
        // What keeps iterations from their end is no matter where an attempt has come to it.
        let (kind, error) = match lost_points {
            Some(error) if kind.is_about_iterations() => (Kind::LostDomain, error),
            _ => (kind, &failed.error),
        };
        let (node, place) = whereabouts(error);
        let at = node.clone().or_else(|| place.map(|place| place.position.clone()));
        let around = at.as_ref().and_then(cell_at);
        let is_driven = model.stepping.control != Control::Load
            || model.boundary_conditions.iter().any(|condition| condition.moves());
        let advice = match kind {
            Kind::SmallCutCell if model.stabilisation.mode != Where::Off => {
                "use a larger `stabilisation: {parameter}`, more points per cell, or another grid"
            }
            Kind::PlasticCollapse | Kind::Instability if is_driven => {
                "use smaller steps (`steps: {count, smallest}`) or a coarser grid; nothing but what is prescribed keeps the \
                 bodies from flowing"
            }
            Kind::BadScaling if model.materials.len() == 1 => {
                "see that units, loads and the size of cells fit together, and that Poisson's ratio is not next to 0.5 or -1"
            }
            Kind::LostDomain
                if matches!(error, SolveError::Domain { .. })
                    && !model.stepping.damping
                    && Stepping { damping: true, ..model.stepping.clone() }.may_damp() =>
            {
                "leave `steps: {damping}` out, so that torn domains are replaced; or use more points per cell, or `method: gimp`"
            }
            Kind::LostDomain if matches!(error, SolveError::Domain { .. } | SolveError::Collapsed { .. }) => {
                "use more points per cell, smaller steps (`steps: {count, smallest}`), or `method: gimp`"
            }
            Kind::Setting => failed.error.help().unwrap_or(kind.advice()),
            _ => kind.advice(),
        };
        let advice = match found.missing {
            Some(missing) if kind == Kind::Creeping => {
                let enough = (model.newton.max_iterations + missing).next_multiple_of(10);
                format!("allow more iterations, `solver: {{max_iterations: {enough}}}`, or use smaller steps")
            }
            _ if kind == Kind::PlasticCollapse && evidence::mean_points_per_cell(points) < FEW => format!(
                "use more points per cell (4 in the plane, 8 in space), since with one a body may collapse early; {advice}"
            ),
            _ if matches!(kind, Kind::Hourglass | Kind::Locking) && flowing > MOST => format!(
                "{advice}; most points have yielded, so that the load may also be beyond what the bodies can carry"
            ),
            _ => advice.to_owned(),
        };
        let is_cell = matches!(kind, Kind::SmallCutCell);
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
            advice,
        }
    }
}

/// What is known about the place and the state that a run stopped at.
struct Found {
    /// Whether a cell there holds hardly any material.
    is_cut: bool,
    /// How much farther its nodes move than points do, [-].
    runaway: f64,
    /// Share of the points that have yielded, [-].
    flowing: f64,
    /// Displacements that the points do not notice, relative to those that they do, [-].
    hourglass: f64,
    /// Whether cells there hold a single point at most, and no part of the bodies can move as a rigid body.
    is_single: bool,
    /// Whether smaller steps would not matter.
    is_small_step: bool,
    /// Whether the residual meets the tolerance, and what comes after it failed.
    is_balanced: bool,
    /// Iterations that are missing where residuals fall steadily.
    missing: Option<usize>,
    /// Whether pressures alternate in isochoric deformation.
    is_locked: bool,
    /// How many times the stiffest material is as stiff as the softest, [-].
    spread: f64,
}

impl Found {
    /// Whether the nodes of a cut cell have run away. They leave a trace in the full cells beside them, too.
    fn runs_away(&self) -> bool {
        self.is_cut && self.runaway > RUNS_AWAY.max(self.hourglass)
    }

    fn new<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        failed: &FailedAttempt<D>,
        at: Option<&[f64]>,
        (around, flowing): (Option<(u32, f64)>, f64),
    ) -> Found {
        let iterate = failed.iterate.as_ref();
        let at_place = iterate.zip(at);
        let Newton { tolerance, max_iterations, .. } = model.newton;
        Found {
            spread: stiffness_spread(model),
            is_cut: around.is_some_and(|(_, filling)| filling < SMALL),
            runaway: at_place.map_or(0.0, |(iterate, at)| evidence::runaway(model, iterate, at)),
            flowing,
            hourglass: iterate.map_or(0.0, |iterate| evidence::hourglass(model, points, iterate)),
            is_single: at_place.is_some_and(|(iterate, at)| {
                evidence::most_points(model, points, &iterate.links, at) == 1
                    && !evidence::can_move_freely(model, points, &iterate.links, failed.step)
            }),
            is_small_step: evidence::is_small_step(model, failed),
            is_balanced: failed.is_balanced(tolerance),
            missing: evidence::iterations_missing(&failed.residuals, tolerance, max_iterations),
            is_locked: evidence::is_isochoric(points)
                && iterate
                    .map_or(0.0, |iterate| oscillation(&points.converged.kirchhoff_stress, &iterate.links))
                    > if flowing > MOST { OSCILLATES_IN_COLLAPSE } else { OSCILLATES },
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
        SolveError::NotConverged { .. } | SolveError::Singular { .. } if found.spread > TOO_FAR_APART => {
            Kind::BadScaling
        }
        SolveError::Singular { .. } if is_cut => Kind::SmallCutCell,
        SolveError::Singular { .. } if is_hourglass => Kind::Hourglass,
        SolveError::Singular { .. } if flowing > FLOWS => collapse,
        SolveError::Singular { .. } if failed.step.index > 1 && failed.indefinite => Kind::Instability,
        SolveError::Singular { .. } if found.is_single => Kind::Hourglass,
        SolveError::Singular { .. } => Kind::RigidBodyMode,
        SolveError::Point { .. } if is_hourglass => Kind::Hourglass,
        SolveError::OffGrid { .. } if is_hourglass && !found.is_balanced => Kind::Hourglass,
        SolveError::Point { .. } if runs_away || is_cut && (is_small_step || flowing <= MUCH) => {
            Kind::SmallCutCell
        }
        SolveError::Point { .. } if flowing > MUCH => collapse,
        SolveError::Point { .. } if failed.indefinite && failed.step.index > 1 && flowing <= FLOWS => {
            Kind::Instability
        }
        SolveError::Point { .. } => Kind::ElementInversion,
        // In equilibrium, and yet beyond the edge.
        SolveError::OffGrid { .. } if found.is_balanced => Kind::LostDomain,
        // However small the step is, the points fly off.
        SolveError::OffGrid { .. } if flowing > MUCH && is_small_step => Kind::PlasticCollapse,
        SolveError::OffGrid { .. } | SolveError::Domain { .. } | SolveError::Collapsed { .. } => {
            Kind::LostDomain
        }
        SolveError::NoPath { .. } => Kind::LostPath,
        SolveError::RoundOff { .. } => Kind::BadScaling,
        SolveError::NotConverged { .. } | SolveError::Iterative { .. } => without_end(failed, found),
        SolveError::Constraint { .. }
        | SolveError::Load { .. }
        | SolveError::OutOfMemory { .. }
        | SolveError::Interrupted { .. }
        | SolveError::Term { .. }
        | SolveError::Output(_) => Kind::Setting,
    }
}

/// What keeps iterations from an end: first what shows in the displacements, then what shows in the residuals, and only where
/// steps are small what the bodies cannot carry.
fn without_end<const D: usize>(failed: &FailedAttempt<D>, found: &Found) -> Kind {
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
    } else if found.is_cut {
        Kind::SmallCutCell
    } else if found.is_small_step {
        Kind::Unknown
    } else {
        Kind::LargeSteps
    }
}

/// The node or the point that an error names.
fn whereabouts(error: &SolveError) -> (Option<Vec<f64>>, Option<&PointPlace>) {
    match error {
        SolveError::NotConverged { worst, .. } | SolveError::RoundOff { worst, .. } => {
            (worst.as_ref().map(|(node, _)| node.clone()), None)
        }
        SolveError::Singular { node, .. } => (node.as_ref().map(|(node, _)| node.clone()), None),
        SolveError::Unheld { node, .. } => (Some(node.clone()), None),
        SolveError::Point { place, .. }
        | SolveError::OffGrid { place, .. }
        | SolveError::Domain { place, .. }
        | SolveError::Collapsed { place, .. } => (None, Some(place)),
        _ => (None, None),
    }
}
