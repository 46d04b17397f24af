"""The files of every run: which there are, that all readers agree on them, and that they agree among each other."""

import re

import numpy as np
import pytest
import pyvista

from conftest import ROOT
from results import assert_readers_agree, component_names

SYMMETRIC = ["XX", "YY", "ZZ", "XY", "YZ", "XZ"]
GENERAL = ["XX", "XY", "XZ", "YX", "YY", "YZ", "ZX", "ZY", "ZZ"]
COMPONENTS = {
    "displacement": 3,
    "deformation_gradient": 9,
    "J": 1,
    "cauchy_stress": 6,
    "elastic_strain": 6,
    "plastic_strain": 6,
    "equivalent_plastic_strain": 1,
    "von_mises_stress": 1,
    "pressure": 1,
    "volume": 1,
    "body_id": 1,
    "material_id": 1,
    "point_id": 1,
}


@pytest.fixture(params=["beam", "collapse"])
def results(request):
    return request.getfixturevalue(request.param)


def names_of_series(results):
    return sorted(path.stem for path in results.directory.glob("*.pvd"))


def test_the_expected_files_and_no_others(beam, collapse):
    for results, series in [(beam, ["domains", "grid", "points"]), (collapse, ["grid", "points"])]:
        assert names_of_series(results) == series
        expected = {f"{name}.pvd" for name in series} | {"history.csv", "convergence.csv", "quality.csv", "summary.json"}
        expected |= {path.name for name in series for _, path in results.series(name)}
        written = {path.name for path in results.directory.iterdir()}
        assert expected <= written
        assert not {name for name in written - expected if name.endswith((".vtu", ".pvd", ".csv", ".tmp"))}
    assert [path.name for _, path in beam.series("points")] == [f"points_{step:04}.vtu" for step in range(21)]


def test_every_file_is_read_alike_by_vtk_and_meshio(results):
    for name in names_of_series(results):
        for _, path in results.series(name):
            assert_readers_agree(path)


def test_times(beam):
    for name in ("points", "domains", "grid"):
        times = [time for time, _ in beam.series(name)]
        np.testing.assert_allclose(times, np.arange(21) / 20, rtol=1e-15)
        reader = pyvista.PVDReader(str(beam.directory / f"{name}.pvd"))
        assert reader.time_values == times
        for step, (time, path) in enumerate(beam.series(name)):
            mesh = pyvista.read(path)
            assert list(mesh.field_data["TimeValue"]) == [time]
            assert list(mesh.field_data["Step"]) == [step]
            reader.set_active_time_value(time)
            np.testing.assert_array_equal(reader.read()[0].points, mesh.points)


def test_fields_of_points(results):
    for mesh in results.meshes("points"):
        assert {name: np.size(mesh.point_data[name][0]) for name in mesh.point_data.keys()} == COMPONENTS
        for name in COMPONENTS:
            integers = name in ("body_id", "material_id", "point_id")
            assert np.issubdtype(mesh.point_data[name].dtype, np.integer if integers else np.float64)
            assert np.isfinite(mesh.point_data[name]).all()
        for name in ("cauchy_stress", "elastic_strain", "plastic_strain"):
            assert component_names(mesh, name) == SYMMETRIC
        assert component_names(mesh, "deformation_gradient") == GENERAL
        np.testing.assert_array_equal(mesh.point_data["point_id"], np.arange(mesh.n_points))
        assert set(mesh.celltypes) == {pyvista.CellType.VERTEX}
        np.testing.assert_array_equal(mesh.cell_connectivity, np.arange(mesh.n_points))


def test_initial_state(results):
    mesh = results.mesh("points", 0)
    np.testing.assert_array_equal(mesh.point_data["displacement"], 0)
    undeformed = np.tile(np.eye(3).ravel(), (mesh.n_points, 1))
    np.testing.assert_array_equal(mesh.point_data["deformation_gradient"], undeformed)
    for name in ("cauchy_stress", "elastic_strain", "plastic_strain", "equivalent_plastic_strain"):
        np.testing.assert_array_equal(mesh.point_data[name], 0)


