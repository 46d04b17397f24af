"""The quality report of `summary.json`, and the warnings of domain updates that do not suit the motion."""

import numpy as np
import pytest

from conftest import BEAM
from results import Results, deformation_gradients

KEYS = {
    "partition_of_unity_loss",
    "domain_outside_grid",
    "smallest_cell_filling",
    "det_f",
    "mass",
    "volume",
    "domain_overlap",
    "domain_volume_excess",
    "newton_order",
    "rotation",
    "shear",
    "box_rotation",
    "crossings",
    "pressure_oscillation",
    "held_by_nodes",
    "overstress",
}


@pytest.fixture
def run(mpm, tmp_path):
    """Runs a deck with parameters; returns its results and the table that the run ends with."""

    def run(deck, **parameters):
        settings = [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]
        process = mpm("run", deck, "--out", tmp_path / "out", *settings)
        assert process.returncode == 0, process.stderr
        results = Results(tmp_path / "out")
        lines = process.stderr.splitlines()
        told = [pair for pair in zip(lines, lines[1:]) if pair[0].startswith("warning[W")]
        assert told == [lines_of(warning) for warning in results.summary["warnings"]]
        return results, process.stdout

    return run


def lines_of(warning):
    """A warning as the screen shows it."""
    head = f"warning[{warning['code']}]: step {warning['step']}: {warning['message']}"
    return head, f"  help: {warning['help']}"


def rotations(gradients):
    return np.degrees(np.arctan2(gradients[:, 1, 0] - gradients[:, 0, 1], gradients[:, 0, 0] + gradients[:, 1, 1]))


def test_quality_of_the_beam(beam):
    summary = beam.summary
    quality = summary["quality"]
    assert set(quality) == KEYS
    (warning,) = summary["warnings"]
    assert (warning["code"], warning["threshold"]) == ("W011", 30) and warning["place"]["bodies"] == ["beam"]
    meshes = beam.meshes("points")
    fields = [deformation_gradients(mesh) for mesh in meshes[1:]]
    det = np.array([np.linalg.det(field) for field in fields])
    assert quality["det_f"]["min"] == pytest.approx(det.min(), rel=1e-13)
    assert quality["det_f"]["max"] == pytest.approx(det.max(), rel=1e-13)
    for name, measure in {
        "rotation": lambda f: np.abs(rotations(f)),
        "shear": lambda f: np.abs((f.transpose(0, 2, 1) @ f)[:, 0, 1]) / np.linalg.det(f),
    }.items():
        values = np.array([measure(field) for field in fields])
        worst = quality[name]
        assert worst["value"] == pytest.approx(values.max(), rel=1e-12)
        assert values[worst["step"] - 1, worst["point"]] == pytest.approx(values.max(), rel=1e-12)
        assert worst["body"] == "beam"
    volume = np.asarray(meshes[-1].point_data["volume"]).sum()
    assert quality["volume"]["total"] == pytest.approx(volume, rel=1e-13)
    assert quality["volume"]["relative_change"] == pytest.approx(volume / 10 - 1, abs=1e-13)
    assert quality["mass"] == {"total": 0, "relative_change": 0}
    # Cells of 0.5 x 0.5; the cells of a step hold the points as they were at its start.
    low = np.inf
    for mesh in meshes[:-1]:
        cells = np.floor(np.asarray(mesh.points)[:, :2] / 0.5 + 1e-8)
        _, cell = np.unique(cells, axis=0, return_inverse=True)
        low = min(low, (np.bincount(cell.ravel(), np.asarray(mesh.point_data["volume"])) / 0.25).min())
    assert quality["smallest_cell_filling"]["value"] == pytest.approx(low, rel=1e-12)
    assert abs(quality["domain_volume_excess"]["value"]) < 1e-12, "the update keeps the volume"
    assert quality["domain_overlap"] == pytest.approx(overlap(beam.mesh("domains", -1)), rel=1e-9)
    assert quality["domain_overlap"] > 0.01, "rectangles cannot follow the bending"
    assert quality["partition_of_unity_loss"]["value"] < 1e-9
    assert quality["newton_order"]["smallest"] <= quality["newton_order"]["median"] < 2.5


