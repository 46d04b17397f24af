"""Limit loads: stages that end at the plateau, and cells that shrink towards the edge of a footing."""

import csv
import json
import math

import pytest

from conftest import ROOT

BEARING = (ROOT / "inputs/bearing.yaml").read_text()
LIMIT = BEARING.replace('steps: {count: "${steps}"}', 'steps: {count: "${steps}", until: limit}')
LONG = ["--set", "settlement=0.03", "--set", "steps=60"]


def prandtl():
    """The exact load on the half footing, [force]."""
    angle = math.radians(20)
    n_q = math.tan(math.pi / 4 + angle / 2) ** 2 * math.exp(math.pi * math.tan(angle))
    return (n_q - 1) / math.tan(angle) * 10e3


@pytest.fixture
def run(mpm, tmp_path):
    """Runs a deck; summary, history and what the screen shows."""

    def run(text, *arguments):
        (tmp_path / "deck.yaml").write_text(text)
        process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out", *arguments)
        assert process.returncode == 0, process.stderr
        with open(tmp_path / "out" / "history.csv", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["converged"] == "1"]
        return json.loads((tmp_path / "out" / "summary.json").read_text()), rows, process.stdout + process.stderr

    return run


def test_a_footing_stops_at_its_limit(run, mpm, tmp_path):
    assert LIMIT != BEARING
    summary, rows, screen = run(LIMIT, *LONG)
    (limit,) = summary["limit_loads"]
    loads = [-float(row["footing_ry"]) for row in rows]
    assert limit["reached"] and limit["kind"] == "force" and limit["stage"] is None
    assert summary["outcome"] == "completed" and len(rows) < 40, len(rows)
    assert limit["load"] == pytest.approx(max(loads), rel=1e-9)
    assert limit["bracket"][0] == pytest.approx(loads[-1], rel=1e-9) and limit["bracket"][1] >= limit["load"]
    assert limit["displacement"] == pytest.approx(0.03 / 60 * len(rows), rel=1e-9)
    steps = 0.03 / 60
    slopes = [(b - a) / steps for a, b in zip([0, *loads], loads)]
    # What the first step carries is no rise: a stage may begin under load.
    slopes = slopes[1:]
    assert limit["steepest_slope"] == pytest.approx(max(slopes), rel=1e-9)
    assert all(slope < 0.01 * max(slopes) for slope in slopes[-2:])
    assert not all(slope < 0.01 * max(slopes) for slope in slopes[-3:])
    assert limit["load"] == pytest.approx(1.05 * prandtl(), rel=0.01)
    assert "limit load" in screen
    report = mpm("report", tmp_path / "out")
    assert report.returncode == 0 and "Limit load" in (tmp_path / "out" / "report.html").read_text()


def test_a_load_that_still_grows_is_no_limit(run):
    summary, rows, screen = run(LIMIT, "--set", "settlement=0.003", "--set", "steps=6")
    (limit,) = summary["limit_loads"]
    assert not limit["reached"] and len(rows) == 6
    assert "not reached: the load still grew at the end" in screen


# Sand without cohesion, whose weight alone gives it strength: large steps need viscosity.
SAND = """
version: 1
parameters: {to: 0.001}
grid: {type: structured, origin: [0, 0], size: [8, 4.5], spacing: 0.25, refine: [{at: [1, 4], to: 0.0625}]}
materials:
  sand: {model: mohr-coulomb, young: 1e7, poisson: 0.3, cohesion: 0, friction_angle: 30, dilation_angle: 30, density: 2}
bodies:
  - {name: ground, material: sand, method: mpm, strain: mean, points_per_cell: 2,
     shape: {type: box, min: [0, 0], max: [8, 4]}, initial_stress: {type: geostatic, surface: 4, k0: 1}}
boundary_conditions:
  - {name: axis, nodes: {x: 0}, fix: [x]}
  - {name: side, nodes: {x: 8}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: footing, nodes: {box: {min: [0, 4], max: [1, 4]}}, fix: [x], uy: "${-to}"}
loads: [{name: weight, type: gravity, acceleration: [0, -10]}]
steps: {count: 40, until: limit}
solver: {predictor: last-step}
output: {every: 0}
"""


