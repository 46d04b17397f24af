//! What a run that could not go on probably suffers from: where, what kind, and what to try.

use serde::{Deserialize, Serialize};

use crate::basis::Connectivity;
use crate::model::Model;
use crate::points::{Points, coordinates};
use crate::stabilisation::{HeldMaterial, Where};
use crate::stepping::Control;

use super::error::PointPlace;
use super::{FailedAttempt, SolveError, Summary};

/// A cell whose weakest node carries less than this of its share of a full cell is a small cut cell.
const SMALL: f64 = 0.1;
/// Where more than this share of the points has yielded, plastic flow is what fails.
const FLOWS: f64 = 0.02;
/// Where more than this share has flowed, a point that turns inside out in a step however small is a part of a mechanism.
const MUCH: f64 = 0.2;
/// Pressures that vary within cells by more than this multiple of the deviatoric stress are those of locking.
const OSCILLATES: f64 = 1.0;

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
    /// A point turns inside out.
    ElementInversion,
    /// A point or its domain leaves the grid or loses its shape.
    LostDomain,
    /// The path of the displacements cannot be followed.
    LostPath,
    /// What the deck asks for cannot be done, whatever the size of the step.
    Setting,
    /// None of these is in sight: steps are too large, or loads and conditions contradict each other.
    Unknown,
}

impl Kind {
    /// What it is, in words.
    pub fn words(self) -> &'static str {
        match self {
            Kind::RigidBodyMode => "a rigid-body mode is free",
            Kind::SmallCutCell => "a cell that holds hardly any material",
            Kind::PlasticCollapse => {
                "plastic collapse: the load is probably beyond what the bodies can carry"
            }
            Kind::Instability => "instability: the stiffness is not positive definite, though nothing yields",
            Kind::Locking => "volumetric locking",
            Kind::ElementInversion => "a point turns inside out",
            Kind::LostDomain => "a point or its domain leaves the grid or loses its shape",
            Kind::LostPath => "the path cannot be followed",
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
                "the largest load factor in equilibrium is a lower bound of the limit load on this grid; prescribe \
                 displacements, or use `steps: {control: {type: arc-length}}`, to go beyond it"
            }
            Kind::Instability => {
                "follow the path with `steps: {control: {type: arc-length}}`, or prescribe displacements"
            }
            Kind::Locking => {
                "use a finer grid with fewer points per cell, or a law that is less incompressible"
            }
            Kind::ElementInversion => "use smaller steps (`steps: {count, smallest}`) or a coarser grid",
            Kind::LostDomain => "make the grid larger, or use another method or domain update",
            Kind::LostPath => {
                "use another number of steps, or prescribe what follows (`type: displacement` with another probe, or `arc-length`)"
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
    /// Of the attempt that ended a run.
    pub(super) fn new<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        failed: &FailedAttempt<D>,
        summary: &Summary,
    ) -> Diagnosis {
        let (node, place) = whereabouts(&failed.error);
        let links = failed.iterate.as_ref().map(|iterate| &iterate.links);
        let around = links.and_then(|links| {
            let at = node.clone().or_else(|| place.map(|place| place.position.clone()))?;
            emptiest_cell(model, points, links, &at)
        });
        let flowing = links.map_or(0.0, |_| share_that_flows(model, points));
        let kind = kind_of(failed, around, flowing, || oscillation(points, links));
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
            Kind::Setting => failed.error.help().unwrap_or(kind.advice()),
            _ => kind.advice(),
        };
        let is_cell = matches!(kind, Kind::SmallCutCell);
        Diagnosis {
            kind,
            step: failed.step.index,
            time: failed.step.start,
            largest_load_factor: summary.largest_load_factor,
            body: place.map(|place| place.body.clone()),
            point: place.map(|place| place.point),
            cell: around.map(|(cell, _)| cell),
            filling: around.map(|(_, filling)| filling).filter(|_| is_cell),
            node,
            flowing,
            advice: advice.to_owned(),
        }
    }
}

