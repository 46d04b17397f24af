"""Files that the Rust tests of the VTU writer have left behind, read with VTK and meshio."""

import os
from pathlib import Path

import numpy as np
import pytest
import pyvista

from results import assert_readers_agree

BLOCK = 65_520 // 8
FILES = Path(os.environ.get("MPM", Path(__file__).parents[2] / "target/release/mpm")).resolve().parents[1] / "tmp/vtu"


def irregular(count):
    """The numbers of the function of the same name in tests/vtu.rs."""
    state, values = 0x9E3779B97F4A7C15, []
    for _ in range(count):
        state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
        values.append((state >> 11) / 2**40 - 4096.0)
    return np.array(values)


@pytest.mark.parametrize("count", [1, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK, 7 * BLOCK // 2])
def test_values_are_exact(count):
    path = FILES / f"blocks_{count}.vtu"
    assert_readers_agree(path)
    mesh, values = pyvista.read(path), irregular(count)
    points = np.stack([values, -values, 0.5 * values], 1)
    np.testing.assert_array_equal(mesh.points, points)
    np.testing.assert_array_equal(mesh.cell_connectivity, np.arange(count))
    for data in (mesh.point_data, mesh.cell_data):
        np.testing.assert_array_equal(data["x"], points)
        np.testing.assert_array_equal(data["id"], np.arange(count))
    assert list(mesh.field_data["TimeValue"]) == [count / 3]
    assert list(mesh.field_data["Step"]) == [count]
    names = [mesh.GetPointData().GetArray("x").GetComponentName(i) for i in range(3)]
    assert names == ["X", "Y", "Z"]


# meshio cannot read a mesh without cells, whoever wrote it.
def test_meshes_without_cells():
    mesh = pyvista.read(FILES / "blocks_0.vtu")
    assert (mesh.n_points, mesh.n_cells) == (0, 0)
    assert mesh.point_data["x"].shape == (0, 3)
    mesh = pyvista.read(FILES / "no_cells.vtu")
    assert (mesh.n_points, mesh.n_cells) == (1, 0)
    np.testing.assert_array_equal(mesh.points, [[1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(mesh.point_data["a"], [4.0])
