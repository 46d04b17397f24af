//! The method and its parts, tested against independent implementations, closed forms and each other; the problems of the
//! paper; the result files; and the examples. They share one binary, because each binary compiles the generic code of the
//! core that it calls once more.

#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
#![allow(clippy::print_stdout, reason = "the measured numbers are part of the verification")]

mod assembly;
mod batched;
mod constraints;
mod duration;
mod examples;
mod failure;
mod fields;
mod further_fields;
mod gmsh;
mod inertia;
mod inline_vtu;
mod iterative;
mod linear;
#[path = "../long/mod.rs"]
mod long;
#[path = "../verification/meshes.rs"]
mod meshes;
mod moving_grid;
mod own_terms;
mod ranks;
mod scaling;
mod solid;
mod stabilisation;
mod stages;
mod stepping;
mod strength_reduction;
mod surfaces;
mod threads;
#[path = "../verification/mod.rs"]
mod verification;
mod vtu;