fn kind_of<const D: usize>(
    failed: &FailedAttempt<D>,
    around: Option<(u32, f64)>,
    flowing: f64,
    oscillation: impl Fn() -> f64,
) -> Kind {
    let small = around.is_some_and(|(_, filling)| filling < SMALL);
    match &failed.error {
        SolveError::Unheld { .. } => Kind::RigidBodyMode,
        SolveError::Singular { .. } if small => Kind::SmallCutCell,
        SolveError::Singular { .. } if flowing > FLOWS => Kind::PlasticCollapse,
        SolveError::Singular { .. } if failed.step.index > 1 && failed.indefinite => Kind::Instability,
        SolveError::Singular { .. } => Kind::RigidBodyMode,
        SolveError::Point { .. } if small => Kind::SmallCutCell,
        SolveError::Point { .. } if flowing > MUCH => Kind::PlasticCollapse,
        SolveError::Point { .. } => Kind::ElementInversion,
        // However small the step is, the points fly off.
        SolveError::OffGrid { .. } if flowing > MUCH => Kind::PlasticCollapse,
        SolveError::OffGrid { .. } | SolveError::Domain { .. } | SolveError::Collapsed { .. } => {
            Kind::LostDomain
        }
        SolveError::NoPath { .. } => Kind::LostPath,
        SolveError::NotConverged { .. } | SolveError::Iterative { .. } => {
            if flowing > FLOWS && oscillation() > OSCILLATES {
                Kind::Locking
            } else if flowing > FLOWS {
                Kind::PlasticCollapse
            } else if failed.indefinite {
                Kind::Instability
            } else if small {
                Kind::SmallCutCell
            } else if oscillation() > OSCILLATES {
                Kind::Locking
            } else {
                Kind::Unknown
            }
        }
        SolveError::Constraint { .. }
        | SolveError::Load { .. }
        | SolveError::OutOfMemory { .. }
        | SolveError::Interrupted { .. }
        | SolveError::Output(_) => Kind::Setting,
    }
}

/// The node or the point that an error names.
fn whereabouts(error: &SolveError) -> (Option<Vec<f64>>, Option<&PointPlace>) {
    match error {
        SolveError::NotConverged { worst, .. } => (worst.as_ref().map(|(node, _)| node.clone()), None),
        SolveError::Singular { node, .. } => (node.as_ref().map(|(node, _)| node.clone()), None),
        SolveError::Unheld { node, .. } => (Some(node.clone()), None),
        SolveError::Point { place, .. }
        | SolveError::OffGrid { place, .. }
        | SolveError::Domain { place, .. }
        | SolveError::Collapsed { place, .. } => (None, Some(place)),
        _ => (None, None),
    }
}

/// The active cell with the least material among those that a place lies in or at, and its filling ratio.
fn emptiest_cell<const D: usize>(
    model: &Model<D>,
    points: &Points<D>,
    links: &Connectivity<D>,
    place: &[f64],
) -> Option<(u32, f64)> {
    let grid = model.grid.as_ref();
    let held = HeldMaterial::new(model, points, links);
    let position: [f64; D] = std::array::from_fn(|d| place.get(d).copied().unwrap_or(0.0));
    let home = grid.nearest_cell(&position);
    let reach = 1e-6 * grid.size(home as usize);
    let touches = |cell: u32| {
        cell == home
            || grid.corners(cell as usize).nodes().iter().any(|n| {
                let node = grid.node_position(*n as usize);
                (0..D).all(|d| (node[d] - position[d]).abs() <= reach)
            })
    };
    let fillings = links.active_cells().iter().filter(|cell| touches(**cell)).map(|cell| {
        let filling = held.filling(model, links, *cell);
        (*cell, filling)
    });
    fillings.min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Share of the points whose history has changed since the start of the analysis, or does in the step in hand.
fn share_that_flows<const D: usize>(model: &Model<D>, points: &Points<D>) -> f64 {
    let n = points.history_len;
    let flows = |p: &usize| {
        let of = |history: &[f64]| history[p * n..][..n].to_vec();
        let fields = model.law(points, *p).state_fields();
        let begun = |history: &[f64]| fields.iter().zip(of(history)).any(|(field, now)| field.initial != now);
        begun(&points.trial.history) || begun(&points.converged.history)
    };
    (0..points.len()).filter(flows).count() as f64 / points.len().max(1) as f64
}

/// How far the mean stresses of the points of one cell differ, relative to the deviatoric stresses, in the root mean square
/// over all cells.
fn oscillation<const D: usize>(points: &Points<D>, links: Option<&Connectivity<D>>) -> f64 {
    let Some(links) = links else { return 0.0 };
    let (mut spread, mut deviator) = (0.0, 0.0);
    for group in 0..links.n_groups() {
        let of_group = links.points_of(group);
        let n = of_group.len() as f64;
        let mean = |p: usize| points.converged.kirchhoff_stress[p].trace() / 3.0;
        let middle: f64 = of_group.clone().map(mean).sum::<f64>() / n;
        for p in of_group {
            let stress = &points.converged.kirchhoff_stress[p];
            spread += (mean(p) - middle).powi(2);
            deviator += stress.dot(stress) - 3.0 * mean(p).powi(2);
        }
    }
    if deviator > 0.0 { (spread / deviator).sqrt() } else { 0.0 }
}
