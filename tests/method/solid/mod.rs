//! Analyses in three dimensions, with and without decks: patch tests, closed forms, slabs in plane strain, files.
#![allow(clippy::print_stdout, reason = "the measured numbers are part of the verification")]
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod block;
mod bodies;
mod compaction;
mod cone;
mod decks;
mod files;
mod patch;
mod shear;
mod slab;
mod twist;
