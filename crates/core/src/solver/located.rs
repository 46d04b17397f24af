//! Builds errors that name the point, the node or the law at fault.

use crate::basis::{Connectivity, SupportError, SupportFailure};
use crate::domain::Collapsed;
use crate::equilibrium::UnbalancedNode;
use crate::linear::LinearError;
use crate::model::Model;
use crate::points::{Points, State};
use crate::step::{Step, StepContext};
use crate::terms::{EvaluateError, LawFailure, PointFailure};

use super::diagnosis::stiffness::stiffnesses;
use super::error::{PointPlace, SolveError, UndeterminedNode};
use super::step_system::StepSystem;

impl SolveError {
    pub(super) fn unsupported<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        failure: SupportFailure,
        step: Step,
    ) -> Self {
        let Some(&position) =
            points.converged.position.get(failure.point).filter(|_| failure.error != SupportError::OnRank)
        else {
            return SolveError::elsewhere();
        };
        match failure.error {
            SupportError::OffGrid => Self::off_grid(model, points, failure.point, position, step),
            error => Self::domain(model, points, failure.point, position, step, error),
        }
    }

    pub(super) fn domain<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        p: usize,
        position: [f64; D],
        step: Step,
        error: SupportError,
    ) -> Self {
        SolveError::Domain { step: step.index, place: place(model, points, p, position), error }
    }

    pub(super) fn off_grid<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        p: usize,
        position: [f64; D],
        step: Step,
    ) -> Self {
        SolveError::OffGrid { step: step.index, place: place(model, points, p, position) }
    }

    pub(super) fn collapsed<const D: usize>(
        model: &Model<D>,
        points: &Points<D>,
        p: usize,
        position: [f64; D],
        step: Step,
        error: Collapsed,
    ) -> Self {
        SolveError::Collapsed { step: step.index, place: place(model, points, p, position), error }
    }

    pub(super) fn not_converged<const D: usize>(
        model: &Model<D>,
        links: &Connectivity<D>,
        step: Step,
        residuals: Vec<f64>,
        out_of_balance: &[[f64; D]],
    ) -> Self {
        SolveError::NotConverged { step: step.index, residuals, worst: worst(model, links, out_of_balance) }
    }

    pub(super) fn round_off<const D: usize>(
        model: &Model<D>,
        links: &Connectivity<D>,
        step: Step,
        residuals: Vec<f64>,
        out_of_balance: &[[f64; D]],
    ) -> Self {
        let worst = worst(model, links, out_of_balance);
        SolveError::RoundOff { step: step.index, residuals, worst, materials: stiffnesses(model) }
    }

    pub(super) fn linear<const D: usize, const N: usize>(
        error: LinearError,
        context: &StepContext<D>,
        system: &StepSystem<D, N>,
    ) -> Self {
        let StepContext { model, links, step: Step { index: step, .. }, .. } = *context;
        match error {
            LinearError::OutOfMemory { needed } => SolveError::OutOfMemory { step, needed },
            LinearError::Turned
            | LinearError::Unstructured
            | LinearError::Unsymmetric
            | LinearError::NotConverged { .. }
            | LinearError::Library(_) => SolveError::Iterative { step, error },
            LinearError::Singular { unknown } => {
                let node = unknown.and_then(|u| system.dofs.place_of(u)).map(|(node, component)| {
                    let place = model.grid.node_position(links.active_nodes()[node] as usize);
                    UndeterminedNode { position: place.to_vec(), unknown: system.fields.unknown(component) }
                });
                SolveError::Singular { step, free: Vec::new(), node }
            }
            LinearError::Undetermined => {
                let motions = system.sum.motions(model).into_iter().filter(|motion| motion.is_free);
                let mut free: Vec<String> = motions.map(|motion| motion.name).collect();
                free.dedup();
                SolveError::Singular { step, free, node: None }
            }
        }
    }
}

/// The node with the largest out-of-balance force.
pub(super) fn worst<const D: usize>(
    model: &Model<D>,
    links: &Connectivity<D>,
    out_of_balance: &[[f64; D]],
) -> Option<UnbalancedNode> {
    let size = |f: &[f64]| f.iter().map(|x| x * x).sum::<f64>();
    let own = (0..out_of_balance.len())
        .max_by(|&a, &b| size(&out_of_balance[a]).total_cmp(&size(&out_of_balance[b])))
        .map(|n| {
            let place = model.grid.node_position(links.active_nodes()[n] as usize);
            UnbalancedNode { position: place.to_vec(), force: out_of_balance[n].to_vec() }
        });
    let all = links.reduction().gather_all(own).into_iter().flatten();
    all.max_by(|a, b| size(&a.force).total_cmp(&size(&b.force)))
}

fn place<const D: usize>(model: &Model<D>, points: &Points<D>, p: usize, position: [f64; D]) -> PointPlace {
    PointPlace {
        body: model.bodies[points.body[p] as usize].name.clone(),
        point: points.id[p],
        position: position.to_vec(),
    }
}

/// Checks that the laws have a finite energy in a state of the points, given the sum of their stored energy and plastic
/// work over all points, [energy].
///
/// # Errors
/// [`SolveError::Law`] with the first point at fault, if one is found.
pub(super) fn with_energy<const D: usize>(
    law_energy: f64,
    model: &Model<D>,
    points: &Points<D>,
    state: &State<D>,
    step: Step,
) -> Result<(), SolveError> {
    if law_energy.is_finite() {
        return Ok(());
    }
    let is_at_fault = |p: &usize| {
        let law = model.law(points, *p);
        let history = &state.history[p * points.history_len..][..law.state_fields().len()];
        !(law.energy(&state.elastic_strain[*p], history) + law.plastic_work(history)).is_finite()
    };
    let point = (0..points.len()).find(is_at_fault);
    let material = match point {
        Some(p) => model.bodies[points.body[p] as usize].material,
        // The failure of a law that is evaluated in batches need not recur.
        None => match model.materials.iter().position(|material| material.law.batch().is_some()) {
            Some(material) => material,
            None => return Ok(()),
        },
    };
    Err(SolveError::Law {
        step: step.index,
        material: model.materials[material].name.clone(),
        place: point.map(|p| place(model, points, p, points.converged.position[p])),
        message: "its stored energy or its plastic work is not finite".to_owned(),
    })
}

/// The error for a failure during assembly, with the point or the law at fault.
pub(super) fn locate_failure<const D: usize>(
    failure: EvaluateError,
    model: &Model<D>,
    points: &Points<D>,
    step: Step,
    iteration: usize,
    residuals: &[f64],
) -> SolveError {
    let step = step.index;
    let place = |p: usize| place(model, points, p, points.converged.position[p]);
    match failure {
        EvaluateError::Point(PointFailure { point, error }) => {
            SolveError::Point { step, iteration, place: place(point), error, residuals: residuals.to_vec() }
        }
        EvaluateError::Law(failure) => {
            let LawFailure { material, point, message } = *failure;
            let material = model.materials[material].name.clone();
            SolveError::Law { step, material, place: point.map(place), message }
        }
        EvaluateError::Contact(error) => SolveError::Contact { step, error },
        EvaluateError::Constraint(error) => SolveError::Constraint { step, error: *error },
        EvaluateError::Term(failure) => SolveError::OwnTerm { step, failure },
        // Replaced by the error of the other rank when all ranks agree on the outcome of the attempt.
        EvaluateError::OnRank { .. } => SolveError::elsewhere(),
    }
}