def test_domains_surround_their_points(beam):
    for points, domains in zip(beam.meshes("points"), beam.meshes("domains"), strict=True):
        assert set(domains.celltypes) == {pyvista.CellType.QUAD}
        assert domains.n_cells == points.n_points
        # Four own points per box: none is shared, so boxes may overlap or part.
        np.testing.assert_array_equal(domains.cell_connectivity, np.arange(4 * domains.n_cells))
        corners = np.asarray(domains.points).reshape(-1, 4, 3)
        np.testing.assert_allclose(corners.mean(axis=1), points.points, rtol=0, atol=1e-12)
        edges = np.roll(corners, -1, axis=1) - corners
        areas = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])[:, 2]
        assert np.isclose(edges[:, :, :2], 0, atol=1e-12).any(axis=2).all(), "a box is not aligned with the axes"
        # The volume correction of the corner update, eq. (37), makes them equal; they are positive, so anticlockwise.
        np.testing.assert_allclose(areas, points.point_data["volume"], rtol=1e-10)
        assert set(domains.cell_data.keys()) == set(points.point_data.keys())
        for name in points.point_data.keys():
            np.testing.assert_array_equal(domains.cell_data[name], points.point_data[name], err_msg=name)


def test_grid_holds_the_points(results):
    h = float(results.summary["parameters"]["h"])
    points = results.meshes("points")
    for step, grid in enumerate(results.meshes("grid")):
        assert set(grid.celltypes) == {pyvista.CellType.QUAD}
        for name in ("displacement_increment", "reaction"):
            assert grid.point_data[name].shape == (grid.n_points, 3)
        corners = np.asarray(grid.points)[grid.cell_connectivity.reshape(-1, 4)][:, :, :2]
        low, high = corners.min(axis=1), corners.max(axis=1)
        np.testing.assert_allclose(high - low, h, rtol=1e-12)
        # The active cells of a step are those that hold the points when the step begins.
        x = np.asarray(points[max(step - 1, 0)].points)[:, None, :2]
        inside = ((x >= low - 1e-9) & (x <= high + 1e-9)).all(axis=2)
        assert inside.any(axis=1).all(), f"a point is outside the active cells of step {step}"


def test_reactions_of_grid_and_history_agree(results):
    meshes = results.meshes("grid")
    np.testing.assert_array_equal(meshes[0].point_data["reaction"], 0)
    np.testing.assert_array_equal(meshes[0].point_data["displacement_increment"], 0)
    steps = [int(mesh.field_data["Step"][0]) for mesh in meshes[1:]]
    sums = np.array([mesh.point_data["reaction"].sum(axis=0) for mesh in meshes[1:]])
    expected = results.reactions()[np.array(steps) - 1]
    scale = max(np.abs(mesh.point_data["reaction"]).sum() for mesh in meshes)
    np.testing.assert_allclose(sums[:, :2], expected, rtol=0, atol=1e-12 * scale)
    np.testing.assert_array_equal(sums[:, 2], 0)


def test_history_and_convergence_agree(results):
    history, convergence = results.history, results.table("convergence")
    steps = history["step"]
    np.testing.assert_array_equal(steps, np.arange(1, len(steps) + 1))
    np.testing.assert_allclose(history["time"], steps / len(steps), rtol=1e-14)
    assert (history["residual"] <= 1e-9).all()
    np.testing.assert_array_equal(np.unique(convergence["step"]), steps)
    for step, iterations, residual in zip(steps, history["iterations"], history["residual"]):
        rows = convergence["step"] == step
        numbers, residuals = convergence["iteration"][rows], convergence["residual"][rows]
        np.testing.assert_array_equal(np.diff(numbers), 1)
        assert numbers[0] in (0, 1) and numbers[-1] == iterations
        assert residuals[-1] == residual
        assert (residuals[:-1][numbers[:-1] > 0] > 1e-9).all(), "iterated on after equilibrium"


