//! The commands of the program.

mod analysis;
pub mod arguments;
pub mod converge;
pub mod element;
pub mod explain;
mod guides;
pub mod manual;
mod member;
pub mod new;
mod newest;
mod overwriting;
pub mod picture;
pub mod plan;
pub mod report;
mod resume;
pub mod run;
pub mod status;
pub mod sweep;
