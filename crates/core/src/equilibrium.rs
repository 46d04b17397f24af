//! A converged load step: its report and its balance of energy and moments.

mod balance;
mod initial_state;
mod report;

pub use balance::{AppliedForces, Energy, ReactionMoment, moment_error, reaction_moments};
pub use initial_state::{InitialState, UnbalancedNode};
pub use report::{FurtherReaction, GridFields, NodalField, StepReport, named_reactions, reactions_of};
