"""Experiments with the step at which a run stops, and steps that an early line search saves."""

import csv
import json

import pytest

STRIP = """\
version: 1
title: A strip of clay hangs from a ceiling, and weighs more than it carries
grid: {type: structured, origin: [0, -2], size: [2, 6], spacing: 0.25}
materials:
  clay: {model: von-mises, young: 1e6, poisson: 0.3, deviatoric_yield_stress: 1e3, density: 20}
bodies:
  - {name: strip, material: clay, shape: {type: box, min: [0, 0], max: [1, 4]}, points_per_cell: 1}
boundary_conditions:
  - {name: ceiling, nodes: {y: 4}, fix: [y]}
  - {name: symmetry, nodes: {x: 0}, fix: [x]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -35]}
steps: {count: 10}
output: {every: 0}
"""

BLOCK = """\
version: 1
title: A block on a rough plane that is tilted until it slides
grid: {type: structured, origin: [0, 0], size: [6, 3], spacing: 0.5}
materials:
  soft: {model: hencky, young: 1e6, poisson: 0.2, density: 2000}
bodies:
  - {name: block, material: soft, method: cpdi2, points_per_cell: 2, shape: {type: box, min: [1, 1], max: [3, 2]}}
loads:
  - name: weight
    type: body-force
    per: mass
    force: ["9.81*min(1, 10*factor)*sin(pi/6*max(0, factor-0.1)/0.9)",
            "-9.81*min(1, 10*factor)*cos(pi/6*max(0, factor-0.1)/0.9)"]
tools:
  - {name: plane, shape: {type: half-space, point: [0, 1], normal: [0, 1]}, friction: 0.5}
steps: {count: 40}
output: {every: 0}
"""

WALL = """\
version: 1
title: A wall is pushed into clay
grid: {type: structured, origin: [0, 0], size: [7, 3.5], spacing: 0.25}
materials:
  soil: {model: von-mises, young: 13439800, poisson: 0.45, undrained_strength: 45100, density: 1800}
bodies:
  - name: soil
    material: soil
    initial_stress: {type: geostatic, surface: 2, k0: 1}
    points_per_cell: 2
    strain: mean-dilatation
    shape: {type: box, min: [0, 0], max: [6, 2]}
boundary_conditions:
  - {name: far, nodes: {x: 6}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
  - {name: wall, nodes: {x: 0}, ux: 0.193}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81]}
steps: {count: 20}
output: {every: 0}
"""


def stopped(mpm, tmp_path, text):
    """The diagnosis and the screen of a run that stops."""
    (tmp_path / "deck.yaml").write_text(text)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 1, process.stderr
    diagnosis = json.loads((tmp_path / "out" / "summary.json").read_text())["diagnosis"]
    return diagnosis, process.stderr


def test_flow_is_the_cause_where_elastic_materials_converge(mpm, tmp_path):
    diagnosis, screen = stopped(mpm, tmp_path, STRIP)
    found = {of["experiment"]: of["converges"] for of in diagnosis["experiments"]}
    assert diagnosis["kind"] == "plastic-collapse" and found["elastic-materials"]
    assert set(found) == {"elastic-materials", "stronger-stabilisation", "half-step"}, "there is no tool"
    assert "\n  evidence: this step converges with elastic materials" in screen


def test_contact_is_the_cause_where_frozen_contact_converges(mpm, tmp_path):
    diagnosis, screen = stopped(mpm, tmp_path, BLOCK)
    found = {of["experiment"]: of["converges"] for of in diagnosis["experiments"]}
    assert diagnosis["kind"] == "sliding"
    assert found["frozen-contact"] and not found["stronger-stabilisation"]
    assert "elastic-materials" not in found, "the material does not flow"
    assert "\n  evidence: this step converges with frozen contact" in screen


def test_experiments_are_no_attempts(mpm, tmp_path):
    (tmp_path / "deck.yaml").write_text(STRIP.replace("every: 0", "every: 1"))
    assert mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out").returncode == 1
    tables = [(tmp_path / "out" / name).read_text().splitlines() for name in ("history.csv", "convergence.csv")]
    attempts = [int(row["step"]) for row in csv.DictReader(tables[0])]
    rows = [int(row["step"]) for row in csv.DictReader(tables[1])]
    assert max(rows) == max(attempts)


def test_a_wall_that_is_pushed_into_clay_takes_few_steps(mpm, tmp_path):
    """Without a search in the second iteration once a step has failed, the run takes 131 steps."""
    (tmp_path / "deck.yaml").write_text(WALL)
    process = mpm("run", tmp_path / "deck.yaml", "--out", tmp_path / "out")
    assert process.returncode == 0, process.stderr
    rows = list(csv.DictReader((tmp_path / "out" / "history.csv").read_text().splitlines()))
    assert len(rows) <= 45
    # The smooth wall squeezes the clay: its weight and 2 s_u over the height. The nodes of the wall stay while the clay
    # moves away from them, so that it carries a little less.
    passive = 0.5 * 1800 * 9.81 * 2**2 + 2 * 45100 * 2
    assert abs(float(rows[-1]["wall_rx"])) == pytest.approx(0.95 * passive, rel=0.03)
