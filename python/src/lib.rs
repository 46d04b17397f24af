//! The Python module `mpm._mpm`: decks, runs, laws and results of the material point method, for the package `mpm`.
//!
//! The package wraps this module in classes with documentation; nothing here is meant to be called by users. Structured
//! data pass between Rust and Python as JSON, arrays as NumPy arrays. The analysis runs on a thread of its own, which
//! holds the interpreter lock only while it calls a law defined in Python.

mod arrays;
mod convergence;
mod decks;
mod errors;
mod files;
mod laws;
mod link;
mod preparation;
mod session;
mod study;
mod tools;
mod worker;

use std::ffi::OsString;

use pyo3::prelude::*;

/// With it, the program of the package tells a lack of memory from other aborts.
#[global_allocator]
static HEAP: mpm::program::Heap = mpm::program::Heap;

/// Runs the program `mpm` with these arguments, the first of which is its name; returns the exit code.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| mpm::program::main(&arguments))
}

#[pymodule]
mod _mpm {
    #[pymodule_export]
    use super::convergence::Grids;
    #[pymodule_export]
    use super::decks::{check, dump, read, schema, text_of_code};
    #[pymodule_export]
    use super::files::{mesh, series, table};
    #[pymodule_export]
    use super::laws::{BuiltIn, conformance, is_field_of_points};
    #[pymodule_export]
    use super::main;
    #[pymodule_export]
    use super::session::Session;
    #[pymodule_export]
    use super::study::{check_axis, headings};

    #[pymodule_export]
    const MAX_THREADS: usize = super::preparation::MAX_THREADS;
    #[pymodule_export]
    const VERSION: &str = mpm::output::summary::VERSION;
}