def test_viscosity_is_no_part_of_the_limit(run):
    """N_gamma of a rough strip is 14.754 (Martin 2005), and +11 % with 8 cells whose edges are four times smaller."""
    exact = 14.754 * 20
    small, _, _ = run(SAND)
    (limit,) = small["limit_loads"]
    assert limit["reached"] and 1.05 < limit["load"] / exact < 1.15, limit
    large, rows, screen = run(SAND, "--set", "to=0.01")
    assert large["viscous_steps"] > 0 and "too large" in screen
    (limit,) = large["limit_loads"]
    low, high = limit["bracket"]
    assert low < 1.2 * exact, limit
    # What viscosity carries is not in the load, but in the bracket.
    assert high > 1.02 * low


def test_the_load_factor_of_an_arch_peaks(run):
    """With arc-length control the load is the load factor; the arch snaps through at its peak."""
    deck = (ROOT / "inputs/arch.yaml").read_text()
    assert "steps: {" in deck
    whole, rows, _ = run(deck)
    factors = [float(row["load_factor"]) for row in rows]
    peak = next(k for k in range(len(factors)) if factors[k + 1] < factors[k])
    summary, rows, _ = run(deck.replace("steps: {", "steps: {until: limit, ", 1))
    (limit,) = summary["limit_loads"]
    assert limit["reached"] and limit["kind"] == "load-factor"
    assert limit["load"] == pytest.approx(factors[peak], rel=1e-12)
    assert peak < len(rows) - 1 <= peak + 3 and whole["steps"] > len(rows)


def test_a_tool_and_a_weak_condition_have_the_load_of_their_motion(run):
    """The load is the force along the motion, whatever imposes it."""
    deck = """
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 3], spacing: 0.5}
materials: {clay: {model: tresca, young: 1e6, poisson: 0.3, cohesion: 1e3}}
bodies: [{name: clay, material: clay, method: cpdi2, strain: mean, shape: {type: box, min: [0, 0], max: [2, 2]}, points_per_cell: 2}]
surfaces: [{name: top, body: clay, part: {box: {min: [0, 1.99], max: [2, 2.01]}}}]
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [y]}
  - {name: left, nodes: {x: 0}, fix: [x]}
MORE
steps: {count: 40, until: limit}
output: {every: 0}
"""
    weak = "  - {name: push, surface: top, move: {along: [0, -1], by: 0.02}}\n"
    tool = (
        "tools: [{name: plate, shape: {type: box, min: [-1, 2], max: [5, 2.5]}, uy: -0.02, "
        "friction: 0}]\n"
    )
    for text, column in ((weak, "push_ry"), (tool, "plate_fy")):
        summary, rows, _ = run(deck.replace("MORE\n", text))
        (limit,) = summary["limit_loads"]
        assert limit["reached"], limit
        forces = [abs(float(row[column])) for row in rows]
        assert limit["load"] == pytest.approx(max(forces), rel=1e-6), column
        # Plane strain: the block yields at 2 s_u.
        assert limit["load"] == pytest.approx(2 * 2 * 1e3, rel=0.02), column


# A drained compression test: a block under a cell pressure of 100 kPa is shortened until it fails.
TRIAXIAL = """
version: 1
parameters: {n: 1000, p: -1e5, to: -0.1}
grid: {type: structured, origin: [0, 0], size: [2, 3], spacing: 0.5}
materials: {soil: {model: mohr-coulomb, young: 1e7, poisson: 0.3, cohesion: 1e3, friction_angle: 30, dilation_angle: 30}}
bodies: [{name: b, material: soil, method: mpm, shape: {type: box, min: [0, 0], max: [1, 2]}, points_per_cell: 2,
  initial_stress: {type: components, stress: {xx: "${p}", yy: "${p}", zz: "${p}"}}}]
boundary_conditions:
  - {name: symmetry, nodes: {x: 0}, fix: [x]}
  - {name: bottom, nodes: {y: 0}, fix: [y]}
  - {name: top, nodes: {y: 2}, uy: "${to}", curve: [[0, 0], [0.5, 0.5], [1, LAST]]}
surfaces: [{name: flank, body: b, part: {edge: 1}}]
loads: [{name: cell, type: pressure, surface: flank, pressure: "${-p}", curve: [[0, 1], [1, 1]]}]
steps: {count: "${n}", until: limit}
output: {every: 0}
"""