def test_beam_with_an_update_that_does_not_stand_rotation(run):
    results, told = run("inputs/beam.yaml", **(BEAM | {"update": "diagonal"}))
    (warning,) = [warning for warning in results.summary["warnings"] if warning["code"] == "W001"]
    message = warning["message"]
    assert "body `beam`" in message and "`diagonal`" in message and "turned by" in message
    assert warning["help"] == "use `domain_update: corners`"
    # The first step in which a point has turned by more than 15 degrees, and that point.
    largest = [np.abs(rotations(deformation_gradients(mesh))) for mesh in results.meshes("points")]
    step = next(k for k, values in enumerate(largest) if values.max() > 15)
    assert warning["step"] == step and warning["threshold"] == 15
    assert warning["value"] == pytest.approx(largest[step].max(), rel=1e-9)
    assert warning["place"]["point"] == largest[step].argmax()
    assert f"{largest[step].max():.1f}°" in message
    assert results.summary["quality"]["domain_volume_excess"]["value"] < -0.5, "vanishing domains"
    assert "\n  quality " in told


def test_shear_with_an_update_that_does_not_stand_it(run):
    results, _ = run("inputs/shear.yaml", method="gimp", update="stretch")
    update, outside, unity = results.summary["warnings"]
    assert "`stretch`" in update["message"] and "sheared by 0.40" in update["message"] and update["step"] == 2
    assert [warning["code"] for warning in (update, outside, unity)] == ["W001", "W002", "W003"]
    assert "outside the grid" in outside["message"]
    assert "add up to 0.99" in unity["message"]
    quality = results.summary["quality"]
    # The domains grow beyond the grid: the sum of the basis functions falls to 0.892.
    assert quality["partition_of_unity_loss"]["value"] == pytest.approx(0.108, rel=0.02)
    assert quality["partition_of_unity_loss"]["step"] == 30
    assert quality["shear"]["value"] == pytest.approx(6, rel=1e-10)
    domains = results.mesh("domains", -1)
    corners = np.asarray(domains.points).reshape(-1, 4, 3)
    low, high = corners.min(axis=1), corners.max(axis=1)
    inside = np.minimum(high, [8, 1, 0]) - np.maximum(low, 0)
    shares = 1 - np.prod(inside[:, :2] / (high - low)[:, :2], axis=1)
    assert quality["domain_outside_grid"]["value"] == pytest.approx(shares.max(), rel=1e-10)
    areas = np.prod((high - low)[:, :2], axis=1)
    assert quality["domain_volume_excess"]["value"] == pytest.approx(areas.sum() - 1, rel=1e-10)
    assert quality["domain_overlap"] == pytest.approx(overlap(domains), rel=1e-9)


def overlap(domains):
    """Area that rectangles share, over all pairs, relative to the area of all."""
    corners = np.asarray(domains.points).reshape(-1, 4, 3)[:, :, :2]
    low, high = corners.min(axis=1), corners.max(axis=1)
    shared = 0.0
    for k in range(len(low) - 1):
        sides = np.minimum(high[k], high[k + 1 :]) - np.maximum(low[k], low[k + 1 :])
        shared += np.prod(np.maximum(sides, 0), axis=1).sum()
    return shared / np.prod(high - low, axis=1).sum()


def test_steps_are_on_record(run):
    results, _ = run("inputs/collapse.yaml", method="gimp", steps=5, every=0)
    rows = np.genfromtxt(results.directory / "quality.csv", delimiter=",", names=True)
    quality = results.summary["quality"]
    assert rows["step"].tolist() == [1, 2, 3, 4, 5]
    for name, worst in {
        "partition_of_unity_loss": rows["partition_of_unity_loss"].max(),
        "domain_outside_grid": rows["domain_outside_grid"].max(),
        "smallest_cell_filling": rows["smallest_cell_filling"].min(),
        "domain_volume_excess": max(rows["domain_volume_excess"], key=abs),
    }.items():
        assert quality[name]["value"] == pytest.approx(worst, rel=1e-12, abs=1e-18), name
    assert quality["det_f"] == {"min": rows["smallest_det_f"].min(), "max": rows["largest_det_f"].max()}
    assert quality["volume"]["total"] == rows["volume"][-1] and quality["mass"]["total"] == rows["mass"][-1]


