//! Exit codes.

/// All went well.
pub const DONE: u8 = 0;
/// The analysis failed.
pub const FAILED: u8 = 1;
/// The deck, the command line or the results directory cannot be used.
pub const USAGE: u8 = 2;
/// The user stopped the run.
pub const INTERRUPTED: u8 = 130;