def test_a_body_under_initial_stress_is_loaded_beyond_its_elastic_range(run):
    """The load at the start is no rise, however short the steps. The strength is 3 p + 2 sqrt(3) c; as the block widens,
    its load goes on growing."""
    for n in (100, 1000):
        summary, rows, _ = run(TRIAXIAL.replace("LAST", "1"), "--set", f"n={n}")
        (limit,) = summary["limit_loads"]
        assert not limit["reached"] and len(rows) == n
        assert limit["load"] > 3e5 + 2 * math.sqrt(3) * 1e3, n


def test_a_motion_that_turns_back_is_no_limit(run):
    """The block is loaded elastically and unloaded."""
    summary, rows, _ = run(TRIAXIAL.replace("LAST", "0"), "--set", "n=40", "--set", "to=-0.02")
    (limit,) = summary["limit_loads"]
    assert not limit["reached"] and len(rows) == 40


def test_a_body_that_meets_nothing_has_no_limit(run):
    """Forces at round-off are no load: the block falls short of the tool."""
    text = """
version: 1
grid: {type: structured, origin: [0, 0], size: [2, 4], spacing: 0.5}
materials: {clay: {model: tresca, young: 1e8, poisson: 0.3, cohesion: 1e4, density: 1800}}
bodies: [{name: b, material: clay, strain: mean, method: mpm, shape: {type: box, min: [0, 1], max: [1, 3]}, points_per_cell: 2}]
boundary_conditions:
  - {name: symmetry, nodes: {x: 0}, fix: [x]}
  - {name: top, nodes: {y: 3}, uy: -0.05, ux: 0}
tools: [{name: floor, shape: {type: half-space, point: [0, 0.9], normal: [0, 1]}, friction: 0}]
steps: {count: 50, until: limit}
output: {every: 0}
"""
    summary, rows, _ = run(text)
    (limit,) = summary["limit_loads"]
    assert not limit["reached"] and len(rows) == 50


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("ux: 0, uy: \"${-settlement}\"", "fix: [x, y]", "nothing is moved"),
        ("until: limit}", "until: limit, control: {type: strength-reduction, to: 2}}", "not a limit load"),
        ("until: limit}", "until: limits}", "until"),
    ],
)
def test_faulty_limits_are_refused(mpm, tmp_path, old, new, message):
    assert old in LIMIT
    (tmp_path / "deck.yaml").write_text(LIMIT.replace(old, new))
    process = mpm("check", tmp_path / "deck.yaml")
    assert process.returncode == 2 and message in process.stderr, process.stderr


def test_cells_that_shrink_towards_the_edge_carry_less_excess(run):
    """With cells of 1/16 m at the edge, the load is nearer to Prandtl's than with cells of 1/8 m everywhere (+2.2 %)."""
    summary, rows, _ = run(LIMIT, *LONG, "--set", "edge=0.0625")
    (limit,) = summary["limit_loads"]
    assert limit["reached"] and summary["points"] == 3840
    assert 0 < limit["load"] / prandtl() - 1 < 0.02


def test_places_without_effect_leave_the_grid_as_it_is(run):
    plain = BEARING.replace(', refine: [{at: [1, 4], to: "${edge}"}]', "").replace('edge: "${h}"', "edge: 1")
    assert plain != BEARING
    loads = [[row["footing_ry"] for row in run(text, "--set", "steps=4")[1]] for text in (BEARING, plain)]
    assert loads[0] == loads[1]


@pytest.mark.parametrize(
    "refine, message",
    [
        ('{at: [11, 4], to: 0.1}', "x = 11 lies outside the grid"),
        ('{at: [1], to: 0.1}', "2"),
        ('{at: [1, 4], to: 0.5}', "cells of 0.5 are larger than the spacing 0.25 along x"),
        ('{at: [1, 4], to: 0}', "to"),
    ],
)
def test_faulty_places_are_refused(mpm, tmp_path, refine, message):
    text = BEARING.replace('{at: [1, 4], to: "${edge}"}', refine).replace('edge: "${h}"', "edge: 1")
    (tmp_path / "deck.yaml").write_text(text)
    process = mpm("check", tmp_path / "deck.yaml")
    assert process.returncode == 2 and message in process.stderr, process.stderr
