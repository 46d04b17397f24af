//! The parts of equilibrium: what adds force and stiffness to the grid.

pub mod external_force;
pub mod ghost;
pub mod held_material;