def test_columns_of_tables(results):
    columns = list(results.table("history"))
    assert columns[:8] == [
        "step", "time", "iterations", "residual", "linear_iterations", "converged", "rounding_limited", "load_factor",
    ]  # fmt: skip
    assert columns[-2:] == ["external_work", "strain_energy"]
    endings = [name[-3:] for name in columns[8:-2]]
    constraints, loads, probes = endings.count("_rx"), endings.count("_fx"), endings.count("_ux")
    assert constraints > 0 and loads > 0
    assert endings == ["_rx", "_ry", "_mz"] * constraints + ["_fx", "_fy"] * loads + ["_ux", "_uy"] * probes
    assert list(results.table("convergence")) == ["step", "iteration", "residual"]


def test_summary(results):
    summary, history, last = results.summary, results.history, results.mesh("points", -1)
    assert summary["outcome"] == "completed"
    assert summary["points"] == last.n_points
    assert summary["steps"] == len(history["step"])
    assert summary["linear_solves"] == history["iterations"].sum()
    assert summary["evaluations"] >= summary["linear_solves"]
    assert summary["cells"] > 0 and summary["unknowns"] > 0 and summary["peak_memory_bytes"] > 0
    phases = {"set-up", "basis", "assembly", "analyse", "factorise", "solve", "update", "output"}
    for clock in ("wall_seconds", "cpu_seconds"):
        assert set(summary[clock]) == phases | {"total"}
        assert all(seconds >= 0 for seconds in summary[clock].values())
    wall = summary["wall_seconds"]
    assert sum(wall[phase] for phase in phases) <= wall["total"] * 1.01 + 0.01


def test_the_book_explains_every_key_of_a_summary(beam, analyse):
    section = (ROOT / "docs/output.md").read_text().split("## `summary.json`")[1].split("\n## ")[0]
    explained = {key.split(".")[0] for key in re.findall(r"`([a-z_.<>]+)`", section)}
    in_stages = analyse("inputs/excavation.yaml", h=0.5)
    touched = analyse("inputs/pipe.yaml", h=0.25, depth=0.02, steps=1)
    keys = set(beam.summary) | set(in_stages.summary) | set(touched.summary)
    assert {"stages", "initial_state", "friction_work"} <= keys
    assert keys <= explained, keys - explained


def test_forces_of_the_summary(results):
    """Loads add up to what is applied; they and the moments are those of the last row of the table."""
    forces, history = results.summary["forces"], results.history
    assert sum(np.array(force) for force in forces["loads"].values()) == pytest.approx(forces["applied"], rel=1e-14)
    for name, force in forces["loads"].items():
        assert force == [history[f"{name}_fx"][-1], history[f"{name}_fy"][-1]]
    assert list(forces["moments"]) == list(forces["reactions"])
    for name, moment in forces["moments"].items():
        assert moment["moment"] == [history[f"{name}_mz"][-1]] and len(moment["about"]) == 2


def test_extents_of_the_summary(results):
    summary, last = results.summary, results.mesh("points", -1)
    assert len(summary["bodies"]) == 1
    (body,) = summary["bodies"].values()
    x = np.asarray(last.points)
    for bound, expected in [("min", x.min(axis=0)), ("max", x.max(axis=0))]:
        np.testing.assert_allclose(body["extent"]["points"][bound][:2], expected[:2], rtol=1e-14, atol=1e-14)
    if "domains" in names_of_series(results):
        corners = np.asarray(results.mesh("domains", -1).points)
        for bound, expected in [("min", corners.min(axis=0)), ("max", corners.max(axis=0))]:
            np.testing.assert_allclose(body["extent"]["domain"][bound][:2], expected[:2], rtol=1e-12, atol=1e-12)
