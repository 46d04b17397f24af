//! Arrays of numbers for NumPy, which takes them over without another copy.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// An array with one number, or one row of `components` numbers, for each point.
pub fn matrix<'py>(py: Python<'py>, values: Vec<f64>, components: usize) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len() / components.max(1);
    let flat = PyArray1::from_vec(py, values);
    if components == 1 {
        return Ok(flat.into_any());
    }
    Ok(flat.reshape([rows, components])?.into_any())
}

/// A dictionary of columns.
pub fn dictionary<'py, 'a>(
    py: Python<'py>,
    columns: impl Iterator<Item = (&'a str, Vec<f64>)>,
) -> PyResult<Bound<'py, PyDict>> {
    let dictionary = PyDict::new(py);
    for (name, values) in columns {
        dictionary.set_item(name, PyArray1::from_vec(py, values))?;
    }
    Ok(dictionary)
}
