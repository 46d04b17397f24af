//! Random decks, files, formulas and analyses; and decks that are too large. The usual tests run some of each; the
//! ignored ones run for a given time.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
#![allow(clippy::print_stdout, reason = "the counts belong to the tests")]

mod decks;
mod files;
mod formulas;
mod harness;
mod large;
#[path = "../long/mod.rs"]
mod long;
mod random;
mod stress;
