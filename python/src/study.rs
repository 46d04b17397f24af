//! Studies: the rules that the package shares with `mpm sweep`.

use mpm::study::headings as headings_of;
use pyo3::prelude::*;

/// Headings of parameters that differ from the columns of results and from each other.
#[pyfunction]
pub fn headings(parameters: Vec<String>, results: Vec<String>) -> Vec<String> {
    let [parameters, results] =
        [&parameters, &results].map(|names| names.iter().map(String::as_str).collect::<Vec<_>>());
    headings_of(&parameters, &results)
}
