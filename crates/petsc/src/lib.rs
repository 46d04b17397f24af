//! Runs of the material point method on many machines: messages through MPI, and the linear solvers of PETSc.
//!
//! Without the feature `petsc` the crate is empty and needs neither library. With it:
//!
//! - [`start`] starts both libraries; the [`Session`] ends them.
//! - [`Mpi`] is the [`Communicator`](mpm_core::ranks::Communicator) of all processes of `mpirun`.
//! - [`Direct`] solves linear systems with the multifrontal factorisation of MUMPS; [`ByExtent`] uses it for large
//!   systems on many ranks.
//! - [`Krylov`] solves them by conjugate gradients or GMRES, with the algebraic multigrid of PETSc or a
//!   [`Preconditioner`] that the caller supplies.
//!
//! This crate contains the `unsafe` code for these libraries: none of it is visible outside.
//!
//! # Threads
//!
//! The libraries are called by one thread at a time, which need not be the main thread. MUMPS calls a BLAS library that
//! may start threads of its own: set `OPENBLAS_NUM_THREADS=1` (or `MKL_NUM_THREADS=1`) if each core has a rank, and
//! set `RAYON_NUM_THREADS` to the number of cores per rank.
#![cfg_attr(feature = "petsc", allow(unsafe_code, reason = "MPI and PETSc are libraries of C"))]
#![allow(rustdoc::broken_intra_doc_links, reason = "without the feature there are no items")]

#[cfg(feature = "petsc")]
mod by_extent;
#[cfg(feature = "petsc")]
mod direct;
#[cfg(feature = "petsc")]
mod entries;
#[cfg(feature = "petsc")]
mod error;
#[cfg(feature = "petsc")]
mod ffi;
#[cfg(feature = "petsc")]
mod krylov;
#[cfg(feature = "petsc")]
mod mpi;
#[cfg(feature = "petsc")]
mod objects;
#[cfg(feature = "petsc")]
mod session;

#[cfg(feature = "petsc")]
pub use by_extent::{ByExtent, MAX_RANKS, MAX_UNKNOWNS};
#[cfg(feature = "petsc")]
pub use direct::Direct;
#[cfg(feature = "petsc")]
pub use error::Error;
#[cfg(feature = "petsc")]
pub use krylov::{Krylov, Preconditioner};
#[cfg(feature = "petsc")]
pub use mpi::Mpi;
#[cfg(feature = "petsc")]
pub use session::{Session, start, version};
