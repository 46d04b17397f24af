//! `mpm`: an implicit, quasi-static, finite-deformation material point method.
//!
//! This crate is the program; it re-exports the libraries it is built from:
//!
//! - the method (`mpm-core`): [`solver`] and its parts; start with the page of that crate;
//! - [`foreign`] (`mpm-foreign`): laws from shared libraries;
//! - [`deck`] (`mpm-deck`): from YAML to a [`model::Model`] and [`points::Points`], with messages that name the line;
//! - [`output`] (`mpm-files`): from a run to result files;
//! - [`appendix`] and [`study`] (`mpm-report`): reports of results, and a deck run for many parameters;
//! - [`codes`]: the pages that explain messages;
//! - [`program`]: the commands.
//!
//! Each depends only on those above it in this list. Only the last prints or exits.

pub use mpm_core::{
    assembly, basis, dofs, domain, element_test, equilibrium, formula, grid, kinematics, linear, material,
    memory, model, points, quality, ranks, region, solver, step, stress, surface, tensor, terms, timing,
};
pub use mpm_deck as deck;
pub use mpm_files as output;
pub use mpm_foreign as foreign;
pub use mpm_report::{appendix, study};

pub mod codes;
pub mod program;

/// The program on the page about the library runs as a test.
#[cfg(doctest)]
#[doc = include_str!("../docs/how-to/library.md")]
struct LibraryPage;
