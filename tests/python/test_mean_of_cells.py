"""Bearing capacities of soil whose flow dilates, with the mean increment of cells, beside Prandtl's solution."""

import csv
import json
import math

import pytest

PHI = 30.0  # degrees

# Half of a rough, rigid strip, 2 wide, on weightless soil under a surcharge of 10. Nodes up to
# x = `held` are held: the edge of the footing lies on a node or, half a cell further, in the middle of a cell.
STRIP = """
version: 1
parameters: {cells: 4, across: 40, down: 20, held: 1, strain: mean, method: mpm, n: 2}
analysis: {initial_imbalance: equilibrate}
grid: {type: structured, origin: [0, 0], size: ["${across/cells}", "${(down+2)/cells}"], spacing: "${1/cells}"}
materials:
  sand: {model: mohr-coulomb, young: 1e7, poisson: 0.3, cohesion: 0.01, friction_angle: PHI, dilation_angle: PHI}
bodies:
  - name: ground
    material: sand
    method: "${method}"
    strain: "${strain}"
    shape: {type: box, min: [0, 0], max: ["${across/cells}", "${down/cells}"]}
    points_per_cell: "${n}"
    initial_stress: {type: components, stress: {xx: -10, yy: -10, zz: -10}}
surfaces:
  - {name: top, body: ground, part: {box: {min: [1, "${(down-0.001)/cells}"], max: ["${across/cells}", "${(down+0.001)/cells}"]}}}
boundary_conditions:
  - {name: symmetry, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: "${across/cells}"}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: footing, nodes: {box: {min: [0, "${down/cells}"], max: ["${held+1e-6}", "${down/cells}"]}}, ux: 0, uy: -0.001}
loads:
  - {name: surcharge, type: traction, surface: top, traction: [0, -10], curve: [[0, 1], [1, 1]]}
solver: {predictor: last-step, max_iterations: 40}
steps: {count: 20}
output: {every: 0}
""".replace("PHI", str(PHI))


def factor():
    """N_q, and what the cohesion adds to it: c N_c/q."""
    slope = math.tan(math.radians(PHI))
    n_q = math.exp(math.pi * slope) * math.tan(math.radians(45 + PHI / 2)) ** 2
    return n_q + 0.01 / 10 * (n_q - 1) / slope


@pytest.fixture(scope="module")
def found(mpm, tmp_path_factory):
    """The load at the end of a run over the exact one, and the relative rise of the load over the last quarter."""

    def run(**parameters):
        folder = tmp_path_factory.mktemp("strip")
        (folder / "strip.yaml").write_text(STRIP)
        words = [word for name, value in parameters.items() for word in ("--set", f"{name}={value}")]
        process = mpm("run", folder / "strip.yaml", "--out", folder / "out", *words)
        assert process.returncode == 0, process.stderr
        with open(folder / "out" / "history.csv", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["converged"] == "1"]
        load = {float(row["time"]): -float(row["footing_ry"]) / 10 for row in rows}
        summary = json.loads((folder / "out" / "summary.json").read_text())
        before = [value for time, value in load.items() if time <= 0.75][-1]
        return load[1.0] / factor() - 1, load[1.0] / before - 1, summary

    return run


def test_the_footing_has_its_capacity(found):
    """With the edge on a node, a footing of held nodes acts wider than it is; in the middle of a cell, narrower."""
    on_node, rise, _ = found()
    in_cell, _, _ = found(cells=4.5, held=4 / 4.5)
    print(f"edge on a node {on_node:+.3f}, in the middle of a cell {in_cell:+.3f}, rise {rise:.1e}")
    assert 0 < on_node < 0.06 and -0.08 < in_cell < 0
    assert abs(0.5 * (on_node + in_cell)) < 0.02
    assert rise < 0.001


def test_the_error_of_the_capacity_halves_with_the_cells(found):
    assert found(cells=8, across=80, down=40)[0] < 0.6 * found()[0]


@pytest.mark.parametrize("strain, least", [("standard", 0.4), ("mean-dilatation", 0.25)])
def test_other_deformations_of_cells_lock(found, strain, least):
    error, rise, _ = found(strain=strain)
    assert error > least and rise > 0.005


