"""Steps that are cut, runs that cannot go on, and what they leave behind."""

import json
import signal
import subprocess
import time

import meshio
import numpy as np
import pytest
import pyvista

from conftest import ROOT
from results import Results

COLLAPSE = {"h": 0.5, "n": 3, "steps": 3}

STRIP = """version: 1
analysis: {stabilisation: {mode: auto}}
grid: {type: structured, origin: [0, -2], size: [2, 6], spacing: 0.25}
materials: {m: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 1e3}}
bodies: [{name: strip, material: m, method: gimp, shape: {type: box, min: [0, 0], max: [1, 4]}, points_per_cell: 1}]
boundary_conditions:
  - {name: top, nodes: {y: 4}, fix: [y]}
  - {name: axis, nodes: {x: 0}, fix: [x]}
loads: [{name: pull, type: body-force, force: [0, -707.1]}]
steps: {count: 10}
"""


def settings(**parameters):
    return [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]


def summary_of(results):
    return json.loads((results.directory / "summary.json").read_text())


def test_history_records_every_attempt(analyse):
    results = analyse("inputs/collapse.yaml", **COLLAPSE)
    table, summary = results.table("history"), summary_of(results)
    failed = table["converged"] == 0
    assert failed.sum() == summary["failed_attempts"] > 0
    assert (~failed).sum() == summary["steps"] > 3
    assert list(table["step"][~failed]) == list(range(1, summary["steps"] + 1))
    # An attempt that failed would have led further than the step that follows it.
    for index in np.flatnonzero(failed):
        assert table["time"][index] > table["time"][index + 1]
        assert table["step"][index] == table["step"][index + 1]
    for name in ("base_ry", "strain_energy", "load_factor"):
        assert np.isnan(table[name][failed]).all()
    assert all(np.isfinite(values[~failed]).all() for values in table.values())
    # Files are written for the steps of the deck, and the last one is at the end.
    assert [when for when, _ in results.series("points")] == [0, 1 / 3, 2 / 3, 1]
    assert (results.table("convergence")["iteration"] == 0).sum() == len(failed)


def test_a_run_that_cannot_go_on_says_why(mpm, tmp_path):
    deck, out = tmp_path / "strip.yaml", tmp_path / "out"
    deck.write_text(STRIP)
    process = mpm("run", deck, "--out", out)
    assert process.returncode == 1
    results = Results(out)
    history, diagnosis = results.history, summary_of(results)["diagnosis"]
    assert summary_of(results)["outcome"] == "failed" and diagnosis["kind"] == "plastic-collapse"
    assert diagnosis["largest_load_factor"] == history["load_factor"].max()
    assert diagnosis["time"] == history["time"][-1]
    assert 1 < 2 * diagnosis["largest_load_factor"] < 4 / 3.5
    assert "diagnosis: plastic collapse" in process.stderr and "largest load factor" in process.stderr

    # The last state in equilibrium is in the series; where the iterations ended is in none.
    named = {path.name for name in ("points", "domains", "grid") for _, path in results.series(name)}
    assert not any(name.startswith("failed") for name in named)
    last = int(history["step"][-1])
    assert f"points_{last:04}.vtu" in named
    points, grid = pyvista.read(out / "failed_points.vtu"), pyvista.read(out / "failed_grid.vtu")
    assert (points["in_equilibrium"] == 0).all() and (grid["in_equilibrium"] == 0).all()
    before = pyvista.read(out / f"points_{last:04}.vtu")
    np.testing.assert_allclose(points.points, before.points + points["displacement_increment"], atol=1e-12)
    force = np.linalg.norm(grid["out_of_balance_force"], axis=1)
    assert np.allclose(grid.points[force.argmax()][:2], diagnosis["node"])
    assert len(meshio.read(out / "failed_points.vtu").points) == points.n_points

    # A later run into the same directory leaves nothing of it.
    deck.write_text(STRIP.replace("-707.1", "-100"))
    assert mpm("run", deck, "--out", out).returncode == 0
    assert not (out / "failed_points.vtu").exists() and not (out / "failed_grid.vtu").exists()


def test_a_path_goes_on_after_an_interruption(program, mpm, tmp_path):
    """Ctrl-C in the middle of an analysis with an unknown load factor, then `--resume`: the same tables."""
    text = (ROOT / "inputs/arch.yaml").read_text().partition("\n")[2]
    deck = tmp_path / "arch.yaml"
    deck.write_text(text.replace("output: {", "checkpoint: {every: 5}\noutput: {"))
    options = settings(steps=40, every=20)
    assert mpm("run", deck, "--out", tmp_path / "whole", *options).returncode == 0
    parts = tmp_path / "parts"
    process = subprocess.Popen(
        [program, "run", deck, "--out", parts, *options], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    while not (parts / "checkpoint_0010.mpm").exists() and process.poll() is None:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) == 130
    assert mpm("run", deck, "--out", parts, *options, "--resume").returncode == 0
    for name in ("history.csv", "convergence.csv", "quality.csv", "points.pvd", "points_0040.vtu"):
        assert (tmp_path / "whole" / name).read_bytes() == (parts / name).read_bytes(), name


@pytest.mark.parametrize("smallest, code", [(1, 1), (0.25, 0)])
def test_the_smallest_step_is_respected(mpm, tmp_path, smallest, code):
    text = (ROOT / "inputs/collapse.yaml").read_text().partition("\n")[2]
    deck, out = tmp_path / "deck.yaml", tmp_path / "out"
    deck.write_text(text.replace('steps: {count: "${steps}"}', f'steps: {{count: "${{steps}}", smallest: {smallest}}}'))
    assert mpm("run", deck, "--out", out, *settings(**COLLAPSE)).returncode == code
    times = np.concatenate([[0], Results(out).history["time"]])
    assert np.diff(times).min() >= smallest / 3 - 1e-12
