//! What a step is made of beside its unknowns: external forces, constraints and the equations.

use crate::assembly::System;
use crate::basis::Connectivity;
use crate::dofs::DofMap;
use crate::model::{Control, Model};
use crate::points::Points;
use crate::stress::Mechanics;
use crate::terms::external_force::{ExternalForce, external_force, external_force_of_factor};

use super::control::{Condition, Path};
use super::error::SolveError;
use super::residual::Parts;
use crate::equilibrium::{Nodal, Step};

/// The external force of a step.
pub(super) struct Loading<const D: usize> {
    pub(super) f_ext: Nodal<D>,
    /// External force of the state the step starts from, on the nodes of this step.
    pub(super) f_ext_start: Nodal<D>,
    /// Resultant of each load at the end of the step, [force].
    pub(super) resultants: Vec<[f64; D]>,
    /// Force at load factor 1 where that factor is unknown, and the resultants that belong to it.
    pub(super) unit: Option<Nodal<D>>,
    unit_resultants: Vec<[f64; D]>,
}

impl<const D: usize> Loading<D> {
    fn new(
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        step: Step,
        path: &Path,
    ) -> Result<Self, SolveError> {
        let no_value = |error| SolveError::Load { step: step.index, error: Box::new(error) };
        if model.stepping.control != Control::Load {
            let ExternalForce { nodal: unit, resultants: unit_resultants } =
                external_force_of_factor(model, points, links, 1.0).map_err(no_value)?;
            let mut loading = Loading {
                f_ext: vec![[0.0; D]; unit.len()],
                f_ext_start: Vec::new(),
                resultants: unit_resultants.clone(),
                unit: Some(unit),
                unit_resultants,
            };
            loading.set_factor(path.factor);
            loading.f_ext_start = loading.f_ext.clone();
            return Ok(loading);
        }
        let load = |time| external_force(model, points, links, time).map_err(no_value); // (24), (25), (29)
        let ExternalForce { nodal: f_ext, resultants } = load(step.end)?;
        // At time 0 nothing is loaded yet, whatever the curves say.
        let f_ext_start =
            if step.start > 0.0 { load(step.start)?.nodal } else { vec![[0.0; D]; f_ext.len()] };
        Ok(Loading { f_ext, f_ext_start, resultants, unit: None, unit_resultants: Vec::new() })
    }

    /// The force at a load factor, where that is unknown.
    pub(super) fn set_factor(&mut self, factor: f64) {
        let Some(unit) = &self.unit else { return };
        for (force, unit) in self.f_ext.iter_mut().flatten().zip(unit.iter().flatten()) {
            *force = factor * unit;
        }
        self.resultants = self.unit_resultants.iter().map(|force| force.map(|f| factor * f)).collect();
    }
}

/// What is set up once per step.
pub(super) struct StepSystem<const D: usize> {
    pub(super) dofs: DofMap<D>,
    pub(super) system: System<D>,
    pub(super) loading: Loading<D>,
    /// What determines the load factor where that is unknown.
    pub(super) condition: Option<Condition<D>>,
    /// The connected parts of the bodies.
    pub(super) parts: Parts,
}

impl<const D: usize> StepSystem<D> {
    pub(super) fn new<M: Mechanics<D>>(
        model: &Model<D>,
        points: &Points<D>,
        links: &Connectivity<D>,
        step: Step,
        path: &Path,
    ) -> Result<Self, SolveError> {
        let dofs = DofMap::new(model, points, links, step.start, step.end)
            .map_err(|error| SolveError::Constraint { step: step.index, error })?;
        let system = System::new::<M>(model, points, links);
        // A ring resists its own motion outwards.
        let lowest = links.parts();
        let rigid = usize::from(M::REVOLVED)..D;
        if let Some((node, axis)) = dofs.unheld(&lowest, rigid) {
            let place = model.grid.node_position(links.active_nodes()[node] as usize);
            return Err(SolveError::Unheld { step: step.index, node: place.to_vec(), axis });
        }
        let loading = Loading::new(model, points, links, step, path)?;
        let condition = Condition::new(model, points, links, step, path);
        Ok(StepSystem { dofs, system, loading, condition, parts: Parts::new(&lowest) })
    }
}
