//! `mpm`: an implicit, finite-deformation material point method, in equilibrium and in motion with inertia.
//!
//! This crate is the program; it re-exports the libraries it is built from:
//!
//! - the method (`mpm-core`): [`solver`] and its parts; start with the documentation of that crate;
//! - [`foreign`] (`mpm-foreign`): laws from shared libraries;
//! - [`deck`] (`mpm-deck`): turns YAML into a [`model::Model`] and [`points::Points`]; its messages name the line;
//! - [`output`] (`mpm-files`): writes the result files of a run;
//! - [`appendix`] and [`study`] (`mpm-report`): reports of results, and studies that run a deck many times;
//! - [`codes`]: the pages that explain messages;
//! - [`program`]: the commands.
//!
//! Each module depends only on the modules above it in this list. Only the last one prints or exits.
//!
//! `docs/theory.md` derives the equations, states where each is implemented, and gives the steps for adding a law, a
//! term of equilibrium, a method, a grid or a linear solver. `CONTRIBUTING.md` explains the layout of the sources.

pub use mpm_core::{
    assembly, basis, dofs, domain, element_test, equilibrium, formula, grid, input_file, kinematics, linear,
    material, memory, model, points, quality, ranks, region, solver, step, stress, surface, tensor, terms,
    timing, tool,
};
pub use mpm_deck as deck;
pub use mpm_files as output;
pub use mpm_foreign as foreign;
pub use mpm_report::{appendix, study};

pub mod codes;
pub mod program;

/// Compiles and runs, as tests, the examples on the documentation page about the library.
#[cfg(doctest)]
#[doc = include_str!("../docs/how-to/library.md")]
struct LibraryPage;
