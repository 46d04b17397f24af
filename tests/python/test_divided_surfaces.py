"""Surfaces follow the cuts of domains: a uniform stress stays in equilibrium with what acts on the sides of the halves.

A block is stretched until its domains are cut in two. The loads and weak conditions on its surfaces then act on the sides
of the halves. With the sides of the whole domains, the stress is off by 11 to 18 %.
"""

import re
import signal
import subprocess
import time

import numpy as np
import pytest

from results import Results

# The right side is pulled, so that the sides of domains at the base and at the top are cut.
BLOCK = """
version: 1
analysis: {idealisation: IDEALISATION}
grid: {type: structured, origin: [0, -0.5], size: [2.5, 2.5], spacing: 0.25}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies:
  - {name: b, material: m, shape: {type: box, min: [0, 0], max: [1, 1]}, method: cpdi2, points_per_cell: 2, split_above: LONG}
surfaces:
  - {name: base, body: b, part: {edge: 0}}
  - {name: side, body: b, part: {edge: 1}}
  - {name: top, body: b, part: {edge: 2}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: roller, surface: base, fix: normal}
  - {name: pull, surface: side, ux: MOTION}
loads: [LOAD]
steps: {count: 16}
output: {every: 1}
"""

SOLID = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, -0.5], size: [2.5, 1.5, 2], spacing: 0.5}
materials: {m: {model: neo-hookean, young: 1000, poisson: 0.3}}
bodies:
  - {name: b, material: m, shape: {type: box, min: [0, 0, 0], max: [1, 1, 1]}, method: cpdi2, points_per_cell: 2, split_above: LONG}
surfaces:
  - {name: base, body: b, part: {box: {min: [0, 0, 0], max: [1, 1, 0]}}}
  - {name: side, body: b, part: {box: {min: [1, 0, 0], max: [1, 1, 1]}}}
  - {name: top, body: b, part: {box: {min: [0, 0, 1], max: [1, 1, 1]}}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: front, nodes: {y: 0}, fix: [y]}
  - {name: roller, surface: base, fix: normal}
  - {name: pull, surface: side, ux: MOTION}
loads: [LOAD]
steps: {count: 8}
output: {every: 1}
"""

LOADS = {
    "follows": "{name: p, type: pressure, surface: top, pressure: 150}",
    "water": "{name: p, type: pressure, surface: top, hydrostatic: {level: 1e12, unit_weight: 15e-11}}",
    "dead": "{name: p, type: pressure, surface: top, pressure: 100, follows: false}",
    "traction": "{name: p, type: traction, surface: top, traction: [DOWN]}",
}


# Conditions on the top, whose linear displacement they prescribe, or which they begin to hold between two cuts.
GLIDE = '  - {name: glide, surface: top, ux: "0.7*X"}\n'
LID = "  - {name: lid, surface: top, fix: normal}\n"
STAGES = """stages:
  - {name: first, steps: {count: 8}, factors: {pull: 0.5, p: 1}}
  - {name: held, steps: {count: 8}, factors: {pull: 1, p: 1}, set: [lid]}
"""


def deck(kind, load="follows", longest=0.7, motion=0.7):
    text = SOLID if kind == "solid" else BLOCK.replace("IDEALISATION", kind)
    text = text.replace("LOAD", LOADS[load]).replace("DOWN", "0, 0, -100" if kind == "solid" else "0, -100")
    return text.replace("LONG", str(longest)).replace("MOTION", str(motion))


@pytest.fixture
def run(mpm, tmp_path):
    def run(text, out="out", *arguments):
        (tmp_path / "deck.yaml").write_text(text)
        process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / out, *arguments)
        assert process.returncode == 0, process.stderr
        return Results(tmp_path / out)

    return run


def scatter(results):
    """The largest deviation of the stress of a point from the mean in any step, relative to the largest stress."""
    stresses = [np.asarray(results.mesh("points", step)["cauchy_stress"]) for step in range(1, results.summary["steps"] + 1)]
    largest = max(np.abs(stress).max() for stress in stresses)
    assert largest > 100
    return max(np.abs(stress - stress.mean(axis=0)).max() for stress in stresses) / largest


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("kind", ["plane-strain", "axisymmetric", "solid"])
def test_halves_balance_a_uniform_stress(run, kind, load):
    results = run(deck(kind, load))
    assert results.mesh("points", -1).n_points >= 2 * results.mesh("points", 0).n_points
    assert scatter(results) < 1e-9


@pytest.mark.parametrize("kind", ["plane-strain", "solid"])
def test_halves_are_cut_again(run, kind):
    """Until each side at the top consists of four or more."""
    results = run(deck(kind, longest=0.55, motion=1.3))
    assert results.mesh("points", -1).n_points >= 4 * results.mesh("points", 0).n_points
    assert scatter(results) < 1e-9


@pytest.mark.parametrize("kind", ["plane-strain", "axisymmetric", "solid"])
def test_a_divided_surface_glides(run, kind):
    results = run(deck(kind).replace("loads:", GLIDE + "loads:"))
    assert results.mesh("points", -1).n_points >= 2 * results.mesh("points", 0).n_points
    assert scatter(results) < 1e-9


@pytest.mark.parametrize("kind", ["plane-strain", "solid"])
def test_a_divided_surface_is_held(run, kind):
    text = deck(kind, longest=0.55, motion=1.3).replace("loads:", LID + "loads:")
    results = run(re.sub("steps: .*\n", STAGES, text))
    counts = [results.mesh("points", step).n_points for step in (0, 8, 16)]
    assert counts[0] < counts[1] < counts[2]
    assert scatter(results) < 1e-9
    tops = [np.asarray(mesh["surface"]) == 2 for mesh in (results.mesh("surfaces", step) for step in (8, 16))]
    heights = [np.asarray(results.mesh("surfaces", step).points)[top] for step, top in zip((8, 16), tops)]
    axis = 2 if kind == "solid" else 1
    assert np.ptp(np.concatenate([height[:, axis] for height in heights])) < 1e-8


def test_samples_are_the_sides_of_the_halves(run):
    results = run(deck("plane-strain"))
    tops = [np.asarray(results.mesh("surfaces", step)["surface"]) == 2 for step in (0, -1)]
    assert tops[0].sum() == 8 and tops[1].sum() == 16
    last = results.mesh("surfaces", -1)
    area, traction = np.asarray(last["area"])[tops[1]], np.asarray(last["traction"])[tops[1]]
    assert area.sum() == pytest.approx(1.7, rel=1e-9) and np.ptp(area) < 1e-9
    assert np.abs(traction - [0, -150, 0]).max() < 1e-6


def test_an_interrupted_run_goes_on_with_the_same_bits(run, program, tmp_path):
    text = deck("plane-strain").replace("count: 16", "count: 300") + "checkpoint: {every: 7}\n"
    whole = run(text, "whole")
    first = next(step for step in range(1, 301) if whole.mesh("points", step).n_points > 64)
    directory = tmp_path / "stopped"
    process = subprocess.Popen(
        [program, "run", tmp_path / "deck.yaml", "--out", directory], stderr=subprocess.PIPE, text=True
    )
    while not (directory / f"points_{first + 10:04}.vtu").exists():
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.002)
    process.send_signal(signal.SIGTERM)
    process.communicate()
    assert process.returncode == 130
    run(text, "stopped", "--resume")
    for name in ("history.csv", "points_0300.vtu", "surfaces_0300.vtu"):
        assert (tmp_path / "whole" / name).read_bytes() == (directory / name).read_bytes()
