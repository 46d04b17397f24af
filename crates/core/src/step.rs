//! A load step: when it begins and ends, what it begins with, and the unknowns that it looks for.

use serde::{Deserialize, Serialize};

use crate::basis::Connectivity;
use crate::model::Model;

/// A load step: the time it starts from and the time it reaches.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// Number, from 1.
    pub index: usize,
    /// Time of the state it starts from.
    pub start: f64,
    /// Time of the state it reaches.
    pub end: f64,
}

/// A vector on the active nodes, one entry per axis.
pub type Nodal<const D: usize> = Vec<[f64; D]>;

/// What a load step begins with: it does not change during the step.
#[derive(Debug, Clone, Copy)]
pub struct StepContext<'a, const D: usize> {
    /// The model.
    pub model: &'a Model<D>,
    /// Links of the converged points with the grid; tells which nodes are active.
    pub links: &'a Connectivity<D>,
    /// The step.
    pub step: Step,
    /// Load factor of the state that the step starts from, where it follows from equilibrium, [-].
    pub factor: f64,
}

impl<'a, const D: usize> StepContext<'a, D> {
    /// The first step, from time 0 to time 1.
    pub fn first(model: &'a Model<D>, links: &'a Connectivity<D>) -> Self {
        StepContext { model, links, step: Step { index: 1, start: 0.0, end: 1.0 }, factor: 0.0 }
    }
}

/// The unknowns at which the terms of equilibrium are evaluated.
#[derive(Debug, Clone, Copy)]
pub struct At<'a, const D: usize> {
    /// Displacement increment Δd of the active nodes, [length].
    pub delta_d: &'a [[f64; D]],
    /// Load factor, where it follows from equilibrium, [-].
    pub factor: f64,
}
