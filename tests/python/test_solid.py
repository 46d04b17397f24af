"""Files of analyses in space that tests/solid/files.rs has left behind, read with VTK and meshio."""

import os
from pathlib import Path

import numpy as np
import pytest
import pyvista

from results import assert_readers_agree

FILES = Path(os.environ.get("MPM", Path(__file__).parents[2] / "target/release/mpm")).resolve().parents[1] / "tmp/vtu"
NAMES = ["mpm", "gimp", "cpdi2", "hexahedra", "tetrahedra"]
WITH_DOMAINS = NAMES[1:]
KIND = {name: pyvista.CellType.HEXAHEDRON for name in NAMES} | {"tetrahedra": pyvista.CellType.TETRA}
# The increment of the test, once and twice.
INCREMENT = np.array([[1.05, -0.2, 0.02], [0.2, 0.95, 0.0], [0.0, 0.05, 1.1]])
GRADIENT = [np.linalg.matrix_power(INCREMENT, step) for step in range(3)]


def read(name, series, step):
    return pyvista.read(FILES / f"solid_{name}" / f"{series}_{step:04}.vtu")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("series", ["points", "domains", "grid"])
def test_readers_agree(name, series):
    if series == "domains" and name == "mpm":
        assert not (FILES / "solid_mpm/domains_0000.vtu").exists()
        return
    for step in range(3):
        assert_readers_agree(FILES / f"solid_{name}" / f"{series}_{step:04}.vtu")


@pytest.mark.parametrize("name", NAMES)
def test_points_move_in_space(name):
    start = read(name, "points", 0).points
    for step in range(3):
        mesh = read(name, "points", step)
        expected = (start - 4.0) @ GRADIENT[step].T + 4.0
        np.testing.assert_allclose(mesh.points, expected, atol=1e-12)
        np.testing.assert_allclose(mesh["displacement"], mesh.points - start, atol=1e-12)
        gradient = mesh["deformation_gradient"].reshape(-1, 3, 3)
        np.testing.assert_allclose(gradient, [GRADIENT[step]] * len(start), atol=1e-12)
        np.testing.assert_allclose(mesh["J"], np.linalg.det(GRADIENT[step]), atol=1e-12)


@pytest.mark.parametrize("name", WITH_DOMAINS)
def test_domains_have_the_volume_of_their_points(name):
    for step in range(3):
        mesh = read(name, "domains", step)
        assert set(mesh.celltypes) == {KIND[name]}
        sizes = mesh.compute_cell_sizes(length=False, area=False)
        # Positive: the corners stand in VTK's order. VTK cuts a hexahedron with curved faces into tetrahedra.
        curved = name == "hexahedra"
        np.testing.assert_allclose(sizes["Volume"], mesh["volume"], rtol=2e-2 if curved else 1e-12)
        np.testing.assert_allclose(sizes["Volume"].sum(), mesh["volume"].sum(), rtol=1e-3 if curved else 1e-12)
        assert (sizes["Volume"] > 0).all()


@pytest.mark.parametrize("name", NAMES)
def test_cells_of_the_grid_fill_it(name):
    for step in range(3):
        mesh = read(name, "grid", step)
        assert set(mesh.celltypes) == {KIND[name]}
        sizes = mesh.compute_cell_sizes(length=False, area=False)["Volume"]
        assert (sizes > 0).all()
        if name in ("mpm", "gimp", "cpdi2"):
            np.testing.assert_allclose(sizes, 1.0, rtol=1e-12)
        # The cells of a step are those with points, or corners of their domains, at its start. At the very start, the
        # body is whole cells.
        points = read(name, "domains" if name in WITH_DOMAINS else "points", max(step - 1, 0))
        if step == 0:
            np.testing.assert_allclose(sizes.sum(), points["volume"].sum(), rtol=1e-3)
        _, nearest = mesh.find_closest_cell(points.points, return_closest_point=True)
        np.testing.assert_allclose(nearest, points.points, atol=1e-9)


def test_slices_and_thresholds_work():
    mesh = read("cpdi2", "domains", 2)
    cut = mesh.slice(normal="z", origin=(4, 4, 4))
    assert cut.n_cells > 0 and cut.area > 10
    limit = np.median(mesh["pressure"])
    assert mesh.threshold(limit, scalars="pressure").n_cells < mesh.n_cells or np.ptp(mesh["pressure"]) < 1e-6
