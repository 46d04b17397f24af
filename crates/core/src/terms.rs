//! The parts of equilibrium. Each adds force and stiffness to the grid; Newton's method uses only their sum.
//!
//! Three terms are built in: the material points, the ghost stabilisation and the external forces. A new term
//! implements [`Term`], in a file here or in another crate.

pub mod external_force;
mod failure;
pub mod ghost;
pub mod held_material;
pub mod material_points;
mod sum;
mod term;

pub use failure::{LoadNotFinite, PointFailure};
pub use sum::{Sum, Terms, of_bodies};
pub use term::{FURTHER, Ledger, NamedForce, Term};
