//! What a user reads in the terminal.

#[macro_use]
pub mod tell;
pub mod closing;
pub mod failure;
pub mod log;
pub mod print;
pub mod progress;
pub mod quantities;
