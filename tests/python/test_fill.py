"""Bodies that stages place onto ground that has settled, and bodies that float above it."""

import json

import numpy as np
import pytest

from results import Results

# The ground settles; the lift has no load, so that it stays where the stage places it.
DECK = """
version: 1
analysis: {idealisation: IDEALISATION}
grid: {type: structured, origin: [0, 0], size: [6, 4], spacing: 0.5}
materials:
  clay: {model: hencky, young: YOUNG, poisson: 0, density: 2000}
  fill: {model: hencky, young: 1e6, poisson: 0.3, density: 2000}
bodies:
  - {name: clay, material: clay, method: METHOD, points_per_cell: 2, shape: {type: box, min: [0, 0], max: [6, 2]}}
  - {name: lift, material: fill, method: METHOD, points_per_cell: 2, shape: LIFT}
surfaces: [{name: crest, body: lift, part: {edge: 2}}]
boundary_conditions:
  - {name: sides, nodes: {box: {min: [0, 0], max: [6, 4]}}, fix: [x]}
  - {name: base, nodes: {y: 0}, fix: [y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -10], bodies: [clay]}
  - {name: push, type: traction, surface: crest, traction: [0, -1]}
stages:
  - {name: weight, steps: {count: 4}, factors: {weight: 1}}
  - {name: fill, steps: {count: 1}, add: [ADD], factors: {push: 1}}
"""
BOX = "{type: box, min: [1, 2], max: [4, 3]}"
ONTO = "{body: lift, onto: clay}"


def deck(method="gimp", young="4e5", lift=BOX, add=ONTO, idealisation="plane-strain"):
    text = DECK.replace("METHOD", method).replace("YOUNG", young).replace("LIFT", lift).replace("ADD", add)
    return text.replace("IDEALISATION", idealisation)


@pytest.fixture
def run(mpm, tmp_path):
    def run(text, *arguments, threads=None):
        path, out = tmp_path / "deck.yaml", tmp_path / f"out{len(list(tmp_path.iterdir()))}"
        path.write_text(text)
        process = mpm("run", path, "--out", out, *arguments, threads=threads)
        assert process.returncode == 0, process.stderr
        return Results(out), process.stderr

    return run


def positions(results, body):
    mesh = results.mesh("points", -1)
    chosen = np.asarray(mesh["body_id"]) == body
    return np.asarray(mesh.points)[chosen], np.asarray(mesh["displacement"])[chosen]


def placed(results):
    (entry,) = results.summary["stages"]["placed"]
    assert (entry["stage"], entry["body"], entry["onto"]) == ("fill", "lift", "clay")
    return entry


@pytest.mark.parametrize("idealisation", ["plane-strain", "axisymmetric"])
@pytest.mark.parametrize("method", ["mpm", "gimp", "cpdi1", "cpdi2"])
def test_a_lift_stands_on_ground_that_has_settled_evenly(run, method, idealisation):
    results, text = run(deck(method, idealisation=idealisation))
    clay, moved = positions(results, 0)
    # A column under its own weight, exact for these steps: u(Y) = ∫ (exp(σ/E) − 1) with the points at the top.
    top = clay[:, 1].max()
    stretch = 1 + (moved[:, 1].max() - moved[:, 1].min())
    assert moved[:, 1].min() < -0.05, stretch
    lift, way = positions(results, 1)
    low = lift[:, 1].min()
    # The top point of the clay lies a quarter of a cell below its surface, slightly less because it is compressed.
    assert low - top == pytest.approx(0.25, abs=2e-3)
    assert lift[:, 1].max() - low == pytest.approx(0.75, abs=1e-4), "its thickness stays"
    assert np.abs(way).max() < 1e-3, "the way onto the ground is no displacement"
    entry = placed(results)
    assert entry["moved"][0] == pytest.approx(entry["moved"][2], abs=1e-9)
    assert entry["moved"][1] == pytest.approx(low - 2.125, abs=1e-3)
    radius = 2 * np.pi * 2.5 if idealisation == "axisymmetric" else 1
    assert entry["volume"] == pytest.approx(3 * radius)
    assert "body `lift`, of volume" in text and "is placed onto `clay`" in text
    assert "W022" not in text


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
def test_columns_follow_ground_that_has_settled_unevenly(run, method):
    results, _ = run(deck(method, young="2e5 + 2e5*X"))
    clay, _ = positions(results, 0)
    lift, _ = positions(results, 1)
    gaps = []
    for x in np.unique(np.round(lift[:, 0], 6)):
        above = lift[np.abs(lift[:, 0] - x) < 1e-3, 1]
        below = clay[np.abs(clay[:, 0] - x) < 1e-3, 1]
        gaps.append(above.min() - below.max())
        assert above.max() - above.min() == pytest.approx(0.75, abs=1e-3)
    entry = placed(results)
    assert entry["moved"][0] < 2 * entry["moved"][2] < 0, "the ground has settled more on the left"
    assert np.allclose(gaps, 0.25, atol=5e-3), gaps


