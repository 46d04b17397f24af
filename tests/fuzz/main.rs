//! Random decks, files, formulas and analyses; and decks that are too large. The usual tests run some of each, those that are
//! ignored go on for as long as they are told.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
#![allow(clippy::print_stdout, reason = "the counts belong to the tests")]

mod decks;
mod files;
mod formulas;
mod harness;
mod large;
mod random;
mod stress;
