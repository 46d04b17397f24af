//! Output in the terminal.

#[macro_use]
pub mod message;
pub mod closing;
pub mod failure;
pub mod log;
pub mod print;
pub mod progress;
pub mod quantities;
