//! A load step in equilibrium: what is known of it, and what must balance in it.

mod balance;
mod report;

pub use balance::{Energy, ReactionMoment, moment_error, reaction_moments};
pub use report::{GridFields, StepReport, named_reactions, reactions_of};
