//! Result files: tables, series and meshes.

use std::path::PathBuf;

use mpm::output::table::Columns;
use mpm::output::vtu::read::{MeshFile, Section};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{dictionary, matrix};
use crate::errors::Raised;

/// A table as a dictionary of columns; missing entries are NaN.
#[pyfunction]
pub fn table<'py>(py: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let columns = py.detach(|| Columns::read(&path)).map_err(|error| Raised::unreadable(&error))?;
    dictionary(py, columns.iter().map(|(name, values)| (name, values.to_vec())))
}

/// The times and files of a series.
#[pyfunction]
#[pyo3(name = "series")]
pub fn series(path: PathBuf) -> PyResult<Vec<(f64, PathBuf)>> {
    let sets = mpm::output::series::read(&path).map_err(|error| Raised::unreadable(&error))?;
    Ok(sets.into_iter().map(|set| (set.time, set.path)).collect())
}

/// The point fields of a mesh by name, its cell fields by name, and the coordinates of its points under the name `""`.
#[pyfunction]
pub fn mesh<'py>(py: Python<'py>, path: PathBuf) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    let unreadable = |error: std::io::Error| PyErr::from(Raised::unreadable(&error));
    let file = py.detach(|| MeshFile::read(&path)).map_err(unreadable)?;
    let (points, cells) = (PyDict::new(py), PyDict::new(py));
    for (section, target) in [(Section::PointData, &points), (Section::CellData, &cells)] {
        for array in file.arrays(section) {
            let values = py.detach(|| file.decode(array)).map_err(unreadable)?;
            target.set_item(array.name.as_str(), matrix(py, values, array.components)?)?;
        }
    }
    let positions = py.detach(|| file.positions()).map_err(unreadable)?;
    points.set_item("", matrix(py, positions.into_iter().flatten().collect(), 3)?)?;
    Ok((points, cells))
}
