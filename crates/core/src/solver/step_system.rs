//! What a step is made of beside its unknowns: the sum of its terms, the prescribed degrees of freedom, and the parts of the
//! bodies.

use crate::dofs::DofMap;
use crate::points::Points;
use crate::step::StepContext;
use crate::stress::Mechanics;
use crate::terms::{Sum, Terms};

use super::control::{Condition, Path};
use super::error::SolveError;
use super::residual::Parts;

/// What is set up once per step.
pub(super) struct StepSystem<const D: usize> {
    pub(super) dofs: DofMap<D>,
    pub(super) sum: Sum<D>,
    /// What determines the load factor where that is unknown.
    pub(super) condition: Option<Condition<D>>,
    /// The connected parts of the bodies.
    pub(super) parts: Parts,
}

impl<const D: usize> StepSystem<D> {
    /// Takes the terms of the run; where it fails, they stay.
    pub(super) fn new<M: Mechanics<D>>(
        context: &StepContext<D>,
        points: &Points<D>,
        path: &Path,
        terms: &mut Terms<D>,
    ) -> Result<Self, SolveError> {
        let StepContext { model, links, step, .. } = *context;
        let dofs = DofMap::new(model, points, links, step.start, step.end)
            .map_err(|error| SolveError::Constraint { step: step.index, error })?;
        // A ring resists its own motion outwards.
        let lowest = links.parts();
        let rigid = usize::from(M::REVOLVED)..D;
        let may_be_held = terms.iter().any(|term| term.may_hold());
        if let Some((node, axis)) = dofs.unheld(&lowest, rigid).filter(|_| !may_be_held) {
            let place = model.grid.node_position(links.active_nodes()[node] as usize);
            return Err(SolveError::Unheld { step: step.index, node: place.to_vec(), axis });
        }
        let sum = Sum::new(std::mem::take(terms), context, points).map_err(|(error, begun)| {
            *terms = begun;
            SolveError::Load { step: step.index, error }
        })?;
        let condition = Condition::new(model, points, links, step, path);
        Ok(StepSystem { dofs, sum, condition, parts: Parts::new(&lowest) })
    }
}
