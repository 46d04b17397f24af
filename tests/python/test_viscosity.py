"""Steps that only viscosity solves: runs of driven sand go on, say so, and account for the work."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from results import Results

PAGE = Path(__file__).parents[2] / "docs" / "errors" / "W024.md"
SAND = "version: 1\n" + re.search(r"```yaml\n(.*?)```", PAGE.read_text(), re.DOTALL)[1] + "output: {every: 0}\n"


def run(mpm, directory, deck, *options):
    path = directory.with_suffix(".yaml")
    path.write_text(deck)
    done = mpm("run", path, "--out", directory, *options)
    return done, json.loads((directory / "summary.json").read_text())


def test_sand_without_cohesion_goes_on_and_says_so(mpm, tmp_path):
    done, summary = run(mpm, tmp_path / "with", SAND)
    assert done.returncode == 0 and summary["outcome"] == "completed"
    (warning,) = [warning for warning in summary["warnings"] if warning["code"] == "W024"]
    assert 0 < warning["value"] <= summary["quality"]["overstress"]["value"] < 0.05
    assert 1 <= summary["viscous_steps"] < summary["steps"] < 3 * summary["steps_requested"]
    (viscous,) = [energy for energy in summary["energies"] if energy["name"] == "viscous"]
    assert viscous["role"] == "dissipated" and 0 < viscous["energy"] < 0.05 * summary["plastic_work"]
    history = Results(tmp_path / "with").history
    assert np.all(history["residual"][history["converged"] == 1] <= 1e-9)


def test_without_viscosity_the_run_stops(mpm, tmp_path):
    done, summary = run(mpm, tmp_path / "without", SAND.replace("{count: 10}", "{count: 10, viscosity: 0}"))
    assert done.returncode == 1 and summary["viscous_steps"] == 0
    assert summary["quality"]["overstress"] is None
    assert "W024" not in done.stderr


def test_the_overstress_falls_with_the_relaxation_time(mpm, tmp_path):
    found = {}
    for viscosity in (0.01, 0.04):
        deck = SAND.replace("{count: 10}", f"{{count: 10, viscosity: {viscosity}}}")
        _, summary = run(mpm, tmp_path / str(viscosity), deck)
        assert summary["outcome"] == "completed"
        found[viscosity] = summary["quality"]["overstress"]["value"]
    # Less than in proportion: the relaxation time shrinks where viscosity takes more than 1 % of the work.
    assert found[0.01] < 0.9 * found[0.04], found


def test_bodies_that_loads_push_have_no_viscosity(mpm, tmp_path):
    deck = SAND.replace(", ux: 0, uy: -0.3}", ", fix: [x]}")
    push = '  - {name: push, type: traction, surface: lid, traction: [0, -2e6]}\n'
    deck = deck.replace("steps:", push + "steps:").replace(
        "loads:", "surfaces:\n  - {name: lid, body: ground, part: {box: {min: [-0.1, 2.9], max: [1, 3.1]}}}\nloads:"
    )
    done, summary = run(mpm, tmp_path / "loads", deck)
    assert done.returncode == 1 and summary["viscous_steps"] == 0
    assert summary["diagnosis"]["kind"] == "plastic-collapse"


def test_a_resumed_run_has_the_same_bits(mpm, tmp_path):
    run(mpm, tmp_path / "whole", SAND)
    deck = SAND.replace("output: {every: 0}", "checkpoint: {every: 23}\noutput: {every: 0}")
    run(mpm, tmp_path / "parts", deck)
    whole, parts = ((tmp_path / name / "history.csv").read_bytes() for name in ("whole", "parts"))
    assert whole == parts
    # The state of step 23, with viscosity in use, leads to the same end.
    first, *later = sorted((tmp_path / "parts").glob("checkpoint_*.mpm"))
    for state in later:
        state.unlink()
    done = mpm("run", tmp_path / "parts.yaml", "--out", tmp_path / "parts", "--resume")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "parts" / "history.csv").read_bytes() == whole


@pytest.mark.parametrize("value, code", [("-1", "D"), ("2", "D"), ("soon", "D")])
def test_a_relaxation_time_out_of_range_is_refused(mpm, tmp_path, value, code):
    path = tmp_path / "deck.yaml"
    path.write_text(SAND.replace("{count: 10}", f"{{count: 10, viscosity: {value}}}"))
    done = mpm("check", path)
    assert done.returncode == 2 and f"error[{code}" in done.stderr and "viscosity" in done.stderr