def test_a_sloping_lift_is_moved_by_columns(run):
    shape = "{type: polygon, vertices: [[1, 2], [5, 2], [4, 3], [2, 3]]}"
    results, _ = run(deck("gimp", lift=shape))
    entry = placed(results)
    assert entry["moved"][0] == pytest.approx(entry["moved"][2], abs=1e-9)


def test_a_lift_drawn_above_the_ground_is_brought_down(run):
    lift = "{type: box, min: [1, 2.5], max: [4, 3.5]}"
    high, _ = run(deck(lift=lift))
    low, _ = run(deck())
    assert placed(high)["moved"][1] == pytest.approx(placed(low)["moved"][1] - 0.5, abs=1e-9)


def test_without_onto_a_gap_is_reported_with_its_size(run):
    results, text = run(deck(add="lift"))
    settled = -placed(run(deck())[0])["moved"][1]
    (warning,) = [of for of in results.summary["warnings"] if of["code"] == "W022"]
    assert warning["value"] == pytest.approx(settled / 0.5, rel=1e-6)
    assert f"up to {settled:.4f} above the current surface of `clay`" in text
    assert "`add: [{body: lift, onto: clay}]`" in text
    stiff, text = run(deck(add="lift", young="4e7"))
    assert "W022" not in text and "placed" not in stiff.summary["stages"]


def test_an_overlap_is_reported(run):
    text = deck(add="lift", young="4e7").replace("nodes: {y: 0}, fix: [y]", "nodes: {y: 0}, uy: 0.1")
    text = text.replace("factors: {weight: 1}", "factors: {base: 1}")
    results, text = run(text)
    (warning,) = [of for of in results.summary["warnings"] if of["code"] == "W022"]
    assert warning["value"] == pytest.approx(0.2, abs=1e-3)
    assert "up to 0.1000 below the current surface of `clay`" in text


def test_the_number_of_threads_does_not_matter(run):
    moved = []
    for threads in [1, 2]:
        results, _ = run(deck("cpdi2", young="2e5 + 2e5*X"), threads=threads)
        moved.append((json.dumps(placed(results)), positions(results, 1)[0].tobytes()))
    assert moved[0] == moved[1]


SOLID = """
version: 1
analysis: {idealisation: solid}
grid: {type: structured, origin: [0, 0, 0], size: [3, 2, 2], spacing: 0.5}
materials: {m: {model: hencky, young: "2e5 + 2e5*Z", poisson: 0, density: 2000}}
bodies:
  - {name: clay, material: m, method: METHOD, points_per_cell: 2, shape: {type: box, min: [0, 0, 0], max: [2, 2, 2]}}
  - {name: lift, material: m, method: METHOD, points_per_cell: 2, shape: {type: box, min: [2, 0, 0], max: [2.5, 1, 2]}}
boundary_conditions:
  - {name: sides, nodes: {box: {min: [0, 0, 0], max: [3, 2, 2]}}, fix: [y, z]}
  - {name: base, nodes: {x: 0}, fix: [x]}
loads: [{name: weight, type: gravity, acceleration: [-10, 0, 0], bodies: [clay]}]
stages:
  - {name: weight, steps: {count: 3}, factors: {weight: 1}}
  - {name: fill, steps: {count: 1}, add: [{body: lift, onto: clay}]}
"""


@pytest.mark.parametrize("method", ["gimp", "cpdi2"])
def test_up_is_opposite_to_gravity_in_space(run, method):
    results, _ = run(SOLID.replace("METHOD", method))
    clay, _ = positions(results, 0)
    lift, _ = positions(results, 1)
    for z in np.unique(np.round(lift[:, 2], 6)):
        above = lift[np.abs(lift[:, 2] - z) < 1e-3, 0]
        below = clay[np.abs(clay[:, 2] - z) < 1e-3, 0]
        assert above.min() - below.max() == pytest.approx(0.25, abs=5e-3)
    entry = placed(results)
    assert entry["moved"][0] < 1.2 * entry["moved"][2] < 0 and entry["volume"] == pytest.approx(1)
