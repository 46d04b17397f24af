//! Advice on errors that end a run.

use mpm_core::solver::{NoPath, Obstacle, SolveError};
use mpm_core::terms::ContactError;

/// The remedy if steps are too large.
const SMALLER_STEPS: &str = "use smaller steps (`steps: {count, smallest}`)";

/// Advice on an error; `None` if there is none to give.
pub fn on_error(error: &SolveError) -> Option<&'static str> {
    match error {
        SolveError::NotConverged { .. } => {
            Some("use smaller steps (`steps: {count, smallest}`), or check loads and boundary conditions")
        }
        SolveError::RoundOff { .. } => Some(
            "give the stiffest material a modulus that is at most about 1e6 times that of the softest; to model a rigid \
             part, prescribe its motion with a boundary condition instead",
        ),
        SolveError::Point { .. } => Some(SMALLER_STEPS),
        SolveError::OffGrid { .. } => {
            Some("make the grid larger where the body moves, or hold the body with boundary conditions")
        }
        SolveError::Domain { .. } => Some(
            "use a larger grid if the domain reaches outside it; if the motion tears the domain, use more load steps \
             or another method",
        ),
        SolveError::Surface { .. } => Some(
            "use more points per cell or smaller load steps where the surface leaves the points of its body, or \
             exclude this part of the surface with `part`",
        ),
        SolveError::Contact { error, .. } => on_contact(error),
        SolveError::Collapsed { .. } => {
            Some("use `domain_update: corners`, or more load steps with `diagonal-incremental`")
        }
        SolveError::Singular { free, .. } if !free.is_empty() => Some(
            "place and load the tool so that the bodies resist its motion in every free component (by friction where it turns or \
             slides); or prescribe some of these components",
        ),
        SolveError::Singular { .. } => Some(
            "check that boundary conditions hold every body; if a cell holds hardly any material, move or refine the grid, \
             or use more points per cell or another method",
        ),
        SolveError::Iterative { .. } => {
            Some("use more load steps (`steps: count`), a coarser grid, or a computer with more memory")
        }
        SolveError::NoPath { reason: NoPath::NoInfluence, .. } => {
            Some("choose a probe and an axis along which the loads move it")
        }
        SolveError::NoPath { .. } => Some(SMALLER_STEPS),
        SolveError::InitialState { .. } => Some(
            "check `initial_stress`, its `surface`, and the loads at time 0; horizontal layers under their weight are in \
             equilibrium, slopes are not. `analysis: {initial_imbalance: equilibrate}` lets the first step find equilibrium",
        ),
        SolveError::GridMotion { .. } => Some(
            "prescribe smaller displacements, or leave more cells between the lines under `grid: {follow: ...}` and the ends \
             of the grid",
        ),
        SolveError::Unheld { .. } => Some(
            "fix or prescribe the displacement along that axis at one or more nodes of each separate part",
        ),
        SolveError::Constraint { .. } | SolveError::Load { .. } | SolveError::OutOfMemory { .. } => {
            error.obstacle().map(against)
        }
        // Interruptions, output errors, and errors of terms that a program adds.
        _ => None,
    }
}

/// Advice on contact between tools and bodies.
fn on_contact(error: &ContactError) -> Option<&'static str> {
    match error {
        ContactError::Overlap { place, .. } if place.is_between_bodies() => Some(
            "move one of the bodies away by this overlap, or subtract its shape from that of the other with a \
             `difference`; overlaps of up to half a cell, as the domains of points cause them at oblique \
             boundaries, are allowed",
        ),
        ContactError::Overlap { .. } => Some(
            "move the tool away from the body by this overlap, or subtract its shape from that of the body with a \
             `difference`; at a curved boundary, the domains of points reach beyond the boundary by up to half their \
             diagonal",
        ),
        ContactError::Slide { .. } | ContactError::Through { .. } => Some(SMALLER_STEPS),
        ContactError::Between { .. } => Some(
            "use smaller cells or more points per cell, so that the distance between domain corners is less than the \
             thickness of this part of the tool; or blunt its edge",
        ),
        ContactError::NotSettled { .. } => Some(
            "use smaller steps (`steps: {count, smallest}`), smaller cells, or a larger `overlap` of the tool or the contact",
        ),
        ContactError::Loose { .. } => {
            Some("place the tool so that it touches a body at the start, or prescribe its motion")
        }
        ContactError::NotFinite { .. } => Some(
            "change the formula: with these values it divides by zero, overflows, or evaluates a function outside its \
             domain",
        ),
        ContactError::UnknownFactor { .. } => Some(
            "prescribe the motion of the tool by numbers or by formulas of `factor`, with rotation about one axis at \
                 most, and only in the last stage; or use `control: {type: load}`",
        ),
        ContactError::OffAxis { .. } => Some("in axisymmetry, prescribe motions along y only"),
        _ => None,
    }
}

/// Advice on an obstacle that no step size removes.
pub fn against(obstacle: Obstacle) -> &'static str {
    match obstacle {
        Obstacle::Conflict => {
            "prescribe the displacement of a node along each axis in only one boundary condition"
        }
        Obstacle::Unmet => {
            "remove this condition, or the other conditions that hold the same nodes or surface"
        }
        Obstacle::NotFinite => {
            "change the formula: with these values it divides by zero, overflows, or evaluates a function outside its \
             domain"
        }
        Obstacle::LooseAxis => "add `{name: axis, nodes: {x: 0}, fix: [x]}` to the boundary conditions",
        Obstacle::Memory => "use a coarser grid or, on a structured grid, `solver: {linear: iterative}`",
    }
}
