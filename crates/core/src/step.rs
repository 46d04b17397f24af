//! A load step: its times, its initial data and its unknowns.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::basis::Connectivity;
use crate::model::{Dynamics, Model, Stabilisation, StabilisationMode};

/// A load step: the time it starts from and the time it reaches.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Step number, from 1.
    pub index: usize,
    /// Time of the state it starts from.
    pub start: f64,
    /// Time of the state it reaches.
    pub end: f64,
}

impl Step {
    /// Duration of the step, in the unit of time of the analysis.
    pub fn duration(&self) -> f64 {
        self.end - self.start
    }
}

/// A vector at each active node, with one entry per component.
pub type Nodal<const N: usize> = Vec<[f64; N]>;

/// The initial data of a load step, constant during the step.
#[derive(Debug, Clone, Copy)]
pub struct StepContext<'a, const D: usize> {
    /// The model.
    pub model: &'a Model<D>,
    /// Links of the converged points with the grid, which determine the active nodes.
    pub links: &'a Connectivity<D>,
    /// The step.
    pub step: Step,
    /// Load factor at the start of the step if it follows from equilibrium, [-].
    pub factor: f64,
    /// Weight of the trial stress if viscosity regularises the laws, [-]; 0 without viscosity.
    pub viscosity: f64,
    /// A change of the equations by which the cause of a failure is sought; its result is never committed.
    pub experiment: Option<Experiment>,
}

/// A change of the equations of a failed step: if the step converges with it, the cause of the failure lies in what was
/// changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Experiment {
    /// Materials respond elastically; laws that are not linear in the logarithmic strain respond as they are.
    ElasticMaterials,
    /// Contact points that carry force stick to the tools and transfer tension; all others stay open.
    FrozenContact,
    /// Each contact point keeps the largest shear that it has at the start of the step.
    FrozenFriction,
    /// Ghost stabilisation acts on all cells at the boundary of the material, and is ten times as stiff.
    StrongerStabilisation,
    /// The step is half as long.
    HalfStep,
}

impl<'a, const D: usize> StepContext<'a, D> {
    /// The first step, from time 0 to time 1.
    pub fn first(model: &'a Model<D>, links: &'a Connectivity<D>) -> Self {
        StepContext {
            model,
            links,
            step: Step { index: 1, start: 0.0, end: 1.0 },
            factor: 0.0,
            viscosity: 0.0,
            experiment: None,
        }
    }

    /// The motion with inertia in the step; `None` in statics.
    pub fn dynamics(&self) -> Option<Dynamics> {
        self.model.stepping.dynamics
    }

    /// Weight of the end of the step in its forces, [-]: 1 in statics.
    pub fn weight(&self) -> f64 {
        self.dynamics().map_or(1.0, |dynamics| dynamics.scheme.weight())
    }

    /// The time whose values loads have in the step: its end or, with inertia, the time that its mean forces stand for.
    pub fn load_time(&self) -> f64 {
        match self.dynamics() {
            None => self.step.end,
            Some(_) => self.step.start + self.weight() * self.step.duration(),
        }
    }

    /// The ghost stabilisation of the step.
    pub(crate) fn stabilisation(&self) -> Stabilisation {
        let usual = self.model.stabilisation;
        match self.experiment {
            Some(Experiment::StrongerStabilisation) => {
                Stabilisation { mode: StabilisationMode::On, parameter: 10.0 * usual.parameter, ..usual }
            }
            _ => usual,
        }
    }
}

/// The unknowns at which the terms of equilibrium are evaluated, with `N` components at each node: first the
/// displacement along each axis, then the components of further fields.
#[derive(Debug, Clone, Copy)]
pub struct At<'a, const N: usize> {
    /// Increments at the active nodes in the step; the displacement increments are Δd, [length].
    pub delta_d: &'a [[f64; N]],
    /// Load factor if it follows from equilibrium, [-].
    pub factor: f64,
    /// Increments of global unknowns in the step: of all terms, or only of one.
    pub globals: &'a [f64],
}

impl<'a, const N: usize> At<'a, N> {
    /// These increments at the nodes, without a load factor or global unknowns.
    pub fn new(delta_d: &'a [[f64; N]]) -> Self {
        At { delta_d, factor: 0.0, globals: &[] }
    }
}

/// The displacement part of nodal increments, i.e. their first `D` components, [length]; borrowed if these are all
/// components.
pub fn displacement<const D: usize, const N: usize>(increments: &[[f64; N]]) -> Cow<'_, [[f64; D]]> {
    if D == N {
        let (same, _) = increments.as_flattened().as_chunks::<D>();
        return Cow::Borrowed(same);
    }
    Cow::Owned(increments.iter().map(|all| std::array::from_fn(|d| all[d])).collect())
}
