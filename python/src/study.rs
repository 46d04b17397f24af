//! Studies: the rules that the package shares with `mpm sweep`.

use mpm::study::{Axis, headings as headings_of};
use pyo3::prelude::*;

use crate::errors::Raised;

/// Checks the values of a parameter, which are written as in `--set`.
#[pyfunction]
pub fn check_axis(name: String, values: Vec<String>) -> PyResult<()> {
    let axis = Axis::new(name, values).map(drop);
    Ok(axis.map_err(|error| Raised::misuse(error.to_string()))?)
}

/// Headings of parameters that differ from the columns of results and from each other.
#[pyfunction]
pub fn headings(parameters: Vec<String>, results: Vec<String>) -> Vec<String> {
    let [parameters, results] =
        [&parameters, &results].map(|names| names.iter().map(String::as_str).collect::<Vec<_>>());
    headings_of(&parameters, &results)
}
