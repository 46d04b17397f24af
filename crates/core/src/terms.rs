//! The parts of equilibrium. Each adds force and stiffness to the grid; Newton's method knows their sum only.
//!
//! The material points, the ghost stabilisation and the external forces are the first three. A new one is a file here, or a
//! type of another crate, that implements [`Term`].

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
