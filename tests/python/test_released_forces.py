"""Forces that a stage releases follow the material that carries them: stresses stay smooth while bodies move."""

import signal
import subprocess
import time

import numpy as np
import pytest

from results import Results

METHODS = ("gimp", "cpdi1", "cpdi2")

# The floor of the pit heaves by 0.7 of a cell. `low` and `up` carry the stress of their weight, with k0 of elasticity.
PIT = """
version: 1
analysis: {idealisation: plane-strain}
grid: {type: structured, origin: [0, 0], size: [0.5, 8.5], spacing: 0.25}
materials: {ground: {model: hencky, young: 60, poisson: 0.3, density: 1}}
bodies:
  - {name: low, material: ground, method: METHOD, shape: {type: box, min: [0, 0], max: [0.5, 5]}, points_per_cell: PPC,
     initial_stress: {type: geostatic, surface: 8, k0: 0.6}}
  - {name: up, material: ground, method: METHOD, shape: {type: box, min: [0, 5], max: [0.5, 8]}, points_per_cell: PPC,
     initial_stress: {type: geostatic, surface: 8, k0: 0.6}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 0.5}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
loads: [{name: weight, type: gravity, acceleration: [0, -1]}]
stages:
  - {name: rest, steps: {count: 1}}
  - {name: dig, steps: {count: 10}, remove: [up]}
"""

# A bar is pulled by 20 % in one step and let go in eight.
BAR = """
version: 1
analysis: {idealisation: plane-strain}
grid: {type: structured, origin: [0, 0], size: [2, 1], spacing: 0.25}
materials: {steel: {model: hencky, young: 1000, poisson: 0}}
bodies: [{name: bar, material: steel, method: METHOD, shape: {type: box, min: [0, 0], max: [1, 0.5]}, SPLIT
    points_per_cell: 2}]
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
  - {name: pull, nodes: {x: 1}, ux: 0.2}
stages:
  - {name: pull, steps: {count: 1}, factors: {pull: 1}}
  - {name: free, steps: {count: 8}, release: [pull]}
output: {every: 1}
"""

# A heavy lift is added to ground that it compresses by more than a cell.
LIFT = """
version: 1
analysis: {idealisation: plane-strain}
grid: {type: structured, origin: [0, 0], size: [0.5, 8], spacing: 0.25}
materials:
  ground: {model: hencky, young: 60, poisson: 0, density: 0}
  fill: {model: hencky, young: 600, poisson: 0, density: 2}
bodies:
  - {name: ground, material: ground, method: METHOD, shape: {type: box, min: [0, 0], max: [0.5, 5]}, points_per_cell: 2}
  - {name: lift, material: fill, method: METHOD, shape: {type: box, min: [0, 5], max: [0.5, 6]}, points_per_cell: 2}
boundary_conditions:
  - {name: sides, nodes: {box: {min: [0, 0], max: [0.5, 8]}}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
loads: [{name: weight, type: gravity, acceleration: [0, -5]}]
stages:
  - {name: rest, steps: {count: 1}, factors: {weight: 1}}
  - {name: fill, steps: {count: 10}, add: [lift]}
output: {every: 1}
"""


@pytest.fixture
def run(mpm, tmp_path):
    def run(text, *arguments, out="out", status=0):
        path = tmp_path / "deck.yaml"
        path.write_text(text)
        process = mpm("run", path, "--out", tmp_path / out, *arguments)
        assert process.returncode == status, process.stderr
        return Results(tmp_path / out)

    return run


def column(results, number=-1):
    """Heights and vertical stresses of the points of the first column, from the top down."""
    mesh = results.mesh("points", number)
    x, stress = np.asarray(mesh.points), np.asarray(mesh["cauchy_stress"])
    first = x[:, 0] < x[:, 0].min() + 1e-3
    order = np.argsort(-x[first, 1])
    return x[first][order, 1], stress[first][order, 1]


@pytest.mark.parametrize("points", (2, 3, 4))
@pytest.mark.parametrize("method", METHODS)
def test_stress_below_a_heaving_floor_is_that_of_the_weight(run, method, points):
    results = run(PIT.replace("METHOD", method).replace("PPC", str(points)))
    y, stress = column(results)
    depth = (np.arange(len(y)) + 0.5) * 0.25 / points
    assert y[0] - 5 > 0.05
    # Below nodes that do not follow the floor, the error is 0.2 of the overburden of 3.
    assert np.abs(stress + depth).max() < (0.02 if method == "gimp" else 0.004)


@pytest.mark.parametrize("method", METHODS)
def test_a_bar_let_go_is_in_uniform_stress(run, method):
    results = run(BAR.replace("METHOD", method).replace("SPLIT", ""))
    for step in range(1, 10):
        stress = np.asarray(results.mesh("points", step)["cauchy_stress"])[:, 0]
        assert np.ptp(stress) < 1e-6
    assert np.abs(stress).max() < 1e-6


def test_halves_of_split_domains_share_released_forces(run):
    text = BAR.replace("METHOD", "cpdi2").replace("ux: 0.2", "ux: 0.4")
    results = run(text.replace("SPLIT", "split_above: 0.6,"))
    assert results.mesh("points", 2).n_points > results.mesh("points", 0).n_points
    for step in range(2, 10):
        stress = np.asarray(results.mesh("points", step)["cauchy_stress"])[:, 0]
        assert np.ptp(stress) < 1e-6


@pytest.mark.parametrize("method", METHODS)
def test_weight_of_a_lift_grows_where_the_lift_is(run, method):
    results = run(LIFT.replace("METHOD", method))
    for step in range(2, 12):
        y, stress = column(results, step)
        share = (step - 1) / 10
        # The lift of 1 by a weight of 10 stands on ground without weight.
        below = stress[y < y[0] - 1.5]
        assert np.abs(below + 10 * share).max() < 0.02 * 10, step
    assert 6 - y[0] > 0.25


def test_an_interrupted_release_goes_on_with_the_same_bits(mpm, program, tmp_path):
    deck = tmp_path / "deck.yaml"
    text = PIT.replace("METHOD", "cpdi2").replace("PPC", "4").replace("count: 10", "count: 300")
    deck.write_text(text + "output: {every: 1}\ncheckpoint: {every: 7}\n")
    assert mpm("run", deck, "--out", tmp_path / "whole").returncode == 0
    directory = tmp_path / "stopped"
    process = subprocess.Popen([program, "run", deck, "--out", directory], stderr=subprocess.PIPE, text=True)
    while not (directory / "points_0020.vtu").exists():
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.002)
    process.send_signal(signal.SIGTERM)
    process.communicate()
    assert process.returncode == 130
    assert mpm("run", deck, "--out", directory, "--resume").returncode == 0
    for name in ("history.csv", "points_0301.vtu"):
        assert (tmp_path / "whole" / name).read_bytes() == (directory / name).read_bytes()
