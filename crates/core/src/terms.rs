//! The terms of equilibrium. Each adds forces and stiffness to the grid; Newton's method uses only their sum.
//!
//! Five terms are built in: the material points, the ghost stabilisation, the external forces on material points, the
//! surfaces with their loads and weak conditions, and the contact with rigid tools. A new term implements [`Term`], in
//! a file here or in another crate.

pub mod contact;
pub mod external_force;
mod failure;
pub mod ghost;
pub mod held_material;
pub mod material_points;
mod saved;
mod sum;
pub mod surface;
mod term;

pub use contact::{
    Contact, ContactError, ContactPlace, ContactPoint, Mode, PartState, StartOverlap, ToolState,
    boxes_on_the_way, overlaps_at_start,
};
pub use failure::{
    BeginError, EvaluateError, LawFailure, LoadNotFinite, PointFailure, SurfaceLost, TermFailure,
};
pub use saved::Saved;
pub use sum::{Sum, Terms, continue_from, motions, of_model, restore, save};
pub use surface::Surfaces;
pub use term::{Augmentation, GlobalMotion, Ledger, NamedForce, Response, SurfaceReaction, Term, TermReport};
