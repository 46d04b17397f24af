"""Reads the output directory of a run, and compares independent readers of it."""

import csv
import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import meshio
import numpy as np
import pyvista


class Results:
    """The files that a run has left in a directory."""

    def __init__(self, directory):
        self.directory = Path(directory)

    def series(self, name):
        """The (time, path) pairs of `name`.pvd."""
        root = ElementTree.parse(self.directory / f"{name}.pvd").getroot()
        entries = root.findall("./Collection/DataSet")
        return [(float(entry.get("timestep")), self.directory / entry.get("file")) for entry in entries]

    def mesh(self, name, index):
        """The mesh of one entry of a series; -1 is the last."""
        return pyvista.read(self.series(name)[index][1])

    def meshes(self, name):
        """All meshes of a series."""
        return [pyvista.read(path) for _, path in self.series(name)]

    def table(self, name):
        """The columns of `name`.csv as arrays."""
        with open(self.directory / f"{name}.csv", newline="") as file:
            rows = list(csv.reader(file))
        header, rows = rows[0], rows[1:]
        assert all(len(row) == len(header) for row in rows), f"ragged rows in {name}.csv"
        # What does not exist is empty: entries of attempts that failed.
        values = np.array([[entry or "nan" for entry in row] for row in rows], dtype=float)
        values = values.reshape(len(rows), len(header))
        return dict(zip(header, values.T))

    @property
    def history(self):
        """history.csv without attempts that failed, so that row k belongs to load step k + 1."""
        columns = self.table("history")
        converged = columns["converged"] == 1
        return {name: values[converged] for name, values in columns.items()}

    def reactions(self):
        """Sum of the reactions of all boundary conditions: one (x, y) row per load step."""
        history = self.history
        return np.stack([sum(history[name] for name in history if name.endswith(end)) for end in ("_rx", "_ry")], 1)

    def probes(self):
        """Displacement of every probe by name: one (x, y) row per load step."""
        history = self.history
        names = [name.removesuffix("_ux") for name in history if name.endswith("_ux")]
        return {name: np.stack([history[f"{name}_ux"], history[f"{name}_uy"]], 1) for name in names}

    @property
    def summary(self):
        return json.loads((self.directory / "summary.json").read_text())


def tensors(six):
    """3 x 3 tensors of rows XX YY ZZ XY YZ XZ."""
    return np.asarray(six)[:, [[0, 3, 5], [3, 1, 4], [5, 4, 2]]]


def deformation_gradients(mesh):
    return np.asarray(mesh.point_data["deformation_gradient"]).reshape(-1, 3, 3)


def component_names(mesh, field):
    array = mesh.GetPointData().GetArray(field)
    return [array.GetComponentName(i) for i in range(array.GetNumberOfComponents())]


def assert_readers_agree(path):
    """PyVista and meshio find the same points, cells and values of the same type, bit for bit."""
    with_vtk, with_meshio = pyvista.read(path), meshio.read(path)
    np.testing.assert_array_equal(with_vtk.points, with_meshio.points)
    assert with_meshio.points.dtype == with_vtk.points.dtype == np.float64
    assert len(with_meshio.cells) == 1
    np.testing.assert_array_equal(
        with_vtk.cell_connectivity.reshape(with_vtk.n_cells, -1), with_meshio.cells[0].data
    )
    assert {"vertex": 1, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12}[with_meshio.cells[0].type] == with_vtk.celltypes[0]
    point_data, cell_data = with_meshio.point_data, {name: v[0] for name, v in with_meshio.cell_data.items()}
    for ours, theirs in [(with_vtk.point_data, point_data), (with_vtk.cell_data, cell_data)]:
        assert set(ours.keys()) == set(theirs)
        for name in theirs:
            assert ours[name].dtype == theirs[name].dtype, name
            np.testing.assert_array_equal(ours[name], theirs[name], err_msg=name)
    assert set(with_vtk.field_data.keys()) == set(with_meshio.field_data) == {"TimeValue", "Step"}
    for name, value in with_meshio.field_data.items():
        np.testing.assert_array_equal(with_vtk.field_data[name], value)
