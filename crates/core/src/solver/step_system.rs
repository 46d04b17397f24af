//! The equations of one attempt at a load step: constraints, the sum of the terms, and the condition on the load
//! factor.

use crate::dofs::{ConstraintError, Constraints, DofMap, Fields};
use crate::linear::Nature;
use crate::model::Model;
use crate::points::Points;
use crate::step::StepContext;
use crate::terms::{Sum, Terms};

use super::collective::{agree, begin};
use super::error::SolveError;
use super::progress::Progress;
use super::residual::Parts;
use super::stepping::control::Condition;

/// The equations of one attempt, set up once.
pub(super) struct StepSystem<const D: usize, const N: usize = D> {
    pub(super) dofs: DofMap<N>,
    pub(super) sum: Sum<D, N>,
    /// The equation for the load factor, if the factor is one of the unknowns.
    pub(super) condition: Option<Condition<D, N>>,
    /// The connected parts of the bodies.
    pub(super) parts: Parts,
    /// The fields of the nodal unknowns.
    pub(super) fields: Fields,
}

impl<const D: usize, const N: usize> StepSystem<D, N> {
    /// Takes the terms of the run and begins the step with them. If this fails, the terms stay in the run.
    pub(super) fn new(
        context: &StepContext<D>,
        points: &Points<D>,
        progress: &Progress,
        fields: &Fields,
        terms: &mut Terms<D, N>,
    ) -> Result<Self, SolveError> {
        let StepContext { model, links, step, .. } = *context;
        let reduction = links.reduction();
        let dofs = constraints(context, points, fields, terms);
        let dofs =
            agree(reduction, dofs.map_err(|error| SolveError::Constraint { step: step.index, error }))?;
        // In a body of revolution, hoop stresses resist radial motion.
        let rigid = usize::from(model.revolved)..D;
        let joined = links.joined_parts();
        let may_be_held = terms.iter().any(|term| term.character(model).may_hold);
        let unheld = dofs.unheld(&joined, reduction, rigid);
        if let Some((part, axis)) = unheld.filter(|_| !may_be_held) {
            let place = model.grid.node_position(joined.lowest[part] as usize);
            return Err(SolveError::Unheld { step: step.index, node: place.to_vec(), axis });
        }
        begin(terms, context, points)?;
        Sum::follow_constraints(terms, &dofs);
        let condition = Condition::new(model, points, links, step, &progress.path, terms);
        let sum = Sum::new(std::mem::take(terms), context, &dofs);
        let parts = Parts::new(&joined, links.reduction(), fields.components());
        let parts = parts.with_bodies(points, links, model.bodies.len(), &progress.carried);
        Ok(StepSystem { dofs, sum, condition, parts, fields: fields.clone() })
    }

    /// What the pivots of the stiffness say about stability.
    pub(super) fn nature(&self, model: &Model<D>) -> Nature {
        match self.sum.has_potential(model) {
            _ if self.fields.have_multipliers() => Nature::SaddlePoint,
            true => Nature::Potential,
            false => Nature::NoPotential,
        }
    }

    /// Completes an evaluation: adds up the contributions of all ranks, and moves the forces on tied components to the
    /// components to which these are tied.
    pub(super) fn complete(&mut self) {
        let system = self.sum.system_mut();
        system.complete();
        system.condense(&self.dofs);
    }
}

/// The constraints of the model and of the terms.
fn constraints<const D: usize, const N: usize>(
    context: &StepContext<D>,
    points: &Points<D>,
    fields: &Fields,
    terms: &Terms<D, N>,
) -> Result<DofMap<N>, ConstraintError> {
    let StepContext { model, links, step, .. } = *context;
    let constraints = Constraints::from_model(model, points, links, [step.start, step.end])?;
    let mut constraints = constraints.with_fields(fields);
    for term in terms {
        term.constrain(context, points, &mut constraints).map_err(|error| error.in_term(term.name()))?;
    }
    constraints.into_map()
}
