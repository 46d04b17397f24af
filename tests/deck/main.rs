//! Decks: reading, checking and building them, and the messages about faulty ones.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
#![allow(clippy::print_stdout, reason = "the counts and numbers belong to the tests")]

mod bad;
mod deck_text;
mod explanations;
mod graded;
mod keys;
mod loading;
#[path = "../long/mod.rs"]
mod long;
mod meaning;
mod mutations;
mod remedy;
mod schema;
mod soil_materials;
