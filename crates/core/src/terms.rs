//! The terms of equilibrium. Each adds forces and stiffness to the grid; Newton's method uses only their sum.
//!
//! Eight terms are built in: the material points, their inertia, absorbing boundaries, the ghost stabilisation, the
//! external forces on material points, water at rest, the surfaces with their loads and weak conditions, and the contact
//! with rigid tools. A new term implements [`Term`], in a file here or in another crate.

mod absorbing;
mod attached;
pub mod contact;
pub mod external_force;
mod failure;
pub mod ghost;
mod global_unknowns;
pub mod held_material;
mod inertia;
mod layout;
mod ledger;
pub mod material_points;
mod multipliers;
mod on_points;
mod released;
mod report;
mod saved;
mod sum;
pub mod surface;
mod term;
pub(crate) mod water;

pub use absorbing::Absorbing;
pub use attached::{Attached, Obstacle};
pub use contact::{
    Contact, ContactPoint, FacetPoint, Mode, PairState, PartState, StartOverlap, ToolState, boxes_on_the_way,
    overlaps_at_start,
};
pub use failure::{
    BeginError, ContactError, ContactPlace, EvaluateError, LawFailure, LoadNotFinite, PointFailure,
    SurfaceLost, TermFailure,
};
pub use global_unknowns::{GlobalMotion, GlobalUnknowns};
pub use inertia::Inertia;
pub use layout::Layout;
pub use ledger::{Amount, Ledger, NamedEnergy, Role, continued, sum_over_ranks};
pub use multipliers::{Augmentation, Multipliers, Response};
pub use report::{Driven, NamedForce, Record, Records, SurfaceReaction, TermReport};
pub use saved::Saved;
pub use sum::{Sum, Terms, continue_from, model_terms, motions, restore, save};
pub use surface::Surfaces;
pub use term::{Character, Coupled, Term};
pub use water::{WATER, Water};
