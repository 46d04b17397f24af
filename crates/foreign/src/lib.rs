//! Constitutive laws from shared libraries, in C, Fortran or any language with the same calling conventions.
//!
//! `examples/laws/mpm_law.h` is the interface. [`Library::open`] loads a library and reads what it states about its
//! law; [`LibraryLaw`] is the law with parameter values. The crate defines no input format and prints nothing.

#![allow(rustdoc::broken_intra_doc_links, reason = "units stand in brackets")]

mod concurrency;
mod error;
mod interface;
mod law;
mod library;

pub use concurrency::differs_between_threads;
pub use error::{Kind, LibraryError};
pub use interface::VERSION;
pub use law::LibraryLaw;
pub use library::{Described, Library};