@pytest.mark.parametrize("update", ["none", "determinant", "diagonal", "corners"])
def test_updates_that_stand_shear(run, update):
    results, _ = run("inputs/shear.yaml", method="gimp", update=update, every=0)
    assert results.summary["warnings"] == []


def test_points_without_domain(collapse):
    quality = collapse.summary["quality"]
    assert set(quality) == KEYS
    assert quality["box_rotation"] is None and quality["crossings"]["block"] > 0
    assert quality["domain_outside_grid"] is None and quality["domain_overlap"] is None
    assert quality["partition_of_unity_loss"]["value"] < 1e-14
    assert quality["mass"]["total"] == pytest.approx(64e3, rel=1e-12)
    assert abs(quality["mass"]["relative_change"]) < 1e-14
    assert 1.9 < quality["newton_order"]["median"] < 2.1


def test_compaction_without_update_of_domains(run):
    results, _ = run("inputs/compaction.yaml", update="none", young=1e4, every=0)
    warning = results.summary["warnings"][0]
    message = warning["message"]
    assert "body `column`" in message and "`none`" in message and "changed its area by" in message
    assert results.summary["quality"]["domain_volume_excess"]["value"] > 1


def test_members_of_a_study_warn(mpm, tmp_path):
    process = mpm(
        "sweep", "inputs/beam.yaml", "--over", "update=diagonal,corners", "--set", "steps=20", "--set", "every=0",
        "--out", tmp_path,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    lines = process.stderr.splitlines()
    places = [k for k, line in enumerate(lines) if line.startswith("  warning[W001]: ")]
    assert len(places) == 1
    assert lines[places[0] - 1] == "member 1/2: update=diagonal"


def test_a_run_without_steps_has_no_measures(mpm, tmp_path):
    settings = ["--set", "steps=1", "--set", "smallest=1", "--set", "every=0"]
    process = mpm("run", "inputs/beam.yaml", "--out", tmp_path, *settings)
    assert process.returncode == 1 and "\nquality: " not in process.stderr
    quality = Results(tmp_path).summary["quality"]
    assert set(quality) == KEYS
    assert all(quality[name] is None for name in KEYS - {"mass", "volume"})
    assert quality["volume"] == {"total": pytest.approx(10), "relative_change": 0}


def test_balances_of_the_summary_are_the_worst_of_the_steps(beam, collapse):
    for results in (beam, collapse):
        steps, summary = results.table("quality"), results.summary
        for name, column in [("energy", "energy_error"), ("force", "force_error"), ("moment", "moment_error")]:
            worst = summary["balance_errors"][name]
            assert worst["value"] == np.abs(steps[column]).max(), name
            assert np.abs(steps[column])[int(worst["step"]) - 1] == worst["value"]
        missing = (
            summary["external_work"]
            + summary["regridding_work"]
            - summary["strain_energy"]
            - summary["plastic_work"]
        )
        assert abs(missing) < 0.02 * abs(summary["external_work"])
        assert steps["plastic_work"][-1] == summary["plastic_work"]
        assert steps["regridding_work"][-1] == summary["regridding_work"]
        assert summary["balance_errors"]["force"]["value"] < 1e-5
    assert collapse.summary["plastic_work"] > 10 * collapse.summary["strain_energy"]
    assert beam.summary["plastic_work"] == 0
    # Work on a path that only goes one way is that of the work so far.
    works = np.diff(beam.history["external_work"], prepend=0) + np.diff(beam.table("quality")["regridding_work"], prepend=0)
    missing = (
        beam.history["external_work"] + beam.table("quality")["regridding_work"] - beam.history["strain_energy"]
    )
    np.testing.assert_allclose(beam.table("quality")["energy_error"], missing / np.abs(works).cumsum(), rtol=1e-6, atol=1e-12)
