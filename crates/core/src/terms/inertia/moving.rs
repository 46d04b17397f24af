//! What inertia keeps of a step.

use std::cell::OnceCell;

use crate::dofs::DofMap;
use crate::linear::Block;
use crate::model::{Dynamics, ForceOfInertia};
use crate::step::Nodal;
use crate::terms::ghost::Ghost;

use super::mass::Mass;

/// The data of a step.
pub(super) struct Moving<const D: usize, const N: usize> {
    pub(super) dynamics: Dynamics,
    pub(super) duration: f64,
    pub(super) force: ForceOfInertia,
    pub(super) dofs: DofMap<N>,
    /// Faces with ghost mass.
    pub(super) ghost: Ghost,
    /// The mass, once the system is laid out.
    pub(super) mass: Option<Mass>,
    /// Velocity and acceleration of the grid at the start of the step, [length/time], [length/time²].
    pub(super) start: [Nodal<N>; 2],
    /// The part of the force of inertia that is constant, on this rank, [force].
    pub(super) constant: Nodal<N>,
    /// Stiffness of the points at the start of the step times its weight, if it damps, [force/length].
    pub(super) stiffness: Vec<Block<N>>,
    /// Force of inertia on all points of this rank in the last evaluation, [force].
    pub(super) resultant: [f64; D],
    /// The motion at the end of the step, once it has been asked for since the last evaluation.
    pub(super) end: OnceCell<EndOfStep>,
    /// Displacement increment of the last evaluation, [length], and the energy that damping then dissipates.
    pub(super) last: Nodal<N>,
    pub(super) damped: f64,
}

/// The motion of the points at the end of a step.
pub(super) struct EndOfStep {
    pub(super) velocity: Vec<f64>,
    pub(super) acceleration: Vec<f64>,
    /// Kinetic energy of the points at the start and at the end of the step, [energy].
    pub(super) kinetic_before: f64,
    pub(super) kinetic: f64,
    /// What ghost mass, the velocity of the grid and the scheme take from it, [energy].
    pub(super) ghost_loss: f64,
    pub(super) pic_loss: f64,
    pub(super) algorithmic_loss: f64,
}