@pytest.mark.parametrize("method, n", [("gimp", 2), ("cpdi2", 2), ("mpm", 3)])
def test_the_capacity_is_that_of_any_method(found, method, n):
    assert 0 < found(method=method, n=n)[0] < 0.1


def test_deviations_dissipate_what_they_do_not_store(found):
    summary = found()[2]
    energy = {entry["role"]: entry["energy"] for entry in summary["energies"]}
    assert energy["dissipated"] > 0 and energy["stored"] >= 0
    # Flow takes the stress away as it grows, so little of its energy is left.
    assert energy["stored"] < energy["dissipated"] < 0.2 * summary["external_work"]
    # The trapezoidal rule of the first steps, in which the load rises most, is the only error.
    errors = [run["balance_errors"]["energy"]["value"] for run in (summary, found(strain="mean-dilatation")[2])]
    assert errors[0] < errors[1] < 0.2


def test_many_points_take_the_mean_of_their_cells(mpm, tmp_path):
    """Data of the step are freed early in large analyses, but not what its end needs. An elastic column under its weight
    gives the exact load whatever the number of points."""
    deck = tmp_path / "column.yaml"
    deck.write_text("""
version: 1
grid: {type: structured, origin: [0, 0], size: [100, 125], spacing: 1}
materials: {rock: {model: hencky, young: 1e9, poisson: 0.3, density: 2000}}
bodies:
  - {name: rock, material: rock, method: mpm, strain: mean, shape: {type: box, min: [0, 0], max: [100, 120]}, points_per_cell: 2}
boundary_conditions: [{name: floor, nodes: {y: 0}, fix: [x, y]}]
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
steps: {count: 2}
output: {every: 0}
""")
    process = mpm("run", deck, "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["points"] == 48000
    with open(tmp_path / "out" / "history.csv", newline="") as file:
        last = list(csv.DictReader(file))[-1]
    assert float(last["floor_ry"]) == pytest.approx(100 * 120 * 2000 * 10, rel=1e-8)


# A slope of 45 degrees whose factor of safety is 1 (Dawson, Roth and Drescher 1999).
SLOPE = """
version: 1
parameters: {steps: 10}
grid: {type: structured, origin: [0, 0], size: [40, 17], spacing: 1}
materials:
  soil: {model: mohr-coulomb, young: 1e5, poisson: 0.3, cohesion: 12.38, friction_angle: 20, dilation_angle: 20, density: 2}
bodies:
  - {name: slope, material: soil, method: cpdi2, strain: mean, points_per_cell: 2,
     shape: {type: polygon, vertices: [[0, 0], [40, 0], [40, 5], [30, 5], [20, 15], [0, 15]]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: 40}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
stages:
  - {name: gravity, steps: {count: 5}, factors: {weight: 1}, then: {reset: [displacement]}}
  - {name: safety, steps: {count: "${steps}", control: {type: strength-reduction, from: 0.8, to: 1.5, tolerance: 0.005}}}
output: {every: 0}
"""


def test_a_factor_of_safety_does_not_depend_on_the_steps_of_the_search(mpm, tmp_path):
    """Soil that begins to flow in a large step must not carry more than its strength to the end of the step."""
    factors = []
    for steps in (10, 80):
        (tmp_path / "slope.yaml").write_text(SLOPE)
        process = mpm("run", tmp_path / "slope.yaml", "--out", tmp_path / "out", "--set", f"steps={steps}")
        assert process.returncode == 0, process.stderr
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        factors.append(sum(summary["strength_reduction"]["slides"]) / 2)
    assert abs(factors[0] - factors[1]) < 0.01, factors
    assert 1.0 < factors[0] < 1.08, factors


def test_cells_that_lock_in_dilating_flow_are_seen(mpm, tmp_path):
    (tmp_path / "strip.yaml").write_text(STRIP)
    for strain, locks in [("standard", True), ("mean-dilatation", True), ("mean", False)]:
        process = mpm("run", tmp_path / "strip.yaml", "--out", tmp_path / "out", "--set", f"strain={strain}")
        assert process.returncode == 0, process.stderr
        summary = json.loads((tmp_path / "out" / "summary.json").read_text())
        found = [warning for warning in summary["warnings"] if warning["code"] == "W012"]
        assert bool(found) == locks, strain
        for warning in found:
            assert "flow that dilates" in warning["message"] and "`strain: mean`" in warning["help"]
